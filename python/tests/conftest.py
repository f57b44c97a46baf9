"""Helpers of all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

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
