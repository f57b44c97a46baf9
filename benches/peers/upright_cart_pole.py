"""CartPole-v1 without ends but its time limit: all copies play for 500 steps, as those of a trained team do."""

import math

import gymnasium


def make_upright() -> gymnasium.Env:
    environment = gymnasium.make("CartPole-v1")
    environment.unwrapped.theta_threshold_radians = environment.unwrapped.x_threshold = math.inf
    return environment
