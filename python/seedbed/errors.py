"""Errors of reading runs."""

from __future__ import annotations

from pathlib import Path


class RunError(Exception):
    """Something of a run is missing or damaged, or the program `seedbed` failed.

    Attributes:
        path: The file or folder, or None if the message of the program names it.
        message: What is wrong, without the path.
    """

    def __init__(self, path: Path | None, message: str) -> None:
        super().__init__(message if path is None else f"{path}: {message}")
        self.path = path
        self.message = message

    def __reduce__(self) -> tuple[type[RunError], tuple[Path | None, str]]:
        return RunError, (self.path, self.message)
