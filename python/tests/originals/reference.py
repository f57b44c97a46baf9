"""Helpers that compare tasks with the same models in MuJoCo."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import seedbed

ENVS = Path(__file__).resolve().parents[3] / "envs"

Vector = NDArray[np.float64]
"""One number per coordinate or control."""

Names = dict[str, tuple[str, float]]
"""Names of MuJoCo's joints, each with the name of the coordinate in the task and its sign in it (1 or -1)."""


def same_names(model: Any) -> Names:
    """All joints of a model, for a task whose coordinates have the same names and directions."""
    return {model.joint(joint).name: (model.joint(joint).name, 1.0) for joint in range(model.njnt)}


def start_options(model: Any, qpos: Vector, qvel: Vector, names: Names | None = None) -> dict[str, dict[str, float]]:
    """The options with which `Env.reset` starts an episode in a state of MuJoCo.

    Args:
        model: The model: all joints have one coordinate.
        qpos: MuJoCo's positions, m or rad, `[joints]`. Coordinates of tasks are 0 in MuJoCo's reference pose `qpos0`.
        qvel: MuJoCo's velocities, m/s or rad/s, `[joints]`.
        names: By default `same_names`.
    """
    options: dict[str, dict[str, float]] = {"positions": {}, "velocities": {}}
    for joint, (name, sign) in (names or same_names(model)).items():
        index = model.joint(joint).id
        options["positions"][name] = sign * float(qpos[index] - model.qpos0[index])
        options["velocities"][name] = sign * float(qvel[index])
    return options


def mujoco_state(env: seedbed.Env, model: Any, names: Names | None = None) -> tuple[Vector, Vector]:
    """MuJoCo's positions and velocities in the current state of an environment, `[joints]` each."""
    coordinates = env.coordinates()
    qpos, qvel = np.array(model.qpos0), np.zeros(model.nv)
    for joint, (name, sign) in (names or same_names(model)).items():
        index = model.joint(joint).id
        qpos[index] += sign * coordinates["positions"][name]
        qvel[index] = sign * coordinates["velocities"][name]
    return qpos, qvel


def without_contacts(text: str) -> str:
    """The text of a task in which nothing touches, joints have no range, and there are no ropes.

    Its joints are simulated in the same way: a floor far away keeps the coordinates that soft ranges of hinges need.
    """
    text = re.sub(r"\n    ropes: .*", "", text)
    soft_hinge = re.search(r"type: Hinge\([^()]*\),\s*range: \([^()]*\), range_softness", text)
    if soft_hinge and "\n    colliders: " not in text:
        floor = "\n    colliders: [(geom: HalfSpace(point: (0.0, -1e3), normal: (0.0, 1.0)))],"
        text = text.replace("\n    bodies: ", floor + "\n    bodies: ")
    text = re.sub(r", contype: \d+, conaffinity: \d+", "", text)
    text = re.sub(r"\bgeom: ", "contype: 0, conaffinity: 0, geom: ", text)
    joints, actuators = text.index("\n    joints: ["), text.index("\n    actuators: [")
    free = re.sub(r"\brange(_softness)?: \([^()]*\),", "", text[joints:actuators])
    return text[:joints] + free + text[actuators:]


def with_iterations(text: str, factor: int) -> str:
    """The text of a task with more substeps per control step."""
    return re.sub(r"\biterations: (\d+)", lambda match: f"iterations: {factor * int(match[1])}", text)


def make_text(text: str, folder: Path) -> seedbed.Env:
    """An environment of the task with this text, which is written to a file in `folder`."""
    path = folder / "task.ron"
    path.write_text(text)
    return seedbed.make(path)


def free_motion(model: Any, qpos: Vector, qvel: Vector, controls: Vector, control_step: float) -> Vector:
    """How a model moves in MuJoCo without contacts and limits, integrated accurately.

    Args:
        model: The model, whose options are changed.
        qpos: Positions at the start, `[joints]`.
        qvel: Velocities at the start, `[joints]`.
        controls: Controls of each control step, `[steps, controls]`.
        control_step: Time of a control step, s.

    Returns:
        Positions, then velocities, after each control step, `[steps, 2 joints]`.
    """
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    substeps = round(control_step / 5e-4)
    model.opt.timestep = control_step / substeps
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    states = []
    for control in controls:
        data.ctrl[:] = control
        mujoco.mj_step(model, data, substeps)
        states.append(np.concatenate([data.qpos, data.qvel]))
    return np.array(states)


def task_motion(env: seedbed.Env, model: Any, qpos: Vector, qvel: Vector, controls: Vector, names: Names | None = None) -> Vector:
    """How a task moves from a state of MuJoCo: as `free_motion`, in MuJoCo's coordinates."""
    env.reset(options=start_options(model, qpos, qvel, names))
    states = []
    for control in controls:
        env.step(np.asarray(control, np.float32))
        states.append(np.concatenate(mujoco_state(env, model, names)))
    return np.array(states)
