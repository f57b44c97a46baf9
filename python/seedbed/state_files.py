"""Files of visited states: one per agent, to which finished episodes are appended.

`docs/state_files.md` ("Files of visited states") describes the format. Only NumPy and the standard library are
needed. A process that is killed leaves at most one incomplete frame, at the end of the file of its agent.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import os
import shutil
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from .state_locks import STATES_FOLDER, LockFile, claim, locked, release

MAGIC = b"SBSTATES"
FORMAT_VERSION = 1
FILE_START = struct.Struct("<8sII")
"""Magic, version of the format, CRC-32 of both."""

FRAME_START = struct.Struct("<4sIII")
"""Kind of the frame, number of bytes of its payload, CRC-32 of the payload, CRC-32 of these three."""

HEADER, BEGIN, EPISODE, CLOSED = b"HEAD", b"STEP", b"EPIS", b"DONE"

EPISODE_START = struct.Struct("<IIIId")
"""Number of the episode, number of its first step in the frame, number of steps in the frame, outcome, sum of all
rewards of the episode so far."""

RUNNING, TERMINATED, TRUNCATED = range(3)
OUTCOMES = ("running", "terminated", "truncated")

SUFFIX = ".states"
EPISODES_TABLE = "episodes.csv"
SUMMARY = "summary.json"
FINAL_WINDOW = 25
"""Number of latest episodes per agent over which `final_return` is averaged."""

COLUMNS = (
    "agent",
    "episode",
    "round",
    "env_steps",
    "return",
    "length",
    "outcome",
    "coverage",
    "visitation_entropy",
    "team_overlap",
    "effective_agents",
    "end_step",
)
"""Columns of `episodes.csv`. Four measures of visits are not known here; `seedbed inspect` computes them. The last one is
not in tables of `seedbed run`: the steps of the agent's environment up to the end of the episode, also those that are not
recorded. Copies of an environment have the same number at the same time."""

DERIVED_FILES = (EPISODES_TABLE, SUMMARY, "rounds.csv", "run.rrd")
"""Files that are made from files of visited states, and made again when there are more states."""

FILES_OF_OTHER_RUNS = ("scenario.ron", "rounds.csv", "checkpoint", "run.rrd", "run.rrd.part")
"""Files by which the folder of another run is recognized."""


MAX_AXES = 10_000
MAX_NAME_BYTES = 1000
"""Limits of what the program reads: observations or components of an action, and bytes of a name or a unit."""

MAX_SPARSE_AGENTS = 1024
"""A larger number of an agent must be below four times the number of agents in the folder: agents are numbered from 0, and
each number takes memory in the program."""


APPENDING = os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0)


class RecordingError(Exception):
    """A file of visited states cannot be written or read."""


@dataclass(frozen=True)
class Axis:
    """One observation or one component of an action.

    An end of the range that is None is the smallest or largest finite value that was visited.
    """

    name: str
    unit: str = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Header:
    """What the states of an agent are."""

    agent: int
    environment: str
    observations: tuple[Axis, ...]
    actions: tuple[Axis, ...]
    time_limit: int | None = None
    step_seconds: float | None = None
    learner: int | None = None
    """Number of the learner that acts: copies of an environment may have one. None if the agent is a learner of its own."""

    def to_json(self) -> bytes:
        """The header as UTF-8."""
        fields = asdict(self)
        if self.learner is None:
            del fields["learner"]
        return json.dumps(fields, ensure_ascii=False, separators=(",", ":")).encode()

    @property
    def learner_number(self) -> int:
        """Number of the learner."""
        return self.agent if self.learner is None else self.learner

    @classmethod
    def from_json(cls, payload: bytes) -> Header:
        """The header that `to_json` wrote."""
        found: dict[str, Any] = json.loads(payload)
        known = {field.name: found[field.name] for field in fields(cls) if field.name in found}
        for axes in ("observations", "actions"):
            known[axes] = tuple(Axis(axis["name"], axis["unit"], axis["low"], axis["high"]) for axis in known[axes])
        return cls(**known)

    def difference_from(self, other: Header) -> str | None:
        """What prevents both agents from being in one recording; None if nothing does."""
        for name in ("environment", "observations", "actions"):
            mine, theirs = getattr(self, name), getattr(other, name)
            if mine != theirs:
                return f"{name} {_text(mine)} differ from those of agent {other.agent}: {_text(theirs)}"
        return None

    def change_from(self, other: Header) -> str | None:
        """What prevents this agent from continuing the file with the other header; None if nothing does."""
        for name in (field.name for field in fields(self)):
            mine, theirs = getattr(self, name), getattr(other, name)
            # Files that were begun before learners were recorded have none.
            if mine != theirs and not (name == "learner" and theirs is None):
                return f"{name} is {_text(mine)}, but in the file {_text(theirs)}"
        return None


@dataclass(frozen=True)
class EpisodeRow:
    """One finished episode in `episodes.csv`."""

    agent: int
    episode: int
    total_reward: float
    length: int
    outcome: int
    end_step: int
    """Steps of the agent's environment up to the end of the episode."""


@dataclass(frozen=True)
class Scan:
    """What is in the file of an agent, as far as it is undamaged."""

    header: Header
    episodes: tuple[EpisodeRow, ...]
    is_closed: bool
    """Whether the recorder was closed after the last episode."""
    end: int
    """Offset after the last frame of a finished episode, or of the end mark."""
    size: int
    nans: tuple[int, ...]
    """Number of states of finished episodes in which an observation is NaN, for each observation."""
    damage: str | None
    """Where the file is damaged and how; None if it is not. An incomplete frame at the end is no damage."""


def _text(value: object) -> str:
    if not isinstance(value, tuple):
        return repr(value)
    return ", ".join(f"{axis.name} [{axis.low}, {axis.high}] {axis.unit}".strip() for axis in value)


def file_of(folder: Path, agent: int) -> Path:
    """The file of an agent in the folder of a run."""
    return folder / STATES_FOLDER / f"agent_{agent}{SUFFIX}"


def frame(kind: bytes, payload: bytes) -> bytes:
    """A frame as it is in the file."""
    start = struct.pack("<4sII", kind, len(payload), zlib.crc32(payload))
    return start + struct.pack("<I", zlib.crc32(start)) + payload


def file_start(header: Header) -> bytes:
    """The beginning of a file: all before the first episode."""
    start = struct.pack("<8sI", MAGIC, FORMAT_VERSION)
    return start + struct.pack("<I", zlib.crc32(start)) + frame(HEADER, header.to_json())


def check_start(folder: Path, header: Header, *, overwrite: bool, resume: bool, together: int = 1) -> None:
    """Refuse to record an agent where it would mix with something else.

    Args:
        folder: Folder of the run.
        header: What the states of the agent are.
        overwrite: Whether a file of the agent is replaced.
        resume: Whether a file of the agent is continued.
        together: Number of agents that one recorder begins to record.

    Raises:
        FileExistsError: The agent was recorded before, or the folder contains another run.
        ValueError: The folder has agents of another environment or with other axes, or too few for such a number.
    """
    if overwrite and resume:
        raise ValueError("overwrite=True and resume=True exclude each other")
    path = file_of(folder, header.agent)
    others = sorted(other for other in path.parent.glob(f"agent_*{SUFFIX}") if other != path)
    limit = max(MAX_SPARSE_AGENTS, 4 * (len(others) + together))
    if header.agent >= limit:
        raise ValueError(
            f"agent is {header.agent}, expected a number below {limit}: agents are numbered from 0, and from "
            f"{MAX_SPARSE_AGENTS} on at least a quarter of the numbers must be in use"
        )
    if path.exists() and not overwrite and not resume:
        raise FileExistsError(
            f"{path} exists: agent {header.agent} was recorded in this folder before; choose another folder or agent, "
            "continue with resume=True, or replace the file with overwrite=True"
        )
    if not others and not path.exists():
        found = [name for name in FILES_OF_OTHER_RUNS if (folder / name).exists()]
        if found:
            raise FileExistsError(f"{folder} contains another run ({found[0]}); choose another folder")
    for other in others[:1]:
        difference = header.difference_from(read_header(other))
        if difference is not None:
            raise ValueError(
                f"agent {header.agent} cannot be recorded in {folder}: its {difference}. Give names=, units= and ranges= "
                "explicitly, or choose another folder"
            )


class StateFile:
    """The file of one agent, to which episodes are appended.

    It is open only while something is appended, so that one process can record any number of agents. Nobody else can
    record the agent until `release`. Nothing has changed before `begin`.

    Raises:
        FileExistsError, ValueError: See `check_start`.
        RecordingError: The existing file cannot be resumed, or another recorder writes to it.
    """

    def __init__(
        self, folder: Path, header: Header, *, overwrite: bool = False, resume: bool = False, together: int = 1
    ) -> None:
        self.path = file_of(folder, header.agent)
        self.header = header
        self.next_episode = 0
        self._folder = folder
        self._process = os.getpid()
        self._path_text = str(self.path)
        self._has_rival = False
        self._has_warned = False
        self._names = [axis.name for axis in header.observations], [axis.name for axis in header.actions], ["reward"]
        self._size = 0
        self._end_step = 0
        with explained(folder), locked(folder):
            check_start(folder, header, overwrite=overwrite, resume=resume, together=together)
            self._lock = claim(folder, header.agent)
            if self._lock is None:
                raise RecordingError(
                    f"{self.path}: another recorder writes to it, in this process or another one; close that one first. "
                    "Each agent needs a number of its own"
                )
            try:
                self._found = self._resumed() if resume and self.path.exists() else None
            except BaseException:
                self.release()
                raise

    def begin(self) -> None:
        """Create the file, or remove what follows the last finished episode."""
        with explained(self._folder), locked(self._folder):
            for name in DERIVED_FILES:
                (self._folder / name).unlink(missing_ok=True)
            for part in self.path.parent.glob(f".{self.path.name}.*.part"):
                part.unlink(missing_ok=True)
            if self._found is None:
                start = file_start(self.header)
                replace_file(self.path, start)
                self._size = len(start)
            else:
                if self._found.end < self._found.size:
                    cut(self.path, self._found)
                self._size = self._found.end
                self.next_episode = len(self._found.episodes)
                self._end_step = self._found.episodes[-1].end_step if self._found.episodes else 0

    @property
    def end_step(self) -> int:
        """Steps of the environment up to the end of the last episode in the file."""
        return self._end_step

    def release(self) -> None:
        """Let others record the agent."""
        if self._lock is not None:
            release(self._lock, self.header.agent)
            self._lock = None

    def append_steps(
        self,
        first_step: int,
        observations: NDArray[np.floating],
        actions: NDArray[np.floating],
        rewards: NDArray[np.floating],
        outcome: int,
        total_reward: float,
        begin_step: int,
    ) -> None:
        """Append n steps of the running episode, which ends with them unless `outcome` is RUNNING.

        Args:
            first_step: Number of the first of these steps in its episode.
            observations: Before each step, and after the last one if the episode ends: `[n or n + 1, observations]`.
            actions: `[n, actions]`.
            rewards: `[n]`.
            outcome: RUNNING, TERMINATED or TRUNCATED.
            total_reward: Sum of all rewards of the episode so far.
            begin_step: Steps of the environment before the episode.
        """
        start = EPISODE_START.pack(self.next_episode, first_step, len(rewards), outcome, total_reward)
        ends = observations.size, observations.size + actions.size
        single = np.empty(ends[1] + rewards.size, "<f4")
        with np.errstate(over="ignore"):
            single[: ends[0]] = observations.reshape(-1)
            single[ends[0] : ends[1]] = actions.reshape(-1)
            single[ends[1] :] = rewards
        if not self._has_warned and not np.isfinite(single).all():
            for values, names in zip((observations, actions, rewards), self._names, strict=True):
                self._warn_of_too_large(values, names)
        content = frame(EPISODE, start + single.tobytes())
        if first_step == 0 and begin_step != self._end_step:
            content = frame(BEGIN, struct.pack("<Q", begin_step)) + content
        is_end = outcome != RUNNING
        self._append(content, episodes=int(is_end))
        if is_end:
            self._end_step = begin_step + first_step + len(rewards)

    def _warn_of_too_large(self, values: NDArray[np.floating], names: Sequence[str]) -> None:
        with np.errstate(over="ignore"):
            too_large = np.isinf(values.astype(np.float32)) & np.isfinite(values)
        if too_large.any() and not self._has_warned:
            self._has_warned = True
            index = np.argwhere(too_large)[0]
            warnings.warn(
                f"{self.path}: {names[index[-1] if values.ndim > 1 else 0]} is {values[tuple(index)]}, which is too large "
                "for single precision: such numbers are recorded as infinite",
                RuntimeWarning,
                stacklevel=2,
            )

    def close(self) -> None:
        """Append the mark that the recorder was closed, unless another recorder writes to the file."""
        if self.was_made_here() and not self._has_rival:
            self._append(frame(CLOSED, struct.pack("<I", self.next_episode)), sync=True)

    def was_made_here(self) -> bool:
        """Whether this process opened the file. A process that was forked from it must not write."""
        return os.getpid() == self._process

    def _resumed(self) -> Scan:
        """What is in the existing file, which this recorder can continue."""
        try:
            found = scan(self.path)
        except RecordingError as error:
            raise RecordingError(f"{error}: it cannot be resumed; replace it with overwrite=True, or choose another folder") from error
        change = self.header.change_from(found.header)
        if change is not None:
            raise ValueError(f"{self.path} cannot be resumed: {change}")
        return found

    def _append(self, content: bytes, *, episodes: int = 0, sync: bool = False) -> None:
        if not self.was_made_here():
            raise RecordingError(
                f"{self.path} was opened by process {self._process}, but this is process {os.getpid()}: "
                "make the recorder in the process that steps the environment"
            )
        try:
            descriptor = os.open(self._path_text, APPENDING)
        except OSError as error:
            raise RecordingError(f"cannot append to {self.path}: {error}") from error
        size, number = self._size + len(content), self.next_episode + episodes
        try:
            self._write(descriptor, content, sync)
            # After Ctrl-C, either both have changed or none.
            self._size, self.next_episode = size, number
        except BaseException:
            if not self._has_rival and self._size != size:
                with contextlib.suppress(OSError):
                    os.ftruncate(descriptor, self._size)
            raise
        finally:
            os.close(descriptor)

    def _write(self, descriptor: int, content: bytes, sync: bool) -> None:
        size = os.fstat(descriptor).st_size
        if size != self._size:
            self._has_rival = True
            raise RecordingError(
                f"{self.path} has {size} bytes, expected {self._size}: another recorder writes to it. "
                "Each agent needs a number of its own"
            )
        try:
            written = os.write(descriptor, content)
            while written < len(content):
                written += os.write(descriptor, content[written:])
            if sync:
                os.fsync(descriptor)
        except OSError as error:
            raise RecordingError(f"cannot append to {self.path}: {error}") from error


def cut(path: Path, found: Scan) -> None:
    """Remove what follows the last finished episode, with a warning, and keep a copy of it if it is damaged."""
    episodes, lost = len(found.episodes), found.size - found.end
    message = f"{path}: removed the unfinished last episode ({lost} bytes)"
    if found.damage is not None:
        with open(path, "rb") as file:
            file.seek(found.end)
            kept = _free_name(path)
            replace_file(kept, file_start(found.header), file)
        message = (
            f"{path} is damaged {found.damage}: removed all from there on, which are the episodes from number {episodes} on "
            f"({lost} bytes; {episodes} episodes are left). They are kept in {kept}"
        )
    with open(path, "r+b") as file:
        file.truncate(found.end)
        os.fsync(file.fileno())
    warnings.warn(message, RuntimeWarning, stacklevel=6)


def _free_name(path: Path) -> Path:
    """A name that no reader takes for that of a file of visited states."""
    number = 1
    while (free := path.with_name(f"{path.name}.cut_{number}")).exists():
        number += 1
    return free


@contextlib.contextmanager
def explained(folder: Path) -> Iterator[None]:
    """Turn errors of the system into errors that say which folder cannot be written."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise RecordingError(f"cannot record in {folder}: {error}") from error


def replace_file(path: Path, content: bytes, rest: BinaryIO | None = None) -> None:
    """Write a file so that it has either its old or its new content, whatever happens.

    Args:
        path: The file.
        content: What is written.
        rest: A file whose content, from its position on, follows.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(part, "wb") as file:
            file.write(content)
            if rest is not None:
                shutil.copyfileobj(rest, file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def read_header(path: Path) -> Header:
    """The header of a file."""
    with open(path, "rb") as file:
        return _read_header(path, file)


def _read_header(path: Path, file: io.BufferedReader) -> Header:
    start = file.read(FILE_START.size)
    if len(start) < FILE_START.size or start[:8] != MAGIC:
        raise RecordingError(f"{path} is not a file of visited states")
    _, version, checksum = FILE_START.unpack(start)
    if checksum != zlib.crc32(start[:12]):
        raise RecordingError(f"{path} is damaged at offset 0: wrong checksum")
    if version != FORMAT_VERSION:
        raise RecordingError(f"{path} has format version {version}, expected {FORMAT_VERSION}")
    try:
        kind, payload_size, checksum = _frame_start(file.read(FRAME_START.size))
        payload = file.read(payload_size)
        if kind != HEADER or zlib.crc32(payload) != checksum:
            raise ValueError
        return Header.from_json(payload)
    except (ValueError, TypeError, KeyError, AttributeError):
        raise RecordingError(f"{path} is damaged at offset {FILE_START.size}: no valid header") from None


def _frame_start(start: bytes) -> tuple[bytes, int, int]:
    """Kind, size and checksum of the payload that follows."""
    kind, size, checksum, own_checksum = FRAME_START.unpack(start.ljust(FRAME_START.size, b"\0"))
    if own_checksum != zlib.crc32(start[:12]):
        raise ValueError("wrong checksum")
    return kind, size, checksum


def scan(path: Path) -> Scan:
    """Find the finished episodes of a file, up to its end or to the first damage. All checksums are verified.

    Raises:
        RecordingError: The file has no valid header.
    """
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        contents = _Contents(_read_header(path, file))
        offset = end = file.tell()
        damage = None
        try:
            while (payload := _next_payload(file, size)) is not None:
                end = file.tell() if contents.add(*payload) else end
                offset = file.tell()
        except ValueError as error:
            damage = f"at offset {offset} ({error})"
    episodes, nans = tuple(contents.episodes), tuple(contents.nans.tolist())
    return Scan(contents.header, episodes, contents.is_closed and end == size, end, size, nans, damage)


def _next_payload(file: io.BufferedReader, size: int) -> tuple[bytes, bytes] | None:
    """Kind and payload of the next frame; None at the end of the file or of its complete frames."""
    start = file.read(FRAME_START.size)
    if len(start) < FRAME_START.size or (not any(start) and not any(iter(lambda: file.read(1 << 16).strip(b"\0"), b""))):
        return None
    kind, payload_size, checksum = _frame_start(start)
    if payload_size > size - file.tell():
        return None
    payload = file.read(payload_size)
    if zlib.crc32(payload) != checksum:
        raise ValueError("wrong checksum")
    return kind, payload


class _Contents:
    """What the frames of a file add up to; the program checks the same when it reads the file."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.episodes: list[EpisodeRow] = []
        self.nans = np.zeros(len(header.observations), np.int64)
        self.is_closed = False
        self._steps = 0
        """Number of steps of the unfinished episode."""
        self._nans = np.zeros_like(self.nans)
        """NaN observations of the unfinished episode."""
        self._begin_step = 0
        """Steps of the environment before the next or unfinished episode."""

    def add(self, kind: bytes, payload: bytes) -> bool:
        """Add a frame; returns whether an episode, or the file, is finished with it.

        Raises:
            ValueError: The frame is not as expected.
        """
        self.is_closed = kind == CLOSED
        if self.is_closed:
            if payload != struct.pack("<I", len(self.episodes)):
                raise ValueError("another number of episodes than in the file")
            return True
        if kind == BEGIN and len(payload) == 8:
            self._begin_step = int.from_bytes(payload, "little")
            return False
        if kind != EPISODE or len(payload) < EPISODE_START.size:
            raise ValueError("unexpected frame")
        number, first_step, steps, outcome, total = EPISODE_START.unpack_from(payload)
        if first_step == 0:
            # An earlier attempt at this episode was cut off.
            self._steps, self._nans = 0, np.zeros_like(self.nans)
        if number != len(self.episodes) or first_step != self._steps or outcome >= len(OUTCOMES):
            raise ValueError(f"episode {number} from step {first_step} on, expected {len(self.episodes)} from {self._steps} on")
        self._add_states(payload, steps, steps + (outcome != RUNNING))
        if outcome == RUNNING:
            return False
        if self._steps == 0:
            raise ValueError("an episode without steps")
        self._begin_step += self._steps
        self.episodes.append(EpisodeRow(self.header.agent, number, total, self._steps, outcome, self._begin_step))
        self.nans += self._nans
        self._steps = 0
        return True

    def _add_states(self, payload: bytes, steps: int, states: int) -> None:
        observations, actions = len(self.header.observations), len(self.header.actions)
        if len(payload) != EPISODE_START.size + 4 * (states * observations + steps * (actions + 1)):
            raise ValueError(f"{len(payload)} bytes do not contain {steps} steps")
        values = np.frombuffer(payload, "<f4", states * observations, EPISODE_START.size)
        self._nans = self._nans + np.isnan(values).reshape(-1, observations).sum(axis=0)
        self._steps += steps


def merge_folder(folder: Path) -> dict[str, int]:
    """Write `episodes.csv` from the files of all agents and, if all of them are closed, `summary.json`.

    If a file is damaged, a warning says so, and nothing is written.

    Returns:
        Number of states in which an observation is NaN, for each observation with such states.
    """
    with explained(folder), locked(folder):
        for name in (EPISODES_TABLE, SUMMARY):
            for part in folder.glob(f".{name}.*.part"):
                part.unlink(missing_ok=True)
        scans = []
        for path in (folder / STATES_FOLDER).glob(f"agent_*{SUFFIX}"):
            try:
                found = scan(path)
                damage = None if found.damage is None else f"{path} is damaged {found.damage}"
            except RecordingError as error:
                damage = str(error)
            if damage is not None:
                message = f"{damage}: {EPISODES_TABLE} and {SUMMARY} are not written. resume=True cuts off what is damaged"
                warnings.warn(message, RuntimeWarning, stacklevel=4)
                return {}
            scans.append(found)
        scans.sort(key=lambda found: found.header.agent)
        episodes = [row for found in scans for row in found.episodes]
        episodes.sort(key=lambda row: (row.episode, row.agent))
        replace_file(folder / EPISODES_TABLE, _table(episodes))
        if all(found.is_closed for found in scans):
            text = json.dumps(_summary(folder, scans, episodes), ensure_ascii=False, indent=2)
            replace_file(folder / SUMMARY, text.encode() + b"\n")
        return _nan_observations(scans)


def _table(episodes: Sequence[EpisodeRow]) -> bytes:
    """`episodes.csv`. The number of a round is that of the episode."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    env_steps = 0
    for row in episodes:
        env_steps += row.length
        known = (row.agent, row.episode, row.episode, env_steps, row.total_reward, row.length, OUTCOMES[row.outcome])
        writer.writerow((*known, *("NaN",) * (len(COLUMNS) - len(known) - 1), row.end_step))
    return text.getvalue().encode()


def _summary(folder: Path, scans: Sequence[Scan], episodes: Sequence[EpisodeRow]) -> dict[str, Any]:
    """The results in a few numbers, as `seedbed run` writes them, as far as they are known."""
    agents = max(found.header.agent for found in scans) + 1
    learners = list(range(agents))
    for found in scans:
        learners[found.header.agent] = found.header.learner_number
    returns = learner_returns(episodes, learners)
    return {
        "scenario": folder.resolve().name,
        "environment": scans[0].header.environment,
        "seed": None,
        "agents": agents,
        "learners": learners,
        "rounds": max((row.episode + 1 for row in episodes), default=0),
        "episodes_per_agent": min(map(len, returns)),
        "episodes_of_agents": {str(found.header.agent): len(found.episodes) for found in scans},
        "env_steps": sum(row.length for row in episodes),
        "solved_at": None,
        "episodes_until_solved": None,
        "final_return": _final_return(returns),
        "nan_observations": _nan_observations(scans),
    }


def _final_return(returns: Sequence[Sequence[float]]) -> float | None:
    """Mean over learners of the mean return of their last episodes; None if one has none, or if it is not finite."""
    if not all(returns):
        return None
    last = [each[-FINAL_WINDOW:] for each in returns]
    # `math.fsum` raises for infinities of both signs and for sums that are too large.
    final_return = sum(sum(each) / len(each) for each in last) / len(last)
    return final_return if math.isfinite(final_return) else None


def _nan_observations(scans: Sequence[Scan]) -> dict[str, int]:
    """Number of states in which an observation is NaN, for each observation with such states."""
    names = [axis.name for axis in scans[0].header.observations]
    counts = [sum(numbers) for numbers in zip(*(found.nans for found in scans), strict=True)]
    return {name: count for name, count in zip(names, counts, strict=True) if count > 0}


def learner_returns(episodes: Sequence[EpisodeRow], learners: Sequence[int]) -> list[list[float]]:
    """The returns of each learner, in the order in which its episodes ended.

    Args:
        episodes: Episodes of all agents; those of each agent are in order.
        learners: Number of the learner of each agent.
    """
    returns: dict[int, list[float]] = {learner: [] for learner in sorted(set(learners))}
    for row in sorted(episodes, key=lambda row: (row.end_step, row.agent)):
        returns[learners[row.agent]].append(row.total_reward)
    return list(returns.values())
