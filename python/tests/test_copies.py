"""Vector environments and teams can be copied and sent to other processes, and continue there with the same bits."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from test_vector import assert_equal

import seedbed

MODES = list(AutoresetMode)

WAYS: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{f"pickle {protocol}": lambda one, protocol=protocol: pickle.loads(pickle.dumps(one, protocol)) for protocol in range(2, 6)},
}


def play_vector(environments: seedbed.VectorEnv, steps: int) -> list[Any]:
    """Results of random actions, with all resets that the mode needs."""
    results: list[Any] = []
    for _ in range(steps):
        found = environments.step(environments.action_space.sample())
        results.append(tuple(np.array(part) for part in found[:4]))
        ended = found[2] | found[3]
        if environments.autoreset_mode == AutoresetMode.DISABLED and ended.any():
            results.append(np.array(environments.reset(options={"reset_mask": ended})[0]))
    return results


def play_team(team: Any, steps: int) -> list[Any]:
    results: list[Any] = []
    for step in range(steps):
        if not team.agents:
            results.append(team.reset())
        results.append(team.step({agent: team.action_space(agent).sample() for agent in team.agents}))
        results.append(list(team.agents))
    return results


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mode", MODES)
def test_copies_of_vector_environments_continue_with_the_same_bits(way: str, mode: AutoresetMode):
    """In the middle of episodes, of which some have ended; limits, seeds and sampled actions go along."""
    arguments = {"physics": "analytic", "max_episode_steps": 30, "threads": 2, "autoreset_mode": mode}
    environments = seedbed.make("cartpole", 5, **arguments)
    environments.reset(seed=3)
    environments.action_space.seed(4)
    play_vector(environments, 25)
    found = WAYS[way](environments)
    assert type(found) is seedbed.VectorEnv
    assert found.get_state() == environments.get_state()
    assert (found.threads, found.np_random_seed, found.spec) == (2, environments.np_random_seed, environments.spec)
    if way == "copy":
        # As `copy.deepcopy`: otherwise both would step the same simulation.
        assert found.action_space is not environments.action_space
    assert_equal(play_vector(found, 100), play_vector(environments, 100))


@pytest.mark.parametrize("name", ["hopper", "lander", "deep_sea", "dm_reacher_easy"])
def test_copies_of_other_tasks(name: str):
    environments = seedbed.make(name, 3)
    environments.reset(seed=1)
    environments.action_space.seed(4)
    play_vector(environments, 10)
    found = pickle.loads(pickle.dumps(environments))
    assert_equal(play_vector(found, 60), play_vector(environments, 60))


def test_copies_before_the_first_reset():
    for environment in (seedbed.make("cartpole", 2), seedbed.parallel_env("cartpole"), seedbed.make("cartpole")):
        found = copy.deepcopy(environment)
        assert_equal(found.reset(seed=1), environment.reset(seed=1))
        with pytest.raises(gymnasium.error.ResetNeeded):
            copy.deepcopy(seedbed.make("cartpole", 2)).step(np.zeros(2, int))


def test_copies_that_share_their_array_of_observations_do_not_share_it_with_each_other():
    environments = seedbed.make("cartpole", 2, copy=False)
    observations, _ = environments.reset(seed=0)
    found = copy.copy(environments)
    before = observations.copy()
    moved, *_ = found.step(np.array([1, 1]))
    assert np.array_equal(observations, before)
    assert found.step(np.array([1, 1]))[0] is moved


@pytest.mark.parametrize("way", WAYS)
def test_copies_of_teams_continue_with_the_same_bits(way: str):
    """Some agents are no longer in `agents`."""
    team = seedbed.parallel_env("cartpole", agents=4)
    team.reset(seed=2)
    for agent, space in team.action_spaces.items():
        space.seed(int(agent[-1]))
    while len(team.agents) != 2:
        play_team(team, 1)
    found = WAYS[way](team)
    assert found.agents == team.agents
    assert np.array_equal(found.state(), team.state())
    assert found.action_space("agent_0") is found.action_space("agent_0") is not team.action_space("agent_0")
    assert_equal(play_team(found, 60), play_team(team, 60))


@pytest.mark.parametrize("name", ["cartpole", "hopper", "deep_sea"])
def test_teams_can_be_set_to_a_state(name: str):
    team, other = seedbed.parallel_env(name, agents=3), seedbed.parallel_env(name, agents=3)
    for one in (team, other):
        for agent, space in one.action_spaces.items():
            space.seed(int(agent[-1]))
    team.reset(seed=2)
    play_team(team, 7)
    state = team.get_state()
    observations = other.set_state(state)
    assert list(observations) == other.agents == team.agents
    assert np.array_equal(other.state(), team.state())
    for agent in observations:
        other.action_space(agent).seed(5), team.action_space(agent).seed(5)
    assert_equal(play_team(other, 60), play_team(team, 60))


def test_states_of_some_agents():
    team = seedbed.parallel_env("cartpole", agents=3)
    idle = team.get_state()
    first, _ = team.reset(seed=2)
    state = team.get_state()
    moved, *_ = team.step(dict.fromkeys(team.agents, 1))
    found = team.set_state([state[1]], agents=["agent_1"])
    assert_equal(found, {"agent_0": moved["agent_0"], "agent_1": first["agent_1"], "agent_2": moved["agent_2"]})
    # A single environment has a state of the same kind.
    single = seedbed.make("cartpole")
    assert np.array_equal(single.set_state(state[2]), first["agent_2"])
    assert team.set_state([idle[0]], agents=["agent_0"]).keys() == {"agent_1", "agent_2"}
    assert team.set_state(idle) == {} and team.agents == []


@pytest.mark.parametrize(
    ("states", "agents", "words"),
    [
        (lambda states: states[:2], None, "there are 2 states, expected 3"),
        (lambda states: states[0], None, "one state as bytes, expected 3"),
        (lambda states: [*states[:2], b"wrong"], None, "not a state"),
        (lambda states: states[:1], ["agent_3"], "no agent 'agent_3', expected one of agent_0, agent_1, agent_2"),
    ],
)
def test_wrong_states_of_teams_change_nothing(states: Any, agents: Any, words: str):
    team = seedbed.parallel_env("cartpole", agents=3)
    team.reset(seed=2)
    before = team.get_state()
    team.step(dict.fromkeys(team.agents, 1))
    now = team.get_state()
    with pytest.raises(ValueError, match=words):
        team.set_state(states(before), agents)
    assert team.get_state() == now


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_vector_environments_in_other_processes(method: str):
    """The process plays by a method of the environments, because one that is started anew cannot import this file."""
    if method not in multiprocessing.get_all_start_methods():
        return
    environments = seedbed.make("cartpole", 4, threads=2)
    environments.reset(seed=0)
    actions = np.array([0, 1, 1, 0])
    with multiprocessing.get_context(method).Pool(1) as pool:
        found = pool.apply_async(environments.step, (actions,)).get(timeout=120)
    expected = environments.step(actions)
    assert all(np.array_equal(one, other) for one, other in zip(found[:4], expected[:4], strict=True))


def test_tasks_of_files_in_asynchronous_vector_environments(mixed_task: Path):
    """Environments are made here, and sent to processes that are started anew."""
    singles = [seedbed.make(mixed_task) for _ in range(2)]
    environments = AsyncVectorEnv([lambda one=one: copy.deepcopy(one) for one in singles], context="spawn")
    found, _ = environments.reset(seed=3)
    assert np.array_equal(found, seedbed.make(mixed_task, 2).reset(seed=3)[0])
    environments.close()


@pytest.mark.parametrize("processes", [0, 2])
def test_supersuit(processes: int):
    """Its vector environments of a team have the rows of the team, one copy after the other."""
    supersuit = pytest.importorskip("supersuit")
    team = seedbed.parallel_env("cartpole", agents=3)
    vector = supersuit.pettingzoo_env_to_vec_env_v1(team)
    environments = supersuit.concat_vec_envs_v1(vector, 2, num_cpus=processes, base_class="gymnasium")
    try:
        observations, _ = environments.reset(seed=4)
        expected = [list(seedbed.parallel_env("cartpole", agents=3).reset(seed=seed)[0].values()) for seed in (4, 7)]
        assert observations.shape == (6, 4)
        assert np.array_equal(observations[:3], expected[0])
        environments.step(np.zeros(6, np.int64))
    finally:
        environments.close()


def test_supersuits_wrappers():
    supersuit = pytest.importorskip("supersuit")
    team = supersuit.frame_stack_v1(supersuit.dtype_v0(seedbed.parallel_env("hopper", agents=2), np.float64), 3)
    observations, _ = team.reset(seed=0)
    assert {row.dtype for row in observations.values()} == {np.dtype(np.float64)}
    team.step({agent: team.action_space(agent).sample() for agent in team.agents})
