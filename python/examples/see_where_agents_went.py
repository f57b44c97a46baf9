"""Four agents of Stable-Baselines3 learn to land, each in a process of its own; then you see where each of them went.

    pip install stable-baselines3 "gymnasium[box2d]"
    python see_where_agents_went.py
    seedbed explore recordings/lander --open

docs/python.md says how seedbed is installed.
"""

import argparse
import multiprocessing
from pathlib import Path

import gymnasium

import seedbed

NAMES = ["x", "y", "vx", "vy", "angle", "turning", "left leg", "right leg"]


def train(folder: Path, agent: int, steps: int) -> None:
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)
    environment = gymnasium.make("LunarLander-v3")
    environment = seedbed.RecordVisitation(
        environment, folder, agent=agent, names=NAMES, units={"angle": "rad"}, ranges="visited"
    )
    model = PPO("MlpPolicy", environment, seed=agent, n_epochs=4, gamma=0.999, gae_lambda=0.98, ent_coef=0.01, device="cpu")
    model.learn(steps)
    environment.close()


def main() -> None:
    parser = argparse.ArgumentParser(description="Train agents that record where they go.")
    parser.add_argument("--folder", type=Path, default=Path("recordings/lander"), help="[default: recordings/lander]")
    parser.add_argument("--agents", type=int, default=4, help="number of agents [default: 4]")
    parser.add_argument("--steps", type=int, default=150_000, help="environment steps of each agent [default: 150000]")
    arguments = parser.parse_args()
    processes = multiprocessing.get_context("spawn")
    learning = [
        processes.Process(target=train, args=(arguments.folder, agent, arguments.steps)) for agent in range(arguments.agents)
    ]
    for process in learning:
        process.start()
    for process in learning:
        process.join()
    if any(process.exitcode for process in learning):
        raise SystemExit("an agent failed; see its message above")
    print(f"recorded {arguments.folder}; look at it with\n  seedbed explore {arguments.folder} --open")


if __name__ == "__main__":
    main()
