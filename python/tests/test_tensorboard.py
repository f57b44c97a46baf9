"""Curves that are written during training are what TensorBoard's own reader says: also those of runs that were resumed."""

from __future__ import annotations

import subprocess
from collections import defaultdict
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import seedbed

Curves = dict[str, list[tuple[int, float]]]


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: object, status: int = 0) -> str:
    line = [seedbed.command(), "run", "cartpole", "--set=agents.count=3", "--quiet", *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done.stderr


def curves(folder: Path) -> Curves:
    """All values of a directory, as TensorBoard shows them."""
    events = EventAccumulator(str(folder), size_guidance={"scalars": 0})
    events.Reload()
    return {tag: [(event.step, event.value) for event in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


@pytest.fixture
def expected(tmp_path: Path) -> dict[str, Curves]:
    """The curves of a run of 12 episodes without an interruption, from its tables."""
    run("--set=stop=Episodes(12)", "--out", "whole")
    found = seedbed.load("whole", frames="pandas")
    expected: dict[str, Curves] = {name: defaultdict(list) for name in ("team", "agent_0", "agent_1", "agent_2")}
    for number, rows in found.episodes.groupby("round"):
        steps = rows["env_steps"].max()
        expected["team"]["return"].append((steps, rows["return"].mean()))
        for row in rows.itertuples():
            expected[f"agent_{row.agent}"]["return"].append((row.env_steps, row[found.episodes.columns.get_loc("return") + 1]))
        for row in found.rounds[found.rounds["round"] == number].itertuples():
            expected[f"agent_{row.agent}"]["entropy"].append((steps, row.entropy))
            if row.agent == 0:
                expected["team"]["effective_agents"].append((steps, row.effective_agents))
    return expected


def check(folder: Path, expected: dict[str, Curves]) -> None:
    assert sorted(path.name for path in folder.iterdir()) == sorted(expected)
    for name, tags in expected.items():
        found = curves(folder / name)
        for tag, points in tags.items():
            assert [step for step, _ in found[tag]] == [step for step, _ in points], (name, tag)
            assert [value for _, value in found[tag]] == pytest.approx([value for _, value in points], rel=1e-6), (name, tag)
    # What is the same for all agents is a curve of the team alone.
    assert "effective_agents" not in curves(folder / "agent_0") and "entropy" in curves(folder / "team")


def test_the_values_are_those_of_the_tables(expected: dict[str, Curves]):
    run("--set=stop=Episodes(12)", "--out", "live", "--tensorboard", "logs/one")
    check(Path("logs/one"), expected)
    # A new run replaces the curves.
    run("--set=stop=Episodes(12)", "--out", "live", "--tensorboard", "logs/one", "--overwrite", "--threads", 1)
    check(Path("logs/one"), expected)
    assert len(list(Path("logs/one/team").iterdir())) == 1


def test_resumed_runs_have_one_curve(expected: dict[str, Curves]):
    """An interruption by the driving program, and a crash after events that are newer than the checkpoint."""
    options = ["--set=stop=Episodes(12)", "--set=checkpoint_every=100", "--out", "part", "--tensorboard", "logs"]
    line = [seedbed.command(), "run", "cartpole", "--set=agents.count=3", "--quiet", *options, "--ask-after-rounds"]
    subprocess.run(line, input="continue\n" * 4, capture_output=True, text=True)
    assert len(curves(Path("logs/team"))["return"]) == 5
    run(*options, "--resume", "--abort-after-rounds", 3, status=-6)
    subprocess.run([*line, "--resume"], input="continue\n" * 2, capture_output=True, text=True)
    run(*options, "--resume")
    check(Path("logs"), expected)
    assert len(list(Path("logs/team").iterdir())) >= 3


def test_runs_of_studies_have_curves_too(expected: dict[str, Curves]):
    """Runs of a small team are made together, and interrupted ones are continued."""
    Path("one.ron").write_text(
        'Study(title: "One", scenario: "cartpole", set: ["agents.count=3", "stop=Episodes(12)"], first_seed: 0, repeats: 2,'
        ' measures: [Coverage], cells: [(name: "a pole")])'
    )
    seedbed.study("one.ron", tensorboard="logs", jobs=1)
    check(Path("logs/a pole/seed-0"), expected)
    assert len(curves(Path("logs/a pole/seed-1/team"))["return"]) == 12


def test_values_behind_the_checkpoint_are_void(expected: dict[str, Curves]):
    """The folder of a run as it was after 5 rounds, with curves of 9 rounds."""
    import shutil

    options = ["--set=stop=Episodes(12)", "--out", "part", "--tensorboard", "logs"]
    line = [seedbed.command(), "run", "cartpole", "--set=agents.count=3", "--quiet", *options, "--ask-after-rounds"]
    subprocess.run(line, input="continue\n" * 4, capture_output=True, text=True)
    shutil.copytree("part", "earlier")
    subprocess.run([*line, "--resume"], input="continue\n" * 3, capture_output=True, text=True)
    assert len(curves(Path("logs/team"))["return"]) == 9
    shutil.rmtree("part")
    Path("earlier").rename("part")
    run(*options, "--resume")
    check(Path("logs"), expected)


def test_from_python():
    seedbed.train("cartpole", agents=2, set=["stop=Episodes(5)"], tensorboard="logs", on_round=lambda state: state.round < 3)
    assert len(curves(Path("logs/team"))["return"]) == 3


def test_tabular_runs_have_returns():
    line = [seedbed.command(), "run", "tabular/deep_sea", "--set=episodes=3", "--set=agents.count=2", "--quiet"]
    subprocess.run([*line, "--out", "run", "--tensorboard", "logs"], check=True)
    assert len(curves(Path("logs/agent_1"))["return"]) == 3 and len(curves(Path("logs/team"))["return"]) == 6


def test_event_files_of_others_are_refused():
    Path("logs/team").mkdir(parents=True)
    Path("logs/team/events.out.tfevents.1700000000.host").write_text("")
    assert "is of another program" in run("--tensorboard", "logs", status=1)


def test_curves_that_cannot_be_written_do_not_end_the_run(capsys: pytest.CaptureFixture[str]):
    def replace_folder(state: seedbed.RunState) -> None:
        if state.round == 1:
            Path("logs").rmdir()
            Path("logs").write_text("no folder")

    trained = seedbed.train("cartpole", agents=2, set=["stop=Episodes(3)"], tensorboard="logs", on_round=replace_folder)
    message = capsys.readouterr().err
    assert "the run continues without curves" in message and message.count("warning") == 1
    assert trained.state == "finished"
