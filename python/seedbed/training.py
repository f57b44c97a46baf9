"""Training teams of agents with the program `seedbed`.

>>> import seedbed
>>> run = seedbed.train("cartpole", agents=4, seed=0)  # doctest: +SKIP
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import json
import math
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeAlias, TypeVar

import numpy as np

from . import programs
from .errors import InputError, RunError
from .frames import Frames
from .gymnasium_task import Gymnasium, known_id, naming_environment
from .progress import RunProgress, progress_here
from .reading import Run
from .ron import Expression, algorithm_text, quoted, ron_text
from .seeding import checked_seed

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

AlgorithmName: TypeAlias = Literal[
    "SeedPg",
    "LeaderFollowers",
    "QLearning",
    "SeedTd",
    "BootstrappedDqn",
    "HyperAgent",
    "SeedSac",
    "SeedPsrl",
    "CrossEntropy",
    "OpenLoopNoise",
    "Random",
]
"""Names of algorithms, as `seedbed list algorithms` shows them."""

WITHOUT_SETTINGS = {"Random"}
"""Names of algorithms that are written without parentheses."""

Environment: TypeAlias = "str | os.PathLike[str] | Gymnasium | Callable[..., Any]"
"""A task: its name, its file, an environment of Gymnasium, or a function that returns one."""

Settings: TypeAlias = Sequence[str] | Mapping[str, Any]
"""Values of a scenario that are replaced: `["algorithm.discount=0.9"]` or `{"algorithm.discount": 0.9}`."""


@dataclass(frozen=True)
class RunState:
    """A run after a round, for `on_round` of `train`.

    Attributes:
        round: Number of finished rounds; of finished episodes in tabular runs.
        episodes: Number of episodes that each agent has finished; of all agents in tabular runs.
        max_episodes: Number of episodes after which the run ends at the latest.
        env_steps: Number of environment steps of the whole team.
        mean_return: Mean return of the episodes of this round; NaN if none has ended.
        recent_return: Mean over agents of the mean return of each one's last 25 episodes.
        returns: For each agent the mean return of its episodes of this round, NaN if none has ended: `[K]`.
        finished: Rows of `episodes.csv` that this round adds: a dictionary per episode.
        updates: Rows of `rounds.csv` that this round adds: a dictionary per update of an agent. What was not measured is None.
        path: Folder of the run.
    """

    round: int
    episodes: int
    max_episodes: int
    env_steps: int
    mean_return: float
    recent_return: float
    returns: list[float]
    finished: list[dict[str, Any]] = field(repr=False)
    updates: list[dict[str, Any]] = field(repr=False)
    path: Path


NAMES_OF_OTHERS = {
    "env": "environment=, the first argument",
    "env_id": "environment=, the first argument",
    "policy": "no argument: networks are given by set={'algorithm.hidden': [64, 64]}",
    "policy_kwargs": "set={'algorithm.hidden': [64, 64]}",
    "n_agents": "agents=",
    "num_agents": "agents=",
    "n_envs": "agents= for agents that learn, or set={'schedule': 'Synchronous(episodes: N)'} for more episodes of one",
    "num_envs": "agents= for agents that learn, or set={'schedule': 'Synchronous(episodes: N)'} for more episodes of one",
    "total_timesteps": "set={'stop': 'Steps(team: N, at_most: EPISODES)'}",
    "steps": "set={'stop': 'Steps(team: N, at_most: EPISODES)'}",
    "episodes": "set={'stop': 'Episodes(N)'}",
    "callback": "on_round=",
    "callbacks": "on_round=",
    "tensorboard_log": "tensorboard=",
    "log_dir": "tensorboard= for TensorBoard, or out= for the folder of the run",
    "verbose": "progress=",
    "progress_bar": "progress=",
    "bonus": "set={'algorithm.bonus': 'Rnd()'}",
    "path": "out=",
    "folder": "out=",
    "run_seed": "seed=",
    "max_episode_steps": "seedbed.Gymnasium(environment, time_limit=N)",
}
"""What arguments that other libraries have are here."""

OnRound: TypeAlias = Callable[[RunState], "bool | None"]
"""Called after each round; False ends the run."""


def _explaining_unknown_names(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """The function, whose error about an unknown argument says where such a setting belongs."""
    known = inspect.signature(function).parameters

    @functools.wraps(function)
    def explaining(*arguments: Parameters.args, **named: Parameters.kwargs) -> Result:
        for name, value in named.items():
            if name not in known:
                raise TypeError(f"{function.__name__}() has no argument {name!r}; {_place_of(name, value)}")
        return function(*arguments, **named)

    return explaining


def _place_of(name: str, value: Any) -> str:
    """Where people find what they meant by an argument of this name."""
    if name in NAMES_OF_OTHERS:
        return f"expected {NAMES_OF_OTHERS[name]}"
    if name in Gymnasium.__dataclass_fields__:
        return f"settings are given by seedbed.Gymnasium(environment, {name}={value!r})"
    # The program knows what names of other libraries mean.
    return f"settings are given by set={{{name!r}: {value!r}}}"


@_explaining_unknown_names
def train(
    environment: Environment | None = None,
    *,
    scenario: str | os.PathLike[str] | None = None,
    algorithm: AlgorithmName | str | Mapping[str, Any] | None = None,
    agents: int | None = None,
    seed: int | None = None,
    set: Settings = (),  # noqa: A002
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    on_round: OnRound | None = None,
    threads: int | None = None,
    recording: bool = True,
    save_initial: bool = False,
    tensorboard: str | os.PathLike[str] | None = None,
    other_versions: bool = False,
    progress: bool = True,
    frames: Frames | None = None,
) -> Run:
    """Train a team of agents, and return its run. The bits are those of `seedbed run` with the same settings.

    Control-C interrupts the run after its round, or before it if the round takes long; the same call with `resume=True`
    continues with the same bits.

    Args:
        environment: Name of a task, path of a task file, id of an environment of Gymnasium, such as `"CartPole-v1"` or
            `"file.py:function"`, a `Gymnasium`, or a function that returns an environment of
            Gymnasium, such as its class. The function may be one of a notebook: worker processes get it pickled by value.
        scenario: A scenario, by name or path: its environment, algorithm and other settings are the defaults of this call. With
            `"ppo"`, `"sac"` or `"dqn"`, an environment is learned with the settings that are usual for these.
        algorithm: Name of an algorithm, or its settings: `"SeedPg"`, `"SeedPg(discount: 0.9)"` or `{"SeedPg": {"discount": 0.9}}`.
            By default that of the scenario, or `SeedPg` with the settings of `seedbed new scenario`. It replaces all settings of the scenario's algorithm; `set` replaces
            some: `{"algorithm.bonus": "Rnd()"}`.
        agents: Number of agents K; by default that of the scenario, or 4. Without a scenario, agents differ by their initial networks
            only; with `set={"agents.seeds": "Normal(sigma: 0.1)"}`, each also adds small fixed numbers to rewards.
        seed: Run seed, from which all random numbers are derived; by default 0.
        set: Values that are replaced, as by `--set`: `["stop=Episodes(300)"]`, or a map such as
            `{"agents.count": 16, "stop": "Episodes(300)"}`, whose texts are written as they are.
        out: Folder of the run; by default `recordings/NAME/seed-N`.
        resume: Continue the interrupted run in `out`.
        overwrite: Replace the run in `out`.
        on_round: Called with a `RunState` after each round. If it returns False, the run ends there, and is finished as by
            `stop=Episodes(n)` with the number of episodes that were played. If it raises, the run is interrupted; so it is if it
            returns another thing that Python takes for False, such as 0.
        threads: Number of threads; results do not depend on it. By default the number of cores.
        recording: Whether visited states are recorded.
        save_initial: Whether `policies.safetensors` also has agent seeds and initial parameters.
        tensorboard: Folder for event files of TensorBoard, which are written during training.
        other_versions: With `resume=True`, continue an environment of Gymnasium with other versions of Python packages.
        progress: Whether progress is shown, in the terminal or in the notebook.
        frames: Library of the tables of the run; see `load`.

    Returns:
        The finished run.

    Raises:
        InputError: An argument, a setting or a file is wrong; also if `out` has a run already.
        RunError: The run failed, such as by an error of the environment. All finished rounds are kept.
        TypeError: The environment has another type, or its function cannot be pickled.
        KeyboardInterrupt: The run was interrupted.

    Example:
        >>> run = train("cartpole", agents=4, set=["stop=Episodes(50)"])  # doctest: +SKIP
        >>> run.summary["final_return"]  # doctest: +SKIP
    """
    settings = setting_arguments(algorithm, agents, set)
    options = _options(threads, recording, save_initial, tensorboard)
    out_folder = out
    with tempfile.TemporaryDirectory(prefix="seedbed-") as folder:
        if environment is not None:
            name = task_name(environment)
            out_folder = out or Path("recordings") / name / f"seed-{seed or 0}"
            given = _scenario_of(environment, name, scenario, Path(folder), Path(out_folder) if resume else None)
        elif scenario is not None:
            given = _Scenario(os.fspath(scenario))
        else:
            raise TypeError("expected an environment or a scenario")
        arguments: list[programs.Argument] = ["run", given.path, *given.settings, *settings, *options]
        arguments += [] if seed is None else ["--seed", str(checked_seed(seed))]
        arguments += [] if out_folder is None else ["--out", out_folder]
        flags = {"--resume": resume, "--overwrite": overwrite, "--other-versions": other_versions}
        arguments += [flag for flag, is_given in flags.items() if is_given]
        following = _Following(on_round, progress_here() if progress else None)
        following.run(arguments, given)
    if following.is_stopped:
        following.finish(options, given.python_path)
    return Run(following.path, frames=frames)


@dataclass(frozen=True)
class _Scenario:
    """What the program is given."""

    path: str
    """Name or path of the scenario."""
    settings: Sequence[str] = ()
    """Arguments that precede those of the caller."""
    written: Path | None = None
    """A file that was written for this call, which errors do not name."""
    python_path: Sequence[str] = ()
    """Folders in which worker processes find modules."""


def task_name(environment: Environment) -> str:
    """Name of a task.

    Raises:
        TypeError: It is something else.
    """
    environment = known_id(environment)
    if isinstance(environment, Gymnasium):
        return environment.name
    if isinstance(environment, str | os.PathLike):
        return Path(environment).name.removesuffix(".ron")
    if callable(environment):
        return Gymnasium(environment).name
    if hasattr(environment, "reset"):
        raise TypeError(f"the environment is {environment!r}, expected a function that returns one, such as lambda: gymnasium.make(…)")
    raise TypeError(f"the environment is {environment!r}, expected a name, a file, a seedbed.Gymnasium or a function")


def task_text(environment: Environment, folder: Path, resumed: Path | None = None) -> str:
    """A task as in a scenario.

    Args:
        environment: The task.
        folder: Folder to which the file of a function is written.
        resumed: Folder of the run that is resumed.
    """
    environment = known_id(environment)
    if isinstance(environment, str | os.PathLike):
        given = os.fspath(environment)
        # Relative to the working directory, not to the scenario.
        return quoted(os.path.abspath(given) if given.endswith(".ron") else given)
    task = environment if isinstance(environment, Gymnasium) else Gymnasium(environment)
    return task.text(folder, None if resumed is None else resumed / "envs" / f"{task.name}.py")


START = """agents: (count: 4, seeds: Normal(sigma: 0)), algorithm: SeedPg(
    value_target: VTrace(lambda: 0.98), advantage: Retrace(lambda: 0.98), time_limit: Bootstraps,
    standardize: PerMinibatch, observations: Running, epochs: 4, minibatch: Steps(64),
)"""
"""The settings of `seedbed new scenario`, which learn more than the defaults of scenarios, which are those of the thesis."""


def _scenario_of(
    environment: Environment, name: str, scenario: str | os.PathLike[str] | None, folder: Path, resumed: Path | None
) -> _Scenario:
    """A scenario as `seedbed new scenario` writes it, without `stop`, or one in another environment."""
    path, text = folder / f"{name}.ron", task_text(environment, folder, resumed)
    python_path = python_path_of(environment)
    if scenario is None:
        path.write_text(f"Scenario(environment: {text}, {START})\n", encoding="utf-8")
        return _Scenario(str(path), written=path, python_path=python_path)
    return _Scenario(os.fspath(scenario), ("--set", f"environment={text}"), path, python_path)


def python_path_of(environment: Environment) -> list[str]:
    """Folders in which worker processes find the modules that a function uses: those of this process."""
    function = environment.id if isinstance(environment, Gymnasium) else environment
    return [os.path.abspath(folder) for folder in sys.path] if callable(function) else []


def setting_arguments(algorithm: str | Mapping[str, Any] | None, agents: int | None, replaced: Settings) -> list[str]:
    """The arguments `--set PATH=VALUE` of the program."""
    text = None if algorithm is None else algorithm_text(algorithm)
    has_default_settings = text is not None and text.isidentifier() and text not in WITHOUT_SETTINGS
    settings = [] if text is None else [f"algorithm={text}{'()' if has_default_settings else ''}"]
    settings += [] if agents is None else [f"agents.count={agents}"]
    if isinstance(replaced, str):
        raise TypeError(f"set is {replaced!r}, expected a list such as [{replaced!r}]")
    if isinstance(replaced, Mapping):
        values = {path: Expression(value) if isinstance(value, str) else value for path, value in replaced.items()}
        settings += [f"{path}={ron_text(value, path)}" for path, value in values.items()]
    else:
        settings += replaced
    return [part for setting in settings for part in ("--set", setting)]


def _options(
    threads: int | None, recording: bool, save_initial: bool, tensorboard: str | os.PathLike[str] | None
) -> list[programs.Argument]:
    """Options that a resumed run needs again."""
    options: list[programs.Argument] = ["--quiet", "--ask-after-rounds"]
    options += [] if threads is None else ["--threads", str(threads)]
    options += [] if recording else ["--no-recording"]
    options += ["--save-initial"] if save_initial else []
    options += [] if tensorboard is None else ["--tensorboard", tensorboard]
    return options


class _Following:
    """Follows a run: shows its progress, and asks the callback whether it goes on."""

    def __init__(self, on_round: OnRound | None, progress: RunProgress | None) -> None:
        self.path = Path()
        self.is_stopped = False
        """Whether the callback has ended the run before its end."""
        self._asked_to_stop = False
        self._on_round = on_round
        self._progress = progress
        self._agents = 0
        self._episodes = 0

    def run(self, arguments: Sequence[programs.Argument], scenario: _Scenario) -> None:
        """Run the program.

        Raises:
            RunError: It failed.
        """
        with self._shown(), _with_python_words(scenario):
            try:
                programs.follow(
                    arguments, on_line=self._answer, on_message=self._show_message, python_path=scenario.python_path
                )
            except RunError as error:
                self.is_stopped = self._asked_to_stop and "; resume with" in error.message
                if not self.is_stopped:
                    raise

    def finish(self, options: Sequence[programs.Argument], python_path: Sequence[str]) -> None:
        """Finish the run that the callback has ended: its last round becomes that of its scenario.

        Raises:
            RunError: It failed.
        """
        stored = self.path / "scenario.ron"
        last = max(self._episodes, 1)
        # A task that may count as solved by the scenario does so here too.
        window = re.search(r"^    stop: Solved\([^)]*\bwindow: (\d+)", stored.read_text(encoding="utf-8"), re.MULTILINE)
        stop = f"stop.at_most={last}" if window and int(window[1]) <= last else f"stop=Episodes({last})"
        self._on_round = self._progress = None
        scenario = _Scenario(str(stored), python_path=python_path)
        self.run(["run", scenario.path, "--out", self.path, "--resume", "--set", stop, *options], scenario)

    @contextlib.contextmanager
    def _shown(self) -> Iterator[None]:
        try:
            yield
        except KeyboardInterrupt:
            place = f"the run in {self.path}" if self._agents else "the run"
            raise KeyboardInterrupt(f"{place} is interrupted; the same call with resume=True continues it") from None
        finally:
            if self._progress is not None:
                self._progress.close()

    def _show_message(self, message: str) -> None:
        if self._progress is not None:
            self._progress.message(message)
        else:
            print(message, file=sys.stderr)

    def _answer(self, line: str) -> str | None:
        """The answer to a line of the program; None if it expects none."""
        kind, content = next(iter(json.loads(line).items()))
        if kind == "begun":
            self.path, self._agents = Path(content["folder"]).absolute(), content["agents"]
            if self._progress is not None:
                self._progress.begin(content["scenario"], content)
            return None
        self._episodes = content["episodes"]
        self._asked_to_stop = self._on_round is not None and not self._ask(self._on_round, content)
        if self._progress is not None:
            self._progress.show(content)
        return "stop" if self._asked_to_stop else "continue"

    def _ask(self, on_round: OnRound, content: Mapping[str, Any]) -> bool:
        """Whether the run goes on."""
        if self._progress is not None:
            # The callback may print.
            self._progress.hide()
        answer: Any = on_round(self._state(content))
        if isinstance(answer, bool | np.bool_):
            return bool(answer)
        # What is neither, such as what a tracker returns, does not matter, but 0 may be meant as False.
        if answer is not None and np.ndim(answer) == 0 and not answer:
            raise TypeError(f"on_round returned {answer!r}, expected False to end the run, or True or None to go on")
        return True

    def _state(self, content: Mapping[str, Any]) -> RunState:
        of_agents: list[list[float]] = [[] for _ in range(self._agents)]
        for row in content["finished"]:
            of_agents[row["agent"]].append(row["return"])
        all_returns = [each for returns in of_agents for each in returns]
        return RunState(
            round=content["rounds"],
            episodes=content["episodes"],
            max_episodes=content["max_episodes"],
            env_steps=content["env_steps"],
            mean_return=_mean(all_returns),
            recent_return=content["recent_return"],
            returns=[_mean(returns) for returns in of_agents],
            finished=content["finished"],
            updates=content["updates"],
            path=self.path,
        )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else math.nan


@contextlib.contextmanager
def _with_python_words(scenario: _Scenario) -> Iterator[None]:
    """Errors in the words of Python: of a file that was written for this call, and of commands to resume the run."""
    try:
        yield
    except RunError as error:
        message = error.message
        if scenario.written is not None:
            message = message.replace(str(scenario.written), "environment").replace(f"{scenario.written.parent}{os.sep}", "")
            message = naming_environment(message, scenario.written.stem)
        message = re.sub(r"\n  seedbed (run .*)$", lambda found: "\n  " + _call(found[1]), message)
        raise type(error)(error.path, message) from None


def _call(command: str) -> str:
    """The arguments of `train` that a command to resume a run means."""
    arguments = {"--resume": "resume=True", "--no-recording": "recording=False"}
    given = [argument for option, argument in arguments.items() if option in command.split()]
    return f"the same call and {', '.join(given)}"
