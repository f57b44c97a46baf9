"""A team of agents as a PettingZoo parallel environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv as PettingZooParallelEnv

from ._native import Batch
from .environment import PICTURE_SIZE, Copyable, Physics, RenderMode, TaskLike, as_task, given_start, rendering, set_states
from .seeding import checked_seed, random_seed
from .spaces import action_space, observation_space


OPTIONS_OF_API_TEST = {"options": 1}
"""Options that `pettingzoo.test.parallel_api_test` gives to each environment, which must accept them."""


class ParallelEnv(Copyable, PettingZooParallelEnv[str, NDArray[np.float32], Any]):  # type: ignore[misc]
    """K agents that act at the same time, each in a copy of the task of its own: they do not meet.

    The start states are those of a team in the workbench: agent k draws them from the random stream (run
    seed, reset, agent k, round 0). An agent whose episode has ended is no longer in `agents`; the next
    `reset` starts new episodes for all.

    Args:
        task: A task, the path of a task file, or the name of a task; see `Task`.
        agents: Number of agents K.
        physics: "rapier" for rigid bodies, "analytic" for the task's analytic model.
        threads: Number of threads; by default the number of cores, but at most one per 256 agents, or per 8
            agents in a task with contacts.
        max_episode_steps: Steps after which an episode is truncated; by default those of the task, and -1
            for no limit.
        render_mode: "rgb_array" to draw the bodies, if the task has any.
        run_seed: Run seed with which tasks are drawn that differ from run to run; by default 0. See `Task`.

    Raises:
        TaskError: Something in the task file is wrong.
        FileNotFoundError: There is no such file or task.
        ValueError: An argument is invalid.

    Example:
        >>> environment = ParallelEnv("cartpole", agents=2)
        >>> observations, infos = environment.reset(seed=0)
        >>> observations, rewards, terminated, truncated, infos = environment.step({"agent_0": 0, "agent_1": 1})
        >>> rewards
        {'agent_0': 1.0, 'agent_1': 1.0}
    """

    metadata: dict[str, Any] = {"name": "seedbed", "is_parallelizable": True}

    def __init__(
        self,
        task: TaskLike,
        agents: int = 2,
        *,
        physics: Physics = "rapier",
        threads: int | None = None,
        max_episode_steps: int | None = None,
        render_mode: RenderMode | None = None,
        run_seed: int | None = None,
    ) -> None:
        self.task = as_task(task, run_seed)
        """Description of the task: names, units and ranges."""
        self._batch = Batch(
            self.task, agents, physics=physics, threads=threads, max_episode_steps=max_episode_steps, team=True
        )
        self.metadata = rendering(self._batch, self.task, render_mode) | {
            "name": f"seedbed_{self.task.name}",
            "is_parallelizable": True,
        }
        self.render_mode = render_mode
        self.possible_agents = [f"agent_{index}" for index in range(agents)]
        self.agents: list[str] = []
        self._index = {agent: index for index, agent in enumerate(self.possible_agents)}
        self.observation_spaces = {agent: observation_space(self.task) for agent in self.possible_agents}
        self.action_spaces = {agent: action_space(self.task) for agent in self.possible_agents}
        self._observations = np.zeros((agents, len(self.task.observations)), np.float32)
        self._rewards = np.zeros(agents)
        self._terminated = np.zeros(agents, np.bool_)
        self._truncated = np.zeros(agents, np.bool_)

    def __repr__(self) -> str:
        return f"ParallelEnv({self.task.name!r}, agents={len(self.possible_agents)})"

    def observation_space(self, agent: str) -> spaces.Space[NDArray[np.float32]]:
        """Space of an agent's observations: the same object in each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's actions: the same object in each call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, dict[str, Any]]]:
        """Start a new episode of each agent.

        Args:
            seed: Random number seed of the start states, from 0 to 2**64 - 1: a run seed of the workbench.
                Without a seed the sequences continue; before the first one it is drawn by the operating
                system.
            options: `"positions"`, `"velocities"` and `"numbers"` are those of `Env.reset`, for each agent.

        Returns:
            For each agent its observation, float32, `[observations]`, and an empty dictionary.

        Raises:
            TypeError: The seed or an option has another type. Nothing has changed.
            ValueError: There is no such seed, option, coordinate or number. Nothing has changed.
        """
        start = given_start(self._batch, None if options == OPTIONS_OF_API_TEST else options)
        if seed is None and self._batch.unseeded():
            seed = random_seed()
        if seed is not None:
            seed = checked_seed(seed)
            for index in range(len(self.possible_agents)):
                self._batch.seed(index, seed)
        self._batch.reset(self._observations, None, start)
        self.agents = list(self.possible_agents)
        return self._observations_of(self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[
        dict[str, NDArray[np.float32]],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Advance by one control step of `task.control_step` seconds.

        Args:
            actions: The action of each agent in `agents`.

        Returns:
            For each agent that has acted: observation (float32, `[observations]`), reward, whether its task
            has terminated, whether its episode is truncated by the time limit, and an empty dictionary.

        Raises:
            ValueError: An agent has no action or is not in `agents`, or an action is not in the action
                space, or not finite. Nothing has moved.
            gymnasium.error.ResetNeeded: `reset` was never called.
        """
        acting = self.agents
        if set(actions) != set(acting):
            raise ValueError(f"there are actions of {sorted(actions)}, expected those of {sorted(acting)}")
        for agent in acting:
            try:
                self._batch.set_action(self._index[agent], actions[agent])
            except ValueError as error:
                raise ValueError(f"{agent}: {error}") from None
        self._batch.step(
            None, self._observations, self._rewards, self._terminated, self._truncated
        )
        terminated = {agent: bool(self._terminated[self._index[agent]]) for agent in acting}
        truncated = {agent: bool(self._truncated[self._index[agent]]) for agent in acting}
        rewards = {agent: float(self._rewards[self._index[agent]]) for agent in acting}
        self.agents = [agent for agent in acting if not (terminated[agent] or truncated[agent])]
        return self._observations_of(acting), rewards, terminated, truncated, {agent: {} for agent in acting}

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the bodies of all agents, from top to bottom.

        Returns:
            A picture, uint8, `[K × 400, 600, 3]`; None if the environment was made without `render_mode`.
        """
        if self.render_mode is None:
            gymnasium.logger.warn('`render` draws nothing: make the environment with render_mode="rgb_array"')
            return None
        pictures = [self._batch.render(index, *PICTURE_SIZE) for index in range(len(self.possible_agents))]
        return np.concatenate(pictures)

    def state(self) -> NDArray[np.float32]:
        """The current observations of all agents, float32, `[K, observations]`."""
        return self._observations.copy()

    def get_state(self) -> list[bytes]:
        """The whole state of each agent's copy, as `VectorEnv.get_state`."""
        return [self._batch.save(index) for index in range(len(self.possible_agents))]

    def set_state(self, states: Sequence[bytes], agents: Sequence[str] | None = None) -> dict[str, NDArray[np.float32]]:
        """Continue from states that `get_state` returned, here or in any environment of this task.

        Agents whose episode is running in their state are in `agents` afterwards, and no others.

        Args:
            states: One state for each agent, or for each of `agents`.
            agents: Names of the agents whose state is set; by default all.

        Returns:
            For each agent in `self.agents` its observation, float32, `[observations]`.

        Raises:
            ValueError: Bytes are not a state of this task, their number is wrong, or there is no such agent.
                No agent has changed.
        """
        names = self.possible_agents if agents is None else agents
        unknown = [name for name in names if name not in self._index]
        if unknown:
            raise ValueError(f"there is no agent {unknown[0]!r}, expected one of {', '.join(self.possible_agents)}")
        set_states(self._batch, [self._index[name] for name in names], states)
        self._batch.observe(self._observations)
        self.agents = [self.possible_agents[index] for index in self._batch.running()]
        return self._observations_of(self.agents)

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    def _observations_of(self, agents: list[str]) -> dict[str, NDArray[np.float32]]:
        return {agent: self._observations[self._index[agent]].copy() for agent in agents}
