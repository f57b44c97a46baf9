"""Text of the task file of a converted model."""

from __future__ import annotations

import math

from . import ron
from .actuators import Actuator, Rope
from .bodies import Body, has_fluid
from .conversion import Conversion, Coordinate
from .joints import Joint
from .plane import TOLERANCE, WORLD, Frame
from .ron import Record, Value, length, number, quoted, vector
from .shapes import shape, why_not
from .source import Source

SLIDE_RANGE = 5.0
VELOCITY_RANGE = 10.0
"""Ranges over which observations without limits are displayed: m; m/s or rad/s."""

SUBSTEPS = 8
"""Substeps per time step of MuJoCo, without contacts."""

SUBSTEPS_AFTER_SEARCH = 4
"""Substeps per time step of MuJoCo, with contacts, which are searched for once per time step."""

MOST = 1000
"""Most iterations and searches of a task file."""

INTEGRATORS = {"euler": "Euler", "rk4": "RK4"}
"""Spelling in MJCF, where it is not in lower case."""

UNNAMED_MODEL = "MuJoCo Model"
"""MuJoCo's name of a model without one."""

NEXT = """What to do next: `seedbed check FILE` reports whether the file is correct, `seedbed preview FILE` shows it in motion.
Write `reward`, a formula over sensors, observations and actions, `terminated` if episodes end early, and the start
distribution `reset`. Choose observations and their ranges. docs/task_fields.md of the repository explains all fields."""


def task_text(conversion: Conversion) -> str:
    """The whole file."""
    header = ron.comment_lines(header_text(conversion))
    return "\n".join([*header, ron.written(task(conversion)), ""])


def header_text(conversion: Conversion) -> str:
    """What was converted, with which options, what was changed and left out."""
    source = conversion.source
    horizontal, vertical = conversion.plane.axes
    model = source.model
    integrator = source.kind_of("mjtIntegrator", "mjINT_", model.opt.integrator)
    lines = [
        f"Converted from {source.path.name} by `python -m seedbed.import_mjcf`; read by MuJoCo {source.mujoco.__version__}.",
        f"Plane: x of this file is {horizontal} of MJCF, y is {vertical}; angles grow counter-clockwise, seen with x to the right.",
        f"Time: timestep {number(model.opt.timestep)} s with the integrator {INTEGRATORS.get(integrator, integrator)}, "
        f"{conversion.options.frame_skip} per control step.",
        "Coordinates of joints are 0 in the reference pose of the model; sensors have the values of MuJoCo's qpos.",
        *[f"Changed: {warning}." for warning in source.report.warnings],
        *[f"Left out: {text}." for text in dropped(conversion)],
        NEXT,
    ]
    return "\n".join(lines)


def dropped(conversion: Conversion) -> list[str]:
    """What is left out without a change of the motion, but for friction cones."""
    source = conversion.source
    lines = []
    shapeless = [
        geom.index
        for geom in conversion.geoms
        if geom.is_visible(source) and drawn_shape(conversion, geom.index) is None
    ]
    for index in shapeless:
        lines.append(f"{source.label('geom', index)}, which is not drawn: {why_not(conversion.geoms[index])}")
    depth = conversion.plane.depth(source.model.opt.gravity)
    if abs(depth) > 0 and not source.is_disabled("gravity"):
        lines.append(f"the gravity of {abs(depth):g} m/s² perpendicular to the plane")
    for kind, number_of in (("sensor", source.model.nsensor), ("key", source.model.nkey)):
        names = [source.name(kind, index) or "(unnamed)" for index in range(number_of)]
        if names:
            lines.append(f"the {'keyframes' if kind == 'key' else 'sensors'} {', '.join(names)}")
    if conversion.contacts.surfaces:
        lines += [f"option {text}, of MuJoCo's contacts" for text in contact_options(source)]
    return lines


def contact_options(source: Source) -> list[str]:
    """Options of the solver of contacts that are not MuJoCo's defaults."""
    option = source.model.opt
    cone = source.kind_of("mjtCone", "mjCONE_", option.cone)
    found = [f'cone="{cone}"'] if cone != "pyramidal" else []
    found += [f'impratio="{option.impratio:g}"'] if option.impratio != 1 else []
    return found + ([f'noslip_iterations="{option.noslip_iterations}"'] if option.noslip_iterations else [])


def task(conversion: Conversion) -> Record:
    """`Environment(…)`."""
    source, options = conversion.source, conversion.options
    title = source.model.names[: source.model.names.index(b"\0")].decode().replace(UNNAMED_MODEL, "")
    fields: list[tuple[str, Value]] = [
        ("description", quoted(f"The model {title or source.path.stem}, converted from MJCF.")),
        ("gravity", gravity(conversion)),
        ("control_step", length(conversion.control_step)),
        ("time_limit", str(options.time_limit)),
        ("solver", solver(conversion)),
    ]
    if conversion.contact_softness:
        fields.append(("contact_softness", softness(conversion.contact_softness)))
    if has_fluid(source):
        medium = source.model.opt
        fields.append(("fluid", f"(density: {number(medium.density)}, viscosity: {number(medium.viscosity)})"))
    fields += surroundings(conversion)
    fields += moving_parts(conversion)
    fields += [("reset", starts(conversion)), ("reward", quoted("0"))]
    return Record(fields, "Environment", comments=comments(conversion))


def comments(conversion: Conversion) -> dict[str, str]:
    """Where the numbers of each field come from."""
    option = conversion.source.model.opt
    step = f"option: timestep {number(option.timestep)}"
    return {
        "gravity": "option: gravity",
        "control_step": f"{step}, times {conversion.options.frame_skip} (--frame-skip)",
        "time_limit": "--time-limit",
        "contact_softness": "geom: solref, solimp, as a spring that yields as far to a lasting force and recovers as fast",
        "fluid": "option: density, viscosity",
        "scenery": "Geoms that do not move and touch nothing: " + listed(conversion, world_geoms(conversion, False)),
        "colliders": "Geoms that do not move: type, pos, size, friction, contype, conaffinity: "
        + listed(conversion, world_geoms(conversion, True)),
        "ropes": "tendon spatial: site, range",
        "bodies": "position, angle: body pos, quat at the reference pose; mass, com, inertia: from inertial or from the geoms, as MuJoCo does",
        "joints": "axis, pos, range, damping, frictionloss, armature, stiffness, springref; bodies without joints are parts of others\n"
        "range_softness: solreflimit, solimplimit, as a spring that yields as far to a lasting force and recovers as fast",
        "actuators": "gear, gainprm, biasprm, ctrlrange of actuators",
        "reset": start_comment(conversion),
        "reward": "Nothing is rewarded yet.",
    }


def start_comment(conversion: Conversion) -> str:
    text = "At rest in the reference pose, where its coordinates are in their ranges."
    shifted = [f"{joint.name}: 0 is {number(joint.reference)} of MJCF" for joint in conversion.joints if joint.reference]
    if shifted:
        text += f"\nPositions count from the reference pose, unlike the sensors; {', '.join(shifted)}."
    return text


def gravity(conversion: Conversion) -> str:
    if conversion.source.is_disabled("gravity"):
        return "(0.0, 0.0)"
    return vector(conversion.plane.project(conversion.source.model.opt.gravity))


def solver(conversion: Conversion) -> str:
    """Contacts are searched for once per time step of MuJoCo. The force of a fluid is computed after each search."""
    skip, factor = conversion.options.frame_skip, conversion.options.refinement
    iterations, searches = (SUBSTEPS_AFTER_SEARCH, skip) if conversion.contacts.surfaces else (SUBSTEPS * skip, 1)
    if has_fluid(conversion.source):
        iterations, searches = 1, SUBSTEPS * skip * factor
    return (
        f"(iterations: {min(iterations * factor, MOST)}, passes: {passes(conversion)}, searches: {min(searches, MOST)})"
    )


def passes(conversion: Conversion) -> int:
    """Chains need more than one iteration over all joints."""
    parents = [body.parent for body in conversion.bodies.bodies.values()]
    return 2 if any(parents) else 1


def softness(values: tuple[float, float]) -> str:
    return f"(natural_frequency: {number(values[0])}, damping_ratio: {number(values[1])})"


# The world


def world_geoms(conversion: Conversion, touching: bool) -> list[int]:
    """Geoms that do not move and have a shape: those that can touch others, or those that are only drawn."""
    return [
        geom
        for geom in own_geoms(conversion, 0)
        if (geom in conversion.contacts.surfaces) == touching and (touching or drawn_shape(conversion, geom))
    ]


def own_geoms(conversion: Conversion, body: int) -> list[int]:
    """Geoms of a body of the task file, or of the world."""
    owner = conversion.bodies.owner
    return [
        geom.index for geom in conversion.geoms if owner[int(conversion.source.model.geom_bodyid[geom.index])] == body
    ]


def drawn_shape(conversion: Conversion, geom: int) -> str | None:
    """The shape of a geom in the frame of its body, or None if it is not drawn."""
    one = conversion.geoms[geom]
    frame = conversion.bodies.frame(int(conversion.source.model.geom_bodyid[geom]))
    return shape(one, frame) if one.is_visible(conversion.source) or geom in conversion.contacts.surfaces else None


def surroundings(conversion: Conversion) -> list[tuple[str, Value]]:
    fields: list[tuple[str, Value]] = []
    scenery = [drawn_shape(conversion, geom) or "" for geom in world_geoms(conversion, False)]
    surfaces = [collider(conversion, geom, WORLD) for geom in world_geoms(conversion, True)]
    if scenery:
        fields.append(("scenery", scenery))
    if surfaces:
        fields.append(("colliders", surfaces))
    tracked = next((body.name for body in conversion.bodies.bodies.values() if is_free(conversion, body)), None)
    if tracked:
        fields.append(("tracked", quoted(tracked)))
    return fields


def is_free(conversion: Conversion, body: Body) -> bool:
    """Whether a body that others hang on can move and turn without limits."""
    joints = [joint for joint in conversion.joints if joint.body == body.index]
    has_children = any(other.parent == body.index for other in conversion.bodies.bodies.values())
    return has_children and body.parent == 0 and len(joints) == 3 and all(joint.range is None for joint in joints)


def collider(conversion: Conversion, geom: int, frame: Frame) -> Record:
    surface = conversion.contacts.surfaces[geom]
    fields: list[tuple[str, Value]] = [
        ("name", quoted(conversion.collider_names[geom])),
        ("geom", shape(conversion.geoms[geom], frame) or ""),
        ("friction", number(surface.friction)),
    ]
    if (surface.contype, surface.conaffinity) != (1, 1):
        fields += [("contype", str(surface.contype)), ("conaffinity", str(surface.conaffinity))]
    return Record(fields)


# Bodies, joints, ropes and actuators


def moving_parts(conversion: Conversion) -> list[tuple[str, Value]]:
    fields: list[tuple[str, Value]] = [
        ("bodies", [body_record(conversion, body) for body in conversion.bodies.bodies.values()]),
        ("joints", [joint_record(conversion, joint) for joint in conversion.joints]),
    ]
    if conversion.ropes:
        fields.append(("ropes", [rope_record(rope) for rope in conversion.ropes]))
    fields.append(("actuators", [actuator_record(actuator) for actuator in conversion.actuators]))
    fields.append(("sensors", [sensor for one in conversion.coordinates for sensor in sensors(one)]))
    fields.append(("observations", observations(conversion)))
    return fields


def body_record(conversion: Conversion, body: Body) -> Record:
    frame = body.frame
    fields: list[tuple[str, Value]] = [("name", quoted(body.name)), ("position", vector(frame.origin))]
    if abs(frame.angle) > TOLERANCE * TOLERANCE:
        fields.append(("angle", length(frame.angle)))
    fields.append(("mass", number(body.mass)))
    fields.append(("com", vector(body.com)) if body.com is not None else ("com", "(0.0, 0.0)"))
    fields.append(("inertia", number(body.inertia)))
    if body.fluid_box:
        fields.append(("fluid_box", f"({', '.join(number(side) for side in body.fluid_box)})"))
    geoms = own_geoms(conversion, body.index)
    drawn = [drawn_shape(conversion, geom) for geom in geoms if geom not in conversion.contacts.surfaces]
    touching = [collider(conversion, geom, frame) for geom in geoms if geom in conversion.contacts.surfaces]
    shapes = [text for text in drawn if text]
    fields += [("geoms", shapes)] if shapes else []
    fields += [("colliders", touching)] if touching else []
    return Record(fields, comment=body_comment(conversion, body, geoms))


def body_comment(conversion: Conversion, body: Body, geoms: list[int]) -> str:
    source = conversion.source
    text = f"{source.label('body', body.index)}: pos, quat, inertial; {listed(conversion, geoms)}"
    if body.is_turned:
        text += "; its axes are not those of MJCF"
    if len(body.members) > 1:
        parts = ", ".join(source.label("body", member) for member in body.members[1:])
        text += f"; without joints, and a part of it: {parts}"
    return text


def listed(conversion: Conversion, geoms: list[int]) -> str:
    """Names of geoms, for people."""
    names = [conversion.source.name("geom", geom) or f"{geom} (unnamed)" for geom in geoms]
    return f"geom {', '.join(names)}" if names else "no geoms"


def joint_record(conversion: Conversion, joint: Joint) -> Record:
    parent = conversion.bodies.bodies[joint.body].parent
    fields: list[tuple[str, Value]] = [
        ("name", quoted(joint.name)),
        ("parent", quoted(conversion.bodies.name(parent))),
        ("child", quoted(conversion.bodies.name(joint.body))),
        ("type", joint_type(joint)),
    ]
    if vector(joint.anchor) != "(0.0, 0.0)":
        fields.append(("anchor", vector(joint.anchor)))
    if joint.range:
        fields.append(("range", ron.interval(joint.range)))
    if joint.softness:
        fields.append(("range_softness", softness(joint.softness)))
    fields += [(name, number(value)) for name, value in passive_forces(joint) if value]
    if joint.forces:
        fields.append(("force", quoted(" + ".join(joint.forces))))
    return Record(fields)


def joint_type(joint: Joint) -> str:
    if joint.kind == "slide":
        return f"Slide(axis: {vector(joint.direction)})"
    if joint.kind == "hinge":
        return "Hinge(positive: Clockwise)" if joint.is_clockwise else "Hinge()"
    return "Weld"


def passive_forces(joint: Joint) -> list[tuple[str, float]]:
    return [
        ("damping", joint.damping),
        ("frictionloss", joint.frictionloss),
        ("armature", joint.armature),
        ("stiffness", joint.stiffness),
        ("springref", joint.springref if joint.stiffness else 0.0),
    ]


def rope_record(rope: Rope) -> Record:
    ends = [
        f"(body: {quoted(body)}, at: {vector(point)})" for body, point in zip(rope.bodies, rope.points, strict=True)
    ]
    return Record([("name", quoted(rope.name)), ("from", ends[0]), ("to", ends[1]), ("length", length(rope.length))])


def actuator_record(actuator: Actuator) -> Record:
    low, high = actuator.control
    fields: list[tuple[str, Value]] = [("name", quoted(actuator.name)), ("type", actuator.kind)]
    if actuator.gear != 1:
        fields.append(("gear", number(actuator.gear)))
    fields.append(("control", f"Continuous({number(low)}, {number(high)})"))
    if actuator.unit:
        fields.append(("unit", quoted(actuator.unit)))
    return Record(fields)


# What is measured, and where episodes start


def sensors(coordinate: Coordinate) -> list[Record]:
    joint = coordinate.joint
    name = quoted(joint.name)
    found = [Record([("name", quoted(coordinate.raw)), ("type", f"JointPosition({name})")])]
    if joint.reference:
        sign = "-" if joint.reference < 0 else "+"
        formula = f"{coordinate.raw} {sign} {number(abs(joint.reference))}"
        found.append(Record([("name", quoted(coordinate.position)), ("type", f"Formula({quoted(formula)})")]))
    return [*found, Record([("name", quoted(coordinate.velocity)), ("type", f"JointVelocity({name})")])]


def observations(conversion: Conversion) -> list[Record]:
    """All positions, then all velocities, as MuJoCo's qpos and qvel."""
    positions = [
        observation(one.position, unit(one.joint), position_range(one.joint)) for one in conversion.coordinates
    ]
    velocity_range = (-VELOCITY_RANGE, VELOCITY_RANGE)
    return positions + [
        observation(one.velocity, f"{unit(one.joint)}/s", velocity_range) for one in conversion.coordinates
    ]


def observation(name: str, unit_name: str, values: tuple[float, float]) -> Record:
    return Record([("name", quoted(name)), ("unit", quoted(unit_name)), ("range", ron.interval(values))])


def unit(joint: Joint) -> str:
    return "rad" if joint.kind == "hinge" else "m"


def position_range(joint: Joint) -> tuple[float, float]:
    """Range of MuJoCo's coordinate over which it is displayed."""
    if joint.range:
        low, high = (float(length(end + joint.reference)) for end in joint.range)
        return low, high
    half = math.pi if joint.kind == "hinge" else SLIDE_RANGE
    return joint.reference - half, joint.reference + half


def starts(conversion: Conversion) -> Value:
    """Joints whose range does not contain the reference pose start at its nearest end."""
    outside = [joint for joint in conversion.joints if joint.start]
    return [
        Record([("joint", quoted(joint.name)), ("position", f"Constant({number(joint.start)})")]) for joint in outside
    ]
