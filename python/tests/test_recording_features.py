"""Recorders record features of what the agent observes: of pictures, dictionaries and `info`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from test_recording_writer import episodes_of, state_file

import seedbed

LENGTH = 4


class Walk(gymnasium.Env):
    """A walk along a line: the agent sees a picture and a goal, `info` has the place."""

    observation_space = spaces.Dict({"picture": spaces.Box(0, 255, (8, 8, 3), np.uint8), "goal": spaces.Box(-1, 1, (1,))})
    action_space = spaces.Discrete(2)

    def observe(self) -> tuple[dict[str, Any], dict[str, Any]]:
        picture = np.zeros((8, 8, 3), np.uint8)
        picture[self.place] = 255
        return {"picture": picture, "goal": np.float32([0.5])}, {"place": self.place, "steps": float(self.steps)}

    def reset(self, *, seed=None, options=None):
        self.place, self.steps = 3, 0
        observation, info = self.observe()
        return observation, {"place": info["place"]}

    def step(self, action):
        self.place, self.steps = self.place + 2 * int(action) - 1, self.steps + 1
        observation, info = self.observe()
        return observation, 1.0, self.place in (0, 7), False, info


def row_of_light(observation: Any, info: dict[str, Any]) -> list[float]:
    return [float(observation["picture"][:, 0, 0].argmax()), float(observation["goal"][0]), info.get("steps", -1.0)]


ACTIONS = [1, 1, 1, 1]
"""From 3 to 7, where the episode ends."""

EXPECTED = np.array([[3, 0.5, -1], [4, 0.5, 1], [5, 0.5, 2], [6, 0.5, 3], [7, 0.5, 4]])


def test_a_function_of_the_observation_and_info(tmp_path: Path):
    environment = seedbed.RecordVisitation(Walk(), tmp_path, features=row_of_light, names=["place", "goal", "steps"], ranges={"place": (0, 7)})
    for _ in range(2):
        observation, _ = environment.reset()
        assert set(observation) == {"picture", "goal"}
        for action in ACTIONS:
            environment.step(action)
    environment.close()
    episodes = episodes_of(state_file(tmp_path, 0), 3, 1)
    assert len(episodes) == 2
    for episode in episodes:
        assert np.array_equal(episode["states"], EXPECTED)


@pytest.mark.filterwarnings("default")
def test_entries_of_info_are_nan_where_they_are_missing(tmp_path: Path):
    environment = seedbed.RecordVisitation(Walk(), tmp_path, features=["place", "steps"])
    environment.reset()
    for action in ACTIONS:
        environment.step(action)
    with pytest.warns(RuntimeWarning, match="steps in 1"):
        environment.close()
    (episode,) = episodes_of(state_file(tmp_path, 0), 2, 1)
    assert episode["states"][:, 0].tolist() == [3, 4, 5, 6, 7]
    assert math.isnan(episode["states"][0, 1]) and episode["states"][1:, 1].tolist() == [1, 2, 3, 4]
    assert json.loads((tmp_path / "summary.json").read_text())["nan_observations"] == {"steps": 1}


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_environments_give_each_copy_to_the_function(tmp_path: Path, mode: AutoresetMode):
    environments = SyncVectorEnv([Walk, Walk], autoreset_mode=mode)
    recorded = seedbed.RecordVisitationVector(environments, tmp_path, features=row_of_light, names=["place", "goal", "steps"])
    recorded.reset()
    for number, action in enumerate([*ACTIONS, 0, *ACTIONS]):
        # The second copy goes to the left: 3 steps.
        _, _, terminated, _, _ = recorded.step(np.array([action, 0 if number < 3 else 1]))
        if mode == AutoresetMode.DISABLED and terminated.any():
            recorded.reset(options={"reset_mask": terminated})
    recorded.close()
    first = episodes_of(state_file(tmp_path, 0), 3, 1)
    assert np.array_equal(first[0]["states"], EXPECTED)
    second = episodes_of(state_file(tmp_path, 1), 3, 1)
    assert second[0]["states"][:, 0].tolist() == [3, 2, 1, 0]
    assert second[0]["states"][:, 2].tolist() == [-1, 1, 2, 3]
    assert np.array_equal(second[1]["states"], EXPECTED)


@pytest.mark.parametrize(
    ("features", "names", "kind", "words"),
    [
        (row_of_light, None, ValueError, "name them, such as names="),
        ("place", None, TypeError, "expected a function of"),
        ([1], None, TypeError, "expected a function of"),
        (["place"], ["a", "b"], ValueError, "expected 1 names: one per feature"),
        ([], None, ValueError, "there are 0 features"),
    ],
)
def test_wrong_features_are_refused(tmp_path: Path, features: Any, names: Any, kind: type[Exception], words: str):
    with pytest.raises(kind, match=words):
        seedbed.RecordVisitation(Walk(), tmp_path, features=features, names=names)


def test_a_function_that_fails_leaves_out_its_episode(tmp_path: Path):
    def fragile(observation: Any, info: dict[str, Any]) -> list[float]:
        if info.get("steps") == 2 and not failed:
            failed.append(True)
            raise KeyError("velocity")
        return [info["place"]]

    failed: list[bool] = []
    environment = seedbed.RecordVisitation(Walk(), tmp_path, features=fragile, names=["place"])
    environment.reset()
    environment.step(1)
    with pytest.raises(KeyError, match="velocity"):
        environment.step(1)
    environment.step(1)
    for _ in range(2):
        environment.reset()
        for action in ACTIONS:
            environment.step(action)
    environment.close()
    episodes = episodes_of(state_file(tmp_path, 0), 1, 1)
    assert [episode["states"][:, 0].tolist() for episode in episodes] == [[3, 4, 5, 6, 7]] * 2


def test_a_function_with_other_numbers_than_names(tmp_path: Path):
    environment = seedbed.RecordVisitation(Walk(), tmp_path, features=lambda observation, info: [1.0, 2.0], names=["place"])
    with pytest.raises(ValueError, match=r"the result of features has the shape \(2,\), expected \(1,\) numbers"):
        environment.reset()


def test_entries_that_no_state_has_are_warned_of(tmp_path: Path):
    env = seedbed.RecordVisitation(Walk(), tmp_path, features=["steps", "placee"])
    with pytest.warns(RuntimeWarning, match="info had no placee in the first 50 states, only place, steps: they are recorded as NaN"):
        for _ in range(15):
            env.reset()
            for action in ACTIONS:
                env.step(action)
    with pytest.warns(RuntimeWarning, match="observations are NaN in some states: steps in 15, placee in 75"):
        env.close()


def test_recorders_name_the_right_recorder_of_other_environments(tmp_path: Path):
    walk, walks = Walk(), SyncVectorEnv([Walk])
    with pytest.raises(TypeError, match="RecordVisitation cannot record a SyncVectorEnv: record it with RecordVisitationVector"):
        seedbed.RecordVisitation(walks, tmp_path)
    with pytest.raises(TypeError, match="RecordVisitationVector cannot record a Walk: record it with RecordVisitation"):
        seedbed.RecordVisitationVector(walk, tmp_path)


def test_normalized_rewards_are_warned_of(tmp_path: Path):
    normalized = gymnasium.wrappers.NormalizeReward(gymnasium.make("CartPole-v1"))
    with pytest.warns(RuntimeWarning, match="rewards are recorded as NormalizeReward changes them: put the recorder inside"):
        seedbed.RecordVisitation(normalized, tmp_path)
