"""The files that RecordVisitation writes, read byte by byte as `docs/state_files.md` describes them."""

from __future__ import annotations

import csv
import gc
import json
import math
import os
import shutil
import signal
import struct
import subprocess
import sys
import warnings
import zlib
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import seedbed
from seedbed.recording import RecordingError, RecordVisitation
from seedbed.state_files import scan


class Counter(gymnasium.Env):
    """Observation (t, 10 t) after t steps, reward t; terminates after `length` steps."""

    def __init__(self, length: int = 3, space: spaces.Space | None = None, action_space: spaces.Space | None = None):
        self.observation_space = space or spaces.Box(-np.inf, np.inf, (2,), np.float64)
        self.action_space = action_space or spaces.Discrete(3)
        self.length = length
        self.steps = 0

    def _observation(self):
        return np.array([self.steps, 10.0 * self.steps])

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self._observation(), {}

    def step(self, action):
        self.steps += 1
        return self._observation(), float(self.steps), self.steps == self.length, False, {}


def frames(path: Path) -> list[tuple[bytes, bytes]]:
    """Kinds and payloads, read independently of the package."""
    content = path.read_bytes()
    magic, version, checksum = struct.unpack("<8sII", content[:16])
    assert (magic, version, checksum) == (b"SBSTATES", 1, zlib.crc32(content[:12]))
    offset, found = 16, []
    while offset < len(content):
        kind, size, checksum, own = struct.unpack("<4sIII", content[offset : offset + 16])
        assert own == zlib.crc32(content[offset : offset + 12])
        payload = content[offset + 16 : offset + 16 + size]
        assert len(payload) == size and zlib.crc32(payload) == checksum
        found.append((kind, payload))
        offset += 16 + size
    return found


def episodes_of(path: Path, observations: int, actions: int) -> list[dict]:
    """Finished episodes, put together from their frames."""
    found, unfinished = [], None
    for kind, payload in frames(path):
        if kind != b"EPIS":
            continue
        number, first, steps, outcome, total = struct.unpack("<IIIId", payload[:24])
        numbers = np.frombuffer(payload[24:], "<f4")
        states = steps + (outcome > 0)
        rows = np.split(numbers, [states * observations, states * observations + steps * actions])
        part = [rows[0].reshape(-1, observations), rows[1].reshape(-1, actions), rows[2]]
        if first == 0:
            unfinished = part
        else:
            assert len(unfinished[2]) == first
            unfinished = [np.concatenate(pair) for pair in zip(unfinished, part, strict=True)]
        if outcome:
            states, taken, rewards = unfinished
            found.append({"episode": number, "outcome": outcome, "return": total, "states": states, "actions": taken, "rewards": rewards})
    return found


def play(environment: gymnasium.Env, episodes: int, action: int = 1) -> None:
    for _ in range(episodes):
        environment.reset()
        ended = False
        while not ended:
            _, _, terminated, truncated, _ = environment.step(action)
            ended = terminated or truncated


def state_file(folder: Path, agent: int = 0) -> Path:
    return folder / "states" / f"agent_{agent}.states"


def test_the_bytes_are_as_documented(tmp_path):
    with RecordVisitation(Counter(2), tmp_path, agent=3, names=["t", "ten"], ranges={"t": (0, 2)}) as environment:
        play(environment, 1)
    header = (
        '{"agent":3,"environment":"Counter","observations":[{"name":"t","unit":"","low":0.0,"high":2.0},'
        '{"name":"ten","unit":"","low":null,"high":null}],"actions":[{"name":"action","unit":"","low":0.0,"high":2.0}],'
        '"time_limit":null,"step_seconds":null}'
    ).encode()
    episode = struct.pack("<IIIId", 0, 0, 2, 1, 3.0)
    episode += struct.pack("<10f", 0, 0, 1, 10, 2, 20, 1, 1, 1, 2)
    expected = b"SBSTATES" + struct.pack("<I", 1)
    expected += struct.pack("<I", zlib.crc32(expected))
    for kind, payload in [(b"HEAD", header), (b"EPIS", episode), (b"DONE", struct.pack("<I", 1))]:
        start = kind + struct.pack("<II", len(payload), zlib.crc32(payload))
        expected += start + struct.pack("<I", zlib.crc32(start)) + payload
    assert state_file(tmp_path, 3).read_bytes() == expected


def test_the_wrapped_environment_behaves_as_before(tmp_path):
    bare, recorded = gymnasium.make("CartPole-v1"), RecordVisitation(gymnasium.make("CartPole-v1"), tmp_path)
    rng = np.random.default_rng(0)
    assert recorded.observation_space == bare.observation_space
    for episode in range(5):
        first, other = bare.reset(seed=episode), recorded.reset(seed=episode)
        assert np.array_equal(first[0], other[0])
        ended = False
        while not ended:
            action = int(rng.integers(2))
            first, other = bare.step(action), recorded.step(action)
            assert np.array_equal(first[0], other[0]) and first[1:] == other[1:]
            ended = first[2] or first[3]
    recorded.close()


def test_tables_agree_with_monitor_of_stable_baselines(tmp_path):
    """Returns and lengths are those of the episodes, in the order of rounds; `env_steps` counts the team's steps."""
    for agent, length in enumerate([2, 4]):
        with RecordVisitation(Counter(length), tmp_path, agent=agent) as environment:
            play(environment, 2)
    with open(tmp_path / "episodes.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    columns = ["agent", "episode", "round", "env_steps", "return", "length", "outcome"]
    assert [[row[column] for column in columns] for row in rows] == [
        ["0", "0", "0", "2", "3.0", "2", "terminated"],
        ["1", "0", "0", "6", "10.0", "4", "terminated"],
        ["0", "1", "1", "8", "3.0", "2", "terminated"],
        ["1", "1", "1", "12", "10.0", "4", "terminated"],
    ]
    assert set(rows[0]) - set(columns) == {"coverage", "visitation_entropy", "team_overlap", "effective_agents", "end_step"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["agents"], summary["episodes_per_agent"], summary["env_steps"]) == (2, 2, 12)
    assert summary["final_return"] == 6.5 and summary["scenario"] == tmp_path.name


def test_long_episodes_are_written_in_parts(tmp_path):
    length = 3 * 4096 + 5
    with RecordVisitation(Counter(length), tmp_path) as environment:
        play(environment, 1)
        size = state_file(tmp_path).stat().st_size
    parts = [payload for kind, payload in frames(state_file(tmp_path)) if kind == b"EPIS"]
    assert len(parts) == 4 and size > 16 * length
    (episode,) = episodes_of(state_file(tmp_path), 2, 1)
    assert np.array_equal(episode["states"][:, 0], np.arange(length + 1)) and episode["return"] == length * (length + 1) / 2
    assert np.array_equal(episode["rewards"], np.arange(1, length + 1))


def test_an_episode_without_steps_is_no_episode(tmp_path):
    with RecordVisitation(Counter(), tmp_path, keep_unfinished=True) as environment:
        environment.reset()
        environment.reset()
    assert episodes_of(state_file(tmp_path), 2, 1) == []
    assert json.loads((tmp_path / "summary.json").read_text())["final_return"] is None


@pytest.mark.filterwarnings("ignore:.*too large for single precision")
@pytest.mark.parametrize("rewards", [[math.inf, -math.inf], [1e308, 1e308], [math.nan, 1]])
def test_a_mean_that_is_no_finite_number_is_null(tmp_path, rewards):
    class Rewarded(Counter):
        def step(self, action):
            observation, _, *rest = super().step(action)
            return observation, rewards.pop(), *rest

    with RecordVisitation(Rewarded(1), tmp_path) as environment:
        play(environment, len(rewards))
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["final_return"], summary["episodes_per_agent"]) == (None, 2)


def test_the_final_return_is_unknown_if_an_agent_has_no_episode(tmp_path):
    with RecordVisitation(Counter(4), tmp_path, agent=1) as environment:
        play(environment, 2)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["agents"], summary["final_return"]) == (2, None)


def test_numbers_are_recorded_as_they_are(tmp_path):
    class Odd(Counter):
        def _observation(self):
            return np.array([math.nan, math.inf]) if self.steps == 1 else np.array([-math.inf, 1e-40])

    environment = RecordVisitation(Odd(2), tmp_path)
    play(environment, 1)
    with pytest.warns(RuntimeWarning, match="observations are NaN in some states: observation_0 in 1"):
        environment.close()
    (episode,) = episodes_of(state_file(tmp_path), 2, 1)
    assert np.array_equal(episode["states"], np.float32([[-np.inf, 1e-40], [np.nan, np.inf], [-np.inf, 1e-40]]), equal_nan=True)


@pytest.mark.parametrize(
    ("space", "action", "expected", "names", "ranges"),
    [
        (spaces.Discrete(4, start=-1), -1, [-1], ["action"], [(-1, 2)]),
        (spaces.Box(-2, 2, (1,)), np.array([0.5]), [0.5], ["action"], [(-2, 2)]),
        (spaces.Box(-np.inf, 1, (2, 2)), np.ones((2, 2)), [1] * 4, ["action_0_0", "action_0_1", "action_1_0", "action_1_1"], [(None, 1)] * 4),
        (spaces.MultiDiscrete([3, 2]), np.array([2, 1]), [2, 1], ["action_0", "action_1"], [(0, 2), (0, 1)]),
        (spaces.MultiBinary(2), np.array([0, 1]), [0, 1], ["action_0", "action_1"], [(0, 1)] * 2),
        (
            spaces.Dict({"gear": spaces.Discrete(3), "throttle": spaces.Box(0, 1, ())}),
            {"gear": 2, "throttle": np.float32(0.25)}, [2, 0.25], ["gear", "throttle"], [(0, 2), (0, 1)],
        ),
    ],
)
def test_actions_of_all_kinds(tmp_path, space, action, expected, names, ranges):
    with RecordVisitation(Counter(2, action_space=space), tmp_path) as environment:
        play(environment, 1, action)
    axes = scan(state_file(tmp_path)).header.actions
    assert ([axis.name for axis in axes], [(axis.low, axis.high) for axis in axes]) == (names, ranges)
    (episode,) = episodes_of(state_file(tmp_path), 2, len(expected))
    assert np.array_equal(episode["actions"], [expected, expected])


def test_axes_are_given_or_bounds_or_learned(tmp_path):
    space = spaces.Box(np.float32([-1, -np.inf]), np.float32([2, np.finfo(np.float32).max]))
    with RecordVisitation(Counter(1, space), tmp_path, names=["Höhe", "角度"], units={"角度": "rad"}) as environment:
        play(environment, 1)
    first, second = scan(state_file(tmp_path)).header.observations
    assert (first.name, first.unit, first.low, first.high) == ("Höhe", "", -1, 2)
    assert (second.name, second.unit, second.low, second.high) == ("角度", "rad", None, None)
    with RecordVisitation(Counter(1, space), tmp_path / "visited", ranges="visited") as environment:
        play(environment, 1)
    axes = scan(state_file(tmp_path / "visited")).header.observations
    assert [(axis.name, axis.low, axis.high) for axis in axes] == [("observation_0", None, None), ("observation_1", None, None)]


def test_observations_of_any_shape_are_flattened(tmp_path):
    class Grid(Counter):
        def _observation(self):
            return np.arange(6).reshape(2, 3) + self.steps

    with RecordVisitation(Grid(2, spaces.Box(0, 20, (2, 3), np.uint8)), tmp_path) as environment:
        play(environment, 1)
    assert [axis.name for axis in scan(state_file(tmp_path)).header.observations][3:] == ["observation_1_0", "observation_1_1", "observation_1_2"]
    (episode,) = episodes_of(state_file(tmp_path), 6, 1)
    assert np.array_equal(episode["states"], np.arange(6) + np.arange(3)[:, None])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"names": ["a"]}, "expected 2 names"),
        ({"names": "ab"}, "expected 2 names"),
        ({"names": ["a", "a"]}, "'a' twice"),
        ({"names": ["a", "reward"]}, "another column"),
        ({"names": ["a", "b=c"]}, "without '='"),
        ({"units": {"z": "m"}}, "units names 'z'"),
        ({"ranges": {"observation_0": (1, 1)}}, "low < high"),
        ({"ranges": [(0, math.inf), None]}, "finite numbers"),
        ({"ranges": [(0, 1)]}, "expected 2 entries"),
        ({"ranges": "all"}, "expected 2 entries"),
        ({"ranges": [3, None]}, "expected (low, high)"),
        ({"action_names": ["a", "b"]}, "expected 1 names"),
        ({"agent": -1}, "agent is -1"),
        ({"agent": 1.7}, "agent is 1.7"),
        ({"learner": 1 << 16}, "learner is 65536"),
        ({"agent": 1024}, "agent is 1024, expected a number below 1024"),
        ({"names": ["a", "é" * 501]}, "a text of 1002 bytes"),
        ({"names": ["a", "\ud800"]}, "no valid Unicode"),
        ({"units": [1, 2]}, "units contains 1, expected a text"),
        ({"units": ["m", "m" * 1001]}, "expected at most 1000"),
        ({"environment": "e" * 1001}, "environment contains a text of 1001 bytes"),
        ({"overwrite": True, "resume": True}, "exclude each other"),
    ],
)
def test_invalid_arguments_are_refused(tmp_path, options, words):
    with pytest.raises(ValueError) as error:
        RecordVisitation(Counter(), tmp_path / "run", **options)
    assert words in str(error.value)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("space", "words"),
    [
        (spaces.Discrete(5), "FlattenObservation"),
        (spaces.Dict({"a": spaces.Discrete(2)}), "FlattenObservation"),
        (spaces.Box(0, 255, (84, 84, 3), np.uint8), "record features"),
        (spaces.Box(0, 1, (0,)), "expected 1 to 1000 numbers"),
    ],
)
def test_other_observations_are_refused(tmp_path, space, words):
    with pytest.raises(TypeError, match=words):
        RecordVisitation(Counter(space=space), tmp_path)


@pytest.mark.parametrize(("space", "count"), [(spaces.Box(0, 1, (0,)), 0), (spaces.Dict(), 0), (spaces.Box(0, 1, (10_001,)), 10_001)])
def test_actions_without_numbers_or_with_too_many_are_refused(tmp_path, space, count):
    environment = Counter()
    environment.action_space = space
    with pytest.raises(TypeError, match=f"with {count} numbers, expected 1 to 10000"):
        RecordVisitation(environment, tmp_path)


@pytest.mark.parametrize(
    ("steps", "rate", "expected"),
    [
        (sys.maxsize, 50, (None, 0.02)),
        (2**32 - 1, np.float32(50), (2**32 - 1, 0.02)),
        (np.int64(7), -1, (7, None)),
        (-1, math.inf, (None, None)),
        (0, 1e-310, (None, None)),
        (None, "fast", (None, None)),
        (None, 10**400, (None, None)),
    ],
)
def test_limits_and_rates_that_cannot_be_recorded_are_left_out(tmp_path, steps, rate, expected):
    """The program refuses a header with a time limit of more than 32 bits, or a step that is not longer than 0 s."""
    environment = Counter(2)
    environment.metadata = {"render_fps": rate}
    environment.spec = gymnasium.envs.registration.EnvSpec("Counter-v0", max_episode_steps=steps)
    with RecordVisitation(environment, tmp_path) as environment:
        play(environment, 1)
    header = scan(state_file(tmp_path)).header
    assert (header.time_limit, header.step_seconds) == expected
    assert seedbed.load(tmp_path, frames="arrow").states.num_rows == 3


def test_numbers_of_agents_have_no_large_gaps(tmp_path):
    """A larger number is accepted as soon as a quarter of the smaller ones is in use."""
    folder = tmp_path / "states"
    folder.mkdir()
    with RecordVisitation(Counter(), tmp_path / "other", agent=0) as environment:
        play(environment, 1)
    for agent in range(300):
        shutil.copy(state_file(tmp_path / "other"), folder / f"agent_{agent}.states")
    with pytest.raises(ValueError, match="agent is 1204, expected a number below 1204"):
        RecordVisitation(Counter(), tmp_path, agent=1204)
    RecordVisitation(Counter(), tmp_path, agent=1203)


@pytest.mark.parametrize(("rewards", "final"), [((math.inf, -math.inf), None), ((1e308, 1e308), None), ((-(10**400), 1.0), None), ((0.5, 1.0), 0.75)])
def test_infinite_and_large_returns_complete_the_run(tmp_path, rewards, final):
    class Given(Counter):
        def step(self, action):
            return *super().step(action)[:1], left.pop(0), True, False, {}

    left = list(rewards)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with RecordVisitation(Given(), tmp_path) as environment:
            play(environment, 2)
    assert json.loads((tmp_path / "summary.json").read_text())["final_return"] == final


def test_a_reward_beyond_double_precision_is_infinite(tmp_path):
    class Huge(Counter):
        def step(self, action):
            return *super().step(action)[:1], 10**400, True, False, {}

    environment = RecordVisitation(Huge(), tmp_path)
    with pytest.warns(RuntimeWarning, match="too large for double precision"):
        play(environment, 1)
    environment.close()
    assert episodes_of(state_file(tmp_path), 2, 1)[0]["return"] == math.inf


def test_a_learner_without_episodes_has_no_final_return(tmp_path):
    with RecordVisitation(Counter(), tmp_path, agent=1) as environment:
        play(environment, 1)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["final_return"], summary["episodes_of_agents"]) == (None, {"1": 1})


def test_flattened_observations_are_recorded(tmp_path):
    taxi = gymnasium.wrappers.FlattenObservation(gymnasium.make("FrozenLake-v1"))
    with RecordVisitation(taxi, tmp_path) as environment:
        play(environment, 2)
    assert len(scan(state_file(tmp_path)).header.observations) == 16


def test_a_recorded_agent_is_replaced_or_resumed_only_on_request(tmp_path):
    def record(**options):
        with RecordVisitation(Counter(), tmp_path, **options) as environment:
            play(environment, 2)
        return [episode["episode"] for episode in episodes_of(state_file(tmp_path), 2, 1)]

    assert record() == [0, 1]
    with pytest.raises(FileExistsError, match="resume=True, or replace"):
        record()
    assert record(resume=True) == [0, 1, 2, 3]
    assert record(overwrite=True) == [0, 1]
    with pytest.raises(ValueError, match="observations .* differ from those of agent 0"):
        RecordVisitation(Counter(), tmp_path, agent=1, names=["x", "y"])
    with pytest.raises(ValueError, match="cannot be resumed"):
        record(resume=True, names=["x", "y"])


def test_the_folder_of_another_run_is_refused(tmp_path):
    (tmp_path / "scenario.ron").touch()
    for options in [{}, {"overwrite": True}, {"resume": True}]:
        with pytest.raises(FileExistsError, match="contains another run"):
            RecordVisitation(Counter(), tmp_path, **options)


def test_results_of_earlier_states_are_removed_when_a_run_continues(tmp_path):
    RecordVisitation(Counter(), tmp_path).close()
    with RecordVisitation(Counter(), tmp_path) as environment:
        play(environment, 1)
    (tmp_path / "run.rrd").touch()
    environment = RecordVisitation(Counter(), tmp_path, resume=True)
    assert (tmp_path / "run.rrd").exists(), "nothing changes before the first episode"
    environment.reset()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["states"]
    environment.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["episodes.csv", "states", "summary.json"]


def test_an_unfinished_last_episode_is_removed_by_resume(tmp_path):
    with RecordVisitation(Counter(), tmp_path) as environment:
        play(environment, 2)
    path = state_file(tmp_path)
    content = path.read_bytes()
    for cut in (25, 40, 60):
        path.write_bytes(content[:-cut])
        with pytest.warns(RuntimeWarning, match="removed the unfinished last episode"):
            environment = RecordVisitation(Counter(), tmp_path, resume=True)
            play(environment, 1)
        environment.close()
        assert path.read_bytes() == content, cut


def test_a_file_that_another_program_changes_is_noticed(tmp_path):
    environment = RecordVisitation(Counter(), tmp_path)
    play(environment, 1)
    with open(state_file(tmp_path), "ab") as file:
        file.write(bytes(8))
    with pytest.raises(RecordingError, match="another recorder writes to it"):
        play(environment, 1)
    environment.close()
    assert state_file(tmp_path).read_bytes().endswith(bytes(8))


def test_a_full_disk_is_an_error_and_leaves_finished_episodes(tmp_path, monkeypatch):
    environment = RecordVisitation(Counter(), tmp_path)
    play(environment, 1)
    size = state_file(tmp_path).stat().st_size

    def write(descriptor, content, real=os.write):
        if len(content) < 10:
            raise OSError(28, "No space left on device")
        return real(descriptor, content[:9])

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", write)
        with pytest.raises(RecordingError, match="No space left on device"):
            environment.reset()
            patch.setattr(os, "write", lambda descriptor, content: write(descriptor, content[:9]))
            for _ in range(3):
                environment.step(0)
    assert state_file(tmp_path).stat().st_size == size


def test_steps_without_a_reset_are_not_recorded(tmp_path):
    environment = RecordVisitation(Counter(2), tmp_path)
    play(environment, 1)
    with pytest.warns(UserWarning, match="without a reset"):
        environment.step(0)
    environment.close()
    assert len(episodes_of(state_file(tmp_path), 2, 1)) == 1


def test_the_wrapper_autoreset_does_not_add_transitions(tmp_path):
    with RecordVisitation(gymnasium.wrappers.Autoreset(Counter(2)), tmp_path) as environment:
        environment.reset()
        for _ in range(6):
            environment.step(0)
    found = episodes_of(state_file(tmp_path), 2, 1)
    assert [episode["states"][:, 0].tolist() for episode in found] == [[0, 1, 2], [0, 1, 2]]


def test_copies_and_use_after_close_are_refused(tmp_path):
    import copy
    import pickle

    environment = RecordVisitation(Counter(), tmp_path)
    for make_copy in (pickle.dumps, copy.deepcopy):
        with pytest.raises(TypeError, match="make it there instead"):
            make_copy(environment)
    environment.close()
    environment.close()
    with pytest.raises(RecordingError, match="is closed"):
        environment.reset()


SCRIPT = """
import os, signal, sys
sys.path[:0] = [{tests!r}]
from test_recording_writer import Counter, play
from seedbed.recording import RecordVisitation
environment = RecordVisitation(Counter(3), {folder!r}, agent={agent})
play(environment, {episodes})
environment.reset()
environment.step(0)
{end}
"""


def run_script(folder: Path, end: str, agent: int = 0, episodes: int = 3) -> subprocess.Popen:
    script = SCRIPT.format(tests=str(Path(__file__).parent), folder=str(folder), agent=agent, episodes=episodes, end=end)
    # Not in the folder of the sources, which have no native part.
    return subprocess.Popen([sys.executable, "-c", script], cwd=folder.parent)


def test_a_killed_process_loses_only_its_unfinished_episode(tmp_path):
    process = run_script(tmp_path, "os.kill(os.getpid(), signal.SIGKILL)")
    assert process.wait() == -signal.SIGKILL
    assert len(episodes_of(state_file(tmp_path), 2, 1)) == 3
    assert not (tmp_path / "summary.json").exists()
    # Another agent completes the table, but the run is not finished.
    assert run_script(tmp_path, "environment.close()", agent=1).wait() == 0
    assert len((tmp_path / "episodes.csv").read_text().splitlines()) == 1 + 6
    assert not (tmp_path / "summary.json").exists()
    with RecordVisitation(Counter(3), tmp_path, resume=True) as environment:
        play(environment, 1)
    assert json.loads((tmp_path / "summary.json").read_text())["env_steps"] == 3 * 7


@pytest.mark.parametrize("end", ["", "del environment", "sys.exit(0)", "environment.close()"])
def test_the_end_of_a_process_completes_the_run(tmp_path, end):
    assert run_script(tmp_path, end).wait() == 0
    assert frames(state_file(tmp_path))[-1] == (b"DONE", struct.pack("<I", 3))
    assert json.loads((tmp_path / "summary.json").read_text())["env_steps"] == 9


def test_an_unhandled_error_completes_the_file(tmp_path):
    process = run_script(tmp_path, "sys.stderr = open(os.devnull, 'w'); raise SystemError")
    assert process.wait() == 1
    assert frames(state_file(tmp_path))[-1] == (b"DONE", struct.pack("<I", 3))


def test_garbage_collection_completes_the_run(tmp_path):
    environment = RecordVisitation(Counter(3), tmp_path)
    play(environment, 1)
    del environment
    gc.collect()
    assert (tmp_path / "summary.json").exists()


def test_several_processes_write_to_one_folder(tmp_path):
    processes = [run_script(tmp_path, "", agent=agent, episodes=20) for agent in range(4)]
    assert [process.wait() for process in processes] == [0] * 4
    rows = (tmp_path / "episodes.csv").read_text().splitlines()
    assert len(rows) == 1 + 80 and rows[1].startswith("0,0,0,3,6.0,3,terminated")
    assert json.loads((tmp_path / "summary.json").read_text())["agents"] == 4
    assert sorted(path.name for path in (tmp_path / "states").iterdir()) == [".lock"] + [f"agent_{agent}.states" for agent in range(4)]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_must_not_write(tmp_path):
    end = """
child = os.fork()
if child == 0:
    try:
        environment.step(0), environment.step(0)
    except Exception as error:
        sys.exit(7 if "make the recorder in the process" in str(error) else 1)
    sys.exit(0)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
environment.step(0), environment.step(0)
"""
    assert run_script(tmp_path, end).wait() == 0
    assert len(episodes_of(state_file(tmp_path), 2, 1)) == 4
