"""Recorders inside the training loops of other libraries: `pytest -m slow`, with stable-baselines3, torchrl and gymnasium[box2d]."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from test_recording_writer import episodes_of, state_file

from seedbed.recording import RecordVisitation, RecordVisitationVector

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]


def maker(folder: Path, agent: int) -> Callable[[], gymnasium.Env]:
    """A local function, which other processes need not import."""
    return lambda: RecordVisitation(gymnasium.make("CartPole-v1"), folder, agent=agent)


def recorded(folder: Path, agent: int) -> gymnasium.Env:
    return maker(folder, agent)()


@pytest.mark.parametrize("start_method", ["fork", "forkserver", "spawn"])
def test_subprocesses_of_stable_baselines(tmp_path, start_method):
    from stable_baselines3.common import vec_env

    environments = vec_env.SubprocVecEnv([maker(tmp_path, agent) for agent in range(3)], start_method)
    environments.reset()
    episodes = np.zeros(3, int)
    for _ in range(200):
        _, _, ended, _ = environments.step(np.ones(3, int))
        episodes += ended
    environments.close()
    assert [len(episodes_of(state_file(tmp_path, agent), 4, 1)) for agent in range(3)] == episodes.tolist()
    assert json.loads((tmp_path / "summary.json").read_text())["agents"] == 3


def test_training_with_stable_baselines_agrees_with_its_monitor(tmp_path):
    import stable_baselines3
    from stable_baselines3.common.monitor import Monitor

    environment = Monitor(recorded(tmp_path / "run", 0), str(tmp_path / "monitor.csv"))
    stable_baselines3.PPO("MlpPolicy", environment, n_steps=256, seed=0, device="cpu").learn(2048)
    environment.close()
    with open(tmp_path / "monitor.csv", newline="") as file:
        file.readline()
        expected = [(float(row["r"]), int(row["l"])) for row in csv.DictReader(file)]
    with open(tmp_path / "run" / "episodes.csv", newline="") as file:
        found = [(float(row["return"]), int(row["length"])) for row in csv.DictReader(file)]
    assert found == expected and len(found) > 20


def test_a_loop_in_the_style_of_cleanrl(tmp_path):
    """Statistics of Gymnasium outside, the recorder inside; both must count the same episodes."""
    environments = gymnasium.vector.SyncVectorEnv([partial(gymnasium.make, "CartPole-v1")] * 4)
    environments = RecordVisitationVector(environments, tmp_path)
    environments = gymnasium.wrappers.vector.RecordEpisodeStatistics(environments)
    environments.reset(seed=1)
    expected = []
    for _ in range(300):
        _, _, _, _, infos = environments.step(environments.action_space.sample())
        for copy in np.flatnonzero(infos.get("_episode", [])):
            expected.append((copy, infos["episode"]["r"][copy], infos["episode"]["l"][copy]))
    environments.close()
    with open(tmp_path / "episodes.csv", newline="") as file:
        found = [(int(row["agent"]), float(row["return"]), int(row["length"])) for row in csv.DictReader(file)]
    assert sorted(found) == sorted(expected) and len(found) > 20


def test_torchrl_collects_from_a_recorded_environment(tmp_path):
    from torchrl import envs

    environment = envs.GymWrapper(recorded(tmp_path, 0))
    rollout = environment.rollout(200, break_when_any_done=False)
    environment.close()
    done = rollout["next", "done"].flatten()
    lengths = np.diff(np.flatnonzero(np.append(1, done.numpy())))
    found = episodes_of(state_file(tmp_path), 4, 1)
    assert [len(episode["rewards"]) for episode in found] == lengths.tolist() and len(found) > 2
    states = np.concatenate([episode["states"][:-1] for episode in found])
    assert np.array_equal(states, rollout["observation"][: len(states)].numpy())


@pytest.mark.parametrize("agents", [2])
def test_the_example_records_each_agent(tmp_path, agents):
    import runpy

    example = runpy.run_path(str(Path(__file__).parents[1] / "examples" / "see_where_agents_went.py"))
    for agent in range(agents):
        example["train"](tmp_path, agent, 2048)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["environment"] == "LunarLander-v3" and summary["agents"] == agents
    assert summary["env_steps"] > 3000
