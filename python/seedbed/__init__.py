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

`load` reads the results of the program `seedbed`, whose path is `seedbed.command()`:

    >>> run = seedbed.load("recordings/cartpole")  # doctest: +SKIP
    >>> action = run.policy(0)(observations[0])  # doctest: +SKIP
"""

from seedbed_command import command

from ._native import Action, Quantity, Task, TaskError, __version__
from .environment import Env
from .errors import RunError
from .making import make, parallel_env
from .policies import Policy
from .reading import Run, load, runs
from .recording import RecordingError, RecordVisitation, RecordVisitationVector
from .registration import environment_id, register_builtin_tasks, tasks
from .vector import VectorEnv

__all__ = [
    "Action",
    "Env",
    "Policy",
    "Quantity",
    "RecordVisitation",
    "RecordVisitationVector",
    "RecordingError",
    "Run",
    "RunError",
    "Task",
    "TaskError",
    "VectorEnv",
    "__version__",
    "command",
    "environment_id",
    "load",
    "make",
    "parallel_env",
    "runs",
    "tasks",
]

register_builtin_tasks()
