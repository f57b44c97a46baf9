"""Bodies of MJCF as bodies of the task file: frames, masses, and which of them move together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .names import Names
from .plane import TOLERANCE, WORLD, Array, Frame, Plane
from .source import Source

LIGHT = 1e-3
"""In a fluid, a body that is welded to another one and is lighter than this part of it is a part of that body."""

MIN_VALUE = 1e-15
"""MuJoCo's smallest positive number, in its model of fluids."""


@dataclass
class Body:
    """A body of the task file.

    Attributes:
        index: Its number in the model.
        name: Its name in the file.
        parent: Number of the body that it hangs on; 0 for the world.
        frame: Its frame in the plane at the reference pose.
        is_turned: Whether the frame differs from that of MJCF in its angle.
        members: Numbers of the bodies of the model that are parts of it, first itself.
        mass: kg.
        com: Center of mass in its frame, `[2]`, m.
        inertia: Moment of inertia about the center of mass, kg m².
        fluid_box: Lengths along the frame's x and y, and perpendicular to the plane, m; None without a fluid.
    """

    index: int
    name: str
    parent: int
    frame: Frame
    is_turned: bool
    members: list[int]
    mass: float = 0.0
    com: Array | None = None
    inertia: float = 0.0
    fluid_box: tuple[float, float, float] | None = None


@dataclass
class Bodies:
    """All bodies of the task file, by their number in the model, and to which of them each body of the model belongs."""

    bodies: dict[int, Body]
    owner: list[int]
    """Number of the body of the file by number of the body of the model; 0 for the world."""

    def name(self, index: int) -> str:
        """Name in the file of the body to which a body of the model belongs."""
        owner = self.owner[index]
        return "world" if owner == 0 else self.bodies[owner].name

    def frame(self, index: int) -> Frame:
        """Frame of the body of the file to which a body of the model belongs."""
        owner = self.owner[index]
        return WORLD if owner == 0 else self.bodies[owner].frame


def find_bodies(source: Source, plane: Plane) -> Bodies:
    """All bodies that move.

    Bodies that cannot move are parts of the world. A body without joints is a part of the body that it hangs on, as
    MuJoCo computes it. In a fluid, which resists the motion of each body, it is so only if it is much lighter.
    """
    check_gravity_compensation(source)
    owner = find_owners(source)
    names = Names({"world"})
    bodies = {}
    for index in sorted(set(owner) - {0}):
        members = [member for member, other in enumerate(owner) if other == index]
        name = names.unique(source.name("body", index), f"body{index}")
        frame, is_turned = find_frame(source, plane, index)
        body = Body(index, name, owner[int(source.model.body_parentid[index])], frame, is_turned, members)
        set_inertia(source, plane, body)
        bodies[index] = body
    return Bodies(bodies, owner)


def check_gravity_compensation(source: Source) -> None:
    for index, share in enumerate(source.array("body_gravcomp", 0.0, source.model.nbody)):
        if share != 0:
            source.report.error(source.label("body", index), f'gravcomp="{share:g}" is not expressible: expected 0')


def find_owners(source: Source) -> list[int]:
    """Number of the body of the file by number of the body of the model."""
    model = source.model
    owner: list[int] = []
    for index in range(model.nbody):
        parent = owner[int(model.body_parentid[index])] if index else 0
        is_part = model.body_jntnum[index] == 0 and (not has_fluid(source) or is_light(source, index, parent))
        owner.append(parent if is_part or model.body_weldid[index] == 0 else index)
        if model.body_mocapid[index] >= 0:
            source.report.warning(source.label("body", index), "mocap is left out: it does not move")
    return owner


def is_light(source: Source, index: int, parent: int) -> bool:
    masses = source.model.body_mass
    return bool(masses[index] < LIGHT * masses[parent])


def find_frame(source: Source, plane: Plane, index: int) -> tuple[Frame, bool]:
    """Frame of a body in the plane, and whether its angle is not that of MJCF.

    With a fluid the axes of the frame are those of the body's box.
    """
    rotation = np.array(source.data.xmat[index]).reshape(3, 3)
    angle = plane.angle_of(rotation)
    origin = plane.project(np.array(source.data.xpos[index]))
    own = angle if angle is not None else 0.0
    needed = box_angle(source, plane, index, own) if has_fluid(source) else own
    return Frame(origin, needed), angle is None or abs(needed - own) > TOLERANCE


def set_inertia(source: Source, plane: Plane, body: Body) -> None:
    """Mass, center of mass, and moment of inertia of a body with all its parts."""
    model, data = source.model, source.data
    masses = np.array([model.body_mass[member] for member in body.members])
    centers = np.array([plane.project(np.array(data.xipos[member])) for member in body.members])
    body.mass = float(masses.sum())
    if body.mass <= 0:
        source.report.error(
            source.label("body", body.index), "it moves and has no mass: expected geoms or an <inertial>"
        )
        return
    center = masses @ centers / body.mass if len(masses) > 1 else centers[0]
    about_own = sum(moment_about_normal(source, plane, member) for member in body.members)
    body.inertia = float(about_own + masses @ np.sum((centers - center) ** 2, axis=1))
    body.com = body.frame.point(center)
    if body.inertia <= 0:
        source.report.error(
            source.label("body", body.index), "it has no moment of inertia: expected a diaginertia larger than 0"
        )
    if has_fluid(source):
        body.fluid_box = fluid_box(source, plane, body)


def moment_about_normal(source: Source, plane: Plane, index: int) -> float:
    """Moment of inertia of a body of the model about the plane's normal through its center of mass, kg m²."""
    axes = np.array(source.data.ximat[index]).reshape(3, 3)
    shares = (axes.T @ plane.toward_viewer) ** 2
    shares[shares < MIN_VALUE] = 0
    return float(shares @ source.model.body_inertia[index])


# Fluids


def has_fluid(source: Source) -> bool:
    """Whether something resists the motion of all bodies."""
    return bool(source.model.opt.density > 0 or source.model.opt.viscosity > 0)


def box_axes(source: Source, plane: Plane, index: int) -> tuple[int, int, int] | None:
    """Which principal axes of a body are most nearly along x and y of the file, and which one is perpendicular to the plane."""
    axes = np.array(source.data.ximat[index]).reshape(3, 3)
    depths = [abs(plane.depth(axes[:, axis])) for axis in range(3)]
    perpendicular = int(np.argmax(depths))
    if depths[perpendicular] < 1 - TOLERANCE:
        return None
    first, second = (axis for axis in range(3) if axis != perpendicular)
    return first, second, perpendicular


def box_angle(source: Source, plane: Plane, index: int, angle: float) -> float:
    """Angle of the body's box in the plane that is nearest to `angle`, rad."""
    found = box_axes(source, plane, index)
    if found is None:
        return angle
    axes = np.array(source.data.ximat[index]).reshape(3, 3)
    x, y = plane.project(axes[:, found[0]])
    turn = (np.arctan2(y, x) - angle + np.pi / 4) % (np.pi / 2) - np.pi / 4
    return float(angle + turn) if abs(turn) > TOLERANCE else angle


def fluid_box(source: Source, plane: Plane, body: Body) -> tuple[float, float, float] | None:
    """Lengths of the box with the body's mass and moments of inertia, as MuJoCo computes them."""
    found = box_axes(source, plane, body.index)
    if found is None:
        source.report.error(
            source.label("body", body.index),
            "a fluid resists it, but none of its principal axes is perpendicular to the plane: expected another fullinertia",
        )
        return None
    moments = source.model.body_inertia[body.index]
    lengths = [
        float(np.sqrt(max(MIN_VALUE, moments.sum() - 2 * moments[axis]) / source.model.body_mass[body.index] * 6))
        for axis in range(3)
    ]
    first, second, perpendicular = found
    axes = np.array(source.data.ximat[body.index]).reshape(3, 3)
    x, y = body.frame.direction(plane.project(axes[:, first]))
    along = (lengths[first], lengths[second]) if abs(x) > abs(y) else (lengths[second], lengths[first])
    return along[0], along[1], lengths[perpendicular]
