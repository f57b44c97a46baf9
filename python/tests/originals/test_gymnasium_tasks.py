"""The tasks `gym_*` of this module are Gymnasium's planar tasks with MuJoCo.

Observations, rewards and ends are compared with Gymnasium's own code in the same states, motion without contacts and
ranges with MuJoCo at a small timestep, and start states and random episodes with many of Gymnasium's.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from reference import (
    ENVS,
    Names,
    Vector,
    free_motion,
    make_text,
    mujoco_state,
    same_names,
    start_options,
    task_motion,
    with_iterations,
    without_contacts,
)

import seedbed

STATES = 300
"""Number of states in which observations and rewards are compared."""

Generator = np.random.Generator


@dataclass(frozen=True)
class Case:
    """A task and what is special about it."""

    id: str
    """Gymnasium's name of the task."""
    stem: str
    """Name of the task's file, without its ending."""
    widths: dict[str, float]
    """Largest random position of joints without a range in Gymnasium or with a useful part of it, m or rad."""
    speed: float
    """Standard deviation of random velocities, m/s or rad/s."""

    @property
    def file(self) -> Path:
        return ENVS / f"{self.stem}.ron"


CASES = [
    Case("InvertedPendulum-v5", "gym_inverted_pendulum", {"hinge": 0.4}, 1.0),
    Case("InvertedDoublePendulum-v5", "gym_inverted_double_pendulum", {"slider": 0.1, "hinge": 1.0, "hinge2": 1.0}, 5.0),
    Case("Reacher-v5", "gym_reacher", {"joint0": 3.0}, 10.0),
    Case("Swimmer-v5", "gym_swimmer", {"slider1": 5.0, "slider2": 5.0, "free_body_rot": 3.0}, 1.0),
    Case("Hopper-v5", "gym_hopper", {"rootx": 5.0, "rootz": 0.8, "rooty": 0.3}, 8.0),
    Case("Walker2d-v5", "gym_walker2d", {"rootx": 5.0, "rootz": 0.8, "rooty": 1.5}, 8.0),
    Case("HalfCheetah-v5", "gym_half_cheetah", {"rootx": 5.0, "rootz": 0.8, "rooty": 3.0}, 5.0),
]

each_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)


def case_of(stem: str) -> Case:
    return next(case for case in CASES if case.stem == stem)


def load(case: Case) -> Any:
    """Gymnasium's environment, without its wrappers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        original = gymnasium.make(case.id).unwrapped
    original.reset(seed=0)
    return original


def names_of(model: Any) -> Names:
    """All joints but those of Gymnasium's target, which is a marker of the task."""
    return {name: same for name, same in same_names(model).items() if not name.startswith("target")}


def random_state(case: Case, generator: Generator, model: Any) -> tuple[Vector, Vector]:
    """MuJoCo's positions and velocities."""
    qpos = np.array(model.qpos0)
    for name in names_of(model):
        joint = model.joint(name)
        width = case.widths.get(name)
        low, high = joint.range if width is None else (-width, width)
        qpos[joint.id] += generator.uniform(low, high)
    return qpos, generator.normal(0, case.speed, model.nv)


def with_target(original: Any, qpos: Vector, qvel: Vector, numbers: dict[str, float]) -> tuple[Vector, Vector]:
    """A state whose target, if there is one, is where the numbers of the episode place it, at rest."""
    if "target_share" in numbers:
        radius, direction = 0.2 * np.sqrt(numbers["target_share"]), numbers["target_direction"]
        qpos[-2:] = radius * np.cos(direction), radius * np.sin(direction)
        qvel[-2:] = 0
    return qpos, qvel


def state_of(env: seedbed.Env, original: Any) -> tuple[Vector, Vector]:
    """MuJoCo's state in the current state of a task."""
    qpos, qvel = mujoco_state(env, original.model, names_of(original.model))
    return with_target(original, qpos, qvel, env.coordinates()["numbers"])


def view(original: Any, before: tuple[Vector, Vector], after: tuple[Vector, Vector], action: Vector) -> tuple[Vector, float, bool]:
    """Observation, reward and end that Gymnasium's code computes for a step from one state to another."""
    original.set_state(*before)
    original.do_simulation = lambda control, frames: original.set_state(*after)
    observation, reward, terminated, _, _ = original.step(action)
    return observation, float(reward), bool(terminated)


def largest_difference(observation: Any, expected: Vector) -> float:
    """Largest difference of observations, relative to values above 1."""
    return float(np.max(np.abs(observation - expected) / np.maximum(1, np.abs(expected))))


@each_case
def test_observations_rewards_and_ends_are_those_of_gymnasium(case: Case):
    """Single precision leaves errors of about 1e-7 of the numbers in formulas. A velocity that is a difference of positions has
    the error of two positions of up to 5 m over a step of at least 0.008 s, 1e-4 m/s. States nearer than 1e-5 to the end of
    an episode do not occur.
    """
    original, env = load(case), seedbed.make(case.file)
    generator = np.random.default_rng(0)
    rewards, ends = [], []
    for _ in range(STATES):
        env.reset(options=start_options(original.model, *random_state(case, generator, original.model), names_of(original.model)))
        before = state_of(env, original)
        action = generator.uniform(env.action_space.low, env.action_space.high).astype(np.float32)
        observation, reward, terminated, _, _ = env.step(action)
        expected, expected_reward, expected_end = view(original, before, state_of(env, original), action)
        assert largest_difference(observation, expected) < 2e-6
        assert reward == pytest.approx(expected_reward, abs=2e-4, rel=2e-6)
        assert terminated == expected_end
        rewards.append(reward)
        ends.append(terminated)
    assert np.std(rewards) > 0.05, "rewards do not differ: the states test nothing"
    has_ends = case.id not in ("Reacher-v5", "Swimmer-v5", "HalfCheetah-v5")
    assert (0.05 < np.mean(ends) < 0.95) == has_ends, "ends are not tested"


def test_the_rail_pushes_as_in_gymnasium():
    """The force of the rail's ends depends on the motor too, but it is clipped: it is 0 or ±10 N where the cart is fast."""
    case = case_of("gym_inverted_double_pendulum")
    original, env = load(case), seedbed.make(case.file)
    generator = np.random.default_rng(0)
    for _ in range(100):
        side, outwards, beyond = generator.choice([-1, 1]), generator.choice([-1, 1]), generator.choice([0.0, 0.02])
        qpos, qvel = np.zeros(3), np.zeros(3)
        qpos[0], qvel[0] = side * (0.975 + beyond), side * outwards * generator.uniform(0.5, 3)
        observation, _ = env.reset(options=start_options(original.model, qpos, qvel))
        original.set_state(qpos, qvel)
        assert observation[-1] == original._get_obs()[-1] == (-10 * side if beyond and outwards > 0 else 0)


@each_case
def test_the_rules_are_those_of_gymnasium(case: Case):
    original, task = load(case), seedbed.make(case.file).task
    specification = gymnasium.spec(case.id)
    assert task.control_step == pytest.approx(original.dt)
    assert task.time_limit == specification.max_episode_steps
    assert task.reward_threshold == specification.reward_threshold
    assert len(task.observations) == original.observation_space.shape[0]
    ranges = np.array([action.range for action in task.actions])
    assert np.array_equal(ranges, original.model.actuator_ctrlrange)


NUMBER = r"(-?[\d.]+)"
POINT = rf"\({NUMBER}, {NUMBER}\)"


@each_case
def test_gears_and_ranges_are_those_of_gymnasium(case: Case):
    """The ends of a range begin to push where MuJoCo's do: earlier by their margin."""
    model, text = load(case).model, seedbed.Task(case.file).text
    assert [float(gear) for gear in re.findall(rf"gear: {NUMBER}", text)] == model.actuator_gear[:, 0].tolist()
    joints = text[text.index("\n    joints: [") : text.index("\n    actuators: [")].split('name: "')[1:]
    described = {part[: part.index('"')]: part for part in joints}
    for name in names_of(model):
        joint, found = model.joint(name), re.search(rf"range: {POINT}", described[name])
        assert (found is not None) == bool(joint.limited[0])
        if found:
            margin = np.array([1, -1]) * joint.margin[0]
            assert [float(end) for end in found.groups()] == pytest.approx(joint.range + margin, abs=1e-12)


@pytest.mark.parametrize("stem", ["gym_hopper", "gym_walker2d", "gym_half_cheetah"])
def test_colliders_are_those_of_gymnasium(stem: str):
    """Capsules and friction. Frames of bodies are MuJoCo's."""
    model, text = load(case_of(stem)).model, seedbed.Task(case_of(stem).file).text
    floor = re.search(rf'name: "floor", geom: HalfSpace\(normal: \(0.0, 1.0\)\), friction: {NUMBER}', text)
    assert floor and float(floor[1]) == model.geom("floor").friction[0]
    capsule = rf"geom: Capsule\(from: {POINT}, to: {POINT}, radius: {NUMBER}\)"
    colliders = re.findall(rf'name: "(\w+)", friction: {NUMBER}, .*\s+{capsule}', text)
    found = {name: [float(number) for number in numbers] for name, *numbers in colliders}
    assert len(found) == model.ngeom - 1
    for name, (friction, *ends, radius) in found.items():
        geom = model.geom(name)
        axis = np.zeros(9)
        mujoco.mju_quat2Mat(axis, geom.quat)
        half = geom.size[1] * axis.reshape(3, 3)[:, 2]
        expected = sorted([tuple((geom.pos + sign * half)[[0, 2]]) for sign in (1, -1)])
        assert np.allclose(sorted([tuple(ends[:2]), tuple(ends[2:])]), expected, atol=2e-6)
        assert (friction, radius) == (geom.friction[0], geom.size[0])


@dataclass(frozen=True)
class Motion:
    """How far a task may be from MuJoCo after some steps of random controls from random states."""

    case: Case
    steps: int
    tolerance: float
    """Largest difference of positions, m or rad, over ten trajectories."""


MOTIONS = [
    Motion(case_of("gym_inverted_pendulum"), 25, 0.02),
    Motion(case_of("gym_inverted_double_pendulum"), 10, 0.05),
    Motion(case_of("gym_reacher"), 50, 0.05),
    Motion(case_of("gym_swimmer"), 50, 0.05),
    Motion(case_of("gym_hopper"), 50, 0.01),
    Motion(case_of("gym_walker2d"), 10, 0.05),
    Motion(case_of("gym_half_cheetah"), 10, 0.15),
]


def finer(text: str, factor: int) -> str:
    """The text of a task with more substeps: with a fluid more searches, after which its forces are computed again."""
    if "fluid: " not in text:
        return with_iterations(text, factor)
    return re.sub(r"\bsearches: (\d+)", lambda match: f"searches: {factor * int(match[1])}", text)


def position_errors(motion: Motion, factor: int, folder: Path) -> Vector:
    """Differences of positions from MuJoCo's without contacts and ranges, `[trajectories, steps, joints]`."""
    text = without_contacts(seedbed.Task(motion.case.file).text)
    env = make_text(finer(re.sub(r"\n    terminated: .*", "", text), factor), folder)
    errors = []
    for seed in range(10):
        model, generator = load(motion.case).model, np.random.default_rng(seed)
        qpos, qvel = with_target(None, *random_state(motion.case, generator, model), {})
        qvel *= 1 / motion.case.speed
        qvel[len(names_of(model)) :] = 0
        controls = generator.uniform(*model.actuator_ctrlrange.T, (motion.steps, model.nu)).astype(np.float32)
        expected = free_motion(model, qpos, qvel, controls, env.task.control_step)
        errors.append(np.abs(task_motion(env, model, qpos, qvel, controls, names_of(model)) - expected)[:, : len(names_of(model))])
    return np.array(errors)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.case.stem)
def test_motion_converges_to_mujoco(motion: Motion, tmp_path: Path):
    """The error is within the tolerance, and inversely proportional to the number of substeps."""
    errors = [position_errors(motion, factor, tmp_path) for factor in (1, 2, 4)]
    assert errors[0].max() < motion.tolerance
    assert errors[0].max() > motion.tolerance / 10, "the tolerance is too loose to test anything"
    sizes = [np.sqrt(np.mean(error**2)) for error in errors]
    assert 1.5 < sizes[0] / sizes[1] < 2.5
    assert 1.5 < sizes[1] / sizes[2] < 2.5


UNEQUAL_STARTS = ("thigh_joint", "leg_joint", "thigh_left_joint", "leg_left_joint")
"""Joints that start within their ranges, while Gymnasium's start beyond an end in half of all episodes."""


@each_case
def test_episodes_start_as_in_gymnasium(case: Case):
    """Means of observations are within five standard errors, and their spreads within a fifth."""
    original, env = load(case), seedbed.make(case.file)
    env.reset(seed=0)
    ours = np.array([env.reset()[0] for _ in range(400)])
    theirs = np.array([original.reset()[0] for _ in range(400)])
    equal = [quantity.name not in UNEQUAL_STARTS for quantity in env.task.observations]
    ours, theirs = ours[:, equal], theirs[:, equal]
    spread = np.maximum(ours.std(0), theirs.std(0))
    assert np.all(np.abs(ours.mean(0) - theirs.mean(0)) <= 5 * spread * np.sqrt(2 / 400) + 1e-6)
    assert np.all(np.abs(ours.std(0) - theirs.std(0)) <= 0.2 * spread + 1e-6)


def random_episodes(environment: Any, episodes: int) -> Vector:
    """Length and return of episodes of uniformly random actions, `[episodes, 2]`."""
    environment.reset(seed=0)
    environment.action_space.seed(0)
    results = []
    for _ in range(episodes):
        environment.reset()
        length, total, ended = 0, 0.0, False
        while not ended:
            observation, reward, terminated, truncated, _ = environment.step(environment.action_space.sample())
            assert np.isfinite(observation).all()
            length, total, ended = length + 1, total + reward, terminated or truncated
        results.append((length, total))
    return np.array(results)


@each_case
def test_random_episodes_are_those_of_gymnasium(case: Case):
    """Mean lengths and returns differ by less than 15 percent and two standard errors."""
    episodes = 20 if case.id in ("Swimmer-v5", "HalfCheetah-v5") else 300
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = random_episodes(gymnasium.make(case.id), episodes)
    ours = random_episodes(seedbed.make(case.file), episodes)
    errors = np.sqrt((ours.var(0) + theirs.var(0)) / episodes)
    tolerances = 0.15 * np.abs(theirs.mean(0)) + 2 * errors
    assert np.all(np.abs(ours.mean(0) - theirs.mean(0)) < tolerances), (ours.mean(0), theirs.mean(0), errors)


def test_a_cheetah_without_torque_rests_as_in_gymnasium():
    """It neither sinks nor trembles. Its feet stay where they landed, while MuJoCo's soft friction lets them creep apart."""
    case = case_of("gym_half_cheetah")
    original, env = load(case), seedbed.make(case.file)
    original.set_state(original.init_qpos, original.init_qvel)
    env.reset(options=start_options(original.model, original.init_qpos, original.init_qvel))
    for _ in range(200):
        original.step(np.zeros(6))
        env.step(np.zeros(6, np.float32))
    qpos, qvel = mujoco_state(env, original.model)
    differences = np.abs(qpos - original.data.qpos)
    assert differences[1] < 0.04, "height, m"
    assert differences[2:].max() < 0.1, "angles, rad"
    assert np.abs(qvel).max() < 1e-3


def test_the_end_of_a_range_yields_as_in_gymnasium():
    """A reacher that pushes its second joint against the end of its range."""
    case = case_of("gym_reacher")
    original, env = load(case), seedbed.make(case.file)
    env.reset(options={"positions": {"joint1": 2.9}})
    qpos = np.zeros(4)
    qpos[1] = 2.9
    original.set_state(qpos, np.zeros(4))
    for _ in range(45):
        original.step(np.array([0.0, 1.0]))
        env.step(np.array([0.0, 1.0], np.float32))
    expected = original.data.qpos[1] - 3
    assert 0.002 < expected < 0.01
    assert env.coordinates()["positions"]["joint1"] - 3 == pytest.approx(expected, rel=0.5)
