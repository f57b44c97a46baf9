"""Environments that programs must cope with, for `test_gymnasium_tasks`. Each function returns an environment."""

from __future__ import annotations

import os
import sys
import time

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, MultiDiscrete


class Awkward(gymnasium.Env):
    """A point on a line: observations of a Dict with infinite bounds, a slow reset, no time limit of its own."""

    observation_space = Dict({"place": Box(-np.inf, np.inf, (2,)), "door": Discrete(3)})
    action_space = MultiDiscrete([3, 2])

    def __init__(self, size=4.0, slow=0.0):
        self.size, self.slow = size, slow

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        time.sleep(self.slow)
        self.x = self.np_random.uniform(-1, 1)
        self.v = 0.0
        return self.observe(), {}

    def step(self, action):
        print("a print of the environment", flush=True)
        self.v = 0.5 * self.v + 0.2 * (int(action[0]) - 1) * (1 + int(action[1]))
        self.x += self.v
        is_out = abs(self.x) > self.size
        return self.observe(), float(self.x > self.size), is_out, False, {"speed": abs(self.v)}

    def observe(self):
        return {"place": np.array([self.x, self.v], np.float32), "door": int(self.x > 0) + int(self.x > 1)}


class Faulty(Awkward):
    """Does what `fault` says in step `at` of each episode after the first `after` episodes."""

    def __init__(self, fault, at=3, after=2):
        super().__init__()
        self.fault, self.at, self.after, self.episodes, self.steps = fault, at, after, 0, 0

    def reset(self, **options):
        self.episodes += 1
        self.steps = 0
        if self.fault == "reset" and self.episodes > self.after:
            raise RuntimeError("no start")
        return super().reset(**options)

    def step(self, action):
        self.steps += 1
        observation, reward, terminated, truncated, info = super().step(action)
        if self.episodes > self.after and self.steps == self.at:
            observation, reward = FAULTS[self.fault](observation, reward)
        return observation, reward, terminated, truncated, info


def _raise(observation, reward):
    raise ValueError("the motor is on fire")


def _recurse(observation, reward):
    return _recurse(observation, reward)


def _hang(observation, reward):
    time.sleep(1000)


FAULTS = {
    "raise": _raise,
    "recurse": _recurse,
    "hang": _hang,
    "exit": lambda observation, reward: sys.exit(3),
    "die": lambda observation, reward: os._exit(7),
    "kill": lambda observation, reward: os.kill(os.getpid(), 9),
    "shape": lambda observation, reward: ({**observation, "place": np.zeros(3, np.float32)}, reward),
    "nan": lambda observation, reward: ({**observation, "place": np.array([np.nan, 0], np.float32)}, reward),
    "no_reward": lambda observation, reward: (observation, None),
    "reset": lambda observation, reward: (observation, reward),
}


class Remembers(Awkward):
    """Its episodes depend on how many there were before."""

    count = 0

    def reset(self, **options):
        self.count += 1
        super().reset(**options)
        self.x += 0.01 * self.count
        return self.observe(), {}

    def render(self):
        return np.zeros((30, 40, 3), np.uint8)


class Drawn(Awkward):
    """Its pictures have the color of its state."""

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(self, render_mode=None):
        super().__init__()
        self.render_mode = render_mode

    def render(self):
        red, blue = np.clip([128 + 25 * self.x, 128 + 60 * self.v], 0, 255)
        return np.full((30, 40, 3), [red, 90, blue], np.uint8)


def drawn(**options):
    return gymnasium.wrappers.TimeLimit(Drawn(**options), 30)


def awkward(**options):
    return Awkward(**options)


def faulty(**options):
    return Faulty(**options)


def without_pictures():
    return Awkward()


def remembers():
    return Remembers()


def endless():
    return gymnasium.wrappers.TransformReward(gymnasium.make("Pendulum-v1", max_episode_steps=-1), lambda reward: reward)


def not_an_environment():
    return 3


def fails():
    raise OSError("the simulator has no license")
