"""The notebooks of the documentation run, and are stored without outputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from conftest import REPOSITORY
from nbclient import NotebookClient
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

READING = REPOSITORY / "docs/reading_runs.ipynb"
LANDING = REPOSITORY / "docs/lunar_lander.ipynb"


def executed(notebook: Path, folder: Path) -> list[Any]:
    """The code cells with their outputs."""
    cells = nbformat.read(notebook, as_version=4)
    NotebookClient(cells, timeout=1200, resources={"metadata": {"path": str(folder)}}).execute()
    return [cell for cell in cells.cells if cell.cell_type == "code"]


def result(cells: list[Any], source: str) -> dict[str, str]:
    """What the cell that contains a text shows."""
    cell = next(cell for cell in cells if source in cell.source)
    return dict(next(output.data for output in cell.outputs if output.output_type == "execute_result"))


@pytest.mark.filterwarnings("default")
def test_every_cell_of_reading_runs_shows_something(tmp_path: Path):
    cells = executed(READING, tmp_path)
    assert len(cells) == 7
    assert "cartpole, run seed 0" in result(cells, "seedbed.load")["text/html"]
    assert "polyline" in result(cells, "seedbed.load")["text/html"]
    for source in ("run.episodes", "run.states", "seedbed.runs"):
        assert "<table" in result(cells, source)["text/html"]
    assert "explore.html" in result(cells, "run.explore")["text/plain"]
    assert result(cells, "run.policy")["text/plain"] == "array([" + ", ".join(["200."] * 10) + "])"


@pytest.mark.filterwarnings("default")
def test_a_team_in_gymnasiums_lander_is_compared_with_another_library(tmp_path: Path):
    cells = executed(LANDING, tmp_path)
    assert "LunarLander-v3" in result(cells, "seedbed.train")["text/html"]
    page = result(cells, "run.explore")["text/html"]
    assert page.startswith("<iframe srcdoc=") and "left_leg" in page
    assert result(cells, "run.plot")["image/svg+xml"].startswith("<svg")
    assert "compare.ron.lock" in result(cells, "seedbed.register")["text/plain"]
    verdict = result(cells, "confirm=True")["text/markdown"]
    assert "The team has higher returns after equal numbers of steps." in verdict and "confirmatory" in verdict
    assert "environment steps of the team" in result(cells, "1-curves")["image/svg+xml"]
    assert result(cells, "found.results")["text/html"].count("four agents, VIME") == 5

    events = EventAccumulator(str(tmp_path / "logs/agent_0"))
    events.Reload()
    returns = events.Scalars("return")
    # Each agent plays a quarter of the team's steps.
    assert returns[-1].step >= 4000 - 4 * 1000 and len(returns) > 3


@pytest.mark.parametrize("notebook", [READING, LANDING], ids=lambda path: path.stem)
def test_notebooks_are_stored_without_outputs(notebook: Path):
    stored = nbformat.read(notebook, as_version=4)
    nbformat.validate(stored)
    code = [cell for cell in stored.cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)
