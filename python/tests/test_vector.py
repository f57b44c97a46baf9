"""Vector environments equal Gymnasium's `SyncVectorEnv` of single environments to the bit."""

from __future__ import annotations

import multiprocessing
import threading
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import seedbed

MODES = list(AutoresetMode)
COPIES = 5


def assert_equal(found: Any, expected: Any, place: str = "") -> None:
    """Equal values, types and bits; objects within."""
    assert type(found) is type(expected), place
    if isinstance(found, dict):
        assert sorted(found) == sorted(expected), place
        for key in found:
            assert_equal(found[key], expected[key], f"{place}[{key!r}]")
    elif isinstance(found, tuple | list):
        assert len(found) == len(expected), place
        for index, (one, other) in enumerate(zip(found, expected, strict=True)):
            assert_equal(one, other, f"{place}[{index}]")
    elif isinstance(found, np.ndarray) and found.dtype == object:
        assert_equal(list(found), list(expected), place)
    elif isinstance(found, np.ndarray):
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape), place
        assert found.tobytes() == expected.tobytes(), f"{place}: {found} != {expected}"
    else:
        assert found == expected, place


def compare(ours: seedbed.VectorEnv, theirs: SyncVectorEnv, steps: int, seed: Any = 3) -> tuple[int, int]:
    """Steps both with the same actions; returns how many episodes were terminated and truncated."""
    assert ours.action_space == theirs.action_space
    assert ours.observation_space == theirs.observation_space
    assert ours.metadata == theirs.metadata
    assert_equal(ours.reset(seed=seed), theirs.reset(seed=seed))
    ours.action_space.seed(0)
    ends = np.zeros(2, int)
    for step in range(steps):
        actions = ours.action_space.sample()
        found = ours.step(actions)
        assert_equal(found, theirs.step(actions), f"step {step}")
        terminated, truncated = found[2:4]
        ends += [terminated.sum(), (truncated & ~terminated).sum()]
        if ours.autoreset_mode == AutoresetMode.DISABLED and (terminated | truncated).any():
            mask = terminated | truncated
            found = ours.reset(options={"reset_mask": mask})
            assert_equal(found, theirs.reset(options={"reset_mask": mask}), f"reset after step {step}")
    return int(ends[0]), int(ends[1])


def sync(name: str, mode: AutoresetMode, copies: int = COPIES, **arguments: Any) -> SyncVectorEnv:
    make = lambda: seedbed.make(name, **arguments)  # noqa: E731
    return SyncVectorEnv([make] * copies, autoreset_mode=mode)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("physics", ["rapier", "analytic"])
def test_equal_to_single_environments(mode: AutoresetMode, physics: str):
    """With a limit of 30 steps some episodes are terminated and others truncated, at different times."""
    arguments = {"physics": physics, "max_episode_steps": 30}
    ours = seedbed.make("cartpole", COPIES, autoreset_mode=mode, **arguments)
    terminated, truncated = compare(ours, sync("cartpole", mode, **arguments), 400)
    assert terminated > 20
    assert truncated > 5


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["hopper", "lander", "deep_sea", "puck_maze", "acrobot"])
def test_equal_to_single_environments_in_other_tasks(name: str, mode: AutoresetMode):
    ours = seedbed.make(name, COPIES, autoreset_mode=mode, max_episode_steps=40)
    terminated, truncated = compare(ours, sync(name, mode, max_episode_steps=40), 120)
    assert terminated + truncated > 5


@pytest.mark.parametrize("mode", MODES)
def test_equal_for_named_actions(mixed_task: Any, mode: AutoresetMode):
    ours = seedbed.make(mixed_task, 3, autoreset_mode=mode)
    terminated, truncated = compare(ours, sync(mixed_task, mode, 3), 60)
    assert terminated + truncated > 5


@pytest.mark.parametrize("mode", MODES)
def test_made_by_gymnasium(mode: AutoresetMode):
    """`make_vec` is native by default, and equals its own mode "sync"."""
    arguments = {"max_episode_steps": 25, "physics": "analytic"}
    ours = gymnasium.make_vec("seedbed/CartPole-v0", COPIES, autoreset_mode=mode.value, **arguments)
    assert isinstance(ours.unwrapped, seedbed.VectorEnv)
    theirs = gymnasium.make_vec(
        "seedbed/CartPole-v0",
        COPIES,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **arguments,
    )
    theirs.metadata = ours.metadata
    assert min(compare(ours.unwrapped, theirs, 200)) > 2
    default = gymnasium.make_vec("seedbed/CartPole-v0", 2)
    assert default.unwrapped._batch.max_episode_steps == 200


@pytest.mark.parametrize("seed", [0, [5, 5, None, 2**64 - 1, 0], None])
def test_seeds(seed: Any):
    ours, theirs = seedbed.make("cartpole", COPIES), sync("cartpole", AutoresetMode.NEXT_STEP)
    for environments in (ours, theirs):
        environments.reset(seed=100)
        environments.reset()
    assert_equal(ours.reset(seed=seed), theirs.reset(seed=seed))
    assert_equal(ours.reset(), theirs.reset())
    assert ours.np_random_seed == theirs.np_random_seed


def test_copies_without_a_seed_differ():
    environments = seedbed.make("cartpole", 8)
    observations, _ = environments.reset()
    assert len({row.tobytes() for row in observations}) == 8
    again, _ = environments.reset(seed=list(environments.np_random_seed))
    assert np.array_equal(again, observations)


def test_a_reset_mask_leaves_other_copies():
    environments = seedbed.make("cartpole", 3)
    first, _ = environments.reset(seed=0)
    moved = environments.step(np.array([1, 1, 1]))[0]
    options = {"reset_mask": np.array([False, True, False])}
    observations, _ = environments.reset(seed=[7, 1, 7], options=options)
    assert np.array_equal(observations, [moved[0], first[1], moved[2]])
    assert list(options) == ["reset_mask"], "wrappers read it as well"
    assert environments.np_random_seed == (0, 1, 2)


@pytest.mark.parametrize(
    ("mask", "error"),
    [
        (np.zeros(3, bool), ValueError),
        (np.ones(2, bool), ValueError),
        (np.ones(3), TypeError),
        ([True, True, True], TypeError),
    ],
)
def test_wrong_reset_masks(mask: Any, error: type[Exception]):
    environments = seedbed.make("cartpole", 3)
    with pytest.raises(error, match="reset_mask"):
        environments.reset(options={"reset_mask": mask})


def test_without_automatic_resets_a_step_after_the_end_is_refused():
    environments = seedbed.make("cartpole", 3, autoreset_mode="Disabled", max_episode_steps=2)
    with pytest.raises(ResetNeeded, match="copy 0 has not started"):
        environments.step(np.zeros(3, int))
    environments.reset(seed=0)
    environments.step(np.zeros(3, int))
    environments.step(np.zeros(3, int))
    environments.reset(options={"reset_mask": np.array([True, True, False])})
    with pytest.raises(ResetNeeded, match="the episode of copy 2 has ended"):
        environments.step(np.zeros(3, int))


def trajectory(environments: seedbed.VectorEnv, steps: int = 60) -> bytes:
    rows = [environments.reset(seed=11)[0].tobytes()]
    environments.action_space.seed(1)
    for _ in range(steps):
        results = environments.step(environments.action_space.sample())
        rows += [array.tobytes() for array in results[:4]]
    return b"".join(rows)


@pytest.mark.parametrize("name", ["cartpole", "hopper", "deep_sea"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_results_do_not_depend_on_the_number_of_threads(name: str, mode: str):
    def bits(threads: int | None) -> bytes:
        return trajectory(seedbed.make(name, 37, threads=threads, autoreset_mode=mode))

    expected = bits(1)
    for threads in (2, 3, 8, 100, None):
        assert bits(threads) == expected, threads


def test_the_default_number_of_threads_depends_on_the_work():
    cores = multiprocessing.cpu_count()
    assert seedbed.make("cartpole", 16).threads == 1
    assert seedbed.make("cartpole", 4096).threads == min(cores, 16)
    assert seedbed.make("hopper", 1024).threads == min(cores, 128)
    assert seedbed.make("cartpole", 3, threads=8).threads == 3


def test_steps_run_while_another_thread_does():
    """The global interpreter lock is released: another thread counts during a single call."""
    environments = seedbed.make("hopper", 2048, threads=1)
    environments.reset(seed=0)
    actions = np.zeros((2048, 3), np.float32)
    counts, is_stepping = [0], threading.Event()

    def count() -> None:
        while not is_stepping.is_set():
            counts[0] += 1

    counter = threading.Thread(target=count)
    counter.start()
    before = counts[0]
    environments.step(actions)
    during = counts[0] - before
    is_stepping.set()
    counter.join()
    assert during > 1000


def child(environments: seedbed.VectorEnv, results: Any) -> None:
    results.put(trajectory(environments))


def test_threads_work_in_a_forked_process():
    environments = seedbed.make("cartpole", 8, threads=2)
    expected = trajectory(environments)
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    process = context.Process(target=child, args=(environments, results))
    process.start()
    assert results.get(timeout=60) == expected
    process.join()


def test_async_vector_environments():
    environments = gymnasium.make_vec("seedbed/CartPole-v0", 2, vectorization_mode="async")
    found, _ = environments.reset(seed=3)
    assert np.array_equal(found, seedbed.make("cartpole", 2).reset(seed=3)[0])
    environments.close()


def test_results_are_new_arrays_unless_told_otherwise():
    copied, shared = seedbed.make("cartpole", 4), seedbed.make("cartpole", 4, copy=False)
    actions = np.ones(4, int)
    first, kept = copied.reset(seed=0)[0], shared.reset(seed=0)[0]
    before = first.copy()
    results = [environments.step(actions) for environments in (copied, shared)]
    assert np.array_equal(first, before)
    assert kept is results[1][0] is shared.step(actions)[0]
    rewards = results[1][1]
    assert not np.shares_memory(rewards, shared.step(actions)[1])
    for array in results[0][:4]:
        assert array.flags.c_contiguous
        assert array.flags.writeable


def test_final_observations_do_not_change():
    environments = seedbed.make("cartpole", 2, autoreset_mode="SameStep", max_episode_steps=1)
    environments.reset(seed=0)
    *_, infos = environments.step(np.zeros(2, int))
    kept = [row.copy() for row in infos["final_obs"]]
    environments.step(np.ones(2, int))
    assert_equal(list(infos["final_obs"]), kept)


@pytest.mark.parametrize("mode", MODES)
def test_gymnasiums_statistics(mode: AutoresetMode):
    """Poles do not fall within 8 steps, so that every episode has this length and return."""
    if mode == AutoresetMode.DISABLED:
        return
    environments = RecordEpisodeStatistics(
        seedbed.make("cartpole", 2, max_episode_steps=8, autoreset_mode=mode)
    )
    environments.reset(seed=0)
    for _ in range(30):
        environments.step(np.array([0, 1]))
    assert set(environments.return_queue) == set(environments.length_queue) == {8}
