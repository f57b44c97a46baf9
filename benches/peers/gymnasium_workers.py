"""Steps per second of wall time of an environment of Gymnasium with random actions: as a task of the program
`seedbed` with one or more workers, in a loop of Python, and with Gymnasium's `AsyncVectorEnv`; in turn, several times.

    benches/peers/gymnasium_workers.py target/release/seedbed CartPole-v1
    benches/peers/gymnasium_workers.py target/release/seedbed HalfCheetah-v5 --workers 1 2
    benches/peers/gymnasium_workers.py target/release/seedbed benches/peers/upright_cart_pole.py:make_upright

With random actions a pole falls after 22 steps, and agents whose pole has fallen wait for the others of their round: in the
third example all play for 500 steps.

Needs a Python with the environment and free cores. Ratios are those of the medians.
"""

import argparse
import importlib.util
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium


def maker(name: str) -> Callable[[], gymnasium.Env]:
    """What makes the environment with an id, or that of a function in a file."""
    file, _, function = name.rpartition(":")
    if not file.endswith(".py"):
        return lambda: gymnasium.make(name)
    specification = importlib.util.spec_from_file_location(Path(file).stem, file)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return getattr(module, function)


def loop(name: str, seconds: float) -> float:
    environment = maker(name)()
    environment.action_space.seed(0)
    actions = [environment.action_space.sample() for _ in range(1000)]
    environment.reset(seed=0)
    steps, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        for action in actions:
            _, _, terminated, truncated, _ = environment.step(action)
            if terminated or truncated:
                environment.reset()
        steps += len(actions)
    return steps / (time.perf_counter() - start)


def asynchronous(name: str, copies: int, seconds: float) -> float:
    environments = gymnasium.vector.AsyncVectorEnv([maker(name)] * copies)
    environments.action_space.seed(0)
    actions = [environments.action_space.sample() for _ in range(100)]
    environments.reset(seed=0)
    steps, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        for action in actions:
            environments.step(action)
        steps += copies * len(actions)
    rate = steps / (time.perf_counter() - start)
    environments.close()
    return rate


def workbench(program: str, name: str, copies: int, workers: int, episodes: int) -> float:
    """Without the time in which workers start."""
    few, many = (run(program, name, copies, workers, count) for count in (2, episodes))
    return (many[0] - few[0]) / (many[1] - few[1])


def run(program: str, name: str, copies: int, workers: int, episodes: int) -> tuple[int, float]:
    """Environment steps and seconds of a run."""
    absolute = os.path.abspath(name) if ".py:" in name else name
    scenario = (
        f'Scenario(environment: Gymnasium(id: "{absolute}", workers: {workers}, probe_steps: 1000), agents: (count: {copies}), '
        f"algorithm: Random, stop: Episodes({episodes}))"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "random.ron"
        path.write_text(scenario)
        command = [program, "run", path, "--no-recording", "--out", f"{folder}/run", "--threads", str(workers)]
        environment = {**os.environ, "SEEDBED_PYTHON": sys.executable}
        result = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    steps, seconds = re.search(r"(\d+) env steps in ([0-9.]+) s", result.stdout).groups()
    return int(steps), float(seconds)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("program")
parser.add_argument("environment")
parser.add_argument("--copies", type=int, default=16)
parser.add_argument("--workers", type=int, nargs="+", default=[1])
parser.add_argument("--repeats", type=int, default=5)
parser.add_argument("--seconds", type=float, default=2.0)
arguments = parser.parse_args()

name, copies = arguments.environment, arguments.copies
mean_length = 22 if name.startswith("CartPole") else 500 if "upright" in name else 1000
rate = loop(name, 0.5)
episodes = max(4, round(4 * arguments.seconds * rate / copies / mean_length))
methods = {"loop of Python": lambda: loop(name, arguments.seconds)}
methods[f"AsyncVectorEnv, {copies} copies"] = lambda: asynchronous(name, copies, arguments.seconds)
for workers in arguments.workers:
    label = f"seedbed, {copies} copies, {workers} worker{'s' if workers > 1 else ''}"
    methods[label] = lambda workers=workers: workbench(arguments.program, name, copies, workers, workers * episodes)
rates: dict[str, list[float]] = {label: [] for label in methods}
for _ in range(arguments.repeats):
    for label, method in methods.items():
        rates[label].append(method())
base = statistics.median(rates["loop of Python"])
for label, values in rates.items():
    median = statistics.median(values)
    print(f"{label:38} {median:10.0f} steps/s ({min(values):.0f} to {max(values):.0f}), {median / base:.2f} of the loop")
