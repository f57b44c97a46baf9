#!/usr/bin/env python3
"""The random search that chose the settings of cartpole_fast.ron.

    scenarios/benchmark/tuning_cartpole_fast.py SEEDBED [--candidates 600] [--threads 2]

SEEDBED is the path of the program. Candidates are drawn from `SPACE` with a fixed seed, and the settings in the file are
one of them. In each stage the candidates with the lowest score stay, and are run with more run seeds, all below 1000; run
seeds from 1000 on are for evaluation. The score of a candidate is the mean number of episodes until solved, where runs
that are not solved count as 800, twice the maximum. The table shows the candidates of the last stage.
"""

import argparse
import json
import random
import statistics
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SCENARIO = Path(__file__).resolve().parents[1] / "cartpole_fast.ron"
UNSOLVED = 800
# Number of candidates that stay, and number of run seeds of each.
STAGES = ((None, 6), (120, 18), (40, 60), (12, 200), (4, 1000))
STEP_SIZES = ("0.001", "0.0015", "0.002", "0.003", "0.004", "0.006", "0.008")
SPACE = {
    "algorithm.epochs": ("2", "4", "6", "8", "12", "16"),
    "algorithm.policy_optimizer.step_size": STEP_SIZES,
    "algorithm.value_optimizer.step_size": STEP_SIZES,
    "algorithm.policy_optimizer.beta2": ("0.99", "0.999"),
    "algorithm.advantage": tuple(f"Gae(lambda: {x})" for x in (0.8, 0.9, 0.95, 0.98, 1)),
    "algorithm.value_target": tuple(f"Gae(lambda: {x})" for x in (0.8, 0.9, 0.95, 0.98, 1)),
    "algorithm.discount": ("0.97", "0.98", "0.99", "0.995"),
    "algorithm.time_limit": ("Ends", "Bootstraps"),
    "algorithm.standardize": ("Off", "PerTrajectory", "PerMinibatch"),
    "algorithm.minibatch": ("Trajectory", "Trajectory", "Steps(16)", "Steps(32)", "Steps(64)"),
    "algorithm.policy_loss": tuple(f"Ppo(clip: {x})" for x in (0.1, 0.2, 0.3, 0.4)),
    "algorithm.observations": ("Range", "Range", "Running"),
    "algorithm.hidden": ("[32, 32]", "[64, 64]", "[64]", "[32]"),
    "algorithm.policy_scale": ("0.01", "0.1", "1"),
    "algorithm.value_scale": ("0", "1"),
    "algorithm.gradient_clip": ("None", "Some(0.5)", "Some(2)"),
    "algorithm.step_size_schedule": (
        "Constant", "Linear(rounds: 60, to: 0.1)", "Linear(rounds: 100, to: 0.1)", "Linear(rounds: 200, to: 0.1)",
    ),
    "algorithm.actions": ("Sampled", "Tempered(temperature: 0.7)", "Tempered(temperature: 0.5)"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seedbed", type=Path)
    parser.add_argument("--candidates", type=int, default=600)
    parser.add_argument("--threads", type=int, default=2, help="number of runs at once")
    arguments = parser.parse_args()
    draws = random.Random(0)
    candidates = [{}] + [
        {path: draws.choice(values) for path, values in SPACE.items()} for _ in range(arguments.candidates - 1)
    ]
    results = {index: [] for index in range(len(candidates))}
    with ThreadPoolExecutor(arguments.threads) as pool:
        for kept, seeds in STAGES:
            remaining = sorted(results, key=lambda index: score(results[index]))[:kept]
            results = {index: results[index] for index in remaining}
            tasks = [(index, seed) for index in remaining for seed in range(len(results[index]), seeds)]
            episodes = pool.map(lambda task: run(arguments.seedbed, candidates[task[0]], task[1]), tasks)
            for (index, _), result in zip(tasks, episodes):
                results[index].append(result)
            best = min(results, key=lambda index: score(results[index]))
            print(f"{len(results)} candidates, {seeds} run seeds: {describe(results[best])}", flush=True)
    for index in sorted(results, key=lambda index: score(results[index])):
        print(f"\n{describe(results[index])}")
        for path, value in candidates[index].items():
            print(f"  --set '{path}={value}'")


def score(results):
    """Mean number of episodes; 0 before the first run."""
    return statistics.fmean(episodes or UNSOLVED for episodes, _ in results) if results else 0.0


def describe(results):
    solved = [episodes for episodes, _ in results if episodes]
    return (
        f"score {score(results):.1f}, solved {len(solved)} of {len(results)}, "
        f"median {statistics.median(episodes or UNSOLVED for episodes, _ in results):g} episodes "
        f"and {statistics.median(steps for _, steps in results):g} steps, largest {max(solved, default=None)}"
    )


def run(seedbed, candidate, seed):
    """Episodes until solved (`None`: unsolved) and environment steps of one run."""
    with tempfile.TemporaryDirectory() as folder:
        command = [seedbed, "run", SCENARIO, "--quiet", "--no-recording", "--threads", "1"]
        command += ["--seed", str(seed), "--out", Path(folder, "run")]
        for path, value in candidate.items():
            command += ["--set", f"{path}={value}"]
        # A candidate whose numbers diverge ends with an error, and counts as unsolved.
        if subprocess.run(command, stderr=subprocess.DEVNULL).returncode:
            return None, UNSOLVED * 200
        summary = json.loads(Path(folder, "run/summary.json").read_text())
        return summary["episodes_until_solved"], summary["env_steps"]


if __name__ == "__main__":
    main()
