#!/usr/bin/env python3
"""Long and large runs: is memory flat, is the time per round flat, what do checkpoints take?

    cargo build --release
    benches/long_runs.py                    all three, about ten minutes on two cores
    benches/long_runs.py states             a run of ten million states, recorded (55 hours of simulated time)
    benches/long_runs.py agents             10,000 agents in one recorded run
    benches/long_runs.py study              a study of 10,000 runs, and its report

Needs Linux (memory is read from /proc) and 3 GB of disk. Nothing is kept.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM = Path(__file__).resolve().parent.parent / "target/release/seedbed"

STUDY = """
Study(
    title: "10,000 short runs",
    scenario: "cartpole_1",
    set: ["stop=Episodes(20)"],
    grid: [(set: ["algorithm.entropy_bonus={}"], values: ["0.0", "0.001", "0.002", "0.003", "0.005", "0.01", "0.02", "0.03", "0.05", "0.1"])],
    repeats: 1000,
    measures: [FinalReturn()],
)
"""


class Watched:
    """A command whose memory and progress are noted until it ends."""

    def __init__(self, arguments, progress):
        self.samples = []
        start = time.monotonic()
        process = subprocess.Popen([PROGRAM, *arguments], stdout=subprocess.DEVNULL)
        while process.poll() is None:
            self.samples.append((time.monotonic() - start, progress(), memory(process.pid)))
            time.sleep(0.25)
        if process.returncode != 0:
            sys.exit(f"{arguments}: exit status {process.returncode}")
        self.seconds = time.monotonic() - start

    def print_quarters(self, what):
        """Duration of each quarter of the progress, and memory at its end."""
        last = max(done for _, done, _ in self.samples)
        begin = 0.0
        for quarter in range(1, 5):
            time_, _, megabytes = next(sample for sample in self.samples if sample[1] >= quarter / 4 * last)
            print(f"  {25 * quarter:>3} % of {last} {what}: {time_ - begin:6.1f} s, {megabytes:.0f} MB")
            begin = time_


def memory(pid):
    """Resident memory of a process in MB; 0 if it just ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    values = [line.split()[1] for line in lines if line.startswith("VmRSS:")]
    return int(values[0]) / 1024 if values else 0.0


def lines_in(path):
    """Number of lines of a growing file."""
    try:
        return path.read_bytes().count(b"\n")
    except OSError:
        return 0


def states(folder):
    """A run of ten million states."""
    arguments = ["run", "cartpole_16", "--quiet", "--set", "stop=Episodes(3400)"]
    for name, extra in [("default checkpoints", []), ("no checkpoints", ["--set", "checkpoint_every=1000000"])]:
        out = folder / name.replace(" ", "_")
        run = Watched([*arguments, "--out", out, *extra], lambda: lines_in(out / "rounds.csv"))
        count = sum(int(line.split(",")[5]) + 1 for line in (out / "episodes.csv").read_text().splitlines()[1:])
        size = (out / "run.rrd").stat().st_size
        print(f"{name}: {count:,} states in {run.seconds:.1f} s, recording {size / count:.1f} bytes a state")
        run.print_quarters("rows of rounds.csv")


def agents(folder):
    """10,000 agents in one run."""
    out = folder / "agents"
    arguments = ["run", "cartpole", "--quiet", "--set", "agents.count=10000", "--set", "stop=Episodes(3)",
                 "--set", "algorithm.sharing=Sampled(trajectories: 15)", "--out", out]
    run = Watched(arguments, lambda: lines_in(out / "rounds.csv"))
    peak = max(megabytes for _, _, megabytes in run.samples)
    size = (out / "run.rrd").stat().st_size
    print(f"10,000 agents, three episodes each: {run.seconds:.1f} s, at most {peak:.0f} MB, recording {size / 1e6:.0f} MB")


def study(folder):
    """A study of 10,000 runs."""
    file, out = folder / "large.ron", folder / "large"
    file.write_text(STUDY)
    runs = out / "runs"
    run = Watched(["study", file, "--out", out], lambda: sum(1 for _ in runs.iterdir()) if runs.is_dir() else 0)
    print(f"a study of 10,000 runs: {run.seconds:.1f} s")
    run.print_quarters("stored runs")
    again = Watched(["report", out], lambda: 0)
    peak = max(megabytes for _, _, megabytes in again.samples)
    print(f"its report: {again.seconds:.1f} s, at most {peak:.0f} MB")


def main():
    tasks = {"states": states, "agents": agents, "study": study}
    if {"-h", "--help"} & set(sys.argv):
        print(__doc__)
        return
    for name in sys.argv[1:] or tasks:
        if name not in tasks:
            sys.exit(f"unknown part {name}: expected one of {', '.join(tasks)}")
        with tempfile.TemporaryDirectory() as folder:
            tasks[name](Path(folder))


if __name__ == "__main__":
    main()
