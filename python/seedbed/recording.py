"""Recording where agents go, in any Gymnasium environment.

    >>> import gymnasium, seedbed
    >>> environment = gymnasium.make("CartPole-v1")
    >>> environment = seedbed.RecordVisitation(environment, "runs/cartpole", agent=0)  # doctest: +SKIP

After `close`, `seedbed explore runs/cartpole` and all other commands of the program show the visited states.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NoReturn

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from .agent_files import AgentFiles
from .batch_recorder import BatchRecorder
from .episode_recorder import EpisodeRecorder
from .recorded_actions import action_numbers, batch_action_numbers
from .recorded_axes import Ranges, action_axes, observation_axes
from .recorded_environment import (
    agent_numbers,
    check_kind,
    has_wrapper,
    header_of,
    headers_of,
    learner_numbers,
    name_of,
    spec_of,
    task_of,
    warn_of_normalization,
)
from .recorded_features import Features, feature_function
from .state_files import RecordingError

__all__ = ["RecordVisitation", "RecordVisitationVector", "RecordingError"]


def refuse_copies(recorder: object) -> NoReturn:
    """Refuse to copy a recorder, or to send it to another process."""
    name = type(recorder).__name__
    raise TypeError(
        f"a {name} cannot be copied or sent to another process, because both would write to one file; "
        f"make it there instead, such as SubprocVecEnv([lambda: {name}(make_env(), folder, agent=k), …])"
    )


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
        env: An environment whose observations are a Box, with at most 1000 numbers, unless `features` are recorded. All Dict,
            Tuple and Discrete observations can be flattened with `gymnasium.wrappers.FlattenObservation` first.
        folder: Folder of the run.
        agent: Number of the agent, from 0.
        learner: Number of the learner that acts. Give agents the same number if they are copies of an environment in which
            one learner acts, such as those of a `SubprocVecEnv`: they count as one. By default each agent is a learner.
        features: What is recorded in place of the observations, such as of pictures: a function of `(observation, info)` that
            returns numbers, whose `names` must be given; or names of entries of `info`, which are NaN where they are missing.
            The agent observes what it did before.
        names: Name of each observation or feature; by default those of a seedbed task, or `observation_0`, `observation_1`, …
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
        features: Features | None = None,
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
        check_kind(env, "environment")
        warn_of_normalization(env)
        super().__init__(env)
        task = task_of(env)
        observations = observation_axes(env.observation_space, task, names, units, ranges, features)
        actions = action_axes(env.action_space, task, action_names)
        name = environment or name_of(env, env.spec)
        header = header_of(agent, name, observations, actions, env.spec, env.metadata, learner)
        files = AgentFiles(Path(folder).absolute(), [header], overwrite, resume)
        convert = action_numbers(env.action_space, task)
        self._recorder = EpisodeRecorder(files, convert, feature_function(features), keep_unfinished)
        self._finish = weakref.finalize(self, self._recorder.close)
        self._autoresets = has_wrapper(env, gymnasium.wrappers.Autoreset)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a new episode; see `gymnasium.Env.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._recorder.start(observation, info)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment, and record the step; see `gymnasium.Env.step`."""
        result = self.env.step(action)
        recorder = self._recorder
        if recorder.is_running:
            recorder.add(action, *result)
        else:
            recorder.add_unrecorded(*result, starts=self._autoresets)
        return result

    def close(self) -> None:
        """Complete the files of the agent, and close the environment."""
        try:
            self._finish()
        finally:
            super().close()

    __getstate__ = refuse_copies


class RecordVisitationVector(gymnasium.vector.VectorWrapper[Any, Any, Any, Any, Any]):
    """Record which states the agents of a vector environment visit.

    Each copy of the environment is an agent with a file of its own; see `RecordVisitation`, whose arguments have the
    same meaning here. By default one learner acts in all copies, so that their episodes count as those of one.
    Steps that only reset a copy (`AutoresetMode.NEXT_STEP`) are not recorded, because they are no transitions.

    Args:
        env: A vector environment whose observations are a Box, unless `features` are recorded, in any autoreset mode.
        folder: Folder of the run.
        agents: Number of the agent of each copy; by default 0, 1, …
        learners: Number of the learner of each copy, such as `range(env.num_envs)` if each has its own; by default the
            number of the first agent for all copies.
        features: As for `RecordVisitation`; a function is called for each copy, with its observation and its `info`.
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
        features: Features | None = None,
        names: Sequence[str] | None = None,
        units: Sequence[str] | Mapping[str, str] | None = None,
        ranges: Ranges = None,
        action_names: Sequence[str] | None = None,
        environment: str | None = None,
        learners: Sequence[int] | None = None,
        autoreset_mode: Literal["NextStep", "SameStep", "Disabled"] | AutoresetMode | None = None,
        overwrite: bool = False,
        resume: bool = False,
        keep_unfinished: bool | None = None,
    ) -> None:
        check_kind(env, "vector")
        warn_of_normalization(env)
        super().__init__(env)
        mode = autoreset_mode or env.metadata.get("autoreset_mode")
        if mode is None:
            raise ValueError("env.metadata has no autoreset_mode; give it, such as autoreset_mode='NextStep'")
        task, spec = task_of(env), spec_of(env)
        numbers = agent_numbers(agents, env.num_envs)
        headers = headers_of(
            numbers,
            learner_numbers(learners, numbers),
            environment or name_of(env, spec),
            observation_axes(env.single_observation_space, task, names, units, ranges, features),
            action_axes(env.single_action_space, task, action_names),
            spec,
            env.metadata,
        )
        files = AgentFiles(Path(folder).absolute(), headers, overwrite, resume)
        convert = batch_action_numbers(env.single_action_space, task)
        self._recorder = BatchRecorder(files, AutoresetMode(mode), convert, feature_function(features), keep_unfinished)
        self._finish = weakref.finalize(self, self._recorder.close)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start new episodes; see `gymnasium.vector.VectorEnv.reset`."""
        # Gymnasium removes the mask from `options`.
        mask = options.get("reset_mask") if isinstance(options, Mapping) else None
        observations, infos = self.env.reset(seed=seed, options=options)
        self._recorder.start(observations, infos, None if mask is None else np.array(mask))
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all copies, and record the steps; see `gymnasium.vector.VectorEnv.step`."""
        result = self.env.step(actions)
        infos = result[4] or {}
        self._recorder.add(actions, *result[:4], infos, infos.get("final_obs"), infos.get("final_info"))
        return result

    def close(self, **kwargs: Any) -> None:
        """Complete the files of the agents, and close the environments."""
        try:
            self._finish()
        finally:
            super().close(**kwargs)

    __getstate__ = refuse_copies
