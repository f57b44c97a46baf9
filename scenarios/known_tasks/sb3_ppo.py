#!/usr/bin/env python3
"""Trains PPO of Stable-Baselines3 in known tasks, through the Python package, and writes a file of episodes per run.

    sb3_ppo.py gym_hopper dm_walker_walk --seeds 1000 1001 1002       a run of each task with each seed
    sb3_ppo.py --jobs 2                                               all tasks
    sb3_ppo.py half_cheetah hopper walker2d --out recordings/sb3_originals      in Gymnasium's originals: ../gymnasium
    seedbed study recordings/sb3/stable_baselines3.ron                tables and figures of all finished runs

Settings are those of the task's scenario in this folder: steps, steps per update, step size and its fall, discount factor, lambda and initial
noise. The others are the library's defaults, which are those of the scenarios too (ten passes over minibatches of 64 steps, a clip of 0.2, two
layers of 64 units), with normalized observations and rewards. Updates use eight copies of the task. Bonuses for new states are left out: the
library has none. A run's episodes are written to OUT/TASK/SEED.monitor.csv, and a study that reads them to OUT; finished runs are skipped.

Needs the packages seedbed and stable-baselines3==2.9.2. Each run uses one thread.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import math
import os
import re
import time
from pathlib import Path

COPIES = 8

FOLDERS = [Path(__file__).parent, Path(__file__).parent.parent / "gymnasium"]


def train(task: str, seed: int, shorter: int, out: Path) -> str:
    """One run. Its file appears when it has ended."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import gymnasium
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

    import seedbed

    torch.set_num_threads(1)
    torch.distributions.Distribution.set_default_validate_args(False)  # checks of parameters, a tenth of the time
    file = out / task / f"{seed}.monitor.csv"
    unfinished = out / task / "unfinished" / f"{seed}-{os.getpid()}.monitor.csv"  # another process may make the same run
    if file.is_file():
        return f"{task} {seed}: there already"
    unfinished.parent.mkdir(parents=True, exist_ok=True)

    settings = Settings.of(task)

    def copy() -> gymnasium.Env:
        environment = gymnasium.make(settings.original) if settings.original else seedbed.make(task)
        box = isinstance(environment.action_space, gymnasium.spaces.Box)
        return gymnasium.wrappers.RescaleAction(environment, -1.0, 1.0) if box else environment

    copies = DummyVecEnv([copy] * COPIES)
    copies.seed(seed)
    environments = VecNormalize(VecMonitor(copies, str(unfinished)), gamma=settings.discount)
    model = PPO(
        "MlpPolicy",
        environments,
        n_steps=settings.rollout,
        gamma=settings.discount,
        gae_lambda=settings.gae_lambda,
        learning_rate=lambda left: settings.step_size * (0.1 + 0.9 * left),
        policy_kwargs={"log_std_init": math.log(settings.initial_deviation), "optimizer_kwargs": {"eps": 1e-5, "fused": True}},
        seed=seed,
        device="cpu",
    )
    steps = settings.steps // shorter
    start = time.process_time()
    model.learn(steps)
    environments.close()
    unfinished.rename(file)
    return f"{task} {seed}: {steps / (time.process_time() - start):.0f} steps per CPU second"


@dataclasses.dataclass
class Settings:
    """What differs between the scenarios."""

    original: str | None
    """Id of an environment of Gymnasium."""
    steps: int
    """Environment steps of a run, in all copies."""
    rollout: int
    """Environment steps of an update in one copy."""
    step_size: float
    discount: float
    gae_lambda: float
    initial_deviation: float

    @staticmethod
    def of(task: str) -> Settings:
        """The settings of the scenario TASK.ron."""
        import gymnasium

        import seedbed

        scenario = next(file for folder in FOLDERS if (file := folder / f"{task}.ron").is_file()).read_text()
        original = re.search(r'environment: "(\w+-v\d+)"', scenario)

        def number(before: str, otherwise: float | None = None) -> float:
            found = re.search(re.escape(before) + r"\s*([0-9.]+)", scenario)
            return float(found[1]) if found else float(otherwise)

        if episodes := number("stop: Episodes(", 0):
            length = gymnasium.spec(original[1]).max_episode_steps if original else seedbed.Task(task).time_limit
            steps, update = episodes * length, number("episodes:") * length
        else:
            steps = number("stop: Steps(team:")
            update = steps / number("step_size_schedule: Linear(rounds:")
        return Settings(
            original=original[1] if original else None,
            steps=int(steps),
            rollout=8 * round(update / COPIES / 8),  # whole minibatches of 64 steps
            step_size=number("policy_optimizer: (step_size:"),
            discount=number("discount:", 0.99),
            gae_lambda=number("advantage: Gae(lambda:"),
            initial_deviation=number("initial_deviation:", 0.5),
        )


def tasks() -> list[str]:
    """All tasks that have a scenario in this folder."""
    return sorted(path.stem for path in FOLDERS[0].glob("*.ron") if path.stem.startswith(("dm_", "gym_")))


def write_study(out: Path) -> Path:
    """Writes a study of all tasks with finished runs, with the measure of the study `learning`."""
    cell = '        (name: "{0}", task: "{0}", results: Monitor("{0}/*.monitor.csv")),\n'
    folders = sorted(folder for folder in out.iterdir() if folder.is_dir())
    finished = [folder.name for folder in folders if any(folder.glob("*.monitor.csv"))]
    is_here = any(name in tasks() for name in finished)
    file = out / ("stable_baselines3.ron" if is_here else "sb3_originals.ron")
    where = "the known tasks" if is_here else "Gymnasium's originals"
    file.write_text(f"""// The episodes that `scenarios/known_tasks/sb3_ppo.py` has written.
Study(
    title: "PPO of Stable-Baselines3 in {where}",
    about: "The settings of the scenarios in scenarios/{'known_tasks' if is_here else 'gymnasium'}, as far as Stable-Baselines3 has them, and as many environment steps.",
    cells: [
{"".join(cell.format(task) for task in finished)}    ],
    measures: [FinalReturn(window: 100)],
    figures: [Curves(window: 100)],
)
""")
    return file


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", help="names of tasks (all that have a scenario here)")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1000, 1001, 1002], help="(1000 1001 1002)")
    parser.add_argument("--shorter", type=int, default=1, help="how many times shorter than the scenario, to try the script (1)")
    parser.add_argument("--jobs", type=int, default=1, help="simultaneous runs (1)")
    parser.add_argument("--out", type=Path, default=Path("recordings/sb3"), help="(recordings/sb3)")
    arguments = parser.parse_args()
    with concurrent.futures.ProcessPoolExecutor(arguments.jobs, max_tasks_per_child=1) as pool:
        runs = [
            pool.submit(train, task, seed, arguments.shorter, arguments.out)
            for seed in arguments.seeds
            for task in arguments.tasks or tasks()
        ]
        for run in concurrent.futures.as_completed(runs):
            print(run.result(), flush=True)
    print(f"seedbed study {write_study(arguments.out)}")


if __name__ == "__main__":
    main()
