"""The wheel, installed in an empty virtual environment and used in an empty folder.

`python/test` names the wheel in the environment variable SEEDBED_WHEEL.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import venv
import zipfile
from pathlib import Path

import pytest

PREFIX = "Scripts" if os.name == "nt" else "bin"


@pytest.fixture(scope="module")
def wheel() -> Path:
    path = os.environ.get("SEEDBED_WHEEL")
    assert path, "SEEDBED_WHEEL must name the wheel: run python/test"
    return Path(path)


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of programs of a virtual environment in which only the wheel and what it needs is installed."""
    folder = tmp_path_factory.mktemp("venv")
    venv.create(folder, with_pip=True)
    programs = folder / PREFIX
    command = [programs / "pip", "install", "--quiet", "--disable-pip-version-check", wheel]
    subprocess.run(command, check=True)
    return programs


def call(program: Path, *arguments: str | Path, cwd: Path, **options: str) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(program.parent), "HOME": str(cwd), **options}
    return subprocess.run([program, *arguments], capture_output=True, text=True, cwd=cwd, env=environment)


def test_the_size_of_the_wheel(wheel: Path):
    assert wheel.stat().st_size <= 40_000_000
    names = zipfile.ZipFile(wheel).namelist()
    assert "seedbed/bin/seedbed" in names
    assert not [name for name in names if name.startswith(("tests", "examples", "seedbed/__pycache__"))]


def test_train_and_read_in_an_empty_folder(installed: Path, tmp_path: Path):
    trained = call(installed / "seedbed", "run", "cartpole", cwd=tmp_path)
    assert trained.returncode == 0, trained.stderr
    assert "seed-0" in trained.stdout
    script = (
        "import seedbed; run = seedbed.load('recordings/cartpole'); print(run.agents, run.summary['rounds']); "
        "print(run.policy(0)([0.0, 0.1, 0.02, -0.1]) in (0, 1)); print(seedbed.command())"
    )
    read = call(installed / "python", "-c", script, cwd=tmp_path)
    assert read.returncode == 0, read.stderr
    agents, is_action, command = read.stdout.splitlines()
    assert (agents, is_action) == ("4 200", "True")
    assert Path(command).parts[-3:] == ("seedbed", "bin", "seedbed")
    # Without a library of frames, what to install is said.
    tables = call(installed / "python", "-c", "import seedbed; seedbed.load('recordings').states", cwd=tmp_path)
    assert "ImportError: frames need polars, or pandas and pyarrow: `pip install polars`" in tables.stderr


def test_the_command_is_the_program(installed: Path, tmp_path: Path):
    """Exit status, arguments, and a program that is chosen for development."""
    version = call(installed / "seedbed", "--version", cwd=tmp_path)
    assert version.stdout.startswith("seedbed ") and version.returncode == 0
    assert call(installed / "python", "-m", "seedbed", "--version", cwd=tmp_path).stdout == version.stdout
    assert call(installed / "seedbed", "check", "no file.ron", cwd=tmp_path).returncode == 2
    chosen = tmp_path / "chosen"
    chosen.write_text('#!/bin/sh\necho "chosen: $1"\nexit 5\n')
    chosen.chmod(0o755)
    other = call(installed / "seedbed", "a b", cwd=tmp_path, SEEDBED_PROGRAM=str(chosen))
    assert (other.stdout, other.returncode) == ("chosen: a b\n", 5)
    missing = call(installed / "seedbed", cwd=tmp_path, SEEDBED_PROGRAM="nothing")
    assert missing.returncode == 2 and missing.stderr.startswith(
        "error: SEEDBED_PROGRAM is nothing, which is not a file"
    )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals")
def test_the_command_gets_signals(installed: Path, tmp_path: Path):
    """The program takes the place of the script, so that an interruption reaches it."""
    command = [installed / "seedbed", "run", "cartpole", "--set", "stop=Episodes(1000000)", "--out", "long"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 60
        while not (tmp_path / "long/episodes.csv").exists():
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 128 + signal.SIGINT, "the program's own exit status of an interruption"
    finally:
        process.kill()
        process.wait()
    assert (tmp_path / "long/checkpoint/state.bin").exists(), "the program saves its state when it is interrupted"


def test_without_the_program(installed: Path, tmp_path: Path):
    """A package without the program finds one on PATH, but never its own script."""
    packaged = next(installed.parent.glob("lib/python*/site-packages/seedbed/bin/seedbed"))
    moved = tmp_path / "elsewhere" / "seedbed"
    moved.parent.mkdir()
    packaged.rename(moved)
    try:
        none = call(installed / "seedbed", "--version", cwd=tmp_path)
        assert none.returncode == 2 and "built without the program" in none.stderr
        path = os.pathsep.join([str(installed), str(moved.parent)])
        assert call(installed / "seedbed", "--version", cwd=tmp_path, PATH=path).stdout.startswith("seedbed ")
    finally:
        moved.rename(packaged)
