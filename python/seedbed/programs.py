"""Calling the program `seedbed`."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence

from seedbed_command import command, use_this_python

from .errors import InputError, RunError

Argument = str | os.PathLike[str]

INVALID_INPUT = 2
"""Exit status of the program if what it was given is wrong."""

_SWITCHES = re.compile(r"--(resume|overwrite|other-versions)\b")
_PARTS = re.compile(r"--what (returns(?:,\w+)*)")
_OPTIONS = re.compile(r"--(out|set|seed|agents|episodes|jobs|threads|runs|what|axes|where|width|height)\b")
"""Options of the program that are arguments of the functions of this package with the same name."""


def call(*arguments: Argument) -> str:
    """Run the program and return what it prints.

    Raises:
        RunError: It failed. The message is its own, without `error: `.
        FileNotFoundError: There is no program; see `seedbed.command`.
    """
    done = subprocess.run(
        _line(arguments), capture_output=True, encoding="utf-8", errors="replace", stdin=subprocess.DEVNULL
    )
    if done.returncode != 0:
        raise error_of(done.returncode, done.stderr, arguments)
    return done.stdout


def follow(
    arguments: Sequence[Argument],
    *,
    on_line: Callable[[str], str | None],
    on_message: Callable[[str], None],
    python_path: Sequence[str] = (),
) -> None:
    """Run the program to its end, line by line.

    An exception, such as that of Control-C, asks the program to stop as Control-C in a terminal does, waits until it has
    written its checkpoint, and is raised then. A second Control-C ends the program at once.

    Args:
        arguments: Arguments of the program.
        on_line: Called with each line of its output; what it returns is written to the input of the program.
        on_message: Called, from another thread, with each line of warnings and progress.
        python_path: Folders in which Python finds modules, for environments of Gymnasium.

    Raises:
        RunError: The program failed. The message is its own, without `error: `.
    """
    line = _line(arguments)  # it also names this Python in the environment
    environment = os.environ.copy()
    if python_path:
        environment["PYTHONPATH"] = os.pathsep.join(python_path)
    process = subprocess.Popen(
        line,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        # Control-C reaches this process alone, which passes it on once: twice would end the program without a checkpoint.
        start_new_session=os.name != "nt",
        env=environment,
    )
    messages = _Messages(process, on_message)
    try:
        _answer(process, on_line)
    except BaseException as error:
        # Only who pressed Control-C waits for the program.
        messages.is_muted = not isinstance(error, KeyboardInterrupt)
        _stop(process)
        raise
    finally:
        messages.thread.join()
        for stream in (process.stdin, process.stdout, process.stderr):
            with contextlib.suppress(OSError):
                stream.close()  # type: ignore[union-attr]
    if process.returncode != 0:
        raise error_of(process.returncode, messages.error, arguments)


def error_of(status: int, messages: str, arguments: Sequence[Argument]) -> RunError:
    """The error of a program that ended with this status after these messages."""
    message = re.split(r"^error: ", messages.strip(), flags=re.MULTILINE)[-1]
    if status == INVALID_INPUT and message:
        return InputError(None, in_python(message))
    return RunError(None, message or f"`seedbed {arguments[0]!s}` ended with exit status {status}")


def in_python(message: str) -> str:
    """A message of the program about its options, which names the arguments of Python instead.

    Example:
        >>> in_python("it contains a run; choose another --out directory, or --overwrite to replace it")
        'it contains a run; choose another out directory, or overwrite=True to replace it'
        >>> in_python("run is not recorded; use --what returns,curves, which needs only the tables")
        "run is not recorded; use what=['returns', 'curves'], which needs only the tables"
    """
    message = message.removesuffix("\n\nFor more information, try '--help'.")
    message = _PARTS.sub(lambda parts: f"what={parts[1].split(',')}", message)
    message = _SWITCHES.sub(lambda switch: f"{switch[1].replace('-', '_')}=True", message)
    return _OPTIONS.sub(r"\1", message)


def _line(arguments: Sequence[Argument]) -> list[str]:
    use_this_python()
    return [command(), *(os.fspath(argument) for argument in arguments)]


class _Messages:
    """Reads what the program writes to its standard error: messages, and the error with which it ends."""

    def __init__(self, process: subprocess.Popen[str], on_message: Callable[[str], None]) -> None:
        self.error = ""
        self.is_muted = False
        self._process = process
        self._on_message = on_message
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if self.error or line.startswith("error: "):
                self.error += line
            elif line.strip() and not self.is_muted:
                self._on_message(line.rstrip("\n"))


def _answer(process: subprocess.Popen[str], on_line: Callable[[str], str | None]) -> None:
    assert process.stdin is not None and process.stdout is not None
    for line in process.stdout:
        answer = on_line(line.rstrip("\n"))
        if answer is not None:
            # The error of a program that has ended is more helpful than that its input is closed.
            with contextlib.suppress(BrokenPipeError):
                process.stdin.write(f"{answer}\n")
                process.stdin.flush()
    process.wait()


def _stop(process: subprocess.Popen[str]) -> None:
    """Ask the program to stop, and wait for its end."""
    assert process.stdin is not None and process.stdout is not None
    while process.poll() is None:
        # On Windows, Control-C has reached the program too.
        if sys.platform != "win32":
            process.send_signal(signal.SIGINT)
        # No answer stops a run too.
        with contextlib.suppress(OSError):
            process.stdin.close()
        with contextlib.suppress(KeyboardInterrupt):
            for _ in process.stdout:
                pass
            process.wait()
