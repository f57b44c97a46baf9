#!/usr/bin/env python3
"""Compares the speed of the workbench with other libraries, on one core, and prints a table of ratios.

    benches/peers/compare.py                  all lines, about 20 minutes after the first installation
    benches/peers/compare.py cartpole update  only lines whose name contains one of the words
    benches/peers/compare.py Python           the environments of the Python package
    benches/peers/compare.py --rounds 9       more repetitions

Each peer runs in a virtual environment of its own, which is made at the first use in --environments. For each line the
workbench and the peer run in turn, each on one thread. The table shows the median of the speeds, and the median, minimum and maximum of
the ratios of neighboring runs: larger than 1 is in favor of the workbench. Leave the machine alone meanwhile. A line that
cannot be measured says `failed`, with the reason on standard error; the others are measured, and the exit status is 1.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
PACKAGES = {
    # The models of these two only; dm_control 1.0.50 loads none of its tasks with this version of MuJoCo.
    "mujoco": ["mujoco==4.0.0", "gymnasium==1.4.0", "dm_control==1.0.50"],
    "gymnasium": ["gymnasium==1.4.0"],
    "jax": ["jax==0.10.2"],
    "sb3": ["stable-baselines3==2.9.2", "torch==2.15.0", "gymnasium==1.4.0"],
    "gymnasium-mujoco": ["mujoco==4.0.0", "gymnasium==1.4.0", "imageio==2.38.1", "packaging==26.3"],
    "envpool": ["envpool==1.2.5", "gymnasium==1.4.0"],
    "seedbed": ["maturin==1.16.0", "gymnasium==1.4.0"],
}


# Tasks beside MuJoCo: the model, and MuJoCo's time steps per control step.
MUJOCO_TASKS = (
    ("cheetah", "gymnasium:half_cheetah.xml", 5),
    ("hopper", "gymnasium:hopper.xml", 4),
    ("gym_inverted_pendulum", "gymnasium:inverted_pendulum.xml", 2),
    ("gym_inverted_double_pendulum", "gymnasium:inverted_double_pendulum.xml", 5),
    ("gym_reacher", "gymnasium:reacher.xml", 2),
    ("gym_swimmer", "gymnasium:swimmer.xml", 4),
    ("gym_hopper", "gymnasium:hopper.xml", 4),
    ("gym_walker2d", "gymnasium:walker2d_v5.xml", 4),
    ("gym_half_cheetah", "gymnasium:half_cheetah.xml", 5),
    ("dm_cartpole_swingup", "suite:cartpole.xml", 1),
    ("dm_acrobot_swingup", "suite:acrobot.xml", 1),
    ("dm_pendulum_swingup", "suite:pendulum.xml", 1),
    ("dm_point_mass_easy", "suite:point_mass.xml", 1),
    ("dm_reacher_easy", "suite:reacher.xml", 1),
    ("dm_ball_in_cup_catch", "suite:ball_in_cup.xml", 10),
    ("dm_finger_spin", "suite:finger.xml", 2),
    ("dm_hopper_hop", "suite:hopper.xml", 4),
    ("dm_walker_run", "suite:walker.xml", 10),
    ("dm_cheetah_run", "suite:cheetah.xml", 1),
)


class Line:
    """One comparison: what is measured, and the peer's script with its virtual environment."""

    def __init__(self, name, unit, workbench, environment, *command):
        self.name, self.unit, self.workbench = name, unit, workbench
        self.environment, self.command = environment, command


class Benchmark:
    """A benchmark of the repository, and its units of work per iteration.

    `without` names a benchmark whose time is subtracted.
    """

    def __init__(self, target, name, units, without=None):
        self.target, self.name, self.units, self.without = target, name, units, without

    def speed(self, programs, seconds, _):
        """Units per second."""
        duration = nanoseconds(programs[self.target], self.name, seconds)
        if self.without:
            duration -= nanoseconds(programs[self.target], self.without, seconds)
        return self.units / (duration * 1e-9)


class Training:
    """A run of a scenario in a process of its own: environment steps per second of CPU time."""

    target = "seedbed"

    def __init__(self, scenario, *overrides):
        self.scenario, self.overrides = scenario, overrides

    def speed(self, programs, _, repetition):
        command = [programs[self.target], "run", f"scenarios/{self.scenario}.ron", "--quiet", "--no-recording"]
        command += ["--threads", "1", "--seed", str(repetition)]
        command += [argument for override in self.overrides for argument in ("--set", override)]
        with tempfile.TemporaryDirectory() as folder:
            before = os.times()
            subprocess.run([*command, "--out", Path(folder, "run")], cwd=REPOSITORY, check=True)
            after = os.times()
            steps = json.loads(Path(folder, "run/summary.json").read_text())["env_steps"]
        return steps / (after.children_user + after.children_system - before.children_user - before.children_system)


class WholeRun:
    """A recorded run of a scenario, from the start of the process to its end: runs per second."""

    target = "seedbed"

    def __init__(self, scenario):
        self.scenario = scenario

    def speed(self, programs, _, repetition):
        command = [programs[self.target], "run", f"scenarios/{self.scenario}.ron", "--quiet"]
        with tempfile.TemporaryDirectory() as folder:
            return 1 / wall_seconds([*command, "--seed", str(1000 + repetition), "--out", Path(folder, "run")])


class PythonSteps:
    """Steps of one of our environments from Python, per second of CPU time; see `python_environments.py`."""

    target = "python"

    def __init__(self, task, copies, physics):
        self.arguments = [f"seedbed:{task}", *copies, "--physics", physics]

    def speed(self, programs, seconds, _):
        command = [programs[self.target], HERE / "python_environments.py", *self.arguments]
        return cpu_speed([*command, "--seconds", str(seconds)])


def lines():
    for kind, label in (("bare", "states only"), ("rapier", "with observations, rewards and resets")):
        for copies in (1, 16, 64, 1024):
            yield Line(
                f"rigid cart-pole, {label}, M = {copies}", "steps",
                Benchmark("environment", f"cartpole/{kind}/{copies}", copies),
                "mujoco", "mujoco_rollout.py", str(HERE / "cartpole.xml"), str(copies),
            )
    for task, model, substeps in MUJOCO_TASKS:
        yield Line(
            f"{task}, M = 16", "steps", Benchmark("environment", f"tasks/{task}/rapier", 16),
            "mujoco", "mujoco_rollout.py", model, "16", "--substeps", str(substeps),
        )
    for copies in (16, 64, 1024):
        yield Line(
            f"closed-form cart-pole, M = {copies}", "steps",
            Benchmark("environment", f"cartpole/analytic/{copies}", copies),
            "gymnasium", "gymnasium_vector.py", str(copies),
        )
    yield Line(
        "update of one agent of 16", "transitions",
        Benchmark("learning", "update/one agent of 16, a round of 16 × 200 steps", 3200),
        "jax", "jax_learning.py", "update",
    )
    name = "seed ensemble of 100"
    yield Line(
        "ensemble of 30, minibatches of 16", "gradient steps",
        Benchmark("value", f"{name}/acting and learning, a round", 300 * 30, without=f"{name}/acting, a round"),
        "jax", "jax_learning.py", "ensemble",
    )
    yield Line(
        "DQN 256-256, minibatches of 64", "steps",
        Training(
            "cartpole_q", "agents.count=1", "algorithm.learning.hidden=[256, 256]", "algorithm.learning.target_every=100",
            "stop=Episodes(60)",
        ),
        "sb3", "sb3_learning.py", "dqn",
    )
    for units, minibatch in ((256, 256), (128, 128), (64, 128)):
        name = f"{units}-{units}, minibatch of {minibatch}"
        for peer, script, work in (("sb3", "sb3_learning.py", "sac"), ("jax", "jax_learning.py", "soft")):
            yield Line(
                f"SAC {name}, 17 observations, 6 actions, beside {peer}", "steps",
                Benchmark("soft", f"step of soft actor-critic/{name}", 1),
                peer, script, work, "--units", str(units), "--minibatch", str(minibatch),
            )
    yield from lines_from_python()
    yield Line("CartPole to 195, whole process", "runs", WholeRun("cartpole_fast"), "sb3", "sb3_learning.py", "cartpole")


def lines_from_python():
    """Our environments beside those of others, as users of Python step them: one, and M at once."""
    numbers = [[], *([str(copies)] for copies in (1, 16, 64, 1024))]
    for ours, physics, label, library, theirs in (
        ("cartpole", "rapier", "rigid cart-pole beside CartPole-v1", "gymnasium", "CartPole-v1"),
        ("cartpole", "analytic", "analytic cart-pole beside CartPole-v1", "gymnasium", "CartPole-v1"),
        ("cartpole", "analytic", "analytic cart-pole beside EnvPool", "envpool", "envpool:CartPole-v1"),
        ("cartpole_continuous", "rapier", "rigid cart-pole beside MuJoCo's", "gymnasium-mujoco", "InvertedPendulum-v5"),
        ("hopper", "rapier", "hopper beside MuJoCo's", "gymnasium-mujoco", "Hopper-v5"),
    ):
        for copies in numbers if library != "envpool" else numbers[1:]:
            name = f"Python: {label}, {f'M = {copies[0]}' if copies else 'single'}"
            peer = ("python_environments.py", theirs, *copies)
            yield Line(name, "steps", PythonSteps(ours, copies, physics), library, *peer)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="compare only lines whose name contains one of these")
    parser.add_argument("--rounds", type=int, default=5, help="repetitions of each line (default: 5)")
    parser.add_argument("--seconds", type=float, default=2.0, help="length of a measurement (default: 2)")
    parser.add_argument(
        "--environments", type=lambda path: Path(path).absolute(), default=Path.home() / ".cache/seedbed/peers",
        help="folder of the virtual environments (default: ~/.cache/seedbed/peers)",
    )
    arguments = parser.parse_args()
    chosen = [
        line for line in lines()
        if not arguments.words or any(word in line.name for word in arguments.words)
    ]
    if not chosen:
        sys.exit("no line has such a name; names: " + "; ".join(line.name for line in lines()))
    print("| Work | workbench, per second | peer, per second | ratio | range |")
    print("|---|---|---|---|---|", flush=True)
    programs = Programs(arguments.environments)
    has_failed = False
    for line in chosen:
        try:
            print(row(line, measured(line, programs, arguments)), flush=True)
        except (Failure, OSError, subprocess.CalledProcessError, ValueError) as error:
            has_failed = True
            print(f"| {line.name} ({line.unit}) | failed | | | |", flush=True)
            print(f"{line.name}: {error}", file=sys.stderr)
    sys.exit(has_failed)


def measured(line, programs, arguments):
    """Speeds of the workbench and of the peer in each repetition."""
    python = environment(arguments.environments, line.environment)
    return [
        (
            line.workbench.speed(programs, arguments.seconds, repetition),
            peer_speed(python, line, arguments.seconds, repetition),
        )
        for repetition in range(arguments.rounds)
    ]


class Failure(Exception):
    """Something cannot be measured."""


class Programs(dict):
    """Paths of the built benchmarks, of the program, and of a Python that has our package, built when they are needed."""

    def __init__(self, environments):
        super().__init__()
        self.environments = environments

    def __missing__(self, name):
        if name == "python":
            self[name] = python_with_package(self.environments)
        elif name == "seedbed":
            self.update(executables("build", "--release", "--bin", "seedbed"))
        else:
            self.update(executables("bench", "--no-run", "--bench", name))
        return self[name]


def python_with_package(environments):
    """The Python of a virtual environment with the Python package, which is built anew."""
    python = environment(environments, "seedbed")
    with tempfile.TemporaryDirectory() as folder:
        build_wheel = [python.with_name("maturin"), "build", "--release", "--quiet", "--out", folder]
        subprocess.run(build_wheel, cwd=REPOSITORY / "python", check=True)
        install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        wheels = list(Path(folder).glob("*.whl"))
        # First what the package needs, as far as it is missing, then the package, even if its version is the same.
        subprocess.run([*install, *wheels], check=True)
        subprocess.run([*install, "--force-reinstall", "--no-deps", *wheels], check=True)
    return python


def executables(*command):
    """Paths of what `cargo` builds, by name."""
    command = ["cargo", *command, "--message-format=json"]
    output = subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = (json.loads(line) for line in output.splitlines())
    return {message["target"]["name"]: message["executable"] for message in messages if message.get("executable")}


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


def nanoseconds(executable, benchmark, seconds):
    """Median time of one iteration of a benchmark."""
    command = [executable, "--bench", "--noplot", "--warm-up-time", "0.5", "--measurement-time", str(seconds)]
    command += ["--output-format", "bencher", "--exact", benchmark]
    output = subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.PIPE, text=True).stdout
    found = re.search(r"bench:\s+([\d,]+) ns/iter", output)
    if not found:
        raise Failure(f"no benchmark `{benchmark}` in {executable}:\n{output}")
    return float(found[1].replace(",", ""))


def peer_speed(python, line, seconds, repetition):
    """Units per second of CPU time of the peer, or whole runs per second."""
    script, *rest = line.command
    command = [python, HERE / script, *rest]
    if isinstance(line.workbench, WholeRun):
        return 1 / wall_seconds([*command, "--seed", str(1000 + repetition)])
    return cpu_speed([*command, "--seconds", str(seconds)])


def cpu_speed(command):
    """Units per second of CPU time that a script prints."""
    # Not in the repository, because MuJoCo writes a log to the current folder.
    folder = tempfile.gettempdir()
    output = subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE, text=True).stdout
    result = json.loads(output.splitlines()[-1])
    return result["units"] / result["cpu_seconds"]


def wall_seconds(command):
    """Time from the start of a process to its end."""
    start = time.perf_counter()
    subprocess.run(command, cwd=REPOSITORY, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


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
