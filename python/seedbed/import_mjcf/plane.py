"""The plane in which a model moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .source import Source

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Largest component of a unit vector that counts as zero: files give axes with six digits or more."""

AXES = "xyz"
# Horizontal and vertical axis of the file, by the axis of MJCF that is perpendicular to the plane.
PLANES = {"y": ("x", "z"), "z": ("x", "y"), "x": ("y", "z")}


@dataclass(frozen=True)
class Plane:
    """A plane of two axes of MJCF's world: they are x and y of the task file."""

    normal: str
    """Axis of MJCF that is perpendicular to it: "x", "y" or "z"."""

    @property
    def axes(self) -> tuple[str, str]:
        """Axes of MJCF that are x and y of the file."""
        return PLANES[self.normal]

    @property
    def toward_viewer(self) -> Array:
        """Unit vector about which angles of the file grow, `[3]`."""
        horizontal, vertical = self.axes
        return np.cross(unit(horizontal), unit(vertical))

    def project(self, vector: Array) -> Array:
        """Components of a vector `[3]` along x and y of the file, `[2]`."""
        horizontal, vertical = self.axes
        return np.array([vector[AXES.index(horizontal)], vector[AXES.index(vertical)]])

    def depth(self, vector: Array) -> float:
        """Component of a vector `[3]` perpendicular to the plane."""
        return float(np.dot(vector, self.toward_viewer))

    def angle_of(self, rotation: Array) -> float | None:
        """Angle (rad) of a rotation matrix `[3, 3]`, or None if it does not only turn the plane in itself."""
        if self.depth(rotation @ self.toward_viewer) < 1 - TOLERANCE:
            return None
        x, y = self.project(rotation @ unit(self.axes[0]))
        return math.atan2(y, x)


@dataclass(frozen=True)
class Frame:
    """A frame in the plane: its origin in the world `[2]`, and its angle (rad)."""

    origin: Array
    angle: float

    def point(self, position: Array) -> Array:
        """A position of the world `[2]` in this frame, `[2]`."""
        return self.direction(position - self.origin)

    def direction(self, vector: Array) -> Array:
        """A vector of the world `[2]` in this frame, `[2]`."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        x, y = vector
        return np.array([cosine * x + sine * y, -sine * x + cosine * y])


WORLD = Frame(np.zeros(2), 0.0)


def unit(axis: str) -> Array:
    """Unit vector along an axis of MJCF, `[3]`."""
    return np.array([float(axis == other) for other in AXES])


def find_plane(source: Source) -> Plane | None:
    """The plane that all hinges are perpendicular to and all slides are parallel to.

    What does not fit is an error of the source's report. Of several directions of hinges, the most frequent one gives
    the plane.

    Returns:
        The plane, or None if there is none.
    """
    check_kinds(source)
    normals = [axis for axis in PLANES if is_normal_of_slides(source, axis)]
    votes = {axis: sum(is_parallel(hinge, axis) for hinge in axes_of(source, "hinge")) for axis in PLANES}
    if any(votes.values()):
        chosen = max(votes, key=lambda axis: votes[axis])
    elif axes_of(source, "hinge") or not normals:
        chosen = ""
    else:
        chosen = normals[0]
    check_hinges(source, chosen)
    check_slides(source, chosen)
    return Plane(chosen) if chosen else None


def check_kinds(source: Source) -> None:
    """Only slides and hinges are expressible."""
    if source.model.njnt == 0:
        source.report.error("worldbody", "no body has a joint: expected something that moves")
    for index, kind in enumerate(source.model.jnt_type):
        name = source.kind_of("mjtJoint", "mjJNT_", kind)
        if name not in ("slide", "hinge"):
            expected = (
                'expected type="slide" or type="hinge"; a body that is free in a plane has two slides, then a hinge'
            )
            source.report.error(source.label("joint", index), f'type="{name}" is not planar: {expected}')


def check_hinges(source: Source, normal: str) -> None:
    for index in joints_of(source, "hinge"):
        axis = source.data.xaxis[index]
        label = source.label("joint", index)
        if not normal or not is_parallel(axis, normal):
            where = (
                f"the axis {normal} of the world, about which most hinges turn"
                if normal
                else "the axis x, y or z of the world"
            )
            source.report.error(label, f"its axis is {readable(axis)} in the world: expected a hinge about {where}")


def check_slides(source: Source, normal: str) -> None:
    for index in joints_of(source, "slide"):
        axis = source.data.xaxis[index]
        label = source.label("joint", index)
        if normal and abs(axis[AXES.index(normal)]) > TOLERANCE:
            expected = f"expected a slide perpendicular to {normal}, the axis about which the hinges turn"
            source.report.error(label, f"its axis is {readable(axis)} in the world: {expected}")
        elif not normal and not axes_of(source, "hinge"):
            expected = "expected slides that are all perpendicular to the axis x, y or z of the world"
            source.report.error(label, f"its axis is {readable(axis)} in the world: {expected}")


def is_normal_of_slides(source: Source, axis: str) -> bool:
    return all(abs(slide[AXES.index(axis)]) <= TOLERANCE for slide in axes_of(source, "slide"))


def is_parallel(vector: Array, axis: str) -> bool:
    return bool(abs(vector[AXES.index(axis)]) >= 1 - TOLERANCE)


def axes_of(source: Source, kind: str) -> list[Array]:
    return [source.data.xaxis[index] for index in joints_of(source, kind)]


def joints_of(source: Source, kind: str) -> list[int]:
    """Indices of the joints of a kind."""
    wanted = int(getattr(source.mujoco.mjtJoint, f"mjJNT_{kind.upper()}"))
    return [index for index, other in enumerate(source.model.jnt_type) if int(other) == wanted]


def readable(vector: Array) -> str:
    """A vector for people, such as "0 1 0"."""
    return " ".join(f"{value + 0.0:.4g}" for value in np.where(np.abs(vector) < TOLERANCE, 0.0, vector))
