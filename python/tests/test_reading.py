"""Runs are read as they are: values equal those of the files, and damage is an error."""

from __future__ import annotations

import csv
import json
import os
import pickle
import shutil
import subprocess
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas
import polars
import pyarrow
import pytest
from conftest import REPOSITORY, Train

import seedbed
from seedbed import exports


@pytest.fixture
def run_copy(cartpole_run: Path, tmp_path: Path) -> Path:
    """A copy of a run, which a test may change."""
    return Path(shutil.copytree(cartpole_run, tmp_path / "copy"))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def as_numbers(table: list[dict[str, str]], column: str) -> np.ndarray:
    return np.array([float(row[column] or "nan") for row in table])


@pytest.mark.parametrize("frames", ["polars", "pandas", "arrow"])
def test_tables_are_those_of_the_files(cartpole_run: Path, frames: Any):
    run = seedbed.load(cartpole_run, frames=frames)
    kind = {"polars": polars.DataFrame, "pandas": pandas.DataFrame, "arrow": pyarrow.Table}[frames]
    for name in ("episodes", "rounds"):
        table, expected = getattr(run, name), rows(cartpole_run / f"{name}.csv")
        assert isinstance(table, kind)
        columns = table.column_names if frames == "arrow" else list(table.columns)
        assert columns == list(expected[0])
        for column in set(columns) - {"outcome"}:
            np.testing.assert_allclose(np.array(table[column], float), as_numbers(expected, column), rtol=1e-6)
    outcomes = run.episodes["outcome"]
    assert list(outcomes.to_pylist() if frames == "arrow" else outcomes) == [
        row["outcome"] for row in rows(cartpole_run / "episodes.csv")
    ]


def test_states_have_the_lengths_and_returns_of_their_episodes(cartpole_run: Path):
    run = seedbed.load(cartpole_run)
    assert isinstance(run.states, polars.DataFrame), "polars is the default"
    sums = run.states.group_by("agent", "episode").agg(
        polars.col("reward").sum().alias("return"), polars.col("step").max().alias("length"), polars.len().alias("rows")
    )
    joined = sums.join(run.episodes, on=["agent", "episode"], suffix="_expected", validate="1:1")
    assert len(joined) == len(run.episodes) == len(sums) == 800
    assert (joined["return"] - joined["return_expected"]).abs().max() < 1e-3
    assert (joined["length"] == joined["length_expected"]).all()
    assert (joined["rows"] == joined["length"] + 1).all()
    assert run.states["force"].null_count() == 800, "the last state of an episode has no action"
    assert set(run.states["force"].drop_nulls().unique()) == {-10.0, 10.0}


def test_some_columns_and_another_library(cartpole_run: Path):
    run = seedbed.load(cartpole_run)
    some = run.table("states", ["theta", "agent"], frames="pandas")
    assert isinstance(some, pandas.DataFrame) and set(some.columns) == {"theta", "agent"}
    assert np.array_equal(some["theta"].to_numpy(), run.states["theta"].to_numpy())
    assert polars.scan_parquet(run.parquet("states")).select(polars.len()).collect().item() == len(run.states)
    with pytest.raises(ValueError, match="content is 'visits'"):
        run.parquet("visits")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="frames is 'dask', expected 'polars'"):
        seedbed.load(cartpole_run, frames="dask")  # type: ignore[arg-type]


def test_results_and_texts(cartpole_run: Path):
    run = seedbed.load(cartpole_run)
    assert run.summary == json.loads((cartpole_run / "summary.json").read_text())
    assert run.scenario == (cartpole_run / "scenario.ron").read_text()
    assert (run.name, run.agents, run.state) == ("cartpole, run seed 0", 4, "finished")
    assert run.task.name == "cartpole" and seedbed.make(run.task).action_space.n == 2
    assert repr(run) == f"<seedbed run 'cartpole, run seed 0' in {cartpole_run}>"


def test_a_run_is_found_from_everywhere_in_it(cartpole_run: Path):
    for path in (cartpole_run, cartpole_run / "run.rrd", cartpole_run.parent, str(cartpole_run)):
        assert seedbed.load(path).path == cartpole_run
    alone = seedbed.load(REPOSITORY / "recordings/sample/run.rrd")
    assert len(alone.states) > 0 and alone.name == "run.rrd"
    with pytest.raises(seedbed.RunError, match="without its folder has no episodes.csv"):
        _ = alone.episodes
    with pytest.raises(seedbed.RunError, match="without the folder of its run has no summary"):
        _ = alone.summary
    assert "a recording without its folder" in alone._repr_html_()


def test_folders_without_a_single_run(cartpole_run: Path, tmp_path: Path):
    with pytest.raises(FileNotFoundError, match="there is no file or folder .*nowhere"):
        seedbed.load(tmp_path / "nowhere")
    with pytest.raises(seedbed.RunError, match="it contains no run"):
        seedbed.load(tmp_path)
    for name in ("a", "b"):
        shutil.copytree(cartpole_run, tmp_path / name)
    with pytest.raises(seedbed.RunError, match="it contains 2 runs: load one of them, such as .*/[ab]"):
        seedbed.load(tmp_path)


def test_runs_are_listed(cartpole_run: Path, run_copy: Path, tmp_path: Path):
    shutil.copytree(cartpole_run, tmp_path / "unfinished")
    (tmp_path / "unfinished/summary.json").unlink()
    shutil.copytree(cartpole_run, tmp_path / "broken")
    (tmp_path / "broken/summary.json").write_text("{")
    frame = seedbed.runs(tmp_path)
    assert isinstance(frame, polars.DataFrame)
    by_name = {Path(row["path"]).name: row for row in frame.to_dicts()}
    assert {name: row["state"] for name, row in by_name.items()} == {
        "copy": "finished",
        "unfinished": "unfinished",
        "broken": "unreadable",
    }
    summary = json.loads((cartpole_run / "summary.json").read_text())
    finished = by_name["copy"]
    for column in ("scenario", "seed", "agents", "env_steps", "final_return", "team_coverage"):
        assert finished[column] == summary[column], column
    assert (finished["solved_at_return"], finished["solved_at_window"]) == (195.0, 25)
    assert abs(datetime.now(timezone.utc) - finished["written"]) < timedelta(days=1)
    assert "summary.json" in by_name["broken"]["error"] and by_name["broken"]["agents"] is None
    assert list(seedbed.runs(tmp_path, frames="pandas").columns) == frame.columns
    (tmp_path / "empty").mkdir()
    assert seedbed.runs(tmp_path / "empty").schema == frame.schema
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        seedbed.runs(tmp_path / "nowhere")


def as_of_a_run_in_progress(run: Path) -> None:
    """Removes the summary, the checksums and the checkpoint, which say what was written."""
    for name in ("summary.json", "SHA256SUMS"):
        (run / name).unlink()
    shutil.rmtree(run / "checkpoint")


def test_a_run_in_progress_is_read_as_far_as_it_is_written(run_copy: Path):
    complete = seedbed.load(run_copy)
    states, episodes = len(complete.states), len(complete.episodes)
    as_of_a_run_in_progress(run_copy)
    (run_copy / "policies.safetensors").unlink()
    content = (run_copy / "run.rrd").read_bytes()
    (run_copy / "run.rrd").unlink()
    (run_copy / "run.rrd.part").write_bytes(content[: len(content) // 2])
    table = (run_copy / "episodes.csv").read_text().splitlines(keepends=True)
    (run_copy / "episodes.csv").write_text("".join(table[:101]) + table[101][:7])
    run = seedbed.load(run_copy)
    assert (run.state, run.name, run.agents) == ("unfinished", "cartpole, run seed 0", 4)
    assert 0 < len(run.states) < states
    assert len(run.episodes) == 100, "an incomplete line is not read"
    with pytest.raises(seedbed.RunError, match=r"summary\.json: there is no such file: the run is in progress"):
        _ = run.summary
    with pytest.raises(seedbed.RunError, match="checkpoint"):
        run.policy(0)
    # It goes on, and the tables follow.
    (run_copy / "run.rrd.part").write_bytes(content)
    (run_copy / "episodes.csv").write_text("".join(table))
    assert (len(run.states), len(run.episodes)) == (states, episodes)


def damage_end(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])


def damage_middle(path: Path) -> None:
    content = path.read_bytes()
    middle = len(content) // 2
    path.write_bytes(content[:middle] + b"?" * 40 + content[middle + 40 :])


@pytest.mark.parametrize("damage", [damage_end, damage_middle, Path.unlink], ids=["end", "middle", "missing"])
@pytest.mark.parametrize(
    ("file", "table"), [("run.rrd", "states"), ("episodes.csv", "episodes"), ("rounds.csv", "rounds")]
)
def test_damaged_tables_of_a_finished_run_are_errors(run_copy: Path, file: str, table: str, damage: Any):
    damage(run_copy / file)
    with pytest.raises(seedbed.RunError, match=file) as caught:
        getattr(seedbed.load(run_copy), table)
    assert pickle.loads(pickle.dumps(caught.value)).args == caught.value.args


@pytest.mark.parametrize("last", [1, 3])
@pytest.mark.parametrize("table", ["episodes", "rounds"])
def test_a_finished_table_without_its_last_lines_is_an_error(run_copy: Path, table: str, last: int):
    (run_copy / "SHA256SUMS").unlink()  # as of an earlier version
    path = run_copy / f"{table}.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-last]))
    with pytest.raises(seedbed.RunError, match=rf"{table}\.csv: it has {800 - last} rows, expected 800"):
        getattr(seedbed.load(run_copy), table)


@pytest.mark.parametrize("text", ["{", "[]", "\xff"])
def test_a_damaged_summary_is_an_error(run_copy: Path, text: str):
    (run_copy / "summary.json").write_bytes(text.encode("latin-1"))
    run = seedbed.load(run_copy)
    with pytest.raises(seedbed.RunError, match=r"summary\.json: "):
        _ = run.summary
    with pytest.raises(seedbed.RunError, match=r"summary\.json: "):
        _ = run.states
    assert "summary.json" in run._repr_html_()


@pytest.mark.parametrize("file", ["summary.json", "scenario.ron", "policies.safetensors", "SHA256SUMS"])
def test_a_flipped_bit_is_an_error(run_copy: Path, file: str):
    content = bytearray((run_copy / file).read_bytes())
    for offset in range(0, len(content), len(content) // 20):
        damaged = bytearray(content)
        damaged[offset] ^= 1 << offset % 8
        (run_copy / file).write_bytes(damaged)
        run = seedbed.load(run_copy)
        with pytest.raises(seedbed.RunError, match=file):
            _ = run.summary, run.scenario, run.policy(0)


def test_a_changed_task_is_an_error(run_copy: Path):
    path = run_copy / "envs" / "cartpole.ron"
    text = path.read_text()
    path.write_text(text.replace("9.8", "1.8"))
    assert path.read_text() != text
    with pytest.raises(seedbed.RunError, match=r"cartpole\.ron: it is damaged"):
        _ = seedbed.load(run_copy).task


def test_a_run_that_was_moved_is_named(run_copy: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(run_copy.parent)
    run = seedbed.load(run_copy.name)
    monkeypatch.chdir("/")
    assert len(run.episodes) > 0, "the path does not depend on the working directory"
    run_copy.rename(run_copy.with_name("moved"))
    for name in ("states", "episodes", "summary", "scenario", "info"):
        with pytest.raises(seedbed.RunError, match="the run was moved or removed"):
            getattr(run, name)


def test_a_cut_table_in_the_cache_is_written_again(run_copy: Path):
    run = seedbed.load(run_copy)
    path = run.parquet("episodes")
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    assert len(run.episodes) > 0 and path.read_bytes() == whole
    path.write_bytes(b"")
    assert run.parquet("episodes") == path and path.read_bytes() == whole


def test_a_version_that_was_just_asked_for_stays(run_copy: Path):
    """Another process may still open it."""
    run = seedbed.load(run_copy)
    first = run.parquet("episodes")
    os.utime(first, (0, 0))
    assert run.parquet("episodes") == first
    os.utime(run_copy / "episodes.csv")
    second = run.parquet("episodes")
    assert second != first and first.exists()


@pytest.mark.parametrize("is_file", [True, False])
def test_a_cache_folder_that_cannot_be_written_is_named(run_copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_file: bool):
    folder = tmp_path / "cache" if is_file else Path("/proc/cache")
    if is_file:
        folder.write_text("")
    monkeypatch.setenv("SEEDBED_CACHE", str(folder))
    with pytest.raises(seedbed.RunError, match="cannot be written to this cache folder .* SEEDBED_CACHE"):
        _ = seedbed.load(run_copy).episodes


def test_tables_are_exported_once_and_again_after_a_change(
    run_copy: Path, cache_folder: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("seedbed.exports.KEPT_SECONDS", -1)
    run = seedbed.load(run_copy)
    first = run.parquet("episodes")
    written = first.stat().st_mtime_ns
    assert first.is_relative_to(cache_folder)
    assert run.episodes is run.episodes, "the frame stays in memory"
    assert seedbed.load(run_copy).parquet("episodes") == first and first.stat().st_mtime_ns == written
    path = run_copy / "episodes.csv"
    lines = path.read_text().splitlines(keepends=True)
    (run_copy / "SHA256SUMS").unlink()
    path.write_text(lines[0] + lines[1].replace(",terminated,", ",truncated,") + "".join(lines[2:]))
    assert lines[1].count("terminated") == 1
    assert run.episodes["outcome"][0] == "truncated"
    assert not first.exists(), "outdated files are removed"
    second = run.parquet("episodes")
    shutil.rmtree(run_copy)
    other = run_copy.parent / "other"
    shutil.copytree(REPOSITORY / "recordings/sample", other)
    seedbed.load(other / "run.rrd").parquet("states")
    assert not second.exists(), "files of runs that are gone are removed"


def test_another_program_reads_again(run_copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    run = seedbed.load(run_copy)
    first = run.parquet("episodes")
    program = tmp_path / "link"
    os.symlink(seedbed.command(), program)
    monkeypatch.setenv("SEEDBED_PROGRAM", str(program))
    assert run.parquet("episodes") == first, "the same program"
    changed = shutil.copy(program, tmp_path / "changed")
    monkeypatch.setenv("SEEDBED_PROGRAM", str(changed))
    assert run.parquet("episodes") != first


def test_a_recorded_run_in_progress_has_all_episodes_that_are_written(tmp_path: Path):
    """The tables of an agent that Python records are written at its end; its states are written before."""
    folder = tmp_path / "run"
    environment = seedbed.RecordVisitation(gymnasium.make("CartPole-v1"), folder)
    environment.reset(seed=0)
    counts = []
    for _ in range(3):
        for _ in range(400):
            *_, terminated, truncated, _ = environment.step(environment.action_space.sample())
            if terminated or truncated:
                environment.reset()
        exported = tmp_path / "episodes.csv"
        subprocess.run([seedbed.command(), "export", folder, "--content", "episodes", "--to", exported], check=True)
        counts.append(len(exported.read_text().splitlines()) - 1)
        run = seedbed.load(folder)
        assert len(run.episodes) == counts[-1] == run.states["episode"].n_unique()
    assert 0 < counts[0] < counts[1] < counts[2]
    environment.close()
    assert len(seedbed.load(folder).episodes) >= counts[-1]


def test_a_damaged_recording_does_not_block_tables(run_copy: Path):
    path = run_copy / "run.rrd"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    run = seedbed.load(run_copy)
    assert len(run.episodes) == run.summary["agents"] * run.summary["episodes_per_agent"]
    assert len(run.rounds) > 0
    with pytest.raises(seedbed.RunError, match=r"run\.rrd: "):
        _ = run.states


@pytest.mark.parametrize(
    ("environment", "file"),
    [
        ("mine.ron", "mine.ron"),
        ("sub/mine.ron", "sub/mine.ron"),
        ("../mine.ron", "../mine.ron"),
        ("HOME/mine.ron", "mine.ron"),
        ("mine", "envs/mine.ron"),
        ("deep/mine", "envs/deep/mine.ron"),
        ("mein Stab – 杆.ron", "mein Stab – 杆.ron"),
    ],
)
def test_a_run_is_read_wherever_its_folder_is(tmp_path: Path, environment: str, file: str):
    """The folder is moved and the task deleted, however the scenario named it; another has its name there."""
    home, moved = tmp_path / "home" / "project", tmp_path / "elsewhere" / "moved run"
    task = (home / file).resolve()
    task.parent.mkdir(parents=True)
    text = (REPOSITORY / "envs/cartpole.ron").read_text().replace("time_limit: 200", "time_limit: 7")
    task.write_text(text)
    scenario = home / "of_mine.ron"
    scenario.parent.mkdir(parents=True, exist_ok=True)
    name = environment.replace("HOME", str(home))
    scenario.write_text(f'Scenario(environment: "{name}", agents: (count: 2), stop: Episodes(2))')
    subprocess.run([seedbed.command(), "run", scenario, "--out", tmp_path / "run", "--quiet"], check=True)
    moved.parent.mkdir()
    shutil.move(tmp_path / "run", moved)
    shutil.rmtree(tmp_path / "home")
    (moved.parent / "envs").mkdir()
    (moved.parent / "envs" / task.name).write_text(text.replace("time_limit: 7", "time_limit: 5"))
    run = seedbed.load(moved)
    assert run.name == "of_mine, run seed 0"
    assert run.task.name == task.stem and run.task.time_limit == 7
    assert run.episodes["length"].max() == 7
    assert len(run.states) == 4 * 8
    run.policy(0)
    (moved / "summary.json").unlink()
    assert seedbed.load(moved).name == "of_mine, run seed 0"


def test_runs_without_a_part(train: Train):
    run = seedbed.load(train("controls/random", "stop=Episodes(2)", options=("--no-recording",)))
    assert len(run.episodes) == 8
    with pytest.raises(seedbed.RunError, match=r"run\.rrd: there is no such file"):
        _ = run.states
    with pytest.raises(seedbed.RunError, match=r"run\.rrd: there is no such file: the run was not recorded"):
        run.to_html("page.html")
    with pytest.raises(seedbed.RunError, match="agents of the algorithm Random have no networks"):
        run.policy(0)
    tabular = seedbed.load(train("tabular/deep_sea", "episodes=3"))
    assert tabular.agents == 10 and tabular.summary["episodes_per_agent"] == 3
    assert len(tabular.states) == 330
    with pytest.raises(seedbed.RunError, match=r"episodes\.csv: there is no such file"):
        _ = tabular.episodes
    with pytest.raises(seedbed.RunError, match=r"policies\.safetensors: there is no such file"):
        tabular.policy(0)
    with pytest.raises(seedbed.RunError, match="no copy of its task"):
        _ = tabular.task


def test_missing_libraries_are_named(cartpole_run: Path, monkeypatch: pytest.MonkeyPatch):
    import importlib.util

    find = importlib.util.find_spec
    run = seedbed.load(cartpole_run)
    without = {"polars"}
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name in without else find(name, *rest))
    assert isinstance(run.episodes, pandas.DataFrame), "without polars it is pandas"
    without |= {"pyarrow"}
    with pytest.raises(ImportError, match="polars, or pandas and pyarrow"):
        _ = run.episodes
    with pytest.raises(ImportError, match="needs pyarrow: `pip install pyarrow`"):
        seedbed.load(cartpole_run, frames="arrow")


def test_the_overview_in_notebooks(cartpole_run: Path, run_copy: Path):
    html = seedbed.load(cartpole_run)._repr_html_()
    assert "cartpole, run seed 0" in html and "125,552" in html
    points = html.partition('points="')[2].partition('"')[0].split()
    team = np.array([float(row["return"]) for row in rows(cartpole_run / "episodes.csv")]).reshape(200, 4).mean(axis=1)
    heights = np.array([float(point.partition(",")[2]) for point in points])
    assert len(points) == 200 and heights.argmin() == team.argmax()
    np.testing.assert_allclose(heights, 78 - 76 * (team - team.min()) / np.ptp(team), atol=0.06)
    (run_copy / "episodes.csv").write_text("agent\n")
    assert "polyline" not in seedbed.load(run_copy)._repr_html_()


def test_the_page_of_visited_states(cartpole_run: Path, run_copy: Path, tmp_path: Path):
    page = seedbed.load(cartpole_run).explore(tmp_path / "page.html", states=1000)
    assert page.read_text().lstrip().lower().startswith("<!doctype html>")
    assert seedbed.load(run_copy).explore() == run_copy / "explore.html"
    assert (run_copy / "explore.html").stat().st_size > page.stat().st_size
    damage_middle(run_copy / "run.rrd")
    with pytest.raises(seedbed.RunError, match=r"run\.rrd"):
        seedbed.load(run_copy).explore()


def test_the_cache_folder_is_that_of_the_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.delenv("SEEDBED_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert exports.cache_folder() == tmp_path / "seedbed/tables"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert exports.cache_folder() == tmp_path / ".cache/seedbed/tables"


def test_the_command_of_the_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    program = seedbed.command()
    assert os.path.isabs(program)
    printed = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    assert printed.startswith("seedbed ")
    monkeypatch.setenv("SEEDBED_PROGRAM", str(tmp_path / "nothing"))
    with pytest.raises(FileNotFoundError, match="SEEDBED_PROGRAM is .*nothing, which is not a file"):
        seedbed.command()
    failing = tmp_path / "failing"
    failing.write_text("#!/bin/sh\nexit 3\n")
    failing.chmod(0o755)
    monkeypatch.setenv("SEEDBED_PROGRAM", str(failing))
    with pytest.raises(seedbed.RunError, match="`seedbed runs` ended with exit status 3"):
        seedbed.runs(tmp_path)


def test_lengths_of_figures_have_a_unit(cartpole_run: Path):
    with pytest.raises(TypeError, match='width is 8.4, expected a text with a unit, such as width="8.4cm"'):
        seedbed.load(cartpole_run).plot(width=8.4)  # type: ignore[arg-type]


def test_films_of_training_and_of_a_policy(run_copy: Path):
    run = seedbed.load(run_copy)
    film = run.film(seconds=0.5, fps=4, width=300)
    assert film == run_copy / "film.gif" and film.read_bytes().startswith(b"GIF8")
    assert list(film._repr_mimebundle_()) == ["image/gif", "text/plain"]
    policy = run.film(run_copy / "two.png", policy=1, actions="greedy", seconds=0.5, fps=4, width=300, scenes=1)
    assert policy.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(seedbed.InputError, match="expected a file that ends in .gif, .png or .mp4"):
        run.film(run_copy / "film.avi")


@pytest.mark.parametrize("frames", ["polars", "pandas"])
def test_columns_that_a_table_does_not_have(cartpole_run: Path, frames: str):
    with pytest.raises(ValueError, match="there is no column 'nope', expected some of agent, episode, round, step, x, x_dot"):
        seedbed.load(cartpole_run).table("states", ["agent", "nope"], frames=frames)  # type: ignore[arg-type]
