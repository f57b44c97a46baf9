"""REINFORCE in NumPy: K agents learn to balance a pole in K copies of the task, which are stepped together.

    python reinforce.py                        # records recordings/reinforce
    seedbed inspect recordings/reinforce

docs/own_algorithm_in_python.md explains it; docs/python.md says how seedbed is installed.
"""

import argparse

import numpy as np

import seedbed


def probability_of_right(inputs, weights):
    """Probability of a push to the right, for each row: `[N, d]`, `[N, d]` or `[d]` to `[N]`."""
    return 1 / (1 + np.exp(-(inputs * weights).sum(axis=1)))


def policy_gradient(inputs, actions, rewards, weights, gamma=0.99):
    """Gradient of the expected return, from one episode: Σ (return from t − mean) ∇ log π(action t)."""
    returns = np.array(rewards, float)
    for step in reversed(range(len(returns) - 1)):
        returns[step] += gamma * returns[step + 1]
    advantages = (returns - returns.mean()) / (returns.std() + 1e-8)
    inputs = np.array(inputs)
    return ((advantages * (np.array(actions) - probability_of_right(inputs, weights)))[:, None] * inputs).mean(axis=0)


def train(folder, agents=4, episodes=150, step_size=2.0, sigma=0.5, run_seed=0, overwrite=False):
    """Train agents, record where they go, and return their returns: a list per agent."""
    environments = seedbed.make("cartpole", num_envs=agents, autoreset_mode="SameStep", max_episode_steps=200)
    ranges = np.array([quantity.range[1] for quantity in environments.task.observations])
    environments = seedbed.RecordVisitationVector(environments, folder, learners=range(agents), overwrite=overwrite)
    # The agent seeds: weights from which each agent starts.
    weights = np.stack([sigma * np.random.default_rng([run_seed, agent]).standard_normal(4) for agent in range(agents)])
    rng = np.random.default_rng(run_seed)
    running = [([], [], []) for _ in range(agents)]
    finished = [[] for _ in range(agents)]
    observations, _ = environments.reset(seed=run_seed)
    while min(map(len, finished)) < episodes:
        inputs = observations / ranges
        actions = (rng.random(agents) < probability_of_right(inputs, weights)).astype(int)
        observations, rewards, terminated, truncated, _ = environments.step(actions)
        for episode, *step in zip(running, inputs, actions, rewards):
            for values, value in zip(episode, step):
                values.append(value)
        for agent in np.flatnonzero(terminated | truncated):
            weights[agent] += step_size * policy_gradient(*running[agent], weights[agent])
            finished[agent].append(sum(running[agent][2]))
            running[agent] = ([], [], [])
    environments.close()
    return finished


def main():
    parser = argparse.ArgumentParser(description="Train K agents by REINFORCE, and record where they go.")
    parser.add_argument(
        "--folder", default="recordings/reinforce", help="folder of the run [default: recordings/reinforce]"
    )
    parser.add_argument("--agents", type=int, default=4, help="number of agents [default: 4]")
    parser.add_argument("--episodes", type=int, default=150, help="min number of episodes of each agent [default: 150]")
    parser.add_argument("--seed", type=int, default=0, help="run seed [default: 0]")
    parser.add_argument("--overwrite", action="store_true", help="replace the run in the folder")
    given = parser.parse_args()
    finished = train(given.folder, given.agents, given.episodes, run_seed=given.seed, overwrite=given.overwrite)
    for agent, returns in enumerate(finished):
        first, last = np.mean(returns[:25]), np.mean(returns[-25:])
        print(f"agent {agent}: mean return {first:.0f} in its first 25 episodes, {last:.0f} in its last 25")
    print(f"recorded {given.folder}; look at it with\n  seedbed inspect {given.folder}")


if __name__ == "__main__":
    main()
