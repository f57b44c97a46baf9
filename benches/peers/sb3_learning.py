"""Stable-Baselines3 on one thread.

`dqn`: steps of DQN with two layers of 256 units and one gradient step on a minibatch of 64 per step of the task, per
second of CPU time, without imports.

`sac`: steps of SAC with one gradient step per step of a task with 17 observations and 6 actions that costs nothing, per
second of CPU time, without imports and before the first gradient step.

`cartpole`: one run of PPO until the mean return of 25 episodes is 195, with the settings that RL Zoo tuned for this task.
"""

import argparse
import json
import time
from collections import deque

import gymnasium
import numpy as np
import torch
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

THRESHOLD, WINDOW, TIME_LIMIT = 195.0, 25, 200


class StopWhenSolved(BaseCallback):
    """Ends training when the mean return of the latest episodes reaches the threshold."""

    def __init__(self):
        super().__init__()
        self.returns = deque(maxlen=WINDOW)
        self.episodes = 0

    def _on_step(self):
        for info in self.locals["infos"]:
            if "episode" in info:
                self.returns.append(info["episode"]["r"])
                self.episodes += 1
        return len(self.returns) < WINDOW or sum(self.returns) / WINDOW < THRESHOLD


def dqn(seconds):
    environment = gymnasium.make("CartPole-v1", max_episode_steps=TIME_LIMIT)
    model = DQN(
        "MlpPolicy", environment, learning_rate=0.0005, buffer_size=50_000, learning_starts=100, batch_size=64, train_freq=1,
        gradient_steps=1, target_update_interval=100, policy_kwargs={"net_arch": [256, 256]}, seed=0, device="cpu",
    )
    model.learn(500)
    steps, start = 0, time.process_time()
    while time.process_time() - start < seconds:
        model.learn(500, reset_num_timesteps=False)
        steps += 500
    return {"units": steps, "cpu_seconds": time.process_time() - start}


class NoTask(gymnasium.Env):
    """Observations and rewards are random numbers; an episode ends after 1000 steps."""

    observation_space = gymnasium.spaces.Box(-1, 1, (17,), np.float32)
    action_space = gymnasium.spaces.Box(-1, 1, (6,), np.float32)

    def __init__(self):
        self.rows = np.random.default_rng(0).uniform(-1, 1, (1000, 17)).astype(np.float32)
        self.steps = 0

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return self.rows[0], {}

    def step(self, action):
        self.steps += 1
        return self.rows[self.steps % 1000], float(self.rows[self.steps % 1000, 0]), False, self.steps == 1000, {}


def sac(seconds, units, minibatch):
    model = SAC(
        "MlpPolicy", NoTask(), buffer_size=100_000, learning_starts=1000, batch_size=minibatch, train_freq=1, gradient_steps=1,
        policy_kwargs={"net_arch": [units, units]}, seed=0, device="cpu",
    )
    model.learn(1050)
    steps, start = 0, time.process_time()
    while time.process_time() - start < seconds:
        model.learn(50, reset_num_timesteps=False)
        steps += 50
    return {"units": steps, "cpu_seconds": time.process_time() - start}


def cartpole(seed):
    environments = make_vec_env(
        lambda: gymnasium.make("CartPole-v1", max_episode_steps=TIME_LIMIT), n_envs=8, seed=seed
    )
    model = PPO(
        "MlpPolicy", environments, n_steps=32, batch_size=256, gae_lambda=0.8, gamma=0.98, n_epochs=20, ent_coef=0.0,
        learning_rate=lambda left: 0.001 * left, clip_range=lambda left: 0.2 * left, seed=seed, device="cpu",
    )
    stop = StopWhenSolved()
    model.learn(100_000, callback=stop)
    return {"env_steps": model.num_timesteps, "episodes": stop.episodes}


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("work", choices=["dqn", "sac", "cartpole"])
parser.add_argument("--seconds", type=float, default=1.0, help="CPU time of the measurement of `dqn` and `sac`")
parser.add_argument("--units", type=int, default=256, help="units of each of two layers of `sac`")
parser.add_argument("--minibatch", type=int, default=256, help="transitions per gradient step of `sac`")
parser.add_argument("--seed", type=int, default=0, help="seed of `cartpole`")
arguments = parser.parse_args()
torch.set_num_threads(1)
if arguments.work == "dqn":
    result = dqn(arguments.seconds)
elif arguments.work == "sac":
    result = sac(arguments.seconds, arguments.units, arguments.minibatch)
else:
    result = cartpole(arguments.seed)
print(json.dumps(result))
