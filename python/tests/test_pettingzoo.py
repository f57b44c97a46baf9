"""Teams follow PettingZoo's interface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from pettingzoo.test import parallel_api_test, parallel_seed_test

import seedbed


@pytest.mark.parametrize("name", ["cartpole", "hopper", "deep_sea", "ball_on_beam"])
def test_parallel_api(name: str, capsys: pytest.CaptureFixture[str]):
    parallel_api_test(seedbed.parallel_env(name, agents=4), num_cycles=250)
    parallel_seed_test(lambda: seedbed.parallel_env(name, agents=3), num_cycles=30)
    assert "Passed" in capsys.readouterr().out


def test_parallel_api_with_named_actions(mixed_task: Path):
    parallel_api_test(seedbed.parallel_env(mixed_task, agents=2), num_cycles=50)


def test_agents_leave_when_their_episode_ends():
    """Pushed to the right only, poles fall within 12 steps; alternately pushed, later."""
    team = seedbed.parallel_env("cartpole", agents=3)
    observations, infos = team.reset(seed=0)
    assert list(observations) == list(infos) == team.agents == ["agent_0", "agent_1", "agent_2"]
    lengths = dict.fromkeys(team.possible_agents, 0)
    step = 0
    while team.agents:
        actions = {agent: 1 if agent == "agent_1" else step % 2 for agent in team.agents}
        acted = team.agents
        results = team.step(actions)
        assert all(sorted(result) == acted for result in results)
        for agent in acted:
            lengths[agent] += 1
        step += 1
    assert lengths["agent_1"] < 13 < min(lengths["agent_0"], lengths["agent_2"])
    assert team.step({}) == ({}, {}, {}, {}, {})


def test_agents_start_where_those_of_the_workbench_do():
    """The streams of agents differ, and agent 0 has that of a single environment."""
    observations, _ = seedbed.parallel_env("cartpole", agents=3).reset(seed=5)
    assert np.array_equal(observations["agent_0"], seedbed.make("cartpole").reset(seed=5)[0])
    assert len({row.tobytes() for row in observations.values()}) == 3
    larger, _ = seedbed.parallel_env("cartpole", agents=9, threads=3).reset(seed=5)
    assert np.array_equal(observations["agent_2"], larger["agent_2"])


def test_wrong_actions_name_the_agent():
    team = seedbed.parallel_env("cartpole", agents=2)
    with pytest.raises(ResetNeeded):
        seedbed.parallel_env("cartpole").step({})
    team.reset(seed=0)
    with pytest.raises(ValueError, match="agent_1: the action is 5, expected the index of a value of `force`"):
        team.step({"agent_0": 0, "agent_1": 5})
    for actions in ({"agent_0": 0}, {"agent_0": 0, "agent_1": 0, "agent_2": 0}):
        with pytest.raises(ValueError, match=r"expected those of \['agent_0', 'agent_1'\]"):
            team.step(actions)


def test_observations_do_not_change():
    team = seedbed.parallel_env("cartpole", agents=2)
    observations, _ = team.reset(seed=0)
    before = observations["agent_0"].copy()
    team.step({"agent_0": 1, "agent_1": 1})
    assert np.array_equal(observations["agent_0"], before)


def test_a_team_is_drawn_below_each_other():
    team = seedbed.parallel_env("cartpole", agents=2, render_mode="rgb_array")
    team.reset(seed=0)
    picture = team.render()
    assert picture is not None
    assert picture.shape == (800, 600, 3)
