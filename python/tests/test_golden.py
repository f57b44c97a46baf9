"""The bits are those of the workbench: `golden_episodes.txt` is written by `cargo xtask bless`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import seedbed

LINES = (Path(__file__).parent / "golden_episodes.txt").read_text().splitlines()
STEPS = 120


class Hash:
    """The hash of the example in Rust."""

    def __init__(self) -> None:
        self.value = 0

    def add(self, numbers: np.ndarray | list[float]) -> None:
        for bits in np.asarray(numbers, np.float32).view(np.uint32).tolist():
            self.add_bits(bits)

    def add_bits(self, bits: int) -> None:
        self.value = (self.value * 6364136223846793005 + bits + 1) % 2**64


def action(task: seedbed.Task, step: int) -> int | np.ndarray:
    """The action of the example in Rust."""
    values = []
    for index, component in enumerate(task.actions):
        if component.values is not None:
            values.append((step // 3 + index) % len(component.values))
        else:
            low, high = np.float32(component.range)
            values.append(low + (high - low) * (np.float32((5 * step + 3 * index) % 9) / np.float32(8)))
    is_index = len(values) == 1 and task.actions[0].values is not None
    return values[0] if is_index else np.array(values)


def hash_of_single_environment(task: seedbed.Task, physics: str, seed: int) -> int:
    environment, found = seedbed.make(task, physics=physics), Hash()
    found.add(environment.reset(seed=seed)[0])
    for step in range(STEPS):
        observation, reward, terminated, truncated, _ = environment.step(action(task, step))
        found.add(observation)
        found.add([reward])
        found.add_bits(int(terminated))
        if terminated or truncated:
            found.add(environment.reset()[0])
    return found.value


def hash_of_agent(task: seedbed.Task, physics: str, seed: int, agent: int) -> int:
    """The first episode of the last agent of a team, whose other agents may end earlier."""
    team, found, name = seedbed.parallel_env(task, agent + 1, physics=physics), Hash(), f"agent_{agent}"
    found.add(team.reset(seed=seed)[0][name])
    for step in range(STEPS):
        observations, rewards, terminated, _, _ = team.step({one: action(task, step) for one in team.agents})
        found.add(observations[name])
        found.add([rewards[name]])
        found.add_bits(int(terminated[name]))
        if name not in team.agents:
            break
    return found.value


def test_every_task_has_golden_episodes():
    assert sorted({line.split()[0] for line in LINES}) == seedbed.tasks()
    assert len(LINES) > 100


@pytest.mark.parametrize("line", LINES)
def test_episodes_have_the_bits_of_the_workbench(line: str):
    name, physics, seed, agent, expected = line.split()
    task = seedbed.Task(name, run_seed=int(seed))
    if agent == "0":
        found = hash_of_single_environment(task, physics, int(seed))
    else:
        found = hash_of_agent(task, physics, int(seed), int(agent))
    assert f"{found:016x}" == expected
