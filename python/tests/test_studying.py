"""Studies, tuning and checks from Python."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from conftest import REPOSITORY

import seedbed

STUDY: dict[str, Any] = {
    "title": 'Do "seeds" help?',
    "scenario": "cartpole",
    "set": ["agents.count=2", "stop=Episodes(4)"],
    "grid": [{"name": "σ", "set": ["agents.seeds=Normal(sigma: {})"], "values": [0, 0.1]}],
    "repeats": 5,
    "measures": ["FinalReturn(window: 4)", "Coverage"],
    "claims": [{"text": "Wider.", "measure": "Coverage", "compare": ("σ 0.1", "σ 0"), "direction": "More", "smallest": 0.05}],
    "figures": ["Curves()", "Visitation(episodes: [All])"],
}

STUDY_FILE = """Study(
    title: "Do \\"seeds\\" help?", scenario: "cartpole", set: ["agents.count=2", "stop=Episodes(4)"],
    grid: [(name: "σ", set: ["agents.seeds=Normal(sigma: {})"], values: ["0", "0.1"])], repeats: 5,
    measures: [FinalReturn(window: 4), Coverage],
    claims: [(text: "Wider.", measure: Coverage, compare: ("σ 0.1", "σ 0"), direction: More, smallest: 0.05)],
    figures: [Curves(), Visitation(episodes: [All])],
)
"""


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_study_as_a_map_is_that_of_its_file(capsys: pytest.CaptureFixture[str]):
    found = seedbed.study(STUDY, name="seeds")
    printed = capsys.readouterr()
    assert "2 cells, 5 runs each, 10 to run" in printed.out and "10/10 runs" in printed.err
    assert found.path == Path("recordings/studies/seeds").absolute()
    Path("seeds.ron").write_text(STUDY_FILE)
    other = seedbed.study("seeds.ron", out="other", jobs=1)
    for name in ("results.csv", "claims.md"):
        assert (found.path / name).read_text() == (other.path / name).read_text()
    # The runs are those that are there already.
    capsys.readouterr()
    assert repr(seedbed.study(STUDY, name="seeds")) == f"<seedbed study 'seeds' in {found.path}>"
    assert "0 to run" in capsys.readouterr().out


def test_results_are_frames_and_the_report(capsys: pytest.CaptureFixture[str]):
    found = seedbed.study(STUDY, frames="pandas")
    frame = found.results
    assert len(frame) == 10 and set(frame["cell"]) == {"σ 0", "σ 0.1"}
    assert frame["Coverage"].dtype == float
    assert type(seedbed.Study(found.path, frames="polars").results).__module__.startswith("polars")
    assert seedbed.Study(found.path, frames="arrow").results.num_rows == 10
    assert found.claims.startswith("| claim |") and "Wider." in repr(found.claims)
    assert "Wider." in found._repr_markdown_() and "coverage" in found.tables.lower()
    assert found.report.name == "report.html" and found.report._repr_html_().startswith("<iframe srcdoc=")
    assert list(found.figures) == ["1-curves", "2-visitation", "claims"]
    assert found.figures["1-curves"]._repr_mimebundle_()["image/svg+xml"].startswith("<svg")
    with pytest.raises(seedbed.RunError, match="no finished study"):
        seedbed.Study("nowhere")


def test_paths_in_a_map_begin_in_the_working_directory():
    Path("mine").mkdir()
    Path("mine/pole.ron").write_text('Scenario(environment: "cartpole", agents: (count: 1), stop: Episodes(2))')
    fields = {"title": "One", "cells": [{"name": "pole", "scenario": "mine/pole.ron"}], "repeats": 1, "measures": ["Coverage"]}
    assert len(seedbed.study(fields, frames="pandas").results) == 1


def test_errors_of_studies():
    with pytest.raises(seedbed.InputError, match="direction") as caught:
        seedbed.study(STUDY | {"claims": [STUDY["claims"][0] | {"direction": "Upwards"}]}, name="seeds")
    assert str(caught.value).startswith("seeds.ron:1:"), caught.value
    with pytest.raises(seedbed.InputError, match="nothing.ron"):
        seedbed.study("nothing.ron")


def test_tuning():
    path = REPOSITORY / "scenarios/tuning/cartpole_q.ron"
    found = seedbed.tune(path, 3, jobs=1, frames="pandas")
    assert found.path == Path("recordings/tuning/cartpole_q").absolute()
    assert len(found.results) == 6 and "Q-learning" in found.best
    line = [seedbed.command(), "tune", path, "--budget", "3", "--out", "other"]
    subprocess.run(line, check=True, capture_output=True)
    assert (found.path / "tuning.csv").read_text() == Path("other/tuning.csv").read_text()
    fields = {
        "title": "Step size",
        "scenario": "cartpole_q",
        "set": ["agents.count=1", "stop=Episodes(3)"],
        "methods": [{"name": "Q", "space": [{"set": ["algorithm.learning.optimizer.step_size={}"], "draw": "LogUniform(1e-4, 1e-2)"}]}],
        "measure": "FinalReturn(window: 3)",
        "goal": "Maximize",
        "runs": 1,
    }
    assert len(seedbed.tune(fields, budget=2, name="mine", frames="pandas").results) == 2


class TestChecks:
    def test_files_and_names_as_the_program_says(self):
        expected = subprocess.run([seedbed.command(), "check", "cartpole", "hopper"], capture_output=True, text=True).stdout
        found = seedbed.check("cartpole", "hopper")
        assert found == expected.strip() and repr(found) == str(found)
        assert found._repr_html_().startswith("<pre>ok: cartpole")

    def test_environments_and_maps(self):
        def make_pole() -> Any:
            return gymnasium.make("CartPole-v1")

        found = seedbed.check(seedbed.Gymnasium(make_pole, names=["x", "v", "angle", "turning"], probe_steps=100))
        assert found.startswith("ok: make_pole: environment; observations x, v, angle, turning")
        assert "study with 2 cells, 5 runs each, and 1 claim" in seedbed.check(STUDY)

    def test_errors(self):
        with pytest.raises(seedbed.InputError, match="'no_such_name'|no_such_name") as caught:
            seedbed.check("no_such_name")
        assert "error:" not in str(caught.value)
        with pytest.raises(seedbed.InputError, match="names") as caught:
            seedbed.check(seedbed.Gymnasium("CartPole-v1", names=["x"], probe_steps=100))
        assert str(caught.value).startswith("environment CartPole-v1: in `names`"), caught.value

        class Endless(gymnasium.Env[Any, Any]):
            observation_space = gymnasium.spaces.Box(-1, 1, (2,))
            action_space = gymnasium.spaces.Discrete(2)

        with pytest.raises(seedbed.InputError) as caught:
            seedbed.check(Endless)
        assert str(caught.value) == (
            "environment Endless: the environment says no time limit; each episode needs one\n"
            "  = help: `seedbed.Gymnasium(environment, time_limit=1000)`"
        )


def test_results_of_others_begin_in_the_working_directory(tmp_path: Path):
    for seed in range(5):
        env = seedbed.RecordVisitation(gymnasium.make("CartPole-v1"), f"others/seed-{seed}")
        env.reset(seed=seed)
        env.action_space.seed(seed)
        ended = 0
        while ended < 6:
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                ended += 1
                env.reset()
        env.close()
    cells = [{"name": "random", "results": 'Runs("others/seed-*")'}]
    found = seedbed.study({"title": "Others", "cells": cells, "repeats": 5, "measures": ["FinalReturn(window: 4)"]})
    assert len(found.results) == 5


def test_coverage_on_different_axes_is_not_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Both cells have the same episodes, and other ranges; without ranges, the axes are those of each run."""
    monkeypatch.chdir(tmp_path)
    wide = {"observation_0": (-9, 9), "observation_1": (-9, 9), "observation_2": (-9, 9), "observation_3": (-9, 9)}
    for name, ranges in {"wide": wide, "tight": {**wide, "observation_3": (-1, 1)}, "none": None}.items():
        for seed in range(2):
            folder = Path(f"{name}-{seed}")
            with seedbed.RecordVisitation(gymnasium.make("CartPole-v1"), folder, ranges=ranges, keep_unfinished=False) as environment:
                environment.reset(seed=seed)
                for _ in range(60):
                    _, _, terminated, truncated, _ = environment.step(1)
                    if terminated or truncated:
                        environment.reset()
            subprocess.run([seedbed.command(), "export", folder, "--to", folder / "rounds.csv", "--content", "rounds"], check=True)

    def study(one: str, other: str) -> None:
        claim = {"text": "more", "measure": "Coverage", "compare": (one, other), "direction": "More", "smallest": 0.01}
        cells = [{"name": name, "results": f'Runs("{name}-*")'} for name in (one, other)]
        seedbed.study({"title": "x", "cells": cells, "measures": ["Coverage"], "claims": [claim]})

    with pytest.raises(seedbed.InputError, match=r"`wide` and `tight` are counted on other axes: `observation_3` is -9 to 9, and -1 to 1"):
        study("wide", "tight")
    with pytest.raises(seedbed.InputError, match="axes that end at the extremes of this run; expected recordings with `ranges`"):
        study("none", "wide")
