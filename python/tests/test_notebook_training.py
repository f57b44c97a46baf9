"""In a notebook: environments of its own are trained on, progress and pages are shown, and its button interrupts a run."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

pytestmark = pytest.mark.filterwarnings("default")

ENVIRONMENT = """
import gymnasium, numpy as np, seedbed
from gymnasium import spaces

GOAL = 6

class Corridor(gymnasium.Env):
    observation_space = spaces.Box(np.float32([0]), np.float32([GOAL]))
    action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = int(self.np_random.integers(1, GOAL))
        return np.float32([self.place]), {}

    def step(self, action):
        self.place += 1 if action else -1
        is_end = self.place in (0, GOAL)
        return np.float32([self.place]), float(is_end), is_end, False, {}

def make_corridor():
    return Corridor()

corridor = seedbed.Gymnasium(make_corridor, names=["place"], time_limit=20, probe_steps=200, workers=1)
"""


def executed(folder: Path, *sources: str) -> list[Any]:
    """The cells with their outputs."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return list(notebook.cells)


def shown(cell: Any) -> dict[str, str]:
    """What a cell shows at its end."""
    return dict(next(output.data for output in cell.outputs if output.output_type == "execute_result"))


def test_training_in_a_notebook(tmp_path: Path):
    train = "run = seedbed.train(corridor, agents=2, set=['stop=Episodes(6)'], on_round=lambda state: print('round', state.round))"
    study = """seedbed.study({"title": "One", "scenario": "cartpole", "set": ["agents.count=1", "stop=Episodes(2)"],
        "cells": [{"name": "pole"}], "repeats": 1, "measures": ["Coverage"]})"""
    print_figure = "run.plot('returns', path='column.pdf', width='8.4cm', height='5cm', font='8pt', title=False, legend=False)"
    plots = ("run.plot('returns')", study, "run.plot(path='figure.png')")
    cells = executed(tmp_path, ENVIRONMENT, train, "run", "run.explore()", *plots, "seedbed.check(corridor)", print_figure)
    outputs = cells[1].outputs
    assert "".join(output.text for output in outputs if output.output_type == "stream" and output.name == "stdout").count("round") == 6
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    (progress,) = (output.data for output in outputs if output.output_type == "display_data")
    assert 'value="6" max="6"' in progress["text/html"] and "make_corridor: 6/6 episodes" in progress["text/plain"]
    assert "make_corridor, run seed 0" in shown(cells[2])["text/html"]
    page = shown(cells[3])
    assert page["text/html"].startswith("<iframe srcdoc=") and "place" in page["text/html"] and "explore.html" in page["text/plain"]
    assert shown(cells[4])["image/svg+xml"].startswith("<svg")
    assert "study" in shown(cells[5])["text/markdown"]
    assert shown(cells[6])["image/png"]
    assert "observations place" in shown(cells[7])["text/html"]
    # 8.4 cm × 5 cm are 238.11 × 141.73 points.
    assert "column.pdf" in shown(cells[8])["text/plain"]
    assert b"/MediaBox[0 0 238.11" in (tmp_path / "column.pdf").read_bytes()


def test_the_button_of_a_notebook_interrupts_a_run(tmp_path: Path):
    """The kernel interrupts its whole process group, as Jupyter does."""
    train = "run = seedbed.train('cartpole', agents=2, set=['stop=Episodes(3000)'], out='run'{})"
    notebook = nbformat.v4.new_notebook(
        cells=[
            nbformat.v4.new_code_cell("import seedbed, pathlib"),
            nbformat.v4.new_code_cell(train.format(", on_round=lambda state: pathlib.Path('begun').touch()")),
        ]
    )
    client = NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})

    def interrupt() -> None:
        while not (tmp_path / "begun").exists():
            time.sleep(0.05)
        asyncio.run(client.km.interrupt_kernel())

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(CellExecutionError, match="the same call with resume=True continues it") as caught:
        client.execute()
    thread.join()
    assert caught.value.ename == "KeyboardInterrupt"
    cells = executed(tmp_path, "import seedbed", train.format(", resume=True"), "run.state")
    assert shown(cells[2])["text/plain"] == "'finished'"
