"""The program `seedbed`, which is part of the package.

A package of its own, because it must start at once: `import seedbed` imports Gymnasium.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import NoReturn

__all__ = ["command", "main", "use_this_python"]

VARIABLE = "SEEDBED_PROGRAM"
FILE_NAME = "seedbed.exe" if os.name == "nt" else "seedbed"


def command() -> str:
    """Path of the program `seedbed`.

    It is the one that the environment variable `SEEDBED_PROGRAM` names, otherwise the one in the package, otherwise
    the first on `PATH` (in a package that was built without the program).

    Returns:
        An absolute path.

    Raises:
        FileNotFoundError: There is no such program.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return _chosen_program(chosen)
    packaged = Path(__file__).resolve().parent.parent / "seedbed" / "bin" / FILE_NAME
    found = str(packaged) if packaged.is_file() else _program_on_path()
    if found is None:
        raise FileNotFoundError(
            f"this package was built without the program `seedbed`, and there is none on PATH: set {VARIABLE} to the "
            "path of one, install it with `cargo install --path .` in the directory of the repository, or install the "
            "wheel that `python/build_wheel` makes there, which has the program"
        )
    return found


def main() -> NoReturn:
    """Become the program: exit status and signals are its own."""
    try:
        program = command()
    except FileNotFoundError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    use_this_python()
    arguments = [program, *sys.argv[1:]]
    try:
        if os.name != "nt":
            os.execv(program, arguments)
        # There `execv` does not wait. Control-C reaches both processes, and the program decides.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.exit(subprocess.run(arguments).returncode)
    except OSError as error:
        print(f"error: cannot run {program}: {error.strerror}", file=sys.stderr)
        sys.exit(1)


def use_this_python() -> None:
    """Let programs that this process starts run environments of Gymnasium with its own Python, unless another is chosen."""
    os.environ.setdefault("SEEDBED_PYTHON", sys.executable)


def _chosen_program(path: str) -> str:
    if not os.path.isfile(path):
        raise FileNotFoundError(
            f"{VARIABLE} is {path}, which is not a file; expected the path of the program `seedbed`"
        )
    return os.path.abspath(path)


def _program_on_path() -> str | None:
    """The first program on `PATH` that is not a script of Python, such as the one that calls `main`."""
    own_scripts = Path(sysconfig.get_path("scripts")).resolve()
    for folder in os.get_exec_path():
        found = shutil.which("seedbed", path=folder) if folder else None
        if found and Path(folder).resolve() != own_scripts and not _is_script(found):
            return os.path.abspath(found)
    return None


def _is_script(path: str) -> bool:
    with open(path, "rb") as file:
        return file.read(2) == b"#!"
