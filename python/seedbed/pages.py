"""Pages about a run: the viewer with the recording, and the overview in notebooks."""

from __future__ import annotations

import base64
import csv
import gzip
import importlib.metadata
import importlib.util
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .checksums import verify
from .errors import RunError

if TYPE_CHECKING:
    from .reading import Run

VIEWER_VERSION = "0.36.3"
"""Version of PyPI's rerun-notebook, which is that of recordings. Other versions have other scripts."""

MARKERS = ("//!<INLINE-MARKER-OPEN>", "//!<INLINE-MARKER-CLOSE>")
"""Around the lines of the viewer's script that download it."""

VIEWER_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>html, body {{ margin: 0; height: 100%; overflow: hidden; background: #1c1c1c; }}</style>
<body>
<script type="text/plain" id="viewer">{viewer}</script>
<script type="text/plain" id="recording">{recording}</script>
<script type="module">
{script}
const unpack = async (id) => {{
  const element = document.getElementById(id);
  const packed = await fetch("data:application/octet-stream;base64," + element.textContent);
  element.remove();
  const stream = (await packed.blob()).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}};
const viewer = new WebViewer();
viewer.on("recording_open", () => {{ document.documentElement.dataset.ready = "yes"; }});
await viewer.start(null, document.body, {{ hide_welcome_screen: true, width: "100%", height: "100%" }});
viewer.open_channel({title_text}).send_rrd(await unpack("recording"));
</script>
</html>
"""

LOAD_VIEWER = """
  const bytes = await unpack("viewer");
  return new Response(bytes, { headers: { "Content-Type": "application/wasm" } });
"""

OVERVIEW_ROWS = {
    "state": "State",
    "agents": "Agents",
    "episodes_per_agent": "Episodes per agent",
    "env_steps": "Environment steps of the team",
    "final_return": "Return (mean of the last 25 episodes)",
    "episodes_until_solved": "Episodes until solved",
    "team_coverage": "Coverage of the team",
    "effective_agents": "Effective agents",
    "regret_per_agent": "Regret per agent",
}


def write_viewer(recording: Path, path: Path, title: str) -> Path:
    """Write a page with the viewer and a recording; see `Run.to_html`."""
    script, viewer = _viewer_files()
    script = script.replace("</script", "<\\/script")
    start, end = (script.index(marker) for marker in MARKERS)
    script = script[: start + len(MARKERS[0])] + LOAD_VIEWER + script[end:]
    page = VIEWER_PAGE.format(
        title=escape(title),
        title_text=_script_text(title),
        viewer=_packed(viewer.read_bytes()),
        recording=_packed(recording.read_bytes()),
        script=script,
    )
    path.write_text(page, encoding="utf-8")
    return path


def _viewer_files() -> tuple[str, Path]:
    """The text of the viewer's script, and its WebAssembly file."""
    # Without importing it, which starts widgets of notebooks.
    spec = importlib.util.find_spec("rerun_notebook")
    install = f"pip install rerun-notebook=={VIEWER_VERSION}"
    needed = f"a page with the viewer needs rerun-notebook {VIEWER_VERSION}: `{install}`"
    if spec is None or not spec.submodule_search_locations:
        raise ImportError(needed)
    version = importlib.metadata.version("rerun-notebook")
    static = Path(spec.submodule_search_locations[0]) / "static"
    if version != VIEWER_VERSION:
        raise ImportError(f"{needed}; version {version} is installed")
    return (static / "widget.js").read_text(encoding="utf-8"), static / "re_viewer_bg.wasm"


def _packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, compresslevel=6, mtime=0)).decode()


def _script_text(text: str) -> str:
    """A text as a literal of JavaScript in a page."""
    return (
        '"'
        + "".join(
            character if character.isalnum() or character in " ,.-_" else f"\\u{{{ord(character):x}}}"
            for character in text
        )
        + '"'
    )


def overview(run: Run) -> str:
    """The main results of a run and its returns, as HTML for notebooks."""
    try:
        row = {"state": "a recording without its folder"} if not run.path.is_dir() else run.info
        name = run.name
    except RunError as error:
        return f"<p><b>{escape(str(run.path))}</b>: {escape(str(error))}</p>"
    cells = [(title, row[key]) for key, title in OVERVIEW_ROWS.items() if row.get(key) is not None]
    style = "text-align: left"
    lines = [
        f'<tr><th style="{style}">{title}</th><td style="{style}">{_cell(value)}</td></tr>' for title, value in cells
    ]
    caption = f'<caption style="{style}"><b>{escape(name)}</b><br>{escape(str(run.path))}</caption>'
    try:
        verify(run.path / "episodes.csv")
        returns = team_returns(run.path)
    except RunError:
        returns = []
    table = f"<table>{caption}{''.join(lines)}</table>"
    return f"<div>{table}{_curve(returns)}</div>"


def _cell(value: Any) -> str:
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))


def team_returns(run: Path) -> list[float]:
    """Mean over agents of the return of their n-th episode, for each n that all agents have finished."""
    returns: dict[int, list[float]] = {}
    try:
        with (run / "episodes.csv").open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                # The last line of a run in progress may be incomplete.
                if row["effective_agents"] is not None:
                    returns.setdefault(int(row["episode"]), []).append(float(row["return"]))
    except (OSError, KeyError, TypeError, ValueError, csv.Error):
        return []
    team = max((len(found) for found in returns.values()), default=0)
    numbers = sorted(number for number, found in returns.items() if len(found) == team)
    return [sum(returns[number]) / team for number in numbers]


def _curve(values: Sequence[float], width: int = 320, height: int = 80) -> str:
    """A small picture of a curve, with its lowest and highest values."""
    if len(values) < 2:
        return ""
    low, high = min(values), max(values)
    scale = (height - 4) / (high - low or 1.0)
    step = (width - 4) / (len(values) - 1)
    points = " ".join(
        f"{2 + number * step:.1f},{height - 2 - (value - low) * scale:.1f}" for number, value in enumerate(values)
    )
    return (
        f'<figure style="margin: 8px 0"><svg width="{width}" height="{height}" role="img" aria-label="returns">'
        f'<polyline points="{points}" fill="none" stroke="#4477aa" stroke-width="1.5"/></svg>'
        f"<figcaption>Mean return of the team per episode, from {low:.4g} to {high:.4g}</figcaption></figure>"
    )
