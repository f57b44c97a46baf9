"""What is shown in notebooks."""

from __future__ import annotations

import sys
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any


def is_notebook() -> bool:
    """Whether the code runs in a cell of a notebook."""
    module = sys.modules.get("IPython")
    shell: Any = None if module is None else module.get_ipython()
    return shell is not None and hasattr(shell, "kernel")


def updated_output() -> Callable[[str, str], None]:
    """Function that shows a text and its HTML below the cell, in place of what it showed before."""
    from IPython.display import display

    handles: list[Any] = []

    def show(text: str, html: str) -> None:
        content = {"text/plain": text, "text/html": html}
        if handles:
            handles[0].update(content, raw=True)
        else:
            handles.append(display(content, raw=True, display_id=True))  # type: ignore[no-untyped-call]

    return show


# Subclasses of the class of this system work before Python 3.12 too.
if TYPE_CHECKING:
    FilePath = Path
else:
    FilePath = type(Path())


class Page(FilePath):
    """Path of a page, which notebooks show."""

    HEIGHT = 700
    """Height in notebooks, pixels."""

    def _repr_html_(self) -> str:
        # Inside of the output, not by its path, which the server of a notebook may not serve.
        content = escape(self.read_text(encoding="utf-8"), quote=True)
        style = f"width: 100%; height: {self.HEIGHT}px; border: 1px solid #ccc"
        return f'<iframe srcdoc="{content}" style="{style}" sandbox="allow-scripts allow-downloads"></iframe>'


class Figure(FilePath):
    """Path of a figure, which notebooks show."""

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        if self.suffix == ".svg":
            return {"image/svg+xml": self.read_text(encoding="utf-8"), "text/plain": repr(self)}
        kind = "application/pdf" if self.suffix == ".pdf" else "image/png"
        return {kind: self.read_bytes(), "text/plain": repr(self)}


class Film(FilePath):
    """Path of a film, which notebooks show unless it is an MP4."""

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        kind = {".gif": "image/gif", ".png": "image/png"}.get(self.suffix)
        shown: dict[str, Any] = {} if kind is None else {kind: self.read_bytes()}
        return {**shown, "text/plain": repr(self)}


class Text(str):
    """A text of several lines, which is shown as it is."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self)}</pre>"
