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

import seedbed
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


def rows_of(folder: Path, *columns: str) -> list[tuple[str, ...]]:
    with open(folder / "episodes.csv", newline="") as file:
        return [tuple(row[column] for column in columns) for row in csv.DictReader(file)]


def test_a_vec_env_of_stable_baselines_agrees_with_its_monitor(tmp_path):
    """Inside of a `VecNormalize`, which changes observations and rewards."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    environments = make_vec_env("CartPole-v1", 3, env_kwargs={"max_episode_steps": 60})
    environments = VecMonitor(environments, str(tmp_path / "monitor.csv"))
    recorded = seedbed.RecordVecEnv(environments, tmp_path / "run", names=["x", "v", "angle", "turning"])
    PPO("MlpPolicy", VecNormalize(recorded), n_steps=128, seed=0, device="cpu").learn(3000)
    recorded.close()
    with open(tmp_path / "monitor.csv", newline="") as file:
        file.readline()
        expected = sorted((float(row["r"]), int(row["l"])) for row in csv.DictReader(file))
    found = rows_of(tmp_path / "run", "return", "length", "outcome")
    assert sorted((float(total), int(length)) for total, length, _ in found) == expected and len(found) > 30
    assert {(length == "60", outcome) for _, length, outcome in found} == {(True, "truncated"), (False, "terminated")}
    states = episodes_of(state_file(tmp_path / "run", 1), 4, 1)[0]["states"]
    assert np.abs(states[0]).max() <= 0.05 and (np.abs(states[-1]) > [2.4, 9, 0.2, 9]).any()
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    assert (summary["agents"], summary["learners"], summary["environment"]) == (3, [0, 0, 0], "CartPole-v1")


class Reach(gymnasium.Env):
    """A point on a line with a goal, as hindsight experience replay needs it."""

    parts = dict.fromkeys(("observation", "achieved_goal", "desired_goal"), gymnasium.spaces.Box(-1, 1, (1,), np.float32))
    observation_space = gymnasium.spaces.Dict(parts)
    action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)

    def observe(self):
        place = np.array([self.place], np.float32)
        return {"observation": place, "achieved_goal": place, "desired_goal": np.array([0.5], np.float32)}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.steps = 0.0, 0
        return self.observe(), {"distance": 0.5}

    def step(self, action):
        self.place, self.steps = float(np.clip(self.place + 0.1 * action[0], -1, 1)), self.steps + 1
        observation, distance = self.observe(), abs(self.place - 0.5)
        return observation, -distance, False, self.steps == 10, {"distance": distance}

    def compute_reward(self, achieved, desired, info):
        return -np.abs(achieved - desired).reshape(-1)


def test_hindsight_experience_replay_with_features(tmp_path):
    """What a copy's `info` says after its last step belongs to the last state, and that of the reset to the next one."""
    from stable_baselines3 import SAC, HerReplayBuffer
    from stable_baselines3.common.vec_env import DummyVecEnv

    recorded = seedbed.RecordVecEnv(
        DummyVecEnv([Reach, Reach]),
        tmp_path,
        features=lambda observation, info: [observation["achieved_goal"][0], info["distance"]],
        names=["place", "distance"],
        learners=[0, 1],
        keep_unfinished=False,
    )
    SAC("MultiInputPolicy", recorded, replay_buffer_class=HerReplayBuffer, learning_starts=50, seed=0, device="cpu").learn(100)
    recorded.close()
    for agent in range(2):
        episodes = episodes_of(state_file(tmp_path, agent), 2, 1)
        assert len(episodes) == 5
        for episode in episodes:
            assert episode["states"].shape == (11, 2) and episode["states"][0].tolist() == [0, 0.5]
            assert np.allclose(np.abs(episode["states"][:, 0] - 0.5), episode["states"][:, 1], atol=1e-6)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["learners"], summary["environment"]) == ([0, 1], "Reach")


def test_a_recorder_of_a_vec_env_is_not_copied(tmp_path):
    import pickle

    from stable_baselines3.common.vec_env import DummyVecEnv

    recorded = seedbed.RecordVecEnv(DummyVecEnv([Reach]), tmp_path, features=["distance"])
    with pytest.raises(TypeError, match="a RecordVecEnv cannot be copied"):
        pickle.dumps(recorded)
