"""The example of an algorithm of one's own learns, and its run is read like any other."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY

import seedbed

SCRIPT = REPOSITORY / "python/examples/reinforce.py"


@pytest.fixture(scope="module")
def reinforce() -> Any:
    spec = importlib.util.spec_from_file_location("reinforce", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("seed", range(3))
def test_agents_learn(reinforce: Any, tmp_path: Path, seed: int):
    """The means of agents that do not learn are below 60 (a random agent's is about 20)."""
    folder = tmp_path / "run"
    finished = reinforce.train(folder, run_seed=seed)
    last = [np.mean(returns[-25:]) for returns in finished]
    assert min(last) >= 100 and np.mean(last) >= 150, last
    idle = reinforce.train(tmp_path / "idle", episodes=25, step_size=0.0, run_seed=seed)
    assert np.mean([np.mean(returns) for returns in idle]) < 60
    check_recording(folder, finished)


def check_recording(folder: Path, finished: list[list[float]]) -> None:
    """`seedbed inspect` and `seedbed.load` have the returns of the script."""
    command = [seedbed.command(), "inspect", folder, "--json"]
    inspected = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert inspected["agent_count"] == 4
    run = seedbed.load(folder, frames="pandas")
    assert run.agents == 4 and run.state == "finished"
    for agent, returns in run.episodes.groupby("agent")["return"]:
        assert returns.tolist() == finished[int(agent)]
    steps = sum(sum(returns) for returns in finished)
    assert len(run.states) == steps + sum(map(len, finished))


def test_the_gradient_is_that_of_the_expected_return(reinforce: Any):
    """Central differences of the sum of advantages times log-probabilities."""
    rng = np.random.default_rng(0)
    inputs, actions, rewards = rng.normal(size=(6, 4)), rng.integers(0, 2, 6), rng.normal(size=6)
    weights = rng.normal(size=4)
    returns = np.array([sum(0.99 ** (later - step) * rewards[later] for later in range(step, 6)) for step in range(6)])
    advantages = (returns - returns.mean()) / returns.std()

    def objective(weights: np.ndarray) -> float:
        right = 1 / (1 + np.exp(-inputs @ weights))
        return float((advantages * np.log(np.where(actions == 1, right, 1 - right))).mean())

    steps = 1e-6 * np.eye(4)
    expected = [(objective(weights + step) - objective(weights - step)) / 2e-6 for step in steps]
    found = reinforce.policy_gradient(list(inputs), list(actions), list(rewards), weights)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_the_page_quotes_the_script():
    page = (REPOSITORY / "docs/own_algorithm_in_python.md").read_text()
    quoted = [block for block in re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE) if "def " in block]
    assert len(quoted) == 3
    assert all(block in SCRIPT.read_text() for block in quoted)


def test_the_script(tmp_path: Path):
    command = [sys.executable, SCRIPT, "--episodes", "30", "--agents", "2", "--seed", "7"]
    first, second = (
        subprocess.run([*command, *more], check=True, capture_output=True, text=True, cwd=tmp_path).stdout
        for more in ([], ["--overwrite"])
    )
    assert first == second and "agent 1: mean return" in first
    assert seedbed.load(tmp_path / "recordings/reinforce").agents == 2
