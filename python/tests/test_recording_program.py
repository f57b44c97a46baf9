"""Records with Python, reads with the program `seedbed`, and compares with what Python saw.

The program is that of the environment variable SEEDBED_PROGRAM, or the newest one that Cargo built in this repository.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from test_recording_writer import Counter, frames, play, state_file

import seedbed
from seedbed.recording import RecordVisitation

NAMES = ["x", "v", "θ", "ω"]
RANGES = {"x": (-2.4, 2.4), "v": (-3, 3), "θ": (-0.21, 0.21), "ω": (-3, 3)}
CELLS = 20


@pytest.fixture(scope="session")
def program() -> str:
    named = os.environ.get("SEEDBED_PROGRAM")
    repository = Path(__file__).parents[2]
    target = Path(os.environ.get("CARGO_TARGET_DIR", repository / "target"))
    built = [path for profile in ("release", "debug") if (path := target / profile / "seedbed").is_file()]
    if named is None and not built:
        pytest.fail("there is no program to test: run `cargo build --release`, or set SEEDBED_PROGRAM")
    return named or str(max(built, key=lambda path: path.stat().st_mtime))


class Witness(gymnasium.Wrapper):
    """Keeps what happens in lists: of each episode, states, actions, rewards and whether it terminated."""

    def __init__(self, env):
        super().__init__(env)
        self.episodes = []

    def reset(self, **options):
        result = self.env.reset(**options)
        self.states, self.actions, self.rewards = [result[0]], [], []
        return result

    def step(self, action):
        result = self.env.step(action)
        self.states.append(result[0]), self.actions.append(action), self.rewards.append(result[1])
        if result[2] or result[3]:
            self.episodes.append((np.array(self.states), self.actions, self.rewards, bool(result[2])))
        return result


@pytest.fixture(scope="session")
def recorded(tmp_path_factory) -> tuple[Path, list[list]]:
    """Three agents that prefer different actions, and what each of them saw."""
    folder = tmp_path_factory.mktemp("runs") / "cartpole"
    seen = []
    for agent, episodes in enumerate([12, 10, 11]):
        witness = Witness(gymnasium.make("CartPole-v1", max_episode_steps=40))
        rng = np.random.default_rng(agent)
        with RecordVisitation(witness, folder, agent=agent, names=NAMES, ranges=RANGES) as environment:
            environment.reset(seed=agent)
            while len(witness.episodes) < episodes:
                _, _, terminated, truncated, _ = environment.step(int(rng.random() < 0.3 + 0.2 * agent))
                if terminated or truncated:
                    environment.reset()
        seen.append(witness.episodes)
    return folder, seen


def run(program: str, *arguments: object) -> str:
    result = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert "warning" not in result.stderr
    return result.stdout


def test_exported_states_are_those_that_python_saw(program, recorded, tmp_path):
    folder, seen = recorded
    run(program, "export", folder, "--to", tmp_path / "states.npz")
    states = np.load(tmp_path / "states.npz")
    row = 0
    for agent, episodes in enumerate(seen):
        for number, (observations, actions, rewards, terminated) in enumerate(episodes):
            rows = slice(row, row + len(observations))
            row = rows.stop
            assert set(states["agent"][rows]) == {agent} and set(states["episode"][rows]) == {number}
            assert np.array_equal(states["step"][rows], np.arange(len(observations)))
            assert np.array_equal(np.stack([states[name][rows] for name in NAMES], 1), observations)
            assert np.array_equal(states["action"][rows][:-1], actions) and np.isnan(states["action"][row - 1])
            assert np.array_equal(states["reward"][rows][:-1], rewards)
            assert set(states["outcome"][rows]) == {"terminated" if terminated else "truncated"}
    assert row == len(states["agent"])


def test_exported_episodes_equal_the_table_that_python_wrote(program, recorded, tmp_path):
    folder, _ = recorded
    run(program, "export", folder, "--to", tmp_path / "episodes.csv", "--content", "episodes")
    exported = (tmp_path / "episodes.csv").read_text().splitlines()
    written = (folder / "episodes.csv").read_text().splitlines()
    assert len(exported) == len(written) == 1 + 33 and exported[0] + ",end_step" == written[0]
    for one, other in zip(exported[1:], written[1:], strict=True):
        one, other = one.split(","), other.split(",")
        assert (one[:4], one[5:7]) == (other[:4], other[5:7]) and float(one[4]) == float(other[4])
        assert other[7:11] == ["NaN"] * 4
    # Measures of visits follow from the states: after its last episode, an agent has its coverage.
    summary = json.loads(run(program, "inspect", folder, "--json"))
    for agent in summary["agents"]:
        last = [line.split(",") for line in exported if line.startswith(f"{agent['agent']},")][-1]
        assert float(last[7]) == pytest.approx(agent["coverage"])


def grids(states: np.ndarray) -> np.ndarray:
    """Number of states per cell of a grid over each pair of observations: `[pairs, 400]`."""
    ends = np.array([RANGES[name] for name in NAMES])
    cells = np.clip((states - ends[:, 0]) / (ends[:, 1] - ends[:, 0]) * CELLS, 0, CELLS - 1).astype(int)
    pairs = itertools.combinations(range(len(NAMES)), 2)
    return np.stack([np.bincount(cells[:, one] * CELLS + cells[:, two], minlength=CELLS**2) for one, two in pairs])


def entropy(shares: np.ndarray) -> float:
    """Mean over grids of the entropy, nats."""
    shares = shares / shares.sum(1, keepdims=True)
    return float(-(shares * np.log(np.where(shares > 0, shares, 1))).sum(1).mean())


def test_measures_are_those_of_the_states(program, recorded):
    folder, seen = recorded
    summary = json.loads(run(program, "inspect", folder, "--json"))
    assert summary["finished"] and summary["name"] == "cartpole" and summary["agent_count"] == 3
    assert summary["env_steps"] == sum(len(episode[1]) for episodes in seen for episode in episodes)
    assert summary["team_returns"] == pytest.approx([np.mean([sum(episodes[n][2]) for episodes in seen]) for n in range(10)])
    states = [np.concatenate([episode[0] for episode in episodes]) for episodes in seen]
    counts = [grids(one) for one in states]
    for agent, (episodes, own) in enumerate(zip(seen, counts, strict=True)):
        found = summary["agents"][agent]
        assert found["episodes"] == len(episodes)
        assert found["coverage"] == pytest.approx((own > 0).mean())
        assert found["terminated"] == pytest.approx(np.mean([episode[3] for episode in episodes]))
        assert found["visitation_evenness"] == pytest.approx(entropy(own) / np.log(400))
    shares = [own / own.sum(1, keepdims=True) for own in counts]
    divergence = entropy(np.mean(shares, 0)) - np.mean([entropy(one) for one in shares])
    assert summary["effective_agents"] == pytest.approx(np.exp(divergence)) and divergence > 0.05
    for index, found in enumerate(summary["observations"]):
        values = np.concatenate(states)[:, index]
        assert (found["name"], found["states"]) == (NAMES[index], len(values))
        assert (found["min"], found["max"]) == pytest.approx((values.min(), values.max()))
        assert found["axis_range"] == pytest.approx(RANGES[NAMES[index]])


def test_pages_and_figures_show_all_states(program, recorded, tmp_path):
    folder, seen = recorded
    count = sum(len(episode[0]) for episodes in seen for episode in episodes)
    assert f"{count} states" in run(program, "explore", folder, "--out", tmp_path / "page.html").replace(",", "")
    data = (tmp_path / "page.html").read_text()
    assert f'"states":{count},"kept":{count}' in data and "θ" in data
    run(program, "plot", folder, "--out", tmp_path / "plot.svg", "--what", "visitation,difference,density,returns,scatter")
    assert "<svg" in (tmp_path / "plot.svg").read_text()
    selected = sum((episode[0][:, 0] >= 0.1).sum() for episode in seen[2][:5])
    arguments = ["--what", "visitation", "--agents", 2, "--episodes", "..5", "--where", "x=0.1.."]
    run(program, "plot", folder, "--out", tmp_path / "some.svg", *arguments)
    assert selected > 0 and f"{selected} states" in (tmp_path / "some.svg").read_text()


def test_a_recording_for_rerun_has_the_same_measures(program, recorded, tmp_path):
    folder, _ = recorded
    run(program, "export", folder, "--to", tmp_path / "run.rrd")
    of_folder = json.loads(run(program, "inspect", folder, "--json"))
    of_recording = json.loads(run(program, "inspect", tmp_path / "run.rrd", "--json"))
    for name in ("env_steps", "team_returns", "effective_agents", "overlaps", "observations"):
        assert of_recording[name] == of_folder[name], name


def test_a_run_is_listed(program, recorded):
    folder, _ = recorded
    (listed,) = json.loads(run(program, "runs", folder.parent, "--json"))
    assert (listed["state"], listed["environment"], listed["agents"]) == ("finished", "CartPole-v1", 3)
    assert listed["final_return"] == pytest.approx(json.loads(run(program, "inspect", folder, "--json"))["final_return"])


def test_a_run_in_progress_and_a_killed_one_are_read(program, tmp_path):
    environment = RecordVisitation(gymnasium.make("CartPole-v1"), tmp_path / "run")
    environment.reset(seed=0)
    for _ in range(3):
        while not any(environment.step(1)[2:4]):
            pass
        environment.reset()
    assert json.loads(run(program, "inspect", tmp_path / "run", "--json"))["agents"][0]["episodes"] == 3
    (path,) = (tmp_path / "run" / "states").glob("agent_*")
    os.truncate(path, path.stat().st_size - 5)
    result = subprocess.run([program, "inspect", tmp_path / "run", "--json"], capture_output=True, text=True)
    assert json.loads(result.stdout)["agents"][0]["episodes"] == 2
    assert "agent_0.states: ignored" in result.stderr
    environment._recorder._agent_files.is_closed = True  # the truncated file cannot be completed


@pytest.fixture
def finished(tmp_path):
    """Two agents with 4 and 3 episodes."""
    for agent, episodes in [(0, 4), (1, 3)]:
        with RecordVisitation(Counter(2), tmp_path / "run", agent=agent) as environment:
            play(environment, episodes)
    return tmp_path / "run"


def cut_end(folder, agent, episodes):
    """Cut a file at the end of one of its episodes."""
    path = state_file(folder, agent)
    sizes = [16 + len(payload) for _, payload in frames(path)]
    os.truncate(path, 16 + sum(sizes[: 1 + episodes]))


@pytest.mark.parametrize(("agent", "episodes", "expected"), [(0, 3, 4), (0, 0, 4), (1, 2, 3), (1, None, 3)])
def test_a_finished_recording_that_lost_its_end_is_an_error(program, finished, agent, episodes, expected):
    if episodes is None:
        state_file(finished, agent).unlink()
    else:
        cut_end(finished, agent, episodes)
    words = f"the number of episodes of agent {agent} is {episodes or 0}, expected {expected} as in summary.json"
    for command in (["inspect"], ["explore", "--out", finished / "x.html"], ["export", "--to", finished / "x.csv"], ["plot", "--out", finished / "x.svg"]):
        result = subprocess.run([program, command[0], finished, *command[1:]], capture_output=True, text=True)
        assert result.returncode == 2 and words in result.stderr, result.stderr
    (listed,) = json.loads(run(program, "runs", finished.parent, "--json"))
    assert listed["state"] == "unreadable" and words in listed["error"]
    loaded = seedbed.load(finished)
    for name in ("episodes", "states", "info"):
        with pytest.raises(seedbed.RunError, match=words):
            getattr(loaded, name)
    (finished / "summary.json").unlink()
    assert seedbed.load(finished).state == "unfinished"


def test_a_finished_recording_with_other_steps_is_an_error(program, finished):
    """As of recorders that did not note the episodes of each agent."""
    summary = json.loads((finished / "summary.json").read_text())
    del summary["episodes_of_agents"]
    (finished / "summary.json").write_text(json.dumps(summary))
    run(program, "inspect", finished)
    cut_end(finished, 0, 3)
    result = subprocess.run([program, "inspect", finished], capture_output=True, text=True)
    assert result.returncode == 2 and "the number of steps of all episodes is 12, expected 14 as in summary.json" in result.stderr


def test_the_whole_episodes_of_a_cut_recording_are_salvaged(program, finished, tmp_path):
    cut_end(finished, 0, 2)
    printed = run(program, "salvage", finished, "--out", tmp_path / "whole")
    assert "summary.json" in printed
    assert json.loads(run(program, "inspect", tmp_path / "whole", "--json"))["env_steps"] == 10
