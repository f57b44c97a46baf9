"""The MJCF file, read by MuJoCo."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .report import MjcfError, Report


def import_mujoco() -> Any:
    """The package `mujoco`.

    Raises:
        MjcfError: It is not installed.
    """
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        message = "the package `mujoco` is needed to read MJCF files: pip install mujoco"
        raise MjcfError([message]) from None


class Source:
    """A model and its kinematics at the reference pose.

    Args:
        path: The MJCF file.

    Attributes:
        mujoco: The package.
        model: The compiled model, in which defaults, classes and includes are resolved.
        data: Poses at the reference coordinates `qpos0`, after `mj_kinematics`.
        report: Errors and warnings about the file.

    Raises:
        MjcfError: There is no such file, MuJoCo is not installed, or it cannot read the file.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.mujoco = import_mujoco()
        self.report = Report(self.path.name)
        self.model = self._read()
        self.data = self.mujoco.MjData(self.model)
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_comPos(self.model, self.data)

    def _read(self) -> Any:
        if self.path.is_dir():
            raise MjcfError([f"{self.path}: expected an MJCF file, found a folder"])
        if not self.path.is_file():
            raise MjcfError([f"{self.path}: there is no such file"])
        try:
            with self.warnings_reported():
                return self.mujoco.MjModel.from_xml_path(str(self.path))
        except Exception as error:  # the package's errors have several types
            reason = " ".join(str(error).split())
            raise MjcfError([f"{self.path}: MuJoCo cannot read it: {reason}"]) from None

    @contextmanager
    def warnings_reported(self) -> Iterator[None]:
        """MuJoCo's own warnings go to the report, instead of to a file in the working directory."""
        self.mujoco.set_mju_user_warning(lambda text: self.report.warning("MuJoCo", str(text).strip()))
        try:
            yield
        finally:
            self.mujoco.set_mju_user_warning(None)

    def name(self, kind: str, index: int) -> str:
        """Name of an element, or an empty text; `kind` is as in `mjtObj`: "body", "joint", "geom"."""
        kind_of_object = getattr(self.mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return self.mujoco.mj_id2name(self.model, kind_of_object, index) or ""

    def label(self, kind: str, index: int) -> str:
        """An element for people: `joint "rooty"`, or `joint 2 (unnamed, in body "torso")`."""
        name = self.name(kind, index)
        if kind == "body" and index == 0:
            return "worldbody"
        if name:
            return f'{kind} "{name}"'
        owners = {"geom": "geom_bodyid", "joint": "jnt_bodyid", "site": "site_bodyid"}
        if kind not in owners:
            return f"{kind} {index} (unnamed)"
        owner = int(getattr(self.model, owners[kind])[index])
        return f"{kind} {index} (unnamed, in {self.label('body', owner)})"

    def is_disabled(self, flag: str) -> bool:
        """Whether `<option><flag FLAG="disable"/></option>` is set; flags that this MuJoCo does not have are not."""
        bit = getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}", None)
        return bit is not None and bool(self.model.opt.disableflags & int(bit))

    def kind_of(self, enumeration: str, prefix: str, value: int) -> str:
        """Name of a value of one of MuJoCo's enumerations as in MJCF: `kind_of("mjtGeom", "mjGEOM_", 2)` is "sphere"."""
        members = getattr(self.mujoco, enumeration).__members__
        names = [name for name, member in members.items() if int(member) == int(value)]
        return str(names[0]).removeprefix(prefix).lower() if names else str(value)

    def array(self, name: str, default: float, size: int) -> Any:
        """An array of the model, or `size` defaults if this version of MuJoCo does not have it."""
        return getattr(self.model, name, [default] * size)
