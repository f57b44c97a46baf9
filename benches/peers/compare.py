#!/usr/bin/env python3
"""Compares the speed of the workbench with other libraries, on one core, and prints a table of ratios.

    benches/peers/compare.py                  all lines, about ten minutes after the first installation
    benches/peers/compare.py cartpole update  only lines whose name contains one of the words
    benches/peers/compare.py --rounds 9       more repetitions

Each peer runs in a virtual environment of its own, which is made at the first use in --environments. For each line the
workbench and the peer run in turn. The table shows the median of the speeds, and the median, minimum and maximum of
the ratios of neighbouring runs: larger than 1 is in favor of the workbench. Leave the machine alone meanwhile.
"""

import argparse
import json
import re
import statistics
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
PACKAGES = {
    "mujoco": ["mujoco==4.0.0", "gymnasium==1.4.0"],
    "gymnasium": ["gymnasium==1.4.0"],
    "jax": ["jax==0.10.2"],
}


class Line:
    """One comparison.

    `bench` and `benchmark` name a benchmark of the repository, `units` its work per iteration. `without` names a
    benchmark whose time is subtracted.
    """

    def __init__(self, name, unit, bench, benchmark, units, environment, *command, without=None):
        self.name, self.unit = name, unit
        self.bench, self.benchmark, self.units, self.without = bench, benchmark, units, without
        self.environment, self.command = environment, command


def lines():
    for copies in (1, 16, 64, 1024):
        yield Line(
            f"rigid cart-pole, M = {copies}", "steps", "environment", f"cartpole/rapier/{copies}", copies,
            "mujoco", "mujoco_rollout.py", str(HERE / "cartpole.xml"), str(copies),
        )
    for task, model, substeps in (("cheetah", "half_cheetah", 5), ("hopper", "hopper", 4)):
        yield Line(
            f"{task}, M = 16", "steps", "environment", f"tasks/{task}/rapier", 16,
            "mujoco", "mujoco_rollout.py", f"gymnasium:{model}.xml", "16", "--substeps", str(substeps),
        )
    for copies in (16, 64, 1024):
        yield Line(
            f"closed-form cart-pole, M = {copies}", "steps", "environment", f"cartpole/analytic/{copies}", copies,
            "gymnasium", "gymnasium_vector.py", str(copies),
        )
    yield Line(
        "update of one agent of 16", "transitions", "learning",
        "update/one agent of 16, a round of 16 × 200 steps", 3200, "jax", "jax_learning.py", "update",
    )
    yield Line(
        "ensemble of 30, minibatches of 16", "gradient steps", "value",
        "seed ensemble of 100/acting and learning, a round", 300 * 30, "jax", "jax_learning.py", "ensemble",
        without="seed ensemble of 100/acting, a round",
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="compare only lines whose name contains one of these")
    parser.add_argument("--rounds", type=int, default=5, help="repetitions of each line (default: 5)")
    parser.add_argument("--seconds", type=float, default=2.0, help="length of a measurement (default: 2)")
    parser.add_argument(
        "--environments", type=Path, default=Path.home() / ".cache/seedbed/peers",
        help="folder of the virtual environments (default: ~/.cache/seedbed/peers)",
    )
    arguments = parser.parse_args()
    chosen = [
        line for line in lines()
        if not arguments.words or any(word in line.name for word in arguments.words)
    ]
    if not chosen:
        sys.exit("no line has such a name; names: " + "; ".join(line.name for line in lines()))
    benches = build_benches(sorted({line.bench for line in chosen}))
    print("| Work | workbench, per second | peer, per second | ratio | range |")
    print("|---|---|---|---|---|", flush=True)
    for line in chosen:
        python = environment(arguments.environments, line.environment)
        pairs = [
            (measure(benches[line.bench], line, arguments.seconds), measure_peer(python, line, arguments.seconds))
            for _ in range(arguments.rounds)
        ]
        print(row(line, pairs), flush=True)


def build_benches(names):
    """Paths of the built benchmarks."""
    command = ["cargo", "bench", "--no-run", "--message-format=json"]
    command += [argument for name in names for argument in ("--bench", name)]
    output = subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = (json.loads(line) for line in output.splitlines())
    return {
        message["target"]["name"]: message["executable"]
        for message in messages
        if message.get("executable") and "bench" in message["target"]["kind"]
    }


def environment(folder, name):
    """The Python of a virtual environment, which is made if it is not there."""
    folder = folder / name
    python = folder / "bin/python"
    if not (folder / "complete").exists():
        venv.create(folder, with_pip=True, clear=True)
        command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PACKAGES[name]]
        subprocess.run(command, check=True)
        (folder / "complete").touch()
    return python


def measure(executable, line, seconds):
    """Units per second of the workbench."""
    time = nanoseconds(executable, line.benchmark, seconds)
    if line.without:
        time -= nanoseconds(executable, line.without, seconds)
    return line.units / (time * 1e-9)


def nanoseconds(executable, benchmark, seconds):
    """Median time of one iteration of a benchmark."""
    command = [executable, "--bench", "--noplot", "--warm-up-time", "0.5", "--measurement-time", str(seconds)]
    command += ["--output-format", "bencher", "--exact", benchmark]
    output = subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.PIPE, text=True).stdout
    found = re.search(r"bench:\s+([\d,]+) ns/iter", output)
    if not found:
        sys.exit(f"no benchmark `{benchmark}` in {executable}:\n{output}")
    return float(found[1].replace(",", ""))


def measure_peer(python, line, seconds):
    """Units per second of CPU time of the peer."""
    script, *rest = line.command
    command = [python, HERE / script, *rest, "--seconds", str(seconds)]
    output = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    result = json.loads(output)
    return result["units"] / result["cpu_seconds"]


def row(line, pairs):
    ours = statistics.median(ours for ours, _ in pairs)
    peer = statistics.median(peer for _, peer in pairs)
    ratios = sorted(ours / peer for ours, peer in pairs)
    shown = f"{statistics.median(ratios):.2f} | {ratios[0]:.2f} to {ratios[-1]:.2f}"
    return f"| {line.name} ({line.unit}) | {rounded(ours)} | {rounded(peer)} | {shown} |"


def rounded(number):
    """Three significant digits, such as `1.61 M`."""
    for factor, suffix in ((1e6, " M"), (1e3, " k"), (1, "")):
        if number >= factor:
            return f"{number / factor:.3g}{suffix}"
    return f"{number:.3g}"


if __name__ == "__main__":
    main()
