"""The motion of a converted model beside MuJoCo's."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .contacts import Contacts
from .conversion import Conversion, Coordinate
from .joints import Joint
from .plane import Array
from .report import MjcfError
from .ron import quoted
from .writing import task_text

STEPS = (1, 10, 100)
"""Numbers of control steps after which the two are compared."""

REFINEMENTS = (1, 2, 4)
"""Factors of the solver's iterations."""

FINER = 10
"""MuJoCo's motion without contacts and ranges is computed by RK4 with steps that are this many times shorter."""

FINER_IMPLICIT = 100
"""The same where damping is so strong that RK4 would be unstable, by the integrator implicitfast."""

STABLE = 1.0
"""Largest damping times step by inertia for which RK4 is used; it is unstable from about 2.8."""

SEED = 0


@dataclass(frozen=True)
class Start:
    """Coordinates of the task file, by name of the joint: m or rad, and m/s or rad/s. Others are at rest in the reference pose."""

    positions: dict[str, float]
    velocities: dict[str, float]


@dataclass(frozen=True)
class Motion:
    """Coordinates after each control step, in the order of `Conversion.coordinates`.

    Attributes:
        positions: MuJoCo's coordinates, `[steps + 1, coordinates]`, m or rad.
        velocities: Their velocities, `[steps + 1, coordinates]`.
    """

    positions: Array
    velocities: Array

    def differences(self, other: Motion, steps: int) -> tuple[float, float]:
        """Largest difference of positions and of velocities over the first control steps."""
        positions = np.abs(self.positions - other.positions)[: steps + 1]
        velocities = np.abs(self.velocities - other.velocities)[: steps + 1]
        return float(positions.max(initial=0.0)), float(velocities.max(initial=0.0))


def check_task(conversion: Conversion, text: str) -> None:
    """Check the task file as `seedbed check` does.

    Raises:
        MjcfError: The task file is not correct.
    """
    environment_of(conversion, text).close()


def comparison_text(conversion: Conversion, text: str) -> str:
    """A table of differences between the motion of the task and that of MuJoCo, for random controls.

    Raises:
        MjcfError: The task file is not correct.
    """
    if not conversion.actuators:
        return "The motion is not compared with MuJoCo's: the model has no actuators."
    controls = random_controls(conversion, max(STEPS))
    start = reference_start(conversion)
    lines = [
        f"Largest differences from MuJoCo within {', '.join(map(str, STEPS))} control steps of random controls "
        f"from {'the reference pose' if not start.positions else 'the start pose'}:",
        f"{'':50}{'positions (m, rad)':>30}{'velocities (m/s, rad/s)':>32}",
    ]
    as_it_is = mujoco_motion(conversion, start, controls)
    lines.append(row("the model as it is", motion(conversion, start, controls, text), as_it_is))
    exact = mujoco_motion(conversion, start, controls, is_free=True)
    free = without_constraints(conversion)
    title = "ranges, contacts and ropes off" if is_constrained(conversion) else "MuJoCo with shorter steps"
    for factor in REFINEMENTS:
        finer = replace(free, options=replace(free.options, refinement=factor))
        label = f"{title}, {factor} x iterations"
        lines.append(row(label, motion(finer, start, controls), exact))
    shorter, integrator = fine_integrator(conversion)
    lines.append(
        f"(The last {len(REFINEMENTS)} lines: MuJoCo with {integrator} and 1/{shorter} of its timestep. "
        "An error of first order is halved from line to line.)"
    )
    lines += reasons(conversion)
    return "\n".join(lines)


def reasons(conversion: Conversion) -> list[str]:
    """Why the error of the last lines may not be halved."""
    rubbing = [joint.name for joint in conversion.joints if joint.frictionloss]
    hinges = [joint for joint in conversion.joints if joint.kind == "hinge"]
    wrapping = [joint.name for joint in hinges if joint.range and (joint.stiffness or has_position_servo(conversion, joint))]
    lines = []
    if rubbing:
        lines.append(f"(frictionloss of {', '.join(rubbing)}: dry friction lets a joint creep in both programs, each by its own amount.)")
    if wrapping:
        lines.append(
            f"({', '.join(wrapping)}: without ranges a hinge may turn by more than half a turn; springs and servos then pull the shorter "
            "way around, unlike MuJoCo's.)"
        )
    return lines


def has_position_servo(conversion: Conversion, joint: Joint) -> bool:
    start = f"PositionServo(joint: {quoted(joint.name)}, "
    return any(actuator.kind.startswith(start) for actuator in conversion.actuators)


def row(title: str, ours: Motion, theirs: Motion) -> str:
    found = [ours.differences(theirs, steps) for steps in STEPS]
    positions = "".join(f"{position:>10.1e}" for position, _ in found)
    velocities = "".join(f"{velocity:>10.1e}" for _, velocity in found)
    return f"{title:50}{positions}  {velocities}"


def is_constrained(conversion: Conversion) -> bool:
    """Whether a joint has a range, or bodies can touch or hang on ropes."""
    return bool(conversion.contacts.surfaces or conversion.ropes or any(joint.range for joint in conversion.joints))


def without_constraints(conversion: Conversion) -> Conversion:
    """The same model without contacts, ranges and ropes."""
    joints = [replace(joint, range=None, softness=None) for joint in conversion.joints]
    contacts = Contacts({}, None, [])
    return replace(conversion, joints=joints, contacts=contacts, contact_softness=None, ropes=[])


def reference_start(conversion: Conversion) -> Start:
    """The reference pose; joints whose range does not contain it are at its nearest end."""
    positions = {joint.name: joint.start for joint in conversion.joints if joint.start}
    return Start(positions, {})


def random_controls(conversion: Conversion, steps: int) -> Array:
    """Controls of the task, uniform in their ranges, exact in float32: `[steps, actuators]`."""
    limits = np.array([actuator.control for actuator in conversion.actuators]).reshape(-1, 2)
    shares = np.random.default_rng(SEED).random((steps, len(limits)))
    controls = limits[:, 0] + shares * (limits[:, 1] - limits[:, 0])
    return np.array(controls.astype(np.float32), dtype=np.float64)


# This package


def motion(conversion: Conversion, start: Start, controls: Array, text: str | None = None) -> Motion:
    """The motion of the task under controls `[steps, actuators]`.

    Raises:
        MjcfError: The task file is not correct.
    """
    environment = environment_of(conversion, text or task_text(conversion))
    options = {"positions": start.positions, "velocities": start.velocities, "numbers": {}}
    observation, _ = environment.reset(seed=SEED, options=options)
    found = [observation]
    for control in controls:
        observation, *_ = environment.step(control.astype(np.float32))
        found.append(observation)
    positions, velocities = np.split(np.array(found, dtype=np.float64), 2, axis=1)
    return Motion(positions, velocities)


def environment_of(conversion: Conversion, text: str) -> Any:
    """The task as an environment without time limit."""
    import seedbed

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{conversion.source.path.stem}.ron"
        path.write_text(text, encoding="utf-8")
        try:
            return seedbed.make(path, max_episode_steps=-1)
        except seedbed.TaskError as error:
            message = str(error).replace(f"{folder}/", "")
            raise MjcfError(
                [f"{conversion.source.report.file}: the converted file is not correct: {message}"]
            ) from None


# MuJoCo


def mujoco_motion(conversion: Conversion, start: Start, controls: Array, is_free: bool = False) -> Motion:
    """MuJoCo's motion under controls of the task `[steps, actuators]`.

    Args:
        is_free: Without contacts and limits, and with short steps of an accurate integrator.
    """
    source = conversion.source
    with source.warnings_reported(), changed_options(conversion, is_free) as skip:
        data = source.mujoco.MjData(source.model)
        set_start(conversion, data, start)
        found = [state(conversion.coordinates, source.model, data)]
        for control in controls:
            for actuator, value in zip(conversion.actuators, control, strict=True):
                data.ctrl[actuator.control_index] = value + actuator.shift
            source.mujoco.mj_step(source.model, data, skip)
            found.append(state(conversion.coordinates, source.model, data))
    positions, velocities = (np.array(part) for part in zip(*found, strict=True))
    return Motion(positions, velocities)


@contextmanager
def changed_options(conversion: Conversion, is_free: bool) -> Iterator[int]:
    """MuJoCo's options while a motion is computed; the value is the number of steps per control step."""
    mujoco, option = conversion.source.mujoco, conversion.source.model.opt
    saved = (option.disableflags, option.timestep, option.integrator)
    factor, integrator = fine_integrator(conversion)
    if is_free:
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        option.timestep /= factor
        option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    try:
        yield conversion.options.frame_skip * (factor if is_free else 1)
    finally:
        option.disableflags, option.timestep, option.integrator = saved


def fine_integrator(conversion: Conversion) -> tuple[int, str]:
    """By which factor time steps are shorter, and the integrator, where MuJoCo's motion is computed finely."""
    model = conversion.source.model
    rates = np.array(model.dof_damping) / np.array(model.dof_M0)
    is_stable = rates.max(initial=0.0) * model.opt.timestep / FINER < STABLE
    return (FINER, "RK4") if is_stable else (FINER_IMPLICIT, "implicitfast")


def set_start(conversion: Conversion, data: Any, start: Start) -> None:
    model = conversion.source.model
    for joint in conversion.joints:
        if joint.index is not None:
            data.qpos[model.jnt_qposadr[joint.index]] = joint.reference + start.positions.get(joint.name, 0.0)
            data.qvel[model.jnt_dofadr[joint.index]] = start.velocities.get(joint.name, 0.0)


def state(coordinates: list[Coordinate], model: Any, data: Any) -> tuple[Array, Array]:
    """Positions and velocities of all coordinates, `[coordinates]` each."""

    def values(array: Any, addresses: Any) -> Array:
        return np.array([array[addresses[one.joint.index]] for one in coordinates])

    return values(data.qpos, model.jnt_qposadr), values(data.qvel, model.jnt_dofadr)
