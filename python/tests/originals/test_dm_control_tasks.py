"""The tasks `dm_*` are those of the DeepMind Control Suite.

Observations and rewards are compared with the suite's own code in the same states, motion without contacts and limits
with MuJoCo at a small timestep, and start states with many of the suite's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from dm_control import suite
from reference import (
    ENVS,
    Vector,
    free_motion,
    make_text,
    mujoco_state,
    start_options,
    task_motion,
    with_iterations,
    without_contacts,
)

import seedbed

STATES = 300
"""Number of states in which observations and rewards are compared."""

Generator = np.random.Generator
Near = Callable[[Generator, Any, Vector, Vector], dict[str, float]]
"""Changes positions and velocities such that a reward is likely; returns numbers of the episode, by name."""


@dataclass(frozen=True)
class Case:
    """A task and what is special about it."""

    domain: str
    task: str
    speed: float = 1.0
    """Standard deviation of random velocities, m/s or rad/s."""
    near: Near = field(default=lambda generator, physics, qpos, qvel: {})
    set_numbers: Callable[[Any, dict[str, float]], None] = field(default=lambda physics, numbers: None)
    """Puts numbers of the episode into the suite's model."""
    uncompared: tuple[str, ...] = ()
    """The suite's observations that depend on forces, which are not functions of the state."""
    settles: bool = False
    """The suite simulates before an episode starts: the task's start states only resemble the suite's."""

    @property
    def file(self) -> Path:
        return ENVS / f"dm_{self.domain}_{self.task}.ron"


def near_upright(generator: Generator, physics: Any, qpos: Vector, qvel: Vector) -> dict[str, float]:
    """All hinges are almost upright."""
    slides = physics.model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
    qpos[~slides] = generator.normal(0, 0.12, (~slides).sum())
    qpos[slides] = generator.uniform(-0.4, 0.4, slides.sum())
    return {}


def near_middle(generator: Generator, physics: Any, qpos: Vector, qvel: Vector) -> dict[str, float]:
    qpos[:] = generator.uniform(-0.03, 0.03, len(qpos))
    return {}


def near_finger(generator: Generator, physics: Any, qpos: Vector, qvel: Vector) -> dict[str, float]:
    """The target of a reacher is near its finger."""
    ends = np.cumsum(qpos)
    x, y = 0.12 * np.cos(ends).sum(), 0.12 * np.sin(ends).sum()
    x, y = generator.normal((x, y), 0.03)
    return {"target_angle": float(np.arctan2(x, y)), "target_radius": float(np.hypot(x, y))}


def set_reacher_target(physics: Any, numbers: dict[str, float]) -> None:
    angle, radius = numbers["target_angle"], numbers["target_radius"]
    physics.named.model.geom_pos["target", ["x", "y"]] = radius * np.sin(angle), radius * np.cos(angle)


def near_cup(generator: Generator, physics: Any, qpos: Vector, qvel: Vector) -> dict[str, float]:
    """The ball is in the cup or next to it."""
    qpos[2:] = qpos[:2] + (0, 0.35) + generator.uniform(-0.04, 0.04, 2)
    return {}


def near_threshold(generator: Generator, physics: Any, qpos: Vector, qvel: Vector) -> dict[str, float]:
    """A spinner turns about as fast as is rewarded."""
    qvel[2] = generator.normal(-15, 1)
    return {}


def near_target(generator: Generator, physics: Any, qpos: Vector, qvel: Vector) -> dict[str, float]:
    """The tip of a finger's spinner is near its target."""
    return {"target_angle": float(generator.normal(-qpos[2], 0.4))}


def set_finger_target(physics: Any, numbers: dict[str, float]) -> None:
    angle = numbers["target_angle"]
    physics.named.model.site_pos["target", ["x", "z"]] = 0.2 + 0.13 * np.sin(angle), 0.4 + 0.13 * np.cos(angle)


CASES = [
    Case("cartpole", "balance", near=near_upright),
    Case("cartpole", "balance_sparse", near=near_upright),
    Case("cartpole", "swingup", near=near_upright),
    Case("cartpole", "swingup_sparse", near=near_upright),
    Case("pendulum", "swingup", near=near_upright),
    Case("acrobot", "swingup", near=near_upright),
    Case("acrobot", "swingup_sparse", near=near_upright),
    Case("point_mass", "easy", speed=0.1, near=near_middle),
    Case("reacher", "easy", near=near_finger, set_numbers=set_reacher_target),
    Case("reacher", "hard", near=near_finger, set_numbers=set_reacher_target),
    Case("walker", "stand"),
    Case("walker", "walk"),
    Case("walker", "run", speed=4.0),
    Case("cheetah", "run", speed=4.0, settles=True),
    Case("hopper", "stand", near=near_upright, uncompared=("touch",)),
    Case("hopper", "hop", speed=2.0, near=near_upright, uncompared=("touch",)),
    Case("ball_in_cup", "catch", near=near_cup),
    Case("finger", "spin", speed=5.0, near=near_threshold, uncompared=("touch",)),
    Case("finger", "turn_easy", near=near_target, set_numbers=set_finger_target, uncompared=("touch",)),
    Case("finger", "turn_hard", near=near_target, set_numbers=set_finger_target, uncompared=("touch",)),
]


def load(case: Case) -> Any:
    """The suite's environment, after its first reset."""
    original = suite.load(case.domain, case.task, task_kwargs={"random": 0})
    original.reset()
    return original


def random_positions(generator: Generator, physics: Any) -> Vector:
    """Positions over the ranges of joints, or a full turn, or a meter."""
    model = physics.model
    hinges = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    widths = np.where(hinges, np.pi, 0.5)
    low, high = np.where(model.jnt_limited[:, None], model.jnt_range, np.stack([-widths, widths], 1)).T
    return generator.uniform(low, high)


def view(case: Case, original: Any, qpos: Vector, qvel: Vector, control: Vector, numbers: dict[str, float]) -> tuple[Vector, float]:
    """Observation and reward that the suite's code computes in a state."""
    physics = original.physics
    case.set_numbers(physics, numbers)
    physics.set_control(control)
    physics.data.qpos[:], physics.data.qvel[:] = qpos, qvel
    physics.forward()
    observed = original.task.get_observation(physics)
    parts = [np.full_like(np.ravel(value), np.nan) if name in case.uncompared else np.ravel(value) for name, value in observed.items()]
    return np.concatenate(parts), original.task.get_reward(physics)


def largest_difference(observation: Any, expected: Vector) -> float:
    """Largest difference of observations, relative to values above 1; those that are not compared are NaN."""
    return float(np.nanmax(np.abs(observation - expected) / np.maximum(1, np.abs(expected))))


def start(case: Case, original: Any, env: seedbed.Env, generator: Generator, is_near: bool) -> Vector:
    """Starts an episode in a random state, in which a reward is likely if `is_near`, and returns the observation."""
    physics, model = original.physics, original.physics.model.ptr
    qpos, qvel = random_positions(generator, physics), generator.normal(0, case.speed, model.nv)
    numbers = case.near(generator, physics, qpos, qvel) if is_near else {}
    return env.reset(options=start_options(model, qpos, qvel) | {"numbers": numbers})[0].astype(np.float64)


def compare(case: Case, original: Any, env: seedbed.Env, observation: Any, control: Any, reward: float | None) -> None:
    """Compares an observation and, after a step, a reward of the task with those of the suite in the task's state."""
    qpos, qvel = mujoco_state(env, original.physics.model.ptr)
    expected, expected_reward = view(case, original, qpos, qvel, control, env.coordinates()["numbers"])
    assert largest_difference(observation, expected) < 1e-5
    if reward is not None:
        assert reward == pytest.approx(expected_reward, abs=1e-5)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.file.stem)
def test_observations_and_rewards_are_those_of_the_suite(case: Case):
    """Single precision leaves errors of about 1e-7 of the coordinates, at most some 10 rad; formulas add as much again."""
    original, env, generator = load(case), seedbed.make(case.file), np.random.default_rng(0)
    rewards = []
    for state in range(STATES):
        observation = start(case, original, env, generator, is_near=state % 2 == 1)
        control = generator.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        compare(case, original, env, observation, control, None)
        stepped, reward, terminated, truncated, _ = env.step(control)
        assert not terminated and not truncated
        compare(case, original, env, stepped, control, reward)
        rewards.append(reward)
    assert np.std(rewards) > 0.05, "rewards do not differ: the states test nothing"


def test_episodes_are_as_long_as_in_the_suite():
    for case in CASES:
        original, task = load(case), seedbed.Task(case.file)
        assert task.control_step == pytest.approx(original.control_timestep())
        assert task.time_limit == int(np.ceil(original._step_limit - 1e-9))


@dataclass(frozen=True)
class Motion:
    """How far a task may be from MuJoCo after some steps of random controls."""

    case: Case
    steps: int
    tolerance: float
    """Largest difference of positions, m or rad, over ten trajectories."""
    ratio: float = 3.0
    """How much smaller the error is at least with four times as many substeps."""


def case_of(domain: str, task: str) -> Case:
    return next(case for case in CASES if (case.domain, case.task) == (domain, task))


MOTIONS = [
    Motion(case_of("cartpole", "balance"), 100, 0.01),
    Motion(case_of("pendulum", "swingup"), 30, 0.15),
    Motion(case_of("acrobot", "swingup"), 100, 0.02),
    Motion(case_of("point_mass", "easy"), 100, 1e-3),
    Motion(case_of("reacher", "easy"), 10, 0.03),
    Motion(case_of("walker", "stand"), 10, 0.2),
    Motion(case_of("cheetah", "run"), 50, 0.2),
    Motion(case_of("hopper", "stand"), 40, 0.2),
    Motion(case_of("ball_in_cup", "catch"), 20, 0.006),
    # Dry friction of the spinner is soft in MuJoCo.
    Motion(case_of("finger", "spin"), 20, 0.03, ratio=2.0),
    Motion(case_of("finger", "turn_easy"), 20, 0.03, ratio=2.0),
]


def position_errors(motion: Motion, factor: int, folder: Path) -> Vector:
    """Differences of positions from MuJoCo's without contacts and limits, `[trajectories, steps, joints]`."""
    text = without_contacts(seedbed.Task(motion.case.file).text)
    env = make_text(with_iterations(text, factor), folder)
    errors = []
    for seed in range(10):
        physics, generator = load(motion.case).physics, np.random.default_rng(seed)
        model = physics.model.ptr
        qpos, qvel = random_positions(generator, physics), generator.normal(0, motion.case.speed, model.nv)
        controls = generator.uniform(-1, 1, (motion.steps, model.nu)).astype(np.float32)
        expected = free_motion(model, qpos, qvel, controls, env.task.control_step)
        errors.append(np.abs(task_motion(env, model, qpos, qvel, controls) - expected)[:, : model.nq])
    return np.array(errors)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.case.file.stem)
def test_motion_converges_to_mujoco(motion: Motion, tmp_path: Path):
    """The error is within the tolerance, and inversely proportional to the number of substeps."""
    once, fourfold = (position_errors(motion, factor, tmp_path) for factor in (1, 4))
    assert once.max() < motion.tolerance
    assert once.max() > motion.tolerance / 10, "the tolerance is too loose to test anything"
    ratio = np.sqrt(np.mean(once**2) / np.mean(fourfold**2))
    assert motion.ratio < ratio < 6


def starts_of_the_suite(case: Case, original: Any) -> Vector:
    """Positions, velocities and observations at 400 starts, without those that depend on forces."""
    starts = []
    for _ in range(400):
        observed = original.reset().observation
        parts = [np.ravel(value) for name, value in observed.items() if name not in case.uncompared]
        starts.append(np.concatenate([original.physics.data.qpos, original.physics.data.qvel, *parts]))
    return np.array(starts)


def starts_of_the_task(case: Case, original: Any) -> Vector:
    """As `starts_of_the_suite`."""
    env = seedbed.make(case.file)
    env.reset(seed=0)
    compared = [np.full(np.size(value), name not in case.uncompared) for name, value in original.reset().observation.items()]
    starts = []
    for _ in range(400):
        observation, _ = env.reset()
        starts.append(np.concatenate([*mujoco_state(env, original.physics.model.ptr), observation[np.concatenate(compared)]]))
    return np.array(starts)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.file.stem)
def test_episodes_start_as_in_the_suite(case: Case):
    """Means of coordinates and observations are within five standard errors, and their spreads within a fifth."""
    original = load(case)
    ours, theirs = starts_of_the_task(case, original), starts_of_the_suite(case, original)
    spread = np.maximum(ours.std(0), theirs.std(0))
    mean_tolerance, spread_tolerance = (1.0, 1.0) if case.settles else (5 * np.sqrt(2 / len(ours)), 0.2)
    assert np.all(np.abs(ours.mean(0) - theirs.mean(0)) <= mean_tolerance * spread + 1e-6)
    assert np.all(np.abs(ours.std(0) - theirs.std(0)) <= spread_tolerance * spread + 1e-6)


def touching_states(env: seedbed.Env, original: Any, forces: slice) -> list[tuple[Any, Any]]:
    """Which touch sensors feel a force in some states of random play, in the task and in the suite, `[sensors]` each."""
    model, generator = original.physics.model.ptr, np.random.default_rng(0)
    found: list[tuple[Any, Any]] = []
    env.reset(seed=0)
    while len(found) < 200:
        control = generator.uniform(-1, 1, model.nu).astype(np.float32)
        observation, _, _, truncated, _ = env.step(control)
        qpos, qvel = mujoco_state(env, model)
        original.physics.set_control(control)
        original.physics.data.qpos[:], original.physics.data.qvel[:] = qpos, qvel
        original.physics.forward()
        pair = observation[forces] > 0, original.physics.touch() > 0
        if pair[0].any() and pair[1].any():
            found.append(pair)
        if truncated:
            env.reset()
    return found


@pytest.mark.parametrize(("case", "forces"), [(case_of("hopper", "stand"), slice(13, 15)), (case_of("finger", "turn_easy"), slice(7, 9))])
def test_touch_sensors_feel_the_same_contacts(case: Case, forces: slice):
    """Where both feel a contact, they agree about the sensor in nine of ten states: one of two contacts may have just ended."""
    states = touching_states(seedbed.make(case.file), load(case), forces)
    assert np.mean([np.array_equal(ours, theirs) for ours, theirs in states]) > 0.9


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.file.stem)
def test_an_episode_of_random_actions_stays_finite(case: Case):
    env, generator = seedbed.make(case.file), np.random.default_rng(0)
    env.reset(seed=0)
    for _ in range(env.task.time_limit):
        observation, reward, *_ = env.step(generator.uniform(-1, 1, env.action_space.shape).astype(np.float32))
        assert np.all(np.abs(observation) < 200) and np.isfinite(reward)


@pytest.mark.parametrize("case", [case_of("walker", "stand"), case_of("cheetah", "run"), case_of("hopper", "stand")])
def test_bodies_come_to_rest_on_the_ground(case: Case):
    """Without controls, figures fall or stand; after 15 s they are almost at rest, and move by less than 0.02 m or rad in a second."""
    env = seedbed.make(case.file, max_episode_steps=2000)
    for seed in range(5):
        env.reset(seed=seed)
        positions = []
        for seconds in (15, 1):
            for _ in range(round(seconds / env.task.control_step)):
                env.step(np.zeros(env.action_space.shape, np.float32))
            positions.append(list(env.coordinates()["positions"].values()))
        assert np.max(np.abs(np.diff(positions, axis=0))) < 0.02
        assert max(map(abs, env.coordinates()["velocities"].values())) < 0.05


def test_the_string_holds_the_ball():
    """A slack string does nothing: the ball falls as in MuJoCo. A taut one holds it 0.3 m below the cup, within a centimeter."""
    env = seedbed.make(case_of("ball_in_cup", "catch").file, max_episode_steps=2000)
    for x in (-0.15, 0.15):
        env.reset(options={"positions": {"ball_x": x, "ball_z": 0.1}})
        for _ in range(5):
            env.step(np.zeros(2, np.float32))
        assert env.coordinates()["positions"]["ball_x"] == pytest.approx(x, abs=1e-4)
        for _ in range(1000):
            env.step(np.zeros(2, np.float32))
            positions = env.coordinates()["positions"]
            below_x = positions["cup_x"] - positions["ball_x"]
            below_y = 0.6 - 0.108 + positions["cup_z"] - 0.2 - positions["ball_z"]
            assert np.hypot(below_x, below_y) < 0.31
