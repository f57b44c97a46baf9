"""Names, units and ranges of what is recorded: observations and components of actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from .recorded_features import Features, feature_names
from .state_files import MAX_AXES, MAX_NAME_BYTES, Axis

Range: TypeAlias = tuple[float | None, float | None]
"""Ends of an axis. An end that is None is the smallest or largest value that was visited."""

Ranges: TypeAlias = Sequence[Range | None] | Mapping[str, Range] | Literal["visited"] | None
"""Ranges of the axes of observations: of all, of some by name, or "visited" for what was visited."""

MAX_OBSERVATIONS = 1000
"""Maximum number of observations: each is an axis, so that pictures cannot be recorded."""

MAX_BOUND = 1e9
"""A bound of a Box beyond this, such as the largest float32, counts as infinite."""

RESERVED_NAMES = {"reward", "log_prob", "intrinsic_reward", "advantage", "outcome"}
"""Names of other columns of a recording."""


def observation_axes(
    space: spaces.Space[Any],
    task: Any,
    names: Sequence[str] | None,
    units: Sequence[str] | Mapping[str, str] | None,
    ranges: Ranges,
    features: Features | None,
) -> tuple[Axis, ...]:
    """The axes of the features, or of the observations in a space, with what is given in place of what is known."""
    if features is not None:
        names = feature_names(features, names)
        axes = tuple(Axis(name) for name in names)
        if not 0 < len(axes) <= MAX_OBSERVATIONS:
            raise ValueError(f"there are {len(axes)} features, expected 1 to {MAX_OBSERVATIONS}")
    else:
        axes = _task_axes(task.observations) if task is not None else _axes_of_space(space)
    count = len(axes)
    if names is not None:
        if isinstance(names, str) or len(names) != count:
            raise ValueError(f"names is {names!r}, expected {count} names: one per observation")
        axes = tuple(Axis(name, axis.unit, axis.low, axis.high) for name, axis in zip(names, axes, strict=True))
    _check_names(axes, "names")
    given_units = _by_axis(axes, units, "units")
    for unit in given_units:
        if unit is not None:
            check_text(unit, "units")
    if isinstance(ranges, str) and ranges == "visited":
        ranges = [(None, None)] * count
    given_ranges = [None if ends is None else _checked_range(ends) for ends in _by_axis(axes, ranges, "ranges")]
    return tuple(
        Axis(axis.name, axis.unit if unit is None else unit, *((axis.low, axis.high) if ends is None else ends))
        for axis, unit, ends in zip(axes, given_units, given_ranges, strict=True)
    )


def _axes_of_space(space: spaces.Space[Any]) -> tuple[Axis, ...]:
    if not isinstance(space, spaces.Box):
        raise TypeError(
            f"the observation space is {space}, expected a Box: wrap the environment with "
            "gymnasium.wrappers.FlattenObservation (of a vector environment: gymnasium.wrappers.vector.FlattenObservation) "
            "first, or record something else with features="
        )
    if not 0 < np.prod(space.shape) <= MAX_OBSERVATIONS:
        raise TypeError(
            f"observations have the shape {space.shape}, expected 1 to {MAX_OBSERVATIONS} numbers: record features instead, "
            "with features="
        )
    return _box_axes(space, "observation")


def action_axes(space: spaces.Space[Any], task: Any, names: Sequence[str] | None) -> tuple[Axis, ...]:
    """The axes of the components of an action."""
    axes = _task_axes(task.actions) if task is not None else _components(space, "action")
    if not 0 < len(axes) <= MAX_AXES:
        raise TypeError(
            f"the action space is {space} with {len(axes)} numbers, expected 1 to {MAX_AXES}: wrap the environment with "
            "gymnasium.wrappers.TransformAction first"
        )
    if names is not None:
        if isinstance(names, str) or len(names) != len(axes):
            raise ValueError(f"action_names is {names!r}, expected {len(axes)} names: one per component of an action")
        axes = tuple(Axis(name, axis.unit, axis.low, axis.high) for name, axis in zip(names, axes, strict=True))
    _check_names(axes, "action_names")
    return axes


def _components(space: spaces.Space[Any], name: str) -> tuple[Axis, ...]:
    match space:
        case spaces.Discrete():
            return (Axis(name, "", float(space.start), float(space.start + space.n - 1)),)
        case spaces.Box():
            return _box_axes(space, name)
        case spaces.MultiDiscrete() | spaces.MultiBinary():
            shape = space.shape
            highs = np.ones(shape) if isinstance(space, spaces.MultiBinary) else space.nvec + space.start - 1
            lows = np.zeros(shape) if isinstance(space, spaces.MultiBinary) else space.start
            return _numbered(name, shape, np.asarray(lows), np.asarray(highs), always_numbered=True)
        case spaces.Dict():
            return tuple(axis for key, part in space.spaces.items() for axis in _components(part, str(key)))
    raise TypeError(
        f"the action space is {space}, expected Discrete, Box, MultiDiscrete, MultiBinary or a Dict of them: "
        "wrap the environment with gymnasium.wrappers.TransformAction first"
    )


def _box_axes(space: spaces.Box, name: str) -> tuple[Axis, ...]:
    return _numbered(name, space.shape, space.low, space.high, always_numbered=False)


def _numbered(
    name: str, shape: tuple[int, ...], lows: NDArray[Any], highs: NDArray[Any], *, always_numbered: bool
) -> tuple[Axis, ...]:
    """One axis per number of an array."""
    indices = list(np.ndindex(shape))
    is_numbered = always_numbered or len(indices) > 1
    axes = []
    for index in indices:
        suffix = "".join(f"_{part}" for part in index) if is_numbered else ""
        low, high = (float(end[index]) for end in (lows, highs))
        axes.append(Axis(name + suffix, "", _finite(low), _finite(high)))
    return tuple(axes)


def _finite(bound: float) -> float | None:
    return bound if abs(bound) <= MAX_BOUND else None


def _task_axes(quantities: Any) -> tuple[Axis, ...]:
    """Axes of the observations or actions of a seedbed task."""
    return tuple(Axis(quantity.name, quantity.unit, *map(float, quantity.range)) for quantity in quantities)


def _check_names(axes: tuple[Axis, ...], argument: str) -> None:
    seen: set[str] = set()
    for name in (axis.name for axis in axes):
        if not isinstance(name, str) or not name or name != name.strip() or any(sign in name for sign in "=,\n"):
            raise ValueError(f"{argument} contains {name!r}, expected a text without '=', ',' and spaces around it")
        check_text(name, argument)
        if name in RESERVED_NAMES:
            raise ValueError(f"{argument} contains {name!r}, which is the name of another column")
        if name in seen:
            raise ValueError(f"{argument} contains {name!r} twice")
        seen.add(name)


def check_text(text: Any, argument: str) -> None:
    """Refuse what the program does not read as a name or a unit.

    Raises:
        ValueError: It is no text, no valid Unicode, or too long.
    """
    if not isinstance(text, str):
        raise ValueError(f"{argument} contains {text!r}, expected a text")
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        raise ValueError(f"{argument} contains {text!r}, which is no valid Unicode text") from None
    if size > MAX_NAME_BYTES:
        raise ValueError(f"{argument} contains a text of {size} bytes ({text[:20]!r}…), expected at most {MAX_NAME_BYTES}")


def _by_axis(axes: tuple[Axis, ...], given: Sequence[Any] | Mapping[str, Any] | None, argument: str) -> list[Any]:
    """What is given for each axis; None for all others."""
    names = [axis.name for axis in axes]
    if given is None:
        return [None] * len(names)
    if isinstance(given, Mapping):
        unknown = sorted(set(given) - set(names))
        if unknown:
            raise ValueError(f"{argument} names {unknown[0]!r}, expected names of observations: {', '.join(names)}")
        return [given.get(name) for name in names]
    if isinstance(given, str) or len(given) != len(names):
        raise ValueError(f"{argument} is {given!r}, expected {len(names)} entries: one per observation")
    return list(given)


def _checked_range(ends: Range) -> Range:
    try:
        low, high = (None if end is None else float(end) for end in ends)
    except (TypeError, ValueError):
        raise ValueError(f"ranges contains {ends!r}, expected (low, high)") from None
    finite = [end for end in (low, high) if end is not None]
    if not all(np.isfinite(np.float32(end)) for end in finite) or (len(finite) == 2 and not finite[0] < finite[1]):
        raise ValueError(f"ranges contains {ends!r}, expected finite numbers (low, high) with low < high, or None")
    return low, high
