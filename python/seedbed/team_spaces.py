"""What a team observes and does, from Gymnasium's spaces, and its actions as the environments take them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from .recorded_axes import Ranges, observation_axes

if TYPE_CHECKING:
    from ._native import Task

Quantity: TypeAlias = tuple[str, str, float, float]
"""Name, unit, and ends of the range."""

Component: TypeAlias = tuple[Quantity, list[float] | None]
"""A component of an action: its range, and the values of a discrete one."""

Convert: TypeAlias = Callable[[NDArray[Any]], Any]
"""Turns the actions of all agents, one column per component, into those that vector environments take."""

UNSCALED = (-1.0, 1.0)
"""Range of an observation without finite bounds: networks get it as it is."""

MAX_NUMBERS = 1000
"""Maximum number of numbers of an observation."""


def observed_quantities(
    space: spaces.Space[Any], task: Task | None, names: Sequence[str] | None, ranges: Ranges
) -> list[Quantity]:
    """The observed numbers, in order.

    Raises:
        TypeError: The space is no Box of at most 1000 numbers.
        ValueError: Names or ranges do not fit.
    """
    if not isinstance(space, spaces.Box):
        raise TypeError(
            f"the observation space is {space}, expected a Box: wrap the environments with "
            "gymnasium.wrappers.FlattenObservation (vector environments: gymnasium.wrappers.vector.FlattenObservation) first"
        )
    if not 0 < math.prod(space.shape) <= MAX_NUMBERS:
        raise TypeError(f"an observation has the shape {space.shape}, expected 1 to {MAX_NUMBERS} numbers")
    if task is not None and space.shape != (len(task.observations),):
        raise ValueError(f"an observation has the shape {space.shape}, but the task has {len(task.observations)} observations")
    axes = observation_axes(space, task, names, None, ranges, None)
    quantities = []
    for axis in axes:
        is_scaled = axis.low is not None and axis.high is not None and axis.low < axis.high
        low, high = (axis.low, axis.high) if is_scaled else UNSCALED
        quantities.append((axis.name, axis.unit, float(low or 0.0), float(high or 0.0)))
    return quantities


def components_of(space: spaces.Space[Any], task: Task | None) -> list[Component]:
    """The components of an action, in order.

    Raises:
        TypeError: The space is of another type, or a Box without finite bounds.
        ValueError: The task has other actions.
    """
    components = _components(space, "action")
    if task is None:
        return components
    of_task: list[Component] = [
        ((action.name, action.unit, *action.range), None if action.values is None else list(action.values))
        for action in task.actions
    ]
    counts = [[None if values is None else len(values) for _, values in each] for each in (components, of_task)]
    if counts[0] != counts[1]:
        raise ValueError(f"the action space is {space}, expected that of the task `{task.name}`")
    return of_task


def _components(space: spaces.Space[Any], name: str) -> list[Component]:
    match space:
        case spaces.Discrete():
            return _discrete(name, [int(space.n)])
        case spaces.MultiDiscrete():
            return _discrete(name, space.nvec.reshape(-1).tolist(), is_numbered=True)
        case spaces.MultiBinary():
            return _discrete(name, [2] * math.prod(space.shape), is_numbered=True)
        case spaces.Box():
            return _continuous(name, space)
        case spaces.Dict():
            return [component for key, part in space.spaces.items() for component in _components(part, str(key))]
    raise TypeError(
        f"the action space is {space}, expected Discrete, MultiDiscrete, MultiBinary, Box or a Dict of them: "
        "wrap the environments with gymnasium.wrappers.TransformAction first"
    )


def _discrete(name: str, counts: list[int], *, is_numbered: bool = False) -> list[Component]:
    names = [f"{name}_{i}" for i in range(len(counts))] if is_numbered else [name]
    return [
        ((each, "", 0.0, float(max(count - 1, 1))), [float(value) for value in range(count)])
        for each, count in zip(names, counts, strict=True)
    ]


def _continuous(name: str, space: spaces.Box) -> list[Component]:
    lows, highs = (bounds.reshape(-1).astype(np.float64).tolist() for bounds in (space.low, space.high))
    # Only what is different in single precision is a range.
    if not all(math.isfinite(np.float32(bound)) for bound in lows + highs) or any(
        np.float32(low) >= np.float32(high) for low, high in zip(lows, highs, strict=True)
    ):
        raise TypeError(
            f"the action space is {space}, expected finite bounds, each lower one below the upper one: wrap the environments "
            "with gymnasium.wrappers.RescaleAction or TransformAction first"
        )
    names = [name] if len(lows) == 1 else [f"{name}_{i}" for i in range(len(lows))]
    return [((each, "", low, high), None) for each, low, high in zip(names, lows, highs, strict=True)]


def conversion_to(space: spaces.Space[Any]) -> Convert | None:
    """What turns the native actions of all agents into actions of the space; None if they are the same.

    Native actions are int64 `[K]` for a single discrete component, int64 `[K, components]` for several, and otherwise
    float32 `[K, components]`.
    """
    match space:
        case spaces.Discrete():
            return None if space.start == 0 and space.dtype == np.int64 else _converted(space)
        case spaces.MultiDiscrete():
            is_same = len(space.shape) == 1 and space.shape[0] > 1 and space.dtype == np.int64 and not space.start.any()
            return None if is_same else _converted(space)
        case spaces.Box():
            return None if len(space.shape) == 1 and space.dtype == np.float32 else _converted(space)
    return _converted(space)


def _converted(space: spaces.Space[Any]) -> Convert:
    def convert(actions: NDArray[Any]) -> Any:
        return _actions(space, actions.reshape(len(actions), -1))

    return convert


def _actions(space: spaces.Space[Any], columns: NDArray[Any]) -> Any:
    """Actions of a space, of which each component has a column."""
    rows = len(columns)
    match space:
        case spaces.Discrete():
            return columns[:, 0].astype(space.dtype) + space.start
        case spaces.MultiDiscrete():
            return columns.astype(space.dtype).reshape(rows, *space.shape) + space.start
        case spaces.Box():
            numbers = np.rint(columns) if np.issubdtype(space.dtype, np.integer) else columns
            numbers = numbers.astype(np.float64).reshape(rows, *space.shape)
            return np.clip(numbers, space.low, space.high).astype(space.dtype)
        case spaces.Dict():
            actions, first = {}, 0
            for key, part in space.spaces.items():
                width = len(_components(part, key))
                actions[key] = _actions(part, columns[:, first : first + width])
                first += width
            return actions
    return columns.astype(space.dtype).reshape(rows, *(space.shape or ()))


def space_to_dict(space: spaces.Space[Any]) -> dict[str, Any]:
    """A space as a dictionary of texts, numbers and lists, which `space_from_dict` reads."""
    match space:
        case spaces.Discrete():
            return {"Discrete": {"n": int(space.n), "start": int(space.start)}}
        case spaces.MultiDiscrete():
            return {"MultiDiscrete": {"nvec": space.nvec.tolist(), "start": space.start.tolist(), "dtype": str(space.dtype)}}
        case spaces.MultiBinary():
            return {"MultiBinary": {"n": space.n if isinstance(space.n, int) else list(space.n)}}
        case spaces.Box():
            return {"Box": {"low": space.low.tolist(), "high": space.high.tolist(), "dtype": str(space.dtype)}}
        case spaces.Dict():
            return {"Dict": {key: space_to_dict(part) for key, part in space.spaces.items()}}
    raise TypeError(f"the space is {space}, expected one that a team can have")


def space_from_dict(given: Mapping[str, Any]) -> spaces.Space[Any]:
    """The space that `space_to_dict` described."""
    kind, content = next(iter(given.items()))
    match kind:
        case "Discrete":
            return spaces.Discrete(content["n"], start=content["start"])
        case "MultiDiscrete":
            return spaces.MultiDiscrete(
                np.array(content["nvec"]), dtype=np.dtype(content["dtype"]).type, start=np.array(content["start"])
            )
        case "MultiBinary":
            return spaces.MultiBinary(content["n"])
        case "Box":
            dtype = np.dtype(content["dtype"])
            return spaces.Box(np.array(content["low"], dtype), np.array(content["high"], dtype), dtype=dtype.type)
    return spaces.Dict([(key, space_from_dict(part)) for key, part in content.items()])
