"""Checksums of the files of a run, which the program writes to `SHA256SUMS`."""

from __future__ import annotations

import hashlib
from pathlib import Path

from .errors import RunError

CHECKSUMS = "SHA256SUMS"

END = "# SHA-256 of the lines above: "
"""Beginning of the last line."""


def verify(path: Path, run: Path | None = None) -> None:
    """Check that a file in the folder of a run has the bytes with which it was written, as far as they are known.

    Args:
        path: The file.
        run: Folder of the run; by default the one that contains the file.

    Raises:
        RunError: It has others.
    """
    run = run or path.parent
    sums = run / CHECKSUMS
    if sums.exists() and not sums.is_file():
        raise RunError(sums, "expected a regular file, found a folder, a pipe, a socket or a device")
    if not sums.is_file() or not path.is_file():
        return
    expected = _read(sums).get(path.relative_to(run).as_posix())
    if expected is not None and hashlib.sha256(path.read_bytes()).hexdigest() != expected:
        reason = f"it is damaged, or was changed after the run wrote it; to use it as it is, delete {sums}"
        raise RunError(path, reason)


def _read(sums: Path) -> dict[str, str]:
    content = sums.read_bytes()
    lines, _, last = content.rpartition(END.encode())
    if last.decode(errors="replace") != hashlib.sha256(lines).hexdigest() + "\n":
        raise RunError(sums, "it is damaged: its last line is not the checksum of the lines before it")
    entries = [line.split("  ", 1) for line in lines.decode().splitlines() if not line.startswith("#")]
    return {name: checksum for checksum, name in entries}
