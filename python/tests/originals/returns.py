#!/usr/bin/env python3
"""Plays episodes of known tasks and of their originals, and prints a table of returns and lengths.

    returns.py                                          all tasks, 60 episodes of random, zero and wave actions each
    returns.py gym_hopper dm_walker_walk                some tasks
    returns.py --episodes 200 --actions waves gym_hopper

    for task in gym_hopper dm_walker_walk; do           # agents that were trained in the tasks
        for seed in 1000 1001 1002; do seedbed run known_tasks/$task --seed $seed --out recordings/trained/$task/seed-$seed; done
    done
    returns.py --trained recordings/trained gym_hopper dm_walker_walk

Wave actions swing once per second over the whole range of each component, one after the other; discrete actions take turns. Trained agents
take their most likely actions; printed is the mean return of each. Other returns are means with standard errors, and quantiles of 10, 50 and
90 %.

Needs the packages seedbed, mujoco, gymnasium[box2d] and dm_control. Run it outside of the folder `python`, whose sources have no native part.
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
    "gym_lunar_lander_continuous": "LunarLanderContinuous-v3",
    "gym_bipedal_walker": "BipedalWalker-v3",
}

SCRIPTED = ["random", "zero", "waves"]

SHORTER_STEPS = 5
"""How many times shorter steps are with stiffer contacts."""

Environments = dict[str, tuple[Any, seedbed.Env]]
"""The original and the task, by the name of the task."""

Controller = Callable[[Any, np.random.Generator, int], Any]
"""The action for an observation, a generator of random numbers, and the number of earlier steps of the episode."""


class SuiteEnv:
    """An environment of the DeepMind Control Suite with the methods of Gymnasium's that are used here."""

    def __init__(self, case: suite_tasks.Case) -> None:
        self.original = suite_tasks.load(case)
        spec = self.original.action_spec()
        self.action_space = gymnasium.spaces.Box(spec.minimum, spec.maximum, dtype=np.float64)

    def reset(self, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        return self.observation(self.original.reset()), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        step = self.original.step(action)
        return self.observation(step), float(step.reward), False, step.last(), {}

    def observation(self, step: Any) -> Any:
        return np.concatenate([np.ravel(value) for value in step.observation.values()])


def stiffen_contacts(env: Any) -> bool:
    """Makes contacts of an environment of MuJoCo stiffer: a time constant of 5 instead of 20 ms, with steps that are five times shorter.

    Returns whether it is one.
    """
    if isinstance(env, SuiteEnv):
        model = env.original.physics.model
        env.original._n_sub_steps *= SHORTER_STEPS
    elif hasattr(env.unwrapped, "model"):
        model = env.unwrapped.model
        env.unwrapped.frame_skip *= SHORTER_STEPS
    else:
        return False
    model.opt.timestep /= SHORTER_STEPS
    model.geom_solref[:, 0] = 0.005
    model.geom_solimp[:, :2] = 0.95
    return True


def originals() -> Iterator[tuple[str, Callable[[], Any]]]:
    """The names of all tasks, and how their originals are made."""
    for case in gymnasium_tasks.CASES:
        yield case.stem, lambda case=case: gymnasium.make(case.id)
    for stem, identifier in BOX2D.items():
        yield stem, lambda identifier=identifier: gymnasium.make(identifier)
    for case in suite_tasks.CASES:
        yield case.file.stem, lambda case=case: SuiteEnv(case)


def play(env: Any, controller: Controller, episodes: int) -> tuple[Any, Any]:
    """Returns and lengths of some episodes, `[episodes]` each."""
    generator, returns, lengths = np.random.default_rng(0), [], []
    env.reset(seed=0)
    for _ in range(episodes):
        observation, _ = env.reset()
        total, length, ended = 0.0, 0, False
        while not ended:
            observation, reward, terminated, truncated, _ = env.step(controller(observation, generator, length))
            total, length, ended = total + float(reward), length + 1, terminated or truncated
        returns.append(total)
        lengths.append(length)
    return np.array(returns), np.array(lengths)


def scripted(kind: str, env: seedbed.Env) -> Controller:
    """A controller that does not look at observations."""
    space, control_step = env.action_space, env.unwrapped.task.control_step
    if isinstance(space, gymnasium.spaces.Discrete):
        count = int(space.n)
        return {
            "random": lambda _, generator, step: int(generator.integers(count)),
            "zero": lambda *_: 0,
            "waves": lambda _, generator, step: int(step * control_step * count) % count,
        }[kind]
    zero, phases = np.zeros(space.shape, space.dtype), np.arange(space.shape[0]) / space.shape[0]
    middle, half = (space.high + space.low) / 2, (space.high - space.low) / 2
    wave = lambda step: middle + half * np.sin(2 * np.pi * (step * control_step + phases))  # noqa: E731
    return {
        "random": lambda _, generator, step: generator.uniform(space.low, space.high).astype(space.dtype),
        "zero": lambda *_: zero,
        "waves": lambda _, generator, step: wave(step).astype(space.dtype),
    }[kind]


def trained(folder: Path) -> list[Controller]:
    """The agents of all runs in a folder, in the order of the names of the runs."""
    policies = [seedbed.load(run).policy(0) for run in sorted(folder.iterdir())]
    return [lambda observation, *_, policy=policy: policy(observation.astype(np.float32)) for policy in policies]


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
    parser.add_argument("--actions", nargs="+", choices=SCRIPTED, default=SCRIPTED, help=f"(default: {' '.join(SCRIPTED)})")
    parser.add_argument("--trained", type=Path, metavar="FOLDER", help="play the agents of the runs FOLDER/TASK/* instead")
    arguments = parser.parse_args()
    known = dict(originals())
    unknown = [name for name in arguments.tasks if name not in known]
    if unknown:
        parser.error(f"unknown task {unknown[0]}, expected one of {', '.join(known)}")
    names = arguments.tasks or list(known)
    environments = {name: (known[name](), seedbed.make(suite_tasks.ENVS / f"{name}.ron")) for name in names}
    if arguments.trained:
        compare_trained(environments, arguments.trained, arguments.episodes)
    else:
        compare_scripted(environments, arguments.actions, arguments.episodes)


def compare_scripted(environments: Environments, kinds: list[str], episodes: int) -> None:
    print("| Task, actions | return of the original | return of the task | length of the original | length of the task |")
    print("|---|---|---|---|---|")
    for name, (original, task) in environments.items():
        for kind in kinds:
            controller = scripted(kind, task)
            played = [play(env, controller, episodes) for env in (original, task)]
            returns = " | ".join(cell(returns) for returns, _ in played)
            lengths = " | ".join(f"{lengths.mean():.4g}" for _, lengths in played)
            print(f"| `{name}`, {kind} | {returns} | {lengths} |", flush=True)


def compare_trained(environments: Environments, folder: Path, episodes: int) -> None:
    print("| Task | in the task | in the original | in the original with stiffer contacts |")
    print("|---|---|---|---|")
    for name, (original, task) in environments.items():
        controllers = trained(folder / name)

        def means(env: Any, controllers: list[Controller] = controllers) -> str:
            return ", ".join(shown(play(env, controller, episodes)[0].mean()) for controller in controllers)

        cells = [means(task), means(original), means(original) if stiffen_contacts(original) else "–"]
        print(f"| `{name}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
