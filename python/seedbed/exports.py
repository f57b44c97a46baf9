"""Tables of runs as Parquet files, which `seedbed export` writes to a cache folder.

A file in the cache belongs to certain versions of the files of the run: after a change of one of them it is written
again. Files of runs that do not exist any more are removed, and so are earlier versions, a minute after they were last
asked for.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, TypeAlias

from seedbed_command import command

from .errors import RunError
from .programs import call

Content: TypeAlias = Literal["states", "episodes", "rounds"]

CONTENTS = ("states", "episodes", "rounds")
RECORDINGS = ("run.rrd", "run.rrd.part")
TABLES = {"episodes": "episodes.csv", "rounds": "rounds.csv"}
STATES_FOLDER = "states"
"""Folder of the files of agents that were recorded from Python."""

KEPT_SECONDS = 60
"""Time for which another process may still open a version of a table that it was given."""

PARQUET_MARK = b"PAR1"
"""The first and the last bytes of a whole Parquet file."""


def cache_folder() -> Path:
    """Folder of exported tables: that of the environment variable `SEEDBED_CACHE`, by default the user's cache."""
    chosen = os.environ.get("SEEDBED_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "seedbed" / "tables"


def parquet_file(run: Path, content: Content, summary: dict[str, Any] | None) -> Path:
    """The Parquet file of a table of a run, which is written if it is not in the cache.

    Args:
        run: Folder of the run, or a recording.
        content: Name of the table.
        summary: Summary of a finished run, with which numbers of rows are compared.

    Raises:
        RunError: The table is missing, damaged, or shorter than the summary says; or the cache cannot be written.
    """
    sources = source_files(run, content)
    own = hashlib.sha256(str(run.resolve()).encode()).hexdigest()[:24]
    path = cache_folder() / f"{own}-{content}-{_version(sources)}.parquet"
    if _is_whole(path):
        with contextlib.suppress(OSError):
            os.utime(path, ns=(time.time_ns(), path.stat().st_mtime_ns))
        return path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_outdated(path, f"{own}-{content}-")
        (path.parent / f"{own}.run").write_text(str(run.resolve()), encoding="utf-8")
    except OSError as error:
        reason = f"tables cannot be written to this cache folder ({error}); name another one by SEEDBED_CACHE"
        raise RunError(path.parent, reason) from error
    _export(run, content, path, sources, summary)
    return path


def _is_whole(path: Path) -> bool:
    """Whether a file is in the cache, with its end."""
    size = len(PARQUET_MARK)
    try:
        with path.open("rb") as file:
            start = file.read(size)
            file.seek(-size, os.SEEK_END)
            return start == file.read() == PARQUET_MARK
    except OSError:
        return False


def source_files(run: Path, content: Content) -> list[Path]:
    """The existing files from which a table is made; for `states` also the episodes, if there are any.

    All tables of a run that was recorded from Python are made from its states, which grow before the others.
    """
    if not run.is_dir():
        if content != "states":
            raise RunError(run, f"a recording without its folder has no {TABLES[content]}")
        return [run]
    states = sorted((run / STATES_FOLDER).glob("*.states"))
    if content != "states" and not states:
        table = run / TABLES[content]
        if not table.is_file():
            raise RunError(table, f"there is no such file, from which {content} are read")
        return [table]
    recordings = [run / name for name in RECORDINGS if (run / name).is_file()]
    recordings += states
    if not recordings:
        raise RunError(run / RECORDINGS[0], "there is no such file, from which states are read")
    return recordings + [table for name in TABLES.values() if (table := run / name).is_file()]


def _version(sources: Iterable[Path]) -> str:
    """Hash of the versions of the files of a run, and of the program that reads them."""
    versions = []
    for path in (*sources, Path(command()).resolve()):
        # A recording is renamed when its run is finished.
        with contextlib.suppress(FileNotFoundError):
            status = path.stat()
            versions.append((path.name, status.st_size, status.st_mtime_ns, status.st_ino))
    return hashlib.sha256(repr(versions).encode()).hexdigest()[:24]


def _export(run: Path, content: Content, path: Path, sources: list[Path], summary: dict[str, Any] | None) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent, prefix="writing-") as folder:
        part = Path(folder) / path.name
        printed = call("export", run, "--content", content, "--to", part)
        rows = re.search(r"(\d+) rows?\s*$", printed.replace(",", ""))
        if rows is None:
            raise RunError(run, f"unexpected answer of `seedbed export`: {printed.strip()}")
        if summary is not None:
            _check_complete(run, content, sources[0], int(rows[1]), summary)
        os.replace(part, path)


def _check_complete(run: Path, content: Content, source: Path, rows: int, summary: dict[str, Any]) -> None:
    """Compare a table of a finished run with its summary: the program reads the intact beginning of a file.

    The program itself compares what was recorded from Python with its summary.
    """
    table = run / TABLES["rounds" if content == "rounds" else "episodes"]
    per_agent = summary.get("rounds" if content == "rounds" else "episodes_per_agent")
    if not table.is_file() or per_agent is None or "learners" in summary:
        return
    expected = per_agent * summary["agents"]
    if content == "states":
        expected += _sum_of_lengths(table)
    elif not table.read_bytes().endswith(b"\n"):
        raise RunError(table, "the end of the file is missing: its last line is incomplete")
    if rows < expected:
        raise RunError(source, f"it has {rows} rows, expected {expected}: the end of the file is missing")


def _sum_of_lengths(table: Path) -> int:
    """Number of steps of all episodes."""
    with table.open(newline="", encoding="utf-8") as file:
        try:
            return sum(int(row["length"]) for row in csv.DictReader(file))
        except (KeyError, TypeError, ValueError, csv.Error) as error:
            raise RunError(table, f"a line has no valid length: {error}") from error


def _remove_outdated(path: Path, prefix: str) -> None:
    """Remove other versions of a table, and tables of runs that do not exist."""
    folder = path.parent
    outdated = [other for other in folder.glob(f"{prefix}*.parquet") if _is_outdated(other)]
    for note in folder.glob("*.run"):
        with contextlib.suppress(FileNotFoundError):
            if not os.path.exists(note.read_text(encoding="utf-8")):
                outdated += [note, *folder.glob(f"{note.stem}-*.parquet")]
    for other in outdated:
        # A file that another process has open stays on Windows; it is removed the next time.
        with contextlib.suppress(OSError):
            other.unlink(missing_ok=True)


def _is_outdated(path: Path) -> bool:
    try:
        status = path.stat()
        return time.time() - max(status.st_atime, status.st_mtime) > KEPT_SECONDS
    except OSError:
        return False
