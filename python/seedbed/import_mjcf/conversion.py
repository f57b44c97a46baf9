"""From a model to all parts of a task file."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from .actuators import Actuator, Rope, find_actuators, find_ropes
from .bodies import Bodies, find_bodies, has_fluid
from .contacts import Contacts, Owners, find_contacts
from .joints import Joint, find_joints, softness
from .names import Names
from .plane import Plane, find_plane
from .report import MjcfError
from .shapes import Geom, geoms_of
from .source import Source

LONGEST_STEP = 10.0
"""Longest control step of a task file, s."""


@dataclass
class Options:
    """What the model does not say.

    Attributes:
        frame_skip: MuJoCo's time steps per control step.
        time_limit: Actions in an episode.
        refinement: Factor of the solver's iterations.
    """

    frame_skip: int = 1
    time_limit: int = 1000
    refinement: int = 1


@dataclass
class Coordinate:
    """Names of the sensors of a joint's coordinate; `raw` is that of the coordinate from the reference pose."""

    joint: Joint
    position: str
    velocity: str
    raw: str


@dataclass
class Conversion:
    """A converted model: all parts of the task file.

    Attributes:
        contact_softness: Natural frequency (Hz) and damping ratio of contacts.
    """

    source: Source
    options: Options
    plane: Plane
    bodies: Bodies
    joints: list[Joint]
    geoms: list[Geom]
    contacts: Contacts
    actuators: list[Actuator]
    ropes: list[Rope]
    coordinates: list[Coordinate]
    contact_softness: tuple[float, float] | None
    collider_names: dict[int, str] = field(default_factory=dict)

    @property
    def control_step(self) -> float:
        """Time between two actions, s."""
        return float(self.source.model.opt.timestep) * self.options.frame_skip


def convert_model(path: str | os.PathLike[str], options: Options) -> Conversion:
    """All parts of the task file of a planar model.

    Raises:
        MjcfError: There is no such file, MuJoCo cannot read it, or something in it is not expressible in a task file.
    """
    source = Source(path)
    plane = find_plane(source)
    if plane is None:
        raise MjcfError(source.report.errors)
    is_planar = not source.report.errors
    check_options(source, options)
    conversion = planar_model(source, plane, options, is_planar)
    source.report.raise_errors()
    return conversion


def planar_model(source: Source, plane: Plane, options: Options, is_planar: bool) -> Conversion:
    bodies = find_bodies(source, plane)
    joints = find_joints(source, plane, bodies)
    geoms = geoms_of(source, plane)
    contacts = Contacts({}, None, [])
    # What touches what is meaningless if the model is not planar, and would give many more errors.
    if is_planar:
        contacts = find_contacts(source, plane, geoms, owners_of(source, bodies, joints))
    names = Names()
    coordinates = name_coordinates(joints, names)
    actuators = find_actuators(source, joints, names)
    ropes = find_ropes(source, plane, bodies)
    if not actuators:
        source.report.warning("actuator", "there is none: an agent has nothing to do")
    shared = contacts.softness
    soft = softness(source, "contacts", shared.solref, shared.dmax) if shared else None
    conversion = Conversion(
        source, options, plane, bodies, joints, geoms, contacts, actuators, ropes, coordinates, soft
    )
    name_colliders(conversion)
    return conversion


def check_options(source: Source, options: Options) -> None:
    """Parts of the model that concern no single element."""
    model, report = source.model, source.report
    step = float(model.opt.timestep) * options.frame_skip
    if step > LONGEST_STEP:
        report.error("option", f"{options.frame_skip} time steps take {step:g} s: expected at most {LONGEST_STEP:g} s")
    disabled = source.is_disabled("equality") or source.is_disabled("constraint")
    for index in range(0 if disabled else model.neq):
        kind = source.kind_of("mjtEq", "mjEQ_", model.eq_type[index])
        name = source.name("equality", index)
        label = f'equality {kind} "{name}"' if name else f"equality {kind} {index}"
        if model.eq_active0[index]:
            report.error(
                label, "constraints between coordinates or bodies are not expressible: expected to leave it out"
            )
        else:
            report.warning(label, "it is not active, and left out")
    if has_fluid(source) and any(model.opt.wind):
        report.error("option", "wind is not expressible: expected 0")
    check_fluid_shapes(source)
    for element in ("flex", "plugin"):
        if getattr(model, f"n{element}", 0):
            report.error(element, "it is not expressible: expected rigid bodies only")
    if model.opt.enableflags & int(source.mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        report.error("option", 'flag override="enable" is not expressible: expected solref and solimp of geoms')


def check_fluid_shapes(source: Source) -> None:
    if not has_fluid(source):
        return
    for index in range(source.model.ngeom):
        if source.model.geom_fluid[index][0] > 0:
            message = (
                'fluidshape="ellipsoid" is not expressible: expected "none", with which the body is a box in the fluid'
            )
            source.report.error(source.label("geom", index), message)


def owners_of(source: Source, bodies: Bodies, joints: list[Joint]) -> Owners:
    """Which bodies of the task file geoms belong to, and which of them cannot touch because of their joint.

    Where several joints connect two bodies, only groups keep them from touching.
    """
    of_geom = [bodies.owner[int(body)] for body in source.model.geom_bodyid]
    joined = set()
    for body in bodies.bodies.values():
        number = sum(joint.body == body.index for joint in joints)
        if body.parent != 0 and number == 1:
            joined.add((min(body.index, body.parent), max(body.index, body.parent)))
    return Owners(of_geom, joined)


def name_coordinates(joints: list[Joint], names: Names) -> list[Coordinate]:
    """Names of sensors: `NAME` and `NAME_dot`; `NAME_offset` where MuJoCo's coordinate is not 0 at the reference pose."""
    moving = [joint for joint in joints if joint.index is not None]
    positions = [names.unique(joint.name, "q") for joint in moving]
    velocities = [names.unique(f"{joint.name}_dot", "q_dot") for joint in moving]
    raws = [
        names.unique(f"{joint.name}_offset", "q_offset") if joint.reference else position
        for joint, position in zip(moving, positions, strict=True)
    ]
    return [Coordinate(*parts) for parts in zip(moving, positions, velocities, raws, strict=True)]


def name_colliders(conversion: Conversion) -> None:
    """The name of each geom that can touch others; otherwise the body's name with a number."""
    source, names = conversion.source, Names()
    for geom in conversion.contacts.surfaces:
        body = conversion.bodies.name(int(source.model.geom_bodyid[geom]))
        own = source.name("geom", geom)
        conversion.collider_names[geom] = names.unique(own, f"{body}_geom{geom}")
