"""Single environments follow Gymnasium's interface."""

from __future__ import annotations

import copy
import math
import pickle
import re
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import seedbed

# Observations have no bounds, and actions are in the units of the task.
EXPECTED_WARNINGS = (".*observation space m.* value is.*infinity.*", ".*symmetric and normalized.*")


def check(environment: gymnasium.Env) -> None:
    with warnings.catch_warnings():
        for message in EXPECTED_WARNINGS:
            warnings.filterwarnings("ignore", message=message)
        check_env(environment)


def task_files() -> list[str]:
    folder = Path(__file__).resolve().parents[2] / "envs"
    return sorted(path.stem for path in folder.glob("*.ron"))


def test_all_task_files_are_built_in_and_registered():
    assert seedbed.tasks() == task_files()
    for name in seedbed.tasks():
        spec = gymnasium.spec(seedbed.environment_id(name))
        task = seedbed.Task(name)
        assert (spec.max_episode_steps, spec.reward_threshold) == (task.time_limit, task.reward_threshold)
    assert not any("naive" in name for name in gymnasium.registry)


def test_ids_are_camel_case():
    ids = {name: seedbed.environment_id(name) for name in seedbed.tasks()}
    assert ids["cartpole"] == "seedbed/CartPole-v0"
    assert ids["mountain_car_continuous"] == "seedbed/MountainCarContinuous-v0"
    assert ids["deep_sea_20"] == "seedbed/DeepSea20-v0"
    assert len(set(ids.values())) == len(ids)


@pytest.mark.parametrize("name", task_files())
def test_check_env(name: str):
    physics = ["rapier", "analytic"] if seedbed.Task(name).has_analytic_model else ["rapier"]
    for kind in physics:
        check(gymnasium.make(seedbed.environment_id(name), physics=kind).unwrapped)
        check(seedbed.make(name, physics=kind))


@pytest.mark.parametrize("fixture", ["mixed_task", "two_switches"])
def test_check_env_of_a_file(fixture: str, request: pytest.FixtureRequest):
    check(seedbed.make(request.getfixturevalue(fixture)))


def test_the_module_prefix_imports_the_package():
    environment = gymnasium.make("seedbed:seedbed/CartPole-v0")
    assert environment.unwrapped.task.name == "cartpole"


def test_spaces(mixed_task: Path, two_switches: Path):
    assert seedbed.make("cartpole").action_space == spaces.Discrete(2)
    assert seedbed.make("hopper").action_space == spaces.Box(-1, 1, (3,), np.float32)
    assert seedbed.make("ball_on_beam").action_space == spaces.Box(-5, 5, (1,), np.float32)
    assert seedbed.make(two_switches).action_space == spaces.MultiDiscrete([3, 2])
    mixed = spaces.Dict({"switch": spaces.Discrete(3), "push": spaces.Box(-2, 2, (), np.float32)})
    assert seedbed.make(mixed_task).action_space == mixed
    assert seedbed.make("cartpole").observation_space == spaces.Box(-np.inf, np.inf, (4,), np.float32)


def test_mixed_actions_reach_their_components(mixed_task: Path):
    """The force is 1 N of the switch and 2 N of the push on 1 kg during 0.1 s."""
    environment = seedbed.make(mixed_task)
    environment.reset(seed=0)
    _, reward, *_ = environment.step({"switch": 2, "push": np.float32(2.0)})
    assert reward == pytest.approx(0.3, rel=1e-5)
    environment.reset(seed=0)
    _, reward, *_ = environment.step({"push": np.array(-5.0), "switch": np.int64(1)})
    assert reward == pytest.approx(-0.2, rel=1e-5), "clamped to -2 N"


def test_discrete_components_are_indices(two_switches: Path):
    environment = seedbed.make(two_switches)
    environment.reset(seed=0)
    _, reward, *_ = environment.step(np.array([2, 0]))
    assert reward == pytest.approx(-0.1, rel=1e-5), "1 N - 2 N"


def run(environment: gymnasium.Env, steps: int, seed: int | None = None) -> list[tuple]:
    """Observations, rewards and ends of some steps, with resets after episodes."""
    rows = [(environment.reset(seed=seed)[0].tobytes(),)]
    environment.action_space.seed(3)
    for _ in range(steps):
        observation, reward, terminated, truncated, _ = environment.step(environment.action_space.sample())
        rows.append((observation.tobytes(), reward, terminated, truncated))
        if terminated or truncated:
            rows.append((environment.reset()[0].tobytes(),))
    return rows


def test_a_seed_gives_the_same_bits_and_no_seed_continues():
    environment = seedbed.make("cartpole")
    first = run(environment, 100, seed=5)
    assert run(environment, 100, seed=5) == first
    assert run(environment, 100, seed=6) != first
    assert run(seedbed.make("cartpole"), 100, seed=5) == first
    one, other = environment.reset(seed=5)[0], environment.reset()[0]
    assert (one != other).all()
    assert np.array_equal(environment.reset(seed=5)[0], one)


def test_an_environment_without_a_seed_draws_one_that_can_be_used_again():
    environment, other = seedbed.make("cartpole"), seedbed.make("cartpole")
    observation, _ = environment.reset()
    assert not np.array_equal(observation, other.reset()[0])
    assert np.array_equal(other.reset(seed=environment.np_random_seed)[0], observation)


@pytest.mark.parametrize(
    ("arguments", "steps"),
    [({}, 500), ({"max_episode_steps": 7}, 7), ({"max_episode_steps": 700}, 700)],
)
def test_time_limits_are_those_of_gymnasium(arguments: dict, steps: int):
    """Bytes are truncated by our own counter, and by Gymnasium's `TimeLimit`, at the same step."""
    made = gymnasium.make("seedbed/MountainCarContinuous-v0", **arguments)
    assert "TimeLimit" in str(made)
    limit = arguments.get("max_episode_steps", seedbed.Task("mountain_car_continuous").time_limit)
    steps = min(steps, limit) if arguments else limit
    for environment in (made, seedbed.make("mountain_car_continuous", **arguments)):
        environment.reset(seed=0)
        for step in range(1, steps + 1):
            *_, terminated, truncated, _ = environment.step(np.zeros(1, np.float32))
            assert (terminated, truncated) == (False, step == steps)


def test_no_time_limit():
    environments = (
        gymnasium.make("seedbed/Pendulum-v0", max_episode_steps=-1),
        seedbed.make("pendulum", max_episode_steps=-1),
    )
    for environment in environments:
        environment.reset(seed=0)
        ends = [environment.step(np.zeros(1, np.float32))[2:4] for _ in range(1000)]
        assert not np.any(ends)


def test_termination_at_the_time_limit_is_both_as_in_gymnasium():
    """Pushed to the right only, the pole falls after some steps; the limit is at this step."""

    def end(environment: gymnasium.Env) -> tuple:
        environment.reset(seed=0)
        for step in range(1, 100):
            *_, terminated, truncated, _ = environment.step(1)
            if terminated or truncated:
                return step, terminated, truncated
        raise AssertionError("the pole did not fall")

    steps, *flags = end(seedbed.make("cartpole"))
    assert flags == [True, False]
    assert end(seedbed.make("cartpole", max_episode_steps=steps)) == (steps, True, True)
    assert end(gymnasium.make("seedbed/CartPole-v0", max_episode_steps=steps)) == (steps, True, True)


def test_the_specification_makes_the_same_environment_again(mixed_task: Path):
    for environment in (
        seedbed.make("cartpole", physics="analytic", max_episode_steps=9),
        seedbed.make(mixed_task),
        gymnasium.make("seedbed/CartPole-v0", physics="analytic", max_episode_steps=9),
    ):
        assert environment.spec is not None
        again = environment.spec.make()
        assert again.unwrapped.physics == environment.unwrapped.physics
        assert again.spec.max_episode_steps == environment.spec.max_episode_steps
        assert run(again, 40, seed=1) == run(environment, 40, seed=1)


def test_steps_without_a_running_episode_are_refused():
    environment = seedbed.make("cartpole", max_episode_steps=1)
    with pytest.raises(ResetNeeded, match="has not started"):
        environment.step(0)
    environment.reset(seed=0)
    environment.step(0)
    with pytest.raises(ResetNeeded, match="has ended"):
        environment.step(0)


def test_copies_and_pickles_continue_with_the_same_bits():
    environment = seedbed.make("hopper", max_episode_steps=50)
    run(environment, 30, seed=2)
    clones = [copy.deepcopy(environment), pickle.loads(pickle.dumps(environment))]
    expected = [environment.step(np.ones(3, np.float32))[0].tobytes() for _ in range(5)]
    for clone in clones:
        found = [clone.step(np.ones(3, np.float32))[0].tobytes() for _ in range(5)]
        assert found == expected
        assert clone.task == environment.task


def test_returned_observations_do_not_change():
    environment = seedbed.make("cartpole")
    observation, _ = environment.reset(seed=0)
    before = observation.copy()
    environment.step(1)
    assert np.array_equal(observation, before)
    assert observation.flags.owndata or observation.base is not None
    observation[:] = 0
    assert not np.array_equal(environment.reset(seed=0)[0], observation)


def test_tasks_that_differ_from_run_to_run():
    def mdp(run_seed: int) -> list[tuple]:
        return run(seedbed.make("deep_sea_permuted", run_seed=run_seed), 200, seed=0)

    assert mdp(1) == mdp(1)
    assert mdp(1) != mdp(2)
    assert run(seedbed.make("cartpole", run_seed=1), 50, seed=0) == run(seedbed.make("cartpole"), 50, seed=0)


def test_descriptions():
    task = seedbed.make("cartpole").task
    assert task.observations[2].range == (-0.21, 0.21)
    assert (task.observations[1].name, task.observations[1].unit) == ("x_dot", "m/s")
    assert task.actions[0].values == (-10.0, 10.0)
    assert seedbed.Task("hopper").actions[0].values is None
    assert task.bodies == ("world", "cart", "pole")
    assert (task.control_step, task.time_limit, task.reward_threshold) == (0.02, 200, 195.0)
    assert pickle.loads(pickle.dumps(task)) == task
    assert seedbed.Task("cartpole") == task != seedbed.Task("hopper")
    assert hash(seedbed.Task("cartpole")) == hash(task)
    for described in (task, *task.observations, *task.actions):
        assert described.__doc__
    with pytest.raises(AttributeError):
        task.control_step = 1.0  # type: ignore[misc]


def test_files_extend_built_in_tasks_and_names_are_looked_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert seedbed.Task("cartpole_gym").observations == seedbed.Task("cartpole").observations
    folder = tmp_path / "envs"
    folder.mkdir()
    (folder / "cartpole.ron").write_text(seedbed.Task("cartpole").text)
    (folder / "mine.ron").write_text('Environment(extends: "cartpole", time_limit: 5)')
    (tmp_path / "below").mkdir()
    monkeypatch.chdir(tmp_path / "below")
    mine = seedbed.make("mine")
    assert (mine.task.time_limit, mine.task.name) == (5, "mine")
    assert seedbed.make(folder / "mine.ron").task == mine.task
    assert gymnasium.make("seedbed/CartPole-v0").unwrapped.task.path == "builtin:envs/cartpole.ron"


def test_poses_follow_the_observations():
    environment = seedbed.make("cartpole")
    observation, _ = environment.reset(seed=0)
    poses = environment.poses()
    assert (poses.shape, poses.dtype) == ((3, 3), np.float32)
    world, cart, pole = poses
    assert np.array_equal(world, [0, 0, 0])
    assert cart[0] == pytest.approx(observation[0], abs=1e-6)
    assert pole[2] == pytest.approx(-observation[2], abs=1e-6), "the angle of the task grows clockwise"
    assert seedbed.make("deep_sea").poses().shape == (0, 3)


def test_an_episode_starts_in_a_given_state() -> None:
    environment = seedbed.make("cartpole")
    start = {"positions": {"slider": 0.25, "hinge": -0.125}, "velocities": {"hinge": 0.5}}
    observation, _ = environment.reset(seed=3, options=start)
    assert observation.tolist() == [0.25, 0.0, -0.125, 0.5]
    assert environment.coordinates() == {
        "positions": {"slider": 0.25, "hinge": -0.125},
        "velocities": {"slider": 0.0, "hinge": 0.5},
        "numbers": {},
    }
    for _ in range(5):
        environment.step(1)
    observation, _ = environment.reset(options=environment.coordinates())
    assert np.array_equal(observation, environment.reset(options=environment.coordinates())[0])


@pytest.mark.parametrize(
    "options, message",
    [
        ({"position": {}}, "unknown option 'position', expected one of positions, velocities, numbers"),
        ({"positions": {"rail": 1.0}}, 'options["positions"]: no coordinate is named "rail": expected one of slider, hinge'),
        ({"velocities": {"hinge": math.nan}}, 'options["velocities"]["hinge"] is NaN, expected a finite number'),
        ({"numbers": {"goal": 1.0}}, 'options["numbers"]: no number in `drawn_per_episode` is named "goal": the task has none'),
    ],
)
def test_a_wrong_start_is_refused(options: dict[str, dict[str, float]], message: str) -> None:
    environment = seedbed.make("cartpole")
    with pytest.raises(ValueError, match=re.escape(message)):
        environment.reset(seed=0, options=options)


def test_a_task_without_actuators_moves(tmp_path: Path) -> None:
    file = tmp_path / "falling.ron"
    file.write_text(
        """Environment(
            description: "A ball falls.", gravity: (0.0, -10.0), control_step: 0.1, time_limit: 9,
            bodies: [(name: "ball", mass: 1.0, geoms: [Ball(radius: 0.1)])],
            actuators: [], sensors: [(name: "v", type: JointVelocity("ball.y"))],
            observations: [(name: "v", range: (-9.0, 0.0))], reward: "0",
        )"""
    )
    environment = seedbed.make(file)
    environment.reset(seed=0)
    observation = environment.step(environment.action_space.sample())[0]
    assert observation == pytest.approx([-1.0], rel=1e-4)


SPINNING = """Environment(
    description: "A wheel.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 20,
    bodies: [(name: "wheel", mass: 1.0, inertia: 1e-9)],
    joints: [(name: "axle", parent: "world", child: "wheel", type: Hinge())],
    actuators: [(name: "torque", type: JointForce("axle"), control: Discrete([-1.0, 1.0]))],
    sensors: [(name: "angle", type: JointPosition("axle"))],
    observations: [(name: "side", value: "cos(angle)", range: (-1.0, 1.0))],
    reward: "side",
)"""


@pytest.mark.parametrize("num_envs", [None, 3])
def test_physics_beyond_its_range_is_a_warning_once(num_envs: int | None, tmp_path: Path):
    """1 N m / 1e-9 kg m² × 0.02 s are 2e7 rad/s; one turn per substep of 5 ms is 1257 rad/s."""
    path = tmp_path / "wheel.ron"
    path.write_text(SPINNING)
    environment = seedbed.make(path, num_envs=num_envs) if num_envs else seedbed.make(path)
    environment.reset(seed=0)
    action = 1 if num_envs is None else np.ones(num_envs, dtype=np.int64)
    expected = r"wheel: in copy 0, episode 0, step 1, the velocity of `axle` is 2\.0e7 rad/s, more than 1256\.6371 rad/s"
    with pytest.warns(RuntimeWarning, match=expected):
        environment.step(action)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment.step(action)
