"""Options of `reset` in vector environments and teams, against single environments and Gymnasium's `SyncVectorEnv`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from test_vector import assert_equal

import seedbed

MODES = list(AutoresetMode)
START = {"positions": {"hinge": 0.05}, "velocities": {"slider": 0.5}}


def both(name: Any, mode: AutoresetMode, copies: int = 3, **arguments: Any) -> tuple[seedbed.VectorEnv, SyncVectorEnv]:
    ours = seedbed.make(name, copies, autoreset_mode=mode, **arguments)
    return ours, SyncVectorEnv([lambda: seedbed.make(name, **arguments)] * copies, autoreset_mode=mode)


def coordinates(name: str) -> list[str]:
    environment = seedbed.make(name)
    environment.reset(seed=0)
    return list(environment.coordinates()["positions"])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["cartpole", "hopper", "lander", "acrobot", "dm_reacher_easy", "corridors_drawn"])
def test_all_copies_start_in_the_given_state(name: str, mode: AutoresetMode):
    """Gymnasium gives the options to each environment; automatic resets draw their start states."""
    first = coordinates(name)[0]
    options = {"positions": {first: 0.03}, "velocities": {first: -0.2}}
    ours, theirs = both(name, mode, max_episode_steps=6)
    assert_equal(ours.reset(seed=4, options=dict(options)), theirs.reset(seed=4, options=dict(options)))
    ours.action_space.seed(0)
    for step in range(20):
        actions = ours.action_space.sample()
        found = ours.step(actions)
        assert_equal(found, theirs.step(actions), f"step {step}")
        if mode == AutoresetMode.DISABLED and (found[2] | found[3]).any():
            mask = {"reset_mask": found[2] | found[3]}
            assert_equal(ours.reset(options=dict(options, **mask)), theirs.reset(options=dict(options, **mask)))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("options", [None, {}, START, {"positions": {}}, {"numbers": {}}, {"velocities": {"slider": np.float32(1)}}])
@pytest.mark.parametrize("seed", [None, 3, [7, None, 7]])
def test_seeds_masks_and_options_together(mode: AutoresetMode, options: Any, seed: Any):
    ours, theirs = both("cartpole", mode)
    for environments in (ours, theirs):
        environments.reset(seed=100)
        environments.step(np.array([0, 1, 0]))
    for mask in (np.array([True, False, True]), None):
        given = None if options is None and mask is None else dict(options or {}) | ({} if mask is None else {"reset_mask": mask})
        found = ours.reset(seed=seed, options=given)
        expected = theirs.reset(seed=seed, options=None if given is None else dict(given))
        assert_equal(found, expected)
        actions = np.array([1, 1, 0])
        assert_equal(ours.step(actions), theirs.step(actions))


def test_numbers_of_the_episode():
    """The target of the reacher is one of the numbers that are drawn per episode."""
    single = seedbed.make("dm_reacher_easy")
    single.reset(seed=0)
    numbers = {name: 0.5 * number for name, number in single.coordinates()["numbers"].items()}
    assert numbers
    ours, theirs = both("dm_reacher_easy", AutoresetMode.NEXT_STEP)
    assert_equal(ours.reset(seed=1, options={"numbers": numbers}), theirs.reset(seed=1, options={"numbers": numbers}))


def test_teams_start_in_the_given_state():
    """Agent 0 is a single environment with the same seed, and a start state is not drawn."""
    team = seedbed.parallel_env("cartpole", agents=3)
    expected, _ = seedbed.make("cartpole").reset(seed=5, options=START)
    observations, _ = team.reset(seed=5, options=START)
    assert all(np.array_equal(row, expected) for row in observations.values())
    assert not np.array_equal(team.reset(seed=5)[0]["agent_0"], expected)


def environments() -> list[Any]:
    return [seedbed.make("cartpole"), seedbed.make("cartpole", 2), seedbed.parallel_env("cartpole", agents=2)]


def states(environment: Any) -> list[bytes]:
    found = environment.get_state()
    return [found] if isinstance(found, bytes) else found


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"position": {"hinge": 0.1}}, ValueError, "unknown option 'position', expected one of positions, velocities, numbers"),
        ({"seed": 3}, ValueError, "unknown option 'seed'"),
        ({"positions": {"hinge": 0.1}, "low": 0}, ValueError, "unknown option 'low'"),
        ({"positions": {"hip": 0.1}}, ValueError, "no coordinate is named \"hip\": expected one of slider, hinge"),
        ({"numbers": {"goal": 1}}, ValueError, "the task has none"),
        ({"positions": {"hinge": float("nan")}}, ValueError, "expected a finite number"),
        ({"positions": {"hinge": 1e39}}, ValueError, "1e39|1000000+, expected a finite number in single precision"),
        ({"positions": {"hinge": "0.1"}}, TypeError, r"options\['positions'\]\['hinge'\] is '0.1', expected a number"),
        ({"positions": {"hinge": np.zeros(2)}}, TypeError, "expected a number"),
        ({"positions": {"hinge": True}}, TypeError, "expected a number"),
        ({"positions": {1: 0.1}}, TypeError, "names 1, expected a text"),
        ({"positions": [0.1]}, TypeError, "expected a dictionary"),
        ({"positions": None}, TypeError, "expected a dictionary"),
        ("positions", TypeError, "expected a dictionary or None"),
    ],
)
def test_wrong_options_change_nothing(options: Any, error: type[Exception], words: str):
    for environment in environments():
        environment.reset(seed=1)
        before = states(environment)
        with pytest.raises(error, match=words):
            environment.reset(seed=9, options=options)
        assert states(environment) == before


def test_only_vector_environments_have_masks():
    single, vector, team = environments()
    mask = {"reset_mask": np.array([True, False])}
    with pytest.raises(ValueError, match="positions, velocities, numbers, reset_mask"):
        vector.reset(options={"mask": mask})
    for environment in (single, team):
        with pytest.raises(ValueError, match="unknown option 'reset_mask'"):
            environment.reset(options=mask)


@pytest.mark.parametrize(
    ("seed", "error", "words"),
    [
        ([1], ValueError, "there are 1 seeds, expected 2"),
        ([1, 2, 3], ValueError, "there are 3 seeds, expected 2"),
        ([], ValueError, "there are 0 seeds, expected 2"),
        ([1, -1], ValueError, "seed is -1, expected 0 to 2"),
        ([1, 1.5], TypeError, "seed is 1.5, expected an integer"),
        ([1, "2"], TypeError, "seed is '2', expected an integer"),
        (1.5, TypeError, "seed is 1.5, expected an integer from 0 to 2\\*\\*64 - 1, or one per copy"),
        ("12", TypeError, "seed is '12'"),
        (b"12", TypeError, "seed is b'12'"),
        (np.array(1.0), TypeError, "expected an integer"),
        ({1, 2}, TypeError, "expected an integer"),
        (2**64, ValueError, "expected 0 to 2"),
        (2**64 - 1, ValueError, "expected 0 to 2"),
    ],
)
def test_wrong_seeds_change_nothing(seed: Any, error: type[Exception], words: str):
    vector = seedbed.make("cartpole", 2)
    vector.reset(seed=1)
    before = vector.get_state()
    with pytest.raises(error, match=words):
        vector.reset(seed=seed)
    assert vector.get_state() == before
    assert vector.np_random_seed == (1, 2)


@pytest.mark.parametrize("seed", [[1, 2], "1", 1.0])
def test_single_environments_and_teams_have_one_seed(seed: Any):
    for environment in (seedbed.make("cartpole"), seedbed.parallel_env("cartpole")):
        with pytest.raises(TypeError, match=r"expected an integer from 0 to 2\*\*64 - 1"):
            environment.reset(seed=seed)


@pytest.mark.parametrize("seed", [(1, 2), np.array([1, 2]), [np.int64(1), np.uint8(2)], np.int32(1)])
def test_sequences_of_seeds(seed: Any):
    assert_equal(seedbed.make("cartpole", 2).reset(seed=seed), seedbed.make("cartpole", 2).reset(seed=[1, 2]))


def test_recorders_pass_options_on(tmp_path: Path):
    single = seedbed.RecordVisitation(seedbed.make("cartpole"), tmp_path / "single", keep_unfinished=False)
    vector = seedbed.RecordVisitationVector(seedbed.make("cartpole", 2), tmp_path / "vector", keep_unfinished=False)
    expected, _ = seedbed.make("cartpole").reset(seed=0, options=START)
    assert np.array_equal(single.reset(seed=0, options=START)[0], expected)
    assert np.array_equal(vector.reset(seed=0, options=START)[0], [expected, expected])
    with pytest.raises(ValueError, match="unknown option"):
        vector.reset(options={"start": {}})
    single.close()
    vector.close()


def test_unknown_keywords_are_refused():
    for make in (lambda: seedbed.make("cartpole", threads=2), lambda: seedbed.make("cartpole", 2, frame_skip=2)):
        with pytest.raises(TypeError, match="unexpected keyword argument|threads is an argument of vector environments"):
            make()
    with pytest.raises(TypeError, match="unexpected keyword argument"):
        seedbed.parallel_env("cartpole", autoreset_mode="NextStep")
    vector = seedbed.make("cartpole", 2)
    with pytest.raises(TypeError, match="unexpected keyword argument 'force'"):
        vector.close(force=True)
    vector.close(timeout=1, terminate=False)
    for name in ("call", "set_attr", "get_attr"):
        assert not hasattr(vector, name)
    for copies in (None, 2):
        with pytest.raises(ValueError, match="render_mode is 'human'"):
            seedbed.make("cartpole", copies, render_mode="human")
    with pytest.raises(ValueError, match="render_mode is 'human'"):
        seedbed.parallel_env("cartpole", render_mode="human")


def test_rounds_of_a_run_have_start_states_of_their_own():
    """Each agent has its own in each round; a mask keeps those of others."""
    environments = seedbed.make("cartpole", 3)
    first, _ = environments.reset(seed=7, options={"round": 0})
    second, _ = environments.reset(seed=7, options={"round": 1})
    assert len({row.tobytes() for row in np.concatenate([first, second])}) == 6
    assert np.array_equal(first, environments.reset(seed=7, options={"round": 0})[0])
    mask = np.array([False, True, False])
    mixed, _ = environments.reset(seed=7, options={"round": 1, "reset_mask": mask})
    assert np.array_equal(mixed, np.where(mask[:, None], second, first))
    assert np.array_equal(first[0], seedbed.make("cartpole").reset(seed=7)[0])


@pytest.mark.parametrize(
    ("seed", "number", "kind", "message"),
    [
        (None, 0, TypeError, "seed is None, expected an integer"),
        ([1, 2, 3], 0, TypeError, r"seed is \[1, 2, 3\], expected an integer"),
        (0, 1.5, TypeError, r"options\['round'\] is 1.5, expected an integer"),
        (0, -1, ValueError, r"options\['round'\] is -1, expected 0 to"),
    ],
)
def test_rounds_that_cannot_be_are_refused(seed: Any, number: Any, kind: type[Exception], message: str):
    environments = seedbed.make("cartpole", 3)
    with pytest.raises(kind, match=message.replace("'round'", "[\"']round[\"']")):
        environments.reset(seed=seed, options={"round": number})
