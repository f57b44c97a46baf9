"""Epsilon-greedy Q-learning with a network in deep sea, in NumPy: all runs at once, each with its own sea.

Written from definitions, not from the Rust code:
  [M] Mnih et al. 2015, "Human-level control through deep reinforcement learning": replay buffer and target network;
  [H] van Hasselt, Guez and Silver 2016, "Deep reinforcement learning with double Q-learning";
  [A] Kingma and Ba 2015, "Adam".
"""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np

SIZE, MOVE_COST, EPISODES = 4, 0.01, 60
HIDDEN, DISCOUNT, MINIBATCH, TARGET_EVERY = 16, 0.99, 16, 10
STEP_SIZE, BETA1, BETA2, TINY = 0.005, 0.9, 0.999, 1e-8
EPSILON = (1.0, 0.1, 100)  # from, to, over this many steps of each agent


def new_network(rng, runs, sizes):
    """Weights and biases uniform within 1 / sqrt(inputs): for each layer [R, inputs + 1, outputs], the biases in the last row."""
    return [rng.uniform(-1, 1, (runs, n + 1, m)) / np.sqrt(n) for n, m in pairwise(sizes)]


def forward(network, x):
    """tanh between layers, a linear output. x [R, B, inputs] -> the inputs of each layer with a constant 1, and Q [R, B, 2]."""
    inputs = []
    for layer in network:
        inputs.append(np.concatenate([x, np.ones((*x.shape[:2], 1))], axis=2))
        x = np.tanh(inputs[-1] @ layer) if layer is not network[-1] else inputs[-1] @ layer
    return inputs, x


def gradients(network, x, action, target):
    """The gradient of L = mean over the minibatch of (Q(s, a) - target)^2 / 2 by the chain rule."""
    inputs, values = forward(network, x)
    delta = np.where(np.arange(values.shape[2]) == action[..., None], values - target[..., None], 0) / action.shape[1]
    found = []
    for layer, into in zip(network[::-1], inputs[::-1]):
        found.append(into.transpose(0, 2, 1) @ delta)
        delta = (delta @ layer[:, :-1].transpose(0, 2, 1)) * (1 - into[..., :-1] ** 2)
    return found[::-1]


class Adam:
    """[A]: m <- b1 m + (1 - b1) g, v <- b2 v + (1 - b2) g^2, w <- w - a m^ / (sqrt(v^) + tiny), where m^ = m / (1 - b1^t)."""

    def __init__(self, network, step_size):
        self.step_size, self.steps, self.m, self.v = step_size, 0, [0 * layer for layer in network], [0 * layer for layer in network]

    def step(self, network, gradient):
        self.steps += 1
        for layer, m, v, g in zip(network, self.m, self.v, gradient):
            m += (1 - BETA1) * (g - m)
            v += (1 - BETA2) * (g**2 - v)
            layer -= self.step_size * m / (1 - BETA1**self.steps) / (np.sqrt(v / (1 - BETA2**self.steps)) + TINY)


def learn(learner, rng, double):
    """One gradient step of each run towards r + gamma Q'(s', a'): a' is best by the target network Q' [M] or by the other one [H]."""
    state, action, reward, after = (np.concatenate(column, axis=1) for column in zip(*learner.replay))
    if state.shape[1] < MINIBATCH:
        return
    chosen = rng.integers(state.shape[1], size=(len(state), MINIBATCH))
    state, action, reward, after = (np.take_along_axis(column, chosen, 1) for column in (state, action, reward, after))
    _, by_target = forward(learner.target, one_hot(after))
    judge = forward(learner.network, one_hot(after))[1] if double else by_target
    best = np.take_along_axis(by_target, judge.argmax(-1)[..., None], 2)[..., 0]
    goal = reward + DISCOUNT * np.where(after == CELLS, 0, best)
    learner.adam.step(learner.network, gradients(learner.network, one_hot(state), action, goal))
    if learner.adam.steps % TARGET_EVERY == 0:
        learner.target = [layer.copy() for layer in learner.network]


CELLS = SIZE * (SIZE + 1) // 2  # the cells that can be reached, row by row; this number is the end


def one_hot(cell):
    return np.eye(CELLS + 1)[cell][..., :CELLS]


def dive(row, column, right):
    """bsuite's deep sea: next column, reward, and number of the next cell, for all divers in a row."""
    treasure = (row == SIZE - 1) & (column == SIZE - 1) & right
    column = np.where(right, column + 1, np.maximum(column - 1, 0))
    cell = CELLS + 0 * column if row == SIZE - 1 else (row + 1) * (row + 2) // 2 + column
    return column, treasure - right * MOVE_COST / SIZE, cell


def play(rng, runs, agents, double, step_size):
    """Returns of all episodes, [R, K, episodes]. All agents act by one network, which learns after each step of all agents."""
    network = new_network(rng, runs, [CELLS, HIDDEN, 2])
    target = [layer.copy() for layer in network]
    learner = SimpleNamespace(network=network, target=target, adam=Adam(network, step_size), replay=[])
    goes_right = rng.integers(2, size=(runs, CELLS))  # which action does, in each cell
    returns = np.zeros((runs, agents, EPISODES))
    for episode in range(EPISODES):
        column = np.zeros((runs, agents), int)
        cell = column.copy()
        for row in range(SIZE):
            epsilon = np.interp(episode * SIZE + row, [0, EPSILON[2]], EPSILON[:2])
            greedy = forward(learner.network, one_hot(cell))[1].argmax(-1)
            action = np.where(rng.random(cell.shape) < epsilon, rng.integers(2, size=cell.shape), greedy)
            column, reward, after = dive(row, column, action == np.take_along_axis(goes_right, cell, 1))
            returns[..., episode] += reward
            learner.replay.append((cell, action, reward, after))
            cell = after
            learn(learner, rng, double)
    return returns


def measures(algorithm, agents, runs, rng, change):
    """The measures of `runs` runs, by their names in results.csv. `change(settings)` may falsify a setting."""
    settings = SimpleNamespace(step_size=STEP_SIZE)
    change(settings)
    returns = play(rng, runs, agents, algorithm == "double Q-learning", settings.step_size)
    of_team = returns.mean(axis=1)
    return {
        "mean_return": of_team.mean(axis=1),
        "final_return": of_team[:, -25:].mean(axis=1),
        "ReturnAt(episode:20,window:10)": of_team[:, 10:20].mean(axis=1),
        "reach": (returns > 0.985).any(axis=2).mean(axis=1),
    }
