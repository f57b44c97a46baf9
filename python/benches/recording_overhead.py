"""Time that RecordVisitation adds to a step, against an environment that does nothing.

Usage: python benches/recording_overhead.py [--repeats N]. Prints the median over repetitions of pairs, recorded
and not recorded one after the other, in microseconds of processor time per step of one environment.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium import spaces

from seedbed.recording import RecordVisitation, RecordVisitationVector


class Nothing(gymnasium.Env):
    """An environment whose step returns the same observation; episodes have a fixed length."""

    def __init__(self, observations: int, length: int, dtype: type) -> None:
        self.observation_space = spaces.Box(-1, 1, (observations,), dtype)
        self.action_space = spaces.Discrete(2)
        self._observation = np.zeros(observations, dtype)
        self._length = length
        self._step = 0

    def reset(self, *, seed=None, options=None):
        self._step = 0
        return self._observation, {}

    def step(self, action):
        self._step += 1
        return self._observation, 1.0, False, self._step == self._length, {}


class NothingVector(gymnasium.vector.VectorEnv):
    """The same as a vector environment."""

    metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.SAME_STEP}

    def __init__(self, copies: int, observations: int, length: int) -> None:
        self.num_envs = copies
        self.single_observation_space = spaces.Box(-1, 1, (observations,))
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, copies)
        self.single_action_space = spaces.Discrete(2)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, copies)
        self._observations = np.zeros((copies, observations), np.float32)
        self._rewards = np.ones(copies)
        self._never = np.zeros(copies, bool)
        self._always = np.ones(copies, bool)
        self._length = length
        self._step = 0

    def reset(self, *, seed=None, options=None):
        self._step = 0
        return self._observations, {}

    def step(self, actions):
        self._step += 1
        if self._step % self._length:
            return self._observations, self._rewards, self._never, self._never, {}
        infos = {"final_obs": list(self._observations), "_final_obs": self._always}
        return self._observations, self._rewards, self._never, self._always, infos


class Plain(gymnasium.Wrapper):
    """A wrapper that does nothing, as another baseline."""

    def step(self, action):
        return self.env.step(action)


def seconds_of(environment: gymnasium.Env, steps: int) -> float:
    environment.reset()
    start = time.process_time()
    for _ in range(steps):
        _, _, terminated, truncated, _ = environment.step(1)
        if terminated or truncated:
            environment.reset()
    return time.process_time() - start


def vector_seconds_of(environment: gymnasium.vector.VectorEnv, actions: np.ndarray, steps: int) -> float:
    environment.reset()
    start = time.process_time()
    for _ in range(steps):
        environment.step(actions)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=9)
    repeats = parser.parse_args().repeats
    print("single environment, median over", repeats, "pairs: microseconds per step added (and by an empty wrapper)")
    for observations, length, dtype in [(4, 10, np.float32), (8, 100, np.float32), (10, 200, np.float64), (10, 1000, np.float64)]:
        steps = 50_000
        added, empty = [], []
        for _ in range(repeats):
            with tempfile.TemporaryDirectory() as folder:
                bare = seconds_of(Nothing(observations, length, dtype), steps)
                recorded = RecordVisitation(Nothing(observations, length, dtype), Path(folder) / "run", keep_unfinished=False)
                added.append((seconds_of(recorded, steps) - bare) / steps * 1e6)
                empty.append((seconds_of(Plain(Nothing(observations, length, dtype)), steps) - bare) / steps * 1e6)
                recorded.close()
        name = np.dtype(dtype).name
        print(f"  {observations} observations ({name}), {length} steps an episode: {statistics.median(added):.2f} ({statistics.median(empty):.2f})")
    print("vector environment, 8 observations, 200 steps an episode: microseconds per step of one copy added")
    for copies in (4, 64, 1024):
        steps = 200_000 // copies
        actions = np.ones(copies, np.int64)
        added = []
        for _ in range(repeats):
            with tempfile.TemporaryDirectory() as folder:
                bare = vector_seconds_of(NothingVector(copies, 8, 200), actions, steps)
                recorded = RecordVisitationVector(NothingVector(copies, 8, 200), Path(folder) / "run", keep_unfinished=False)
                added.append((vector_seconds_of(recorded, actions, steps) - bare) / (steps * copies) * 1e6)
                recorded.close()
        print(f"  {copies} copies: {statistics.median(added):.2f}")


if __name__ == "__main__":
    main()
