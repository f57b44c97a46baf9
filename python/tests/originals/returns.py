#!/usr/bin/env python3
"""Plays episodes of known tasks and of their originals, and prints a table of returns and lengths.

    returns.py                                  all tasks, 60 episodes of random and of zero actions each
    returns.py gym_hopper dm_walker_walk        some tasks
    returns.py --episodes 200 gym_hopper

Needs the packages seedbed, mujoco, gymnasium[box2d] and dm_control. Run it outside of the folder `python`, whose sources
have no native part. Returns are means with standard errors, and quantiles of 10, 50 and 90 %.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
warnings.simplefilter("ignore")

import gymnasium  # noqa: E402
import test_dm_control_tasks as suite_tasks  # noqa: E402
import test_gymnasium_tasks as gymnasium_tasks  # noqa: E402

import seedbed  # noqa: E402

BOX2D = {
    "gym_lunar_lander": "LunarLander-v3",
    "gym_bipedal_walker": "BipedalWalker-v3",
}

Action = Callable[[np.random.Generator], Any]


class SuiteEnv:
    """An environment of the DeepMind Control Suite with the methods of Gymnasium's that are used here."""

    def __init__(self, case: suite_tasks.Case) -> None:
        self.original = suite_tasks.load(case)
        spec = self.original.action_spec()
        self.action_space = gymnasium.spaces.Box(spec.minimum, spec.maximum, dtype=np.float64)

    def reset(self, seed: int | None = None) -> None:
        self.original.reset()

    def step(self, action: Any) -> tuple[None, float, bool, bool, dict[str, Any]]:
        step = self.original.step(action)
        return None, float(step.reward), False, step.last(), {}


def originals() -> Iterator[tuple[str, Callable[[], Any]]]:
    """The names of all tasks, and how their originals are made."""
    for case in gymnasium_tasks.CASES:
        yield case.stem, lambda case=case: gymnasium.make(case.id)
    for stem, identifier in BOX2D.items():
        yield stem, lambda identifier=identifier: gymnasium.make(identifier)
    for case in suite_tasks.CASES:
        yield case.file.stem, lambda case=case: SuiteEnv(case)


def play(env: Any, action: Action, episodes: int) -> tuple[Any, Any]:
    """Returns and lengths of some episodes, `[episodes]` each."""
    generator, returns, lengths = np.random.default_rng(0), [], []
    env.reset(seed=0)
    for _ in range(episodes):
        env.reset()
        total, length, ended = 0.0, 0, False
        while not ended:
            _, reward, terminated, truncated, _ = env.step(action(generator))
            total, length, ended = total + reward, length + 1, terminated or truncated
        returns.append(total)
        lengths.append(length)
    return np.array(returns), np.array(lengths)


def actions(space: Any) -> dict[str, Action]:
    """Random actions and actions that do nothing."""
    if isinstance(space, gymnasium.spaces.Discrete):
        return {"random": lambda generator: int(generator.integers(space.n)), "zero": lambda _: 0}
    zero = np.zeros(space.shape, space.dtype)
    return {"random": lambda generator: generator.uniform(space.low, space.high).astype(space.dtype), "zero": lambda _: zero}


def shown(value: float, digits: int = 3) -> str:
    """A number with this many digits; nearly nothing is 0."""
    return np.format_float_positional(value, digits, fractional=False, trim="-") if abs(value) >= 5e-4 else "0"


def cell(values: Any) -> str:
    quantiles = " ".join(map(shown, np.quantile(values, (0.1, 0.5, 0.9))))
    return f"{shown(values.mean())} ± {shown(values.std() / np.sqrt(len(values)), 2)} [{quantiles}]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", help="names of tasks (default: all)")
    parser.add_argument("--episodes", type=int, default=60, help="episodes of each kind (default: 60)")
    arguments = parser.parse_args()
    known = dict(originals())
    unknown = [name for name in arguments.tasks if name not in known]
    if unknown:
        parser.error(f"unknown task {unknown[0]}, expected one of {', '.join(known)}")
    print("| Task, actions | return of the original | return of the task | length of the original | length of the task |")
    print("|---|---|---|---|---|")
    for name in arguments.tasks or known:
        ours, theirs = seedbed.make(suite_tasks.ENVS / f"{name}.ron"), known[name]()
        for kind in ("random", "zero"):
            played = [play(env, actions(env.action_space)[kind], arguments.episodes) for env in (theirs, ours)]
            returns = " | ".join(cell(returns) for returns, _ in played)
            lengths = " | ".join(f"{lengths.mean():.4g}" for _, lengths in played)
            print(f"| `{name}`, {kind} | {returns} | {lengths} |", flush=True)


if __name__ == "__main__":
    main()
