"""RecordVisitationVector in all autoreset modes, against recorders of single environments."""

from __future__ import annotations

import csv
import json
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from test_recording_writer import Counter, episodes_of, play, state_file

import seedbed
from seedbed.recording import RecordVisitation, RecordVisitationVector

MODES = list(AutoresetMode)


class Walk(gymnasium.Env):
    """A random walk whose episodes end after a random number of steps, by termination or truncation."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,))
    action_space = gymnasium.spaces.Box(-1, 1, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = self.np_random.normal(size=2).astype(np.float32)
        return self.state.copy(), {}

    def step(self, action):
        self.state = self.state + np.float32(action[0]) + self.np_random.normal(size=2).astype(np.float32)
        end = self.np_random.integers(12)
        return self.state.copy(), float(self.state[0]), end == 0, end == 1, {}


def expected_episodes(seed: int, actions: list[np.ndarray], mode: AutoresetMode) -> list[dict]:
    """What a copy of Walk does if action t is actions[t], with what each mode does at the end of an episode."""
    environment = Walk()
    found, states, taken, rewards = [], [environment.reset(seed=seed)[0]], [], []
    must_reset = False
    for action in actions:
        if must_reset:
            states, taken, rewards = [environment.reset()[0]], [], []
            must_reset = False
            if mode == AutoresetMode.NEXT_STEP:
                continue
        state, reward, terminated, truncated, _ = environment.step(action)
        states.append(state), taken.append(action), rewards.append(reward)
        if terminated or truncated:
            outcome = 1 if terminated else 2
            found.append({"outcome": outcome, "states": np.array(states), "actions": np.array(taken), "rewards": np.float32(rewards)})
            must_reset = True
    return found


def step_all(environments: gymnasium.vector.VectorEnv, actions: np.ndarray, mode: AutoresetMode) -> None:
    environments.reset(seed=5)
    ended = np.zeros(environments.num_envs, bool)
    for row in actions:
        if mode == AutoresetMode.DISABLED and ended.any():
            environments.reset(options={"reset_mask": ended})
        _, _, terminated, truncated, _ = environments.step(row)
        ended = terminated | truncated


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("make", [SyncVectorEnv, partial(AsyncVectorEnv, context="fork")])
def test_episodes_are_those_of_the_copies(tmp_path, mode, make, monkeypatch):
    # Few rows, so that most episodes are written in several parts.
    monkeypatch.setattr("seedbed.agent_files.MAX_BUFFERED_NUMBERS", 0)
    copies = 3
    environments = RecordVisitationVector(make([Walk] * copies, autoreset_mode=mode), tmp_path, agents=[4, 0, 2], keep_unfinished=False)
    actions = np.random.default_rng(1).uniform(-1, 1, (200, copies, 1)).astype(np.float32)
    step_all(environments, actions, mode)
    environments.close()
    for copy, agent in enumerate([4, 0, 2]):
        expected = expected_episodes(5 + copy, list(actions[:, copy]), mode)
        found = episodes_of(state_file(tmp_path, agent), 2, 1)
        assert len(found) == len(expected) > 10
        for one, other in zip(found, expected, strict=True):
            assert one["outcome"] == other["outcome"]
            for name in ("states", "actions", "rewards"):
                assert np.array_equal(one[name], other[name]), (name, mode)
            assert one["return"] == pytest.approx(float(other["rewards"].astype(np.float64).sum()), rel=1e-6)


@pytest.mark.parametrize("mode", MODES)
def test_results_are_passed_on_unchanged(tmp_path, mode):
    actions = np.random.default_rng(1).uniform(-1, 1, (50, 2, 1)).astype(np.float32)
    bare = SyncVectorEnv([Walk] * 2, autoreset_mode=mode)
    recorded = RecordVisitationVector(SyncVectorEnv([Walk] * 2, autoreset_mode=mode), tmp_path, keep_unfinished=False)
    bare.reset(seed=3), recorded.reset(seed=3)
    for row in actions:
        one, other = bare.step(row), recorded.step(row)
        assert all(np.array_equal(*pair) for pair in zip(one[:4], other[:4], strict=True)) and one[4].keys() == other[4].keys()
        ended = one[2] | one[3]
        if mode == AutoresetMode.DISABLED and ended.any():
            for environments in (bare, recorded):
                environments.reset(options={"reset_mask": ended.copy()})
    recorded.close()


def test_a_native_vector_environment(tmp_path):
    environments = gymnasium.make_vec("CartPole-v1", num_envs=5, vectorization_mode="vector_entry_point")
    environments = RecordVisitationVector(environments, tmp_path, keep_unfinished=False)
    environments.reset(seed=0)
    rewards = 0.0
    for _ in range(300):
        _, reward, terminated, truncated, _ = environments.step(np.ones(5, np.int64))
        rewards += reward.sum()
    environments.close()
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["environment"] == "CartPole-v1" and summary["agents"] == 5
    finished = [episode for agent in range(5) for episode in episodes_of(state_file(tmp_path, agent), 4, 1)]
    assert len(finished) > 100 and all(episode["return"] == len(episode["rewards"]) for episode in finished)
    # The first states of episodes are near 0, the last ones are not: no reset is recorded as a transition.
    assert all(np.abs(episode["states"][0]).max() <= 0.05 for episode in finished)
    assert all(np.abs(np.diff(episode["states"][:, 0])).max() < 0.1 for episode in finished)


def test_kept_unfinished_episodes(tmp_path):
    environments = SyncVectorEnv([partial(Counter, 3), partial(Counter, 5)], autoreset_mode=AutoresetMode.DISABLED)
    environments = RecordVisitationVector(environments, tmp_path, keep_unfinished=True)
    environments.reset()
    for _ in range(3):
        environments.step(np.zeros(2, np.int64))
    environments.reset(options={"reset_mask": np.array([True, False])})
    environments.step(np.zeros(2, np.int64))
    environments.close()
    lengths = [[(len(found["rewards"]), found["outcome"]) for found in episodes_of(state_file(tmp_path, agent), 2, 1)] for agent in (0, 1)]
    assert lengths == [[(3, 1), (1, 2)], [(4, 2)]]


def test_invalid_vector_environments_are_refused(tmp_path):
    environments = SyncVectorEnv([Counter] * 2)
    with pytest.raises(ValueError, match="expected 2 different numbers"):
        RecordVisitationVector(environments, tmp_path, agents=[1, 1])
    environments.metadata = {}
    with pytest.raises(ValueError, match="no autoreset_mode"):
        RecordVisitationVector(environments, tmp_path)
    RecordVisitationVector(environments, tmp_path, autoreset_mode="NextStep")
    discrete = SyncVectorEnv([partial(Counter, 3, gymnasium.spaces.Discrete(3))])
    with pytest.raises(TypeError, match="FlattenObservation"):
        RecordVisitationVector(discrete, tmp_path)


def test_single_recorders_inside_processes_of_a_vector_environment(tmp_path):
    """AsyncVectorEnv makes the first environment twice, of which one is only asked for its spaces."""
    makers = [partial(_recorded, tmp_path, agent) for agent in range(3)]
    environments = AsyncVectorEnv(makers)
    environments.reset(seed=0)
    for _ in range(20):
        environments.step(np.zeros(3, np.int64))
    environments.close()
    assert [len(episodes_of(state_file(tmp_path, agent), 2, 1)) for agent in range(3)] == [5] * 3
    assert json.loads((tmp_path / "summary.json").read_text())["agents"] == 3


def _recorded(folder, agent):
    return RecordVisitation(Counter(3), folder, agent=agent)


def test_many_agents_need_no_more_open_files(tmp_path):
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, limits[1]))
    try:
        environments = RecordVisitationVector(SyncVectorEnv([partial(Counter, 3)] * 200), tmp_path)
        environments.reset()
        for _ in range(8):
            environments.step(np.zeros(200, np.int64))
        environments.close()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert json.loads((tmp_path / "summary.json").read_text())["env_steps"] == 200 * 2 * 3


def test_play_helper_is_recorded_like_a_vector_of_one(tmp_path):
    with RecordVisitation(Counter(4), tmp_path / "single") as environment:
        play(environment, 3)
    environments = RecordVisitationVector(SyncVectorEnv([partial(Counter, 4)], autoreset_mode="SameStep"), tmp_path / "vector")
    environments.reset()
    for _ in range(12):
        environments.step(np.ones(1, np.int64))
    environments.close()
    assert state_file(tmp_path / "single").read_bytes() == state_file(tmp_path / "vector").read_bytes()


def test_one_learner_acts_in_all_copies_unless_each_has_its_own(tmp_path):
    """Copies end episodes after 3, 6, 9 and 2, 4, 6, 8 steps: those of one learner are in the order of these numbers."""

    def record(folder, **options):
        environments = SyncVectorEnv([partial(Counter, 3), partial(Counter, 2)], autoreset_mode=AutoresetMode.SAME_STEP)
        environments = RecordVisitationVector(environments, folder, **options)
        environments.reset()
        for _ in range(9):
            environments.step(np.zeros(2, np.int64))
        environments.close()
        summary = json.loads((folder / "summary.json").read_text())
        return [summary[name] for name in ("agents", "learners", "episodes_per_agent", "final_return")]

    # An episode of n steps has the return 1 + … + n: 3 · 6 and 4 · 3.
    assert record(tmp_path / "one") == [2, [0, 0], 7, 30 / 7]
    assert record(tmp_path / "two", learners=[0, 1]) == [2, [0, 1], 3, 4.5]
    note = "(2 copies of the environment, 1 learner)"
    assert [note in seedbed.load(tmp_path / name).explore().read_text() for name in ("one", "two")] == [True, False]
    assert record(tmp_path / "other", agents=[3, 1]) == [4, [0, 3, 2, 3], 0, None]
    with pytest.raises(ValueError, match=r"learners is \[0\], expected 2 numbers: one per copy"):
        record(tmp_path / "three", learners=[0])
    with pytest.raises(TypeError, match=r"learners is 2, expected the number of the learner of each copy, such as range\(2\)"):
        record(tmp_path / "three", learners=2)
    with pytest.raises(seedbed.RunError, match="another program made this run: its policies are not in the recording"):
        seedbed.load(tmp_path / "one").policy(0)


class Unequal(Counter):
    """Episodes of one step with return 1, or of `length` steps with return 10."""

    def step(self, action):
        observation, _, terminated, truncated, info = super().step(action)
        return observation, 1.0 if self.length == 1 else 10.0 * terminated, terminated, truncated, info


@pytest.mark.parametrize("mode", MODES)
def test_episodes_of_copies_are_in_the_order_in_which_they_ended(tmp_path, mode):
    """With NEXT_STEP the copy of short episodes does half of the steps: the order is that of the steps of the loop."""
    environments = SyncVectorEnv([partial(Unequal, length) for length in (1, 60)], autoreset_mode=mode)
    environments = RecordVisitationVector(environments, tmp_path, keep_unfinished=False)
    environments.reset(seed=0)
    ended = []
    for number in range(115):
        terminated = environments.step(np.zeros(2, np.int64))[2]
        ended += [(number + 1, copy) for copy in np.flatnonzero(terminated)]
        if mode == AutoresetMode.DISABLED and terminated.any():
            environments.reset(options={"reset_mask": terminated.copy()})
    environments.close()
    expected = np.mean([[1.0, 10.0][copy] for _, copy in ended[-25:]])
    assert json.loads((tmp_path / "summary.json").read_text())["final_return"] == expected
    assert seedbed.load(tmp_path).info["final_return"] == expected
    with (tmp_path / "episodes.csv").open() as file:
        assert sorted((int(row["end_step"]), int(row["agent"])) for row in csv.DictReader(file)) == ended


def test_episodes_that_are_left_out_count_in_the_order(tmp_path):
    """Copy 0 is reset every two steps, copy 1 has episodes of five steps: nothing is recorded of copy 0 up to step 20."""
    environments = SyncVectorEnv([partial(Unequal, length) for length in (3, 5)], autoreset_mode=AutoresetMode.DISABLED)
    environments = RecordVisitationVector(environments, tmp_path, keep_unfinished=False)
    environments.reset(seed=0)
    for number in range(1, 24):
        terminated = environments.step(np.zeros(2, np.int64))[2]
        mask = terminated | np.array([number < 20 and number % 2 == 0, False])
        if mask.any():
            environments.reset(options={"reset_mask": mask})
    environments.close()
    with (tmp_path / "episodes.csv").open() as file:
        ends = [(int(row["agent"]), int(row["end_step"])) for row in csv.DictReader(file)]
    assert sorted(ends) == [(0, 21), (1, 5), (1, 10), (1, 15), (1, 20)]


def test_a_recording_of_copies_is_loaded(tmp_path):
    environments = gymnasium.make_vec("CartPole-v1", num_envs=8)
    environments = RecordVisitationVector(environments, tmp_path / "run", keep_unfinished=False)
    environments.reset(seed=0)
    episodes = 0
    for _ in range(100):
        *_, terminated, truncated, _ = environments.step(np.ones(8, np.int64))
        episodes += int((terminated | truncated).sum())
    environments.close()
    run = seedbed.load(tmp_path / "run", frames="arrow")
    assert run.episodes.num_rows == run.summary["episodes_per_agent"] == episodes
    assert run.states.num_rows == run.summary["env_steps"] + episodes


def test_a_resumed_recorder_counts_on(tmp_path):
    for resume in (False, True):
        environments = SyncVectorEnv([partial(Counter, length) for length in (2, 7)], autoreset_mode=AutoresetMode.SAME_STEP)
        environments = RecordVisitationVector(environments, tmp_path, keep_unfinished=False, resume=resume)
        environments.reset()
        for _ in range(9):
            environments.step(np.zeros(2, np.int64))
        environments.close()
    with (tmp_path / "episodes.csv").open() as file:
        ends = [(int(row["agent"]), int(row["end_step"])) for row in csv.DictReader(file)]
    first = [2, 4, 6, 8]
    assert sorted(ends) == [(0, end) for end in first + [8 + end for end in first]] + [(1, 7), (1, 15)]


def test_agents_count_with_their_own_last_episodes(tmp_path):
    """Agents with a budget of steps: the best one has the longest episodes and the fewest."""
    for agent, (length, episodes) in enumerate([(10, 30), (2, 60)]):
        with RecordVisitation(Counter(length), tmp_path, agent=agent) as environment:
            for _ in range(episodes):
                environment.reset()
                for _ in range(length):
                    environment.step(0)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["learners"], summary["episodes_per_agent"]) == ([0, 1], 30)
    assert summary["final_return"] == (55 + 3) / 2


def test_a_folder_without_learners_is_resumed(tmp_path):
    """As versions before wrote it: each copy is an agent."""
    for learners in ([0, 1], None):
        environments = SyncVectorEnv([partial(Counter, 2)] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
        environments = RecordVisitationVector(environments, tmp_path, learners=learners, resume=learners is None)
        environments.reset()
        for _ in range(4):
            environments.step(np.zeros(2, np.int64))
        environments.close()
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["learners"], summary["episodes_per_agent"]) == ([0, 1], 4)
