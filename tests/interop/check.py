"""Opens the recording of a finished run with Rerun's own tools, and compares it with `episodes.csv` of the run.

    check.py RUN     RUN is the output folder of `seedbed run`

Run by tests/interop/run, which installs the Rerun SDK.
"""

import csv
import pathlib
import subprocess
import sys

import rerun as rr


def main(run_folder: pathlib.Path) -> None:
    recording = run_folder / "run.rrd"
    subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", str(recording)], check=True)
    with (run_folder / "episodes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    agents = sorted({int(row["agent"]) for row in rows})
    with rr.server.Server(datasets={"run": [str(recording)]}) as server:
        dataset = server.client().get_dataset("run")
        states = sum(compare_episodes(dataset, agent, [row for row in rows if int(row["agent"]) == agent]) for agent in agents)
        returns = sum(compare_returns(dataset, agent, [row for row in rows if int(row["agent"]) == agent]) for agent in agents)
    print(f"rerun-sdk {rr.__version__}: {len(agents)} agents, {len(rows)} episodes, {states} states, {returns} returns: the recording agrees with episodes.csv")


def column(table, name: str) -> list:
    """One value per row, or None: each cell of the table is a list of at most one value."""
    return [cell[0] if cell else None for cell in table.column(name).to_pylist()]


def compare_episodes(dataset, agent: int, expected: list[dict]) -> int:
    """Compares length, return and outcome of each episode of an agent with its row of `episodes.csv`. Returns the number of recorded states."""
    entity = f"/raw/agent_{agent}"
    table = dataset.filter_contents([entity]).reader(index="env_step").to_arrow_table().sort_by("env_step")
    steps = table.column("env_step").to_pylist()
    assert steps == list(range(len(steps))), f"{entity}: steps have gaps"
    episodes = table.column("episode").to_pylist()
    rewards, outcomes = column(table, f"{entity}:State:reward"), column(table, f"{entity}:State:outcome")
    first = 0
    for row in expected:
        last = first + int(row["length"])
        place = f"{entity}, episode {row['episode']}"
        assert set(episodes[first : last + 1]) == {int(row["episode"])}, f"{place}: {int(row['length']) + 1} rows expected"
        assert outcomes[first:last] == [None] * (last - first), f"{place}: an outcome before the last state"
        assert outcomes[last] == row["outcome"], f"{place}: {outcomes[last]}, expected {row['outcome']}"
        assert rewards[last] is None, f"{place}: a reward in the last state"
        total = sum(rewards[first:last])
        assert abs(total - float(row["return"])) <= 1e-9 * max(1.0, abs(total)), f"{place}: return {total}, expected {row['return']}"
        first = last + 1
    assert first == len(steps), f"{entity}: {len(steps)} rows, expected {first}"
    return len(steps)


def compare_returns(dataset, agent: int, expected: list[dict]) -> int:
    """Compares the curve of an agent's returns with `episodes.csv`. Returns the number of values."""
    entity = f"/curves/return/agent_{agent}"
    table = dataset.filter_contents([entity]).reader(index="episode").to_arrow_table().sort_by("episode")
    returns = [value for value in column(table, f"{entity}:Scalars:scalars") if value is not None]
    assert returns == [float(row["return"]) for row in expected], f"{entity}: not the returns of episodes.csv"
    return len(returns)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
