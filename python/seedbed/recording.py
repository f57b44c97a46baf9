"""Recording where agents go, in any Gymnasium environment.

    >>> import gymnasium, seedbed
    >>> environment = gymnasium.make("CartPole-v1")
    >>> environment = seedbed.RecordVisitation(environment, "runs/cartpole", agent=0)  # doctest: +SKIP

After `close`, `seedbed explore runs/cartpole` and all other commands of the program show the visited states.
"""

from __future__ import annotations

import contextlib
import math
import operator
import os
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NoReturn, TypeAlias

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from .state_files import (
    MAX_AXES,
    MAX_NAME_BYTES,
    RUNNING,
    TERMINATED,
    TRUNCATED,
    Axis,
    Header,
    RecordingError,
    StateFile,
    check_start,
    merge_folder,
)

__all__ = ["RecordVisitation", "RecordVisitationVector", "RecordingError"]

Range: TypeAlias = tuple[float | None, float | None]
"""Ends of an axis. An end that is None is the smallest or largest value that was visited."""

Ranges: TypeAlias = Sequence[Range | None] | Mapping[str, Range] | Literal["visited"] | None
"""Ranges of the axes of observations: of all, of some by name, or "visited" for what was visited."""

MAX_OBSERVATIONS = 1000
"""Maximum number of observations: each is an axis, so that pictures cannot be recorded."""

MAX_BOUND = 1e9
"""A bound of a Box beyond this, such as the largest float32, counts as infinite."""

RESERVED_NAMES = {"reward", "log_prob", "intrinsic_reward", "advantage", "outcome"}
"""Names of other columns of a recording."""

MAX_BUFFERED_STEPS = 4096
MAX_BUFFERED_NUMBERS = 1 << 20
"""Steps of unfinished episodes that wait in memory: at most so many, and at most 8 MB."""


class RecordVisitation(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Record which states an agent visits.

    The wrapped environment behaves exactly as before. Each finished episode is appended to
    `FOLDER/states/agent_K.states` when it ends, so that a process that is killed loses at most its last episode.
    `close`, the end of the process or garbage collection writes `episodes.csv` and, when all agents of the folder
    are closed, `summary.json`, which also says how many states have an observation that is NaN. Then `seedbed runs`, `inspect`, `plot`, `explore`, `export` and `film` show the run;
    they also do while it is in progress.

    Several agents, also in different processes, write to one folder: each needs an `agent` of its own. The file is
    made by the first `reset`, in the process that steps the environment. Nobody else can record the agent until `close`.

    An episode that `reset` cuts off is recorded as truncated: a wrapper outside of this one, such as `TimeLimit`, ends
    episodes in this way. The episode that `close` cuts off is left out, with a warning, because its return would say
    nothing; see `keep_unfinished`.

    Numbers are recorded in single precision, after a warning if they are too large for it.

    Args:
        env: An environment whose observations are a Box, with at most 1000 numbers. All Dict, Tuple and Discrete
            observations can be flattened with `gymnasium.wrappers.FlattenObservation` first.
        folder: Folder of the run.
        agent: Number of the agent, from 0.
        learner: Number of the learner that acts. Give agents the same number if they are copies of an environment in which
            one learner acts, such as those of a `SubprocVecEnv`: they count as one. By default each agent is a learner.
        names: Name of each observation; by default those of a seedbed task, or `obs_0`, `obs_1`, …
        units: Unit of each observation, or of some by name, such as `{"x": "m"}`.
        ranges: Ends of the axis of each observation, or of some by name, such as `{"x": (-1, 1)}`. By default those
            of a seedbed task, or finite bounds of the Box; all other ends are the smallest and largest finite
            value that any agent in the folder has visited. `"visited"` ignores bounds, which are often far from
            what is visited. Values beyond an end are recorded as they are.
        action_names: Name of each component of an action; by default those of a seedbed task, or `action`,
            or `action_0`, `action_1`, …
        environment: Name of the environment; by default its id.
        overwrite: Replace the file of this agent, if there is one. Files of other agents stay.
        resume: Continue the file of this agent, if there is one. An unfinished episode at its end is removed, and so is
            all from the first damage on, of which a copy is kept; both with a warning.
        keep_unfinished: True also records the episode that `close` cuts off, as truncated. False records only episodes
            that the environment has ended, as Stable-Baselines3's `Monitor` does, and leaves out all others silently.

    Raises:
        TypeError: The observations or actions are no numbers. The message says what to wrap the environment with.
        ValueError: Names, units or ranges are invalid, or differ from those of another agent in the folder.
        FileExistsError: The agent was recorded before, or the folder contains another run.
        RecordingError: The first `reset` cannot write to the folder, or another recorder writes to the file; or a later
            call cannot write. The episode is then left out, and the next one is recorded.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        folder: str | os.PathLike[str],
        agent: int = 0,
        *,
        names: Sequence[str] | None = None,
        units: Sequence[str] | Mapping[str, str] | None = None,
        ranges: Ranges = None,
        action_names: Sequence[str] | None = None,
        environment: str | None = None,
        learner: int | None = None,
        overwrite: bool = False,
        resume: bool = False,
        keep_unfinished: bool | None = None,
    ) -> None:
        super().__init__(env)
        task = _task_of(env)
        observations = observation_axes(env.observation_space, task, names, units, ranges)
        actions = action_axes(env.action_space, task, action_names)
        name = environment or _name_of(env, env.spec)
        header = _header(agent, name, observations, actions, env.spec, env.metadata, learner)
        recorders = _Recorders(Path(folder).absolute(), [header], overwrite, resume)
        is_flat = len(env.observation_space.shape or ()) == 1
        self._recorder = _EpisodeRecorder(recorders, _numbers(env.action_space, task), is_flat, keep_unfinished)
        self._finish = weakref.finalize(self, self._recorder.close)
        self._autoresets = _has_wrapper(env, gymnasium.wrappers.Autoreset)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a new episode; see `gymnasium.Env.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._recorder.start(observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment, and record the step; see `gymnasium.Env.step`."""
        result = self.env.step(action)
        observation, reward, terminated, truncated, _ = result
        recorder = self._recorder
        recorder.count_step()
        if recorder.is_running:
            recorder.add(action, reward, observation, terminated, truncated)
        elif recorder.is_left_out:
            recorder.is_left_out = not (terminated or truncated)
        elif self._autoresets:
            recorder.start(observation)
        else:
            recorder.warn_of_missing_reset()
        return result

    def close(self) -> None:
        """Complete the files of the agent, and close the environment."""
        try:
            self._finish()
        finally:
            super().close()

    def __getstate__(self) -> NoReturn:
        raise TypeError(
            "a RecordVisitation cannot be copied or sent to another process, because both would write to one file; "
            "make it there instead, such as SubprocVecEnv([lambda: RecordVisitation(make_env(), folder, agent=k), …])"
        )


class RecordVisitationVector(gymnasium.vector.VectorWrapper[Any, Any, Any, Any, Any]):
    """Record which states the agents of a vector environment visit.

    Each copy of the environment is an agent with a file of its own; see `RecordVisitation`, whose arguments have the
    same meaning here. By default one learner acts in all copies, so that their episodes count as those of one.
    Steps that only reset a copy (`AutoresetMode.NEXT_STEP`) are not recorded, because they are no transitions.

    Args:
        env: A vector environment whose observations are a Box, in any autoreset mode.
        folder: Folder of the run.
        agents: Number of the agent of each copy; by default 0, 1, …
        learners: Number of the learner of each copy, such as `range(env.num_envs)` if each has its own; by default the
            number of the first agent for all copies.
        autoreset_mode: Autoreset mode, if `env.metadata` does not have it.

    Raises:
        TypeError, ValueError, FileExistsError: As for `RecordVisitation`.
    """

    def __init__(
        self,
        env: gymnasium.vector.VectorEnv[Any, Any, Any],
        folder: str | os.PathLike[str],
        agents: Sequence[int] | None = None,
        *,
        names: Sequence[str] | None = None,
        units: Sequence[str] | Mapping[str, str] | None = None,
        ranges: Ranges = None,
        action_names: Sequence[str] | None = None,
        environment: str | None = None,
        learners: Sequence[int] | None = None,
        autoreset_mode: str | AutoresetMode | None = None,
        overwrite: bool = False,
        resume: bool = False,
        keep_unfinished: bool | None = None,
    ) -> None:
        super().__init__(env)
        mode = autoreset_mode or env.metadata.get("autoreset_mode")
        if mode is None:
            raise ValueError("env.metadata has no autoreset_mode; give it, such as autoreset_mode='NextStep'")
        numbers = [_agent_number("agents", agent) for agent in (range(env.num_envs) if agents is None else agents)]
        if len(numbers) != env.num_envs or len(set(numbers)) != len(numbers):
            raise ValueError(f"agents is {numbers}, expected {env.num_envs} different numbers: one per copy")
        given_learners = [numbers[0]] * len(numbers) if learners is None else learners
        learner_numbers = [_agent_number("learners", learner) for learner in given_learners]
        if len(learner_numbers) != env.num_envs:
            raise ValueError(f"learners is {learner_numbers}, expected {env.num_envs} numbers: one per copy")
        task = _task_of(env)
        observations = observation_axes(env.single_observation_space, task, names, units, ranges)
        actions = action_axes(env.single_action_space, task, action_names)
        spec = _spec_of(env)
        name = environment or _name_of(env, spec)
        headers = [
            _header(agent, name, observations, actions, spec, env.metadata, learner)
            for agent, learner in zip(numbers, learner_numbers, strict=True)
        ]
        recorders = _Recorders(Path(folder).absolute(), headers, overwrite, resume)
        convert = _batch_numbers(env.single_action_space, task)
        self._recorder = _BatchRecorder(recorders, AutoresetMode(mode), convert, keep_unfinished)
        self._finish = weakref.finalize(self, self._recorder.close)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start new episodes; see `gymnasium.vector.VectorEnv.reset`."""
        # Gymnasium removes the mask from `options`.
        mask = options.get("reset_mask") if isinstance(options, Mapping) else None
        observations, infos = self.env.reset(seed=seed, options=options)
        self._recorder.start(observations, None if mask is None else np.array(mask))
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all copies, and record the steps; see `gymnasium.vector.VectorEnv.step`."""
        result = self.env.step(actions)
        self._recorder.add(actions, *result)
        return result

    def close(self, **kwargs: Any) -> None:
        """Complete the files of the agents, and close the environments."""
        try:
            self._finish()
        finally:
            super().close(**kwargs)

    __getstate__ = RecordVisitation.__getstate__


class _Recorders:
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


def _warn_of_unfinished(folder: Path, steps: Sequence[int]) -> None:
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


def _reward(reward: Any) -> float:
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


def _reshaped(values: Any, shape: tuple[int, ...], name: str) -> NDArray[Any]:
    try:
        return np.reshape(values, shape)
    except ValueError:
        raise ValueError(f"{name} has the shape {np.shape(values)}, expected {shape} numbers") from None


def _buffered_steps(headers: Sequence[Header]) -> int:
    numbers = len(headers[0].observations) + len(headers[0].actions) + 1
    return max(16, min(MAX_BUFFERED_STEPS, MAX_BUFFERED_NUMBERS // (numbers * len(headers))))


class _EpisodeRecorder:
    """Collects the steps of one agent, and writes them when the episode ends or the memory is full."""

    def __init__(
        self, recorders: _Recorders, numbers: Callable[[Any], Any] | None, is_flat: bool, keep_unfinished: bool | None
    ) -> None:
        self._recorders = recorders
        self._numbers = numbers
        self._is_flat = is_flat
        self._keep_unfinished = keep_unfinished
        header = recorders.headers[0]
        self._capacity = _buffered_steps(recorders.headers)
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

    def start(self, observation: Any) -> None:
        _ = self._recorders.files
        try:
            self._end_unfinished(self._keep_unfinished is not False)
        finally:
            self._observations[0] = _reshaped(observation, self._flat, "the observation")
            self._steps = self._first_step = 0
            self._total_reward = 0.0
            self._begin_step = self._recorders.clock
            self.is_running, self.is_left_out = True, False

    def add(self, action: Any, reward: Any, observation: Any, terminated: Any, truncated: Any) -> None:
        try:
            self._add(action, reward, observation)
            if terminated or truncated:
                self._end(TERMINATED if terminated else TRUNCATED)
        except BaseException:
            self.is_running, self.is_left_out = False, not (terminated or truncated)
            raise

    def _add(self, action: Any, reward: Any, observation: Any) -> None:
        if self._steps == self._capacity:
            self._write(RUNNING)
            self._observations[0] = self._observations[self._steps]
            self._first_step += self._steps
            self._steps = 0
        step = self._steps
        self._actions[step] = action if self._numbers is None else self._numbers(action)
        if type(reward) is not float:
            reward = _reward(reward)
        self._rewards[step] = reward
        self._total_reward += reward
        # NumPy would repeat an array of one number.
        is_flat = self._is_flat and getattr(observation, "shape", None) == self._flat
        self._observations[step + 1] = observation if is_flat else _reshaped(observation, self._flat, "the observation")
        self._steps = step + 1

    def count_step(self) -> None:
        self._recorders.clock += 1

    def warn_of_missing_reset(self) -> None:
        if not self._has_warned:
            gymnasium.logger.warn("steps after the end of an episode, without a reset, are not recorded")
            self._has_warned = True

    def close(self) -> None:
        left_out = []
        try:
            if self._recorders.was_opened_here():
                left_out = self._end_unfinished(self._keep_unfinished is True)
        finally:
            self._recorders.close()
        if self._keep_unfinished is None:
            _warn_of_unfinished(self._recorders.folder, left_out)

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
        self._recorders.files[0].append_steps(
            self._first_step,
            self._observations[:states],
            self._actions[:steps],
            self._rewards[:steps],
            outcome,
            self._total_reward,
            self._begin_step,
        )


class _BatchRecorder:
    """Collects the steps of all copies of a vector environment.

    Row t of the memory has the observations before step t of all copies, so that a step needs three assignments for
    any number of copies. The rows of an episode are written when it ends or the memory is full.
    """

    def __init__(
        self,
        recorders: _Recorders,
        mode: AutoresetMode,
        numbers: Callable[[Any], NDArray[Any]],
        keep_unfinished: bool | None,
    ) -> None:
        self._recorders = recorders
        self._mode = mode
        self._numbers = numbers
        self._keep_unfinished = keep_unfinished
        header, copies = recorders.headers[0], len(recorders.headers)
        self._capacity = _buffered_steps(recorders.headers)
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

    def start(self, observations: Any, mask: NDArray[np.bool_] | None) -> None:
        copies = np.flatnonzero(np.ones(len(self._is_running)) if mask is None else mask).tolist()
        _ = self._recorders.files
        failures = self._for_each(copies, lambda copy: self._end_unfinished(copy, self._keep_unfinished is not False))
        if mask is None:
            self._row = 0
        self._observations[self._row, copies] = self._flat(observations)[copies]
        self._begin(copies)
        if failures:
            raise failures[0]

    def add(self, actions: Any, observations: Any, rewards: Any, terminated: Any, truncated: Any, infos: Any) -> None:
        self._recorders.clock += 1
        try:
            failures = self._add(actions, observations, rewards, np.ravel(terminated), np.ravel(truncated), infos or {})
        except BaseException:
            # Some of the steps may be missing.
            self._is_running[:] = self._will_reset[:] = False
            raise
        if failures:
            raise failures[0]

    def _add(
        self, actions: Any, observations: Any, rewards: Any, terminated: NDArray[Any], truncated: NDArray[Any], infos: Any
    ) -> list[RecordingError]:
        failures = self._empty() if self._row == self._capacity else []
        row = self._row
        self._actions[row] = self._numbers(actions)
        self._rewards[row] = _reshaped(rewards, self._is_running.shape, "the array of rewards")
        self._row = row = row + 1
        self._observations[row] = self._flat(observations)
        ended = (terminated | truncated).astype(np.bool_)
        if self._will_reset.any():
            ended &= ~self._will_reset
            self._begin(np.flatnonzero(self._will_reset).tolist())
        if ended.any():

            def end(copy: int) -> None:
                self._end(copy, TERMINATED if terminated[copy] else TRUNCATED, self._last_observation(copy, infos))

            failures += self._for_each(np.flatnonzero(ended & self._is_running).tolist(), end)
            if self._mode == AutoresetMode.NEXT_STEP:
                self._will_reset |= ended
            elif self._mode == AutoresetMode.SAME_STEP:
                self._begin(np.flatnonzero(ended).tolist())
        return failures

    def close(self) -> None:
        left_out: list[int] = []
        try:
            if self._recorders.was_opened_here():
                copies = list(range(len(self._is_running)))
                keep = self._keep_unfinished is True
                failures = self._for_each(copies, lambda copy: left_out.extend(self._end_unfinished(copy, keep)))
                if failures:
                    raise failures[0]
        finally:
            self._recorders.close()
        if self._keep_unfinished is None:
            _warn_of_unfinished(self._recorders.folder, left_out)

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

    def _flat(self, observations: Any) -> NDArray[Any]:
        return _reshaped(observations, self._observations.shape[1:], "the array of observations")

    def _begin(self, copies: list[int]) -> None:
        """Begin episodes with the observations in the current row."""
        self._is_running[copies] = True
        self._will_reset[copies] = False
        self._first_row[copies] = self._row
        self._first_step[copies] = 0
        self._total_reward[copies] = 0.0
        self._begin_step[copies] = self._recorders.clock

    def _last_observation(self, copy: int, infos: dict[str, Any]) -> Any:
        """The observation at the end of an episode, `[observations]`."""
        if self._mode != AutoresetMode.SAME_STEP:
            return self._observations[self._row, copy]
        if "final_obs" not in infos or infos["final_obs"][copy] is None:
            raise RecordingError(
                "infos has no final_obs, the last observation of an episode that ended (SAME_STEP): record it inside of "
                "wrappers that remove it, or give the autoreset mode with autoreset_mode="
            )
        return _reshaped(infos["final_obs"][copy], self._observations.shape[2:], 'infos["final_obs"]')

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
        self._recorders.files[copy].append_steps(
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


def observation_axes(
    space: spaces.Space[Any],
    task: Any,
    names: Sequence[str] | None,
    units: Sequence[str] | Mapping[str, str] | None,
    ranges: Ranges,
) -> tuple[Axis, ...]:
    """The axes of the observations in a space, with what is given in place of what is known."""
    if not isinstance(space, spaces.Box):
        raise TypeError(
            f"the observation space is {space}, expected a Box: wrap the environment with "
            "gymnasium.wrappers.FlattenObservation (of a vector environment: gymnasium.wrappers.vector.FlattenObservation) first"
        )
    count = int(np.prod(space.shape))
    if not 0 < count <= MAX_OBSERVATIONS:
        raise TypeError(
            f"observations have the shape {space.shape}, expected 1 to {MAX_OBSERVATIONS} numbers: record features instead, "
            "such as with gymnasium.wrappers.TransformObservation"
        )
    axes = _task_axes(task.observations) if task is not None else _box_axes(space, "obs", always_numbered=True)
    if names is not None:
        if isinstance(names, str) or len(names) != count:
            raise ValueError(f"names is {names!r}, expected {count} names: one per observation")
        axes = tuple(Axis(name, axis.unit, axis.low, axis.high) for name, axis in zip(names, axes, strict=True))
    _check_names(axes, "names")
    given_units = _by_axis(axes, units, "units")
    for unit in given_units:
        if unit is not None:
            _check_text(unit, "units")
    if isinstance(ranges, str) and ranges == "visited":
        ranges = [(None, None)] * count
    given_ranges = [None if ends is None else _checked_range(ends) for ends in _by_axis(axes, ranges, "ranges")]
    return tuple(
        Axis(axis.name, axis.unit if unit is None else unit, *((axis.low, axis.high) if ends is None else ends))
        for axis, unit, ends in zip(axes, given_units, given_ranges, strict=True)
    )


def action_axes(space: spaces.Space[Any], task: Any, names: Sequence[str] | None) -> tuple[Axis, ...]:
    """The axes of the components of an action."""
    axes = _task_axes(task.actions) if task is not None else _components(space, "action")
    if not 0 < len(axes) <= MAX_AXES:
        raise TypeError(
            f"the action space is {space} with {len(axes)} numbers, expected 1 to {MAX_AXES}: wrap the environment with "
            "gymnasium.wrappers.TransformAction first"
        )
    if names is not None:
        if isinstance(names, str) or len(names) != len(axes):
            raise ValueError(f"action_names is {names!r}, expected {len(axes)} names: one per component of an action")
        axes = tuple(Axis(name, axis.unit, axis.low, axis.high) for name, axis in zip(names, axes, strict=True))
    _check_names(axes, "action_names")
    return axes


def _components(space: spaces.Space[Any], name: str) -> tuple[Axis, ...]:
    match space:
        case spaces.Discrete():
            return (Axis(name, "", float(space.start), float(space.start + space.n - 1)),)
        case spaces.Box():
            return _box_axes(space, name, always_numbered=False)
        case spaces.MultiDiscrete() | spaces.MultiBinary():
            shape = space.shape
            highs = np.ones(shape) if isinstance(space, spaces.MultiBinary) else space.nvec + space.start - 1
            lows = np.zeros(shape) if isinstance(space, spaces.MultiBinary) else space.start
            return _numbered(name, shape, np.asarray(lows), np.asarray(highs), always_numbered=True)
        case spaces.Dict():
            return tuple(axis for key, part in space.spaces.items() for axis in _components(part, str(key)))
    raise TypeError(
        f"the action space is {space}, expected Discrete, Box, MultiDiscrete, MultiBinary or a Dict of them: "
        "wrap the environment with gymnasium.wrappers.TransformAction first"
    )


def _box_axes(space: spaces.Box, name: str, *, always_numbered: bool) -> tuple[Axis, ...]:
    return _numbered(name, space.shape, space.low, space.high, always_numbered=always_numbered)


def _numbered(
    name: str, shape: tuple[int, ...], lows: NDArray[Any], highs: NDArray[Any], *, always_numbered: bool
) -> tuple[Axis, ...]:
    """One axis per number of an array."""
    indices = list(np.ndindex(shape))
    is_numbered = always_numbered or len(indices) > 1
    axes = []
    for index in indices:
        suffix = "".join(f"_{part}" for part in index) if is_numbered else ""
        low, high = (float(end[index]) for end in (lows, highs))
        axes.append(Axis(name + suffix, "", _finite(low), _finite(high)))
    return tuple(axes)


def _finite(bound: float) -> float | None:
    return bound if abs(bound) <= MAX_BOUND else None


def _task_axes(quantities: Any) -> tuple[Axis, ...]:
    """Axes of the observations or actions of a seedbed task."""
    return tuple(Axis(quantity.name, quantity.unit, *map(float, quantity.range)) for quantity in quantities)


def _check_names(axes: tuple[Axis, ...], argument: str) -> None:
    seen: set[str] = set()
    for name in (axis.name for axis in axes):
        if not isinstance(name, str) or not name or name != name.strip() or any(sign in name for sign in "=,\n"):
            raise ValueError(f"{argument} contains {name!r}, expected a text without '=', ',' and spaces around it")
        _check_text(name, argument)
        if name in RESERVED_NAMES:
            raise ValueError(f"{argument} contains {name!r}, which is the name of another column")
        if name in seen:
            raise ValueError(f"{argument} contains {name!r} twice")
        seen.add(name)


def _check_text(text: Any, argument: str) -> None:
    """Refuse what the program does not read as a name or a unit.

    Raises:
        ValueError: It is no text, no valid Unicode, or too long.
    """
    if not isinstance(text, str):
        raise ValueError(f"{argument} contains {text!r}, expected a text")
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        raise ValueError(f"{argument} contains {text!r}, which is no valid Unicode text") from None
    if size > MAX_NAME_BYTES:
        raise ValueError(f"{argument} contains a text of {size} bytes ({text[:20]!r}…), expected at most {MAX_NAME_BYTES}")


def _by_axis(axes: tuple[Axis, ...], given: Sequence[Any] | Mapping[str, Any] | None, argument: str) -> list[Any]:
    """What is given for each axis; None for all others."""
    names = [axis.name for axis in axes]
    if given is None:
        return [None] * len(names)
    if isinstance(given, Mapping):
        unknown = sorted(set(given) - set(names))
        if unknown:
            raise ValueError(f"{argument} names {unknown[0]!r}, expected names of observations: {', '.join(names)}")
        return [given.get(name) for name in names]
    if isinstance(given, str) or len(given) != len(names):
        raise ValueError(f"{argument} is {given!r}, expected {len(names)} entries: one per observation")
    return list(given)


def _checked_range(ends: Range) -> Range:
    try:
        low, high = (None if end is None else float(end) for end in ends)
    except (TypeError, ValueError):
        raise ValueError(f"ranges contains {ends!r}, expected (low, high)") from None
    finite = [end for end in (low, high) if end is not None]
    if not all(np.isfinite(np.float32(end)) for end in finite) or (len(finite) == 2 and not finite[0] < finite[1]):
        raise ValueError(f"ranges contains {ends!r}, expected finite numbers (low, high) with low < high, or None")
    return low, high


def _numbers(space: spaces.Space[Any], task: Any) -> Callable[[Any], Any] | None:
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
    """The numbers of an action, in the order of `_components`."""
    for key, part in space.spaces.items():
        yield from _numbers_of_dict(part, action[key]) if isinstance(part, spaces.Dict) else np.ravel(action[key])


def _batch_numbers(space: spaces.Space[Any], task: Any) -> Callable[[Any], NDArray[Any]]:
    """Function from the actions of n copies to their components: `[n, components]`."""
    if isinstance(space, spaces.Dict):
        one = _numbers(space, task)
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


def _header(
    agent: int,
    environment: str,
    observations: tuple[Axis, ...],
    actions: tuple[Axis, ...],
    spec: Any,
    metadata: Mapping[str, Any],
    learner: int | None,
) -> Header:
    _check_text(environment, "environment")
    number = _agent_number("agent", agent)
    learner_number = None if learner is None else _agent_number("learner", learner)
    return Header(
        agent=number,
        environment=environment,
        observations=observations,
        actions=actions,
        time_limit=_time_limit(spec),
        step_seconds=_step_seconds(metadata.get("render_fps")),
        learner=None if learner_number == number else learner_number,
    )


def _agent_number(name: str, number: Any) -> int:
    try:
        index = -1 if isinstance(number, bool) else operator.index(number)
    except TypeError:
        index = -1
    if not 0 <= index < 1 << 16:
        raise ValueError(f"{name} is {number!r}, expected a number from 0 to 65535")
    return index


def _time_limit(spec: Any) -> int | None:
    """Number of steps after which episodes are truncated; None if there is no such number of 32 bits."""
    try:
        steps = operator.index(getattr(spec, "max_episode_steps", None))  # type: ignore[arg-type]
    except TypeError:
        return None
    return steps if 0 < steps < 1 << 32 else None


def _step_seconds(frames_per_second: Any) -> float | None:
    """Time of a step, s; None if the frames per second are no number that has one."""
    try:
        seconds = 1 / float(frames_per_second)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return seconds if 0 < seconds < math.inf else None


def _name_of(env: Any, spec: Any) -> str:
    copies = getattr(env.unwrapped, "envs", None)
    return str(spec.id) if spec is not None else type((copies[0] if copies else env).unwrapped).__name__


def _spec_of(env: Any) -> Any:
    """The specification of a vector environment or, if it has none, of its first copy."""
    copies = getattr(env.unwrapped, "envs", None)
    return env.spec if env.spec is not None or not copies else copies[0].spec


def _task_of(env: Any) -> Any:
    """The seedbed task of an environment, if no wrapper changes its observations."""
    layers = [env]
    while layers[-1] is not env.unwrapped:
        layers.append(layers[-1].env)
    task = getattr(layers[-1], "task", None)
    if not all(hasattr(task, name) for name in ("observations", "actions", "time_limit")):
        return None
    is_changed = any(
        layer.observation_space is not layers[-1].observation_space or layer.action_space is not layers[-1].action_space
        for layer in layers
    )
    return None if is_changed else task


def _has_wrapper(env: Any, kind: type) -> bool:
    while env is not env.unwrapped:
        if isinstance(env, kind):
            return True
        env = env.env
    return False
