"""RecordVisitation inside and outside of other wrappers, and with environments that return unusual values."""

from __future__ import annotations

import csv
import gc
import json
import math
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces, wrappers
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from test_recording_writer import Counter, episodes_of, play, run_script, state_file

import seedbed
from seedbed.recording import RecordingError, RecordVisitation, RecordVisitationVector


def lengths(folder: Path, agent: int = 0) -> list[tuple[int, int]]:
    """Length and outcome of each episode: 1 terminated, 2 truncated."""
    return [(len(found["rewards"]), found["outcome"]) for found in episodes_of(state_file(folder, agent), 2, 1)]


RECORD = "record"
ORDERS = [
    [RECORD, partial(wrappers.TimeLimit, max_episode_steps=4)],
    [partial(wrappers.TimeLimit, max_episode_steps=4), RECORD],
    [RECORD, partial(wrappers.TimeLimit, max_episode_steps=4), wrappers.Autoreset],
    [RECORD, wrappers.PassiveEnvChecker, partial(wrappers.TimeLimit, max_episode_steps=4), wrappers.RecordEpisodeStatistics],
    [RECORD, partial(wrappers.TimeLimit, max_episode_steps=4), wrappers.OrderEnforcing],
    [partial(wrappers.TimeLimit, max_episode_steps=9), RECORD, partial(wrappers.TimeLimit, max_episode_steps=4)],
]


@pytest.mark.parametrize("order", ORDERS)
def test_time_limits_in_any_order(tmp_path: Path, order: list[Any]):
    """Each of three episodes is truncated after 4 of 10 steps, wherever the limit is: 4 steps of rewards 1 + 2 + 3 + 4."""
    environment: gymnasium.Env = Counter(10, spaces.Box(-1000, 1000, (2,), np.float64))
    for wrapper in order:
        environment = RecordVisitation(environment, tmp_path) if wrapper is RECORD else wrapper(environment)
    environment.reset(seed=0)
    for _ in range(3):
        ended = False
        while not ended:
            *_, terminated, truncated, _ = environment.step(1)
            ended = terminated or truncated
        environment.reset()
    environment.close()
    assert lengths(tmp_path) == [(4, 2)] * 3
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["episodes_per_agent"], summary["final_return"]) == (3, 10)
    command = [seedbed.command(), "inspect", str(tmp_path), "--json"]
    assert json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_recorders_inside_of_vector_environments_and_time_limits(tmp_path: Path, mode: AutoresetMode):
    def make(agent: int) -> gymnasium.Env:
        return wrappers.TimeLimit(RecordVisitation(Counter(10), tmp_path, agent=agent), 4)

    environments = SyncVectorEnv([partial(make, agent) for agent in range(2)], autoreset_mode=mode)
    environments.reset()
    for _ in range(16):
        *_, truncated, _ = environments.step(np.zeros(2, np.int64))
        if mode == AutoresetMode.DISABLED and truncated.any():
            environments.reset(options={"reset_mask": truncated})
    environments.reset()
    environments.close()
    # In NEXT_STEP, each fifth step only resets.
    steps = [4, 4, 4, 1] if mode == AutoresetMode.NEXT_STEP else [4] * 4
    assert lengths(tmp_path) == lengths(tmp_path, 1) == [(length, 2) for length in steps]


def test_what_is_kept_of_episodes_that_are_cut_off(tmp_path: Path):
    """By `reset`, by `close`; reset right after reset is no episode."""
    expected = {None: [(2, 2), (3, 1)], True: [(2, 2), (3, 1), (1, 2)], False: [(3, 1)]}
    for keep, kept in expected.items():
        folder = tmp_path / str(keep)
        environment = RecordVisitation(Counter(3), folder, keep_unfinished=keep)
        environment.reset()
        environment.reset()
        environment.step(0), environment.step(0)
        play(environment, 1)
        environment.reset()
        environment.step(0)
        if keep is None:
            with pytest.warns(RuntimeWarning, match=r"the unfinished last episode \(1 steps\) is not recorded; keep_unfinished=True"):
                environment.close()
        else:
            environment.close()
        assert lengths(folder) == kept


@pytest.mark.parametrize("keep", [None, True, False])
def test_unfinished_episodes_of_vector_environments(tmp_path: Path, keep: bool | None):
    environments = SyncVectorEnv([partial(Counter, 3), partial(Counter, 9)])
    environments = RecordVisitationVector(environments, tmp_path, keep_unfinished=keep)
    environments.reset()
    for _ in range(6):
        environments.step(np.zeros(2, np.int64))
    environments.reset()
    environments.step(np.zeros(2, np.int64))
    if keep is None:
        with pytest.warns(RuntimeWarning, match=r"the unfinished last episodes of 2 agents \(2 steps\) are not recorded"):
            environments.close()
    else:
        environments.close()
    cut = {None: [[(2, 2)], [(6, 2)]], True: [[(2, 2), (1, 2)], [(6, 2), (1, 2)]], False: [[], []]}[keep]
    assert lengths(tmp_path) == [(3, 1), *cut[0]]
    assert lengths(tmp_path, 1) == cut[1]


def test_garbage_collection_and_exit_say_it_too(tmp_path: Path):
    environment = RecordVisitation(Counter(3), tmp_path / "collected")
    environment.reset()
    environment.step(0)
    with pytest.warns(RuntimeWarning, match="unfinished last episode"):
        del environment
        gc.collect()
    process = run_script(tmp_path, "environment.reset(); environment.step(0); sys.stderr = open('stderr.txt', 'w')")
    assert process.wait() == 0
    assert "unfinished last episode (1 steps)" in (tmp_path.parent / "stderr.txt").read_text()


class Rewarded(Counter):
    """Its rewards are what is given."""

    def __init__(self, reward: Any):
        super().__init__(2)
        self.reward = reward

    def step(self, action):
        observation, _, *rest = super().step(action)
        return (observation, self.reward, *rest)


@pytest.mark.parametrize(
    "reward",
    [0.5, np.float32(0.5), np.float64(0.5), np.array(0.5), np.array([0.5]), np.array([[0.5]]), [0.5], np.float16(0.5)],
)
def test_rewards_of_any_shape(tmp_path: Path, reward: Any):
    with RecordVisitation(Rewarded(reward), tmp_path) as environment:
        environment.reset()
        assert environment.step(0)[1] is reward
        environment.step(0)
    assert episodes_of(state_file(tmp_path), 2, 1)[0]["return"] == 1.0


@pytest.mark.parametrize(
    ("reward", "total"), [(1, 2), (True, 2), (np.True_, 2), (np.int64(3), 6), (np.uint8(200), 400), (np.array([2]), 4)]
)
def test_rewards_of_other_types(tmp_path: Path, reward: Any, total: float):
    """Sums do not overflow: 200 + 200 in 8 bits would be 144."""
    with RecordVisitation(Rewarded(reward), tmp_path) as environment:
        play(environment, 1)
    assert episodes_of(state_file(tmp_path), 2, 1)[0]["return"] == total


@pytest.mark.parametrize("reward", [None, np.zeros(2), [], "a", {}])
def test_rewards_that_are_no_numbers(tmp_path: Path, reward: Any):
    """The episode is left out, and the next one is recorded."""
    environment = RecordVisitation(Rewarded(reward), tmp_path)
    environment.reset()
    with pytest.raises((TypeError, ValueError)) as error:
        environment.step(0)
    assert "expected a number" in str(error.value) or "could not convert" in str(error.value)
    environment.step(0)
    environment.env.reward = 1.0
    play(environment, 1)
    environment.close()
    assert lengths(tmp_path) == [(2, 1)]


@pytest.mark.parametrize("reward", [math.inf, -math.inf, math.nan])
def test_returns_that_are_not_finite(tmp_path: Path, reward: float):
    with RecordVisitation(Rewarded(reward), tmp_path) as environment:
        play(environment, 2)
    assert np.array_equal(episodes_of(state_file(tmp_path), 2, 1)[1]["return"], 2 * reward, equal_nan=True)
    with open(tmp_path / "episodes.csv", newline="") as file:
        assert np.array_equal(float(next(csv.DictReader(file))["return"]), reward, equal_nan=True)
    assert json.loads((tmp_path / "summary.json").read_text())["final_return"] is None


class Observed(Counter):
    """Its observations are what is given."""

    def __init__(self, space: spaces.Space, observation: Any):
        super().__init__(2, space)
        self.observation = observation

    def _observation(self):
        return self.observation


@pytest.mark.parametrize(
    ("space", "observation", "expected"),
    [
        (spaces.Box(0, 255, (2,), np.uint8), np.array([1, 255], np.uint8), [1, 255]),
        (spaces.Box(-5, 5, (2,), np.int64), np.array([-5, 5]), [-5, 5]),
        (spaces.Box(0, 1, (2,), np.bool_), np.array([True, False]), [1, 0]),
        (spaces.Box(-9, 9, (2,), np.float64), np.array([0.1, 1e-300]), [0.1, 0]),
        (spaces.Box(-9, 9, (2,), np.float64), [0.25, 2], [0.25, 2]),
        (spaces.Box(-9, 9, (2,), np.float64), np.array([[1.0, 2.0]]), [1, 2]),
        (spaces.Box(-9, 9, (2, 1), np.float32), np.array([[1.0], [2.0]]), [1, 2]),
    ],
)
def test_observations_of_other_types(tmp_path: Path, space: spaces.Box, observation: Any, expected: list[float]):
    with RecordVisitation(Observed(space, observation), tmp_path) as environment:
        play(environment, 1)
    assert np.array_equal(episodes_of(state_file(tmp_path), 2, 1)[0]["states"], np.float32([expected] * 3))


@pytest.mark.parametrize("value", [1e39, -1e300, 10**40])
def test_numbers_beyond_single_precision(tmp_path: Path, value: float):
    """They are recorded as infinite, with one warning."""
    space = spaces.Box(-np.inf, np.inf, (2,), np.float64)
    environment = RecordVisitation(Observed(space, np.array([1.0, value], np.float64)), tmp_path, names=["a", "b"])
    with pytest.warns(RuntimeWarning, match="b is .*too large for single precision: such numbers are recorded as infinite") as warned:
        play(environment, 2)
    assert len(warned) == 1
    environment.close()
    assert np.array_equal(episodes_of(state_file(tmp_path), 2, 1)[1]["states"][:, 1], [math.copysign(np.inf, value)] * 3)


def test_rewards_beyond_single_precision(tmp_path: Path):
    """Returns are double precision, so that their sum is right."""
    environment = RecordVisitation(Rewarded(1e39), tmp_path)
    with pytest.warns(RuntimeWarning, match="reward is 1e"):
        play(environment, 1)
    environment.close()
    assert episodes_of(state_file(tmp_path), 2, 1)[0]["return"] == 2e39


@pytest.mark.parametrize("observation", [np.zeros(1), 0.0, np.zeros(3), np.zeros((2, 2)), []])
def test_observations_of_a_wrong_shape(tmp_path: Path, observation: Any):
    """NumPy would repeat a single number."""
    space = spaces.Box(-1, 1, (2,), np.float64)
    environment = RecordVisitation(Observed(space, np.zeros(2)), tmp_path)
    environment.reset()
    environment.env.observation = observation
    with pytest.raises(ValueError, match=r"the observation has the shape .*expected \(2,\)"):
        environment.step(0)
    environment.close()
    assert lengths(tmp_path) == []


def test_nans_are_counted(tmp_path: Path):
    """A third of the states of each of two agents, in the second observation."""

    class Missing(Counter):
        def _observation(self):
            return np.array([self.steps, math.nan if self.steps % 3 == 0 else 1.0])

    for agent in range(2):
        environment = RecordVisitation(Missing(5), tmp_path, agent=agent)
        play(environment, 10)
        with pytest.warns(RuntimeWarning, match=f"observations are NaN in some states: observation_1 in {20 * (agent + 1)}"):
            environment.close()
    assert json.loads((tmp_path / "summary.json").read_text())["nan_observations"] == {"observation_1": 40}
    states = np.concatenate([found["states"] for found in episodes_of(state_file(tmp_path), 2, 1)])
    assert np.isnan(states).sum(axis=0).tolist() == [0, 20]


def test_without_nans(tmp_path: Path):
    with RecordVisitation(Counter(3), tmp_path) as environment:
        play(environment, 1)
    assert json.loads((tmp_path / "summary.json").read_text())["nan_observations"] == {}


def test_errors_of_the_environment(tmp_path: Path):
    """What was visited before is recorded, as truncated when the environment is reset."""

    class Fragile(Counter):
        def step(self, action):
            if action == 2:
                raise OSError("broken")
            return super().step(action)

    environment = RecordVisitation(Fragile(5), tmp_path)
    environment.reset()
    environment.step(0), environment.step(0)
    with pytest.raises(OSError, match="broken"):
        environment.step(2)
    play(environment, 1)
    environment.close()
    assert lengths(tmp_path) == [(2, 2), (5, 1)]


class Vector(gymnasium.vector.VectorEnv):
    """Two copies whose episodes have two steps, with results of any form."""

    def __init__(self, mode: AutoresetMode, convert: Any, infos: Any):
        self.num_envs = 2
        self.single_observation_space = spaces.Box(-9, 9, (2,), np.float64)
        self.single_action_space = spaces.Discrete(2)
        self.metadata = {"autoreset_mode": mode}
        self.convert, self.infos = convert, infos

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return np.zeros((2, 2)), {}

    def step(self, actions):
        self.steps += 1
        ended = np.array([self.steps % 2 == 0] * 2)
        return np.ones((2, 2)), self.convert(np.ones(2)), self.convert(ended), self.convert(~ended & False), self.infos


@pytest.mark.parametrize("convert", [np.asarray, lambda values: values.tolist(), lambda values: values[:, None]])
def test_results_of_vector_environments_of_any_form(tmp_path: Path, convert: Any):
    environments = RecordVisitationVector(
        Vector(AutoresetMode.SAME_STEP, convert, {"final_obs": np.full((2, 2), 3.0)}), tmp_path
    )
    environments.reset()
    for _ in range(4):
        environments.step(np.zeros(2, np.int64))
    environments.close()
    for agent in range(2):
        found = episodes_of(state_file(tmp_path, agent), 2, 1)
        assert [episode["states"][:, 0].tolist() for episode in found] == [[0, 1, 3], [1, 1, 3]]
        assert [episode["return"] for episode in found] == [2, 2]


@pytest.mark.parametrize("infos", [{}, None, {"final_obs": np.full(2, None)}])
def test_missing_last_observations(tmp_path: Path, infos: Any):
    """Nothing is invented: these episodes are left out, and the error says what is missing."""
    environments = RecordVisitationVector(Vector(AutoresetMode.SAME_STEP, np.asarray, infos), tmp_path, keep_unfinished=False)
    environments.reset()
    environments.step(np.zeros(2, np.int64))
    with pytest.raises(RecordingError, match="infos has no final_obs"):
        environments.step(np.zeros(2, np.int64))
    environments.env.infos = {"final_obs": np.full((2, 2), 3.0)}
    for _ in range(2):
        environments.step(np.zeros(2, np.int64))
    environments.close()
    assert [episode["states"][:, 0].tolist() for episode in episodes_of(state_file(tmp_path), 2, 1)] == [[1, 1, 3]]


def test_processes_of_an_asynchronous_vector_environment(tmp_path: Path):
    context = None if sys.platform == "win32" else "fork"
    makers = [partial(_limited, tmp_path, agent) for agent in range(2)]
    environments = AsyncVectorEnv(makers, context=context)
    environments.reset(seed=0)
    for _ in range(10):
        environments.step(np.zeros(2, np.int64))
    environments.close()
    assert lengths(tmp_path) == lengths(tmp_path, 1) == [(4, 2)] * 2


def _limited(folder: Path, agent: int) -> gymnasium.Env:
    return wrappers.TimeLimit(RecordVisitation(Counter(10), folder, agent=agent), 4)
