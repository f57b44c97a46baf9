"""Errors of runs and of the program `seedbed`."""

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
        return type(self), (self.path, self.message)


class InputError(RunError, ValueError):
    """An argument, a setting or a file is wrong. The message is that of the program, which ends with status 2, with the names
    of arguments instead of options: `overwrite=True` for `--overwrite`.
    """
