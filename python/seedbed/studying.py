"""Studies, tuning and checks of files, by the program `seedbed`.

>>> import seedbed
>>> study = seedbed.study("team_size.ron")  # doctest: +SKIP
>>> study.results  # doctest: +SKIP
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from . import programs
from .errors import RunError
from .frames import Frames, choose, read_csv
from .gymnasium_task import Gymnasium, known_id, naming_environment
from .notebooks import Figure, Page, Text, is_notebook, updated_output
from .ron import Expression, quoted, struct
from .training import Environment, python_path_of, task_name, task_text

File: TypeAlias = "str | os.PathLike[str]"

TEXTS = ("values", "labels")
"""Fields whose numbers are written as texts."""

EXPRESSIONS = ("measures", "measure", "direction", "goal", "figures", "results", "expected", "draw", "of")
"""Fields of studies and tuning files whose texts are words of the format, such as `Less` and `Curves()`: they get no quotes."""

PATTERN = re.compile(r'"([^"]*)"')
"""Files of results in a text such as `Runs("recordings/ppo/seed-*")`: the first text in quotes."""

PROGRESS_LINE = re.compile(r"\d+/\d+ runs")


def check(what: Environment | Mapping[str, Any], *others: File) -> Text:
    """Check a scenario, a task, a study or a tuning file without running it.

    Args:
        what: A file or a name; a `Gymnasium` or a function that returns an environment, which is made, and tried with random
            actions; or a study as a map.
        others: More files or names.

    Returns:
        What `seedbed check` prints: observations and actions, and warnings.

    Raises:
        InputError: Something is wrong; the message says where.

    Example:
        >>> check("cartpole")
        ok: cartpole: scenario with 4 agents in `cartpole`; observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)
    """
    with tempfile.TemporaryDirectory(prefix="seedbed-") as name:
        folder = Path(name)
        path = Path(_written(what, folder))
        is_task = path.parent == folder and not isinstance(what, Mapping)
        printed: list[str] = []
        errors: list[str] = []
        try:
            programs.follow(
                ["check", path, *others], on_line=printed.append, on_message=errors.append, python_path=_python_path(what)
            )
        except RunError as error:
            message = error.message
            if is_task:
                message = re.sub(rf"{re.escape(str(path))}(:\d+:\d+)?", f"environment {path.stem}", message)
                message = naming_environment(message, path.stem)
            raise type(error)(None, message.replace(f"{folder}{os.sep}", "")) from None
        text = "\n".join([*printed, *errors])
        text = text.replace(str(path), path.stem) if is_task else text
        return Text(text.replace(f"{folder}{os.sep}", ""))


def study(
    what: File | Mapping[str, Any],
    *,
    name: str = "study",
    confirm: bool = False,
    quick: bool = False,
    out: File | None = None,
    jobs: int | None = None,
    retry: bool = False,
    ignore_memory: bool = False,
    tensorboard: File | None = None,
    frames: Frames | None = None,
) -> Study:
    """Run what is missing of a study, and write its report.

    The same call resumes an interrupted study.

    Args:
        what: A study file, or its fields as a map, such as `{"scenario": "cartpole", "repeats": 5, "grid": […], …}`. Texts of
            the fields `measures`, `direction`, `figures` and other words of the format are written without quotes, and
            paths begin in the working directory.
        name: Name of a study that is a map.
        confirm: Run what `register` has registered, with the run seeds that derive from it.
        quick: Use the study's `quick` settings, in a separate folder.
        out: Folder of the results; by default `recordings/studies/NAME`.
        jobs: Number of simultaneous runs; by default the number of cores.
        retry: Repeat runs that failed before.
        ignore_memory: Start even if the runs seem to need more memory than there is.
        tensorboard: Folder for event files of TensorBoard, which runs write while they train to `CELL/seed-N`.
        frames: Library of the tables; see `load`.

    Raises:
        InputError: Something in the study is wrong.
        RunError: Runs failed; the report has the others.
        KeyboardInterrupt: The study was interrupted.

    Example:
        >>> found = study("scenarios/thesis/fig_6_4a.ron", quick=True)  # doctest: +SKIP
        >>> found.results, found.claims, found.report  # doctest: +SKIP
    """
    flags = {"--quick": quick, "--retry": retry, "--ignore-memory": ignore_memory}
    options: list[programs.Argument] = [flag for flag, is_given in flags.items() if is_given]
    options += [] if out is None else ["--out", out]
    options += [] if jobs is None else ["--jobs", str(jobs)]
    options += [] if tensorboard is None else ["--tensorboard", tensorboard]
    command = ["study", "confirm"] if confirm else ["study"]
    with tempfile.TemporaryDirectory(prefix="seedbed-") as folder:
        printed = _run([*command, _written(what, Path(folder), name), *options], Path(folder))
    report = re.search(r"^report +(.*)$", printed, re.MULTILINE)
    assert report is not None, printed
    return Study(Path(report[1]).parent, frames=frames)


def register(what: File, *, out: File | None = None) -> Text:
    """Register a study before its runs: its claims, cells and numbers of runs are fixed in `NAME.ron.lock`, beside its file.

    Args:
        what: The study file.
        out: Folder of runs that were made before; by default `recordings/studies/NAME`.

    Returns:
        What `seedbed study register` prints: how many runs each claim needs.

    Raises:
        InputError: Something in the study is wrong, or it is registered already.

    Example:
        >>> register("team_size.ron")  # doctest: +SKIP
        >>> study("team_size.ron", confirm=True)  # doctest: +SKIP
    """
    if not isinstance(what, str | os.PathLike):
        raise TypeError(f"the study is a {type(what).__name__}, expected a file: the registration is written beside it")
    lines: list[str] = []
    options: list[programs.Argument] = [] if out is None else ["--out", out]
    programs.follow(["study", "register", what, *options], on_line=lines.append, on_message=lines.append)
    return Text("\n".join(lines))


def tune(
    what: File | Mapping[str, Any],
    budget: int,
    *,
    name: str = "tuning",
    seed: int = 0,
    out: File | None = None,
    jobs: int | None = None,
    retry: bool = False,
    ignore_memory: bool = False,
    tensorboard: File | None = None,
    frames: Frames | None = None,
) -> Tuning:
    """Search for the parameters of methods, each with the same number of runs.

    The same call resumes an interrupted search; one with a larger budget uses the runs again.

    Args:
        what: A tuning file, or its fields as a map, as for `study`.
        budget: Number of runs of each method.
        name: Name of a search that is a map.
        seed: Search seed, from which configurations are drawn.
        out: Folder of the results; by default `recordings/tuning/NAME`.
        jobs, retry, ignore_memory, tensorboard, frames: As for `study`.

    Raises:
        InputError, RunError, KeyboardInterrupt: As for `study`.
    """
    flags = {"--retry": retry, "--ignore-memory": ignore_memory}
    options: list[programs.Argument] = ["--budget", str(budget), "--seed", str(seed)]
    options += [flag for flag, is_given in flags.items() if is_given]
    options += [] if out is None else ["--out", out]
    options += [] if jobs is None else ["--jobs", str(jobs)]
    options += [] if tensorboard is None else ["--tensorboard", tensorboard]
    with tempfile.TemporaryDirectory(prefix="seedbed-") as folder:
        printed = _run(["tune", _written(what, Path(folder), name), *options], Path(folder))
    runs = re.search(r"^runs +(.*)$", printed, re.MULTILINE)
    assert runs is not None, printed
    return Tuning(Path(runs[1]).parent, frames=frames)


class _Results:
    """A folder with results of many runs."""

    TABLE = ""
    KIND = ""

    def __init__(self, path: File, *, frames: Frames | None = None) -> None:
        self.path = Path(path).absolute()
        self.frames = None if frames is None else choose(frames)
        if not (self.path / self.TABLE).is_file():
            raise RunError(self.path / self.TABLE, f"there is no such file: the folder has no finished {self.KIND}")

    @property
    def results(self) -> Any:
        """Frame with one row per run."""
        return read_csv(self.path / self.TABLE, choose(self.frames))

    def __repr__(self) -> str:
        return f"<seedbed {self.KIND} {self.path.name!r} in {self.path}>"


class Study(_Results):
    """Results of a study in a folder; see `study`.

    Attributes:
        path: Absolute path of the folder.
        frames: Library of the tables; None for the default.

    Raises:
        RunError: The folder has no results.
    """

    TABLE = "results.csv"
    KIND = "study"

    @property
    def claims(self) -> Text:
        """The verdicts on the claims, as a table in Markdown."""
        return self._text("claims.md")

    @property
    def tables(self) -> Text:
        """The tables of the report, in Markdown."""
        return self._text("tables.md")

    @property
    def report(self) -> Page:
        """The report: a page, which notebooks show."""
        return Page(self.path / "report.html")

    @property
    def figures(self) -> dict[str, Figure]:
        """The figures by name."""
        return {path.stem: Figure(path) for path in sorted((self.path / "figures").glob("*.svg"))}

    def _text(self, name: str) -> Text:
        path = self.path / name
        return Text(path.read_text(encoding="utf-8").rstrip("\n")) if path.is_file() else Text("")

    def _repr_markdown_(self) -> str:
        return f"**{self.path.name}** ({self.path})\n\n{self.claims}"


class Tuning(_Results):
    """Results of a search for parameters in a folder; see `tune`.

    Attributes:
        path: Absolute path of the folder.
        frames: Library of the tables; None for the default.

    Raises:
        RunError: The folder has no results.
    """

    TABLE = "tuning.csv"
    KIND = "tuning"

    @property
    def best(self) -> Text:
        """The best configuration of each method, as cells for a study."""
        return Text((self.path / "best.ron").read_text(encoding="utf-8").rstrip("\n"))


def _written(what: Environment | Mapping[str, Any], folder: Path, name: str = "study") -> File:
    """The file that is meant, which is written if it is none."""
    what = known_id(what)
    if isinstance(what, str | os.PathLike):
        return what
    if isinstance(what, Mapping):
        text, path = _document(what), folder / f"{name}.ron"
    else:
        text, path = task_text(what, folder), folder / f"{task_name(what)}.ron"
    path.write_text(f"{text}\n", encoding="utf-8")
    return path


def _python_path(what: Environment | Mapping[str, Any]) -> list[str]:
    return [] if isinstance(what, Mapping) else python_path_of(what)


def _document(fields: Mapping[str, Any]) -> str:
    """A study or a tuning file."""
    kind = "Tuning" if "methods" in fields else "Study"
    return struct(kind, {name: _value(name, value) for name, value in fields.items()})


def _value(name: str, value: Any) -> Any:
    """A value of a field: maps are structures, and paths of scenarios begin in the working directory."""
    if isinstance(value, Gymnasium):
        return Expression(value)
    if isinstance(value, Mapping):
        return Expression(struct("", {field: _value(field, each) for field, each in value.items()}))
    if isinstance(value, str):
        if name in EXPRESSIONS:
            return Expression(PATTERN.sub(_absolute_pattern, value) if name == "results" else value)
        is_path = name == "scenario" and (value.endswith(".ron") or os.sep in value)
        return os.path.abspath(value) if is_path else value
    if isinstance(value, Sequence):
        values = [_value(name, each) for each in value]
        return tuple(values) if isinstance(value, tuple) else values
    return str(value) if name in TEXTS else value


def _absolute_pattern(found: re.Match[str]) -> str:
    """A path in quotes that begins in the working directory, as an absolute path; other texts as they are."""
    is_path = os.sep in found[1] or "*" in found[1] or os.path.exists(found[1])
    return quoted(os.path.abspath(found[1])) if is_path else found[0]


def _run(arguments: Sequence[programs.Argument], folder: Path) -> str:
    """Run the program, show what it prints, and return it."""
    printed: list[str] = []
    shown = _shown_progress()

    def show(line: str) -> None:
        printed.append(line)
        print(line)

    try:
        programs.follow(arguments, on_line=show, on_message=shown)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("interrupted; the same call resumes it") from None
    except RunError as error:
        message = error.message.replace(f"{folder}{os.sep}", "").replace(f"in {folder} ", "")
        raise type(error)(None, message) from None
    return "\n".join(printed)


def _shown_progress() -> Callable[[str], None]:
    """Shows messages; in notebooks, lines of progress replace each other."""
    update = updated_output() if is_notebook() else None

    def show(line: str) -> None:
        if update is not None and PROGRESS_LINE.match(line):
            update(line, f"<pre>{line}</pre>")
        else:
            print(line, file=sys.stderr)

    return show
