"""The worker that serves environments of Gymnasium to the program, in a process of its own over a socket."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from conftest import REPOSITORY

import seedbed.worker

SOURCE = Path(seedbed.worker.__file__).read_bytes()
BOOTSTRAP = (
    "import os, struct; read = lambda count, text=b'': "
    "text if len(text) == count else read(count, text + os.read(0, count - len(text))); "
    "exec(compile(read(*struct.unpack('<I', read(4))), 'worker', 'exec'))"
)

TASKS = '''
import ctypes, os, sys, time
import gymnasium
import numpy as np
from gymnasium import spaces

class Scripted(gymnasium.Env):
    """Returns what it is told to."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}

    def __init__(self, observe=lambda: np.zeros(2, np.float32), space=spaces.Box(-1, 1, (2,), np.float32),
                 actions=spaces.Discrete(2), on_step=lambda action: (1.0, False, False, {}), on_reset=lambda: {}, picture=None):
        self.observe, self.observation_space, self.action_space = observe, space, actions
        self.on_step, self.on_reset, self.picture = on_step, on_reset, picture

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        info = self.on_reset()
        return self.observe(), info

    def step(self, action):
        result = self.on_step(action)
        return self.observe(), *result

    def render(self):
        return self.picture

def plain(**kwargs):
    return Scripted(**kwargs)

SPACES = {
    "box": (spaces.Box(-2, 3, (2, 2), np.float64), np.array([[0.5, 1], [2, 3]])),
    "scalar": (spaces.Box(-np.inf, 5e6, (), np.float32), np.array(7, np.float32)),
    "one": (spaces.Box(0, 1, (1,), np.float32), np.array([0.25], np.float32)),
    "int": (spaces.Box(0, 9, (3,), np.int16), np.array([1, 2, 3], np.int16)),
    "list": (spaces.Box(0, 9, (3,), np.float32), [1, 2, 3]),
    "discrete": (spaces.Discrete(3, start=5), np.int64(6)),
    "multi": (spaces.MultiDiscrete([2, 3], start=[0, 10]), np.array([1, 12])),
    "binary": (spaces.MultiBinary(3), np.array([1, 0, 1], np.int8)),
    "dict": (
        spaces.Dict({"z": spaces.Box(0, 1, (2,)), "a": spaces.Dict({"x": spaces.Discrete(2), "b": spaces.Box(0, 1, ())})}),
        {"z": np.array([0.5, 0.75], np.float32), "a": {"x": 1, "b": np.float32(0.125)}},
    ),
    "tuple": (spaces.Tuple([spaces.Discrete(2), spaces.Box(0, 1, (2,)), spaces.Tuple([spaces.MultiBinary(1)])]),
              (1, np.array([0.5, 0.75], np.float32), (np.array([1], np.int8),))),
    "same names": (spaces.Dict({"a": spaces.Box(0, 1, (2,)), "a_0": spaces.Box(0, 1, (1,))}),
                   {"a": np.array([0.5, 0.75], np.float32), "a_0": np.array([1], np.float32)}),
    "picture": (spaces.Box(0, 255, (64, 64, 3), np.uint8), None),
    "small picture": (spaces.Box(0, 255, (2, 2), np.uint8), np.array([[1, 2], [3, 255]], np.uint8)),
    "huge": (spaces.Box(0, 1, (101, 100)), None),
    "many states": (spaces.Discrete(10_001), 3),
    "text": (spaces.Dict({"mission": spaces.Text(5)}), None),
    "sequence": (spaces.Sequence(spaces.Discrete(2)), None),
    "graph": (spaces.Graph(spaces.Discrete(2), None), None),
    "one of": (spaces.OneOf([spaces.Discrete(2), spaces.Discrete(3)]), None),
}

def observing(name):
    space, value = SPACES[name]
    return Scripted(lambda: value, space)

ACTIONS = {
    "discrete": spaces.Discrete(3, start=-1),
    "multi": spaces.MultiDiscrete([[2, 3], [4, 5]], start=[[0, 1], [0, 0]]),
    "binary": spaces.MultiBinary((2, 1)),
    "box": spaces.Box(np.array([-1, 0], np.float32), np.array([1, 0.1], np.float32)),
    "double": spaces.Box(-0.1, 0.1, (1, 2), np.float64),
    "whole": spaces.Box(-3, 3, (2,), np.int32),
    "unbounded": spaces.Box(-np.inf, 1, (2,), np.float32),
    "dict": spaces.Dict({"a": spaces.Discrete(2)}),
    "text": spaces.Text(4),
}

def acting(name):
    """Observes the numbers of its last action, and whether its space contains it."""
    space, last = ACTIONS[name], [np.zeros(6)]
    def on_step(action):
        given = np.asarray(action, float).reshape(-1)
        last[0] = np.concatenate([given, np.zeros(5 - len(given)), [space.contains(action)]])
        kept.append(action)
        return 0.0, False, False, {}
    kept = []
    return Scripted(lambda: last[0], spaces.Box(-9, 9, (6,), np.float64), space, on_step)

def keeping():
    """Observes the sum of the first numbers of all actions so far, which it has kept."""
    kept = []
    def on_step(action):
        kept.append(action)
        return 0.0, False, False, {}
    return Scripted(lambda: np.array([sum(float(each[0]) for each in kept)]), spaces.Box(-9, 9, (1,), np.float64),
                    spaces.Box(-1, 1, (1,), np.float32), on_step)

def fail(error):
    raise error

def deep(n):
    return n and deeper(n - 1)

def deeper(n):
    return n and deep(n - 1)

def deep_step():
    sys.setrecursionlimit(20_000)
    deep(10**6)

FAILURES = {
    "value": lambda: fail(ValueError("too steep")),
    "recursion": deep_step,
    "exit": lambda: sys.exit(3),
    "interrupt": lambda: fail(KeyboardInterrupt()),
    "generator": lambda: fail(GeneratorExit()),
    "stop": lambda: fail(StopIteration()),
    "long": lambda: fail(ValueError("x" * 100_000)),
    "surrogate": lambda: fail(ValueError(os.fsdecode(b"license\\xe9"))),
    "cause": lambda: cause(),
    "import": lambda: __import__("no_such_package.part"),
    "sleep": lambda: time.sleep(60),
}

def cause():
    try:
        fail(KeyError("inner"))
    except KeyError as error:
        raise RuntimeError("outer") from error

def failing(when, how):
    failure = FAILURES[how]
    if when == "make":
        failure()
    return Scripted(on_step=lambda action: (failure() if when == "step" else 0.0, False, False, {}),
                    on_reset=lambda: (failure() if when == "reset" else None, {})[1])

WRONG = {
    "shape": lambda: (np.zeros(3), 0.0),
    "object": lambda: (np.array([None, 1]), 0.0),
    "ragged": lambda: ([[1], 2], 0.0),
    "none": lambda: (None, 0.0),
    "string": lambda: (np.array(["a", "b"]), 0.0),
    "reward none": lambda: (np.zeros(2), None),
    "reward array": lambda: (np.zeros(2), np.zeros(2)),
    "reward text": lambda: (np.zeros(2), "1"),
}

def wrong(name):
    environment = Scripted()
    environment.step = lambda action: (*WRONG[name](), False, False, {})
    return environment

def four_values():
    environment = Scripted()
    environment.step = lambda action: (np.zeros(2), 0.0, False, {})
    return environment

def old_reset():
    environment = Scripted()
    environment.reset = lambda seed=None, options=None: np.zeros(2)
    return environment

def rewarding(kind):
    kinds = {"int": 2, "bool": True, "float32": np.float32(0.5), "array": np.array([1.5]), "nan": float("nan"), "inf": np.inf}
    return Scripted(lambda: np.array([np.nan, -np.inf], np.float32), on_step=lambda action: (kinds[kind], False, False, {}))

def ending(status):
    return Scripted(on_step=lambda action: (0.0, status in ("terminated", "both"), np.bool_(status in ("truncated", "both")), {}))

def informing():
    return Scripted(on_step=lambda action: (0.0, False, False, {"x": np.float64(0.25), "flag": True, "word": "a"}))

def printing():
    def prints(action=None):
        print("from print")
        print("from stderr", file=sys.stderr)
        os.write(1, b"from file descriptor 1\\n")
        libc = ctypes.CDLL(None)
        libc.puts(b"from C")
        libc.fflush(None)
        try:
            input()
        except EOFError:
            print("no input")
        return 0.0, False, False, {}
    prints()
    return Scripted(on_step=prints, on_reset=lambda: prints()[3])

def remembering():
    """Its observation depends on all episodes that it has played."""
    steps = [0]
    def on_step(action):
        steps[0] += 1
        return 0.0, steps[0] % 7 == 0, False, {}
    return Scripted(lambda: np.array([0, min(steps[0], 30)], np.float32), spaces.Box(0, 100, (2,)), on_step=on_step)

def parental():
    """Terminates a forked and a started process in each step, and observes their exit status."""
    import multiprocessing, subprocess
    def on_step(action):
        forked = multiprocessing.get_context("fork").Process(target=time.sleep, args=(60,), daemon=True)
        forked.start()
        started = subprocess.Popen([sys.executable, "-c", "import time; print(1, flush=True); time.sleep(60)"], stdout=-1)
        started.stdout.read(1)
        forked.terminate(), started.terminate()
        forked.join()
        seen[0] = np.array([forked.exitcode, started.wait()], np.float32)
        return 0.0, False, False, {}
    seen = [np.zeros(2, np.float32)]
    return Scripted(lambda: seen[0], on_step=on_step)

class Walk(gymnasium.Env):
    observation_space, action_space = spaces.Box(-np.inf, np.inf, (2,), np.float64), spaces.Box(-1, 1, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = self.np_random.uniform()
        return np.array([self.x, 0.5]), {}

    def step(self, action):
        self.x += float(action[0])
        return np.array([self.x, 2.0 if self.x > 0 else 1.0]), 0.0, False, False, {}

def walk():
    return Walk()

def limited():
    return gymnasium.wrappers.TimeLimit(Walk(), 4)

def picture(render_mode=None, kind="right"):
    pictures = {"right": np.arange(24, dtype=np.uint8).reshape(2, 4, 3), "none": None, "gray": np.zeros((2, 2), np.uint8)}
    return Scripted(picture=pictures[kind] if render_mode == "rgb_array" else None)

SHARED = Scripted()

def shared():
    return SHARED

def nothing():
    return 5

gymnasium.register("Registered-v0", entry_point=Walk, max_episode_steps=3, reward_threshold=float("inf"))
'''


class Worker:
    """A process with the worker, and the program's end of the socket."""

    def __init__(self, python: str | Path = sys.executable, **options: Any) -> None:
        self.socket, other = socket.socketpair()
        self.socket.settimeout(60)
        options = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, **options}
        self.process = subprocess.Popen([python, "-c", BOOTSTRAP], stdin=other, **options)
        other.close()
        self.socket.sendall(struct.pack("<I", len(SOURCE)) + SOURCE)
        self.copies = self.width = self.action_width = self.info_width = 0

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.socket.close()
        self.process.kill()
        self.process.communicate()

    def send(self, tag: bytes, payload: bytes = b"") -> None:
        self.socket.sendall(struct.pack("<Ic", len(payload), tag) + payload)

    def receive(self) -> tuple[bytes, bytes]:
        length, tag = struct.unpack("<Ic", self._exactly(5))
        return tag, self._exactly(length)

    def _exactly(self, count: int) -> bytes:
        found = b""
        while len(found) < count:
            part = self.socket.recv(count - len(found))
            assert part, "the worker has ended"
            found += part
        return found

    def ask(self, tag: bytes, payload: bytes = b"") -> tuple[bytes, bytes]:
        self.send(tag, payload)
        return self.receive()

    def json(self, tag: bytes, payload: bytes, expected: bytes) -> dict[str, Any]:
        found, content = self.ask(tag, payload)
        assert found == expected, (found, content)
        return json.loads(content)

    def configure(self, id: str, answer: bytes = b"J", **changes: Any) -> dict[str, Any]:
        config = {"id": id, "kwargs": {}, "copies": 1, "time_limit": None, "render": False, "discrete": "one_hot"}
        config |= {"log_info": [], "path": [], "expected": None, **changes}
        found = self.json(b"C", json.dumps(config).encode(), answer)
        if answer == b"J":
            self.width, self.action_width = len(found["observations"]), len(found["actions"])
            self.copies, self.info_width = config["copies"], len(config["log_info"])
        return found

    def reset(self, copy: int = 0, seed: int = 0) -> np.ndarray:
        tag, payload = self.ask(b"R", struct.pack("<II", copy, seed))
        assert tag == b"r", payload
        return np.frombuffer(payload, "<f4")

    def step(self, actions: Any, live: Any = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
        """Observations, rewards, infos and status."""
        tag, payload = self.ask(b"S", self.step_payload(actions, live))
        assert tag == b"s", payload
        m, w, k = self.copies, self.width, self.info_width
        numbers = np.frombuffer(payload, "<f4", m * (w + 1 + k))
        assert len(payload) == 4 * len(numbers) + m
        observations, rewards, infos = np.split(numbers, [m * w, m * (w + 1)])
        return observations.reshape(m, w), rewards, infos.reshape(m, k), list(payload[4 * len(numbers) :])

    def step_payload(self, actions: Any, live: Any = None) -> bytes:
        rows = np.zeros((self.copies, self.action_width), "<f4")
        rows[:] = actions
        return bytes([1] * self.copies if live is None else live) + rows.tobytes()

    def failure(self, tag: bytes, payload: bytes) -> dict[str, Any]:
        return self.json(tag, payload, b"E")

    def failed_step(self, actions: Any = 0) -> dict[str, Any]:
        return self.failure(b"S", self.step_payload(actions))

    def probe(self, steps: int = 100, seed: int = 0, seeds: int = 2) -> dict[str, Any]:
        return self.json(b"P", json.dumps({"steps": steps, "seed": seed, "seeds": seeds}).encode(), b"J")

    def quit(self) -> str:
        """Ends the worker, and returns what was printed to stderr."""
        self.send(b"Q")
        out, errors = self.process.communicate(timeout=60)
        assert self.process.returncode == 0
        assert out == b""
        return errors.decode()


@pytest.fixture(scope="module")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with functions that make environments."""
    path = tmp_path_factory.mktemp("tasks") / "worker_tasks.py"
    path.write_text(TASKS)
    return path


def test_the_program_has_the_same_worker():
    assert SOURCE == (REPOSITORY / "crates/seedbed-env/src/gymnasium/worker.py").read_bytes()


def test_description_of_cartpole():
    with Worker() as worker:
        found = worker.configure("CartPole-v1", copies=3)
        assert [each["name"] for each in found["observations"]] == [f"observation_{i}" for i in range(4)]
        assert found["observations"][0] == {"name": "observation_0", "low": float(np.float32(-4.8)), "high": float(np.float32(4.8))}
        assert found["observations"][1] == {"name": "observation_1", "low": None, "high": None}
        assert found["actions"] == [{"name": "action_0", "kind": "discrete", "count": 2}]
        assert (found["time_limit"], found["reward_threshold"], found["control_step"]) == (500, 475.0, 0.02)
        assert found["versions"]["gymnasium"] == gymnasium.__version__
        assert found["versions"]["numpy"] == np.__version__
        assert found["versions"]["python"] == sys.version.split()[0]
        assert found["source"] is None
        assert found["render_fps"] == 50.0
        assert worker.quit() == ""


def test_control_step_and_engine_of_mujoco():
    with Worker() as worker:
        found = worker.configure("HalfCheetah-v5")
        assert found["control_step"] == pytest.approx(0.05)
        assert "mujoco" in found["versions"]
        assert found["actions"][5] == {"name": "action_5", "kind": "continuous", "low": -1.0, "high": 1.0}


def check_same_bits(id: str, copies: int, steps: int, **kwargs: Any) -> list[int]:
    """Compares with environments in this process; returns the status of all steps."""
    environments = [gymnasium.make(id, **kwargs) for _ in range(copies)]
    generator, statuses = np.random.default_rng(0), []
    with Worker() as worker:
        found = worker.configure(id, copies=copies, kwargs=kwargs)
        resets = [3 * i for i in range(copies)]
        for i, environment in enumerate(environments):
            assert worker.reset(i, resets[i]).tobytes() == environment.reset(seed=resets[i])[0].astype("<f4").tobytes()
        for _ in range(steps):
            if "count" in found["actions"][0]:
                actions = generator.integers(found["actions"][0]["count"], size=(copies, 1)).astype("<f4")
            else:
                actions = generator.uniform(-1, 1, (copies, worker.action_width)).astype("<f4")
            observations, rewards, _, status = worker.step(actions)
            for i, environment in enumerate(environments):
                action = int(actions[i, 0]) if "count" in found["actions"][0] else actions[i]
                observation, reward, terminated, truncated, _ = environment.step(action)
                assert observations[i].tobytes() == observation.astype("<f4").tobytes()
                assert rewards[i] == np.float32(reward)
                assert status[i] == (1 if terminated else 2 if truncated else 0)
                if status[i]:
                    resets[i] += 1
                    fresh = environment.reset(seed=resets[i])[0].astype("<f4")
                    assert worker.reset(i, resets[i]).tobytes() == fresh.tobytes()
            statuses += status
    for environment in environments:
        environment.close()
    return statuses


# A warning of SWIG, turned into an error, crashes the import of Box2D.
@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
def test_the_same_bits_as_gymnasium():
    assert set(check_same_bits("CartPole-v1", 3, 600)) == {0, 1}
    assert set(check_same_bits("Pendulum-v1", 2, 450)) == {0, 2}
    assert set(check_same_bits("HalfCheetah-v5", 2, 60, ctrl_cost_weight=0.5)) == {0}
    assert 1 in check_same_bits("LunarLander-v3", 2, 200, gravity=-9.0)


def test_time_limit(tasks: Path):
    for id, limit, expected in (
        ("Pendulum-v1", 5, 5),
        (f"{tasks}:walk", 5, 5),
        (f"{tasks}:walk", None, None),
        (f"{tasks}:limited", None, 4),
        (f"{tasks}:limited", 9, 4),
    ):
        with Worker() as worker:
            assert worker.configure(id, time_limit=limit)["time_limit"] == expected
            worker.reset()
            assert [worker.step(0)[3][0] for _ in range(expected or 3)] == [0] * ((expected or 4) - 1) + [2] * bool(expected)


def test_copies_that_are_not_live():
    with Worker() as worker:
        worker.configure("CartPole-v1", copies=3)
        for copy in range(3):
            worker.reset(copy, 1)
        all_live = worker.step([[1], [1], [1]])
        assert np.all(all_live[0][0] == all_live[0][2]) and all_live[3] == [0, 0, 0]
        observations, rewards, _, status = worker.step([[0], [np.nan], [0]], live=[1, 0, 1])
        assert status == [0, 3, 0]
        assert np.all(observations[1] == 0) and rewards.tolist() == [1, 0, 1]
        assert np.all(observations[0] == observations[2]) and observations[0].any()
        assert worker.step(0, live=[0, 0, 0])[3] == [3, 3, 3]


SPACE_CASES = {
    "box": (["observation_0", "observation_1", "observation_2", "observation_3"], [0.5, 1, 2, 3], (-2.0, 3.0)),
    "scalar": (["observation"], [7], (None, None)),
    "one": (["observation"], [0.25], (0.0, 1.0)),
    "int": (["observation_0", "observation_1", "observation_2"], [1, 2, 3], (0.0, 9.0)),
    "list": (["observation_0", "observation_1", "observation_2"], [1, 2, 3], (0.0, 9.0)),
    "discrete": (["state_5", "state_6", "state_7"], [0, 1, 0], (0.0, 1.0)),
    "multi": (
        ["component_0_is_0", "component_0_is_1", "component_1_is_10", "component_1_is_11", "component_1_is_12"],
        [0, 1, 0, 0, 1],
        (0.0, 1.0),
    ),
    "binary": (["bit_0", "bit_1", "bit_2"], [1, 0, 1], (0.0, 1.0)),
    "dict": (["a.b", "a.x_0", "a.x_1", "z_0", "z_1"], [0.125, 0, 1, 0.5, 0.75], (0.0, 1.0)),
    "tuple": (
        ["0.state_0", "0.state_1", "1.observation_0", "1.observation_1", "2.0.bit_0"],
        [0, 1, 0.5, 0.75, 1],
        (0.0, 1.0),
    ),
    "same names": (["a_0.0", "a_1", "a_0.2"], [0.5, 0.75, 1], (0.0, 1.0)),
    "small picture": (["observation_0", "observation_1", "observation_2", "observation_3"], [1, 2, 3, 255], (0.0, 255.0)),
}


@pytest.mark.parametrize("name", SPACE_CASES)
def test_spaces(tasks: Path, name: str):
    names, values, bounds = SPACE_CASES[name]
    with Worker() as worker:
        found = worker.configure(f"{tasks}:observing", kwargs={"name": name})["observations"]
        assert [each["name"] for each in found] == names
        assert (found[0]["low"], found[0]["high"]) == bounds
        assert worker.reset().tolist() == values
        assert worker.step(0)[0].tolist() == [values]


def test_spaces_as_numbers(tasks: Path):
    for name, names, values, bounds in (
        ("discrete", ["state"], [6], (5.0, 7.0)),
        ("multi", ["component_0", "component_1"], [1, 12], (0.0, 1.0)),
        ("many states", ["state"], [3], (0.0, 10_000.0)),
        ("tuple", ["0.state", "1.observation_0", "1.observation_1", "2.0.bit_0"], [1, 0.5, 0.75, 1], (0.0, 1.0)),
        ("dict", ["a.b", "a.x", "z_0", "z_1"], [0.125, 1, 0.5, 0.75], (0.0, 1.0)),
    ):
        with Worker() as worker:
            found = worker.configure(f"{tasks}:observing", kwargs={"name": name}, discrete="number")["observations"]
            assert [each["name"] for each in found] == names
            assert (found[0]["low"], found[0]["high"]) == bounds
            assert worker.reset().tolist() == values


@pytest.mark.parametrize(
    ("name", "word", "help"),
    [
        ("picture", "picture of shape (64, 64, 3)", "TransformObservation"),
        ("huge", "10100 numbers", "FilterObservation"),
        ("many states", "10001 numbers", '"number"'),
        ("text", "`mission` is a space of type Text", "FilterObservation"),
        ("sequence", "type Sequence", "TransformObservation"),
        ("graph", "type Graph", "TransformObservation"),
        ("one of", "type OneOf", "TransformObservation"),
    ],
)
def test_observations_that_are_refused(tasks: Path, name: str, word: str, help: str):
    with Worker() as worker:
        found = worker.configure(f"{tasks}:observing", b"E", kwargs={"name": name})
        assert found["kind"] == "space" and word in found["message"] and help in found["help"]


@pytest.mark.parametrize(
    ("name", "components", "given", "action"),
    [
        ("discrete", [3], [2], [1]),
        ("multi", [2, 3, 4, 5], [1, 0, 3, 2], [1, 1, 3, 2]),
        ("binary", [2, 2], [0, 1], [0, 1]),
        ("box", [(-1, 1), (0, float(np.float32(0.1)))], [-0.5, 0.1], [-0.5, float(np.float32(0.1))]),
        ("double", [(-0.1, 0.1), (-0.1, 0.1)], [-0.1, 0.1], [-0.1, 0.1]),
        ("whole", [(-3, 3), (-3, 3)], [1.6, -3], [2, -3]),
    ],
)
def test_actions(tasks: Path, name: str, components: list[Any], given: list[float], action: list[float]):
    with Worker() as worker:
        found = worker.configure(f"{tasks}:acting", kwargs={"name": name}, copies=2)["actions"]
        assert [each.get("count", (each.get("low"), each.get("high"))) for each in found] == components
        assert [each["name"] for each in found] == [f"action_{i}" for i in range(len(found))]
        observations = worker.step([given, given], live=[0, 1])[0]
        assert observations[1, : len(action)].tolist() == np.float32(action).tolist()
        assert observations[1, 5] == 1, "the space does not contain the action"
        # Random actions of the probe are also inside.
        assert worker.probe(50)["ranges"][5] == [0.0, 1.0]


def test_actions_are_not_overwritten(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:keeping")
        assert [worker.step(value)[0][0, 0] for value in (0.5, 0.25, 1)] == [0.5, 0.75, 1.75]


def test_actions_that_are_refused(tasks: Path):
    for name, word in (("unbounded", "finite bounds"), ("dict", "type Dict"), ("text", "type Text")):
        with Worker() as worker:
            found = worker.configure(f"{tasks}:acting", b"E", kwargs={"name": name})
            assert found["kind"] == "space" and word in found["message"]
            assert "gymnasium.wrappers.TransformAction" in found["help"]


def test_rewards_and_numbers_that_are_not_finite(tasks: Path):
    for kind, expected in (("int", 2), ("bool", 1), ("float32", 0.5), ("array", 1.5), ("nan", np.nan), ("inf", np.inf)):
        with Worker() as worker:
            worker.configure(f"{tasks}:rewarding", kwargs={"kind": kind})
            observations, rewards, _, _ = worker.step(0)
            np.testing.assert_equal(rewards, np.float32([expected]))
            np.testing.assert_equal(observations, np.float32([[np.nan, -np.inf]]))


def test_ends(tasks: Path):
    for status, expected in (("terminated", 1), ("truncated", 2), ("both", 1), ("none", 0)):
        with Worker() as worker:
            worker.configure(f"{tasks}:ending", kwargs={"status": status})
            assert worker.step(0)[3] == [expected]


def test_log_info(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:informing", copies=2, log_info=["flag", "x"])
        assert np.isnan(worker.reset()[2:]).all()
        assert worker.step(0)[2].tolist() == [[1, 0.25], [1, 0.25]]
    with Worker() as worker:
        worker.configure("HalfCheetah-v5", log_info=["x_position"])
        assert np.isfinite(worker.reset()[-1])
        worker.step(0)
    for name, word in (("y", "no `y`, only: x, flag, word"), ("word", "`word` of info is str 'a'")):
        with Worker() as worker:
            worker.configure(f"{tasks}:informing", log_info=[name])
            found = worker.failed_step()
            assert (found["kind"], found["copy"]) == ("info", 0) and word in found["message"]


def test_ids(tasks: Path):
    folder = str(tasks.parent)
    with Worker() as worker:
        found = worker.configure("worker_tasks:Registered-v0", path=[folder])
        assert (found["time_limit"], found["reward_threshold"]) == (3, None)
        assert found["source"] == {"file": str(tasks), "sha256": hashlib.sha256(tasks.read_bytes()).hexdigest()}
    with Worker() as worker:
        assert worker.configure("worker_tasks:plain", path=[folder])["source"]["file"] == str(tasks)
    with Worker() as worker:
        assert worker.configure(f"{tasks}:plain")["source"]["file"] == str(tasks)
        assert worker.configure("CartPole-v1", b"E")["kind"] == "protocol"
    for id, kind, word, help in (
        ("CartPol-v1", "unknown_id", "Did you mean: `CartPole`", "module"),
        ("CartPole-v77", "unknown_id", "CartPole", "module"),
        ("not an id!", "unknown_id", "Malformed", "module"),
        ("Nowhere/CartPole-v1", "unknown_id", "Nowhere", "module"),
        (f"{tasks}:absent", "unknown_id", "no function `absent`", "plain"),
        ("/no/such/file.py:make", "unknown_id", "no file /no/such/file.py", None),
        ("no_such_package:X-v0", "missing_package", "no_such_package", "pip install no_such_package"),
        ("no_such_package:Class", "missing_package", "no_such_package", "pip install no_such_package"),
        ("gymnasium:NoSuchClass", "unknown_id", "NoSuchClass", "has its class"),
        (f"{tasks}:nothing", "make", "returned int 5, expected a gymnasium.Env", None),
    ):
        with Worker() as worker:
            found = worker.configure(id, b"E")
            assert found["kind"] == kind and word in found["message"], found
            assert found["help"] is None if help is None else help in found["help"]
    with Worker() as worker:
        found = worker.configure(f"{tasks}:shared", b"E", copies=2)
        assert found["kind"] == "make" and "made twice" in found["message"]
    with Worker() as worker:
        found = worker.configure("CartPole-v1", b"E", kwargs={"color": 3})
        assert found["kind"] == "make" and "TypeError" in found["message"] and "color" in found["message"]


def test_the_version_of_a_package_that_is_not_installed_is_that_of_its_files(tmp_path: Path):
    package = tmp_path / "own_package"
    package.mkdir()
    (package / "__init__.py").write_text("from .task import Task\n")
    (package / "task.py").write_text("import gymnasium\nfrom .size import SIZE\n" + TASK_OF_SIZE)
    versions = []
    for size in (1, 1, 2):
        (package / "size.py").write_text(f"SIZE = {size}  # {'x' * size}\n")
        with Worker() as worker:
            versions.append(worker.configure("own_package:Task", path=[str(tmp_path)])["versions"]["own_package"])
    assert versions[0] == versions[1] != versions[2]
    assert re.fullmatch("files [0-9a-f]{16}", versions[0])
    with Worker() as worker:
        assert set(worker.configure("CartPole-v1")["versions"]) == {"python", "gymnasium", "numpy"}


TASK_OF_SIZE = """
class Task(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(0, SIZE, (1,))
    action_space = gymnasium.spaces.Discrete(2)
"""


def test_expected_widths():
    with Worker() as worker:
        worker.configure("CartPole-v1", expected={"observation_width": 4, "action_width": 1})
    with Worker() as worker:
        found = worker.configure("CartPole-v1", b"E", expected={"observation_width": 5, "action_width": 1})
        assert found["kind"] == "space" and "observation_width is 4, expected 5" in found["message"]


def fail(worker: Worker, tasks: Path, when: str, how: str) -> dict[str, Any]:
    id, kwargs = f"{tasks}:failing", {"when": when, "how": how}
    if when == "make":
        return worker.configure(id, b"E", kwargs=kwargs)
    worker.configure(id, kwargs=kwargs, copies=2)
    if when == "reset":
        return worker.failure(b"R", struct.pack("<II", 1, 0))
    return worker.failure(b"S", worker.step_payload(0, live=[0, 1]))


@pytest.mark.parametrize("when", ["make", "reset", "step"])
@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("value", "ValueError: too steep"),
        ("recursion", "RecursionError: maximum recursion depth exceeded"),
        ("exit", "SystemExit: 3"),
        ("interrupt", "KeyboardInterrupt"),
        ("generator", "GeneratorExit"),
        ("stop", "StopIteration"),
        ("long", "ValueError: xxx"),
        ("surrogate", "ValueError: license?"),
        ("cause", "RuntimeError: outer"),
    ],
)
def test_exceptions(tasks: Path, when: str, how: str, message: str):
    with Worker() as worker:
        found = fail(worker, tasks, when, how)
        assert found["kind"] == when and found["message"].startswith(message)
        assert len(found["message"]) < 1100
        assert found["copy"] == (None if when == "make" else 1)
        lines = found["traceback"].splitlines()
        assert len(lines) <= 30 and len(found["traceback"]) <= 4000
        if how != "long":
            assert f'File "{tasks}"' in found["traceback"] and lines[-1].startswith(message)
        assert 'File "worker"' not in found["traceback"]
        if how == "cause":
            assert "KeyError: 'inner'" in found["traceback"]
        # The worker continues.
        if when == "reset":
            assert worker.step(0)[3] == [0, 0]
        if when == "step":
            assert len(worker.reset(1)) == 2
        worker.quit()


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("shape", "the observation is an array of shape (3,) of float64, expected an array of shape (2,) of numbers"),
        ("object", "the observation is an array of shape (2,) of object"),
        ("ragged", "the observation is list [[1], 2]"),
        ("none", "the observation is NoneType None"),
        ("string", "the observation is an array of shape (2,) of <U1"),
        ("reward none", "the reward is NoneType None, expected a number"),
        ("reward array", "the reward is an array of shape (2,)"),
        ("reward text", "the reward is str '1'"),
    ],
)
def test_wrong_results(tasks: Path, name: str, word: str):
    with Worker() as worker:
        worker.configure(f"{tasks}:wrong", kwargs={"name": name})
        found = worker.failed_step()
        assert (found["kind"], found["copy"]) == ("shape", 0) and word in found["message"]


def test_wrong_numbers_of_results(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:four_values")
        found = worker.failed_step()
        assert found["kind"] == "shape" and "step returned 4 values, expected 5 values" in found["message"]
    with Worker() as worker:
        worker.configure(f"{tasks}:old_reset")
        found = worker.failure(b"R", struct.pack("<II", 0, 0))
        assert found["kind"] == "shape" and "reset returned an array of shape (2,)" in found["message"]


def test_states_outside_of_their_space(tasks: Path):
    text = tasks.read_text().replace("np.int64(6)", "np.int64(8)").replace("np.array([1, 12])", "np.array([1, 13])")
    text = text.replace('"b": np.float32(0.125)', '"c": 0')
    other = tasks.with_name("other_tasks.py")
    other.write_text(text)
    for name, word in (("discrete", "from 5 to 7"), ("multi", "[0, 10] to [1, 12]"), ("dict", "expected entries b, x")):
        with Worker() as worker:
            worker.configure(f"{other}:observing", kwargs={"name": name})
            found = worker.failure(b"R", struct.pack("<II", 0, 0))
            assert found["kind"] == "shape" and word in found["message"]


def test_prints_do_not_break_the_stream(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:printing")
        worker.reset()
        assert worker.step(0)[3] == [0]
        errors = worker.quit()
        for line in ("from print", "from stderr", "from file descriptor 1", "from C", "no input"):
            assert errors.count(line + "\n") == 3, line


def test_unexpected_requests(tasks: Path):
    with Worker() as worker:
        assert worker.failure(b"S", b"")["kind"] == "protocol"
        worker.configure("CartPole-v1")
        assert worker.failure(b"S", b"")["kind"] == "protocol"
        assert worker.failure(b"X", b"abc")["kind"] == "protocol"
        assert worker.failure(b"P", b"{")["kind"] == "protocol"
        assert worker.failure(b"R", struct.pack("<II", 7, 0))["kind"] == "reset"
        worker.send(b"R", struct.pack("<II", 0, 3))
        worker.send(b"R", struct.pack("<II", 0, 3))
        assert worker.receive() == worker.receive()
        large = worker.failure(b"X", bytes(200_000))
        assert large["kind"] == "protocol"
        assert len(worker.reset()) == 4


def test_a_step_before_a_reset():
    with Worker() as worker:
        worker.configure("CartPole-v1")
        found = worker.failed_step()
        assert found["kind"] == "step" and "ResetNeeded" in found["message"]


HIDING = """
import sys
class Hiding:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {hidden!r}:
            raise ModuleNotFoundError('No module named ' + repr(name), name=name)
sys.meta_path.insert(0, Hiding())
"""


@pytest.mark.parametrize(
    ("hidden", "id", "help"),
    [
        ("gymnasium", "CartPole-v1", "pip install gymnasium"),
        ("numpy", "CartPole-v1", "pip install gymnasium"),
        ("Box2D", "BipedalWalker-v3", 'pip install "gymnasium[box2d]"'),
        ("mujoco", "HalfCheetah-v5", 'pip install "gymnasium[mujoco]"'),
        ("ale_py", "ale_py:ALE/Pong-v5", "pip install ale-py"),
        ("minigrid", "minigrid:MiniGrid-Empty-5x5-v0", "pip install minigrid"),
    ],
)
def test_missing_packages(tmp_path: Path, hidden: str, id: str, help: str):
    (tmp_path / "sitecustomize.py").write_text(HIDING.format(hidden=[hidden]))
    with Worker(env={**os.environ, "PYTHONPATH": str(tmp_path)}) as worker:
        found = worker.configure(id, b"E")
        assert (found["kind"], found["help"]) == ("missing_package", help)
        assert hidden in found["message"]
        worker.quit()


def test_missing_pygame_is_found_by_pictures(tmp_path: Path):
    (tmp_path / "sitecustomize.py").write_text(HIDING.format(hidden=["pygame"]))
    with Worker(env={**os.environ, "PYTHONPATH": str(tmp_path)}) as worker:
        worker.configure("CartPole-v1", render=True)
        worker.reset()
        found = worker.failure(b"F", struct.pack("<I", 0))
        assert (found["kind"], found["help"]) == ("missing_package", 'pip install "gymnasium[classic-control]"')


def test_a_missing_package_in_a_step(tasks: Path):
    with Worker() as worker:
        found = fail(worker, tasks, "step", "import")
        help = "pip install no_such_package; if it is your own, install its folder, or run this in the folder that has it"
        assert (found["kind"], found["help"], found["copy"]) == ("missing_package", help, 1)


def test_pictures(tasks: Path):
    with Worker(env={**os.environ, "SDL_VIDEODRIVER": "dummy"}) as worker:
        worker.configure("CartPole-v1", render=True, copies=2)
        worker.reset(1, 4)
        tag, payload = worker.ask(b"F", struct.pack("<I", 1))
        assert tag == b"I" and struct.unpack("<II", payload[:8]) == (400, 600)
        with gymnasium.make("CartPole-v1", render_mode="rgb_array") as environment:
            environment.reset(seed=4)
            assert payload[8:] == environment.render().tobytes()
    with Worker() as worker:
        worker.configure(f"{tasks}:picture", render=True)
        assert worker.ask(b"F", struct.pack("<I", 0)) == (b"I", struct.pack("<II", 2, 4) + bytes(range(24)))
    for kind, word in (("none", "NoneType"), ("gray", "shape (2, 2)")):
        with Worker() as worker:
            worker.configure(f"{tasks}:picture", render=True, kwargs={"kind": kind})
            found = worker.failure(b"F", struct.pack("<I", 0))
            assert found["kind"] == "render" and word in found["message"]


def test_probe_of_cartpole():
    with Worker() as worker:
        worker.configure("CartPole-v1", copies=2)
        before = worker.reset(0, 5)
        found = worker.probe(2000, seed=3)
        assert found["reproducible"] is True and found["difference"] is None
        assert found["episodes"] > 50
        assert 15 < found["mean_length"] < 30 and found["steps_per_second"] > 100
        for low, high in found["ranges"]:
            assert -6 < low < 0 < high < 6
        again = worker.probe(2000, seed=3)
        for key in ("ranges", "episodes", "mean_length", "reproducible"):
            assert found[key] == again[key]
        # The copies that are served were not touched: this one continues its episode.
        environment = gymnasium.make("CartPole-v1")
        assert np.all(environment.reset(seed=5)[0] == before)
        assert np.all(environment.step(1)[0] == worker.step([[1], [0]], live=[1, 0])[0][0])


def test_probe_of_ranges_and_unfinished_episodes(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:walk")
        found = worker.probe(50)
        assert found["ranges"][1][0] == 0.5 and found["ranges"][1][1] in (1.0, 2.0)
        assert found["ranges"][0][0] < found["ranges"][0][1]
        assert (found["episodes"], found["mean_length"]) == (0, 50.0)
        assert found["reproducible"] is True
    with Worker() as worker:
        worker.configure(f"{tasks}:limited")
        found = worker.probe(50)
        assert (found["episodes"], found["mean_length"]) == (12, 4.0)


def test_probe_finds_what_depends_on_history(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:remembering")
        found = worker.probe(20)
        assert found["reproducible"] is False
        assert found["difference"].startswith("observation `observation_1` after the reset: 0.0 in a fresh environment, ")
    with Worker() as worker:
        worker.configure("BipedalWalker-v3")
        found = worker.probe(100, seeds=3)
        assert found["reproducible"] is False and "in a fresh environment" in found["difference"]


def test_probe_reports_failures(tasks: Path):
    for when in ("reset", "step"):
        with Worker() as worker:
            worker.configure(f"{tasks}:failing", kwargs={"when": when, "how": "value"})
            found = worker.failure(b"P", b'{"steps": 10, "seed": 0, "seeds": 1}')
            place = "step 1 after reset(seed=0), action 1: " if when == "step" else ""
            assert (found["kind"], found["copy"], found["message"]) == (when, None, f"{place}ValueError: too steep")


def ends_within(pid: int, seconds: float) -> bool:
    """Whether a process ends, or is only kept for its parent to read its exit status."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.02)
    return False


PARENT = """
import json, os, socket, struct, subprocess, sys, time
near, far = socket.socketpair()
process = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdin=far)
source = open(sys.argv[2], "rb").read()
near.sendall(struct.pack("<I", len(source)) + source)
config = json.dumps({"id": sys.argv[3], "kwargs": {"when": "step", "how": "sleep"}, "copies": 1}).encode()
near.sendall(struct.pack("<Ic", len(config), b"C") + config)
assert near.recv(5)[4:] == b"J"
near.sendall(struct.pack("<Ic", 5, b"S") + b"\\1" + bytes(4))
time.sleep(0.3)
print(process.pid, flush=True)
time.sleep(60)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux to end the worker with its parent")
def test_the_worker_ends_with_its_parent_in_the_middle_of_a_step(tasks: Path):
    arguments = [BOOTSTRAP, seedbed.worker.__file__, f"{tasks}:failing"]
    with subprocess.Popen([sys.executable, "-c", PARENT, *arguments], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        assert not ends_within(pid, 0.2)
        parent.send_signal(signal.SIGKILL)
        assert ends_within(pid, 5)


def test_the_worker_ignores_signals_and_ends_with_the_stream():
    with Worker() as worker:
        worker.configure("CartPole-v1")
        for number in (signal.SIGINT, signal.SIGTERM):
            worker.process.send_signal(number)
        assert len(worker.reset()) == 4
        worker.socket.close()
        assert worker.process.wait(timeout=60) == 0


def test_environments_can_terminate_their_processes(tasks: Path):
    with Worker() as worker:
        worker.configure(f"{tasks}:parental")
        assert worker.step(0)[0].tolist() == [[-signal.SIGTERM, -signal.SIGTERM]]


def test_the_module_serves_too():
    near, far = socket.socketpair()
    with near, subprocess.Popen([sys.executable, "-m", "seedbed.worker"], stdin=far) as process:
        far.close()
        config = json.dumps({"id": "CartPole-v1", "copies": 1}).encode()
        near.sendall(struct.pack("<Ic", len(config), b"C") + config)
        assert near.recv(5)[4:] == b"J"
        near.close()
        assert process.wait(timeout=60) == 0


SOURCES_ONLY = """
import sys
import seedbed
assert "gymnasium" not in sys.modules
import seedbed.worker
assert dir(seedbed) == sorted(seedbed.__all__), dir(seedbed)
from seedbed import RecordVisitation, RecordVisitationVector, RecordingError, RunError, load, runs
for name in ("make", "Task", "__version__", "VectorEnv"):
    try:
        getattr(seedbed, name)
    except ImportError as error:
        assert f"seedbed.{name} needs the native module" in str(error), error
    else:
        raise AssertionError(name)
assert not hasattr(seedbed, "nonsense")
"""


def test_sources_without_the_native_module(tmp_path: Path):
    """As in a checkout: the worker and recorders can be imported, and all else says what is missing."""
    for package in ("seedbed", "seedbed_command"):
        (tmp_path / package).mkdir()
        for path in (REPOSITORY / "python" / package).glob("*.py"):
            (tmp_path / package / path.name).write_bytes(path.read_bytes())
    result = subprocess.run([sys.executable, "-c", SOURCES_ONLY], cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_the_package_lists_its_public_names():
    assert dir(seedbed) == sorted(seedbed.__all__)
    for name in seedbed.__all__:
        assert getattr(seedbed, name) is not None
    assert not hasattr(seedbed, "nonsense")
