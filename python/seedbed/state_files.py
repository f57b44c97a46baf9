"""Files of visited states: one per agent, to which finished episodes are appended.

`docs/recording.md` ("Files of visited states") describes the format. Only NumPy and the standard library are
needed. A process that is killed leaves at most one incomplete frame, at the end of the file of its agent.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
import os
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAGIC = b"SBSTATES"
FORMAT_VERSION = 1
FILE_START = struct.Struct("<8sII")
"""Magic, version of the format, CRC-32 of both."""

FRAME_START = struct.Struct("<4sIII")
"""Kind of the frame, number of bytes of its payload, CRC-32 of the payload, CRC-32 of these three."""

HEADER, EPISODE, CLOSED = b"HEAD", b"EPIS", b"DONE"

EPISODE_START = struct.Struct("<IIIId")
"""Number of the episode, number of its first step in the frame, number of steps in the frame, outcome, sum of all
rewards of the episode so far."""

RUNNING, TERMINATED, TRUNCATED = range(3)
OUTCOMES = ("running", "terminated", "truncated")

STATES_FOLDER = "states"
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
)
"""Columns of `episodes.csv`. The last four are not known here; `seedbed inspect` computes them."""

DERIVED_FILES = (EPISODES_TABLE, SUMMARY, "rounds.csv", "run.rrd")
"""Files that are made from files of visited states, and made again when there are more states."""

FILES_OF_OTHER_RUNS = ("scenario.ron", "rounds.csv", "checkpoint", "run.rrd", "run.rrd.part")
"""Files by which the folder of another run is recognized."""


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
        fields: dict[str, Any] = json.loads(payload)
        for axes in ("observations", "actions"):
            fields[axes] = tuple(Axis(**axis) for axis in fields[axes])
        return cls(**fields)

    def difference_from(self, other: Header) -> str | None:
        """What prevents both agents from being in one recording; None if nothing does."""
        for field in ("environment", "observations", "actions"):
            mine, theirs = getattr(self, field), getattr(other, field)
            if mine != theirs:
                return f"{field} {_text(mine)} differ from those of agent {other.agent}: {_text(theirs)}"
        return None


@dataclass(frozen=True)
class EpisodeRow:
    """One finished episode in `episodes.csv`."""

    agent: int
    episode: int
    total_reward: float
    length: int
    outcome: int


@dataclass(frozen=True)
class Scan:
    """What is in the file of an agent."""

    header: Header
    episodes: tuple[EpisodeRow, ...]
    is_closed: bool
    """Whether the recorder was closed after the last episode."""
    end: int
    """Offset after the last frame of a finished episode, or of the end mark."""
    size: int


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


def check_start(folder: Path, header: Header, *, overwrite: bool, resume: bool) -> None:
    """Refuse to record an agent where it would mix with something else.

    Raises:
        FileExistsError: The agent was recorded before, or the folder contains another run.
        ValueError: The folder has agents of another environment or with other axes.
    """
    if overwrite and resume:
        raise ValueError("overwrite=True and resume=True exclude each other")
    path = file_of(folder, header.agent)
    others = sorted(other for other in path.parent.glob(f"agent_*{SUFFIX}") if other != path)
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

    It is open only while something is appended, so that one process can record any number of agents.

    Raises:
        FileExistsError, ValueError: See `check_start`.
        RecordingError: The existing file cannot be resumed.
    """

    def __init__(self, folder: Path, header: Header, *, overwrite: bool = False, resume: bool = False) -> None:
        self.path = file_of(folder, header.agent)
        self.header = header
        self.next_episode = 0
        self._process = os.getpid()
        self._has_rival = False
        with locked(folder):
            check_start(folder, header, overwrite=overwrite, resume=resume)
            self._size = self._resume() if resume and self.path.exists() else self._create()
            for name in DERIVED_FILES:
                (folder / name).unlink(missing_ok=True)

    def append_steps(
        self,
        first_step: int,
        observations: NDArray[np.floating],
        actions: NDArray[np.floating],
        rewards: NDArray[np.floating],
        outcome: int,
        total_reward: float,
    ) -> None:
        """Append n steps of the running episode, which ends with them unless `outcome` is RUNNING.

        Args:
            first_step: Number of the first of these steps in its episode.
            observations: Before each step, and after the last one if the episode ends: `[n or n + 1, observations]`.
            actions: `[n, actions]`.
            rewards: `[n]`.
            outcome: RUNNING, TERMINATED or TRUNCATED.
            total_reward: Sum of all rewards of the episode so far.
        """
        start = EPISODE_START.pack(self.next_episode, first_step, len(rewards), outcome, total_reward)
        arrays = (np.ascontiguousarray(array, "<f4").tobytes() for array in (observations, actions, rewards))
        self._append(frame(EPISODE, start + b"".join(arrays)))
        self.next_episode += outcome != RUNNING

    def close(self) -> None:
        """Append the mark that the recorder was closed, unless another recorder writes to the file."""
        if self.was_made_here() and not self._has_rival:
            self._append(frame(CLOSED, struct.pack("<I", self.next_episode)), sync=True)

    def was_made_here(self) -> bool:
        """Whether this process opened the file. A process that was forked from it must not write."""
        return os.getpid() == self._process

    def _create(self) -> int:
        """Create the file, and return its size."""
        start = file_start(self.header)
        replace_file(self.path, start)
        return len(start)

    def _resume(self) -> int:
        """Remove what follows the last finished episode, and return the size of the file."""
        found = scan(self.path)
        # Files that were begun before learners were recorded have none.
        known = self.header if found.header.learner is not None else replace(self.header, learner=None)
        if found.header != known:
            difference = self.header.difference_from(found.header) or "learner, time limit or step differs"
            raise ValueError(f"{self.path} cannot be resumed: {difference}")
        if found.end < found.size:
            warnings.warn(
                f"{self.path}: removed the unfinished last episode ({found.size - found.end} bytes)",
                RuntimeWarning,
                stacklevel=4,
            )
            os.truncate(self.path, found.end)
        self.next_episode = found.episodes[-1].episode + 1 if found.episodes else 0
        return found.end

    def _append(self, content: bytes, *, sync: bool = False) -> None:
        if not self.was_made_here():
            raise RecordingError(
                f"{self.path} was opened by process {self._process}, but this is process {os.getpid()}: "
                "make the recorder in the process that steps the environment"
            )
        try:
            descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise RecordingError(f"cannot append to {self.path}: {error}") from error
        try:
            self._write(descriptor, content, sync)
        finally:
            os.close(descriptor)
        self._size += len(content)

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
            with contextlib.suppress(OSError):
                os.ftruncate(descriptor, self._size)
            raise RecordingError(f"cannot append to {self.path}: {error}") from error


def replace_file(path: Path, content: bytes) -> None:
    """Write a file so that it has either its old or its new content, whatever happens."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let one process at a time change which files are in a folder. The system unlocks it if the process dies."""
    states = folder / STATES_FOLDER
    states.mkdir(parents=True, exist_ok=True)
    with open(states / ".lock", "ab") as file:
        _lock(file.fileno())
        yield


def _lock(descriptor: int) -> None:
    if os.name == "nt":
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_LOCK, 1)  # type: ignore[attr-defined, unused-ignore]
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX)


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
    kind, payload_size, checksum = _read_frame_start(path, file)
    payload = file.read(payload_size)
    if kind != HEADER or zlib.crc32(payload) != checksum:
        raise RecordingError(f"{path} is damaged at offset {FILE_START.size}: no valid header")
    return Header.from_json(payload)


def _read_frame_start(path: Path, file: io.BufferedReader) -> tuple[bytes, int, int]:
    """Kind, size and checksum of the payload that follows."""
    offset = file.tell()
    start = file.read(FRAME_START.size)
    kind, size, checksum, own_checksum = FRAME_START.unpack(start.ljust(FRAME_START.size, b"\0"))
    if own_checksum != zlib.crc32(start[:12]):
        raise RecordingError(f"{path} is damaged at offset {offset}: wrong checksum")
    return kind, size, checksum


def scan(path: Path) -> Scan:
    """Find the finished episodes of a file. States are skipped; their checksums are checked by `seedbed`."""
    episodes: list[EpisodeRow] = []
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        header = _read_header(path, file)
        end, is_closed = file.tell(), False
        while size - file.tell() >= FRAME_START.size:
            kind, payload_size, _ = _read_frame_start(path, file)
            next_frame = file.tell() + payload_size
            if next_frame > size:
                break
            is_closed = kind == CLOSED
            outcome = RUNNING
            if kind == EPISODE:
                number, first_step, steps, outcome, total = EPISODE_START.unpack(file.read(EPISODE_START.size))
                if outcome != RUNNING:
                    episodes.append(EpisodeRow(header.agent, number, total, first_step + steps, outcome))
            if is_closed or outcome != RUNNING:
                end = next_frame
            file.seek(next_frame)
    return Scan(header, tuple(episodes), is_closed, end, size)


def merge_folder(folder: Path) -> None:
    """Write `episodes.csv` from the files of all agents and, if all of them are closed, `summary.json`."""
    with locked(folder):
        scans = [scan(path) for path in (folder / STATES_FOLDER).glob(f"agent_*{SUFFIX}")]
        scans.sort(key=lambda found: found.header.agent)
        episodes = [row for found in scans for row in found.episodes]
        episodes.sort(key=lambda row: (row.episode, row.agent))
        replace_file(folder / EPISODES_TABLE, _table(episodes))
        if all(found.is_closed for found in scans):
            text = json.dumps(_summary(folder, scans, episodes), ensure_ascii=False, indent=2)
            replace_file(folder / SUMMARY, text.encode() + b"\n")


def _table(episodes: Sequence[EpisodeRow]) -> bytes:
    """`episodes.csv`. The number of a round is that of the episode."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    env_steps = 0
    for row in episodes:
        env_steps += row.length
        known = (row.agent, row.episode, row.episode, env_steps, row.total_reward, row.length, OUTCOMES[row.outcome])
        writer.writerow(known + ("NaN",) * (len(COLUMNS) - len(known)))
    return text.getvalue().encode()


def _summary(folder: Path, scans: Sequence[Scan], episodes: Sequence[EpisodeRow]) -> dict[str, Any]:
    """The results in a few numbers, as `seedbed run` writes them, as far as they are known."""
    agents = max(found.header.agent for found in scans) + 1
    learners = list(range(agents))
    for found in scans:
        learners[found.header.agent] = found.header.learner_number
    returns = learner_returns(episodes, learners)
    means = [math.fsum(last) / len(last) for last in (each[-FINAL_WINDOW:] for each in returns) if last]
    final_return = math.fsum(means) / len(means) if len(means) == len(returns) else 0.0
    return {
        "scenario": folder.resolve().name,
        "environment": scans[0].header.environment,
        "seed": None,
        "agents": agents,
        "learners": learners,
        "rounds": max((row.episode + 1 for row in episodes), default=0),
        "episodes_per_agent": min(map(len, returns)),
        "env_steps": sum(row.length for row in episodes),
        "solved_at": None,
        "episodes_until_solved": None,
        "final_return": final_return if math.isfinite(final_return) else None,
    }


def learner_returns(episodes: Sequence[EpisodeRow], learners: Sequence[int]) -> list[list[float]]:
    """The returns of each learner, in the order in which its episodes ended.

    Copies of an environment step together: an episode ends after as many steps of its copy as the copy has done.

    Args:
        episodes: Episodes of all agents; those of each agent are in order.
        learners: Number of the learner of each agent.
    """
    ends = [0] * len(learners)
    ordered = []
    for row in episodes:
        ends[row.agent] += row.length
        ordered.append((ends[row.agent], row.agent, row.total_reward))
    returns: dict[int, list[float]] = {learner: [] for learner in sorted(set(learners))}
    for _, agent, total_reward in sorted(ordered, key=lambda end: end[:2]):
        returns[learners[agent]].append(total_reward)
    return list(returns.values())
