"""Recorder of one agent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from .agent_files import AgentFiles, buffered_steps, number_of_reward, reshaped, warn_of_unfinished
from .state_files import RUNNING, TERMINATED, TRUNCATED


NUMBERS = frozenset({bool, np.float64, np.float32, np.int64})
"""Types of rewards that are numbers of single or double precision."""


class EpisodeRecorder:
    """Collects the steps of one agent, and writes them when the episode ends or the memory is full."""

    def __init__(
        self,
        agent_files: AgentFiles,
        numbers: Callable[[Any], Any] | None,
        features: Callable[[Any, Any], Any] | None,
        keep_unfinished: bool | None,
    ) -> None:
        self._agent_files = agent_files
        self._numbers = numbers
        self._features = features
        self._keep_unfinished = keep_unfinished
        header = agent_files.headers[0]
        self._capacity = buffered_steps(agent_files.headers)
        self._observations = np.zeros((self._capacity + 1, len(header.observations)), np.float64)
        self._actions = np.zeros((self._capacity, len(header.actions)), np.float64)
        self._rewards = np.zeros(self._capacity, np.float64)
        self._flat = (len(header.observations),)
        self.is_running = False
        self.is_left_out = False
        """Whether an episode is running that is not recorded, because some of its steps could not be."""
        self._steps = 0
        self._first_step = 0
        self._total_reward = 0.0
        self._begin_step = 0
        """Steps of the environment before the running episode."""
        self._has_warned = False

    def start(self, observation: Any, info: Any) -> None:
        _ = self._agent_files.files
        try:
            self._end_unfinished(self._keep_unfinished is not False)
        finally:
            self.is_running = self.is_left_out = False
            self._observations[0] = self._recorded(observation, info)
            self._steps = self._first_step = 0
            self._total_reward = 0.0
            self._begin_step = self._agent_files.clock
            self.is_running = True

    def add(self, action: Any, observation: Any, reward: Any, terminated: Any, truncated: Any, info: Any) -> None:
        """Record a step. This is called as often as the environment is stepped."""
        self._agent_files.clock += 1
        try:
            step = self._steps
            if step == self._capacity:
                step = self._empty()
            self._actions[step] = action if self._numbers is None else self._numbers(action)
            if type(reward) is not float:
                reward = float(reward) if type(reward) in NUMBERS else number_of_reward(reward)
            self._rewards[step] = reward
            self._total_reward += reward
            # The usual case, without another call. NumPy would repeat an array of one number.
            is_flat = self._features is None and getattr(observation, "shape", None) == self._flat
            self._observations[step + 1] = observation if is_flat else self._recorded(observation, info)
            self._steps = step + 1
            if terminated or truncated:
                self._end(TERMINATED if terminated else TRUNCATED)
        except BaseException:
            self.is_running, self.is_left_out = False, not (terminated or truncated)
            raise

    def add_unrecorded(
        self, observation: Any, reward: Any, terminated: Any, truncated: Any, info: Any, *, starts: bool
    ) -> None:
        """Count a step outside of a recorded episode; it is the first state of one if the environment resets itself."""
        self._agent_files.clock += 1
        if self.is_left_out:
            self.is_left_out = not (terminated or truncated)
        elif starts:
            self.start(observation, info)
        elif not self._has_warned:
            gymnasium.logger.warn("steps after the end of an episode, without a reset, are not recorded")
            self._has_warned = True

    def _recorded(self, observation: Any, info: Any) -> Any:
        """What is recorded of a state: `[observations]`."""
        if self._features is not None:
            return reshaped(self._features(observation, info), self._flat, "the result of features")
        is_flat = getattr(observation, "shape", None) == self._flat
        return observation if is_flat else reshaped(observation, self._flat, "the observation")

    def _empty(self) -> int:
        """Write the steps in memory; returns the number of steps that are left there: 0."""
        self._write(RUNNING)
        self._observations[0] = self._observations[self._steps]
        self._first_step += self._steps
        self._steps = 0
        return 0

    def close(self) -> None:
        left_out = []
        try:
            if self._agent_files.was_opened_here():
                left_out = self._end_unfinished(self._keep_unfinished is True)
        finally:
            self._agent_files.close()
        if self._keep_unfinished is None:
            warn_of_unfinished(self._agent_files.folder, left_out)

    def _end_unfinished(self, keep: bool) -> list[int]:
        """End the running episode; returns the number of its steps if there are any and they are left out."""
        steps = self._first_step + self._steps
        if not self.is_running or steps == 0:
            self.is_running = False
            return []
        if keep:
            self._end(TRUNCATED)
            return []
        self.is_running = False
        return [steps]

    def _end(self, outcome: int) -> None:
        self.is_running = False
        self._write(outcome)

    def _write(self, outcome: int) -> None:
        steps = self._steps
        states = steps + (outcome != RUNNING)
        self._agent_files.files[0].append_steps(
            self._first_step,
            self._observations[:states],
            self._actions[:steps],
            self._rewards[:steps],
            outcome,
            self._total_reward,
            self._begin_step,
        )
