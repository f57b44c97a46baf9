"""Teams of agents that learn in training loops of your own.

>>> import gymnasium, seedbed
>>> environments = gymnasium.make_vec("CartPole-v1", num_envs=2)
>>> spaces = environments.single_observation_space, environments.single_action_space
>>> team = seedbed.Team("SeedPg", *spaces, agents=2, seed=0)
>>> observations, _ = environments.reset(seed=0)
>>> while not team.ready:
...     actions = team.act(observations)
...     observations, rewards, terminated, truncated, infos = environments.step(actions)
...     team.record(observations, rewards, terminated, truncated, infos)
>>> metrics = team.learn()
>>> metrics["return"].shape, team.round
((2,), 1)
"""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import safetensors.numpy
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from . import _native, programs
from ._native import Task
from .errors import RunError
from .recorded_axes import Ranges
from .ron import algorithm_text, fields_of_map
from .seeding import checked_seed
from .team_spaces import components_of, conversion_to, observed_quantities, space_from_dict, space_to_dict
from .vector import BATCH_AUTORESET, Autoreset

if TYPE_CHECKING:
    from .policies import Policy

Settings: TypeAlias = str | Mapping[str, Any]
"""RON, or a map of its fields, in which texts are RON already."""

DEFAULT_MAX_STEPS = 10_000

HELP = "\n  = help: "
"""What precedes the help in an error."""


class Team:
    """K agents that learn together, in a training loop of your own.

    Each agent acts in its own copy of an environment: row k of all arrays is that of agent k. The loop is

    1. `actions = team.act(observations)`: every playing agent chooses its next action;
    2. `team.record(*environments.step(actions))`: the result of the step;
    3. `team.learn()` once each agent has ended an episode (`team.ready`): all agents learn from all episodes that have
       ended since the last call, and the next *round* begins.

    The bits are those of `seedbed run` with the same settings, if observations and rewards are: they depend on the run seed, and
    not on the number of threads. Agents act and learn without Python's global interpreter lock.

    Args:
        algorithm: Name of an algorithm (`"SeedPg"`), its settings in RON (`"SeedPg(discount: 0.9)"`), or as a map
            (`{"SeedPg": {"discount": 0.9, "policy_loss": "Ppo(clip: 0.1)"}}`, in which texts are RON). `seedbed list
            algorithms` shows all.
        observation_space: Space of the observation of one agent: a Box of at most 1000 numbers.
        action_space: Space of the action of one agent: Discrete, MultiDiscrete, MultiBinary, a Box with finite bounds, or a
            Dict of these. Which fit depends on the algorithm.
        agents: Number of agents K, or what a scenario says of them: `dict(count=4, seeds="Normal(sigma: 0.5)")`.
        seed: Run seed, from which all random numbers of the team are derived, from 0 to 2**64 - 1.
        autoreset_mode: When the environment of an agent whose episode has ended is reset: that of
            `environments.metadata["autoreset_mode"]`.

            * `NEXT_STEP` (default): by the next step, in which the agent does not play.
            * `SAME_STEP`: by the same step. The last observation of the old episode is in `infos`. Vector environments of
              Stable-Baselines3 do this.
            * `DISABLED`: by you, before the next `act`.
        episodes: Number of episodes that each agent plays per round; agents that have ended theirs wait for the others until
            `learn`, after which you reset the environments. By default nobody waits: agents play on.
        learn_every: Learn during episodes, in `record`: each time after this number of steps. For algorithms with a replay
            buffer, such as QLearning and SeedSac; they may also learn after episodes, as all others do (None).
        steps_of: Whose steps `learn_every` counts: those of one `"Agent"`, or of the whole `"Team"`.
        task: The task, if environments are those of `seedbed.make`: it has names, units and ranges of observations.
        names: Name of each observed number; by default `observation_0`, `observation_1`, …
        ranges: Ends of the range of each observed number, or of some by name, such as `{"x": (-1, 1)}`: inputs of networks
            are scaled with them. By default finite bounds of the Box; numbers without are not scaled.
        max_episode_steps: Maximum number of steps of an episode; by default that of the task, otherwise 10,000. A longer one
            is an error.
        threads: Number of threads on which agents learn; by default the number of cores. Results do not depend on it.

    Attributes:
        observation_space: Space of the observation of one agent.
        action_space: Space of the action of one agent.

    Raises:
        TypeError: An argument or a space has another type.
        ValueError: A setting is wrong, or the algorithm cannot learn with these actions. The message says what was expected.
    """

    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]

    def __init__(
        self,
        algorithm: Settings,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        agents: int | Mapping[str, Any] = 1,
        seed: int = 0,
        autoreset_mode: Autoreset | AutoresetMode = "NextStep",
        episodes: int | None = None,
        learn_every: int | None = None,
        steps_of: Literal["Agent", "Team"] = "Agent",
        task: Task | None = None,
        names: Sequence[str] | None = None,
        ranges: Ranges = None,
        max_episode_steps: int | None = None,
        threads: int | None = None,
    ) -> None:
        if steps_of not in ("Agent", "Team"):
            raise ValueError(f'steps_of is {steps_of!r}, expected "Agent" or "Team"')
        if task is not None and not isinstance(task, Task):
            raise TypeError(f"task is {task!r}, expected a seedbed.Task")
        notes = {"observation_space": observation_space, "action_space": action_space}
        observations = observed_quantities(observation_space, task, names, ranges)
        actions = components_of(action_space, task)
        text = algorithm_text(algorithm)
        limit = DEFAULT_MAX_STEPS if task is None else min(task.time_limit, 100 * DEFAULT_MAX_STEPS)
        with _with_names_of_others(text):
            self._team = _native.Team(
                text,
                fields_of_map(agents if isinstance(agents, Mapping) else {"count": _count("agents", agents)}, "agents"),
                "environments" if task is None else task.name,
                observations,
                actions,
                observation_space.shape or (),
                seed=checked_seed(seed),
                max_episode_steps=_count("max_episode_steps", limit if max_episode_steps is None else max_episode_steps),
                episodes=None if episodes is None else _count("episodes", episodes),
                learn_every=None if learn_every is None else _count("learn_every", learn_every),
                counts_team_steps=steps_of == "Team",
                autoreset=BATCH_AUTORESET[AutoresetMode(autoreset_mode)],
                threads=threads,
                notes=json.dumps({name: space_to_dict(space) for name, space in notes.items()}),
            )
        self._set_spaces(observation_space, action_space)

    def _set_spaces(self, observation_space: spaces.Space[Any], action_space: spaces.Space[Any]) -> None:
        self.observation_space, self.action_space = observation_space, action_space
        self._convert = conversion_to(action_space)
        self._resets_in_same_step = self._team.autoreset == "same_step"

    @property
    def agents(self) -> int:
        """Number of agents K."""
        return self._team.agents

    @property
    def algorithm(self) -> str:
        """The algorithm, in RON."""
        return self._team.algorithm

    @property
    def seed(self) -> int:
        """The run seed."""
        return self._team.seed

    @property
    def round(self) -> int:
        """Number of finished rounds: of calls of `learn`."""
        return self._team.round

    @property
    def threads(self) -> int:
        """Number of threads on which agents learn."""
        return self._team.threads

    @property
    def ready(self) -> bool:
        """Whether each agent has ended its episodes of the round, so that the team can `learn`."""
        return self._team.ready

    @property
    def playing(self) -> NDArray[np.bool_]:
        """Whether each agent is playing an episode: bool, `[K]`. Actions of others have no meaning."""
        return self._team.playing

    def act(self, observations: ArrayLike) -> Any:
        """Choose the next action of each agent. An agent without an episode starts one, unless it waits.

        Args:
            observations: What the latest `step` or `reset` returned: `[K, *observation_space.shape]`. Rows of agents that
                wait, or whose environments are reset by the next step, are ignored.

        Returns:
            Actions as vector environments of the action space take them, such as int64 `[K]` for Discrete, and float32 `[K,
            components]`, within its bounds, for a Box. Actions of agents that do not play are valid, but have no meaning.

        Raises:
            ValueError: Observations have another shape or type, are not finite, or are others than those that were recorded.
            RuntimeError: The latest step is not recorded, or all agents wait for `learn`.
        """
        try:
            actions = self._team.act(observations)
        except ValueError as error:
            if np.shape(observations) == self.observation_space.shape:
                message = f"{error}; the team has the spaces of a vector environment, expected its single_observation_space and single_action_space"
                raise ValueError(message) from None
            raise
        return actions if self._convert is None else self._convert(actions)

    def record(
        self,
        observations: ArrayLike,
        rewards: ArrayLike,
        terminated: ArrayLike,
        truncated: Any,
        infos: Mapping[str, Any] | None = None,
    ) -> None:
        """Add the result of a step, with the actions of `act`, to the episodes: what `environments.step` returned.

        Four arguments are those of a vector environment of Stable-Baselines3: `observations, rewards, dones, infos`, where
        `infos` is a list.

        Args:
            observations: Observations after the step: `[K, *observation_space.shape]`.
            rewards: Rewards: `[K]`.
            terminated: Whether episodes have ended in a terminal state: bool, `[K]`.
            truncated: Whether episodes were cut off: bool, `[K]`.
            infos: With `SAME_STEP`, `infos["final_obs"]` has the last observations of episodes that have ended; not needed
                otherwise.

        Raises:
            ValueError: An array has another shape or type or is not finite, or the last observation of an episode is missing.
                Nothing has changed.
            RuntimeError: `act` was not called before.
        """
        if infos is None and isinstance(truncated, list | tuple) and all(isinstance(info, Mapping) for info in truncated):
            terminated, truncated, infos = _ends_of_vec_env(terminated, truncated)
        final = self._final_observations(observations, infos) if infos else None
        self._team.record(observations, rewards, terminated, truncated, final)

    def _final_observations(self, observations: ArrayLike, infos: Mapping[str, Any]) -> NDArray[np.float32] | None:
        """The last observations of episodes that ended and were followed by a reset in the same step; other rows are as given."""
        final = infos.get("final_obs", infos.get("final_observation"))
        if final is None:
            return None
        if not self._resets_in_same_step:
            raise ValueError(
                "infos has the last observations of episodes, so that environments are reset in the same step; "
                'expected Team(…, autoreset_mode="SameStep")'
            )
        rows = np.array(observations, np.float32)
        if len(final) != len(rows):
            raise ValueError(f"infos has {len(final)} last observations of episodes, expected {len(rows)}: one per agent")
        for index, observation in enumerate(final):
            if observation is not None:
                rows[index] = observation
        return rows

    def start(self, observations: ArrayLike, mask: ArrayLike | None = None) -> None:
        """Start new episodes after a reset in the middle of episodes, which are truncated where they are.

        `act` starts all other episodes.

        Args:
            observations: What `reset` returned: `[K, *observation_space.shape]`.
            mask: Which agents start new episodes: bool, `[K]`; by default all.

        Raises:
            ValueError: An array has another shape or type, or is not finite. Nothing has changed.
            RuntimeError: The latest step is not recorded, or an agent waits for `learn`.
        """
        self._team.start(observations, mask)

    def learn(self) -> dict[str, NDArray[np.float64]]:
        """All agents learn from the episodes that have ended since the last call, and the next round begins.

        Episodes in progress go on, unless agents wait for each other (`episodes=`).

        Returns:
            Arrays `[K]` with a number per agent, NaN where nothing was measured: `return`, the mean return of the agent's
            episodes, and the numbers of the update, called as the columns of `rounds.csv`: `gradient_steps`, `value_loss`,
            `policy_loss`, `ratio_deviation`, `largest_ratio`, `clipped_fraction`, `entropy`, `intrinsic_reward`,
            `prediction_error`, `bonus_agreement`.

        Raises:
            RuntimeError: An agent has not ended its episodes, or the latest step is not recorded.
            FloatingPointError: A network has diverged.
        """
        return self._team.learn()

    def parameters(self) -> dict[str, NDArray[np.float32]]:
        """Copies of the parameters of all networks, with the names in `policies.safetensors` of a run.

        Names begin with the owner, such as `agent_3.policy.layer_0.weight`; `model_3.` is a model that agents share, and `team.`
        what the whole team shares.
        """
        return self._team.parameters()

    def policy(self, agent: int = 0, *, model: int | None = None) -> Policy:
        """A copy of the policy of an agent as it is now, for evaluation: a function of observations, which can also be written as
        an ONNX file. It chooses greedy actions, and others on request; a discrete action is its index, from 0.

        Args:
            agent: Number of the agent, from 0.
            model: Number of a model of the team, as in `Run.policy`.

        Raises:
            RunError: The algorithm has no networks.
            IndexError: There is no such agent or model.
        """
        from .policies import Policy

        with tempfile.TemporaryDirectory(prefix="seedbed-") as folder:
            path = Path(folder) / "policies.safetensors"
            self.save_policies(path)
            return Policy(path, agent, model)

    def save_policies(self, path: str | os.PathLike[str]) -> None:
        """Write the parameters of all networks as a file of safetensors, like `policies.safetensors` of a run.

        `seedbed.Policy(path, agent)` reads it.
        """
        _write(Path(path), safetensors.numpy.save(self.parameters(), self._team.metadata()))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the whole team to a file, from which `Team.load` continues with the same bits.

        Episodes in progress are in it; save the environments too, if they are not reset then.

        Raises:
            RuntimeError: A round is in progress: save before its first step, or after `learn`.
            OSError: The file cannot be written. An existing one stays as it was.
        """
        _write(Path(path), self._team.save())

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, threads: int | None = None) -> Team:
        """The team that `save` wrote.

        Args:
            path: The file.
            threads: Number of threads on which agents learn; by default the number of cores.

        Raises:
            ValueError: The file is no saved team, or damaged.
            OSError: The file cannot be read.
        """
        team = cls.__new__(cls)
        try:
            team._team = _native.Team.load(Path(path).read_bytes(), threads)
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)}: {error}") from None
        notes = json.loads(team._team.notes)
        team._set_spaces(*(space_from_dict(notes[name]) for name in ("observation_space", "action_space")))
        return team

    def __repr__(self) -> str:
        name = self.algorithm.partition("(")[0]
        agents = "1 agent" if self.agents == 1 else f"{self.agents} agents"
        return f"<team of {agents} ({name}, run seed {self.seed}) after {self.round} rounds>"


def _ends_of_vec_env(
    dones: ArrayLike, infos: Sequence[Mapping[str, Any]]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Mapping[str, Any]]:
    """Whether episodes have terminated and are truncated, and their last observations, as Gymnasium says it."""
    ended = np.asarray(dones)
    truncated = np.array([bool(info.get("TimeLimit.truncated")) for info in infos], np.bool_)
    if ended.shape != truncated.shape:
        raise ValueError(f"`dones` has the shape {ended.shape}, expected {truncated.shape}")
    final = [info.get("terminal_observation") for info in infos]
    known = {} if all(observation is None for observation in final) else {"final_obs": final}
    return ended & ~truncated, ended & truncated, known


def _count(name: str, count: Any) -> int:
    if isinstance(count, bool) or not isinstance(count, int | np.integer):
        raise TypeError(f"{name} is {count!r}, expected an integer")
    if not 1 <= count < 2**32:
        raise ValueError(f"{name} is {count}, expected at least 1")
    return int(count)


@contextlib.contextmanager
def _with_names_of_others(algorithm: str) -> Iterator[None]:
    """Errors say what a name of another library, such as `PPO`, is here, which the program knows."""
    try:
        yield
    except ValueError as error:
        message, _, own_help = str(error).partition(HELP)
        if not message.startswith("algorithm:") or not (help := _help_of_program(algorithm) or own_help):
            raise
        raise ValueError(f"{message}{HELP}{help}") from None


def _help_of_program(algorithm: str) -> str | None:
    """How to write an algorithm with names of other libraries; None if the program says nothing or is missing."""
    with tempfile.TemporaryDirectory(prefix="seedbed-") as folder:
        path = Path(folder) / "team.ron"
        path.write_text(f'Scenario(environment: "cartpole", algorithm: {algorithm})\n', encoding="utf-8")
        try:
            programs.call("check", path)
        except RunError as error:
            found = error.message.partition(HELP)[2]
            return found if "; write " in found else None
        except OSError:
            pass
    return None


def _write(path: Path, content: bytes) -> None:
    """Write a file, or leave the one that there is as it was."""
    part = path.with_name(f"{path.name}.part")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise
