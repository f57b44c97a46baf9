#!/usr/bin/env python3
"""Trains SAC of Stable-Baselines3 in Gymnasium's originals with the usual settings of `originals.ron`, and writes a file of episodes per run.

    sb3_sac.py --seeds 1000 1001 1002                          a run of each task with each seed: an hour and a half on two cores
    seedbed study recordings/sb3_sac/sb3_sac.ron               tables and figures of all finished runs

Equal are the numbers of environment and gradient steps, random steps at first, networks, minibatches, step sizes, discount factor, target rate and the
target of the entropy. A run's episodes are written to OUT/TASK/SEED.monitor.csv, and a study that reads them to OUT; finished runs are skipped.

Needs the packages seedbed and stable-baselines3==2.9.2 with gymnasium[mujoco]. Each run uses one thread.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import os
import time
from pathlib import Path

TASKS = ["HalfCheetah-v5", "Hopper-v5", "Walker2d-v5"]


def train(task: str, seed: int, steps: int, out: Path) -> str:
    """One run. Its file appears when it has ended."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import gymnasium
    import torch
    from stable_baselines3 import SAC
    from stable_baselines3.common.monitor import Monitor

    torch.set_num_threads(1)
    torch.distributions.Distribution.set_default_validate_args(False)  # checks of parameters, a tenth of the time
    file = out / task / f"{seed}.monitor.csv"
    unfinished = out / task / "unfinished" / f"{seed}-{os.getpid()}.monitor.csv"  # another process may make the same run
    if file.is_file():
        return f"{task} {seed}: there already"
    unfinished.parent.mkdir(parents=True, exist_ok=True)

    model = SAC(
        "MlpPolicy",
        Monitor(gymnasium.make(task), str(unfinished)),
        learning_rate=3e-4,
        buffer_size=1_000_000,
        learning_starts=5000,
        batch_size=128,
        policy_kwargs={"net_arch": [128, 128]},
        seed=seed,
        device="cpu",
    )
    start = time.process_time()
    model.learn(steps)
    unfinished.rename(file)
    return f"{task} {seed}: {steps / (time.process_time() - start):.0f} steps per CPU second"


def write_study(out: Path) -> Path:
    """Writes a study of all tasks with finished runs, with the measure of `originals.ron`."""
    cell = '        (name: "{0}", task: "{0}", results: Monitor("{0}/*.monitor.csv")),\n'
    finished = [task for task in TASKS if any((out / task).glob("*.monitor.csv"))]
    file = out / "sb3_sac.ron"
    file.write_text(f"""// The episodes that `scenarios/soft_actor_critic/sb3_sac.py` has written.
Study(
    title: "SAC of Stable-Baselines3 in Gymnasium's originals",
    about: "The usual settings of scenarios/soft_actor_critic/originals.ron, and as many environment and gradient steps.",
    cells: [
{"".join(cell.format(task) for task in finished)}    ],
    measures: [FinalReturn(window: 20)],
    figures: [Curves(window: 20)],
)
""")
    return file


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", default=TASKS, help=f"({' '.join(TASKS)})")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1000, 1001, 1002], help="(1000 1001 1002)")
    parser.add_argument("--steps", type=int, default=200_000, help="environment steps of a run (200000)")
    parser.add_argument("--jobs", type=int, default=1, help="simultaneous runs (1)")
    parser.add_argument("--out", type=Path, default=Path("recordings/sb3_sac"), help="(recordings/sb3_sac)")
    arguments = parser.parse_args()
    with concurrent.futures.ProcessPoolExecutor(arguments.jobs, max_tasks_per_child=1) as pool:
        runs = [pool.submit(train, task, seed, arguments.steps, arguments.out) for seed in arguments.seeds for task in arguments.tasks]
        for run in concurrent.futures.as_completed(runs):
            print(run.result(), flush=True)
    print(f"seedbed study {write_study(arguments.out)}")


if __name__ == "__main__":
    main()
