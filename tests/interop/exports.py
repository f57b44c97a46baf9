"""Exports a run and reads the files with the tools for which they are meant: NumPy, PyArrow and TensorBoard.

Usage: exports.py SEEDBED RUN
"""

import csv
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
import pyarrow.parquet
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator


def export(seedbed: str, run: Path, *arguments: str) -> None:
    subprocess.run([seedbed, "export", run, *arguments], check=True, stdout=subprocess.DEVNULL)


def read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    number = lambda cell: float(cell) if cell else np.nan
    values = {name: str if name == "outcome" else number for name in rows[0]}
    return {name: np.array([value(row[name]) for row in rows]) for name, value in values.items()}


def check_states(folder: Path, episodes: dict[str, np.ndarray]) -> None:
    """All formats have the same states, which have the outcomes of their episodes, and the rewards of each episode add up to its return."""
    arrays = np.load(folder / "states.npz")
    parquet = pyarrow.parquet.read_table(folder / "states.parquet")
    from_csv = read_csv(folder / "states.csv")
    assert list(arrays) == parquet.column_names == list(from_csv), list(arrays)
    outcomes = dict(zip(zip(episodes["agent"], episodes["episode"]), episodes["outcome"]))
    expected = [outcomes[key] for key in zip(arrays["agent"], arrays["episode"])]
    assert arrays["outcome"].tolist() == parquet["outcome"].to_pylist() == from_csv["outcome"].tolist() == expected
    for name in set(arrays) - {"outcome"}:
        column = parquet[name].to_numpy().astype(arrays[name].dtype)
        assert np.array_equal(arrays[name], column, equal_nan=arrays[name].dtype.kind == "f"), name
        assert np.array_equal(arrays[name], from_csv[name].astype(arrays[name].dtype), equal_nan=arrays[name].dtype.kind == "f"), name
    assert parquet["reward"].null_count == len(episodes["return"]), "the last state of each episode has no reward"
    keys = list(zip(arrays["agent"].tolist(), arrays["episode"].tolist(), arrays["step"].tolist()))
    assert keys == sorted(keys), "rows are sorted by agent, episode and step"
    units = json.loads(pyarrow.parquet.read_schema(folder / "states.parquet").metadata[b"units"])
    assert units and set(units) <= set(arrays), units
    assert len(arrays["step"]) == (episodes["length"] + 1).sum()
    returns: dict[tuple[int, int], float] = defaultdict(float)
    for agent, episode, reward in zip(arrays["agent"], arrays["episode"], arrays["reward"]):
        returns[int(agent), int(episode)] += 0.0 if np.isnan(reward) else float(reward)
    for agent, episode, expected in zip(episodes["agent"], episodes["episode"], episodes["return"]):
        assert abs(returns[int(agent), int(episode)] - expected) < 1e-3


def check_episodes(folder: Path, run: Path) -> None:
    """Tables have the columns of the CSV file, with types."""
    arrays = np.load(folder / "episodes.npz")
    parquet = pyarrow.parquet.read_table(folder / "episodes.parquet")
    with (run / "episodes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(arrays) == parquet.column_names == list(rows[0])
    assert arrays["outcome"].tolist() == parquet["outcome"].to_pylist() == [row["outcome"] for row in rows]
    assert arrays["agent"].dtype == np.int64 and str(parquet.schema.field("agent").type) == "int64"


def check_events(folder: Path, episodes: dict[str, np.ndarray], run: Path) -> None:
    """TensorBoard reads the returns of each agent, and all metrics of the last round."""
    agents = int(episodes["agent"].max()) + 1
    for agent in range(agents):
        events = EventAccumulator(str(folder / f"agent_{agent}"), size_guidance={"scalars": 0})
        events.Reload()
        scalars = events.Scalars("return")
        own = episodes["agent"] == agent
        assert [event.step for event in scalars] == episodes["episode"][own].astype(int).tolist()
        assert np.allclose([event.value for event in scalars], episodes["return"][own])
        rounds = read_csv(run / "rounds.csv")
        last = np.flatnonzero(rounds["agent"] == agent)[-1]
        for name, column in rounds.items():
            if name not in ("agent", "round") and not np.isnan(column[last]):
                assert np.isclose(events.Scalars(name)[-1].value, column[last], rtol=1e-5), name
    team = EventAccumulator(str(folder / "team"), size_guidance={"scalars": 0})
    team.Reload()
    means = [episodes["return"][episodes["episode"] == number].mean() for number in range(len(team.Scalars("return")))]
    assert np.allclose([event.value for event in team.Scalars("return")], means)


def main() -> None:
    seedbed, run = sys.argv[1], Path(sys.argv[2])
    episodes = read_csv(run / "episodes.csv")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for suffix in ("csv", "parquet", "npz"):
            export(seedbed, run, "--to", str(folder / f"states.{suffix}"))
            export(seedbed, run, "--to", str(folder / f"episodes.{suffix}"), "--content", "episodes")
        export(seedbed, run, "--tensorboard", str(folder / "logs"))
        check_states(folder, episodes)
        check_episodes(folder, run)
        check_events(folder / "logs", episodes, run)
    print("NumPy, PyArrow and TensorBoard read the exported run")


if __name__ == "__main__":
    main()
