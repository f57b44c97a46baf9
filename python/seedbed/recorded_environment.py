"""What a recording says of an environment: its name, task, time limit and duration of a step."""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

import gymnasium

from .recorded_axes import check_text
from .state_files import Axis, Header


RECORDERS = {"environment": "RecordVisitation", "vector": "RecordVisitationVector", "VecEnv": "RecordVecEnv"}
"""The recorder of each kind of environment."""


def check_kind(env: Any, expected: Literal["environment", "vector", "VecEnv"]) -> None:
    """Raises: TypeError: The environment is of another kind; the message names the recorder of that kind."""
    if isinstance(env, gymnasium.vector.VectorEnv):
        found = "vector"
    elif isinstance(env, gymnasium.Env):
        found = "environment"
    else:
        found = "VecEnv" if hasattr(env, "step_wait") else ""
    if found != expected:
        help = f": record it with {RECORDERS[found]}" if found else ""
        raise TypeError(f"{RECORDERS[expected]} cannot record a {type(env).__name__}{help}")


def warn_of_normalization(env: Any) -> None:
    """Warns if the recorder is outside of a wrapper that normalizes rewards, so that returns have no meaning."""
    for part in _parts(env):
        name = type(part).__name__
        if name == "NormalizeReward" or (name == "VecNormalize" and part.norm_reward):
            message = f"rewards are recorded as {name} changes them: put the recorder inside of {name}"
            warnings.warn(message, RuntimeWarning, stacklevel=3)


def _parts(env: Any) -> Iterator[Any]:
    """An environment, and those that it wraps: of several copies, the first."""
    while env is not None:
        yield env
        inner = vars(env) if hasattr(env, "__dict__") else {}
        copies = inner.get("envs") or [None]
        env = inner.get("venv") or inner.get("env") or copies[0]


def header_of(
    agent: int,
    environment: str,
    observations: tuple[Axis, ...],
    actions: tuple[Axis, ...],
    spec: Any,
    metadata: Mapping[str, Any],
    learner: int | None,
) -> Header:
    """The header of the file of an agent."""
    check_text(environment, "environment")
    number = agent_number("agent", agent)
    learner_number = None if learner is None else agent_number("learner", learner)
    return Header(
        agent=number,
        environment=environment,
        observations=observations,
        actions=actions,
        time_limit=_time_limit(spec),
        step_seconds=_step_seconds(metadata.get("render_fps")),
        learner=None if learner_number == number else learner_number,
    )


def headers_of(
    agents: Sequence[int],
    learners: Sequence[int],
    environment: str,
    observations: tuple[Axis, ...],
    actions: tuple[Axis, ...],
    spec: Any,
    metadata: Mapping[str, Any],
) -> list[Header]:
    """The headers of the files of all copies of a vector environment."""
    return [
        header_of(agent, environment, observations, actions, spec, metadata, learner)
        for agent, learner in zip(agents, learners, strict=True)
    ]


def agent_numbers(agents: Sequence[int] | None, copies: int) -> list[int]:
    """The agent of each copy of a vector environment.

    Raises:
        ValueError: There are more or fewer numbers than copies, or one is no such number or is there twice.
    """
    numbers = [agent_number("agents", agent) for agent in (range(copies) if agents is None else agents)]
    if len(numbers) != copies or len(set(numbers)) != len(numbers):
        raise ValueError(f"agents is {numbers}, expected {copies} different numbers: one per copy")
    return numbers


def learner_numbers(learners: Sequence[int] | None, agents: Sequence[int]) -> list[int]:
    """The learner of each copy; by default one acts in all copies.

    Raises:
        TypeError: It is no sequence.
        ValueError: There are more or fewer numbers than copies, or one is no such number.
    """
    if learners is None:
        return [agents[0]] * len(agents)
    if not isinstance(learners, Iterable):
        raise TypeError(f"learners is {learners!r}, expected the number of the learner of each copy, such as range({len(agents)})")
    numbers = [agent_number("learners", learner) for learner in learners]
    if len(numbers) != len(agents):
        raise ValueError(f"learners is {numbers}, expected {len(agents)} numbers: one per copy")
    return numbers


def agent_number(name: str, number: Any) -> int:
    """A number of an agent or learner; an error says the `name` of the argument."""
    try:
        index = -1 if isinstance(number, bool) else operator.index(number)
    except TypeError:
        index = -1
    if not 0 <= index < 1 << 16:
        raise ValueError(f"{name} is {number!r}, expected a number from 0 to 65535")
    return index


def _time_limit(spec: Any) -> int | None:
    """Number of steps after which episodes are truncated; None if there is no such number of 32 bits."""
    try:
        steps = operator.index(getattr(spec, "max_episode_steps", None))  # type: ignore[arg-type]
    except TypeError:
        return None
    return steps if 0 < steps < 1 << 32 else None


def _step_seconds(frames_per_second: Any) -> float | None:
    """Time of a step, s; None if the frames per second are no number that has one."""
    try:
        seconds = 1 / float(frames_per_second)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return seconds if 0 < seconds < math.inf else None


def name_of(env: Any, spec: Any) -> str:
    """The id of an environment or, if it has none, the name of its class."""
    copies = getattr(env.unwrapped, "envs", None)
    return str(spec.id) if spec is not None else type((copies[0] if copies else env).unwrapped).__name__


def spec_of(env: Any) -> Any:
    """The specification of a vector environment or, if it has none, of its first copy."""
    copies = getattr(env.unwrapped, "envs", None)
    return env.spec if env.spec is not None or not copies else copies[0].spec


def task_of(env: Any) -> Any:
    """The seedbed task of an environment, if no wrapper changes its observations."""
    layers = [env]
    while layers[-1] is not env.unwrapped:
        layers.append(layers[-1].env)
    task = getattr(layers[-1], "task", None)
    if not all(hasattr(task, name) for name in ("observations", "actions", "time_limit")):
        return None
    is_changed = any(
        layer.observation_space is not layers[-1].observation_space or layer.action_space is not layers[-1].action_space
        for layer in layers
    )
    return None if is_changed else task


def has_wrapper(env: Any, kind: type) -> bool:
    """Whether one of the wrappers of an environment is of this kind."""
    while env is not env.unwrapped:
        if isinstance(env, kind):
            return True
        env = env.env
    return False
