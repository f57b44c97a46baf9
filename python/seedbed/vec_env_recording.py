"""Recording where agents go, in the vector environments of Stable-Baselines3."""

from __future__ import annotations

import os
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from .agent_files import AgentFiles
from .batch_recorder import BatchRecorder
from .recorded_actions import batch_action_numbers
from .recorded_axes import Ranges, action_axes, observation_axes
from .recorded_environment import agent_numbers, check_kind, headers_of, learner_numbers, name_of, warn_of_normalization
from .recorded_features import Features, feature_function
from .recording import refuse_copies


class RecordVecEnv(VecEnvWrapper):
    """Record which states the agents of a `VecEnv` of Stable-Baselines3 visit.

    As `RecordVisitationVector`, whose arguments have the same meaning: each copy has a file of its own, and by default one
    learner acts in all copies. Put it inside of `VecNormalize` and `VecFrameStack`, so that the states are recorded as they
    are. The copies may be in other processes (`SubprocVecEnv`): this one writes the files.

    Args:
        venv: A vector environment whose observations are a Box, unless `features` are recorded, as for `HER`.
        folder: Folder of the run.

    Example:
        >>> environments = make_vec_env("CartPole-v1", n_envs=8)  # doctest: +SKIP
        >>> environments = RecordVecEnv(environments, "recordings/ppo")  # doctest: +SKIP
        >>> PPO("MlpPolicy", environments).learn(100_000)  # doctest: +SKIP
        >>> environments.close()  # doctest: +SKIP
    """

    def __init__(
        self,
        venv: VecEnv,
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
        overwrite: bool = False,
        resume: bool = False,
        keep_unfinished: bool | None = None,
    ) -> None:
        check_kind(venv, "VecEnv")
        warn_of_normalization(venv)
        super().__init__(venv)
        spec = _attribute(venv, "spec")
        numbers = agent_numbers(agents, venv.num_envs)
        headers = headers_of(
            numbers,
            learner_numbers(learners, numbers),
            environment or name_of(venv, spec),
            observation_axes(venv.observation_space, None, names, units, ranges, features),
            action_axes(venv.action_space, None, action_names),
            spec,
            _attribute(venv, "metadata") or {},
        )
        files = AgentFiles(Path(folder).absolute(), headers, overwrite, resume)
        convert = batch_action_numbers(venv.action_space, None)
        self._recorder = BatchRecorder(files, AutoresetMode.SAME_STEP, convert, feature_function(features), keep_unfinished)
        self._finish = weakref.finalize(self, self._recorder.close)
        self._actions: Any = None

    def reset(self) -> Any:
        """Start new episodes; see `VecEnv.reset`."""
        observations = self.venv.reset()
        self._recorder.start(observations, self.venv.reset_infos, None)
        return observations

    def step_async(self, actions: Any) -> None:
        """Begin a step; see `VecEnv.step_async`."""
        self._actions = actions
        self.venv.step_async(actions)

    def step_wait(self) -> Any:
        """End the step, and record it; see `VecEnv.step_wait`."""
        result = self.venv.step_wait()
        observations, rewards, ended, infos = result
        truncated = np.array([bool(info.get("TimeLimit.truncated")) for info in infos]) & ended
        last = [info.get("terminal_observation") for info in infos]
        # The information of an ended copy belongs to its last state.
        of_states = [self.venv.reset_infos[copy] if ended[copy] else info for copy, info in enumerate(infos)]
        self._recorder.add(self._actions, observations, rewards, ended & ~truncated, truncated, of_states, last, infos)
        return result

    def close(self) -> None:
        """Complete the files of the agents, and close the environments."""
        try:
            self._finish()
        finally:
            super().close()

    __getstate__ = refuse_copies


def _attribute(venv: VecEnv, name: str) -> Any:
    """An attribute of the first copy; None if it has none."""
    try:
        return venv.get_attr(name, 0)[0]
    except AttributeError:
        return None
