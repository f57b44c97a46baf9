"""Reading runs: tables, results and policies.

>>> import seedbed
>>> run = seedbed.load("recordings/cartpole")  # doctest: +SKIP
>>> run.episodes  # doctest: +SKIP
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from . import exports, pages, programs
from .checksums import verify
from .errors import RunError
from .exports import Content
from .frames import Frames, check_columns, choose, from_rows, read_parquet
from .notebooks import Figure, Film, Page

if TYPE_CHECKING:
    from ._native import Task
    from .policies import Policy

SUMMARY = "summary.json"
SCENARIO = "scenario.ron"
POLICIES = "policies.safetensors"

COLUMNS: dict[str, type] = {
    "path": str,
    "state": str,
    "error": str,
    "scenario": str,
    "environment": str,
    "seed": int,
    "agents": int,
    "episodes_per_agent": int,
    "env_steps": int,
    "final_return": float,
    "solved_at_return": float,
    "solved_at_window": int,
    "episodes_until_solved": int,
    "team_coverage": float,
    "effective_agents": float,
    "regret_per_agent": float,
    "seconds": float,
    "written": datetime,
}
"""Columns of `runs`, and their types."""


Part: TypeAlias = Literal["visitation", "density", "difference", "returns", "curves", "scatter", "all"]
"""Parts of a figure."""

Color: TypeAlias = Literal["agent", "episode", "return", "outcome", "intrinsic-reward"]
"""Quantities by which states are colored."""


def load(path: str | os.PathLike[str], *, frames: Frames | None = None) -> Run:
    """Open a run, finished or in progress.

    Nothing is read before it is asked for.

    Args:
        path: Folder of a run, the recording in it, a folder with a single run, or a recording alone.
        frames: Library of the tables: "polars", "pandas" or "arrow"; by default polars if it is installed, otherwise
            pandas.

    Raises:
        FileNotFoundError: There is no such file or folder.
        RunError: The folder contains no run, or several.

    Example:
        >>> run = load("recordings/cartpole")  # doctest: +SKIP
        >>> run.summary["final_return"]  # doctest: +SKIP
        187.95
    """
    given = Path(path)
    if not given.exists():
        raise FileNotFoundError(f"there is no file or folder {given}")
    if not given.is_dir():
        if given.suffix not in (".rrd", ".part", ".states"):
            raise RunError(given, "no recording; expected the folder of a run, or a file that ends in .rrd")
        is_in_run = given.name in exports.RECORDINGS and (given.parent / SCENARIO).is_file()
        return Run(given.parent if is_in_run else given, frames=frames)
    return Run(_run_folder(given), frames=frames)


def runs(folder: str | os.PathLike[str] = "recordings", *, frames: Frames | None = None) -> Any:
    """Runs in a folder, at any depth, with their main results, as a frame with one row per run.

    Args:
        folder: Folder with runs.
        frames: Library of the frame; see `load`.

    Returns:
        A frame with the columns of `seedbed runs --json`: `path`, `state` (finished, unfinished or unreadable),
        `error`, `scenario`, `environment`, `seed`, `agents`, `episodes_per_agent`, `env_steps`, `final_return`,
        `solved_at_return` and `solved_at_window` (when the task counts as solved), `episodes_until_solved`,
        `team_coverage`, `effective_agents`, `regret_per_agent`, `seconds` and `written` (the time, in UTC).

    Raises:
        FileNotFoundError: There is no such folder.

    Example:
        >>> runs("recordings")  # doctest: +SKIP
    """
    given = Path(folder)
    if not given.is_dir():
        raise FileNotFoundError(f"there is no folder {given}")
    chosen = choose(frames)
    return _frame(_listed(given), chosen)


def _quantity(name: str) -> str:
    """A quantity as on axes, of which a column may have the name."""
    return "intrinsic reward" if name == "intrinsic_reward" else name


def _length(option: str, length: object) -> str:
    """The value of an option that is a length."""
    if not isinstance(length, str):
        name, unit = option.removeprefix("--"), "pt" if option == "--font" else "cm"
        raise TypeError(f'{name} is {length!r}, expected a text with a unit, such as {name}="{length}{unit}"')
    return length


def _range(ends: tuple[float | None, float | None] | float) -> str:
    """A range as on the command line; a number is a range that has nothing else."""
    if isinstance(ends, int | float):
        return f"{ends}..{ends}"
    return "..".join("" if end is None else str(end) for end in ends)


class Run:
    """A run; see `load`.

    Attributes:
        path: Absolute path of the folder of the run, or of the recording if there is no folder.
        frames: Library of the tables; None for the default.
    """

    def __init__(self, path: Path, *, frames: Frames | None = None) -> None:
        # Also after a change of the working directory.
        self.path = path.absolute()
        self.frames = None if frames is None else choose(frames)
        self._tables: dict[Content, tuple[Path, Any]] = {}

    @property
    def name(self) -> str:
        """Name of the scenario and the run seed."""
        if not self._is_folder:
            return self.path.name
        row = self.info
        name = row["scenario"] or row["environment"] or self.path.resolve().name
        return name if row["seed"] is None else f"{name}, run seed {row['seed']}"

    @property
    def state(self) -> str:
        """The state of the run: "finished", or "unfinished" if it is in progress or was interrupted."""
        return str(self.info["state"])

    @property
    def agents(self) -> int:
        """Number of agents K. Copies of an environment in which one learner acts count as agents."""
        return int(self.info.get("copies") or self.info["agents"])

    @property
    def info(self) -> dict[str, Any]:
        """The row of the run in `seedbed.runs`, as it is now.

        Raises:
            RunError: The run cannot be read.
        """
        folder = self._folder("results")
        # An error of the summary names it.
        self._summary()
        rows = [row for row in _listed(folder) if Path(row["path"]).resolve() == folder.resolve()]
        if not rows:
            raise RunError(folder, "it contains no run")
        if rows[0]["error"] is not None:
            raise RunError(None, str(rows[0]["error"]))
        return rows[0]

    @property
    def summary(self) -> dict[str, Any]:
        """Contents of `summary.json`, which is written when a run is finished.

        Raises:
            RunError: The run is not finished, or the file is damaged.
        """
        found = self._summary()
        if found is None:
            reason = "there is no such file: the run is in progress or was interrupted, see `run.info`"
            raise RunError(self._folder("summary") / SUMMARY, reason)
        return found

    @property
    def scenario(self) -> str:
        """Text of the scenario, with all defaults written out.

        Raises:
            RunError: The file is missing, damaged or no text.
        """
        path = self._folder("scenario") / SCENARIO
        verify(path)
        return _text(path)

    @property
    def task(self) -> Task:
        """The task of the run: that of the copy in its folder, which `seedbed.make` accepts.

        Raises:
            RunError: The run has no copy of a task file, as those of tabular scenarios, or the copy is damaged.
            TaskError: Something in the file is wrong.
        """
        row = self.info
        path = self.path / "envs" / f"{row['environment']}.ron"
        if not path.is_file():
            raise RunError(path, "there is no such file: the run has no copy of its task")
        verify(path, self.path)
        from ._native import Task

        return Task(path, run_seed=row["seed"] or 0)

    @property
    def episodes(self) -> Any:
        """Frame with one row per finished episode: the columns of `episodes.csv`."""
        return self.table("episodes")

    @property
    def rounds(self) -> Any:
        """Frame with one row per update of an agent: the columns of `rounds.csv`."""
        return self.table("rounds")

    @property
    def states(self) -> Any:
        """Frame with one row per visited state.

        Its columns are `agent`, `episode`, `round`, `step`, all observations, the action as the policy chose it,
        `reward` and `outcome`. The last state of an episode has no action and no reward.
        """
        return self.table("states")

    def table(self, content: Content, columns: Sequence[str] | None = None, *, frames: Frames | None = None) -> Any:
        """A table, or only some of its columns. Whole tables stay in memory until their files change.

        Args:
            content: "states", "episodes" or "rounds".
            columns: Names of columns.
            frames: Library of the frame; by default that of the run.

        Raises:
            RunError: The file is missing, damaged, or shorter than the summary of the finished run says.
            ValueError: There is no such column.
            ImportError: The library is not installed.
        """
        chosen = choose(frames or self.frames)
        path = self.parquet(content)
        if columns is not None:
            check_columns(path, chosen, columns)
        if columns is not None or chosen != choose(self.frames):
            return read_parquet(path, chosen, columns)
        known = self._tables.get(content)
        if known is None or known[0] != path:
            known = self._tables[content] = (path, read_parquet(path, chosen))
        return known[1]

    def parquet(self, content: Content = "states") -> Path:
        """A Parquet file with a table, for tools that read a part of it, such as `polars.scan_parquet` and DuckDB.

        The file is in a cache folder (`SEEDBED_CACHE`). Call `parquet` again after the run has changed.

        Raises:
            RunError: As for `table`.
        """
        if content not in exports.CONTENTS:
            raise ValueError(f"content is {content!r}, expected one of {', '.join(exports.CONTENTS)}")
        self._check_exists()
        return exports.parquet_file(self.path, content, self._summary() if self._is_folder else None)

    def policy(self, agent: int = 0, *, model: int | None = None) -> Policy:
        """The trained policy of an agent; of a run that has not ended, that of its newest checkpoint.

        Args:
            agent: Number of the agent, from 0.
            model: Number of a model of the team, for algorithms whose agents act by shared models. By default that of
                the agent. If agents draw a model for each round, each model is a policy of its own; the default is
                `agent` modulo their number.

        Raises:
            RunError: There is no checkpoint yet, a file is damaged, or the algorithm has no networks.
            IndexError: There is no such agent or model.

        Example:
            >>> policy = run.policy(2)  # doctest: +SKIP
            >>> action = policy([0.0, 0.1, 0.02, -0.1])  # doctest: +SKIP
        """
        from .policies import Policy

        path = self._folder("policies") / POLICIES
        if not (self.path / "scenario.ron").exists():
            raise RunError(self.path, "another program made this run: its policies are not in the recording")
        if path.exists() or self.state == "finished":
            return Policy(path, agent, model)
        with tempfile.TemporaryDirectory(prefix="seedbed-") as folder:
            programs.call("export", self.path, "--to", Path(folder) / POLICIES)
            return Policy(Path(folder) / POLICIES, agent, model)

    def explore(self, path: str | os.PathLike[str] | None = None, *, states: int | None = None) -> Page:
        """Write a page in which visited states are selected by brushes (`seedbed explore`). Notebooks show it.

        Args:
            path: The page; by default `explore.html` in the folder of the run.
            states: Maximum number of states; more are thinned evenly. By default 200,000.

        Returns:
            Path of the page.
        """
        out = Path(path) if path is not None else self._folder("place for a page") / "explore.html"
        limit = [] if states is None else ["--states", str(states)]
        programs.call("explore", self.path, "--out", out, *limit)
        return Page(out)

    def plot(
        self,
        what: Part | Sequence[Part] | None = None,
        *,
        beside: Sequence[Run] = (),
        path: str | os.PathLike[str] | None = None,
        agents: Sequence[int] | int | None = None,
        episodes: tuple[int | None, int | None] | None = None,
        where: Mapping[str, tuple[float | None, float | None] | float] | None = None,
        axes: Sequence[str] | None = None,
        color: Color | None = None,
        lines: int | None = None,
        over: Literal["episodes", "env-steps"] = "episodes",
        theme: Literal["paper", "talk", "dark"] = "paper",
        log: Literal["x", "y", "x,y"] | None = None,
        x_range: tuple[float, float] | None = None,
        y_range: tuple[float, float] | None = None,
        size: tuple[int, int] | None = None,
        width: str | None = None,
        height: str | None = None,
        font: str | None = None,
        title: bool = True,
        legend: bool = True,
    ) -> Figure:
        """Draw visited states and returns (`seedbed plot`). Notebooks show the figure.

        Args:
            what: Parts, one below the other; by default a scatter plot of two axes, visitation, difference,
                density and returns.
            beside: Runs that are drawn beside this one.
            path: The figure, an SVG, PDF or PNG; by default `plot.svg` in the folder of the run.
            agents: Numbers of the agents that are drawn, or one.
            episodes: First episode of each agent that is drawn, and the one after the last; None for no limit.
            where: Ranges of quantities, such as `{"theta": (-0.1, 0.2), "return": (150, None)}`, or single values: only
                states in all of them are drawn.
            axes: Names of the axes, in their order.
            color: Quantity by which states are colored.
            lines: Maximum number of states that a panel draws one by one; by default 1000.
            over: What returns and curves are drawn over.
            theme: Colors and size of letters.
            log: Logarithmic axes of returns and curves; values of 0 and below are left out.
            x_range: Ends of the horizontal axis of returns and curves.
            y_range: Ends of their vertical axis.
            size: Width and height in CSS pixels.
            width: Width in print with its unit, such as "8.4cm"; instead of `size`.
            height: Height in print with its unit; by default it fits the content.
            font: Size of the letters of axis labels in print, such as "8pt".
            title: Whether the page has its title.
            legend: Whether there are legends and color keys.

        Returns:
            Path of the figure.

        Raises:
            InputError: An argument is invalid.
            RunError: There is no recording, or it is damaged.

        Example:
            >>> run.plot(["visitation", "returns"], where={"return": (150, None)})  # doctest: +SKIP
        """
        out = Path(path) if path is not None else self._folder("place for a figure") / "plot.svg"
        given: dict[str, list[str]] = {
            "--what": [] if what is None else [what] if isinstance(what, str) else list(what),
            "--agents": [] if agents is None else [str(agent) for agent in ([agents] if isinstance(agents, int) else agents)],
            "--axes": [] if axes is None else list(axes),
        }
        options = [part for option, values in given.items() if values for part in (option, ",".join(values))]
        options += [] if episodes is None else ["--episodes", _range(episodes)]
        options += [part for name, ends in (where or {}).items() for part in ("--where", f"{_quantity(name)}={_range(ends)}")]
        options += [] if color is None else ["--color", color]
        options += [] if lines is None else ["--lines", str(lines)]
        options += [] if size is None else ["--size", f"{size[0]}x{size[1]}"]
        options += ["--over", over, "--theme", theme] + ([] if log is None else ["--log", log])
        for option, ends in (("--x-range", x_range), ("--y-range", y_range)):
            options += [] if ends is None else [f"{option}={ends[0]}..{ends[1]}"]
        for option, length in (("--width", width), ("--height", height), ("--font", font)):
            options += [] if length is None else [option, _length(option, length)]
        options += [] if title else ["--no-title"]
        options += [] if legend else ["--no-legend"]
        programs.call("plot", self.path, *(run.path for run in beside), "--out", out, *options)
        return Figure(out)

    def film(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        agent: int = 0,
        policy: int | None = None,
        actions: Literal["sampled", "greedy"] | None = None,
        seconds: float | None = None,
        fps: int = 12,
        width: int = 760,
        scenes: int | None = None,
    ) -> Film:
        """Film the training, or a trained policy (`seedbed film`). Notebooks show the film.

        Args:
            path: The film: a GIF, an animated PNG, or an MP4 (needs ffmpeg); by default `film.gif`, or `policy.gif` of a policy,
                in the folder of the run.
            agent: Agent whose bodies are shown during the training.
            policy: Agent whose trained policy plays new episodes; None films the training.
            actions: How a policy chooses actions; by default as in training.
            seconds: Duration; by default 12, or whole episodes of a policy.
            fps: Frames per second.
            width: Width in pixels.
            scenes: Maximum number of episodes whose bodies are shown; by default 6, or 3 of a policy.

        Returns:
            Path of the film.

        Raises:
            InputError: An argument is invalid.
            RunError: There is no recording, or it is damaged.

        Example:
            >>> run.film(policy=2, actions="greedy")  # doctest: +SKIP
        """
        name = "film.gif" if policy is None else "policy.gif"
        out = Path(path) if path is not None else self._folder("place for a film") / name
        given = {"--policy": policy, "--actions": actions, "--seconds": seconds, "--scenes": scenes}
        options = [part for option, value in given.items() if value is not None for part in (option, str(value))]
        options += [] if policy is not None else ["--agent", str(agent)]
        programs.call("film", self.path, "--out", out, "--fps", str(fps), "--width", str(width), *options)
        return Film(out)

    def to_html(self, path: str | os.PathLike[str]) -> Path:
        """Write the recording and the viewer into one page, which needs nothing but a browser.

        It has about 22 MB more than the recording. Needs `pip install rerun-notebook==0.36.3`.

        Args:
            path: The page.

        Returns:
            Path of the page.

        Raises:
            RunError: There is no recording, or it is damaged.
            ImportError: The viewer is not installed.
        """
        recording = self._recording()
        verify(recording)
        return pages.write_viewer(recording, Path(path), self.name)

    def __repr__(self) -> str:
        return f"<seedbed run {self.name!r} in {self.path}>"

    def _repr_html_(self) -> str:
        return pages.overview(self)

    @property
    def _is_folder(self) -> bool:
        return self.path.is_dir()

    def _check_exists(self) -> None:
        if not self.path.exists():
            raise RunError(self.path, "there is no such file or folder: the run was moved or removed")

    def _folder(self, what: str) -> Path:
        self._check_exists()
        if not self._is_folder:
            raise RunError(self.path, f"a recording without the folder of its run has no {what}")
        return self.path

    def _recording(self) -> Path:
        self._check_exists()
        if not self._is_folder:
            return self.path
        for name in exports.RECORDINGS:
            if (self.path / name).is_file():
                return self.path / name
        raise RunError(self.path / exports.RECORDINGS[0], "there is no such file: the run was not recorded")

    def _summary(self) -> dict[str, Any] | None:
        path = self._folder("summary") / SUMMARY
        if not path.is_file():
            return None
        verify(path)
        try:
            found = json.loads(_text(path))
        except json.JSONDecodeError as error:
            raise RunError(path, f"it is no valid JSON: {error}") from error
        if not isinstance(found, dict):
            raise RunError(path, "expected a JSON object")
        return found


def _run_folder(folder: Path) -> Path:
    """The folder itself, if it is a run, or that of the single run in it."""
    if any((folder / name).is_file() for name in (SUMMARY, SCENARIO)):
        return folder
    if any((folder / exports.STATES_FOLDER).glob("*.states")):
        return folder
    found = [row["path"] for row in _listed(folder)]
    if not found:
        raise RunError(folder, "it contains no run")
    if len(found) > 1:
        raise RunError(folder, f"it contains {len(found)} runs: load one of them, such as {found[0]}")
    return Path(found[0])


def _listed(folder: Path) -> list[dict[str, Any]]:
    """Runs in a folder, as `seedbed runs` lists them."""
    rows: list[dict[str, Any]] = json.loads(programs.call("runs", folder, "--json"))
    return rows


def _frame(rows: list[dict[str, Any]], chosen: Frames) -> Any:
    for row in rows:
        solved = row.pop("solved_at") or {}
        row["solved_at_return"], row["solved_at_window"] = solved.get("return"), solved.get("window")
        if row["written"] is not None:
            row["written"] = datetime.fromisoformat(row["written"].replace("Z", "+00:00"))
    return from_rows(rows, COLUMNS, chosen)


def _text(path: Path) -> str:
    if path.exists() and not path.is_file():
        raise RunError(path, "expected a regular file, found a folder, a pipe, a socket or a device")
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise RunError(path, "there is no such file") from error
    except UnicodeDecodeError as error:
        raise RunError(path, f"it is no text: {error}") from error
