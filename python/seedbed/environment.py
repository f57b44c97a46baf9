"""One copy of a task as a Gymnasium environment."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ._native import Batch, Task
from .seeding import checked_seed, random_seed
from .spaces import action_space, observation_space

TaskLike: TypeAlias = Task | str | os.PathLike[str]
"""A task, the path of a task file, or the name of a task."""

Physics: TypeAlias = Literal["rapier", "analytic"]
"""Rigid bodies, or the analytic model of a task."""

RenderMode: TypeAlias = Literal["rgb_array"]
"""Render modes of tasks with bodies."""

PICTURE_SIZE = (600, 400)
"""Width and height of pictures in pixels."""

RENDER_MODES = ("rgb_array",)


def as_task(task: TaskLike, run_seed: int | None = None) -> Task:
    """The task that is meant, drawn with `run_seed` (by default 0, or that of a `Task`)."""
    seed = None if run_seed is None else checked_seed(run_seed)
    if not isinstance(task, Task):
        return Task(task, run_seed=seed or 0)
    if seed not in (None, task.run_seed):
        raise ValueError(f"run_seed is {seed}, but the task was made with run_seed={task.run_seed}")
    return task


def rendering(batch: Batch, task: Task, render_mode: str | None) -> dict[str, Any]:
    """Gymnasium's metadata about pictures.

    Raises:
        ValueError: There is no such render mode for this task.
    """
    modes = list(RENDER_MODES) if batch.has_bodies else []
    if render_mode is not None and render_mode not in modes:
        expected = "None or " + " or ".join(map(repr, modes)) if modes else "None: the task has no bodies to draw"
        raise ValueError(f"render_mode is {render_mode!r}, expected {expected}")
    return {"render_modes": modes, "render_fps": max(1, round(1 / task.control_step))}


START_OPTIONS = ("positions", "velocities", "numbers")


Start: TypeAlias = tuple[dict[str, float], dict[str, float], dict[str, float]]
"""Numbers of a start state by name, in the order of `START_OPTIONS`."""


def given_start(batch: Batch, options: dict[str, Any] | None, *others: str) -> Start | None:
    """The start state that the options of `reset` give; None if they give none.

    Args:
        batch: The batch of the task.
        options: The options.
        others: Names of other options of `reset`, which are not read here.

    Raises:
        TypeError: An option has another type.
        ValueError: There is no such option, coordinate or number.
    """
    if options is not None and not isinstance(options, Mapping):
        raise TypeError(f"options is {options!r}, expected a dictionary or None")
    given = {name: numbers for name, numbers in (options or {}).items() if name not in others}
    for name, numbers in given.items():
        if name not in START_OPTIONS:
            raise ValueError(f"unknown option {name!r}, expected one of {', '.join([*START_OPTIONS, *others])}")
        _check_numbers(name, numbers)
    if not given:
        return None
    positions, velocities, numbers = (dict(given.get(name, {})) for name in START_OPTIONS)
    batch.check_start((positions, velocities, numbers))
    return positions, velocities, numbers


def _check_numbers(option: str, numbers: Any) -> None:
    if not isinstance(numbers, Mapping):
        raise TypeError(f"options[{option!r}] is {numbers!r}, expected a dictionary of names and numbers")
    for name, number in numbers.items():
        if not isinstance(name, str):
            raise TypeError(f"options[{option!r}] names {name!r}, expected a text")
        if isinstance(number, bool) or not isinstance(number, Real):
            raise TypeError(f"options[{option!r}][{name!r}] is {number!r}, expected a number")


Kind = TypeVar("Kind", bound="Copyable")


class Copyable:
    """An environment whose copies by `copy`, `copy.deepcopy` and `pickle` are independent of it.

    They continue with the same bits, because `Batch` is copied with its whole state.
    """

    def __copy__(self: Kind) -> Kind:
        return copy.deepcopy(self)


def set_states(batch: Batch, indices: Sequence[int], states: Sequence[bytes]) -> None:
    """Set copies of a batch to states: all of them, or none.

    Raises:
        ValueError: Bytes are not a state of this task, or their number is wrong. No copy has changed.
        IndexError: There is no such copy.
    """
    if isinstance(states, bytes) or len(states) != len(indices):
        found = "one state as bytes" if isinstance(states, bytes) else f"{len(states)} states"
        raise ValueError(f"there are {found}, expected {len(indices)}: one per copy")
    before = [(index, batch.save(index)) for index in indices]
    try:
        for index, state in zip(indices, states, strict=True):
            batch.restore(index, state)
    except (TypeError, ValueError):
        for index, state in before:
            batch.restore(index, state)
        raise


class Env(Copyable, gymnasium.Env[NDArray[np.float32], Any]):
    """One copy of a task.

    The time limit is part of the environment and of its state: no wrapper is needed.

    Observations are float32, `[observations]`, in the units of `task.observations`. Actions are those of
    `action_space`; a continuous action outside of its range is clamped to it.

    Args:
        task: A task, the path of a task file, or the name of a task; see `Task`.
        physics: "rapier" for rigid bodies, "analytic" for the task's analytic model.
        max_episode_steps: Steps after which an episode is truncated; by default those of the task, and -1
            for no limit.
        render_mode: "rgb_array" to draw the bodies, if the task has any.
        run_seed: Run seed with which tasks are drawn that differ from run to run; by default 0. See `Task`.

    Raises:
        TaskError: Something in the task file is wrong.
        FileNotFoundError: There is no such file or task.
        ValueError: An argument is invalid.

    Example:
        >>> environment = Env("cartpole")
        >>> observation, info = environment.reset(seed=0)
        >>> observation, reward, terminated, truncated, info = environment.step(1)
        >>> observation.shape, observation.dtype, reward, terminated, truncated
        ((4,), dtype('float32'), 1.0, False, False)
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}
    _default_time_limit: ClassVar[int | None] = None

    def __init__(
        self,
        task: TaskLike,
        *,
        physics: Physics = "rapier",
        max_episode_steps: int | None = None,
        render_mode: RenderMode | None = None,
        run_seed: int | None = None,
    ) -> None:
        self.task = as_task(task, run_seed)
        """Description of the task: names, units and ranges."""
        self.physics = physics
        if max_episode_steps is None:
            max_episode_steps = self._default_time_limit
        self._batch = Batch(self.task, physics=physics, max_episode_steps=max_episode_steps)
        self.metadata = rendering(self._batch, self.task, render_mode)
        self.render_mode = render_mode
        self.observation_space = observation_space(self.task)
        self.action_space = action_space(self.task)

    def __repr__(self) -> str:
        return f"Env({self.task.name!r})"

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start a new episode.

        Args:
            seed: Random number seed of the start states, from 0 to 2**64 - 1. They are those of agent 0 in
                round 0 of a run with this run seed. Without a seed the sequence continues; before the
                first one it is drawn by the operating system (`np_random_seed` returns it).
            options: A state in which the episode starts, instead of drawing one: `"positions"` and
                `"velocities"` are dictionaries of coordinates (names of joints, or `NAME.x`, `NAME.y` and
                `NAME.angle` of a free body) and numbers in m, rad, m/s or rad/s; `"numbers"` is one of
                numbers in the task's `drawn_per_episode`. Coordinates that are not named start at rest
                where the task places its bodies; other numbers are drawn.

        Returns:
            The observation, float32, `[observations]`, and an empty dictionary.

        Raises:
            TypeError: The seed or an option has another type. Nothing has changed.
            ValueError: There is no such seed, option, coordinate or number. Nothing has changed.
        """
        start = given_start(self._batch, options)
        if seed is None and self._batch.unseeded():
            seed = random_seed()
        if seed is not None:
            seed = checked_seed(seed)
            super().reset(seed=seed)
            self._batch.seed(0, seed)
        return self._batch.reset_one(start), {}

    def step(
        self, action: Any
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance by one control step of `task.control_step` seconds.

        Returns:
            The observation (float32, `[observations]`), the reward, whether the task has terminated, whether
            the episode is truncated by the time limit, and an empty dictionary. As with Gymnasium's
            `TimeLimit`, both can be true.

        Raises:
            ValueError: The action is not in the action space, or not finite.
            gymnasium.error.ResetNeeded: The episode has ended, or none has started.
        """
        observation, reward, terminated, truncated = self._batch.step_one(action)
        return observation, reward, terminated, truncated, {}

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the bodies.

        Returns:
            A picture, uint8, `[400, 600, 3]`; None if the environment was made without `render_mode`.
        """
        if self.render_mode is None:
            gymnasium.logger.warn('`render` draws nothing: make the environment with render_mode="rgb_array"')
            return None
        return self._batch.render(0, *PICTURE_SIZE)

    def poses(self) -> NDArray[np.float32]:
        """Where the bodies are.

        Returns:
            x and y in m, angle in rad, counter-clockwise: float32, `[bodies, 3]`, in the order of
            `task.bodies`.
        """
        return self._batch.poses(0)

    def coordinates(self) -> dict[str, dict[str, float]]:
        """Where the bodies are, as the options with which `reset` starts an episode there.

        Returns:
            Dictionaries `"positions"` and `"velocities"` of coordinates by name (m, rad, m/s, rad/s) and
            `"numbers"`, those in the task's `drawn_per_episode`. `get_state` is exact to the bit; this is
            for comparisons with other simulators.
        """
        return dict(zip(START_OPTIONS, self._batch.coordinates(), strict=True))

    def get_state(self) -> bytes:
        """The whole state: bodies, number of steps, and the random stream of start states.

        An environment that is set to it continues with the same bits.
        """
        return self._batch.save(0)

    def set_state(self, state: bytes) -> NDArray[np.float32]:
        """Continue from a state that `get_state` returned, here or in any environment of this task.

        Returns:
            The observation in this state, float32, `[observations]`.

        Raises:
            ValueError: The bytes are not a state of this task. The environment is unchanged.
        """
        self._batch.restore(0, state)
        return self._batch.observe_one()


class RegisteredEnv(Env):
    """One copy of a task as `gymnasium.make` makes it: Gymnasium's `TimeLimit` truncates episodes."""

    _default_time_limit = -1
