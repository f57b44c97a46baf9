"""Helpers of all tests."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

import seedbed

REPOSITORY = Path(__file__).resolve().parents[2]

MIXED_TASK = """Environment(
    description: "A disc with a switch and a push.",
    gravity: (0.0, 0.0),
    control_step: 0.1,
    time_limit: 20,
    bodies: [(name: "disc", mass: 1.0, geoms: [Ball(radius: 0.1)])],
    joints: [(name: "rail", parent: "world", child: "disc", type: Slide(axis: (1.0, 0.0)))],
    actuators: [
        (name: "switch", type: JointForce("rail"), control: Discrete([-1.0, 0.0, 1.0]), unit: "N"),
        (name: "push", type: JointForce("rail"), control: Continuous(-2.0, 2.0), unit: "N"),
    ],
    sensors: [(name: "x", type: JointPosition("rail")), (name: "x_dot", type: JointVelocity("rail"))],
    observations: [(name: "x", unit: "m", range: (-1.0, 1.0)), (name: "x_dot", unit: "m/s", range: (-1.0, 1.0))],
    reset: [(joint: "rail", position: Uniform(-0.1, 0.1))],
    reward: "x_dot",
    terminated: "abs(x) > 1",
)
"""
"""A task with a discrete and a continuous component of actions."""


def _skipping_fails(report: Any) -> Any:
    if report.skipped and sys.platform == "linux" and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid} was skipped, which tests on Linux must not be: {report.longrepr}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, Any, Any]:
    """A test that is skipped has failed: `python/test` installs all that tests need."""
    return _skipping_fails((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, Any, Any]:
    """As for single tests: a file that is skipped has failed."""
    return _skipping_fails((yield))


@pytest.fixture
def mixed_task(tmp_path: Path) -> Path:
    """Path of a task with a discrete and a continuous component of actions."""
    path = tmp_path / "mixed.ron"
    path.write_text(MIXED_TASK)
    return path


@pytest.fixture
def two_switches(tmp_path: Path) -> Path:
    """Path of a task with two discrete components of actions."""
    path = tmp_path / "two_switches.ron"
    path.write_text(MIXED_TASK.replace("Continuous(-2.0, 2.0)", "Discrete([-2.0, 2.0])"))
    return path


@pytest.fixture(scope="session", autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder of exported tables, so that tests do not use that of the user."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SEEDBED_CACHE", str(folder))
        yield folder


Train = Callable[..., Path]


@pytest.fixture(scope="session")
def train(tmp_path_factory: pytest.TempPathFactory) -> Train:
    """Runs a scenario of the repository with settings, and returns the folder of the run."""

    def run(scenario: str, *settings: str, options: tuple[str, ...] = ()) -> Path:
        folder = tmp_path_factory.mktemp("run") / "results"
        overrides = [part for setting in settings for part in ("--set", setting)]
        path = REPOSITORY / "scenarios" / f"{scenario}.ron"
        command = [seedbed.command(), "run", path, "--out", folder, "--quiet", *overrides, *options]
        subprocess.run(command, check=True, cwd=REPOSITORY)
        return folder

    return run


@pytest.fixture(scope="session")
def cartpole_run(train: Train) -> Path:
    """Folder of a run of `cartpole` with four trained agents. Tests must not change it."""
    return train("cartpole")
