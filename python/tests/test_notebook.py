"""The notebook of the documentation runs, and is stored without outputs."""

from __future__ import annotations

from typing import Any

import nbformat
import pytest
from conftest import REPOSITORY
from nbclient import NotebookClient

NOTEBOOK = REPOSITORY / "docs/reading_runs.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """The code cells with their outputs."""
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def result(cells: list[Any], source: str) -> dict[str, str]:
    """What the cell that contains a text shows."""
    cell = next(cell for cell in cells if source in cell.source)
    return dict(next(output.data for output in cell.outputs if output.output_type == "execute_result"))


@pytest.mark.filterwarnings("default")
def test_every_cell_runs_and_shows_something(executed: list[Any]):
    assert len(executed) == 7
    assert "cartpole, run seed 0" in result(executed, "seedbed.load")["text/html"]
    assert "polyline" in result(executed, "seedbed.load")["text/html"]
    for source in ("run.episodes", "run.states", "seedbed.runs"):
        assert "<table" in result(executed, source)["text/html"]
    assert "explore.html" in result(executed, "run.explore")["text/plain"]
    assert result(executed, "run.policy")["text/plain"] == "array([" + ", ".join(["200."] * 10) + "])"


def test_it_is_stored_without_outputs():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)
