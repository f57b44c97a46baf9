"""Serves copies of a Gymnasium environment to the program `seedbed`, over a socket that is file descriptor 0.

The program starts Python with the text of this file; `python -m seedbed.worker` serves in the same way. Each request is
answered by one frame: u32 length of the payload, u8 tag, payload; all numbers are little-endian.

    request                                   answer
    C  JSON: the environment (first, once)    J  JSON: names, bounds, versions: see `description`
    R  u32 copy, u32 seed: reset a copy       r  f32 observation [W], f32 info [k]
    S  u8 is_live [M], f32 actions [M × A]    s  f32 observations [M × W], f32 rewards [M], f32 infos [M × k], u8 status [M]
    P  JSON: steps, seed, seeds               J  JSON: ranges, speed, reproducibility: see `probe`
    F  u32 copy: picture                      I  u32 height, u32 width, u8 RGB [height × width × 3]
    Q  (or the end of the stream)             none: the worker ends

Any other answer is E, JSON: kind, message, help, copy and traceback of a failure. No failure of an environment, not
even SystemExit, ends the worker. It ends with the thread that started it, which on Linux must therefore live on.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import hashlib
import importlib.metadata
import importlib.util
import inspect
import json
import math
import operator
import os
import platform
import re
import signal
import socket
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers: TypeAlias = NDArray[Any]
    Environment: TypeAlias = "gymnasium.Env[Any, Any]"

HEADER = struct.Struct("<Ic")
TWO_NUMBERS = struct.Struct("<II")
OWN_FILE = (lambda: None).__code__.co_filename
PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux

MAX_NUMBERS = 10_000  # per observation
MAX_PICTURE_NUMBERS = 100
UNBOUNDED = 1e6
"""Bounds of observations that are farther from 0 say nothing about values."""
UNBOUNDED_ACTION = 1e30

MAX_TRACEBACK_LINES = 30
MAX_TRACEBACK_CHARACTERS = 4000
MAX_MESSAGE_CHARACTERS = 1000

EPISODE_STEPS = 200  # of episodes that are compared
HISTORY_STEPS = 1000  # of the whole episode that a used environment played before
RUNNING, TERMINATED, TRUNCATED, NOT_LIVE = range(4)

PACKAGES = {
    "Box2D": '"gymnasium[box2d]"',
    "swig": '"gymnasium[box2d]"',
    "mujoco": '"gymnasium[mujoco]"',
    "pygame": '"gymnasium[classic-control]"',
    "jax": '"gymnasium[jax]"',
    "ale_py": "ale-py",
    "cv2": "opencv-python",
    "PIL": "pillow",
    "yaml": "pyyaml",
    "sklearn": "scikit-learn",
    "numpy": "gymnasium",
}
"""What to install for a module, where it is not the module's name."""
ENGINES = ("mujoco", "Box2D", "ale_py", "pybullet", "jax")
"""Packages whose version changes results, if they are loaded."""


# The process


def take_stream() -> socket.socket:
    """Takes the socket away from file descriptor 0; environments then read nothing, and print to stderr."""
    connection = socket.socket(fileno=os.dup(0))
    connection.setblocking(True)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    os.dup2(2, 1)
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=connection.close)
    return connection


def end_with_parent() -> None:
    """Lets this process end when its parent does, even in the middle of a step."""
    parent = os.getppid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(0)
    else:
        threading.Thread(target=watch_parent, args=(parent,), daemon=True).start()


def watch_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(0)


def prepare_process() -> socket.socket:
    """Returns the stream. Must be called before NumPy is imported, which starts threads."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    try:
        connection = take_stream()
    except OSError:
        sys.exit("error: the program `seedbed` starts this worker, with a socket as standard input")
    end_with_parent()
    faulthandler.enable()
    return connection


if __name__ == "__main__":
    connection = prepare_process()

missing: ModuleNotFoundError | None = None
try:
    import gymnasium
    import numpy as np
    from gymnasium import spaces
except ModuleNotFoundError as error:
    missing = error


# Failures


class Failure(Exception):
    """An answer `E`: kind, message for people, what helps, number of the copy, and Python's traceback."""

    def __init__(self, kind: str, message: str, help: str | None = None, copy: int | None = None) -> None:
        super().__init__(message)
        self.content = {"kind": kind, "message": message, "help": help, "copy": copy, "traceback": ""}


def failure(error: BaseException, kind: str, copy: int | None = None) -> Failure:
    """The answer to an exception: an own failure, a missing package, an unknown id, or one of the given kind."""
    if isinstance(error, Failure):
        if error.content["copy"] is None:
            error.content["copy"] = copy
        return error
    found = missing_package(error) or unknown_id(error) or Failure(kind, message_of(error))
    found.content.update(copy=copy, traceback=traceback_of(error))
    return found


def message_of(error: BaseException) -> str:
    try:
        text = str(error)
    except BaseException:
        text = ""
    text = f"{type(error).__name__}: {text}" if text else type(error).__name__
    return text if len(text) <= MAX_MESSAGE_CHARACTERS else text[:MAX_MESSAGE_CHARACTERS] + " …"


def traceback_of(error: BaseException) -> str:
    """The end of Python's traceback, without frames of this file."""
    try:
        whole = traceback.TracebackException.from_exception(error, limit=-MAX_TRACEBACK_LINES)
        part: traceback.TracebackException | None = whole
        while part is not None:
            part.stack = traceback.StackSummary.from_list([each for each in part.stack if each.filename != OWN_FILE])
            part = part.__cause__ or part.__context__
        lines = "".join(whole.format()).splitlines()[-MAX_TRACEBACK_LINES:]
    except BaseException:
        lines = [message_of(error)]
    return "\n".join(lines)[-MAX_TRACEBACK_CHARACTERS:]


def missing_package(error: BaseException) -> Failure | None:
    """The failure if an import failed because a module is not installed."""
    dependency_error: type[BaseException] = ImportError if missing else gymnasium.error.DependencyNotInstalled
    if not isinstance(error, (ImportError, dependency_error)):
        return None
    cause: BaseException | None = error
    while cause is not None and not (isinstance(cause, ModuleNotFoundError) and cause.name):
        cause = cause.__cause__ or cause.__context__
    if isinstance(cause, ModuleNotFoundError) and cause.name:
        module = cause.name.partition(".")[0]
        message = f"the Python package {module} is not installed for {sys.executable} ({message_of(error)})"
        return Failure("missing_package", message, f"pip install {PACKAGES.get(module, module)}")
    command = re.search(r"pip install [^`]+", message_of(error))
    return Failure("missing_package", message_of(error), command[0]) if command else None


def unknown_id(error: BaseException) -> Failure | None:
    """The failure if Gymnasium knows no environment of this name; its message may contain a suggestion."""
    if missing or not isinstance(error, gymnasium.error.Error):
        return None
    is_unknown = str(error).startswith(("No registered env", "Malformed environment ID"))
    if not (is_unknown or isinstance(error, gymnasium.error.UnregisteredEnv)):
        return None
    help = "name the module that registers it, such as minigrid:MiniGrid-Empty-5x5-v0 or ale_py:ALE/Pong-v5"
    return Failure("unknown_id", message_of(error), help)


# Observations


@dataclass
class Flat:
    """How an observation becomes a row of numbers: their names and bounds, and what writes them into a row."""

    names: list[str]
    lows: list[float]
    highs: list[float]
    write: Callable[[Any, Numbers], None]


def flat(space: Any, one_hot: bool, prefix: str = "", key: str | None = None) -> Flat:
    """Flattens a space, whose names begin with `prefix`; `key` is its name in a Dict.

    Raises:
        Failure: There is no way, of kind "space".
    """
    place = f"observation `{prefix}{key or ''}`" if prefix or key is not None else "the observation"
    if isinstance(space, spaces.Box):
        return flat_box(space, prefix + (key or "observation"), place)
    if isinstance(space, spaces.Discrete):
        return flat_discrete(space, one_hot, prefix + (key or "state"), place)
    if isinstance(space, spaces.MultiDiscrete):
        return flat_multi_discrete(space, one_hot, prefix + (key or "component"), place)
    if isinstance(space, spaces.MultiBinary):
        return flat_multi_binary(space, prefix + (key or "bit"), place)
    inner = prefix if key is None else f"{prefix}{key}."
    if isinstance(space, spaces.Dict):
        keys = sorted(space.spaces, key=str)
        return flat_parts({each: flat(space[each], one_hot, inner, str(each)) for each in keys}, Mapping, place)
    if isinstance(space, spaces.Tuple):
        parts = {i: flat(each, one_hot, f"{inner}{i}.") for i, each in enumerate(space.spaces)}
        return flat_parts(parts, (tuple, list), place)
    help = "leave it out with gymnasium.wrappers.FilterObservation, or turn it into a Box with TransformObservation"
    raise Failure("space", f"{place} is a space of type {type(space).__name__}, which has no fixed number of numbers", help)


def numbered(stem: str, count: int) -> list[str]:
    return [f"{stem}_{i}" for i in range(count)]


def wrong(place: str, value: Any, expected: str) -> Failure:
    """The failure if an environment returns something that its spaces do not contain."""
    with contextlib.suppress(Exception):
        value = f"an array of shape {np.asarray(value).shape} and type {np.asarray(value).dtype}"
    return Failure("shape", f"{place} is {value}, expected {expected}")


def as_array(value: Any, shape: tuple[int, ...], kinds: str, place: str) -> Numbers:
    """Raises: Failure: The value has another shape, or is of none of the kinds of NumPy."""
    array: Numbers | None = None
    with contextlib.suppress(ValueError, TypeError):
        array = np.asarray(value)
    if array is None or array.shape != shape or array.dtype.kind not in kinds:
        raise wrong(place, value, f"an array of shape {shape} of {'numbers' if 'f' in kinds else 'whole numbers'}")
    return array


def flat_box(space: spaces.Box, stem: str, place: str) -> Flat:
    shape = space.shape
    count = math.prod(shape)
    if space.dtype == np.uint8 and len(shape) >= 2 and count > MAX_PICTURE_NUMBERS:
        help = "choose a variant of the environment that observes numbers, or compute some with TransformObservation"
        raise Failure("space", f"{place} is a picture of shape {shape}, and pictures are not supported", help)
    is_flat = len(shape) <= 1

    def write(value: Any, row: Numbers) -> None:
        if type(value) is not np.ndarray or value.shape != shape or value.dtype.kind not in "fiub":
            value = as_array(value, shape, "fiub", place)
        row[:] = value if is_flat else value.reshape(-1)

    names = [stem] if count == 1 else numbered(stem, count)
    return Flat(names, space.low.reshape(-1).tolist(), space.high.reshape(-1).tolist(), write)


def flat_discrete(space: spaces.Discrete, one_hot: bool, stem: str, place: str) -> Flat:
    start, count = int(space.start), int(space.n)

    def index(value: Any) -> int:
        try:
            found = operator.index(value) - start
        except TypeError:
            found = -1
        if not 0 <= found < count:
            raise Failure("shape", f"{place} is {value!r:.100}, expected a whole number from {start} to {start + count - 1}")
        return found

    def write_one_hot(value: Any, row: Numbers) -> None:
        row[:] = 0
        row[index(value)] = 1

    def write_number(value: Any, row: Numbers) -> None:
        row[0] = index(value) + start

    if not one_hot:
        return Flat([stem], [float(start)], [float(start + count - 1)], write_number)
    check_count(count)
    return Flat([f"{stem}_{start + i}" for i in range(count)], [0] * count, [1] * count, write_one_hot)


def flat_multi_discrete(space: spaces.MultiDiscrete, one_hot: bool, stem: str, place: str) -> Flat:
    counts, starts = space.nvec.reshape(-1), space.start.reshape(-1)
    offsets = np.cumsum(counts) - counts

    def numbers(value: Any) -> Numbers:
        found = as_array(value, space.shape, "iub", place).reshape(-1)
        if (found < starts).any() or (found >= starts + counts).any():
            raise Failure("shape", f"{place} is {value!s:.100}, expected numbers below {(starts + counts).tolist()}")
        return found

    def write_one_hot(value: Any, row: Numbers) -> None:
        row[:] = 0
        row[offsets + numbers(value) - starts] = 1

    def write_numbers(value: Any, row: Numbers) -> None:
        row[:] = numbers(value)

    if not one_hot:
        lows, highs = starts.astype(float).tolist(), (starts + counts - 1).astype(float).tolist()
        return Flat(numbered(stem, len(counts)), lows, highs, write_numbers)
    check_count(int(counts.sum()))
    names = [f"{stem}_{i}_is_{starts[i] + k}" for i in range(len(counts)) for k in range(counts[i])]
    return Flat(names, [0] * len(names), [1] * len(names), write_one_hot)


def flat_multi_binary(space: spaces.MultiBinary, stem: str, place: str) -> Flat:
    count = math.prod(space.shape)

    def write(value: Any, row: Numbers) -> None:
        row[:] = as_array(value, space.shape, "fiub", place).reshape(-1)

    return Flat(numbered(stem, count), [0] * count, [1] * count, write)


def flat_parts(parts: dict[Any, Flat], kind: Any, place: str) -> Flat:
    """One row of the rows of all parts, which are the values of a Dict or Tuple."""
    names = [name for part in parts.values() for name in part.names]
    slices, end = [], 0
    for key, part in parts.items():
        slices.append((key, part.write, end, end + len(part.names)))
        end += len(part.names)

    def write(value: Any, row: Numbers) -> None:
        if not isinstance(value, kind) or len(value) < len(parts):
            keys = ", ".join(map(str, parts))
            raise Failure("shape", f"{place} is {type(value).__name__} {value!s:.100}, expected one with entries {keys}")
        for key, write_part, begin, end in slices:
            try:
                inner = value[key]
            except LookupError:
                raise Failure("shape", f"{place} has no entry `{key}`") from None
            write_part(inner, row[begin:end])

    lows = [low for part in parts.values() for low in part.lows]
    return Flat(names, lows, [high for part in parts.values() for high in part.highs], write)


def check_count(count: int) -> None:
    if count > MAX_NUMBERS:
        help = 'observe numbers instead of one per state with `discrete: "number"`, or leave some out with TransformObservation'
        raise Failure("space", f"an observation has {count} numbers, expected at most {MAX_NUMBERS}", help)


def observations_of(space: Any, one_hot: bool) -> Flat:
    """The flat space, whose names are all different."""
    found = flat(space, one_hot)
    check_count(len(found.names))
    if len(set(found.names)) < len(found.names):
        found.names = [f"{name}.{i}" if found.names.count(name) > 1 else name for i, name in enumerate(found.names)]
    return found


# Actions


@dataclass
class Actions:
    """Components of an action, and what turns rows of numbers into actions of the environment."""

    components: list[dict[str, Any]]
    convert: Callable[[Numbers], list[Any]]


def actions_of(space: Any) -> Actions:
    """Raises: Failure: The space is unbounded, or of another kind; of kind "space"."""
    if isinstance(space, spaces.Discrete):
        start = int(space.start)
        return discrete([int(space.n)], lambda rows: (rows[:, 0].astype(np.int64) + start).tolist())
    if isinstance(space, spaces.MultiDiscrete):
        starts = space.start
        return discrete(space.nvec.reshape(-1).tolist(), lambda rows: list(rows.astype(starts.dtype).reshape(-1, *starts.shape) + starts))
    if isinstance(space, spaces.MultiBinary):
        shape = space.shape
        return discrete([2] * math.prod(shape), lambda rows: list(rows.astype(np.int8).reshape(-1, *shape)))
    if isinstance(space, spaces.Box):
        return continuous(space)
    help = "wrap the environment with gymnasium.wrappers.TransformAction, which makes its actions from a Box or MultiDiscrete"
    raise Failure("space", f"the action is a space of type {type(space).__name__}, which is not supported", help)


def discrete(counts: list[int], convert: Callable[[Numbers], list[Any]]) -> Actions:
    names = numbered("action", len(counts))
    return Actions([{"name": name, "kind": "discrete", "count": count} for name, count in zip(names, counts)], convert)


def continuous(space: spaces.Box) -> Actions:
    lows, highs = space.low.reshape(-1).tolist(), space.high.reshape(-1).tolist()
    if not all(abs(bound) < UNBOUNDED_ACTION for bound in (*lows, *highs)):
        help = "give it bounds with gymnasium.wrappers.TransformAction and an action_space that is a Box with finite bounds"
        raise Failure("space", "the action is a Box without finite bounds", help)
    names = numbered("action", len(lows))
    components = [
        {"name": name, "kind": "continuous", "low": low, "high": high}
        for name, low, high in zip(names, lows, highs)
    ]
    if space.dtype == np.float32:
        return Actions(components, lambda rows: list(rows.astype(np.float32).reshape(-1, *space.shape)))
    is_whole = np.issubdtype(space.dtype, np.integer)

    def convert(rows: Numbers) -> list[Any]:
        # Bounds that single precision rounds to the outside must stay inside.
        values = np.rint(rows) if is_whole else rows
        return list(np.clip(values.astype(space.dtype).reshape(-1, *space.shape), space.low, space.high))

    return Actions(components, convert)


# Making


def maker_of(config: dict[str, Any]) -> tuple[Callable[[], Environment], Path | None]:
    """What makes a copy of the environment, and the file with the function that does."""
    for folder in reversed(config.get("path") or []):
        sys.path.insert(0, folder)
    kwargs, limit = dict(config.get("kwargs") or {}), config.get("time_limit")
    file, _, name = config["id"].rpartition(":")
    if file.endswith(".py"):
        function = function_of(Path(file), name)
        if config.get("render") and takes_render_mode(function):
            kwargs.setdefault("render_mode", "rgb_array")
        return partial(call, function, kwargs, limit), Path(file)
    if limit is not None:
        kwargs["max_episode_steps"] = limit
    if config.get("render"):
        kwargs.setdefault("render_mode", "rgb_array")
    # Its checks are made here in fewer words; a layer less is also faster.
    kwargs.setdefault("disable_env_checker", True)
    return partial(gymnasium.make, config["id"], **kwargs), None


def function_of(path: Path, name: str) -> Callable[..., Any]:
    """Loads a function of a file, whose folder it can import from."""
    if not path.is_file():
        raise Failure("unknown_id", f"there is no file {path}")
    sys.path.insert(0, str(path.parent))
    module_name = path.stem if path.stem not in sys.modules else f"{path.stem}_of_seedbed"
    module_spec = importlib.util.spec_from_file_location(module_name, path)
    assert module_spec is not None and module_spec.loader is not None, path
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[module_name] = module
    module_spec.loader.exec_module(module)
    function = getattr(module, name, None)
    if not callable(function):
        found = ", ".join(key for key, value in vars(module).items() if callable(value) and value.__module__ == module_name)
        raise Failure("unknown_id", f"{path} has no function `{name}`", f"choose one of its functions: {found}" if found else None)
    return function  # type: ignore[no-any-return]


def takes_render_mode(function: Callable[..., Any]) -> bool:
    with contextlib.suppress(ValueError, TypeError):
        parameters = inspect.signature(function).parameters
        return "render_mode" in parameters or any(each.kind == each.VAR_KEYWORD for each in parameters.values())
    return False


def call(function: Callable[..., Any], kwargs: dict[str, Any], limit: int | None) -> Environment:
    environment = function(**kwargs)
    if not isinstance(environment, gymnasium.Env):
        message = f"{function.__name__} returned {type(environment).__name__}, expected a gymnasium.Env"
        raise Failure("make", message)
    return environment if limit is None else gymnasium.wrappers.TimeLimit(environment, limit)


# Description


def description(environment: Environment, observations: Flat, actions: Actions, file: Path | None) -> dict[str, Any]:
    bounds = zip(observations.names, observations.lows, observations.highs)
    spec, fps = environment.spec, environment.metadata.get("render_fps")
    fps = positive(fps)
    return {
        "observations": [{"name": name, "low": bound(low), "high": bound(high)} for name, low, high in bounds],
        "actions": actions.components,
        "time_limit": time_limit(environment),
        "reward_threshold": None if spec is None else finite(spec.reward_threshold),
        "control_step": positive(dt_of(environment)) or (1 / fps if fps else 1.0),
        "versions": versions(environment),
        "source": source(environment, file),
        "render_fps": fps,
    }


def finite(value: Any) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def bound(value: float) -> float | None:
    return float(value) + 0.0 if abs(value) < UNBOUNDED else None


def positive(value: Any) -> float | None:
    with contextlib.suppress(TypeError, ValueError):
        return float(value) if 0 < float(value) < math.inf else None
    return None


def dt_of(environment: Environment) -> Any:
    """Seconds per step; a property of environments with MuJoCo, which others may use for something else."""
    try:
        return getattr(environment.unwrapped, "dt", None)
    except Exception:
        return None


def time_limit(environment: Environment) -> int | None:
    """Max steps of an episode."""
    limits = []
    while isinstance(environment, gymnasium.Wrapper):
        if isinstance(environment, gymnasium.wrappers.TimeLimit):
            limits.append(int(environment._max_episode_steps))
        environment = environment.env
    return min(limits, default=None)


def versions(environment: Environment) -> dict[str, str]:
    """Versions of all that changes results."""
    package = type(environment.unwrapped).__module__.partition(".")[0]
    names = ["gymnasium", "numpy", package, *(engine for engine in ENGINES if engine in sys.modules)]
    found = {"python": platform.python_version()}
    for name in names:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError, ValueError):
            found[name] = importlib.metadata.version(name)
    return found


def source(environment: Environment, file: Path | None) -> dict[str, str] | None:
    """The file that defines the environment, unless Gymnasium does, and the checksum of its content."""
    module = type(environment.unwrapped).__module__
    if file is None and module.partition(".")[0] == "gymnasium":
        return None
    path = file or getattr(sys.modules.get(module), "__file__", None)
    if path is None or not os.path.isfile(path):
        return None
    return {"file": str(path), "sha256": hashlib.sha256(Path(path).read_bytes()).hexdigest()}


# Episodes


def reset(environment: Environment, seed: int) -> tuple[Any, Any]:
    """Observation and info."""
    result = environment.reset(seed=seed)
    if type(result) is not tuple or len(result) != 2:
        raise Failure("shape", f"reset returned {amount(result)}, expected 2 values: observation, info")
    return result


def bad_step(result: Any) -> Failure:
    expected = "5 values: observation, reward, terminated, truncated, info"
    return Failure("shape", f"step returned {amount(result)}, expected {expected}")


def amount(result: Any) -> str:
    return f"{len(result)} values" if isinstance(result, tuple) else type(result).__name__


def number(value: Any, place: str) -> float:
    array = None
    with contextlib.suppress(ValueError, TypeError):
        array = np.asarray(value)
    if array is None or array.size != 1 or array.dtype.kind not in "fiub":
        raise Failure("shape", f"{place} is {value!r:.100}, expected a number")
    return float(array.reshape(()))


def write_info(info: Any, names: list[str], row: Numbers, is_reset: bool) -> None:
    """Writes entries of an info into a row. Many environments have them only after a step: NaN after a reset."""
    for column, name in enumerate(names):
        if is_reset and name not in info:
            row[column] = math.nan
        elif name not in info:
            raise Failure("shape", f"info of this step has no `{name}`; it has {', '.join(map(str, info)) or 'nothing'}")
        else:
            row[column] = number(info[name], f"`{name}` of info")


@dataclass
class Environments:
    """All copies, and the answers of resets and steps, whose memory is used again for each answer."""

    make: Callable[[], Environment]
    copies: list[Environment]
    observations: Flat
    actions: Actions
    log_info: list[str]

    def __post_init__(self) -> None:
        count, width, extra = len(self.copies), len(self.observations.names), len(self.log_info)
        self.reset_answer, row = answer(b"r", width + extra, 0)
        self.reset_row, self.reset_info = row[:width], row[width:]
        self.step_answer, self.numbers = answer(b"s", count * (width + 1 + extra), count)
        self.rows = list(self.numbers[: count * width].reshape(count, width))
        self.rewards = self.numbers[count * width : count * (width + 1)]
        self.infos = list(self.numbers[count * (width + 1) :].reshape(count, extra))
        self.status = self.step_answer[len(self.step_answer) - count :]
        self.all_not_live = bytes([NOT_LIVE]) * count
        # A check of the type is faster than a conversion.
        self.number_types = frozenset({float, int, bool, np.float64, np.float32, np.int64})

    def reset(self, copy: int, seed: int) -> memoryview[int]:
        try:
            observation, info = reset(self.copies[copy], seed)
            self.observations.write(observation, self.reset_row)
            write_info(info, self.log_info, self.reset_info, is_reset=True)
        except BaseException as error:
            raise failure(error, "reset", copy) from None
        return self.reset_answer

    def step(self, is_live: Numbers, actions: Numbers) -> memoryview[int]:
        """Steps the copies that are live, each with the numbers of a row of actions."""
        self.numbers.fill(0)
        self.status[:] = self.all_not_live
        live = is_live.nonzero()[0]
        rows, rewards, status, write = self.rows, self.rewards, self.status, self.observations.write
        copies, log_info, number_types = self.copies, self.log_info, self.number_types
        copy = None
        try:
            for copy, action in zip(live.tolist(), self.actions.convert(actions[live])):
                result = copies[copy].step(action)
                if type(result) is not tuple or len(result) != 5:
                    raise bad_step(result)
                observation, reward, terminated, truncated, info = result
                write(observation, rows[copy])
                rewards[copy] = reward if type(reward) in number_types else number(reward, "the reward")
                status[copy] = TERMINATED if terminated else TRUNCATED if truncated else RUNNING
                if log_info:
                    write_info(info, log_info, self.infos[copy], is_reset=False)
        except BaseException as error:
            raise failure(error, "step", copy) from None
        return self.step_answer

    def picture(self, copy: int) -> bytes:
        try:
            frame = self.copies[copy].render()
        except BaseException as error:
            raise failure(error, "render", copy) from None
        frame = frame[-1] if isinstance(frame, list) and frame else frame
        if not isinstance(frame, np.ndarray) or frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] not in (3, 4):
            raise Failure("render", f"render returned {type(frame).__name__}, expected an array of height × width × 3 of uint8", None, copy)
        return TWO_NUMBERS.pack(*frame.shape[:2]) + frame[:, :, :3].tobytes()

    def close(self) -> None:
        for environment in self.copies:
            with contextlib.suppress(BaseException):
                environment.close()


def answer(tag: bytes, count: int, more: int) -> tuple[memoryview, Numbers]:
    """Memory of an answer with `count` numbers and `more` bytes, and its numbers, which are aligned."""
    memory = bytearray(8 + 4 * count + more)
    HEADER.pack_into(memory, 8 - HEADER.size, 4 * count + more, tag)
    return memoryview(memory)[8 - HEADER.size :], np.frombuffer(memory, "<f4", count, 8)


# Probe


Episode: TypeAlias = "list[tuple[Numbers, float, int]]"
"""Observation, reward and status after the reset and after each step."""


def random_actions(actions: Actions, seed: int) -> Iterator[Any]:
    """Uniformly random actions without end."""
    generator = np.random.Generator(np.random.PCG64(seed))
    lows = np.array([each.get("low", 0.0) for each in actions.components])
    spans = np.array([each["high"] if "high" in each else each["count"] for each in actions.components]) - lows
    is_discrete = np.array([each["kind"] == "discrete" for each in actions.components])
    while True:
        values = lows + spans * generator.random((256, len(lows)))
        yield from actions.convert(np.where(is_discrete, np.floor(values), values).astype(np.float32))


@dataclass
class Probe:
    """Plays random episodes, in double precision, and measures."""

    environments: Environments
    seconds: float = 0.0

    def make(self) -> Environment:
        try:
            return self.environments.make()
        except BaseException as error:
            raise failure(error, "make") from None

    def reset(self, environment: Environment, seed: int) -> Numbers:
        row = np.zeros(len(self.environments.observations.names))
        try:
            begin = time.perf_counter()
            observation, _ = reset(environment, seed)
            self.seconds += time.perf_counter() - begin
            self.environments.observations.write(observation, row)
        except BaseException as error:
            raise failure(error, "reset") from None
        return row

    def step(self, environment: Environment, action: Any) -> tuple[Numbers, float, int]:
        row = np.zeros(len(self.environments.observations.names))
        try:
            begin = time.perf_counter()
            result = environment.step(action)
            self.seconds += time.perf_counter() - begin
            if type(result) is not tuple or len(result) != 5:
                raise bad_step(result)
            self.environments.observations.write(result[0], row)
            reward = number(result[1], "the reward")
            return row, reward, TERMINATED if result[2] else TRUNCATED if result[3] else RUNNING
        except BaseException as error:
            raise failure(error, "step") from None

    def episode(self, environment: Environment, seed: int, max_steps: int) -> Episode:
        """An episode with random actions that the seed determines."""
        found: Episode = [(self.reset(environment, seed), 0.0, RUNNING)]
        for action in islice(random_actions(self.environments.actions, seed), max_steps):
            found.append(self.step(environment, action))
            if found[-1][2] != RUNNING:
                break
        return found

    def measure(self, steps: int, seed: int) -> dict[str, Any]:
        """Ranges of observations, speed, and lengths of episodes, in a number of steps with random actions."""
        environment, lengths, length = self.make(), [], 0
        row = self.reset(environment, seed)
        lows, highs = row.copy(), row.copy()
        for done, action in enumerate(islice(random_actions(self.environments.actions, seed), steps), 1):
            row, _, status = self.step(environment, action)
            np.fmin(lows, row, out=lows)
            np.fmax(highs, row, out=highs)
            length += 1
            if status == RUNNING:
                continue
            lengths.append(length)
            length = 0
            if done < steps:
                row = self.reset(environment, seed + len(lengths))
                np.fmin(lows, row, out=lows)
                np.fmax(highs, row, out=highs)
        with contextlib.suppress(BaseException):
            environment.close()
        return {
            "ranges": [[finite(low), finite(high)] for low, high in zip(lows, highs)],
            "steps_per_second": steps / self.seconds,
            "episodes": len(lengths),
            "mean_length": sum(lengths) / len(lengths) if lengths else float(steps),
            "unfinished": not lengths and time_limit(environment) is None,
        }

    def difference(self, seed: int, seeds: int) -> str | None:
        """What differs between episodes in a fresh environment and in one that has played others before."""
        used = self.make()
        try:
            for reset_seed in range(seed, seed + seeds):
                fresh = self.make()
                expected = self.episode(fresh, reset_seed, EPISODE_STEPS)
                with contextlib.suppress(BaseException):
                    fresh.close()
                for other_seed, history in ((seed + seeds, max(1, len(expected) // 2)), (seed + seeds + 1, HISTORY_STEPS)):
                    self.episode(used, reset_seed + other_seed, history)
                    found = self.episode(used, reset_seed, EPISODE_STEPS)
                    if (text := self.compare(expected, found)) is not None:
                        return text
            return None
        finally:
            with contextlib.suppress(BaseException):
                used.close()

    def compare(self, expected: Episode, found: Episode) -> str | None:
        """The first bits that differ."""
        words = ("runs", "terminated", "truncated")
        for step, (fresh, used) in enumerate(zip(expected, found)):
            where = f"of step {step}" if step > 0 else "after the reset"
            columns = np.flatnonzero(fresh[0].view(np.int64) != used[0].view(np.int64))
            if len(columns) > 0:
                name, column = self.environments.observations.names[columns[0]], columns[0]
                return unlike(f"observation `{name}` {where}", float(fresh[0][column]), float(used[0][column]))
            if struct.pack("<d", fresh[1]) != struct.pack("<d", used[1]):
                return unlike(f"reward {where}", fresh[1], used[1])
            if fresh[2] != used[2]:
                return unlike(f"end {where}", words[fresh[2]], words[used[2]])
        return None


def unlike(what: str, fresh: object, used: object) -> str:
    return f"{what}: {fresh} in a fresh environment, {used} in a used one"


def probe(environments: Environments, steps: int, seed: int, seeds: int) -> dict[str, Any]:
    """Ranges, speed, and whether a reset with a seed determines an episode; copies that are served are not touched."""
    found = Probe(environments).measure(steps, seed)
    difference = Probe(environments).difference(seed, seeds)
    return {**found, "reproducible": difference is None, "difference": difference}


# Serving


class Stream:
    """Frames over a socket; see the top of this file."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.buffer = bytearray(1 << 16)
        self.begin = self.end = 0

    def receive(self) -> tuple[bytes, memoryview] | None:
        """The tag and payload of the next frame, until the next call; None at the end of the stream."""
        if not self.fill(HEADER.size):
            return None
        length, tag = HEADER.unpack_from(self.buffer, self.begin)
        if not self.fill(HEADER.size + length):
            return None
        begin = self.begin + HEADER.size
        self.begin = begin + length
        return tag, memoryview(self.buffer)[begin : self.begin]

    def fill(self, count: int) -> bool:
        """Receives until there are `count` bytes; False if the stream ends before."""
        if self.begin + count > len(self.buffer) or self.begin == self.end:
            rest = self.buffer[self.begin : self.end]
            if count > len(self.buffer):
                self.buffer = bytearray(2 * count)
            self.buffer[: len(rest)] = rest
            self.begin, self.end = 0, len(rest)
        while self.end - self.begin < count:
            received = self.connection.recv_into(memoryview(self.buffer)[self.end :])
            if received == 0:
                return False
            self.end += received
        return True


def frame(tag: bytes, payload: bytes) -> bytes:
    return HEADER.pack(len(payload), tag) + payload


def json_frame(tag: bytes, content: dict[str, Any]) -> bytes:
    # Text from file systems may contain halves of characters, which are no UTF-8.
    return frame(tag, json.dumps(content, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace"))


def configured(config: dict[str, Any]) -> tuple[Environments, dict[str, Any]]:
    """Makes all copies, and describes them."""
    if missing is not None:
        raise failure(missing, "missing_package")
    try:
        make, file = maker_of(config)
        copies = [make() for _ in range(config["copies"])]
    except BaseException as error:
        is_render = bool(config.get("render")) and "render_mode" in message_of(error)
        raise failure(error, "render" if is_render else "make") from None
    if len({id(environment.unwrapped) for environment in copies}) < len(copies):
        raise Failure("make", f"{config['id']} returned one environment twice, expected a new one for each call")
    first = copies[0]
    observations = observations_of(first.observation_space, config.get("discrete", "one_hot") == "one_hot")
    actions = actions_of(first.action_space)
    widths = {"observation_width": len(observations.names), "action_width": len(actions.components)}
    for name, width in (config.get("expected") or {}).items():
        if widths.get(name, width) != width:
            raise Failure("space", f"{name.replace('_', ' ')} is {widths[name]}, expected {width}")
    environments = Environments(make, copies, observations, actions, list(config.get("log_info") or []))
    return environments, description(first, observations, actions, file)


class Worker:
    """Answers requests."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.environments: Environments | None = None

    def serve(self) -> None:
        """Serves until the program says so or ends."""
        stream = Stream(self.connection)
        with contextlib.suppress(OSError):
            while (request := stream.receive()) is not None and request[0] != b"Q":
                self.connection.sendall(self.answer(*request))
        if self.environments is not None:
            self.environments.close()

    def answer(self, tag: bytes, payload: memoryview) -> bytes | memoryview:
        try:
            if tag == b"C" and self.environments is None:
                self.environments, content = configured(json.loads(bytes(payload)))
                return json_frame(b"J", content)
            if self.environments is not None and tag in ANSWERS:
                return ANSWERS[tag](self.environments, payload)
            raise Failure("protocol", f"unexpected request {tag!r}")
        except BaseException as error:
            return json_frame(b"E", failure(error, "protocol").content)


def answer_reset(environments: Environments, payload: memoryview) -> memoryview[int]:
    return environments.reset(*TWO_NUMBERS.unpack(payload))


def answer_step(environments: Environments, payload: memoryview) -> memoryview[int]:
    count, width = len(environments.copies), len(environments.actions.components)
    is_live = np.frombuffer(payload, np.uint8, count)
    return environments.step(is_live, np.frombuffer(payload, "<f4", count * width, count).reshape(count, width))


def answer_probe(environments: Environments, payload: memoryview) -> bytes:
    return json_frame(b"J", probe(environments, **json.loads(bytes(payload))))


def answer_picture(environments: Environments, payload: memoryview) -> bytes:
    return frame(b"I", environments.picture(int.from_bytes(payload, "little")))


ANSWERS: dict[bytes, Callable[[Environments, memoryview], bytes | memoryview[int]]] = {
    b"R": answer_reset,
    b"S": answer_step,
    b"P": answer_probe,
    b"F": answer_picture,
}


if __name__ == "__main__":
    Worker(connection).serve()
