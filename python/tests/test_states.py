"""States are exact to the bit."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

import seedbed

TASKS = [("cartpole", "rapier"), ("cartpole", "analytic"), ("hopper", "rapier"), ("lander", "rapier"), ("deep_sea", "rapier")]


def play(environment: seedbed.Env, steps: int) -> list[Any]:
    """Results of some steps with resets, which continue the random stream."""
    results: list[Any] = []
    for step in range(steps):
        actions = environment.action_space
        actions.seed(step)
        observation, reward, terminated, truncated, _ = environment.step(actions.sample())
        results.append((observation.tobytes(), reward, terminated, truncated))
        if terminated or truncated:
            results.append(environment.reset()[0].tobytes())
    return results


@pytest.mark.parametrize(("name", "physics"), TASKS)
def test_an_environment_continues_with_the_same_bits(name: str, physics: str):
    """The end of the episode, the time limit included, and the next start states too."""
    environment = seedbed.make(name, physics=physics, max_episode_steps=50)
    before, _ = environment.reset(seed=4)
    play(environment, 7)
    state = environment.get_state()
    expected = play(environment, 120)
    for other in (environment, seedbed.make(name, physics=physics, max_episode_steps=50)):
        observation = other.set_state(state)
        assert not np.array_equal(observation, before)
        assert other.get_state() == state
        assert play(other, 120) == expected


@pytest.mark.parametrize(("name", "physics"), TASKS)
def test_states_move_between_batches_of_different_size(name: str, physics: str):
    large = seedbed.make(name, 9, physics=physics, threads=2)
    large.reset(seed=1)
    large.action_space.seed(0)
    for _ in range(5):
        large.step(large.action_space.sample())
    states = large.get_state()
    small = seedbed.make(name, 2, physics=physics)
    small.reset(seed=50)
    observations = small.set_state([states[8], states[3]])
    single = seedbed.make(name, physics=physics)
    assert np.array_equal(single.set_state(states[8]), observations[0])
    for step in range(30):
        large.action_space.seed(step)
        actions = large.action_space.sample()
        expected = large.step(actions)
        found = small.step(actions[[8, 3]])
        for one, other in zip(found[:4], expected[:4], strict=True):
            assert one.tobytes() == other[[8, 3]].tobytes()


def test_some_copies_can_be_set():
    environments = seedbed.make("cartpole", 3)
    first, _ = environments.reset(seed=0)
    states = environments.get_state()
    moved = environments.step(np.array([1, 0, 1]))[0]
    observations = environments.set_state([states[0]], copies=[1])
    assert np.array_equal(observations, [moved[0], first[0], moved[2]])


def test_states_before_the_first_reset_and_after_the_end():
    environment = seedbed.make("cartpole", max_episode_steps=1)
    idle = environment.get_state()
    environment.reset(seed=0)
    environment.step(0)
    ended = environment.get_state()
    environment.reset()
    environment.set_state(ended)
    with pytest.raises(Exception, match="has ended"):
        environment.step(0)
    environment.set_state(idle)
    with pytest.raises(Exception, match="has not started"):
        environment.step(0)


def test_wrong_bytes_change_nothing():
    environment = seedbed.make("hopper")
    environment.reset(seed=0)
    state = environment.get_state()
    bits = random.Random(0)
    damaged = [b"", b"x", state[:-1], state + b"\0", state[:7], state[:8], state[:20], bytes(len(state))]
    for _ in range(200):
        changed = bytearray(state)
        changed[bits.randrange(len(state))] ^= 1 << bits.randrange(8)
        damaged.append(bytes(changed))
    for wrong in damaged:
        with pytest.raises(ValueError, match="state"):
            environment.set_state(wrong)
    assert environment.get_state() == state


def test_states_of_other_tasks_are_refused():
    hopper, cartpole = seedbed.make("hopper"), seedbed.make("cartpole")
    analytic = seedbed.make("cartpole", physics="analytic")
    for environment in (hopper, cartpole, analytic):
        environment.reset(seed=0)
    with pytest.raises(ValueError, match="of task `hopper`, expected `cartpole`"):
        cartpole.set_state(hopper.get_state())
    with pytest.raises(ValueError, match='physics="analytic", expected physics="rapier"'):
        cartpole.set_state(analytic.get_state())


def test_a_wrong_state_among_several_changes_no_copy():
    environments = seedbed.make("cartpole", 3)
    environments.reset(seed=0)
    before = environments.get_state()
    environments.step(np.array([0, 0, 0]))
    now = environments.get_state()
    with pytest.raises(ValueError, match="not a state"):
        environments.set_state([before[0], before[1], b"wrong"])
    assert environments.get_state() == now
    with pytest.raises(ValueError, match="2 states, expected 3"):
        environments.set_state(before[:2])
    with pytest.raises(IndexError, match="copy is 3, expected 0 to 2"):
        environments.set_state(before[:1], copies=[3])


@pytest.mark.parametrize("wrong", [None, 3, "text", [1, 2]])
def test_states_are_bytes(wrong: Any):
    environment = seedbed.make("cartpole")
    environment.reset(seed=0)
    with pytest.raises(TypeError):
        environment.set_state(wrong)
