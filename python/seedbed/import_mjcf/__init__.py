"""Import a planar model from MJCF, the format of MuJoCo.

    python -m seedbed.import_mjcf MODEL.xml > envs/model.ron

`convert` does the same in Python. It needs the package `mujoco`, which reads the model.
"""

from __future__ import annotations

import os

from .conversion import Options, convert_model
from .report import MjcfError
from .writing import task_text

__all__ = ["MjcfError", "convert"]


def convert(path: str | os.PathLike[str], frame_skip: int = 1, time_limit: int = 1000) -> str:
    """Convert a planar model to the text of a task file.

    Args:
        path: The MJCF file.
        frame_skip: MuJoCo's time steps per control step.
        time_limit: Actions in an episode.

    Returns:
        The text, which has no reward yet.

    Raises:
        MjcfError: There is no such file, MuJoCo cannot read it, or something in it is not expressible in a task file.
    """
    return task_text(convert_model(path, Options(frame_skip, time_limit)))
