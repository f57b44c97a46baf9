"""Progress of a run: a line in the terminal, a bar in the notebook, some lines elsewhere."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Mapping
from html import escape
from typing import Any

from .notebooks import is_notebook, updated_output

SHOWN_EVERY = 0.1
"""Time between two updates, s."""

BAR_WIDTH = 32


class RunProgress:
    """Shows the progress of a run as lines, one per tenth of it: where nobody waits for it."""

    def __init__(self) -> None:
        self._name = ""
        self._started = self._shown = 0.0
        self._first_step = 0
        self._first_count = 0
        self._tenths = 0
        self._content: Mapping[str, Any] | None = None

    def begin(self, name: str, content: Mapping[str, Any]) -> None:
        """Begin to show a run with this progress; that of a resumed run is not 0."""
        self._name, self._started = name, time.monotonic()
        self._first_step, (self._first_count, _, _) = content["env_steps"], _played(content)

    def show(self, content: Mapping[str, Any]) -> None:
        """Show a finished round."""
        self._content = content
        now = time.monotonic()
        if now - self._shown >= SHOWN_EVERY:
            self._shown = now
            self._update(content)

    def hide(self) -> None:
        """Make place for other lines, until the next round is shown."""

    def message(self, text: str) -> None:
        """Show a warning."""
        self.hide()
        print(text, file=sys.stderr)

    def close(self) -> None:
        """Show the last round."""
        if self._content is not None:
            self._update(self._content)

    def _update(self, content: Mapping[str, Any]) -> None:
        count, maximum, _ = _played(content)
        tenths = 10 * count // maximum
        if tenths > self._tenths:
            self._tenths = tenths
            print(f"{self._name}: {self._text(content)}", file=sys.stderr)

    def _text(self, content: Mapping[str, Any]) -> str:
        count, maximum, unit = _played(content)
        seconds = time.monotonic() - self._started
        rate = (content["env_steps"] - self._first_step) / max(seconds, 1e-3)
        parts = [f"{count:,}/{maximum:,} {unit}", f"mean return {_short(content['recent_return'])}", f"{rate:,.0f} env steps/s"]
        if self._first_count < count < maximum:
            parts.append(f"{_duration(seconds * (maximum - count) / (count - self._first_count))} left")
        return " · ".join(parts)


class TerminalProgress(RunProgress):
    """Shows the progress in one line, which is removed before other lines are written."""

    def hide(self) -> None:
        self._write("")
        self._shown = 0.0

    def close(self) -> None:
        super().close()
        if self._content is not None:
            print(file=sys.stderr)

    def _update(self, content: Mapping[str, Any]) -> None:
        count, maximum, _ = _played(content)
        done = BAR_WIDTH * count // maximum
        self._write(f"{self._name} {'█' * done}{'░' * (BAR_WIDTH - done)} {self._text(content)}")

    def _write(self, text: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        print(f"\r\x1b[2K{text[:width]}", end="", file=sys.stderr, flush=True)


class NotebookProgress(RunProgress):
    """Shows the progress as a bar below the cell."""

    def __init__(self) -> None:
        super().__init__()
        self._output = updated_output()

    def _update(self, content: Mapping[str, Any]) -> None:
        count, maximum, _ = _played(content)
        text = f"{self._name}: {self._text(content)}"
        bar = f'<progress value="{count}" max="{maximum}" style="width: 20em"></progress>'
        self._output(text, f"<div>{bar} {escape(text)}</div>")


def progress_here() -> RunProgress:
    """The progress for the place where Python runs."""
    if is_notebook():
        return NotebookProgress()
    return TerminalProgress() if sys.stderr.isatty() else RunProgress()


def _played(content: Mapping[str, Any]) -> tuple[int, int, str]:
    """How much of a run has been played, in the unit after which it ends."""
    if content["max_env_steps"] is not None:
        return min(content["env_steps"], content["max_env_steps"]), content["max_env_steps"], "env steps"
    return content["episodes"], max(content["max_episodes"], 1), "episodes"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def _short(value: float) -> str:
    """A number with a decimal or, if it is small, four significant digits."""
    return f"{value:.1f}" if abs(value) >= 100 else f"{value:.4g}"
