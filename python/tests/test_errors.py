"""Wrong input is an exception that says what is wrong, where, and what was expected."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from conftest import REPOSITORY

import seedbed

BROKEN_TASKS = REPOSITORY / "crates/seedbed-env/tests/broken_envs"


@pytest.mark.parametrize("path", sorted(BROKEN_TASKS.glob("*.ron")), ids=lambda path: path.stem)
def test_messages_about_task_files_are_those_of_seedbed_check(path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(BROKEN_TASKS.parents[1])
    expected = path.with_suffix(".txt").read_text()
    with pytest.raises(seedbed.TaskError) as caught:
        seedbed.make(path.relative_to(BROKEN_TASKS.parents[1]))
    assert f"{caught.value}\n" == expected
    assert isinstance(caught.value, ValueError)


def test_the_parts_of_a_message_are_attributes(tmp_path: Path):
    path = tmp_path / "wrong.ron"
    path.write_text('Environment(\n    extends: "wrong",\n)\n')
    with pytest.raises(seedbed.TaskError) as caught:
        seedbed.Task(path)
    error = caught.value
    assert (error.path, error.line, error.column, error.field) == (str(path), 2, 14, "extends")
    assert error.message in str(error)
    assert error.help is None
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(seedbed.TaskError) as caught:
        seedbed.Task(path)
    assert caught.value.line is None
    assert "UTF-8" in caught.value.message


def test_missing_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileNotFoundError, match="no such task file or task") as caught:
        seedbed.make("no.ron")
    assert caught.value.filename == "no.ron"
    with pytest.raises(FileNotFoundError, match="did you mean `cartpole`"):
        seedbed.make("cartpol")
    for name in ("", "builtin:envs/no.ron", "builtin:../envs/cartpole.ron", "../..", "\0", "builtin:", "é" * 5000):
        with pytest.raises(OSError):
            seedbed.make(name)
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError):
        seedbed.make("folder")
    (tmp_path / "cartpole").mkdir()
    assert seedbed.make("cartpole").unwrapped.task.name == "cartpole"
    with pytest.raises(TypeError):
        seedbed.make(3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"physics": "mujoco"}, 'physics is "mujoco", expected "rapier" or "analytic"'),
        ({"physics": ""}, "expected"),
        ({"max_episode_steps": 0}, "max_episode_steps is 0, expected at least 1, or -1"),
        ({"max_episode_steps": -2}, "max_episode_steps is -2"),
        ({"render_mode": "human"}, "render_mode is 'human', expected None or 'rgb_array'"),
        ({"run_seed": -1}, r"seed is -1, expected 0 to 2\*\*64 - 1"),
        ({"run_seed": 2**64}, "seed is 18446744073709551616"),
        ({"num_envs": 0}, "number of copies is 0, expected 1 to 1048576"),
        ({"num_envs": 2**40}, "number of copies is 1099511627776"),
        ({"num_envs": -1}, "number of copies is -1, expected 1 to 1048576"),
        ({"num_envs": 2, "threads": -1}, "number of threads is -1, expected 1 to 256"),
        ({"num_envs": 2, "threads": 0}, "number of threads is 0, expected 1 to 256"),
        ({"num_envs": 2, "threads": 10**6}, "number of threads is 1000000"),
        ({"num_envs": 2, "autoreset_mode": "sometimes"}, "sometimes"),
    ],
)
def test_wrong_arguments(arguments: dict, message: str):
    with pytest.raises(ValueError, match=message):
        seedbed.make("cartpole", **arguments)


def test_a_task_without_an_analytic_model():
    with pytest.raises(ValueError, match='the task `hopper` has no analytic model: use physics="rapier"'):
        seedbed.make("hopper", physics="analytic")
    with pytest.raises(ValueError, match="no analytic model"):
        seedbed.make("deep_sea", physics="analytic")
    with pytest.raises(ValueError, match="no bodies to draw"):
        seedbed.make("deep_sea", render_mode="rgb_array")


def test_a_run_seed_other_than_that_of_the_task():
    task = seedbed.Task("deep_sea_permuted", run_seed=5)
    assert seedbed.make(task).task.run_seed == seedbed.make(task, run_seed=5).task.run_seed == 5
    for make in (seedbed.make, seedbed.parallel_env):
        with pytest.raises(ValueError, match="run_seed is 4, but the task was made with run_seed=5"):
            make(task, run_seed=4)


def test_arguments_of_vector_environments_need_a_number():
    with pytest.raises(TypeError, match="threads"):
        seedbed.make("cartpole", threads=2)
    with pytest.raises(TypeError, match="paint"):
        seedbed.make("cartpole", paint="red")


@pytest.mark.parametrize("seed", [-1, 2**64, 10**40])
def test_seeds_out_of_range(seed: int):
    for environment in (seedbed.make("cartpole"), seedbed.make("cartpole", 2), seedbed.parallel_env("cartpole")):
        with pytest.raises(ValueError, match="expected 0 to 2"):
            environment.reset(seed=seed)
    with pytest.raises(ValueError, match="seed is 18446744073709551616"):
        seedbed.make("cartpole", 2).reset(seed=2**64 - 1)


@pytest.mark.parametrize("seed", ["7", 1.5, object()])
def test_seeds_are_integers(seed: Any):
    for environment in (seedbed.make("cartpole"), seedbed.parallel_env("cartpole")):
        with pytest.raises(TypeError):
            environment.reset(seed=seed)
    with pytest.raises((TypeError, ValueError)):
        seedbed.make("cartpole", 2).reset(seed=seed)


def test_one_seed_per_copy():
    with pytest.raises(ValueError, match="3 seeds, expected 2"):
        seedbed.make("cartpole", 2).reset(seed=[1, 2, 3])


DISCRETE = "expected the index of a value of `force`: 0 to 1"


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (2, f"the action is 2, {DISCRETE}"),
        (-1, f"the action is -1, {DISCRETE}"),
        (np.int64(10**18), "the action is 1000000000000000000"),
        (10**30, "the action is of type object, expected integers"),
        (0.0, "the action is of type float64, expected integers"),
        (np.float32(1.0), "the action is of type float32, expected integers"),
        ("left", "the action is of type <U4, expected integers"),
        (None, "the action is of type object, expected integers"),
        ([1], r"the action has the shape \(1,\), expected \(\)"),
        (np.zeros((1, 1), int), r"the action has the shape \(1, 1\), expected \(\)"),
        ([[1], [1, 2]], "the action is of type list, expected integers"),
        ({"force": 1}, "the action is of type object, expected integers"),
        (1j, "the action is of type complex128"),
    ],
)
def test_wrong_discrete_actions(action: Any, message: str):
    environment = seedbed.make("cartpole")
    environment.reset(seed=0)
    state = environment.get_state()
    with pytest.raises(ValueError, match=message):
        environment.step(action)
    assert environment.get_state() == state


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0, 0, np.nan], r"actions\[2\] is nan, expected a finite number for `foot_torque`"),
        ([0, np.inf, 0], r"actions\[1\] is inf, expected a finite number for `leg_torque`"),
        ([0, -np.inf, 0], r"actions\[1\] is -inf"),
        ([0, 1e300, 0], r"actions\[1\] is inf"),
        ([0, 0], r"the action has the shape \(2,\), expected \(3,\)"),
        (np.zeros((1, 3)), r"the action has the shape \(1, 3\), expected \(3,\)"),
        (0.5, r"the action has the shape \(\), expected \(3,\)"),
        (["a", "b", "c"], "the action is of type <U1, expected numbers"),
        (None, "the action is of type object, expected numbers"),
        (np.zeros(3, complex), "the action is of type complex128"),
        (np.zeros(3, "datetime64[s]"), "the action is of type datetime64"),
    ],
)
def test_wrong_continuous_actions(action: Any, message: str):
    environment = seedbed.make("hopper")
    environment.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        environment.step(action)


@pytest.mark.parametrize("dtype", [bool, np.int8, np.uint8, np.int16, np.int32, np.uint64, ">i4"])
def test_all_types_of_integers_are_accepted(dtype: Any):
    single, many = seedbed.make("cartpole"), seedbed.make("cartpole", 2)
    single.reset(seed=0)
    many.reset(seed=0)
    expected = single.step(1)[0]
    assert np.array_equal(many.step(np.ones(2, dtype))[0][0], expected)
    single.reset(seed=0)
    assert np.array_equal(single.step(np.ones((), dtype))[0], expected)


@pytest.mark.parametrize("dtype", [np.float16, np.float64, np.int64, ">f4"])
def test_all_types_of_numbers_are_accepted(dtype: Any):
    environment = seedbed.make("hopper")
    environment.reset(seed=0)
    expected = environment.step(np.ones(3, np.float32))[0]
    environment.reset(seed=0)
    assert np.array_equal(environment.step(np.ones(3, dtype))[0], expected)


def test_arrays_in_any_memory_order_are_accepted():
    environments = seedbed.make("hopper", 4)
    actions = np.random.default_rng(0).uniform(-1, 1, (4, 3)).astype(np.float32)
    environments.reset(seed=0)
    expected = environments.step(actions)[0]
    padded = np.zeros((8, 6), np.float32)
    padded[::2, ::2] = actions
    for same in (np.asfortranarray(actions), padded[::2, ::2], actions[::-1][::-1], actions.tolist()):
        environments.reset(seed=0)
        assert np.array_equal(environments.step(same)[0], expected)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.array([0, 1, 2]), rf"actions\[2\] is 2, {DISCRETE}"),
        (np.array([0, 1]), r"actions have the shape \(2,\), expected \(3,\)"),
        (np.zeros((3, 1), int), r"actions have the shape \(3, 1\), expected \(3,\)"),
        (1, r"actions have the shape \(\), expected \(3,\)"),
        (np.zeros(3), "actions are of type float64, expected integers"),
        ([[0], [1, 2], 0], "actions are of type list, expected integers"),
        (None, "actions are of type object, expected integers"),
    ],
)
def test_wrong_actions_of_many(actions: Any, message: str):
    environments = seedbed.make("cartpole", 3)
    environments.reset(seed=0)
    states = environments.get_state()
    with pytest.raises(ValueError, match=message):
        environments.step(actions)
    assert environments.get_state() == states


def test_wrong_continuous_actions_of_many():
    environments = seedbed.make("hopper", 2)
    environments.reset(seed=0)
    actions = np.zeros((2, 3), np.float32)
    actions[1, 2] = np.nan
    with pytest.raises(ValueError, match=r"actions\[1, 2\] is nan, expected a finite number for `foot_torque`"):
        environments.step(actions)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ({"switch": 3, "push": 0.0}, r'actions\["switch"\] is 3, expected the index of a value of `switch`: 0 to 2'),
        ({"switch": 0, "push": np.nan}, r'actions\["push"\] is nan'),
        ({"switch": 0}, 'actions have no key "push"'),
        ({"switch": 0, "push": 0.0, "pull": 0.0}, "actions have the key 'pull'"),
        ({"switch": [0], "push": 0.0}, r'actions\["switch"\] has the shape \(1,\), expected \(\)'),
        ([0, 0.0], "actions are a list, expected a dictionary"),
        ({1: 0, "push": 0.0}, "actions have the key 1"),
    ],
)
def test_wrong_named_actions(mixed_task: Path, action: Any, message: str):
    environment = seedbed.make(mixed_task)
    environment.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        environment.step(action)
    many = seedbed.make(mixed_task, 2)
    many.reset(seed=0)
    actions = {"switch": np.array([0, 5]), "push": np.zeros(2)}
    with pytest.raises(ValueError, match=r'actions\["switch"\]\[1\] is 5'):
        many.step(actions)


def test_hostile_objects_raise_their_own_or_our_errors():
    class Hostile:
        def __index__(self) -> int:
            raise ZeroDivisionError

        def __array__(self, *_: Any, **__: Any) -> Any:
            raise ZeroDivisionError

        def __fspath__(self) -> str:
            raise ZeroDivisionError

        def __len__(self) -> int:
            return -1

    environments = (seedbed.make("cartpole"), seedbed.make("cartpole", 2), seedbed.parallel_env("cartpole"))
    for environment in environments:
        environment.reset(seed=0)
        with pytest.raises((ValueError, ZeroDivisionError, TypeError)):
            environment.step(Hostile())
        with pytest.raises((ValueError, ZeroDivisionError, TypeError)):
            environment.reset(seed=Hostile())
    with pytest.raises((TypeError, ZeroDivisionError)):
        seedbed.make(Hostile())


def test_native_calls_with_wrong_arrays_are_refused():
    """The private class checks its arrays, although only this package calls it."""
    batch = seedbed._native.Batch(seedbed.Task("cartpole"), 3)
    with pytest.raises(gymnasium.error.ResetNeeded):
        batch.step(np.zeros(3, int), *arrays(3))
    for index in range(3):
        batch.seed(index, 0)
    batch.reset(np.zeros((3, 4), np.float32))
    for lengths in itertools.product([2, 3], repeat=4):
        if set(lengths) != {3}:
            with pytest.raises(ValueError, match="expected"):
                batch.step(np.zeros(3, int), *arrays(*lengths))
    observations = np.asfortranarray(np.zeros((3, 4), np.float32))
    with pytest.raises(ValueError, match="contiguous"):
        batch.reset(observations)
    frozen = np.zeros((3, 4), np.float32)
    frozen.flags.writeable = False
    with pytest.raises((TypeError, ValueError)):
        batch.reset(frozen)
    with pytest.raises(IndexError, match="copy is 3, expected 0 to 2"):
        batch.save(3)
    with pytest.raises(OverflowError):
        batch.save(-1)
    with pytest.raises(ValueError, match="expected 1"):
        batch.reset_one()
    with pytest.raises(ValueError, match="side of a picture is 5 pixels"):
        batch.render(0, 5, 100)


def arrays(observations: int, rewards: int = 3, terminated: int = 3, truncated: int = 3) -> tuple:
    return (
        np.zeros((observations, 4), np.float32),
        np.zeros(rewards),
        np.zeros(terminated, bool),
        np.zeros(truncated, bool),
    )


@pytest.mark.filterwarnings("ignore:explosion")
def test_an_exploding_simulation_is_no_panic(tmp_path: Path):
    """A force that grows without bounds ends in numbers that are not finite, not in a crash."""
    task = seedbed.Task("hopper").text
    path = tmp_path / "explosion.ron"
    path.write_text(task.replace("gear: 200.0", "gear: 1e30").replace("terminated:", "terminated: \"false\", // "))
    environments = seedbed.make(path, 4, threads=2)
    environments.reset(seed=0)
    for _ in range(50):
        try:
            observations, *_ = environments.step(np.ones((4, 3), np.float32))
        except RuntimeError as error:
            assert "the simulation failed" in str(error)
            return
    assert observations.shape == (4, 11)
