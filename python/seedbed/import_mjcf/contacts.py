"""Which geoms can touch each other, by MuJoCo's rules, and how the task file says so."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from .joints import has_default_shape
from .plane import WORLD, Plane
from .shapes import Geom, shape, why_not
from .source import Source

Pair = tuple[int, int]

GROUPS = 32
"""Collision groups of the task file."""

ZERO = 1e-9


@dataclass
class Surface:
    """What a geom has as a collider of the task file."""

    friction: float
    contype: int
    conaffinity: int


@dataclass(frozen=True, order=True)
class Softness:
    """MuJoCo's parameters of softness: solref, and dmax of solimp."""

    solref: tuple[float, float]
    dmax: float

    def __str__(self) -> str:
        return f'solref="{self.solref[0]:g} {self.solref[1]:g}" with dmax {self.dmax:g}'


@dataclass
class Contacts:
    """All surfaces, by the index of their geom."""

    surfaces: dict[int, Surface]
    softness: Softness | None
    """MuJoCo's parameters of softness that all contacts share."""
    pairs: list[Pair]


class Owners:
    """The body of the task file to which each geom belongs, and which bodies a joint connects.

    Args:
        of_geom: Index of the body of the task file by geom; 0 for the world.
        joined: Pairs of bodies, other than the world, that one joint connects; such bodies cannot touch in the task file.
    """

    def __init__(self, of_geom: list[int], joined: set[Pair]) -> None:
        self.of_geom = of_geom
        self.joined = joined

    def can_touch(self, pair: Pair) -> bool:
        """Whether groups alone decide about a pair."""
        first, second = (self.of_geom[geom] for geom in pair)
        return first != second and (min(first, second), max(first, second)) not in self.joined


def find_contacts(source: Source, plane: Plane, geoms: list[Geom], owners: Owners) -> Contacts:
    """Surfaces, groups and properties of all geoms that can touch others.

    What the task file cannot express is an error of the source's report.
    """
    allowed = [pair for pair in combinations(range(len(geoms)), 2) if mujoco_allows(source, pair)]
    met = [pair for pair in allowed if can_meet(source, plane, geoms, pair)]
    report_walls(source, geoms, met)
    pairs = [pair for pair in met if not is_wall(geoms, pair)]
    check_shapes(source, geoms, pairs)
    check_depths(source, geoms, pairs)
    check_joined(source, owners, pairs)
    report_overlaps(source, pairs)
    colliders = sorted({geom for pair in pairs for geom in pair})
    free = free_pairs(source, plane, geoms, owners, colliders, set(pairs))
    bits = groups(source, colliders, pairs, free)
    frictions = find_frictions(source, colliders, pairs)
    check_properties(source, colliders)
    surfaces = {geom: Surface(frictions[geom], *bits[geom]) for geom in colliders}
    return Contacts(surfaces, common_softness(source, pairs), pairs)


# Which pairs MuJoCo lets touch


def mujoco_allows(source: Source, pair: Pair) -> bool:
    """MuJoCo's rules: flags, explicit pairs, groups, excluded bodies, bodies that are rigidly connected or parent and child."""
    if source.is_disabled("contact") or source.is_disabled("constraint"):
        return False
    return is_explicit(source, pair) or (groups_match(source, pair) and bodies_match(source, pair))


def is_explicit(source: Source, pair: Pair) -> bool:
    model = source.model
    explicit = zip(model.pair_geom1, model.pair_geom2, strict=True)
    return any({int(first), int(second)} == set(pair) for first, second in explicit)


def groups_match(source: Source, pair: Pair) -> bool:
    contype, conaffinity = source.model.geom_contype, source.model.geom_conaffinity
    first, second = pair
    return bool(contype[first] & conaffinity[second] or contype[second] & conaffinity[first])


def bodies_match(source: Source, pair: Pair) -> bool:
    model = source.model
    bodies = sorted(int(model.geom_bodyid[geom]) for geom in pair)
    if (bodies[0] << 16) + bodies[1] in {int(signature) for signature in model.exclude_signature}:
        return False
    welds = [int(model.body_weldid[body]) for body in bodies]
    parents = [int(model.body_weldid[model.body_parentid[weld]]) for weld in welds]
    if welds[0] == welds[1]:
        return False
    filters_parents = not source.is_disabled("filterparent") and 0 not in welds
    return not (filters_parents and (welds[0] == parents[1] or welds[1] == parents[0]))


# Which pairs can meet


def can_meet(source: Source, plane: Plane, geoms: list[Geom], pair: Pair) -> bool:
    """Whether two geoms can touch in some configuration; geometry perpendicular to the plane never changes."""
    first, second = (geoms[geom] for geom in pair)
    margin = float(source.model.geom_margin[first.index] + source.model.geom_margin[second.index])
    if first.kind == second.kind == "plane":
        return False
    if is_wall(geoms, pair):
        return touches_wall(first, second, margin)
    (low, high), (other_low, other_high) = first.extent(), second.extent()
    if low >= other_high + margin or other_low >= high + margin:
        return False
    return distance_bound(source, plane, first, second) < margin


def is_wall(geoms: list[Geom], pair: Pair) -> bool:
    """Whether one of the two is a plane parallel to the plane of the model."""
    return any(geoms[geom].kind == "plane" and geoms[geom].is_along_normal for geom in pair)


def touches_wall(first: Geom, second: Geom, margin: float) -> bool:
    wall, other = (first, second) if first.kind == "plane" else (second, first)
    normal = wall.rotation[:, 2]
    return float(normal @ (other.center - wall.center)) - other.half_extent(normal) < margin - ZERO


def distance_bound(source: Source, plane: Plane, first: Geom, second: Geom) -> float:
    """A lower bound of the distance of two geoms over all configurations, m; -inf if bodies slide."""
    (center, reach), (other_center, other_reach) = (reachable(source, plane, geom) for geom in (first, second))
    for geom, point, radius in ((first, other_center, other_reach), (second, center, reach)):
        if geom.kind == "plane":
            return float(geom.direction @ (point - geom.position)) - radius if geom.is_in_plane else -math.inf
    return float(np.linalg.norm(center - other_center)) - reach - other_reach


def reachable(source: Source, plane: Plane, geom: Geom) -> tuple[np.ndarray, float]:
    """A disc in the plane that contains a geom in all configurations: center `[2]` and radius (m)."""
    model = source.model
    point, radius = geom.position, geom.bounding_radius
    body = int(model.geom_bodyid[geom.index])
    while body != 0:
        joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
        for joint in reversed(joints):
            if source.kind_of("mjtJoint", "mjJNT_", model.jnt_type[joint]) != "hinge":
                return point, math.inf
            anchor = plane.project(source.data.xanchor[joint])
            radius += float(np.linalg.norm(point - anchor))
            point = anchor
        body = int(model.body_parentid[body])
    return point, radius


# What the task file cannot express


def report_walls(source: Source, geoms: list[Geom], pairs: list[Pair]) -> None:
    for pair in pairs:
        if is_wall(geoms, pair):
            wall, other = sorted(pair, key=lambda geom: geoms[geom].kind != "plane")
            message = f"it always touches {source.label('geom', other)}: expected a distance perpendicular to the plane of the model"
            source.report.error(source.label("geom", wall), message)


def check_shapes(source: Source, geoms: list[Geom], pairs: list[Pair]) -> None:
    for geom in sorted({geom for pair in pairs for geom in pair}):
        if shape(geoms[geom], WORLD) is None:
            message = f'type="{geoms[geom].kind}" of a geom that can touch others: {why_not(geoms[geom])}, or contype="0" conaffinity="0"'
            source.report.error(source.label("geom", geom), message)


def check_depths(source: Source, geoms: list[Geom], pairs: list[Pair]) -> None:
    """Round geoms that are not in the same plane touch later than their shapes in the plane."""
    for pair in pairs:
        (low, high), (other_low, other_high) = (geoms[geom].core() for geom in pair)
        if low > other_high + ZERO or other_low > high + ZERO:
            other = source.label("geom", pair[1])
            message = f"it is not at the depth of {other}: they touch earlier in the plane than in space"
            source.report.warning(source.label("geom", pair[0]), message)


def check_joined(source: Source, owners: Owners, pairs: list[Pair]) -> None:
    for pair in pairs:
        if not owners.can_touch(pair):
            message = f"it can touch {source.label('geom', pair[1])}, but a joint connects their bodies: expected an <exclude>"
            source.report.error(source.label("geom", pair[0]), message)


def report_overlaps(source: Source, pairs: list[Pair]) -> None:
    """Geoms that overlap in the reference pose are pushed apart at the start of an episode."""
    data = source.mujoco.MjData(source.model)
    source.mujoco.mj_forward(source.model, data)
    for contact in data.contact:
        first, second = sorted(int(geom) for geom in contact.geom)
        if contact.dist < -ZERO and (first, second) in pairs:
            message = f"it overlaps {source.label('geom', second)} by {-contact.dist:.3g} m in the reference pose"
            source.report.warning(source.label("geom", first), message)


# Groups


def free_pairs(
    source: Source, plane: Plane, geoms: list[Geom], owners: Owners, colliders: list[int], pairs: set[Pair]
) -> set[Pair]:
    """Pairs for which groups do not matter: they cannot touch whatever these are."""

    def is_free(pair: Pair) -> bool:
        if pair in pairs:
            return False
        first, second = (geoms[geom] for geom in pair)
        is_static = all(owners.of_geom[geom] == 0 for geom in pair)
        return is_static or not owners.can_touch(pair) or distance_bound(source, plane, first, second) > 0

    return {pair for pair in combinations(colliders, 2) if is_free(pair)}


def groups(source: Source, colliders: list[int], pairs: list[Pair], free: set[Pair]) -> dict[int, tuple[int, int]]:
    """`contype` and `conaffinity` that let exactly these pairs touch: those of the model if they do."""
    model = source.model
    original = {
        geom: (int(model.geom_contype[geom]) & 0xFFFFFFFF, int(model.geom_conaffinity[geom]) & 0xFFFFFFFF)
        for geom in colliders
    }
    expected = set(pairs)

    def is_right(pair: Pair) -> bool:
        (contype, conaffinity), (other_contype, other_conaffinity) = original[pair[0]], original[pair[1]]
        touches = bool(contype & other_conaffinity or other_contype & conaffinity)
        return pair in free or touches == (pair in expected)

    if all(is_right(pair) for pair in combinations(colliders, 2)):
        return original
    return new_groups(source, colliders, expected)


def new_groups(source: Source, colliders: list[int], pairs: set[Pair]) -> dict[int, tuple[int, int]]:
    """One group for all surfaces that touch the same others."""
    neighbors = {geom: frozenset(sum(pair) - geom for pair in pairs if geom in pair) for geom in colliders}
    kinds = sorted(set(neighbors.values()), key=lambda kind: min(geom for geom in colliders if neighbors[geom] == kind))
    if len(kinds) > GROUPS:
        message = f"geoms that can touch form {len(kinds)} groups, expected at most {GROUPS}: use fewer <exclude> elements and geoms"
        source.report.error("contact", message)
        return {geom: (1, 1) for geom in colliders}
    bit = {geom: 1 << kinds.index(neighbors[geom]) for geom in colliders}
    return {geom: (bit[geom], sum({bit[other] for other in neighbors[geom]})) for geom in colliders}


# Friction and softness


@dataclass
class PairProperties:
    """Properties of one contact by MuJoCo's rules."""

    friction: float
    softness: Softness


def properties(source: Source, pair: Pair) -> PairProperties:
    """MuJoCo's rules: the higher priority decides; otherwise the larger friction, and a mixture of the softness."""
    model = source.model
    for index, geoms in enumerate(zip(model.pair_geom1, model.pair_geom2, strict=True)):
        if {int(geom) for geom in geoms} == set(pair):
            friction = float(model.pair_friction[index][0]) if model.pair_dim[index] > 1 else 0.0
            return PairProperties(friction, softness_of(model.pair_solref[index], model.pair_solimp[index]))
    priorities = [int(model.geom_priority[geom]) for geom in pair]
    deciding = [geom for geom in pair if model.geom_priority[geom] == max(priorities)]
    dimensions = max(int(model.geom_condim[geom]) for geom in deciding)
    friction = max(float(model.geom_friction[geom][0]) for geom in deciding)
    return PairProperties(friction if dimensions > 1 else 0.0, mixed_softness(source, deciding))


def softness_of(solref: np.ndarray, solimp: np.ndarray) -> Softness:
    return Softness((float(solref[0]), float(solref[1])), float(solimp[1]))


def mixed_softness(source: Source, geoms: list[int]) -> Softness:
    """The mean, weighted by solmix; of negative numbers, which are no time constants, the smaller ones."""
    model = source.model
    solrefs = [np.array(model.geom_solref[geom]) for geom in geoms]
    solimps = [np.array(model.geom_solimp[geom]) for geom in geoms]
    weights = np.array([float(model.geom_solmix[geom]) for geom in geoms])
    shares = weights / weights.sum() if weights.sum() > 0 else np.full(len(geoms), 1 / len(geoms))
    mixed_solimp = sum(share * solimp for share, solimp in zip(shares, solimps, strict=True))
    if min(solref[0] for solref in solrefs) <= 0:
        return softness_of(np.min(solrefs, axis=0), mixed_solimp)
    if all(np.array_equal(solref, solrefs[0]) for solref in solrefs):
        return softness_of(solrefs[0], mixed_solimp)
    return softness_of(sum(share * solref for share, solref in zip(shares, solrefs, strict=True)), mixed_solimp)


def find_frictions(source: Source, colliders: list[int], pairs: list[Pair]) -> dict[int, float]:
    """Friction of each surface, of which the task uses the larger one of two. Pairs that differ are reported."""
    expected = {pair: properties(source, pair).friction for pair in pairs}
    of_geom = {geom: [friction for pair, friction in expected.items() if geom in pair] for geom in colliders}
    own = {geom: float(source.model.geom_friction[geom][0]) for geom in colliders}
    frictions = {geom: min(own[geom], max(of_geom[geom])) for geom in colliders}
    for pair, friction in expected.items():
        found = max(frictions[geom] for geom in pair)
        if not math.isclose(found, friction, abs_tol=ZERO):
            report_friction(source, pair, friction, found)
    return frictions


def report_friction(source: Source, pair: Pair, expected: float, found: float) -> None:
    first, second = (source.label("geom", geom) for geom in pair)
    if expected == 0:
        message = f'its contact with {second} has condim="1", no friction: in the task it has the friction {found:g}'
        source.report.warning(first, message)
        return
    message = (
        f"its contact with {second} has the friction {expected:g}, but the larger one of the two surfaces' is {found:g}: "
        "expected no priority, and no <pair> with another friction"
    )
    source.report.error(first, message)


def common_softness(source: Source, pairs: list[Pair]) -> Softness | None:
    """The softness of all contacts; if they differ, that of most of them."""
    found = [properties(source, pair).softness for pair in pairs]
    different = sorted(set(found), key=found.count, reverse=True)
    if len(different) > 1:
        counts = ", ".join(f"{value} of {found.count(value)} pairs" for value in different)
        source.report.warning(
            "contacts", f"their softness differs: {counts}; all contacts of the task have the first one"
        )
    return different[0] if different else None


def check_properties(source: Source, colliders: list[int]) -> None:
    """Properties of geoms that the task file does not have."""
    model = source.model
    moving = source.array("geom_surfacevel", 0.0, model.ngeom)
    sticky = source.array("geom_adhesion", 0.0, model.ngeom)
    for geom in colliders:
        label = source.label("geom", geom)
        changes = {
            "margin is left out": model.geom_margin[geom] != 0,
            "gap is left out": model.geom_gap[geom] != 0,
            "torsional and rolling friction (condim larger than 3) is left out": model.geom_condim[geom] > 3,
            "of solimp only dmax, its second number, is used": not has_default_shape(model.geom_solimp[geom]),
        }
        for message in (message for message, is_found in changes.items() if is_found):
            source.report.warning(label, message)
        if np.any(moving[geom]) or np.any(sticky[geom]):
            source.report.error(label, "surfacevel and adhesion are not expressible: expected 0")
