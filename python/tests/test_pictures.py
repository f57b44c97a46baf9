"""Pictures show the bodies."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RenderCollection

import seedbed

AGENT = np.array([161, 121, 7])
"""Color of the first moving body; the second one is dark."""


def center(picture: np.ndarray, color: np.ndarray) -> tuple[float, float]:
    """Mean position of pixels of a color, from the left and the top."""
    rows, columns = np.nonzero((np.abs(picture.astype(int) - color) < 12).all(axis=2))
    assert len(rows) > 5
    return float(columns.mean()), float(rows.mean())


def test_the_cart_is_drawn_where_it_is():
    """A cart 0.1 m further right is further right in the picture, and not higher."""
    environment = seedbed.make("cartpole", render_mode="rgb_array", max_episode_steps=-1)
    environment.reset(seed=0)
    positions, centers = [], []
    for _ in range(8):
        observation, *_ = environment.step(1)
        picture = environment.render()
        assert picture is not None
        assert (picture.shape, picture.dtype) == ((400, 600, 3), np.uint8)
        positions.append(observation[0])
        centers.append(center(picture, AGENT))
    across, up = np.transpose(centers)
    pixels_per_meter, _ = np.polyfit(positions, across, 1)
    assert 80 < pixels_per_meter < 200
    assert np.ptp(up) < 1
    # The first pixel of white space, and a picture that is not empty.
    assert (picture[0, 0] == 255).all()


@pytest.mark.parametrize("name", [name for name in seedbed.tasks() if seedbed.Task(name).bodies])
def test_every_task_with_bodies_can_be_drawn(name: str):
    environment = seedbed.make(name, render_mode="rgb_array")
    environment.reset(seed=0)
    before = environment.render()
    assert before is not None
    colors = np.unique(before.reshape(-1, 3), axis=0)
    assert 2 < len(colors) < 2000
    environment.action_space.seed(0)
    for _ in range(10):
        _, _, terminated, truncated, _ = environment.step(environment.action_space.sample())
        if terminated or truncated:
            break
    assert not np.array_equal(environment.render(), before)


def test_a_picture_depends_on_the_state_only():
    one, other = (seedbed.make("lander", render_mode="rgb_array") for _ in range(2))
    one.reset(seed=0)
    for _ in range(20):
        one.step(2)
        one.render()
    other.reset(seed=9)
    other.set_state(one.get_state())
    assert np.array_equal(one.render(), other.render())


def test_bodies_far_away_are_in_the_picture(tmp_path: Path):
    end = 'terminated: "abs(x) > 2.4 || abs(theta) > 12 * degree"'
    path = tmp_path / "free.ron"
    path.write_text(seedbed.Task("cartpole").text.replace(end, 'terminated: "false"'))
    free = seedbed.make(path, render_mode="rgb_array", max_episode_steps=-1)
    free.reset(seed=0)
    for _ in range(120):
        observation, *_ = free.step(1)
    assert observation[0] > 10
    picture = free.render()
    assert picture is not None
    assert center(picture, AGENT)[0] > 400


BALL_ABOVE_GROUND = """Environment(
    description: "A ball above level ground, whose height is drawn.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 20,
    solver: (iterations: 4, searches: 2),
    drawn_per_episode: [(name: "level", value: Uniform(-1.0, 0.0))],
    colliders: [(name: "ground", geom: Terrain(from: -1.0, spacing: 0.5, points: 5, height: "level"))],
    bodies: [(name: "ball", position: (0.0, 1.0), mass: 1.0, colliders: [(name: "skin", geom: Ball(radius: 0.2))])],
    actuators: [(name: "push", type: JointForce("ball.x"), control: Continuous(-1.0, 1.0), unit: "N")],
    sensors: [(name: "x", type: JointPosition("ball.x"))],
    observations: [(name: "x", unit: "m", range: (-1.0, 1.0)), (name: "level", unit: "m", range: (-1.0, 0.0))],
    reward: "0",
)"""


def test_the_ground_of_the_episode_is_drawn(tmp_path: Path):
    """The lower the ground is, the further below the ball it is in the picture."""
    path = tmp_path / "ball.ron"
    path.write_text(BALL_ABOVE_GROUND)
    environment = seedbed.make(path, render_mode="rgb_array")
    levels, distances = [], []
    for seed in range(6):
        (_, level), _ = environment.reset(seed=seed)
        picture = environment.render()
        assert picture is not None
        # The ground is a gray line, and nothing else is gray.
        is_ground = (np.ptp(picture, axis=2) < 20) & (picture.mean(axis=2) < 220)
        levels.append(level)
        distances.append(np.nonzero(is_ground)[0].mean() - center(picture, AGENT)[1])
    assert np.ptp(levels) > 0.3
    assert list(np.argsort(levels)) == list(np.argsort(distances)[::-1])
    assert min(distances) > 50


def test_metadata():
    assert seedbed.make("cartpole").metadata == {"render_modes": ["rgb_array"], "render_fps": 50}
    assert seedbed.make("pendulum").metadata["render_fps"] == 20
    assert seedbed.make("deep_sea").metadata == {"render_modes": [], "render_fps": 1}
    assert seedbed.make("cartpole", 2).metadata["render_fps"] == 50


def test_without_a_render_mode_nothing_is_drawn():
    for environment in (seedbed.make("cartpole"), seedbed.make("cartpole", 2), seedbed.parallel_env("cartpole")):
        environment.reset(seed=0)
        with pytest.warns(UserWarning, match="render_mode"):
            assert environment.render() is None


def test_vector_environments_draw_each_copy():
    many, single = seedbed.make("hopper", 3, render_mode="rgb_array"), seedbed.make("hopper", render_mode="rgb_array")
    many.reset(seed=0)
    single.reset(seed=2)
    pictures = many.render()
    assert pictures is not None
    assert len(pictures) == 3
    assert np.array_equal(pictures[2], single.render())


def test_gymnasiums_wrappers_collect_pictures():
    environment = gymnasium.make("seedbed/CartPole-v0", render_mode="rgb_array_list")
    assert isinstance(environment, RenderCollection)
    environment.reset(seed=0)
    environment.step(0)
    assert len(environment.render()) == 2
