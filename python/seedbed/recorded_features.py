"""Features: numbers that are recorded in place of observations, such as those of pictures or entries of `info`."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Features: TypeAlias = "Callable[[Any, dict[str, Any]], Sequence[float] | NDArray[Any]] | Sequence[str]"
"""A function of an observation and its `info` that returns numbers, or names of entries of `info`."""


STATES_BEFORE_WARNING = 50
"""Some entries are there at the end of an episode only."""


def feature_names(features: Features, names: Sequence[str] | None) -> Sequence[str]:
    """Names of the features: those of the entries of `info`, unless names are given.

    Raises:
        TypeError: It is no such function or list.
        ValueError: Features of a function have no names, or there are more or fewer names than entries.
    """
    if callable(features):
        if names is None:
            raise ValueError("the features are those of a function; name them, such as names=['x', 'y']")
        return names
    if isinstance(features, str) or not all(isinstance(entry, str) for entry in features):
        raise TypeError(f"features is {features!r}, expected a function of (observation, info), or names of entries of info")
    if names is not None and len(names) != len(features):
        raise ValueError(f"names is {names!r}, expected {len(features)} names: one per feature")
    return features if names is None else names


def feature_function(features: Features | None) -> Callable[[Any, Any], Any] | None:
    """Function from an observation and its `info` to the features; None if observations are recorded. An entry that `info`
    does not have, as after a reset, is NaN."""
    if features is None or callable(features):
        return features
    return _Entries(features)


class _Entries:
    """Entries of `info`. Warns of those that none of the first states has: their names may be misspelled."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._missing = set(names)
        self._others: set[str] = set()
        self._states_left = STATES_BEFORE_WARNING

    def __call__(self, _: Any, info: Any) -> list[Any]:
        if self._missing and self._states_left > 0:
            self._watch(info)
        return [info.get(name, math.nan) for name in self._names]

    def _watch(self, info: Any) -> None:
        self._missing -= set(info)
        self._others |= set(info)
        self._states_left -= 1
        if self._missing and self._states_left == 0:
            missing, others = (", ".join(sorted(map(str, names))) for names in (self._missing, self._others))
            message = f"info had no {missing} in the first {STATES_BEFORE_WARNING} states, only {others or 'nothing'}: they are recorded as NaN"
            warnings.warn(message, RuntimeWarning, stacklevel=2)


def features_of_copies(features: Callable[[Any, Any], Any], observations: Any, infos: Any, copies: int) -> NDArray[Any]:
    """Features of all copies of a vector environment: `[copies, features]`."""
    rows = [features(part_of(observations, copy), info_of(infos, copy)) for copy in range(copies)]
    return np.array(rows, np.float64)


def part_of(observations: Any, copy: int) -> Any:
    """The observation of one copy: also of a Dict or a Tuple."""
    if isinstance(observations, Mapping):
        return {key: part_of(part, copy) for key, part in observations.items()}
    if isinstance(observations, tuple):
        return tuple(part_of(part, copy) for part in observations)
    return observations[copy]


def info_of(infos: Any, copy: int) -> dict[str, Any]:
    """The `info` of one copy: infos are a list of them, or have an array and a mask for each entry."""
    return dict(_entries(infos, copy)) if isinstance(infos, Mapping) else infos[copy]


def _entries(infos: Mapping[str, Any], copy: int) -> Iterator[tuple[str, Any]]:
    for name, values in infos.items():
        mask = infos.get(f"_{name}")
        if name.startswith("_") or (mask is not None and not mask[copy]):
            continue
        yield name, info_of(values, copy) if isinstance(values, Mapping) else values[copy]
