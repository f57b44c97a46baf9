#!/usr/bin/env python3
"""Trains PPO of Stable-Baselines3 in known tasks, through the Python package, and writes a file of episodes per run.

    sb3_ppo.py gym_hopper dm_walker_walk --seeds 1000 1001 1002      a run of each task with each seed
    sb3_ppo.py --jobs 2                                               all tasks
    sb3_ppo.py --table > results/sb3.csv                              one row per finished run

Settings are those of RL Zoo for MuJoCo's tasks (`mujoco-defaults`), which are the library's defaults with normalized observations and
rewards, in eight copies with rollouts of 256 steps, which are as many steps per update as one copy with 2048. The step size falls
linearly to 0, as in CleanRL. A run's episodes are written to OUT/TASK/SEED.monitor.csv; finished runs are skipped.

Needs the packages seedbed and stable-baselines3==2.9.2. Each run uses one thread.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import csv
import os
import statistics
import time
from pathlib import Path

COPIES, ROLLOUT = 8, 256

FOLDER = Path(__file__).parent


def train(task: str, seed: int, steps: int, out: Path) -> str:
    """One run. Its file appears when it has ended."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

    import seedbed

    torch.set_num_threads(1)
    file, unfinished = (out / task / f"{seed}.{ending}" for ending in ("monitor.csv", "unfinished.monitor.csv"))
    if file.is_file():
        return f"{task} {seed}: there already"
    unfinished.parent.mkdir(parents=True, exist_ok=True)
    copies = DummyVecEnv([lambda: seedbed.make(task)] * COPIES)
    copies.seed(seed)
    environments = VecNormalize(VecMonitor(copies, str(unfinished)))
    model = PPO("MlpPolicy", environments, n_steps=ROLLOUT, learning_rate=lambda left: 3e-4 * left, seed=seed, device="cpu")
    start = time.process_time()
    model.learn(steps)
    environments.close()
    unfinished.rename(file)
    return f"{task} {seed}: {steps / (time.process_time() - start):.0f} steps per CPU second"


def tasks() -> list[str]:
    """All tasks that have a scenario in this folder."""
    return sorted(path.stem for path in FOLDER.glob("*.ron") if path.stem.startswith(("dm_", "gym_")))


def print_table(out: Path) -> None:
    """Prints the environment steps of all finished runs, and the mean return of the last 100 episodes, as in the study `learning`."""
    print("task,run_seed,env_steps,final_return")
    for file in sorted(out.glob("*/*.monitor.csv")):
        seed = file.name.removesuffix(".monitor.csv")
        if seed.isdigit():
            with file.open() as lines:
                episodes = list(csv.DictReader(line for line in lines if not line.startswith("#")))
            mean = statistics.fmean(float(episode["r"]) for episode in episodes[-100:])
            print(f"{file.parent.name},{seed},{sum(int(episode['l']) for episode in episodes)},{mean:.4f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", help="names of tasks (all that have a scenario here)")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1000, 1001, 1002], help="(1000 1001 1002)")
    parser.add_argument("--steps", type=int, default=1_000_000, help="environment steps of a run, in all copies (1000000)")
    parser.add_argument("--jobs", type=int, default=1, help="simultaneous runs (1)")
    parser.add_argument("--out", type=Path, default=Path("recordings/sb3"), help="(recordings/sb3)")
    parser.add_argument("--table", action="store_true", help="print the results of finished runs, and run nothing")
    arguments = parser.parse_args()
    if arguments.table:
        return print_table(arguments.out)
    with concurrent.futures.ProcessPoolExecutor(arguments.jobs, max_tasks_per_child=1) as pool:
        runs = [
            pool.submit(train, task, seed, arguments.steps, arguments.out)
            for seed in arguments.seeds
            for task in arguments.tasks or tasks()
        ]
        for run in concurrent.futures.as_completed(runs):
            print(run.result(), flush=True)


if __name__ == "__main__":
    main()
