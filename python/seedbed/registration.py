"""Registration of the built-in tasks with Gymnasium."""

from __future__ import annotations

import gymnasium

from ._native import Task, builtin_tasks

WORDS = {"cartpole": "CartPole"}
"""Words of names of tasks whose usual spelling has more capitals."""


def tasks() -> list[str]:
    """Names of the built-in tasks, sorted.

    Example:
        >>> "cartpole" in tasks()
        True
    """
    return builtin_tasks()


def environment_id(name: str) -> str:
    """Gymnasium's id of the task with this name.

    Example:
        >>> environment_id("cartpole_swingup")
        'seedbed/CartPoleSwingup-v0'
    """
    words = (WORDS.get(word, word[:1].upper() + word[1:]) for word in name.split("_"))
    return f"seedbed/{''.join(words)}-v0"


def register_builtin_tasks() -> None:
    """Register all built-in tasks that are not registered yet."""
    for name in builtin_tasks():
        if environment_id(name) not in gymnasium.registry:
            _register(name)


def _register(name: str) -> None:
    path = f"builtin:envs/{name}.ron"
    task = Task(path)
    gymnasium.register(
        id=environment_id(name),
        entry_point="seedbed.environment:RegisteredEnv",
        vector_entry_point="seedbed.vector:VectorEnv",
        reward_threshold=task.reward_threshold,
        max_episode_steps=task.time_limit,
        kwargs={"task": path},
    )
