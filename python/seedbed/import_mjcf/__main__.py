"""`python -m seedbed.import_mjcf MODEL.xml > envs/model.ron`"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from .comparison import check_task, comparison_text
from .conversion import Conversion, Options, convert_model
from .report import MjcfError
from .writing import dropped, task_text

EXAMPLES = """examples:
  python -m seedbed.import_mjcf hopper.xml --frame-skip 4 -o envs/hopper_mjcf.ron
  python -m seedbed.import_mjcf hopper.xml --frame-skip 4 --no-comparison > envs/hopper_mjcf.ron

Then: seedbed check envs/hopper_mjcf.ron

Only models that move in a plane can be converted: slides in it, and hinges perpendicular to it. Errors name all elements
that do not fit; the exit code is 2 then, and nothing is written. The model itself is read by MuJoCo: pip install mujoco
"""

NOT_CONVERTIBLE = 2
"""Exit code: the file or an argument is wrong."""


def main(arguments: list[str] | None = None) -> int:
    """The command line; returns the exit code."""
    options = parser().parse_args(arguments)
    try:
        check_output(options.output, options.overwrite)
        conversion = convert_model(options.model, Options(options.frame_skip, options.time_limit))
        text = task_text(conversion)
        report_changes(conversion)
        check_task(conversion, text)
        if options.comparison:
            print(comparison_text(conversion, text), file=sys.stderr)
        write(text, options.output)
    except MjcfError as error:
        for message in error.messages:
            print(f"error: {message}", file=sys.stderr)
        return NOT_CONVERTIBLE
    return 0


def parser() -> argparse.ArgumentParser:
    found = argparse.ArgumentParser(
        prog="python -m seedbed.import_mjcf",
        description="Convert a planar model of MuJoCo (MJCF) to a task file, and compare its motion with MuJoCo's.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    found.add_argument("model", metavar="MODEL.xml", help="the MJCF file")
    found.add_argument("-o", "--output", metavar="FILE", help="write the task file here instead of to standard output")
    found.add_argument("--overwrite", action="store_true", help="replace the file of --output if there is one")
    found.add_argument(
        "--frame-skip", type=positive, default=1, metavar="N", help="MuJoCo's time steps per control step (default: 1)"
    )
    found.add_argument(
        "--time-limit", type=positive, default=1000, metavar="N", help="actions in an episode (default: 1000)"
    )
    found.add_argument(
        "--no-comparison", dest="comparison", action="store_false", help="do not compare the motion with MuJoCo's"
    )
    return found


def positive(text: str) -> int:
    """A whole number of at least 1."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text}")
    return int(text)


def check_output(output: str | None, may_replace: bool) -> None:
    """Nothing that people wrote is lost, and nothing is computed that cannot be written. Makes the folder.

    Raises:
        MjcfError: There is a file of this name, or no such file can be written.
    """
    if output is None:
        return
    path = Path(output)
    if path.is_dir():
        raise MjcfError([f"{output}: expected the name of a file, found a folder"])
    if path.exists() and not may_replace:
        raise MjcfError([f"{output}: there is such a file: expected another name, or --overwrite to replace it"])
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MjcfError([f"{output}: its folder cannot be made: {error.strerror}"]) from None
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise MjcfError([f"{output}: it cannot be written: permission denied"])


def report_changes(conversion: Conversion) -> None:
    report = conversion.source.report
    for warning in report.warnings:
        print(f"warning: {report.file}: {warning}", file=sys.stderr)
    for text in dropped(conversion):
        print(f"left out: {report.file}: {text}", file=sys.stderr)


def write(text: str, output: str | None) -> None:
    """Write the file, or standard output.

    Raises:
        MjcfError: The file cannot be written.
    """
    if output is None:
        sys.stdout.write(text)
        return
    try:
        Path(output).write_text(text, encoding="utf-8")
    except OSError as error:
        raise MjcfError([f"{output}: it cannot be written: {error.strerror}"]) from None


if __name__ == "__main__":
    sys.exit(main())
