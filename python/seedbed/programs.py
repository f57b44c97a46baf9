"""Calling the program `seedbed`."""

from __future__ import annotations

import os
import re
import subprocess

from seedbed_command import command, use_this_python

from .errors import RunError


def call(*arguments: str | os.PathLike[str]) -> str:
    """Run the program and return what it prints.

    Raises:
        RunError: It failed. The message is its own, without `error: `.
        FileNotFoundError: There is no program; see `seedbed.command`.
    """
    use_this_python()
    line = [command(), *(os.fspath(argument) for argument in arguments)]
    done = subprocess.run(line, capture_output=True, encoding="utf-8", errors="replace", stdin=subprocess.DEVNULL)
    if done.returncode != 0:
        message = re.split(r"^error: ", done.stderr.strip(), flags=re.MULTILINE)[-1]
        raise RunError(None, message or f"`seedbed {arguments[0]!s}` ended with exit status {done.returncode}")
    return done.stdout
