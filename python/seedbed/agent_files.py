"""The files of the agents that a wrapper records, and the memory of the steps that wait for them."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .state_files import Header, RecordingError, StateFile, check_start, merge_folder

MAX_BUFFERED_STEPS = 4096
MAX_BUFFERED_NUMBERS = 1 << 20
"""Steps of unfinished episodes that wait in memory: at most so many, and at most 8 MB."""


class AgentFiles:
    """The files of the agents that a wrapper records, which are made when the first episodes start."""

    def __init__(self, folder: Path, headers: Sequence[Header], overwrite: bool, resume: bool) -> None:
        self.folder = folder
        self.headers = headers
        self._how: dict[str, Any] = {"overwrite": overwrite, "resume": resume, "together": len(headers)}
        self._files: list[StateFile] | None = None
        self.clock = 0
        """Steps of the environments so far, also those that are not recorded."""
        self.is_closed = False
        for header in headers:
            check_start(folder, header, **self._how)

    @property
    def files(self) -> list[StateFile]:
        if self.is_closed:
            raise RecordingError(f"the recorder of {self.folder} is closed")
        if self._files is None:
            self._files = self._open()
        return self._files

    def _open(self) -> list[StateFile]:
        """The files of all agents; if one of them cannot be recorded, none has changed."""
        files: list[StateFile] = []
        try:
            for header in self.headers:
                files.append(StateFile(self.folder, header, **self._how))
            for file in files:
                file.begin()
            self.clock = max(file.end_step for file in files)
        except BaseException:
            for file in files:
                file.release()
            raise
        return files

    def was_opened_here(self) -> bool:
        """Whether there are files, and they are not those of the process from which this one was forked."""
        return not self.is_closed and self._files is not None and self._files[0].was_made_here()

    def close(self) -> None:
        """Complete all files; if this fails for some, the others are complete."""
        files = self.files if self.was_opened_here() else []
        self.is_closed = True
        with contextlib.ExitStack() as last_first:
            if files:
                last_first.callback(self._merge)
            for file in files:
                last_first.callback(file.release)
                last_first.callback(file.close)

    def _merge(self) -> None:
        nans = merge_folder(self.folder)
        if nans:
            counts = ", ".join(f"{name} in {count}" for name, count in nans.items())
            warnings.warn(f"{self.folder}: observations are NaN in some states: {counts}", RuntimeWarning, stacklevel=2)


def warn_of_unfinished(folder: Path, steps: Sequence[int]) -> None:
    """Say which episodes `close` has left out; `steps` are their lengths."""
    if steps:
        subject = "the unfinished last episode" if len(steps) == 1 else f"the unfinished last episodes of {len(steps)} agents"
        verb, outcome = ("is", "it") if len(steps) == 1 else ("are", "them")
        warnings.warn(
            f"{folder}: {subject} ({sum(steps)} steps) {verb} not recorded; keep_unfinished=True records {outcome} as "
            "truncated, and keep_unfinished=False leaves out this message",
            RuntimeWarning,
            stacklevel=2,
        )


def number_of_reward(reward: Any) -> float:
    """A reward as a number: also an array with one number, of any shape."""
    try:
        if isinstance(reward, list) or getattr(reward, "ndim", 0) > 0:
            reward = np.asarray(reward).reshape(()).item()
        return float(reward)
    except OverflowError:
        message = "a reward is too large for double precision: such numbers are recorded as infinite"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
        return math.inf if reward > 0 else -math.inf
    except (TypeError, ValueError):
        raise TypeError(f"the reward is {reward!r}, expected a number") from None


def reshaped(values: Any, shape: tuple[int, ...], name: str) -> NDArray[Any]:
    """Values in another shape; an error says the `name` of what has another number of values."""
    try:
        return np.reshape(values, shape)
    except ValueError:
        raise ValueError(f"{name} has the shape {np.shape(values)}, expected {shape} numbers") from None


def buffered_steps(headers: Sequence[Header]) -> int:
    """Number of steps of each agent that wait in memory."""
    numbers = len(headers[0].observations) + len(headers[0].actions) + 1
    return max(16, min(MAX_BUFFERED_STEPS, MAX_BUFFERED_NUMBERS // (numbers * len(headers))))
