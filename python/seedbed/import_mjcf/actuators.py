"""Actuators and tendons of MJCF as actuators, forces and ropes of the task file."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import ron
from .bodies import Bodies
from .joints import DEFAULT_SOLIMP, DEFAULT_SOLREF, Joint
from .names import Names
from .plane import Array, Plane
from .source import Source

@dataclass
class Actuator:
    """An actuator of the task file.

    Attributes:
        index: Its number in the model.
        control_index: Number of its control in MuJoCo's `ctrl`.
        name: Its name in the file.
        kind: Its type, as text of the file.
        gear: Factor of the control.
        control: Range of the control.
        shift: MuJoCo's control is that of the file plus this.
        unit: Unit of the control.
    """

    index: int
    control_index: int
    name: str
    kind: str
    gear: float
    control: tuple[float, float]
    shift: float
    unit: str


@dataclass
class Rope:
    """A rope of the task file: names and points `[2]` of its ends, and its length (m)."""

    index: int
    name: str
    bodies: tuple[str, str]
    points: tuple[Array, Array]
    length: float


@dataclass
class Law:
    """The force of an actuator: gain × control − stiffness × length − damping × velocity, all before its gear."""

    gain: float
    stiffness: float
    damping: float


@dataclass
class Drive:
    """What an actuator of the model does, wherever it acts."""

    source: Source
    index: int
    control_index: int
    law: Law
    control: tuple[float, float]
    gear: float

    @property
    def label(self) -> str:
        return self.source.label("actuator", self.index)

    def actuator(self, name: str, kind: str, gear: float = 1.0, shift: float = 0.0, unit: str = "") -> Actuator:
        """The actuator of the task file, whose control is MuJoCo's less `shift`."""
        low, high = self.control
        return Actuator(self.index, self.control_index, name, kind, gear, (low - shift, high - shift), shift, unit)


def find_actuators(source: Source, joints: list[Joint], names: Names) -> list[Actuator]:
    """All actuators that are not disabled. Those on tendons add to the forces of joints."""
    if source.is_disabled("actuation"):
        source.report.warning("option", 'flag actuation="disable": all actuators are left out')
        return []
    by_index = {joint.index: joint for joint in joints if joint.index is not None}
    found = [actuator(source, index, by_index, names) for index in range(source.model.actuator_trntype.shape[0])]
    check_joint_limits(source, by_index)
    return [one for one in found if one is not None]


def actuator(source: Source, index: int, joints: dict[int, Joint], names: Names) -> Actuator | None:
    """One actuator, or None if it is disabled or not expressible."""
    model = source.model
    label = source.label("actuator", index)
    group = int(model.actuator_group[index])
    if 0 <= group < 31 and model.opt.disableactuator & (1 << group):
        source.report.warning(label, f"its group {group} is disabled: it is left out")
        return None
    law = find_law(source, index)
    control_index = int(source.array("actuator_ctrladr", 0, 0)[index]) if hasattr(model, "actuator_ctrladr") else index
    control = find_control(source, index, control_index)
    transmission = source.kind_of("mjtTrn", "mjTRN_", model.actuator_trntype[index])
    if law is None or control is None:
        return None
    drive = Drive(source, index, control_index, law, control, gear_of(source, index))
    if transmission in ("joint", "jointinparent"):
        joint = joints.get(int(model.actuator_trnid[index][0]))
        return None if joint is None else on_joint(drive, joint, names)
    if transmission == "tendon":
        return on_tendon(drive, joints, names)
    source.report.error(label, f"it acts on a {transmission}: expected a joint, or a <fixed> tendon")
    return None


def find_law(source: Source, index: int) -> Law | None:
    """The law of the force, or None if it is not expressible."""
    model = source.model
    label = source.label("actuator", index)
    dynamics = source.kind_of("mjtDyn", "mjDYN_", model.actuator_dyntype[index])
    gain = source.kind_of("mjtGain", "mjGAIN_", model.actuator_gaintype[index])
    bias = source.kind_of("mjtBias", "mjBIAS_", model.actuator_biastype[index])
    parameters = np.array(model.actuator_biasprm[index][:3]) if bias == "affine" else np.zeros(3)
    problems = {
        f'dyntype="{dynamics}": activations are not expressible, expected "none"': dynamics != "none",
        f'gaintype="{gain}", expected "fixed"': gain != "fixed",
        f'biastype="{bias}", expected "none" or "affine"': bias not in ("none", "affine"),
        f"its biasprm begins with {parameters[0]:g}, expected 0": parameters[0] != 0,
        "its biasprm pushes away, expected a second and a third number of at most 0": max(parameters[1:]) > 0,
        "a delay is not expressible, expected 0": bool(np.any(source.array("actuator_delay", 0.0, index + 1)[index])),
        "a plugin is not expressible": model.actuator_plugin[index] >= 0,
        "damping and armature of an actuator are not expressible: expected them at the joint": has_passive(
            source, index
        ),
    }
    found = [problem for problem, is_found in problems.items() if is_found]
    for problem in found:
        source.report.error(label, problem)
    return None if found else Law(float(model.actuator_gainprm[index][0]), -float(parameters[1]), -float(parameters[2]))


def has_passive(source: Source, index: int) -> bool:
    names = ("actuator_damping", "actuator_dampingpoly", "actuator_armature")
    return any(bool(np.any(source.array(name, 0.0, index + 1)[index])) for name in names)


def find_control(source: Source, index: int, control_index: int) -> tuple[float, float] | None:
    model = source.model
    if not model.actuator_ctrllimited[control_index] or source.is_disabled("clampctrl"):
        source.report.error(
            source.label("actuator", index), 'its control is not limited: expected a ctrlrange="LOW HIGH"'
        )
        return None
    low, high = (float(end) for end in model.actuator_ctrlrange[control_index])
    return low, high


def gear_of(source: Source, index: int) -> float:
    model = source.model
    output = int(model.actuator_outadr[index]) if hasattr(model, "actuator_outadr") else index
    return float(model.actuator_gear[output][0])


def on_joint(drive: Drive, joint: Joint, names: Names) -> Actuator | None:
    """A motor, or a servo whose control is a position or a velocity."""
    law = drive.law
    if law.stiffness == law.damping == 0:
        return motor(drive, joint, names)
    if drive.gear == 0 or law.gain == 0:
        drive.source.report.error(drive.label, "its control has no effect: expected a gear and a gainprm other than 0")
        return None
    limit = servo_limit(drive)
    return None if limit is None else servo(drive, joint, names, limit)


def motor(drive: Drive, joint: Joint, names: Names) -> Actuator | None:
    if not is_force_unlimited(drive):
        return None
    name = unique_name(drive, names, joint, "torque" if joint.kind == "hinge" else "force")
    return drive.actuator(name, f"JointForce({ron.quoted(joint.name)})", drive.gear * drive.law.gain)


def servo(drive: Drive, joint: Joint, names: Names, limit: float) -> Actuator:
    """A servo of the coordinate q of the task file: the length that MuJoCo's law is about is gear × (q + reference)."""
    law, gear = drive.law, drive.gear
    is_position = law.stiffness > 0
    stiffness = [f"kp: {ron.number(gear * gear * law.stiffness)}"] if is_position else []
    limits = [f"force_limit: {ron.number(limit)}"] if math.isfinite(limit) else []
    fields = [f"joint: {ron.quoted(joint.name)}", *stiffness, f"kv: {ron.number(gear * gear * law.damping)}", *limits]
    factor = law.gain / (gear * (law.stiffness or law.damping))
    shift = joint.reference / factor if is_position else 0.0
    if is_position:
        report_target(drive, joint, factor, shift)
    unit = {"hinge": "rad", "slide": "m"}[joint.kind] + ("" if is_position else "/s")
    kind = f"{'PositionServo' if is_position else 'VelocityServo'}({', '.join(fields)})"
    name = unique_name(drive, names, joint, "target")
    return drive.actuator(name, kind, factor, shift, unit if factor == 1 else "")


def report_target(drive: Drive, joint: Joint, factor: float, shift: float) -> None:
    """What differs from MuJoCo's target of a position servo."""
    if shift:
        message = f"its target counts from the reference pose: the control is that of MuJoCo less {shift:.6g}"
        drive.source.report.warning(drive.label, message)
    farthest = max(abs(end) for end in drive.control)
    if joint.kind == "hinge" and farthest > 2 * math.pi:
        message = f"its target goes to {farthest:g} rad: MuJoCo does not convert ctrlrange from degrees"
        drive.source.report.warning(drive.label, message)


def unique_name(drive: Drive, names: Names, joint: Joint, suffix: str) -> str:
    """The actuator's own name; if it has none, or a sensor has it, with what the control means."""
    own = drive.source.name("actuator", drive.index)
    wanted = own if own and not names.has(own) else f"{own or joint.name}_{suffix}"
    return names.unique(wanted, f"actuator{drive.index}")


def is_force_unlimited(drive: Drive) -> bool:
    """Whether a motor's forcerange never binds; otherwise it is an error."""
    model = drive.source.model
    if not model.actuator_forcelimited[drive.index]:
        return True
    low, high = model.actuator_forcerange[drive.index]
    forces = [drive.law.gain * end for end in drive.control]
    if low <= min(forces) and max(forces) <= high:
        return True
    message = f'forcerange="{low:g} {high:g}" limits the force of a motor: expected a ctrlrange that does not exceed it'
    drive.source.report.error(drive.label, message)
    return False


def servo_limit(drive: Drive) -> float | None:
    """Largest force of a servo along the coordinate, infinite without a limit, None if it is not expressible."""
    model = drive.source.model
    if not model.actuator_forcelimited[drive.index]:
        return math.inf
    low, high = (float(end) for end in model.actuator_forcerange[drive.index])
    if low == -high:
        return abs(drive.gear) * high
    drive.source.report.error(drive.label, f'forcerange="{low:g} {high:g}" is not symmetric: expected "-F F"')
    return None


def check_joint_limits(source: Source, joints: dict[int, Joint]) -> None:
    """Limits of the sum of all forces on a joint are not expressible."""
    for index in joints:
        if source.array("jnt_actfrclimited", False, source.model.njnt)[index]:
            message = "actuatorfrcrange is not expressible: expected a ctrlrange or forcerange of the actuators"
            source.report.error(source.label("joint", index), message)


# Tendons


def on_tendon(drive: Drive, joints: dict[int, Joint], names: Names) -> Actuator | None:
    """A motor on a fixed tendon: a signal, which forces of joints read."""
    source = drive.source
    tendon = int(source.model.actuator_trnid[drive.index][0])
    coefficients = fixed_tendon(source, tendon)
    if coefficients is None:
        message = f"it acts on {source.label('tendon', tendon)}: expected a joint, or a <fixed> tendon"
        source.report.error(drive.label, message)
        return None
    if drive.law.stiffness or drive.law.damping:
        source.report.error(drive.label, "it is a servo on a tendon: expected a motor, or a joint")
        return None
    if not is_force_unlimited(drive):
        return None
    own = source.name("actuator", drive.index) or f"{source.name('tendon', tendon)}_force"
    name = names.unique(f"{own}_force" if names.has(own) else own, f"actuator{drive.index}")
    for joint, coefficient in coefficients:
        factor = coefficient * drive.gear * drive.law.gain
        if factor and joint in joints:
            joints[joint].forces = [*(joints[joint].forces or []), f"{ron.number(factor)} * {name}"]
    return drive.actuator(name, "Signal")


def fixed_tendon(source: Source, tendon: int) -> list[tuple[int, float]] | None:
    """Joints of a fixed tendon with their coefficients; None for a spatial one."""
    model = source.model
    path = range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
    if any(source.kind_of("mjtWrap", "mjWRAP_", model.wrap_type[step]) != "joint" for step in path):
        return None
    return [(int(model.wrap_objid[step]), float(model.wrap_prm[step])) for step in path]


def find_ropes(source: Source, plane: Plane, bodies: Bodies) -> list[Rope]:
    """Limited spatial tendons between two sites."""
    names = Names()
    ropes = [rope(source, plane, bodies, tendon, names) for tendon in range(source.model.ntendon)]
    return [one for one in ropes if one is not None]


def rope(source: Source, plane: Plane, bodies: Bodies, tendon: int, names: Names) -> Rope | None:
    """One rope, or None if the tendon does nothing by itself."""
    check_tendon(source, tendon)
    model = source.model
    label = source.label("tendon", tendon)
    is_limited = bool(model.tendon_limited[tendon]) and not (
        source.is_disabled("limit") or source.is_disabled("constraint")
    )
    if not is_limited:
        return None
    low, high = (float(end) for end in model.tendon_range[tendon])
    sites = sites_of(source, tendon)
    if sites is None or low > 0:
        source.report.error(
            label, "its length is limited: expected a <spatial> tendon of two sites with a range that begins with 0"
        )
        return None
    positions = [np.array(source.data.site_xpos[site]) for site in sites]
    depth = plane.depth(positions[1] - positions[0])
    if abs(depth) >= high:
        source.report.error(label, "its sites are farther apart perpendicular to the plane than it is long")
        return None
    owners = [int(model.site_bodyid[site]) for site in sites]
    points = [
        bodies.frame(owner).point(plane.project(position)) for owner, position in zip(owners, positions, strict=True)
    ]
    name = names.unique(source.name("tendon", tendon), f"rope{tendon}")
    length = math.sqrt(high * high - depth * depth) if depth else high
    distance = float(np.linalg.norm(plane.project(positions[1] - positions[0])))
    if distance > length:
        source.report.warning(label, f"it is taut in the reference pose, in which its sites are {distance - length:.3g} m too far apart")
    return Rope(tendon, name, (bodies.name(owners[0]), bodies.name(owners[1])), (points[0], points[1]), length)


def sites_of(source: Source, tendon: int) -> tuple[int, int] | None:
    model = source.model
    path = range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
    kinds = [source.kind_of("mjtWrap", "mjWRAP_", model.wrap_type[step]) for step in path]
    if kinds != ["site", "site"]:
        return None
    first, second = (int(model.wrap_objid[step]) for step in path)
    return first, second


def check_tendon(source: Source, tendon: int) -> None:
    """Forces of a tendon by itself are not expressible."""
    model = source.model
    names = (
        "stiffness",
        "stiffnesspoly",
        "damping",
        "dampingpoly",
        "frictionloss",
        "armature",
        "springyield",
        "actfrclimited",
    )
    for name in names:
        if np.any(source.array(f"tendon_{name}", 0.0, model.ntendon)[tendon]):
            source.report.error(source.label("tendon", tendon), f"{name} is not expressible: expected to leave it out")
    if model.tendon_limited[tendon] and not np.allclose(model.tendon_solref_lim[tendon], DEFAULT_SOLREF):
        source.report.warning(source.label("tendon", tendon), "solreflimit is left out")
    if model.tendon_limited[tendon] and not np.allclose(model.tendon_solimp_lim[tendon], DEFAULT_SOLIMP):
        source.report.warning(source.label("tendon", tendon), "solimplimit is left out")
    if model.tendon_margin[tendon] != 0:
        source.report.warning(source.label("tendon", tendon), "margin is left out")
