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

Any other answer is E, JSON: kind, message, help, copy and traceback of a failure. No exception of an environment, not
even SystemExit, ends the worker. On Linux it ends with the thread that started it, which must therefore live on.
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
import select
import signal
import socket
import struct
import sys
import sysconfig
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
    Step: TypeAlias = tuple[Numbers, float, int]

HEADER = struct.Struct("<Ic")
TWO_NUMBERS = struct.Struct("<II")
OWN_FILE = (lambda: None).__code__.co_filename
PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux

AWAKE_SECONDS = 50e-6
# Where all cores are busy, the program goes on.
yield_processor = getattr(os, "sched_yield", lambda: None)

MAX_NUMBERS = 10_000  # of an observation
MAX_PICTURE_NUMBERS = 100
# Bounds that are farther from 0 say nothing about values.
MAX_OBSERVATION_BOUND = 1e6
MAX_ACTION_BOUND = 1e30
MAX_TRACEBACK_LINES = 30
MAX_TRACEBACK_CHARACTERS = 4000
MAX_MESSAGE_CHARACTERS = 1000

COMPARED_STEPS = 200  # of each episode that the probe compares
HISTORY_STEPS = 1000  # of the longest episode that a used environment has played before
STATUS_WORDS = ("runs", "terminated", "truncated")
RUNNING, TERMINATED, TRUNCATED, NOT_LIVE = range(4)

# What to install for a module, where it is not its name.
PACKAGES = {
    "Box2D": '"gymnasium[box2d]"',
    "PIL": "pillow",
    "ale_py": "ale-py",
    "cv2": "opencv-python",
    "gymnasium": "gymnasium",
    "jax": '"gymnasium[jax]"',
    "minigrid": "minigrid",
    "mujoco": '"gymnasium[mujoco]"',
    "numpy": "gymnasium",
    "pygame": '"gymnasium[classic-control]"',
    "sklearn": "scikit-learn",
    "swig": '"gymnasium[box2d]"',
    "yaml": "pyyaml",
}
# If they are loaded, results depend on their versions.
ENGINES = ("Box2D", "ale_py", "jax", "mujoco", "pybullet")


# The process


def prepare_process() -> socket.socket:
    """Returns the stream. Must be called before NumPy is imported, which starts threads."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Processes that environments start must not ignore it too.
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    try:
        connection = take_stream()
    except OSError:
        sys.exit("error: the program `seedbed` starts this worker, with a socket as standard input")
    end_with_parent()
    faulthandler.enable(2)
    return connection


def take_stream() -> socket.socket:
    """Takes the socket away from file descriptor 0: environments read nothing, and print to stderr."""
    connection = socket.socket(fileno=os.dup(0))
    connection.setblocking(True)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=partial(become_child, connection))
    return connection


def become_child(connection: socket.socket) -> None:
    """Makes a process that an environment forks independent of the program."""
    connection.close()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def end_with_parent() -> None:
    """Lets this process end when its parent does, even in the middle of a step."""
    parent = os.getppid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(0)
    else:
        threading.Thread(target=watch, args=(parent,), daemon=True).start()


def watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(0)


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
    """An answer E. `help` says what to do, `copy` is the number of the copy that failed."""

    def __init__(self, kind: str, message: str, help: str | None = None) -> None:
        super().__init__(message)
        self.content: dict[str, Any] = {"kind": kind, "message": message, "help": help, "copy": None, "traceback": ""}


@contextlib.contextmanager
def failing_as(kind: str, copy: int | None = None) -> Iterator[None]:
    """Turns all exceptions into failures of this kind."""
    try:
        yield
    except BaseException as error:
        raise failure(error, kind, copy) from None


def failure(error: BaseException, kind: str, copy: int | None = None) -> Failure:
    """The failure that an exception means: itself, a missing package, an unknown id, or one of the given kind."""
    if isinstance(error, Failure):
        found = error
    else:
        found = missing_package(error) or unknown_id(error) or Failure(kind, message_of(error))
        found.content["traceback"] = traceback_of(error)
    if found.content["copy"] is None:
        found.content["copy"] = copy
    return found


def message_of(error: BaseException) -> str:
    name = type(error).__name__
    with contextlib.suppress(BaseException):
        name += f": {error}" if str(error) else ""
    return name if len(name) <= MAX_MESSAGE_CHARACTERS else name[:MAX_MESSAGE_CHARACTERS] + " …"


def traceback_of(error: BaseException) -> str:
    """The end of Python's traceback, without frames of this file."""
    lines = [message_of(error)]
    with contextlib.suppress(BaseException):
        whole = traceback.TracebackException.from_exception(error, limit=-MAX_TRACEBACK_LINES)
        part: traceback.TracebackException | None = whole
        while part is not None:
            part.stack = traceback.StackSummary.from_list([each for each in part.stack if each.filename != OWN_FILE])
            part = part.__cause__ or part.__context__
        lines = "".join(whole.format()).splitlines()[-MAX_TRACEBACK_LINES:]
    return "\n".join(lines)[-MAX_TRACEBACK_CHARACTERS:]


def missing_package(error: BaseException) -> Failure | None:
    """The failure if a module is not installed."""
    if not (isinstance(error, ImportError) or is_error_of_gymnasium(error, "DependencyNotInstalled")):
        return None
    cause: BaseException | None = error
    while cause is not None and not (isinstance(cause, ModuleNotFoundError) and cause.name):
        cause = cause.__cause__ or cause.__context__
    module = (getattr(cause, "name", None) or "").partition(".")[0]
    if module and module not in sys.modules:
        message = f"the Python package {module} is not installed for {sys.executable}"
        help = f"pip install {PACKAGES.get(module, module)}"
        if module not in PACKAGES:
            help += "; if it is your own, install its folder, or run this in the folder that has it"
        return Failure("missing_package", message, help)
    command = re.search(r"pip install [^`]+", message_of(error))
    return Failure("missing_package", message_of(error), command[0]) if command else None


def unknown_id(error: BaseException) -> Failure | None:
    """The failure if Gymnasium knows no environment of this name. Its message may suggest one."""
    if not is_error_of_gymnasium(error, "UnregisteredEnv"):
        starts = ("No registered env", "Malformed environment ID")
        if not (is_error_of_gymnasium(error, "Error") and str(error).startswith(starts)):
            return None
    help = "name the module that registers it, such as minigrid:MiniGrid-Empty-5x5-v0, or that has its class, such as depot:Warehouse"
    return Failure("unknown_id", message_of(error), help)


def is_error_of_gymnasium(error: BaseException, name: str) -> bool:
    return missing is None and isinstance(error, getattr(gymnasium.error, name))


# Observations


@dataclass
class Flat:
    """Names and bounds of the numbers of an observation, and what writes them into a row."""

    names: list[str]
    lows: list[float]
    highs: list[float]
    write: Callable[[Any, Numbers], None]


def flat_observations(space: Any, one_hot: bool) -> Flat:
    """The whole observation, whose names are all different.

    Raises:
        Failure: There is no way to turn it into a fixed number of numbers; of kind "space".
    """
    found = flat(space, one_hot, "", None)
    check_count(len(found.names))
    if len(set(found.names)) < len(found.names):
        found.names = [f"{name}.{i}" if found.names.count(name) > 1 else name for i, name in enumerate(found.names)]
    return found


def check_count(count: int) -> None:
    if count > MAX_NUMBERS:
        help = 'with discrete: "number", a state is one number; or leave some out with gymnasium.wrappers.FilterObservation'
        raise Failure("space", f"an observation has {count} numbers, expected at most {MAX_NUMBERS}", help)


def flat(space: Any, one_hot: bool, prefix: str, key: str | None) -> Flat:
    """Part of an observation, whose names begin with `prefix`; `key` is its name in a Dict."""
    place = f"observation `{prefix}{key or ''}`" if prefix or key else "the observation"
    if isinstance(space, spaces.Box):
        return flat_box(space, f"{prefix}{key or 'observation'}", place)
    if isinstance(space, spaces.Discrete):
        return flat_discrete(space, one_hot, f"{prefix}{key or 'state'}", place)
    if isinstance(space, spaces.MultiDiscrete):
        return flat_multi_discrete(space, one_hot, f"{prefix}{key or 'component'}", place)
    if isinstance(space, spaces.MultiBinary):
        count = math.prod(space.shape)
        return Flat(numbered(f"{prefix}{key or 'bit'}", count), [0] * count, [1] * count, array_writer(space, place))
    inner = f"{prefix}{key}." if key else prefix
    if isinstance(space, spaces.Dict):
        keys = sorted(space.spaces, key=str)
        return joined({each: flat(space[each], one_hot, inner, str(each)) for each in keys}, Mapping, place)
    if isinstance(space, spaces.Tuple):
        parts = {i: flat(each, one_hot, f"{inner}{i}.", None) for i, each in enumerate(space.spaces)}
        return joined(parts, (tuple, list), place)
    help = "leave it out with gymnasium.wrappers.FilterObservation, or make a Box of it with TransformObservation"
    raise Failure("space", f"{place} is a space of type {type(space).__name__}, which has no fixed number of numbers", help)


def numbered(stem: str, count: int) -> list[str]:
    return [f"{stem}_{i}" for i in range(count)]


def flat_box(space: spaces.Box, stem: str, place: str) -> Flat:
    count = math.prod(space.shape)
    if space.dtype == np.uint8 and len(space.shape) >= 2 and count > MAX_PICTURE_NUMBERS:
        help = "choose a variant that observes numbers, or compute some with gymnasium.wrappers.TransformObservation"
        raise Failure("space", f"{place} is a picture of shape {space.shape}, and pictures are not supported", help)
    names = [stem] if count == 1 else numbered(stem, count)
    return Flat(names, space.low.reshape(-1).tolist(), space.high.reshape(-1).tolist(), array_writer(space, place))


def array_writer(space: Any, place: str) -> Callable[[Any, Numbers], None]:
    shape, dtype, is_row = space.shape, space.dtype, len(space.shape) <= 1

    def write(value: Any, row: Numbers) -> None:
        if type(value) is not np.ndarray or value.dtype is not dtype or value.shape != shape:
            value = as_array(value, shape, "fiub", place)
        row[:] = value if is_row else value.reshape(-1)

    return write


def as_array(value: Any, shape: tuple[int, ...], kinds: str, place: str) -> Numbers:
    """Raises: Failure: The value has another shape, or a type of another kind; of kind "shape"."""
    array = None
    with contextlib.suppress(Exception):
        array = np.asarray(value)
    if array is None or array.shape != shape or array.dtype.kind not in kinds:
        expected = f"an array of shape {shape} of {'numbers' if 'f' in kinds else 'whole numbers'}"
        raise Failure("shape", f"{place} is {text_of(value)}, expected {expected}")
    return array


def text_of(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} of {value.dtype}"
    with contextlib.suppress(Exception):
        return f"{type(value).__name__} {value!r:.60}"
    return type(value).__name__


def flat_discrete(space: spaces.Discrete, one_hot: bool, stem: str, place: str) -> Flat:
    start, count = int(space.start), int(space.n)

    def index(value: Any) -> int:
        found = -1
        with contextlib.suppress(TypeError):
            found = operator.index(value) - start
        if not 0 <= found < count:
            expected = f"a whole number from {start} to {start + count - 1}"
            raise Failure("shape", f"{place} is {text_of(value)}, expected {expected}")
        return found

    def write_one_hot(value: Any, row: Numbers) -> None:
        row[:] = 0
        row[index(value)] = 1

    def write_number(value: Any, row: Numbers) -> None:
        row[0] = index(value) + start

    if not one_hot:
        return Flat([stem], [start], [start + count - 1], write_number)
    check_count(count)
    return Flat([f"{stem}_{start + i}" for i in range(count)], [0] * count, [1] * count, write_one_hot)


def flat_multi_discrete(space: spaces.MultiDiscrete, one_hot: bool, stem: str, place: str) -> Flat:
    counts, starts = space.nvec.reshape(-1).astype(np.int64), space.start.reshape(-1).astype(np.int64)
    begins = np.cumsum(counts) - counts

    def indices(value: Any) -> Numbers:
        found = as_array(value, space.shape, "iub", place).reshape(-1) - starts
        if (found < 0).any() or (found >= counts).any():
            expected = f"whole numbers from {starts.tolist()} to {(starts + counts - 1).tolist()}"
            raise Failure("shape", f"{place} is {text_of(value)}, expected {expected}")
        return found

    def write_one_hot(value: Any, row: Numbers) -> None:
        row[:] = 0
        row[begins + indices(value)] = 1

    def write_numbers(value: Any, row: Numbers) -> None:
        row[:] = indices(value) + starts

    if not one_hot:
        lows, highs = map(float, starts), map(float, starts + counts - 1)
        return Flat(numbered(stem, len(counts)), list(lows), list(highs), write_numbers)
    check_count(int(counts.sum()))
    names = [f"{stem}_{i}_is_{starts[i] + k}" for i in range(len(counts)) for k in range(counts[i])]
    return Flat(names, [0] * len(names), [1] * len(names), write_one_hot)


def joined(parts: dict[Any, Flat], kind: Any, place: str) -> Flat:
    """All parts of a Dict or Tuple in one row."""
    writers, end = [], 0
    for key, part in parts.items():
        writers.append((key, part.write, end, end + len(part.names)))
        end += len(part.names)

    def write(value: Any, row: Numbers) -> None:
        if not isinstance(value, kind) or len(value) < len(parts) or (kind is Mapping and not parts.keys() <= value.keys()):
            raise Failure("shape", f"{place} is {text_of(value)}, expected entries {', '.join(map(str, parts))}")
        for key, write_part, begin, end in writers:
            write_part(value[key], row[begin:end])

    flats = parts.values()
    names, lows, highs = ([each for part in flats for each in getattr(part, field)] for field in ("names", "lows", "highs"))
    return Flat(names, lows, highs, write)


# Actions


@dataclass
class Actions:
    """Components of an action, and what turns rows of numbers into new actions for the environment."""

    components: list[dict[str, Any]]
    convert: Callable[[Numbers], list[Any]]


def actions_of(space: Any) -> Actions:
    """Raises: Failure: The actions have no bounds, or are of another type of space; of kind "space"."""
    if isinstance(space, spaces.Discrete):
        start = int(space.start)
        return discrete([int(space.n)], lambda rows: (rows[:, 0].astype(np.int64) + start).tolist())
    if isinstance(space, spaces.MultiDiscrete):
        starts, shape = space.start, space.shape
        convert = lambda rows: list(rows.astype(starts.dtype).reshape(-1, *shape) + starts)  # noqa: E731
        return discrete(space.nvec.reshape(-1).tolist(), convert)
    if isinstance(space, spaces.MultiBinary):
        shape = space.shape
        return discrete([2] * math.prod(shape), lambda rows: list(rows.astype(np.int8).reshape(-1, *shape)))
    if isinstance(space, spaces.Box):
        return continuous(space)
    help = "wrap it with gymnasium.wrappers.TransformAction, with an action_space that is a Box or MultiDiscrete"
    raise Failure("space", f"the action is a space of type {type(space).__name__}, which is not supported", help)


def discrete(counts: list[int], convert: Callable[[Numbers], list[Any]]) -> Actions:
    return Actions([{"name": f"action_{i}", "kind": "discrete", "count": n} for i, n in enumerate(counts)], convert)


def continuous(space: spaces.Box) -> Actions:
    bounds = list(zip(map(float, space.low.reshape(-1)), map(float, space.high.reshape(-1)), strict=True))
    if not all(abs(bound) < MAX_ACTION_BOUND for pair in bounds for bound in pair):
        help = "wrap it with gymnasium.wrappers.TransformAction, with an action_space that has finite bounds"
        raise Failure("space", "the action is a Box without finite bounds", help)
    shape, dtype, low, high = space.shape, space.dtype, space.low, space.high
    is_whole = np.issubdtype(dtype, np.integer)

    def convert(rows: Numbers) -> list[Any]:
        actions = (np.rint(rows) if is_whole else rows).astype(dtype).reshape(-1, *shape)
        # Only in single precision are bounds the same numbers here and there.
        return list(actions if dtype == np.float32 else np.clip(actions, low, high))

    components = [{"name": f"action_{i}", "kind": "continuous", "low": a, "high": b} for i, (a, b) in enumerate(bounds)]
    return Actions(components, convert)


# Making


def maker_of(config: dict[str, Any]) -> tuple[Callable[[], Environment], Path | None]:
    """What makes a copy of the environment, and the file with the function that does if `id` names one."""
    sys.path[:0] = config.get("path") or []
    kwargs, limit = dict(config.get("kwargs") or {}), config.get("time_limit")
    file, _, name = config["id"].rpartition(":")
    path = Path(file) if file.endswith(".py") else None
    function = function_of_module(file, name) if path is None else function_of(path, name)
    if config.get("render"):
        draw_without_screen()
        if function is None or takes_render_mode(function):
            kwargs.setdefault("render_mode", "rgb_array")
    if function is not None:
        return partial(call, function, kwargs, limit), path
    if limit is not None:
        kwargs["max_episode_steps"] = limit
    # The worker checks what environments return; one wrapper less is faster.
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
    functions: dict[str, Callable[..., Any]] = {key: each for key, each in vars(module).items() if callable(each)}
    if name not in functions:
        own = [key for key, each in functions.items() if getattr(each, "__module__", None) == module_name]
        help = f"choose one of its functions: {', '.join(own)}" if own else None
        raise Failure("unknown_id", f"{path} has no function `{name}`", help)
    return functions[name]


def function_of_module(module: str, name: str) -> Callable[..., Any] | None:
    """A function or class of a module, unless the module registers an environment of this name."""
    if not module or not name.isidentifier():
        return None
    with contextlib.suppress(ImportError):  # `gymnasium.make` tells it
        function = getattr(importlib.import_module(module), name, None)
        return function if callable(function) and name not in gymnasium.registry else None
    return None


def draw_without_screen() -> None:
    """MuJoCo and pygame look at these variables when they are imported."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        os.environ.setdefault("MUJOCO_GL", "egl")
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")


def takes_render_mode(function: Callable[..., Any]) -> bool:
    with contextlib.suppress(ValueError, TypeError):
        parameters = inspect.signature(function).parameters
        return "render_mode" in parameters or any(each.kind == each.VAR_KEYWORD for each in parameters.values())
    return False


def call(function: Callable[..., Any], kwargs: dict[str, Any], limit: int | None) -> Environment:
    made = function(**kwargs)
    if not isinstance(made, gymnasium.Env):
        raise Failure("make", f"the function returned {text_of(made)}, expected a gymnasium.Env")
    return made if limit is None else gymnasium.wrappers.TimeLimit(made, limit)


# Description


def description(environment: Environment, observations: Flat, actions: Actions, file: Path | None) -> dict[str, Any]:
    """What the program needs to know; null for what there is not."""
    bounds = zip(observations.names, observations.lows, observations.highs, strict=True)
    fps = positive(environment.metadata.get("render_fps"))
    threshold = environment.spec.reward_threshold if environment.spec is not None else None
    dt = None
    # A property that not all environments compute without an episode.
    with contextlib.suppress(Exception):
        dt = getattr(environment.unwrapped, "dt", None)
    return {
        "observations": [{"name": name, "low": bound(low), "high": bound(high)} for name, low, high in bounds],
        "actions": actions.components,
        "time_limit": time_limit(environment),
        "reward_threshold": None if threshold is None else finite(threshold),
        "control_step": positive(dt) or (1.0 / fps if fps else 1.0),
        "versions": versions(environment, file),
        "source": source(environment, file),
        "render_fps": fps,
    }


def finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def bound(value: float) -> float | None:
    # Zero is added because some bounds are -0.0.
    return float(value) + 0.0 if abs(value) < MAX_OBSERVATION_BOUND else None


def positive(value: Any) -> float | None:
    with contextlib.suppress(TypeError, ValueError):
        return float(value) if 0 < float(value) < math.inf else None
    return None


def time_limit(environment: Environment) -> int | None:
    """Max steps of an episode."""
    limits = []
    while isinstance(environment, gymnasium.Wrapper):
        if isinstance(environment, gymnasium.wrappers.TimeLimit):
            limits.append(int(environment._max_episode_steps))
        environment = environment.env
    return min(limits, default=None)


def versions(environment: Environment, file: Path | None) -> dict[str, str]:
    """Versions of Python and of packages; of a package that is not installed, which may change at any time, a checksum of its files."""
    package = type(environment.unwrapped).__module__.partition(".")[0]
    found = {"python": platform.python_version()}
    for name in ("gymnasium", "numpy", package, *(each for each in ENGINES if each in sys.modules)):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError, ValueError):
            found[name] = importlib.metadata.version(name)
    files = changeable_files(package, file)
    if files:
        sha256 = hashlib.sha256(b"".join(Path(each).read_bytes() for each in files))
        found[package] = f"files {sha256.hexdigest()[:16]}"
    return found


def changeable_files(package: str, file: Path | None) -> list[str]:
    """Loaded files of a package outside of the folders of installed packages, without `file`, whose checksum is `source`."""
    installed = tuple(sysconfig.get_path(name) + os.sep for name in ("purelib", "platlib", "stdlib"))
    files = {getattr(module, "__file__", None) or "" for name, module in list(sys.modules.items()) if name.partition(".")[0] == package}
    files = {each for each in files if each.endswith(".py") and not each.startswith(installed) and Path(each) != file}
    return sorted(each for each in files if os.path.isfile(each))


def source(environment: Environment, file: Path | None) -> dict[str, str] | None:
    """The file that defines the environment, unless Gymnasium does, and the checksum of its bytes."""
    module = type(environment.unwrapped).__module__
    if file is None and module.partition(".")[0] == "gymnasium":
        return None
    path = file or getattr(sys.modules.get(module), "__file__", None)
    if path is None or not os.path.isfile(path):
        return None
    return {"file": str(path), "sha256": hashlib.sha256(Path(path).read_bytes()).hexdigest()}


# Episodes


def checked_reset(environment: Environment, seed: int) -> tuple[Any, Any]:
    """Observation and info."""
    result = environment.reset(seed=seed)
    if type(result) is not tuple or len(result) != 2:
        raise Failure("shape", f"reset returned {amount(result)}, expected 2 values: observation, info")
    return result


def check_step(result: Any) -> None:
    if type(result) is not tuple or len(result) != 5:
        expected = "5 values: observation, reward, terminated, truncated, info"
        raise Failure("shape", f"step returned {amount(result)}, expected {expected}")


def amount(result: Any) -> str:
    return f"{len(result)} values" if isinstance(result, tuple) else text_of(result)


def number(value: Any, place: str, kind: str = "shape") -> float:
    array = None
    with contextlib.suppress(Exception):
        array = np.asarray(value)
    if array is None or array.size != 1 or array.dtype.kind not in "fiub":
        raise Failure(kind, f"{place} is {text_of(value)}, expected a number")
    return float(array.reshape(()))


def write_info(info: Any, names: list[str], row: Numbers, is_reset: bool) -> None:
    """Writes entries of an info into a row. After a reset, those that only steps have are NaN."""
    for column, name in enumerate(names):
        if name in info:
            row[column] = number(info[name], f"`{name}` of info", "info")
        elif is_reset:
            row[column] = math.nan
        else:
            raise Failure("info", f"info of a step has no `{name}`, only: {', '.join(map(str, info)) or 'nothing'}")


def answer_memory(tag: bytes, count: int, more: int) -> tuple[memoryview[int], Numbers]:
    """A frame of `count` numbers and `more` bytes, and its numbers, which are aligned in memory."""
    memory = bytearray(8 + 4 * count + more)
    HEADER.pack_into(memory, 8 - HEADER.size, 4 * count + more, tag)
    return memoryview(memory)[8 - HEADER.size :], np.frombuffer(memory, "<f4", count, 8)


@dataclass
class Environments:
    """All copies, and memory of the answers to resets and steps, which is used again for each."""

    make: Callable[[], Environment]
    copies: list[Environment]
    observations: Flat
    actions: Actions
    log_info: list[str]

    def __post_init__(self) -> None:
        count, width, extra = len(self.copies), len(self.observations.names), len(self.log_info)
        self.reset_answer, row = answer_memory(b"r", width + extra, 0)
        self.reset_row, self.reset_info = row[:width], row[width:]
        self.step_answer, self.numbers = answer_memory(b"s", count * (width + 1 + extra), count)
        self.rows = list(self.numbers[: count * width].reshape(count, width))
        self.rewards = self.numbers[count * width : count * (width + 1)]
        self.infos = list(self.numbers[count * (width + 1) :].reshape(count, extra))
        self.status = self.step_answer[len(self.step_answer) - count :]
        self.number_types = frozenset({float, int, bool, np.float64, np.float32, np.int64})

    def reset(self, copy: int, seed: int) -> memoryview[int]:
        with failing_as("reset", copy):
            observation, info = checked_reset(self.copies[copy], seed)
            self.observations.write(observation, self.reset_row)
            write_info(info, self.log_info, self.reset_info, is_reset=True)
        return self.reset_answer

    def step(self, is_live: Numbers, actions: Numbers) -> memoryview[int]:
        """Steps the copies that are live, each with the numbers of its row. Thousands of times per second."""
        self.numbers.fill(0)
        self.status[:] = bytes((NOT_LIVE,)) * len(self.copies)
        copies, rows, rewards, status, number_types = self.copies, self.rows, self.rewards, self.status, self.number_types
        write, log_info, copy = self.observations.write, self.log_info, None
        live = is_live.nonzero()[0]
        try:
            for copy, action in zip(live.tolist(), self.actions.convert(actions[live]), strict=True):
                result = copies[copy].step(action)
                if type(result) is not tuple or len(result) != 5:
                    check_step(result)
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
        """Height, width and colors."""
        with failing_as("render", copy):
            picture: Any = self.copies[copy].render()
            if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8 or picture.shape[2:] != (3,):
                expected = "an array of height × width × 3 of uint8"
                raise Failure("render", f"render returned {text_of(picture)}, expected {expected}")
            return TWO_NUMBERS.pack(*picture.shape[:2]) + picture.tobytes()

    def close(self) -> None:
        for environment in self.copies:
            close(environment)


def close(environment: Environment) -> None:
    with contextlib.suppress(BaseException):
        environment.close()


# Probe


def probe(environments: Environments, steps: int, seed: int, seeds: int) -> dict[str, Any]:
    """Ranges, speed, and whether a reset with a seed determines an episode, in environments that are not served."""
    player = Player(environments.make, environments.observations, environments.actions)
    measured = player.measure(steps, seed)
    difference = player.difference(seed, seeds)
    player.check_info(environments.log_info, seed)
    return {**measured, "reproducible": difference is None, "difference": difference}


@dataclass
class Player:
    """Plays random episodes. A step is the observation, in double precision, the reward and the status.

    `seconds` is the time that environments took for all resets and steps.
    """

    make_environment: Callable[[], Environment]
    observations: Flat
    actions: Actions
    seconds: float = 0.0
    seed: int = 0
    steps: int = 0

    def make(self) -> Environment:
        with failing_as("make"):
            return self.make_environment()

    def random_actions(self, seed: int) -> Iterator[Any]:
        """Uniformly random actions without end."""
        generator = np.random.Generator(np.random.PCG64(seed))
        components = self.actions.components
        lows = np.array([each.get("low", 0.0) for each in components])
        highs = np.array([each.get("high", each.get("count")) for each in components], float)
        is_discrete = np.array([each["kind"] == "discrete" for each in components])
        while True:
            values = lows + (highs - lows) * generator.random((256, len(components)))
            yield from self.actions.convert(np.where(is_discrete, np.floor(values), values).astype(np.float32))

    def reset(self, environment: Environment, seed: int) -> Step:
        row = np.zeros(len(self.observations.names))
        with failing_as("reset"):
            begin = time.perf_counter()
            observation, _ = checked_reset(environment, seed)
            self.seconds += time.perf_counter() - begin
            self.observations.write(observation, row)
            self.seed, self.steps = seed, 0
            self.check_finite(row)
        return row, 0.0, RUNNING

    def check_finite(self, row: Numbers) -> None:
        for name, value in zip(self.observations.names, row, strict=True):
            if not math.isfinite(value):
                raise Failure("shape", f"the observation `{name}` is {value}")

    @contextlib.contextmanager
    def failing_in_step(self, action: Any) -> Iterator[None]:
        """Failures name the step."""
        self.steps += 1
        try:
            with failing_as("step"):
                yield
        except Failure as error:
            place = f"step {self.steps} after reset(seed={self.seed}), action {np.asarray(action).tolist()}"
            error.content["message"] = f"{place}: {error.content['message']}"
            raise

    def step(self, environment: Environment, action: Any) -> Step:
        row = np.zeros(len(self.observations.names))
        with self.failing_in_step(action):
            begin = time.perf_counter()
            result = environment.step(action)
            self.seconds += time.perf_counter() - begin
            check_step(result)
            self.observations.write(result[0], row)
            self.check_finite(row)
            status = TERMINATED if result[2] else TRUNCATED if result[3] else RUNNING
            return row, number(result[1], "the reward"), status

    def check_info(self, names: list[str], seed: int) -> None:
        """Fails if a step has no info with these names."""
        environment, row = self.make(), np.zeros(len(names))
        with failing_as("step"):
            checked_reset(environment, seed)
            result = environment.step(next(self.random_actions(seed)))
            check_step(result)
        write_info(result[4], names, row, is_reset=False)
        close(environment)

    def episode(self, environment: Environment, seed: int, max_steps: int) -> list[Step]:
        """An episode with random actions. The seed determines them and the reset."""
        steps = [self.reset(environment, seed)]
        for action in islice(self.random_actions(seed), max_steps):
            steps.append(self.step(environment, action))
            if steps[-1][2] != RUNNING:
                break
        return steps

    def measure(self, steps: int, seed: int) -> dict[str, Any]:
        """Ranges of observations, steps per second and lengths of episodes."""
        environment, lengths, length = self.make(), [], 0
        lows = self.reset(environment, seed)[0]
        highs = lows.copy()
        for done, action in enumerate(islice(self.random_actions(seed), steps), 1):
            rows = [self.step(environment, action)]
            length += 1
            if rows[0][2] != RUNNING:
                lengths.append(length)
                length = 0
                if done < steps:
                    rows.append(self.reset(environment, seed + len(lengths)))
            for row, _, _ in rows:
                np.fmin(lows, row, out=lows)
                np.fmax(highs, row, out=highs)
        close(environment)
        return {
            "ranges": [[finite(low), finite(high)] for low, high in zip(lows, highs, strict=True)],
            "steps_per_second": steps / self.seconds,
            "episodes": len(lengths),
            "mean_length": sum(lengths) / len(lengths) if lengths else float(steps),
        }

    def difference(self, seed: int, seeds: int) -> str | None:
        """What differs between episodes in a fresh environment and in one that has played others before."""
        with contextlib.ExitStack() as stack:
            used = self.make()
            stack.callback(close, used)
            found = (self.difference_after(used, reset_seed, seed + seeds) for reset_seed in range(seed, seed + seeds))
            return next(filter(None, found), None)

    def difference_after(self, used: Environment, seed: int, other_seed: int) -> str | None:
        """The same for one seed. The used environment plays half an episode before, and later a whole one."""
        with contextlib.ExitStack() as stack:
            fresh = self.make()
            stack.callback(close, fresh)
            expected = self.episode(fresh, seed, COMPARED_STEPS)
        for history_seed, max_steps in (other_seed, max(1, len(expected) // 2)), (other_seed + 1, HISTORY_STEPS):
            self.episode(used, history_seed, max_steps)
            found = self.episode(used, seed, COMPARED_STEPS)
            differences = map(self.difference_of_step, range(len(expected)), expected, found)
            if (first := next(filter(None, differences), None)) is not None:
                return first
        return None

    def difference_of_step(self, number: int, fresh: Step, used: Step) -> str | None:
        place = f"of step {number}" if number > 0 else "after the reset"
        for column in np.flatnonzero(fresh[0].view(np.int64) != used[0].view(np.int64)):
            name = f"observation `{self.observations.names[column]}`"
            return f"{name} {place}: {fresh[0][column]} in a fresh environment, {used[0][column]} in a used one"
        if struct.pack("<d", fresh[1]) != struct.pack("<d", used[1]):
            return f"reward {place}: {fresh[1]} in a fresh environment, {used[1]} in a used one"
        if fresh[2] != used[2]:
            return f"end {place}: {STATUS_WORDS[fresh[2]]} in a fresh environment, {STATUS_WORDS[used[2]]} in a used one"
        return None


# Serving


class Stream:
    """Receives frames."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.buffer = bytearray(1 << 16)
        self.begin = self.end = 0
        self.poll = select.poll()
        self.poll.register(connection, select.POLLIN)

    def receive(self) -> tuple[bytes, memoryview[int]] | None:
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
        if self.begin == self.end or self.begin + count > len(self.buffer):
            rest = self.buffer[self.begin : self.end]
            if count > len(self.buffer):
                self.buffer = bytearray(2 * count)
            self.buffer[: len(rest)] = rest
            self.begin, self.end = 0, len(rest)
        while self.end - self.begin < count:
            self.wait_awake()
            received = self.connection.recv_into(memoryview(self.buffer)[self.end :])
            if received == 0:
                return False
            self.end += received
        return True

    def wait_awake(self) -> None:
        """Waits for data, but not for long: a process that sleeps may need as long to wake up as a short step takes."""
        deadline = time.perf_counter() + AWAKE_SECONDS
        while not self.poll.poll(0) and time.perf_counter() < deadline:
            yield_processor()


def frame(tag: bytes, payload: bytes) -> bytes:
    return HEADER.pack(len(payload), tag) + payload


def json_frame(tag: bytes, content: dict[str, Any]) -> bytes:
    # Text from file systems may contain halves of characters, which are no UTF-8.
    return frame(tag, json.dumps(content, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace"))


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

    def answer(self, tag: bytes, payload: memoryview[int]) -> bytes | memoryview[int]:
        try:
            if self.environments is None and tag == b"C":
                return self.configure(**json.loads(bytes(payload)))
            if self.environments is None or tag not in (b"R", b"S", b"P", b"F"):
                raise Failure("protocol", f"unexpected request {tag!r}")
            return answer(self.environments, tag, payload)
        except BaseException as error:
            return json_frame(b"E", failure(error, "protocol").content)

    def configure(self, **config: Any) -> bytes:
        """Makes all copies, and describes them."""
        if missing is not None:
            raise missing
        with failing_as("make"):
            make, file = maker_of(config)
            copies = [make() for _ in range(config["copies"])]
            if len({id(each.unwrapped) for each in copies}) < len(copies):
                raise Failure("make", "one environment was made twice, expected a new one for each copy")
        observations = flat_observations(copies[0].observation_space, config.get("discrete") != "number")
        actions = actions_of(copies[0].action_space)
        widths = {"observation_width": len(observations.names), "action_width": len(actions.components)}
        for name, width in (config.get("expected") or {}).items():
            if widths[name] != width:
                raise Failure("space", f"{name} is {widths[name]}, expected {width}")
        content = description(copies[0], observations, actions, file)
        self.environments = Environments(make, copies, observations, actions, list(config.get("log_info") or []))
        return json_frame(b"J", content)


def answer(environments: Environments, tag: bytes, payload: memoryview[int]) -> bytes | memoryview[int]:
    if tag == b"S":
        count, width = len(environments.copies), len(environments.actions.components)
        is_live = np.frombuffer(payload, np.uint8, count)
        return environments.step(is_live, np.frombuffer(payload, "<f4", count * width, count).reshape(count, width))
    if tag == b"R":
        return environments.reset(*TWO_NUMBERS.unpack(payload))
    if tag == b"P":
        return json_frame(b"J", probe(environments, **json.loads(bytes(payload))))
    return frame(b"I", environments.picture(int.from_bytes(payload, "little")))


if __name__ == "__main__":
    Worker(connection).serve()
