"""Environments of Gymnasium as tasks of the program."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from pathlib import Path
from typing import Any, Literal

from . import functions
from .ron import Expression, struct, with_lists


ID = re.compile(r"[\w.\-/]+-v\d+|[\w.]+:[\w.\-/]+|.+\.py:\w+")
"""Names that only environments of Gymnasium have: with a version, of a module or of a file of Python."""

PLACE_OF_ID = re.compile(r"environment( \S+| with set)?(:\d+:\d+)?: in `(environment\.)?id`: ")
"""How an error begins that is about the id of an environment in a text that was written for one call."""


@dataclass(frozen=True, repr=False)
class Gymnasium:
    """An environment of Gymnasium as a task, for `train`, `check` and studies.

    Args:
        id: `"CartPole-v1"`, `"module:Name-v0"`, `"module:Class"`, `"file.py:function"`, or a class of environments or a function
            that returns one: also one of a notebook, which worker processes get pickled by value.
        kwargs: Arguments of the environment or of the function: numbers, texts, lists and maps.
        names: Names of all observed numbers, in order; by default those of the observation space.
        units: Units of observed numbers, such as `{"x": "m"}`.
        ranges: Ranges of observed numbers, such as `{"x": (0, 9)}`: they are displayed, their coverage is counted, and inputs
            of networks are scaled with them. By default finite bounds, otherwise what random actions reach.
        time_limit: Steps after which an episode is truncated; by default that of the environment.
        reward_threshold: Mean return at which the task counts as solved; by default that of the environment.
        discrete: How discrete observations are given to agents; by default `"OneHot"`.
        workers: Number of worker processes; by default one per thread. Results do not depend on it.
        step_timeout: Time after which a reset or a step counts as hanging, s; by default 60.
        probe_steps: Number of random steps with which ranges are found; by default 10,000.
        log_info: Names of entries of `info` that are recorded beside the observations.
        description: One sentence for people.

    Example:
        >>> maze = Gymnasium("CartPole-v1", ranges={"observation_1": (-3, 3)})
        >>> f"environment={maze}"  # as in `set=` of `train` and of studies
        'environment=Gymnasium(id: "CartPole-v1", ranges: {"observation_1": (-3, 3)})'
    """

    id: str | Callable[..., Any]
    _: KW_ONLY
    kwargs: Mapping[str, Any] | None = None
    names: Sequence[str] | None = None
    units: Mapping[str, str] | None = None
    ranges: Mapping[str, tuple[float, float]] | None = None
    time_limit: int | None = None
    reward_threshold: float | None = None
    discrete: Literal["OneHot", "Number"] | None = None
    workers: int | None = None
    step_timeout: float | None = None
    probe_steps: int | None = None
    log_info: Sequence[str] | None = None
    description: str | None = None

    @property
    def name(self) -> str:
        """Name of the task."""
        if isinstance(self.id, str):
            return self.id.rpartition(":")[2].replace("/", "-").replace("\\", "-")
        return functions.name_of(self.id)

    def text(self, folder: Path | None = None, stored: Path | None = None) -> str:
        """The task as in a scenario.

        Args:
            folder: Folder to which the file of a function is written; see `functions.environment_id`.
            stored: The file of the function in the folder of the run that is resumed.

        Raises:
            TypeError: A setting has another type, or the function cannot be pickled.
        """
        if isinstance(self.id, str):
            file, colon, function = self.id.rpartition(":")
            # Relative to the working directory, not to the file that the text is written to.
            is_file = folder is not None and file.endswith(".py")
            id = f"{os.path.abspath(file)}{colon}{function}" if is_file else self.id
        elif folder is None:
            raise TypeError(f"the environment {self.name} is a function, which has no text: write it into a file, such as id='file.py:{self.name}'")
        elif callable(self.id):
            id = functions.environment_id(self.id, folder, stored)
        else:
            raise TypeError(f"the environment is {self.id!r}, expected an id or a function that returns an environment, such as lambda: …")
        settings = {field.name: getattr(self, field.name) for field in fields(self)} | {"id": id}
        if self.kwargs is not None:
            settings["kwargs"] = with_lists(self.kwargs)
        if self.discrete is not None:
            settings["discrete"] = Expression(self.discrete)
        return struct("Gymnasium", settings)

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        given = {name: value for name, value in given.items() if value is not None and name != "id"}
        return f"Gymnasium({', '.join([repr(self.id), *(f'{name}={value!r}' for name, value in given.items())])})"


def naming_environment(message: str, name: str) -> str:
    """An error in the text of a task that was written for one call: it names the environment, not the place of its id in that text.

    Example:
        >>> error = "environment with set: in `environment.id`: the environment fails\\n  | id: B\\n  |      ^\\n  = help: …"
        >>> print(naming_environment(error, "B"))
        environment B: the environment fails
          = help: …
    """
    place = PLACE_OF_ID.match(message)
    if place:
        lines = message[place.end() :].splitlines()
        message = f"environment {name}: " + "\n".join(line for line in lines if not line.startswith("  |"))
    return message.replace("add `time_limit: 1000`", "`seedbed.Gymnasium(environment, time_limit=1000)`")


def known_id(environment: Any) -> Any:
    """A text that only environments of Gymnasium have as their id, as a task; all else as it is."""
    return Gymnasium(environment) if isinstance(environment, str) and ID.fullmatch(environment) else environment
