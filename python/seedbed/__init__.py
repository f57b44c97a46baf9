"""Reinforcement-learning tasks as text files, for Gymnasium and PettingZoo.

Importing this package registers the built-in tasks with Gymnasium:

    >>> import gymnasium
    >>> import seedbed
    >>> environment = gymnasium.make("seedbed/CartPole-v0")

`make` also makes environments of task files, one or many at once:

    >>> environment = seedbed.make("cartpole")
    >>> environments = seedbed.make("cartpole", num_envs=64)
    >>> observations, _ = environments.reset(seed=0)
    >>> observations.shape
    (64, 4)
"""

from ._native import Action, Quantity, Task, TaskError, __version__
from .environment import Env
from .making import make, parallel_env
from .recording import RecordingError, RecordVisitation, RecordVisitationVector
from .registration import environment_id, register_builtin_tasks, tasks
from .vector import VectorEnv

__all__ = [
    "Action",
    "Env",
    "Quantity",
    "RecordVisitation",
    "RecordVisitationVector",
    "RecordingError",
    "Task",
    "TaskError",
    "VectorEnv",
    "__version__",
    "environment_id",
    "make",
    "parallel_env",
    "tasks",
]

register_builtin_tasks()
