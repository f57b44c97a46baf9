"""Gymnasium's spaces of a task."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ._native import Action, Task


def observation_space(task: Task) -> spaces.Space[NDArray[np.float32]]:
    """Space of the observations of a task: float32, `[observations]`, without bounds.

    Display ranges (`task.observations[i].range`) are no bounds: values outside occur.
    """
    space = spaces.Box(-np.inf, np.inf, (len(task.observations),), np.float32)
    return cast("spaces.Space[NDArray[np.float32]]", space)


def action_space(task: Task) -> spaces.Space[Any]:
    """Space of the actions of a task.

    Returns:
        * `Discrete(n)` for a single discrete component: the index of one of its n values.
        * `MultiDiscrete([n, …])` for several discrete components: int64, `[components]`.
        * `Box(low, high)` for continuous components: float32, `[components]`, each in its unit.
        * `Dict` for discrete and continuous components: for each component, under its name, `Discrete(n)`
          or a `Box` of the shape `()`.
    """
    counts = [len(action.values) for action in task.actions if action.values is not None]
    if len(counts) == len(task.actions):
        return spaces.Discrete(counts[0]) if len(counts) == 1 else spaces.MultiDiscrete(counts)
    if not counts:
        return spaces.Box(_ends(task, 0), _ends(task, 1), dtype=np.float32)
    return spaces.Dict([(action.name, _component_space(action)) for action in task.actions])


def _component_space(action: Action) -> spaces.Space[Any]:
    if action.values is not None:
        return spaces.Discrete(len(action.values))
    low, high = action.range
    return spaces.Box(np.float32(low), np.float32(high), (), np.float32)


def _ends(task: Task, end: int) -> NDArray[np.float32]:
    return np.array([action.range[end] for action in task.actions], np.float32)
