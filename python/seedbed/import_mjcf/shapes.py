"""Geoms of MJCF as shapes in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import ron
from .plane import TOLERANCE, Array, Frame, Plane
from .source import Source

INFINITE = math.inf


@dataclass(frozen=True)
class Geom:
    """One geom at the reference pose.

    Attributes:
        index: Its number in the model.
        kind: "sphere", "capsule", … as in MJCF.
        center: Position in the world, `[3]`.
        rotation: Rotation matrix, `[3, 3]`; its columns are the geom's axes in the world.
        size: MuJoCo's sizes, `[3]`.
        plane: The plane of the model.
    """

    index: int
    kind: str
    center: Array
    rotation: Array
    size: Array
    bounding_radius: float
    plane: Plane

    @property
    def position(self) -> Array:
        """Its center in the plane, `[2]`."""
        return self.plane.project(self.center)

    @property
    def direction(self) -> Array:
        """Its own z axis in the plane, `[2]`: the axis of capsules and cylinders, the normal of planes."""
        return self.plane.project(self.rotation[:, 2])

    @property
    def is_along_normal(self) -> bool:
        """Whether its own z axis is perpendicular to the plane of the model."""
        return abs(self.plane.depth(self.rotation[:, 2])) > 1 - TOLERANCE

    @property
    def is_in_plane(self) -> bool:
        """Whether its own z axis is parallel to the plane of the model."""
        return abs(self.plane.depth(self.rotation[:, 2])) < TOLERANCE

    def axis_along_normal(self) -> int | None:
        """Which of its own axes is perpendicular to the plane of the model, if one is."""
        depths = [abs(self.plane.depth(self.rotation[:, axis])) for axis in range(3)]
        best = int(np.argmax(depths))
        return best if depths[best] > 1 - TOLERANCE else None

    def core(self) -> tuple[float, float]:
        """Depths (m, perpendicular to the plane) between which it has its full size in the plane."""
        depth = self.plane.depth(self.center)
        if self.kind == "plane" and self.is_in_plane:
            return -INFINITE, INFINITE
        if self.kind in ("capsule", "cylinder") and self.is_along_normal:
            return depth - self.size[1], depth + self.size[1]
        axis = self.axis_along_normal()
        if self.kind == "box" and axis is not None:
            return depth - self.size[axis], depth + self.size[axis]
        return depth, depth

    def extent(self) -> tuple[float, float]:
        """Depths (m, perpendicular to the plane) between which it is."""
        depth, half = self.plane.depth(self.center), self.half_extent(self.plane.toward_viewer)
        return depth - half, depth + half

    def half_extent(self, direction: Array) -> float:
        """How far it reaches from its center along a unit vector `[3]` of the world, m."""
        along = np.abs(self.rotation.T @ direction)
        if self.kind == "plane":
            return INFINITE
        if self.kind == "sphere":
            return float(self.size[0])
        if self.kind == "capsule":
            return float(self.size[0] + along[2] * self.size[1])
        if self.kind == "cylinder":
            return float(along[2] * self.size[1] + math.sqrt(max(0.0, 1 - along[2] ** 2)) * self.size[0])
        if self.kind == "box":
            return float(along @ self.size)
        if self.kind == "ellipsoid":
            return float(np.linalg.norm(along * self.size))
        return self.bounding_radius

    def is_visible(self, source: Source) -> bool:
        """Whether MuJoCo draws it."""
        return bool(source.model.geom_rgba[self.index][3] > 0)


def geoms_of(source: Source, plane: Plane) -> list[Geom]:
    """All geoms of a model, in its order."""
    model, data = source.model, source.data

    def geom(index: int) -> Geom:
        kind = source.kind_of("mjtGeom", "mjGEOM_", model.geom_type[index])
        rotation = np.array(data.geom_xmat[index]).reshape(3, 3)
        size = np.array(model.geom_size[index])
        center = np.array(data.geom_xpos[index])
        return Geom(index, kind, center, rotation, size, float(model.geom_rbound[index]), plane)

    return [geom(index) for index in range(model.ngeom)]


def shape(geom: Geom, frame: Frame) -> str | None:
    """The shape in a frame of the plane, as text of the task file, or None if the plane has none like it."""
    converters: dict[str, Any] = {
        "sphere": ball,
        "capsule": capsule,
        "cylinder": cylinder,
        "box": box,
        "plane": half_space,
    }
    converter = converters.get(geom.kind)
    return converter(geom, frame) if converter else None


def why_not(geom: Geom) -> str:
    """What is expected of a geom that has no shape in the plane."""
    if geom.kind == "plane" and geom.is_along_normal:
        return "it is parallel to the plane of the model"
    if geom.kind in ("capsule", "cylinder"):
        return "expected an axis in the plane or perpendicular to it"
    if geom.kind == "box":
        return "expected an edge perpendicular to the plane"
    if geom.kind == "plane":
        return "expected a normal in the plane"
    return 'expected type="sphere", "capsule", "cylinder", "box" or "plane"'


def ball(geom: Geom, frame: Frame) -> str:
    return f"Ball({centered(geom, frame)}radius: {ron.length(geom.size[0])})"


def capsule(geom: Geom, frame: Frame) -> str | None:
    """A capsule in the plane; one that is perpendicular to it is a ball."""
    if geom.is_along_normal:
        return ball(geom, frame)
    if not geom.is_in_plane:
        return None
    ends = [frame.point(geom.position + sign * geom.size[1] * geom.direction) for sign in (1, -1)]
    return f"Capsule(from: {ron.vector(ends[0])}, to: {ron.vector(ends[1])}, radius: {ron.length(geom.size[0])})"


def cylinder(geom: Geom, frame: Frame) -> str | None:
    """A cylinder in the plane is a box; one that is perpendicular to it is a ball."""
    if geom.is_along_normal:
        return ball(geom, frame)
    if not geom.is_in_plane:
        return None
    return rectangle(geom, frame, geom.direction, float(geom.size[1]), float(geom.size[0]))


def box(geom: Geom, frame: Frame) -> str | None:
    """A box of which one edge is perpendicular to the plane."""
    axis = geom.axis_along_normal()
    if axis is None:
        return None
    first, second = (axis + 1) % 3, (axis + 2) % 3
    direction = geom.plane.project(geom.rotation[:, first])
    return rectangle(geom, frame, direction, float(geom.size[first]), float(geom.size[second]))


def rectangle(geom: Geom, frame: Frame, direction: Array, along: float, across: float) -> str:
    """A box with its half sizes along a direction of the world and across it, turned by less than a quarter turn."""
    x, y = frame.direction(direction)
    quarters, angle = divmod(math.atan2(y, x) + math.pi / 4, math.pi / 2)
    half_size = np.array([along, across] if quarters % 2 == 0 else [across, along])
    angle = float(ron.length(angle - math.pi / 4))
    turned = f", angle: {ron.number(angle)}" if angle else ""
    return f"Box({centered(geom, frame)}half_size: {ron.vector(half_size)}{turned})"


def half_space(geom: Geom, frame: Frame) -> str | None:
    """A plane whose normal is in the plane of the model."""
    if not geom.is_in_plane:
        return None
    point, normal = frame.point(geom.position), frame.direction(geom.direction)
    # The nearest point to the origin, along the normal: a plane has no other position.
    nearest = float(point @ normal) * normal
    at = "" if ron.vector(nearest) == "(0.0, 0.0)" else f"point: {ron.vector(nearest)}, "
    return f"HalfSpace({at}normal: {ron.vector(normal)})"


def centered(geom: Geom, frame: Frame) -> str:
    """The field `center`, left out at the origin."""
    center = ron.vector(frame.point(geom.position))
    return "" if center == "(0.0, 0.0)" else f"center: {center}, "
