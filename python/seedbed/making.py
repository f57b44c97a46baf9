"""Making environments of task files and of built-in tasks."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, overload

from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from ._native import Task
from .environment import Env, Physics, RenderMode, TaskLike, as_task
from .registration import environment_id
from .vector import Autoreset, VectorEnv

if TYPE_CHECKING:
    from .parallel import ParallelEnv


@overload
def make(
    task: TaskLike,
    num_envs: None = None,
    *,
    physics: Physics = "rapier",
    max_episode_steps: int | None = None,
    render_mode: RenderMode | None = None,
    run_seed: int | None = None,
) -> Env: ...


@overload
def make(
    task: TaskLike,
    num_envs: int,
    *,
    physics: Physics = "rapier",
    threads: int | None = None,
    autoreset_mode: Autoreset | AutoresetMode = "NextStep",
    copy: bool = True,
    max_episode_steps: int | None = None,
    render_mode: RenderMode | None = None,
    run_seed: int | None = None,
) -> VectorEnv: ...


def make(
    task: TaskLike,
    num_envs: int | None = None,
    *,
    physics: Physics = "rapier",
    threads: int | None = None,
    autoreset_mode: Autoreset | AutoresetMode = "NextStep",
    copy: bool = True,
    max_episode_steps: int | None = None,
    render_mode: RenderMode | None = None,
    run_seed: int | None = None,
) -> Env | VectorEnv:
    """Make an environment of a task file or of a built-in task.

    Args:
        task: Path of a task file, name of a task (see `Task`; `seedbed.tasks()` returns the built-in ones),
            or a `Task`.
        num_envs: Number of copies of a vector environment; by default a single environment.
        physics: "rapier" for rigid bodies, "analytic" for the task's analytic model.
        threads: Number of threads of a vector environment; see `VectorEnv`.
        autoreset_mode: When a copy of a vector environment is reset whose episode has ended; see `VectorEnv`.
        copy: Whether each call of a vector environment returns an array of its own; see `VectorEnv`.
        max_episode_steps: Number of steps after which an episode is truncated, -1 for no limit; by default that of the task.
        render_mode: "rgb_array" for pictures by `render`.
        run_seed: Run seed with which tasks are drawn that differ from run to run; by default 0. See `Task`.

    Returns:
        An `Env` or, with `num_envs`, a `VectorEnv`. It has no wrappers: it truncates episodes itself.

    Raises:
        TaskError: Something in the task file is wrong.
        FileNotFoundError: There is no such file or task.
        TypeError: An argument of vector environments is given without `num_envs`.
        ValueError: An argument is invalid.

    Example:
        >>> make("cartpole").task.name
        'cartpole'
        >>> make("cartpole", num_envs=8, autoreset_mode="SameStep").num_envs
        8
    """
    found = as_task(task, run_seed)
    options = _given(physics=(physics, "rapier"), max_episode_steps=(max_episode_steps, None), render_mode=(render_mode, None))
    of_vectors = _given(threads=(threads, None), autoreset_mode=(autoreset_mode, "NextStep"), copy=(copy, True))
    environment: Env | VectorEnv
    if num_envs is None:
        if of_vectors:
            raise TypeError(f"{next(iter(of_vectors))} is an argument of vector environments; give num_envs too")
        environment = Env(found, **options)
    else:
        options |= of_vectors
        environment = VectorEnv(found, num_envs, **options)
    environment.spec = _spec(found, num_envs, options)
    return environment


def _given(**values: tuple[Any, Any]) -> dict[str, Any]:
    """The arguments that differ from their defaults: `name=(value, default)`."""
    return {name: value for name, (value, default) in values.items() if value != default}


def parallel_env(
    task: TaskLike,
    agents: int = 2,
    *,
    physics: Physics = "rapier",
    threads: int | None = None,
    max_episode_steps: int | None = None,
    render_mode: RenderMode | None = None,
    run_seed: int | None = None,
) -> ParallelEnv:
    """Make a PettingZoo environment of K agents that act at the same time, each in a copy of its own.

    It needs the package `pettingzoo`.

    Args:
        task: Path of a task file, name of a task, or a `Task`, as in `make`.
        agents: Number of agents K.
        physics, threads, max_episode_steps, render_mode, run_seed: As for `make`.

    Returns:
        A `seedbed.parallel.ParallelEnv`.

    Example:
        >>> parallel_env("cartpole", agents=3).possible_agents
        ['agent_0', 'agent_1', 'agent_2']
    """
    from .parallel import ParallelEnv

    return ParallelEnv(
        task,
        agents,
        physics=physics,
        threads=threads,
        max_episode_steps=max_episode_steps,
        render_mode=render_mode,
        run_seed=run_seed,
    )


def _spec(task: Task, num_envs: int | None, options: dict[str, Any]) -> EnvSpec:
    """Gymnasium's specification, from which `gymnasium.make` makes the same environment again."""
    name = re.sub(r"\W", "_", task.name) or "task"
    kwargs = {"task": task.path, "run_seed": task.run_seed} | options
    limit = options.get("max_episode_steps")
    return EnvSpec(
        id=environment_id(name),
        entry_point="seedbed.environment:Env",
        vector_entry_point="seedbed.vector:VectorEnv",
        reward_threshold=task.reward_threshold,
        max_episode_steps=task.time_limit if limit is None else None if limit == -1 else limit,
        order_enforce=False,
        kwargs=kwargs if num_envs is None else kwargs | {"num_envs": num_envs},
    )
