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

`train` trains a team of agents with the program `seedbed`, and `load` reads its results:

    >>> run = seedbed.train("cartpole", agents=4, seed=0)  # doctest: +SKIP
    >>> run = seedbed.load("recordings/cartpole")  # doctest: +SKIP
    >>> action = run.policy(0)(observations[0])  # doctest: +SKIP

`Team` has the same learners for training loops of your own:

    >>> task = environments.task
    >>> spaces = environments.single_observation_space, environments.single_action_space
    >>> team = seedbed.Team("SeedPg", *spaces, agents=64, task=task)
    >>> team.act(observations).shape
    (64,)
"""

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

from seedbed_command import command

if TYPE_CHECKING:
    from ._native import Action, Quantity, Task, TaskError, __version__
    from .environment import Env
    from .errors import InputError, RunError
    from .gymnasium_task import Gymnasium
    from .making import make, parallel_env
    from .policies import Policy
    from .reading import Run, load, runs
    from .recording import RecordingError, RecordVisitation, RecordVisitationVector
    from .registration import environment_id, tasks
    from .studying import Study, Tuning, check, register, study, tune
    from .team import Team
    from .training import RunState, train
    from .vec_env_recording import RecordVecEnv
    from .vector import VectorEnv

__all__ = [
    "Action",
    "Env",
    "Gymnasium",
    "InputError",
    "Policy",
    "Quantity",
    "RecordVecEnv",
    "RecordVisitation",
    "RecordVisitationVector",
    "RecordingError",
    "Run",
    "RunError",
    "RunState",
    "Study",
    "Task",
    "TaskError",
    "Team",
    "Tuning",
    "VectorEnv",
    "__version__",
    "check",
    "command",
    "environment_id",
    "load",
    "make",
    "parallel_env",
    "register",
    "runs",
    "study",
    "tasks",
    "train",
    "tune",
]

_MODULES = {
    "_native": ("Action", "Quantity", "Task", "TaskError", "__version__"),
    "environment": ("Env",),
    "errors": ("InputError", "RunError"),
    "gymnasium_task": ("Gymnasium",),
    "making": ("make", "parallel_env"),
    "policies": ("Policy",),
    "reading": ("Run", "load", "runs"),
    "recording": ("RecordVisitation", "RecordVisitationVector", "RecordingError"),
    "registration": ("environment_id", "tasks"),
    "studying": ("Study", "Tuning", "check", "register", "study", "tune"),
    "team": ("Team",),
    "training": ("RunState", "train"),
    "vec_env_recording": ("RecordVecEnv",),
    "vector": ("VectorEnv",),
}
"""Modules of the names that are loaded when they are first used. Recorders need nothing but Gymnasium."""

_HAS_NATIVE = importlib.util.find_spec("seedbed._native") is not None
"""Whether the package is built; the sources alone have no native module."""


def _load(module: str, name: str) -> Any:
    try:
        return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    except ModuleNotFoundError as error:
        if error.name != f"{__name__}._native":
            raise
        raise ImportError(
            f"seedbed.{name} needs the native module of the package, which sources do not contain: "
            "install the package with `pip install ./python` in the directory of the repository",
            name=error.name,
        ) from error


# Hidden from mypy, which would take every name for one of the package.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        for module, names in _MODULES.items():
            if name in names:
                globals()[name] = _load(module, name)
                return globals()[name]
        if not name.startswith("_") and importlib.util.find_spec(f"{__name__}.{name}") is not None:
            return importlib.import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


if _HAS_NATIVE:
    _load("registration", "register_builtin_tasks")()
