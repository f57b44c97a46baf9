"""Locks of the folder of a run, and of each agent that is recorded in it.

They are locks of bytes of the file `states/.lock`: byte k for agent k, and one for the folder. The system releases
them if the process dies. One open file per folder is enough for any number of agents. On Linux the locks belong to the
open file; elsewhere on POSIX to the process, which loses them when it closes another open file of the same name, such as
one of `shutil.copytree`.
"""

from __future__ import annotations

import contextlib
import os
import struct
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

STATES_FOLDER = "states"

FOLDER_BYTE = 1 << 16
"""The byte that is locked while files of a folder change; agents have smaller numbers."""


@dataclass
class LockFile:
    """The file of the locks of a folder, as long as this process has some of them."""

    key: tuple[int, int]
    descriptor: int
    locked: set[int] = field(default_factory=set)


_guard = threading.RLock()
_files: dict[tuple[int, int], LockFile] = {}
"""A process opens a file of locks once: locks of its bytes by two open files exclude each other or, where they belong to
the process, do not."""


def _forget() -> None:
    """Forget the locks of the process from which this one was forked: they end when that one closes its file, too."""
    global _guard
    _guard = threading.RLock()
    for file in _files.values():
        os.close(file.descriptor)
    _files.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[LockFile]:
    """The file of locks, which is closed afterwards if none of its bytes is locked."""
    with _guard:
        states = folder / STATES_FOLDER
        states.mkdir(parents=True, exist_ok=True)
        path = states / ".lock"
        file = None
        with contextlib.suppress(FileNotFoundError):
            file = _files.get(_key(os.stat(path)))
        if file is None:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            key = _key(os.fstat(descriptor))
            file = _files[key] = LockFile(key, descriptor)
        try:
            yield file
        finally:
            _close_if_unused(file)


def _key(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino


def _close_if_unused(file: LockFile) -> None:
    if not file.locked and _files.get(file.key) is file:
        del _files[file.key]
        os.close(file.descriptor)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let one process at a time change which files are in a folder."""
    with _opened(folder) as file:
        _lock(file.descriptor, FOLDER_BYTE, wait=True)
        file.locked.add(FOLDER_BYTE)
        try:
            yield
        finally:
            _unlock(file, FOLDER_BYTE)


def claim(folder: Path, agent: int) -> LockFile | None:
    """Lock an agent until `release`; None if it is locked, by this process or another one."""
    with _opened(folder) as file:
        if agent in file.locked or not _lock(file.descriptor, agent, wait=False):
            return None
        file.locked.add(agent)
        return file


def release(file: LockFile, agent: int) -> None:
    """Unlock an agent that this process has locked."""
    with _guard:
        if _files.get(file.key) is file and agent in file.locked:
            _unlock(file, agent)
            _close_if_unused(file)


def _lock(descriptor: int, byte: int, *, wait: bool) -> bool:
    """Whether the byte is locked now, or the file system has no locks."""
    try:
        if os.name == "nt":
            import msvcrt

            os.lseek(descriptor, byte, os.SEEK_SET)
            mode = msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK  # type: ignore[attr-defined, unused-ignore]
            msvcrt.locking(descriptor, mode, 1)  # type: ignore[attr-defined, unused-ignore]
        else:
            _lock_bytes(descriptor, byte, wait=wait)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        # Two recorders of one agent are then noticed by the size of its file.
        return True
    return True


def _unlock(file: LockFile, byte: int) -> None:
    file.locked.discard(byte)
    with contextlib.suppress(OSError):
        if os.name == "nt":
            import msvcrt

            os.lseek(file.descriptor, byte, os.SEEK_SET)
            msvcrt.locking(file.descriptor, msvcrt.LK_UNLCK, 1)  # type: ignore[attr-defined, unused-ignore]
        else:
            import fcntl

            if sys.platform == "linux":
                fcntl.fcntl(file.descriptor, fcntl.F_OFD_SETLK, _flock(fcntl.F_UNLCK, byte))
            else:
                fcntl.lockf(file.descriptor, fcntl.LOCK_UN, 1, byte)


def _lock_bytes(descriptor: int, byte: int, *, wait: bool) -> None:
    import fcntl

    if sys.platform == "linux":
        fcntl.fcntl(descriptor, fcntl.F_OFD_SETLKW if wait else fcntl.F_OFD_SETLK, _flock(fcntl.F_WRLCK, byte))
    else:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, byte)


def _flock(kind: int, byte: int) -> bytes:
    """The `struct flock` of Linux: kind, from where `start` counts, start, length and, 0 for open files, the process."""
    return struct.pack("hhqqi0q", kind, os.SEEK_SET, byte, 1, 0)
