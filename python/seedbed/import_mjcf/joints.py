"""Joints of MJCF as joints of the task file."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .bodies import Bodies
from .names import Names
from .plane import TOLERANCE, Array, Plane
from .source import Source

DEFAULT_SOLREF = (0.02, 1.0)
"""MuJoCo's time constant (s) and damping ratio."""

DEFAULT_SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)
"""MuJoCo's dmin, dmax, width, midpoint and power."""

MOST_DMAX = 0.9999
"""MuJoCo's largest impedance."""


@dataclass
class Joint:
    """A joint of the task file. Lengths in m, angles in rad.

    Attributes:
        index: Its number in the model; None for a weld.
        body: Number of the child in the model.
        name: Its name in the file.
        kind: "slide", "hinge" or "weld".
        direction: Axis of a slide in the child's frame, `[2]`.
        is_clockwise: Whether a hinge's coordinate grows clockwise.
        anchor: Position of a hinge in the child's frame, `[2]`.
        reference: MuJoCo's coordinate at the reference pose, where that of the file is 0.
        range: Range of the coordinate, or None.
        softness: Natural frequency (Hz) and damping ratio of the ends of the range.
        springref: Coordinate at which the spring is at rest.
        forces: Terms of a formula of the force along the coordinate.
    """

    index: int | None
    body: int
    name: str
    kind: str
    direction: Array
    is_clockwise: bool
    anchor: Array
    reference: float = 0.0
    range: tuple[float, float] | None = None
    softness: tuple[float, float] | None = None
    damping: float = 0.0
    frictionloss: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    springref: float = 0.0
    forces: list[str] | None = None

    @property
    def start(self) -> float:
        """The coordinate of its range that is nearest to the reference pose."""
        low, high = self.range or (0.0, 0.0)
        return min(max(0.0, low), high)


def find_joints(source: Source, plane: Plane, bodies: Bodies) -> list[Joint]:
    """All joints in the order of the model, and a weld for each body without one."""
    names = Names()
    joints = []
    for index in bodies.bodies:
        own = own_joints(source, index)
        check_combination(source, plane, index, own)
        joints += [moving_joint(source, plane, bodies, joint, names) for joint in own]
        if not own:
            joints.append(weld(bodies, index, names))
    return joints


def own_joints(source: Source, body: int) -> list[int]:
    """Numbers of the joints of a body."""
    first = int(source.model.body_jntadr[body])
    return list(range(first, first + int(source.model.body_jntnum[body])))


def check_combination(source: Source, plane: Plane, body: int, joints: list[int]) -> None:
    """The joints of a body are up to two slides with perpendicular axes, then at most one hinge."""
    kinds = [source.kind_of("mjtJoint", "mjJNT_", source.model.jnt_type[joint]) for joint in joints]
    if not set(kinds) <= {"slide", "hinge"}:
        return
    labels = ", ".join(source.label("joint", joint) for joint in joints)
    slides = ", ".join(source.label("joint", joint) for joint in joints[:2])
    expected = "expected up to two slides, then at most one hinge"
    if "".join(kind[0] for kind in kinds) not in ("", "s", "h", "sh", "ss", "ssh"):
        kinds_text = ", ".join(kinds)
        source.report.error(source.label("body", body), f"its joints {labels} are {kinds_text}: {expected}")
    elif kinds[:2] == ["slide", "slide"]:
        axes = [plane.project(source.data.xaxis[joint]) for joint in joints[:2]]
        if abs(axes[0] @ axes[1]) > TOLERANCE:
            message = f"its slides {slides} are not perpendicular: {expected}, and slides along perpendicular axes"
            source.report.error(source.label("body", body), message)


def weld(bodies: Bodies, body: int, names: Names) -> Joint:
    name = names.unique(f"{bodies.name(body)}_weld", "weld")
    return Joint(None, body, name, "weld", np.zeros(2), False, np.zeros(2))


def moving_joint(source: Source, plane: Plane, bodies: Bodies, index: int, names: Names) -> Joint:
    model, data = source.model, source.data
    body = int(model.jnt_bodyid[index])
    kind = source.kind_of("mjtJoint", "mjJNT_", model.jnt_type[index])
    frame = bodies.frame(body)
    direction = frame.direction(plane.project(data.xaxis[index])) if kind == "slide" else np.zeros(2)
    anchor = frame.point(plane.project(data.xanchor[index])) if kind == "hinge" else np.zeros(2)
    name = names.unique(source.name("joint", index), f"{bodies.name(body)}_{kind}")
    is_clockwise = kind == "hinge" and plane.depth(data.xaxis[index]) < 0
    joint = Joint(index, body, name, kind, direction, is_clockwise, anchor)
    joint.reference = float(model.qpos0[model.jnt_qposadr[index]])
    set_passive_forces(source, joint, index)
    set_range(source, joint, index)
    return joint


def set_passive_forces(source: Source, joint: Joint, index: int) -> None:
    model = source.model
    degree = int(model.jnt_dofadr[index])
    check_passive_forces(source, index, degree)
    joint.armature = float(model.dof_armature[degree])
    if not (source.is_disabled("damper") or source.is_disabled("passive")):
        joint.damping = float(model.dof_damping[degree])
    if not (source.is_disabled("spring") or source.is_disabled("passive")):
        joint.stiffness = float(model.jnt_stiffness[index])
        joint.springref = float(model.qpos_spring[model.jnt_qposadr[index]]) - joint.reference
    if not (source.is_disabled("frictionloss") or source.is_disabled("constraint")):
        joint.frictionloss = float(model.dof_frictionloss[degree])
    if joint.frictionloss:
        report_friction(source, index, degree)


def report_friction(source: Source, index: int, degree: int) -> None:
    """How MuJoCo's dry friction creeps is not expressible."""
    model = source.model
    if not np.allclose(model.dof_solref[degree], DEFAULT_SOLREF):
        source.report.warning(source.label("joint", index), "solreffriction is left out")
    if not np.allclose(model.dof_solimp[degree], DEFAULT_SOLIMP):
        source.report.warning(source.label("joint", index), "solimpfriction is left out")


def check_passive_forces(source: Source, index: int, degree: int) -> None:
    model = source.model
    values = {
        "damping with more than one number": source.array("dof_dampingpoly", 0.0, model.nv)[degree],
        "stiffness with more than one number": source.array("jnt_stiffnesspoly", 0.0, model.njnt)[index],
        "springyield": source.array("jnt_springyield", 0.0, model.njnt)[index],
        "actuatorgravcomp": source.array("jnt_actgravcomp", 0.0, model.njnt)[index],
    }
    for name, value in values.items():
        if np.any(value):
            source.report.error(source.label("joint", index), f"{name} is not expressible: expected to leave it out")


def set_range(source: Source, joint: Joint, index: int) -> None:
    model = source.model
    if not model.jnt_limited[index] or source.is_disabled("limit") or source.is_disabled("constraint"):
        return
    low, high = (float(end) - joint.reference for end in model.jnt_range[index])
    joint.range = (low, high)
    joint.softness = softness(
        source, source.label("joint", index), model.jnt_solref[index], float(model.jnt_solimp[index][1])
    )
    if model.jnt_margin[index] != 0:
        source.report.warning(source.label("joint", index), "margin is left out")
    if not has_default_shape(model.jnt_solimp[index]):
        source.report.warning(source.label("joint", index), "of solimplimit only dmax, its second number, is used")
    if not low <= 0 <= high:
        message = f"the reference pose is outside of its range: episodes start at its nearest end, {joint.start:.6g}"
        source.report.warning(source.label("joint", index), message)


def has_default_shape(solimp: Array) -> bool:
    """Whether an impedance is MuJoCo's default, apart from its largest value dmax, which sets the softness."""
    others = [0, 2, 3, 4]
    return np.allclose(np.array(solimp)[others], np.array(DEFAULT_SOLIMP)[others])


def softness(
    source: Source, label: str, solref: Array | tuple[float, float], dmax: float
) -> tuple[float, float] | None:
    """Natural frequency (Hz) and damping ratio of a spring that acts like MuJoCo's constraint.

    MuJoCo's constraint removes the share d, at most dmax, of the acceleration a that other forces cause, and adds that of a
    spring. It yields to a lasting force by (1 - dmax) timeconst² dampratio² a, and recovers, for a damping ratio of 1, as
    exp(-t / timeconst). A spring of the frequency 1 / (2 π timeconst dampratio √(1 - dmax)) and the damping ratio
    dampratio / (2 √(1 - dmax)) yields as far and recovers as fast.

    As in MuJoCo, the time constant is at least two time steps; negative numbers are the stiffness and damping of a unit mass.

    Returns:
        The two numbers, or None if they are not expressible.
    """
    first, second = float(solref[0]), float(solref[1])
    stiffer = 1 / math.sqrt(1 - min(dmax, MOST_DMAX))
    if first > 0 and second > 0:
        shortest = 0.0 if source.is_disabled("refsafe") else 2 * float(source.model.opt.timestep)
        return stiffer / (2 * math.pi * max(first, shortest) * second), second * stiffer / 2
    if first < 0 and second < 0:
        frequency = math.sqrt(-first)
        return stiffer * frequency / (2 * math.pi), -second / (2 * frequency) * stiffer / 2
    source.report.warning(label, f'solref="{first:g} {second:g}" is left out: expected two numbers larger than 0')
    return None
