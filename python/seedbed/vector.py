"""Many copies of a task as a Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ._native import Batch
from .environment import (
    PICTURE_SIZE,
    RENDER_MODES,
    Copyable,
    Physics,
    RenderMode,
    TaskLike,
    as_task,
    given_start,
    rendering,
    set_states,
)
from .seeding import checked_round, checked_seed, random_seed
from .spaces import action_space, observation_space

Autoreset: TypeAlias = Literal["NextStep", "SameStep", "Disabled"]
"""When a copy whose episode has ended is reset: the values of Gymnasium's `AutoresetMode`."""

BATCH_AUTORESET = {
    AutoresetMode.NEXT_STEP: "next_step",
    AutoresetMode.SAME_STEP: "same_step",
    AutoresetMode.DISABLED: "disabled",
}


class VectorEnv(Copyable, gymnasium.vector.VectorEnv[NDArray[np.float32], Any, NDArray[Any]]):
    """M copies of a task, stepped natively.

    Results equal those of `gymnasium.vector.SyncVectorEnv` with M environments of the class `Env`, to the
    bit, for any number of threads.

    Args:
        task: A task, the path of a task file, or the name of a task; see `Task`.
        num_envs: Number of copies M.
        physics: "rapier" for rigid bodies, "analytic" for the task's analytic model.
        threads: Number of threads; by default the number of cores, but at most one per 256 copies, or per 8
            copies of a task with contacts.
        autoreset_mode: When a copy whose episode has ended is reset:
            * `NEXT_STEP` (default): by the next step, which ignores the action of the copy.
            * `SAME_STEP`: by the same step, which returns the first observation of the new episode. The
              last one of the old episode is `infos["final_obs"]`.
            * `DISABLED`: by `reset(options={"reset_mask": mask})`.
        copy: Whether observations are a new array in each step. If not, all calls return the same array,
            whose content each call changes. All other results are new arrays in any case.
        max_episode_steps: Steps after which an episode is truncated; by default those of the task, and -1
            for no limit.
        render_mode: "rgb_array" to draw the bodies, if the task has any.
        run_seed: Run seed with which tasks are drawn that differ from run to run; by default 0. See `Task`.

    Raises:
        TaskError: Something in the task file is wrong.
        FileNotFoundError: There is no such file or task.
        ValueError: An argument is invalid.

    Example:
        >>> environments = VectorEnv("cartpole", num_envs=3)
        >>> observations, infos = environments.reset(seed=0)
        >>> observations, rewards, terminated, truncated, infos = environments.step(np.array([0, 1, 1]))
        >>> observations.shape, rewards
        ((3, 4), array([1., 1., 1.]))
    """

    metadata: dict[str, Any] = {
        "render_modes": list(RENDER_MODES),
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        task: TaskLike,
        num_envs: int = 1,
        *,
        physics: Physics = "rapier",
        threads: int | None = None,
        autoreset_mode: Autoreset | AutoresetMode = "NextStep",
        copy: bool = True,
        max_episode_steps: int | None = None,
        render_mode: RenderMode | None = None,
        run_seed: int | None = None,
    ) -> None:
        super().__init__()
        self.task = as_task(task, run_seed)
        """Description of the task: names, units and ranges."""
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        if not isinstance(copy, bool):
            raise TypeError(f"copy is {copy!r}, expected True or False")
        self.copy = copy
        self.num_envs = num_envs
        self._batch = Batch(
            self.task,
            num_envs,
            physics=physics,
            threads=threads,
            max_episode_steps=max_episode_steps,
            autoreset=BATCH_AUTORESET[self.autoreset_mode],
        )
        self.metadata = rendering(self._batch, self.task, render_mode) | {"autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.single_observation_space = observation_space(self.task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.single_action_space = action_space(self.task)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._seeds: list[int | None] = [None] * num_envs
        shape = (num_envs, len(self.task.observations))
        self._observations = np.zeros(shape, np.float32)
        resets_in_same_step = self.autoreset_mode == AutoresetMode.SAME_STEP
        self._final_observations = np.zeros(shape, np.float32) if resets_in_same_step else None

    @property
    def threads(self) -> int:
        """Number of threads that step the copies."""
        return self._batch.threads

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The latest seed of each copy; -1 before its first reset."""
        return tuple(-1 if seed is None else seed for seed in self._seeds)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start new episodes.

        Args:
            seed: Random number seeds of the start states, each from 0 to 2**64 - 1: one for each copy, or
                one number s for the seeds s, s + 1, …, s + M - 1. Copies without a seed continue their
                sequence; before their first one it is drawn by the operating system.
            options: `"reset_mask"` (bool, `[M]`) resets only the copies whose mask is true. `"positions"`,
                `"velocities"` and `"numbers"` are those of `Env.reset`, for each copy that is reset; later
                automatic resets draw their start states. `"round"` is the number of a round of the run `seed`, which is one
                number then: copy k starts as agent k in this round of `seedbed run`.

        Returns:
            The observations of all copies, float32, `[M, observations]`, and an empty dictionary.

        Raises:
            TypeError: A seed or an option has another type. Nothing has changed.
            ValueError: There is no such seed, option, coordinate or number, or their number is wrong.
                Nothing has changed.
        """
        start = given_start(self._batch, options, "reset_mask", "round")
        mask = self._reset_mask(options)
        if options is not None and "round" in options:
            self._seed_round(checked_seed(seed), checked_round(options["round"]), mask)
        else:
            self._seed(self._seeds_of_copies(seed), mask)
        observations = self._memory()
        self._batch.reset(observations, mask, start)
        return observations, {}

    def step(
        self, actions: Any
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Advance all copies by one control step of `task.control_step` seconds.

        Args:
            actions: One row per copy, as in `action_space`.

        Returns:
            Observations (float32, `[M, observations]`), rewards (float64, `[M]`), whether tasks have
            terminated (bool, `[M]`), whether episodes are truncated by the time limit (bool, `[M]`), and
            a dictionary. With `SAME_STEP`, if episodes have ended, it has `final_obs` (an array of M
            objects: the last observation, or None), `final_info` (empty), and the masks `_final_obs` and
            `_final_info` (bool, `[M]`).

        Raises:
            ValueError: An action is not in the action space, or not finite. Nothing has moved.
            gymnasium.error.ResetNeeded: An episode has not started, or has ended (`DISABLED`).
        """
        observations = self._memory()
        rewards = np.empty(self.num_envs, np.float64)
        terminated = np.empty(self.num_envs, np.bool_)
        truncated = np.empty(self.num_envs, np.bool_)
        self._batch.step(actions, observations, rewards, terminated, truncated, self._final_observations)
        return observations, rewards, terminated, truncated, self._final_infos(terminated | truncated)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw the bodies of each copy.

        Returns:
            M pictures, uint8, `[400, 600, 3]`; None if the environment was made without `render_mode`.
        """
        if self.render_mode is None:
            gymnasium.logger.warn('`render` draws nothing: make the environment with render_mode="rgb_array"')
            return None
        return tuple(self._batch.render(index, *PICTURE_SIZE) for index in range(self.num_envs))

    def poses(self) -> NDArray[np.float32]:
        """Where the bodies are.

        Returns:
            x and y in m, angle in rad, counter-clockwise: float32, `[M, bodies, 3]`, in the order of
            `task.bodies`.
        """
        return np.stack([self._batch.poses(index) for index in range(self.num_envs)])

    def get_state(self) -> list[bytes]:
        """The whole state of each copy: bodies, number of steps, and the random stream of start states.

        A copy that is set to it continues with the same bits, in an environment with any number of copies.
        """
        return [self._batch.save(index) for index in range(self.num_envs)]

    def set_state(
        self, states: Sequence[bytes], copies: Sequence[int] | None = None
    ) -> NDArray[np.float32]:
        """Continue from states that `get_state` returned, here or in any environment of this task.

        Args:
            states: One state for each copy, or for each of `copies`.
            copies: Indices of the copies that are set; by default all.

        Returns:
            The observations of all copies, float32, `[M, observations]`.

        Raises:
            ValueError: Bytes are not a state of this task, or their number is wrong. No copy has changed.
            IndexError: There is no such copy.
        """
        set_states(self._batch, range(self.num_envs) if copies is None else copies, states)
        observations = self._memory()
        self._batch.observe(observations)
        return observations

    def close_extras(self, **kwargs: Any) -> None:
        """Do nothing: there is nothing to close, so that nothing can take long (`timeout`) or hang (`terminate`)."""
        unknown = sorted(set(kwargs) - {"timeout", "terminate"})
        if unknown:
            raise TypeError(f"close() got an unexpected keyword argument {unknown[0]!r}")

    def _memory(self) -> NDArray[np.float32]:
        """The array in which the next observations are written."""
        return np.empty_like(self._observations) if self.copy else self._observations

    def _final_infos(self, ended: NDArray[np.bool_]) -> dict[str, Any]:
        """Gymnasium's information on the episodes that ended and were followed by a reset."""
        if self._final_observations is None or not ended.any():
            return {}
        final_observations = np.full(self.num_envs, None, object)
        for index in np.flatnonzero(ended):
            final_observations[index] = self._final_observations[index].copy()
        return {
            "final_obs": final_observations,
            "_final_obs": ended,
            "final_info": {},
            "_final_info": ended.copy(),
        }

    def _reset_mask(self, options: dict[str, Any] | None) -> NDArray[np.bool_] | None:
        if options is None or "reset_mask" not in options:
            return None
        mask = options["reset_mask"]
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            found = mask.dtype if isinstance(mask, np.ndarray) else type(mask).__name__
            raise TypeError(f'options["reset_mask"] is of type {found}, expected an array of the type bool')
        if mask.shape != (self.num_envs,):
            raise ValueError(f'options["reset_mask"] has the shape {mask.shape}, expected ({self.num_envs},)')
        if not mask.any():
            raise ValueError('options["reset_mask"] is false for all copies, expected at least one true')
        return mask

    def _seeds_of_copies(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str | bytes) and getattr(seed, "ndim", 1) > 0:
            if len(seed) != self.num_envs:
                raise ValueError(f"there are {len(seed)} seeds, expected {self.num_envs}: one per copy")
            return [None if one is None else checked_seed(one) for one in seed]
        try:
            first = checked_seed(seed)
        except TypeError:
            raise TypeError(f"seed is {seed!r}, expected an integer from 0 to 2**64 - 1, or one per copy") from None
        checked_seed(first + self.num_envs - 1)
        return [first + index for index in range(self.num_envs)]

    def _seed_round(self, run_seed: int, number: int, mask: NDArray[np.bool_] | None) -> None:
        """Let copies that will be reset start as the agents of a run in a round."""
        for index in range(self.num_envs) if mask is None else map(int, np.flatnonzero(mask)):
            self._batch.seed(index, run_seed, index, number)
            self._seeds[index] = run_seed

    def _seed(self, seeds: list[int | None], mask: NDArray[np.bool_] | None) -> None:
        """Seed the copies that will be reset."""
        unseeded = set(self._batch.unseeded())
        for index, seed in enumerate(seeds):
            if mask is not None and not mask[index]:
                continue
            if seed is None and index in unseeded:
                seed = random_seed()
            if seed is not None:
                self._batch.seed(index, seed)
                self._seeds[index] = seed
