"""Recorder of the agents of a vector environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from .agent_files import AgentFiles, buffered_steps, reshaped, warn_of_unfinished
from .recorded_features import features_of_copies, info_of
from .state_files import RUNNING, TERMINATED, TRUNCATED, RecordingError


class BatchRecorder:
    """Collects the steps of all copies of a vector environment.

    Row t of the memory has the observations before step t of all copies, so that a step needs three assignments for
    any number of copies. The rows of an episode are written when it ends or the memory is full.
    """

    def __init__(
        self,
        agent_files: AgentFiles,
        mode: AutoresetMode,
        numbers: Callable[[Any], NDArray[Any]],
        features: Callable[[Any, Any], Any] | None,
        keep_unfinished: bool | None,
    ) -> None:
        self._agent_files = agent_files
        self._mode = mode
        self._numbers = numbers
        self._features = features
        self._keep_unfinished = keep_unfinished
        header, copies = agent_files.headers[0], len(agent_files.headers)
        self._capacity = buffered_steps(agent_files.headers)
        self._observations = np.zeros((self._capacity + 1, copies, len(header.observations)), np.float64)
        self._actions = np.zeros((self._capacity, copies, len(header.actions)), np.float64)
        self._rewards = np.zeros((self._capacity, copies), np.float64)
        self._row = 0
        self._is_running = np.zeros(copies, np.bool_)
        self._first_row = np.zeros(copies, np.int64)
        """Row of the first state of each running episode, or of its first state that is not written."""
        self._first_step = np.zeros(copies, np.int64)
        """Number of steps of each running episode that are written."""
        self._total_reward = np.zeros(copies, np.float64)
        self._begin_step = np.zeros(copies, np.int64)
        """Steps of the environments before each running episode."""
        self._will_reset = np.zeros(copies, np.bool_)
        """Copies that the next step only resets."""

    def start(self, observations: Any, infos: Any, mask: NDArray[np.bool_] | None) -> None:
        copies = np.flatnonzero(np.ones(len(self._is_running)) if mask is None else mask).tolist()
        _ = self._agent_files.files
        failures = self._for_each(copies, lambda copy: self._end_unfinished(copy, self._keep_unfinished is not False))
        if mask is None:
            self._row = 0
        self._observations[self._row, copies] = self._recorded(observations, infos)[copies]
        self._begin(copies)
        if failures:
            raise failures[0]

    def add(
        self,
        actions: Any,
        observations: Any,
        rewards: Any,
        terminated: Any,
        truncated: Any,
        infos: Any,
        final_observations: Any,
        final_infos: Any,
    ) -> None:
        """Record a step of all copies. The last three are needed where a step also resets copies: `infos` belong to
        `observations`, and what is final to the episodes that ended."""
        self._agent_files.clock += 1
        finals = final_observations, final_infos
        try:
            failures = self._add(actions, observations, rewards, np.ravel(terminated), np.ravel(truncated), infos, finals)
        except BaseException:
            # Some of the steps may be missing.
            self._is_running[:] = self._will_reset[:] = False
            raise
        if failures:
            raise failures[0]

    def _add(
        self,
        actions: Any,
        observations: Any,
        rewards: Any,
        terminated: NDArray[Any],
        truncated: NDArray[Any],
        infos: Any,
        finals: tuple[Any, Any],
    ) -> list[RecordingError]:
        failures = self._empty() if self._row == self._capacity else []
        row = self._row
        self._actions[row] = self._numbers(actions)
        self._rewards[row] = reshaped(rewards, self._is_running.shape, "the array of rewards")
        self._row = row = row + 1
        self._observations[row] = self._recorded(observations, infos)
        ended = (terminated | truncated).astype(np.bool_)
        if self._will_reset.any():
            ended &= ~self._will_reset
            self._begin(np.flatnonzero(self._will_reset).tolist())
        if ended.any():

            def end(copy: int) -> None:
                self._end(copy, TERMINATED if terminated[copy] else TRUNCATED, self._last_observation(copy, *finals))

            failures += self._for_each(np.flatnonzero(ended & self._is_running).tolist(), end)
            if self._mode == AutoresetMode.NEXT_STEP:
                self._will_reset |= ended
            elif self._mode == AutoresetMode.SAME_STEP:
                self._begin(np.flatnonzero(ended).tolist())
        return failures

    def close(self) -> None:
        left_out: list[int] = []
        try:
            if self._agent_files.was_opened_here():
                copies = list(range(len(self._is_running)))
                keep = self._keep_unfinished is True
                failures = self._for_each(copies, lambda copy: left_out.extend(self._end_unfinished(copy, keep)))
                if failures:
                    raise failures[0]
        finally:
            self._agent_files.close()
        if self._keep_unfinished is None:
            warn_of_unfinished(self._agent_files.folder, left_out)

    def _for_each(self, copies: list[int], write: Callable[[int], Any]) -> list[RecordingError]:
        """Write something for each copy; returns why this failed. The episodes of those copies are left out."""
        failures = []
        for copy in copies:
            try:
                write(copy)
            except RecordingError as error:
                self._is_running[copy] = False
                failures.append(error)
        return failures

    def _recorded(self, observations: Any, infos: Any) -> NDArray[Any]:
        """What is recorded of the states of all copies: `[copies, observations]`."""
        if self._features is not None:
            observations = features_of_copies(self._features, observations, infos or {}, len(self._is_running))
        return reshaped(observations, self._observations.shape[1:], "the array of observations")

    def _begin(self, copies: list[int]) -> None:
        """Begin episodes with the observations in the current row."""
        self._is_running[copies] = True
        self._will_reset[copies] = False
        self._first_row[copies] = self._row
        self._first_step[copies] = 0
        self._total_reward[copies] = 0.0
        self._begin_step[copies] = self._agent_files.clock

    def _last_observation(self, copy: int, final_observations: Any, final_infos: Any) -> Any:
        """The observation at the end of an episode, `[observations]`."""
        if self._mode != AutoresetMode.SAME_STEP:
            return self._observations[self._row, copy]
        if final_observations is None or final_observations[copy] is None:
            raise RecordingError(
                "infos has no final_obs, the last observation of an episode that ended (SAME_STEP): record it inside of "
                "wrappers that remove it, or give the autoreset mode with autoreset_mode="
            )
        last = final_observations[copy]
        if self._features is not None:
            last = self._features(last, info_of(final_infos or {}, copy))
        return reshaped(last, self._observations.shape[2:], 'infos["final_obs"]')

    def _end_unfinished(self, copy: int, keep: bool) -> list[int]:
        """End a running episode; returns the number of its steps if there are any and they are left out."""
        steps = int(self._first_step[copy] + self._row - self._first_row[copy])
        if not self._is_running[copy] or steps == 0:
            self._is_running[copy] = False
            return []
        if keep:
            self._end(copy, TRUNCATED, self._observations[self._row, copy])
            return []
        self._is_running[copy] = False
        return [steps]

    def _end(self, copy: int, outcome: int, last_observation: NDArray[Any]) -> None:
        rows = slice(self._first_row[copy], self._row)
        states = np.concatenate([self._observations[rows, copy], last_observation[None]])
        self._is_running[copy] = False
        self._write(copy, states, rows, outcome)

    def _write(self, copy: int, states: NDArray[np.float64], rows: slice, outcome: int) -> None:
        rewards = self._rewards[rows, copy]
        # One after the other, so that the sum does not depend on when the memory was full.
        total_reward = np.add.accumulate(np.append(self._total_reward[copy], rewards))[-1]
        first_step = int(self._first_step[copy])
        self._agent_files.files[copy].append_steps(
            first_step,
            states,
            self._actions[rows, copy],
            rewards,
            outcome,
            float(total_reward),
            int(self._begin_step[copy]),
        )
        self._total_reward[copy] = total_reward

    def _empty(self) -> list[RecordingError]:
        """Write the steps of all running episodes, and continue in the first row; returns why this failed."""

        def write(copy: int) -> None:
            rows = slice(self._first_row[copy], self._row)
            if rows.start < rows.stop:
                self._write(copy, self._observations[rows, copy], rows, RUNNING)
                self._first_step[copy] += rows.stop - rows.start

        failures = self._for_each(np.flatnonzero(self._is_running).tolist(), write)
        self._observations[0] = self._observations[self._row]
        self._first_row[:] = 0
        self._row = 0
        return failures
