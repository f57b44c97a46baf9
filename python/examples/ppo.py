"""Proximal policy optimization in one file, on a task of seedbed.

    python ppo.py                                     CartPole until its mean return is 195
    python ppo.py --env-id seedbed:seedbed/Acrobot-v0

It has the structure of CleanRL's single-file PPO: `gymnasium.make`, Gymnasium's wrappers and `SyncVectorEnv`,
so that only the name of the environment differs from a script for Gymnasium's own tasks.
Needs `torch`, and seedbed: docs/python.md says how it is installed.
"""

from __future__ import annotations

import argparse

import gymnasium as gym
import numpy as np
import torch
from torch import nn


def make_env(env_id):
    def thunk():
        env = gym.make(env_id)
        return gym.wrappers.RecordEpisodeStatistics(env)

    return thunk


def layer(inputs, outputs, gain=2**0.5):
    module = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(module.weight, gain)
    nn.init.zeros_(module.bias)
    return module


class Agent(nn.Module):
    """Separate networks for the value and for the logits of a discrete action."""

    def __init__(self, envs):
        super().__init__()
        inputs = int(np.prod(envs.single_observation_space.shape))
        self.value = nn.Sequential(layer(inputs, 64), nn.Tanh(), layer(64, 64), nn.Tanh(), layer(64, 1, 1.0))
        actions = envs.single_action_space.n
        self.logits = nn.Sequential(layer(inputs, 64), nn.Tanh(), layer(64, 64), nn.Tanh(), layer(64, actions, 0.01))

    def evaluate(self, observations, actions=None):
        """Actions, their log probabilities, entropies and values."""
        policy = torch.distributions.Categorical(logits=self.logits(observations))
        if actions is None:
            actions = policy.sample()
        return actions, policy.log_prob(actions), policy.entropy(), self.value(observations).squeeze(-1)


def advantages_of(rewards, values, dones, next_value, next_done, discount, trace):
    """Generalized advantage estimates: `[steps, environments]`."""
    advantages = torch.zeros_like(rewards)
    last = torch.zeros_like(next_value)
    for step in reversed(range(len(rewards))):
        is_last = step == len(rewards) - 1
        continues = 1.0 - (next_done if is_last else dones[step + 1])
        following = next_value if is_last else values[step + 1]
        error = rewards[step] + discount * following * continues - values[step]
        last = error + discount * trace * continues * last
        advantages[step] = last
    return advantages


def update(agent, optimizer, batch, arguments):
    observations, actions, log_probs, advantages, returns = batch
    for _ in range(arguments.update_epochs):
        for indices in torch.randperm(len(actions)).split(len(actions) // arguments.num_minibatches):
            _, new_log_probs, entropies, values = agent.evaluate(observations[indices], actions[indices])
            ratios = (new_log_probs - log_probs[indices]).exp()
            scaled = advantages[indices]
            scaled = (scaled - scaled.mean()) / (scaled.std() + 1e-8)
            clipped = ratios.clamp(1 - arguments.clip, 1 + arguments.clip)
            policy_loss = -torch.min(ratios * scaled, clipped * scaled).mean()
            value_loss = 0.5 * (values - returns[indices]).pow(2).mean()
            loss = policy_loss + 0.5 * value_loss - arguments.entropy * entropies.mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def train(arguments):
    """Returns the mean return of the last 20 episodes, and the number of steps."""
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(1)
    envs = gym.vector.SyncVectorEnv([make_env(arguments.env_id) for _ in range(arguments.num_envs)])
    assert isinstance(envs.single_action_space, gym.spaces.Discrete), "only discrete action spaces"
    agent = Agent(envs)
    optimizer = torch.optim.Adam(agent.parameters(), lr=arguments.learning_rate, eps=1e-5)
    shape = (arguments.num_steps, arguments.num_envs)
    observations = torch.zeros(shape + envs.single_observation_space.shape)
    actions, log_probs, rewards, dones, values = (torch.zeros(shape) for _ in range(5))
    returns_of_episodes = []
    next_observations = torch.tensor(envs.reset(seed=arguments.seed)[0])
    next_done = torch.zeros(arguments.num_envs)
    step_count = 0
    while step_count < arguments.total_timesteps:
        for step in range(arguments.num_steps):
            step_count += arguments.num_envs
            observations[step], dones[step] = next_observations, next_done
            with torch.no_grad():
                actions[step], log_probs[step], _, values[step] = agent.evaluate(next_observations)
            found, reward, terminated, truncated, infos = envs.step(actions[step].long().numpy())
            rewards[step] = torch.tensor(reward)
            next_observations, next_done = torch.tensor(found), torch.tensor(terminated | truncated).float()
            if "episode" in infos:
                returns_of_episodes.extend(infos["episode"]["r"][infos["_episode"]].tolist())
        mean = float(np.mean(returns_of_episodes[-20:] or [np.nan]))
        print(f"steps {step_count}, episodes {len(returns_of_episodes)}, mean return {mean:.1f}", flush=True)
        if len(returns_of_episodes) >= 20 and mean >= arguments.threshold:
            break
        with torch.no_grad():
            next_value = agent.value(next_observations).squeeze(-1)
        advantages = advantages_of(
            rewards, values, dones, next_value, next_done, arguments.discount, arguments.trace
        )
        rows = (observations, actions, log_probs, advantages, advantages + values)
        update(agent, optimizer, [array.flatten(0, 1) for array in rows], arguments)
    envs.close()
    return mean, step_count


def parse(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env-id", default="seedbed:seedbed/CartPole-v0", help="id of the environment")
    parser.add_argument("--seed", type=int, default=1, help="random number seed (default: 1)")
    parser.add_argument("--total-timesteps", type=int, default=200_000, help="maximum number of steps")
    parser.add_argument("--threshold", type=float, default=195.0, help="mean return at which training ends")
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--num-envs", type=int, default=8)
    parser.add_argument("--num-steps", type=int, default=128, help="steps per environment and update")
    parser.add_argument("--num-minibatches", type=int, default=4)
    parser.add_argument("--update-epochs", type=int, default=4)
    parser.add_argument("--discount", type=float, default=0.99)
    parser.add_argument("--trace", type=float, default=0.95, help="lambda of generalized advantage estimates")
    parser.add_argument("--clip", type=float, default=0.2)
    parser.add_argument("--entropy", type=float, default=0.01, help="factor of the entropy bonus")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    train(parse())
