"""Components of actions as numbers: the values that discrete actions choose, in the order of their axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray


def action_numbers(space: spaces.Space[Any], task: Any) -> Callable[[Any], Any] | None:
    """Function from an action to its components; None if NumPy assigns them as they are."""
    if task is not None:
        values = [None if action.values is None else np.array(action.values, np.float32) for action in task.actions]
        if isinstance(space, spaces.Dict):
            names = [action.name for action in task.actions]
            return lambda action: [_value(action[name], one) for name, one in zip(names, values, strict=True)]
        if values[0] is not None:
            return lambda action: [_value(one, table) for one, table in zip(np.reshape(action, -1), values, strict=True)]
        return None
    if isinstance(space, spaces.Dict):
        return lambda action: list(_numbers_of_dict(space, action))
    return None if len(space.shape or ()) <= 1 else lambda action: np.reshape(action, -1)


def _value(action: Any, values: NDArray[np.float32] | None) -> Any:
    """The value that a discrete action chooses, or a continuous action itself."""
    return np.reshape(action, ()) if values is None else values[int(action)]


def _numbers_of_dict(space: spaces.Dict, action: Any) -> Iterator[Any]:
    """The numbers of an action, in the order of their axes."""
    for key, part in space.spaces.items():
        yield from _numbers_of_dict(part, action[key]) if isinstance(part, spaces.Dict) else np.ravel(action[key])


def batch_action_numbers(space: spaces.Space[Any], task: Any) -> Callable[[Any], NDArray[Any]]:
    """Function from the actions of n copies to their components: `[n, components]`."""
    if isinstance(space, spaces.Dict):
        one = action_numbers(space, task)
        assert one is not None

        def of_dict(actions: Any) -> NDArray[Any]:
            copies = len(next(iter(actions.values())))
            return np.array([one({key: part[copy] for key, part in actions.items()}) for copy in range(copies)])

        return of_dict
    if task is not None and task.actions[0].values is not None:
        tables = [np.array(action.values, np.float32) for action in task.actions]

        def of_indices(actions: Any) -> NDArray[Any]:
            indices = np.reshape(np.asarray(actions), (-1, len(tables)))
            return np.stack([table[indices[:, number]] for number, table in enumerate(tables)], axis=1)

        return of_indices
    return lambda actions: np.reshape(actions, (len(actions), -1))
