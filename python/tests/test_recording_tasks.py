"""Recorders of seedbed tasks, whose names, units and ranges are known."""

from __future__ import annotations

import gymnasium
import numpy as np
from test_recording_writer import episodes_of, play, state_file

import seedbed
from seedbed.state_files import Axis, scan


def quantities(quantities) -> list[Axis]:
    return [Axis(one.name, one.unit, *one.range) for one in quantities]


def test_axes_are_those_of_the_task(tmp_path):
    environment = gymnasium.make("seedbed/CartPole-v0")
    task = environment.unwrapped.task
    with seedbed.RecordVisitation(environment, tmp_path, ranges={"x": (-1, 1)}) as environment:
        play(environment, 1)
    header = scan(state_file(tmp_path)).header
    assert header.environment == "seedbed/CartPole-v0"
    assert list(header.observations[1:]) == quantities(task.observations)[1:]
    assert header.observations[0] == Axis("x", "m", -1, 1)
    assert list(header.actions) == quantities(task.actions)
    assert (header.time_limit, header.step_seconds) == (task.time_limit, task.control_step)


def test_discrete_actions_are_recorded_as_values(tmp_path):
    task = seedbed.Task("cartpole")
    (values,) = [action.values for action in task.actions]
    for index, value in enumerate(values):
        with seedbed.RecordVisitation(seedbed.make(task), tmp_path / str(index)) as environment:
            play(environment, 1, index)
        (episode,) = episodes_of(state_file(tmp_path / str(index)), 4, 1)
        assert set(episode["actions"].flatten()) == {np.float32(value)}
        copies = seedbed.make(task, num_envs=2, autoreset_mode="SameStep")
        recorded = seedbed.RecordVisitationVector(copies, tmp_path / f"vector {index}")
        recorded.reset(seed=0)
        for _ in range(60):
            recorded.step(np.full(2, index))
        recorded.close()
        for episode in episodes_of(state_file(tmp_path / f"vector {index}", 1), 4, 1):
            assert set(episode["actions"].flatten()) == {np.float32(value)}


def test_changed_observations_do_not_have_the_axes_of_the_task(tmp_path):
    environment = gymnasium.wrappers.NormalizeObservation(seedbed.make("cartpole"))
    with seedbed.RecordVisitation(environment, tmp_path) as environment:
        play(environment, 1)
    assert scan(state_file(tmp_path)).header.observations[0] == Axis("observation_0")


def test_a_vector_environment_records_what_single_environments_record(tmp_path):
    copies = 3
    recorded = seedbed.RecordVisitationVector(
        seedbed.make("cartpole", num_envs=copies, autoreset_mode="SameStep", copy=False), tmp_path / "vector"
    )
    actions = np.random.default_rng(0).integers(2, size=(300, copies))
    recorded.reset(seed=7)
    for row in actions:
        recorded.step(row)
    recorded.close()
    for agent in range(copies):
        with seedbed.RecordVisitation(
            seedbed.make("cartpole"), tmp_path / "single", agent=agent, learner=0
        ) as environment:
            environment.reset(seed=7 + agent)
            for action in actions[:, agent]:
                _, _, terminated, truncated, _ = environment.step(action)
                if terminated or truncated:
                    environment.reset()
        assert state_file(tmp_path / "single", agent).read_bytes() == state_file(tmp_path / "vector", agent).read_bytes()
