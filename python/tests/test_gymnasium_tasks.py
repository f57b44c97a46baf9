"""Environments of Gymnasium as tasks of the program `seedbed`: runs, bits, faults, views.

The program is that of the environment variable SEEDBED_PROGRAM, or the newest one that Cargo built in this repository.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
import PIL.Image
import PIL.ImageSequence
import pytest
from test_recording_program import program  # noqa: F401

import seedbed

HERE = Path(__file__).parent


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory with a file of environments and a scenario, which is the working directory."""
    shutil.copy(HERE / "foreign_environments.py", tmp_path / "foreign.py")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SEEDBED_PYTHON", sys.executable)
    return tmp_path


def scenario(folder: Path, environment: str, **fields: str) -> Path:
    path = folder / "mine.ron"
    settings = {"agents": "(count: 3)", "algorithm": "SeedPg()", "stop": "Episodes(6)", "checkpoint_share": "1.0", **fields}
    lines = "".join(f"    {name}: {value},\n" for name, value in settings.items())
    path.write_text(f"Scenario(\n    environment: {environment},\n{lines})\n")
    return path


def call(program: str, *arguments: object, status: int = 0) -> subprocess.CompletedProcess[str]:
    result = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert result.returncode == status, result.stderr + result.stdout
    return result


def bits(folder: Path) -> list[bytes]:
    return [(folder / name).read_bytes() for name in ("episodes.csv", "rounds.csv", "policies.safetensors")]


AWKWARD = 'Gymnasium(id: "foreign.py:awkward", kwargs: {"size": 2.5}, time_limit: 30)'
CARTPOLE = 'Gymnasium(id: "CartPole-v1")'


class TestBits:
    @pytest.mark.parametrize("environment", [CARTPOLE, AWKWARD])
    def test_workers_threads_and_interruptions_change_no_bit(self, lab: Path, program: str, environment: str) -> None:
        path = scenario(lab, environment)
        call(program, "run", path, "--out", "whole", "--threads", "1")
        for workers, threads in [(1, 2), (2, 1), (3, 2), (3, 3)]:
            out = f"w{workers}-{threads}"
            call(program, "run", path, "--set", f"environment.workers={workers}", "--threads", threads, "--out", out)
            assert bits(lab / out) == bits(lab / "whole")
        call(program, "run", path, "--out", "part", "--abort-after-rounds", "3", status=-signal.SIGABRT)
        call(program, "run", path, "--out", "part", "--resume")
        assert bits(lab / "part") == bits(lab / "whole")

    def test_a_worker_answers_resets_of_many_copies(self, lab: Path, program: str) -> None:
        """More than the program sends before it reads answers; agents play several episodes in a round."""
        fields = {"agents": "(count: 70)", "stop": "Episodes(4)", "schedule": "Synchronous(episodes: 2)", "algorithm": "Random"}
        path = scenario(lab, CARTPOLE, **fields)
        call(program, "run", path, "--out", "one", "--no-recording")
        call(program, "run", path, "--set", "environment.workers=3", "--out", "three", "--no-recording")
        episodes = (lab / "one" / "episodes.csv").read_bytes()
        assert episodes.count(b"\n") == 1 + 70 * 4
        assert episodes == (lab / "three" / "episodes.csv").read_bytes()

    @pytest.mark.parametrize(
        "fields",
        [
            {"schedule": "Asynchronous(training: (env_steps: 5))"},
            {"algorithm": "QLearning()", "schedule": "Lockstep(learn_every: 4)"},
            {"schedule": "Synchronous(episodes: 2)", "algorithm": "SeedPg(bonus: Vime(seeds: Shift))"},
            {"algorithm": "CrossEntropy()"},
        ],
    )
    def test_all_schedules_and_kinds_of_algorithms_work(self, lab: Path, program: str, fields: dict[str, str]) -> None:
        path = scenario(lab, CARTPOLE, **fields)
        call(program, "run", path, "--out", "whole")
        call(program, "run", path, "--out", "part", "--abort-after-rounds", "2", status=-signal.SIGABRT)
        call(program, "run", path, "--out", "part", "--resume", "--set", "environment.workers=2")
        assert bits(lab / "part") == bits(lab / "whole")

    def test_the_recorded_states_are_those_of_gymnasium(self, lab: Path, program: str) -> None:
        """Played again with Gymnasium alone: the recorded actions lead to the recorded observations and returns."""
        path = scenario(lab, CARTPOLE, recording="(raw_every: 1)")
        call(program, "run", path, "--out", "run")
        call(program, "export", "run", "--to", "states.npz")
        with np.load("states.npz") as states:
            columns = {name: states[name] for name in states.files}
        environment = gymnasium.make("CartPole-v1")
        chosen = (columns["agent"] == 1) & (columns["episode"] == 2)
        names = [f"observation_{index}" for index in range(4)]
        observations = np.stack([columns[name][chosen] for name in names], axis=1)
        actions = columns["action_0"][chosen]
        environment.reset(seed=0)
        environment.unwrapped.state = tuple(observations[0].astype(np.float64))
        for before, after in zip(range(len(actions) - 1), range(1, len(actions)), strict=True):
            observation, reward, _, _, _ = environment.step(int(actions[before]))
            assert np.allclose(observation, observations[after], atol=1e-5)
            assert reward == 1.0


class TestSettings:
    def test_names_units_ranges_and_limits_are_those_of_the_file(self, lab: Path, program: str) -> None:
        environment = (
            'Gymnasium(id: "foreign.py:awkward", names: ["at_left", "at_middle", "at_right", "x", "v"], '
            'units: {"x": "m"}, ranges: {"x": (-5, 5)}, time_limit: 7, reward_threshold: 0.5)'
        )
        path = scenario(lab, environment)
        checked = call(program, "check", path).stdout
        assert "observations at_left, at_middle, at_right, x, v" in checked
        call(program, "run", path, "--out", "run")
        stored = (lab / "run/envs/awkward.ron").read_text()
        assert "range: (-5" not in stored.split("found:")[1]
        assert seedbed.load("run").episodes["length"].max() == 7
        summary = json.loads((lab / "run/summary.json").read_text())
        assert summary["solved_at"]["return"] == 0.5

    @pytest.mark.parametrize(
        ("environment", "expected"),
        [
            ('Gymnasium(id: "CartPole-v7")', "CartPole"),
            ('Gymnasium(id: "no_such_module:X-v0")', "pip install no_such_module"),
            ('Gymnasium(id: "foreign.py:nothing")', "nothing"),
            ('Gymnasium(id: "nowhere.py:awkward")', "nowhere.py"),
            ('Gymnasium(id: "foreign.py:not_an_environment")', "gymnasium.Env"),
            ('Gymnasium(id: "foreign.py:fails")', "OSError: the simulator has no license"),
            ('Gymnasium(id: "foreign.py:awkward", kwargs: {"length": 3})', "length"),
            ('Gymnasium(id: "foreign.py:awkward", time_limit: 9, names: ["x"])', "expected a name for each of the 5"),
            ('Gymnasium(id: "foreign.py:awkward", time_limit: 9, units: {"place_00": "m"})', "did you mean `place_0`?"),
            ('Gymnasium(id: "foreign.py:endless")', "add `time_limit: 1000`"),
            ('Gym(id: "CartPole-v1")', "Gymnasium(id:"),
            ('Gymnasium(name: "CartPole-v1")', "unexpected field `name`"),
            ('Gymnasium(id: "CartPole-v1", time_limit: 0)', "whole number from 1"),
        ],
    )
    def test_mistakes_are_named_with_their_place(self, lab: Path, program: str, environment: str, expected: str) -> None:
        result = call(program, "run", scenario(lab, environment), status=2)
        assert expected in result.stderr
        assert "mine.ron:2:" in result.stderr
        assert "panicked" not in result.stderr

    def test_a_missing_interpreter_says_how_to_name_another(self, lab: Path, program: str) -> None:
        result = call(program, "check", scenario(lab, CARTPOLE), "--python", "no/such/python", status=2)
        assert "cannot start no/such/python" in result.stderr and "--python" in result.stderr

    def test_the_command_of_the_package_uses_its_own_python(self, lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("SEEDBED_PYTHON")
        monkeypatch.delenv("VIRTUAL_ENV", raising=False)
        checked = call(sys.executable, "-m", "seedbed", "check", scenario(lab, CARTPOLE))
        assert "observation_3" in checked.stdout

    def test_tasks_in_files_have_what_python_says(self, lab: Path, program: str) -> None:
        call(program, "new", "task", "pole", "--env", "gymnasium:CartPole-v1")
        call(program, "new", "scenario", "balance", "--env", "pole")
        listed = call(program, "list", "environments", "--python", "/nowhere").stdout
        assert "observation_3" in listed
        call(program, "run", "balance", "--set", "stop=Episodes(2)", "--out", "run")
        call(program, "new", "scenario", "inline", "--env", "gymnasium:CartPole-v1")
        assert 'Gymnasium(id: "CartPole-v1")' in (lab / "scenarios/inline.ron").read_text()

    def test_the_command_line_can_name_an_environment(self, lab: Path, program: str) -> None:
        call(program, "run", "cartpole", "--set", f"environment={AWKWARD}", "--set", "stop=Episodes(2)", "--out", "run")
        assert json.loads((lab / "run/summary.json").read_text())["environment"] == "awkward"


class TestFaults:
    @pytest.mark.parametrize(
        ("fault", "expected"),
        [
            ("raise", "ValueError: the motor is on fire"),
            ("recurse", "RecursionError"),
            ("exit", "SystemExit"),
            ("die", "ended with exit status 7"),
            ("kill", "killed (signal 9)"),
            ("hang", "no answer within"),
            ("shape", "shape"),
            ("no_reward", "reward"),
            ("reset", "RuntimeError: no start"),
            ("nan", "non-finite observation `place_0`"),
        ],
    )
    @pytest.mark.parametrize("workers", [1, 2])
    def test_a_failing_step_keeps_all_finished_rounds(
        self, lab: Path, program: str, fault: str, expected: str, workers: int
    ) -> None:
        # The probe makes an environment of its own, which must not fail.
        environment = (
            f'Gymnasium(id: "foreign.py:faulty", kwargs: {{"fault": "{fault}", "after": 12}}, time_limit: 20, '
            f"probe_steps: 20, workers: {workers}, step_timeout: 1)"
        )
        path = scenario(lab, environment, stop="Episodes(16)")
        result = call(program, "run", path, "--out", "run", status=1)
        assert expected in result.stderr, result.stderr
        assert len(result.stderr.splitlines()) < 60
        if fault not in ("die", "kill", "hang"):
            assert "agent 0, episode 12" in result.stderr
        rows = (lab / "run/episodes.csv").read_text().splitlines()
        assert len(rows) == 1 + 3 * 12
        call(program, "evaluate", "run", "--episodes", "1")

    @pytest.mark.parametrize(
        ("kwargs", "expected"),
        [
            ('"fault": "nan"', "step 3 after reset(seed=2), action [2.0, 1.0]: the observation `place_0` is nan"),
            ('"fault": "raise"', "step 3 after reset(seed=2), action [2.0, 1.0]: ValueError: the motor is on fire"),
        ],
    )
    def test_faults_in_the_random_steps_before_a_run_are_located(self, lab: Path, program: str, kwargs: str, expected: str) -> None:
        path = scenario(lab, f'Gymnasium(id: "foreign.py:faulty", kwargs: {{{kwargs}}}, time_limit: 20)')
        error = call(program, "check", path, status=2).stderr
        place = error.split("the environment fails: ")[1].splitlines()[0]
        assert place.split("action")[0] == expected.split("action")[0] and place.split("]: ")[1] == expected.split("]: ")[1]

    def test_hanging_and_ended_workers_name_the_steps_that_they_were_in(self, lab: Path, program: str) -> None:
        environment = 'Gymnasium(id: "foreign.py:faulty", kwargs: {"fault": "die", "after": 12}, time_limit: 20, probe_steps: 20)'
        error = call(program, "run", scenario(lab, environment, stop="Episodes(16)"), "--out", "run", status=1).stderr
        assert error.count("step 3 after reset(seed=") >= 1 and "action [" in error

    def test_a_run_that_cannot_begin_deletes_nothing(self, lab: Path, program: str) -> None:
        path = scenario(lab, '"stored"', stop="Episodes(2)")
        (lab / "envs").mkdir()
        (lab / "envs/stored.ron").write_text(f"{CARTPOLE}\n")
        call(program, "run", path, "--out", "run")
        shutil.copy(lab / "run/envs/stored.ron", lab / "envs/stored.ron")
        call(program, "run", path, "--out", "run", "--overwrite", "--python", "/bin/false", status=1)
        call(program, "evaluate", "run", "--episodes", "1")

    def test_a_changed_python_file_is_found_when_its_task_is_read(self, lab: Path, program: str) -> None:
        path = scenario(lab, '"mine"', stop="Episodes(6)")
        (lab / "envs").mkdir()
        call(program, "new", "task", "mine", "--env", "gymnasium:foreign.py:drawn")
        call(program, "run", path, "--out", "run", "--abort-after-rounds", "2", status=-signal.SIGABRT)
        (lab / "foreign.py").write_text((lab / "foreign.py").read_text() + "# changed\n")
        for arguments in [("check", path), ("run", path, "--out", "run", "--overwrite")]:
            error = call(program, *arguments, status=2).stderr
            assert "`../foreign.py` has changed since `found` was written" in error and "remove the field `found`" in error
        task = (lab / "envs/mine.ron").read_text()
        (lab / "envs/mine.ron").write_text(task.split("    found:")[0] + ")\n")
        error = call(program, "run", path, "--out", "run", "--resume", status=2).stderr
        assert "the Python file of `mine` has changed" in error and "--other-versions" in error
        call(program, "run", path, "--out", "run", "--resume", "--other-versions")

    def test_a_new_task_without_a_time_limit_gets_one(self, lab: Path, program: str) -> None:
        made = call(program, "new", "task", "mine", "--env", "gymnasium:foreign.py:awkward")
        assert "says no time limit" in made.stderr and "time_limit: Some(1000)" in (lab / "envs/mine.ron").read_text()
        call(program, "check", "envs/mine.ron")

    def test_agents_and_episodes_of_replays_are_named(self, lab: Path, program: str) -> None:
        environment = 'Gymnasium(id: "foreign.py:faulty", kwargs: {"fault": "raise", "after": 0}, time_limit: 20, probe_steps: 1)'
        path = scenario(lab, environment.replace('"after": 0', '"after": 12'), stop="Episodes(4)")
        call(program, "run", path, "--out", "run")
        error = call(program, "evaluate", "run", "--episodes", "20", status=1).stderr
        assert ", episode 12: environment" in error

    def test_workers_end_with_the_program(self, lab: Path, program: str) -> None:
        environment = 'Gymnasium(id: "foreign.py:awkward", kwargs: {"slow": 0.02}, time_limit: 30, workers: 2, probe_steps: 30)'
        path = scenario(lab, environment, stop="Episodes(100000)")
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            running = subprocess.Popen([program, "run", str(path), "--out", f"out-{number}"], start_new_session=True)
            workers = wait_for_workers(running.pid)
            os.kill(running.pid, number)
            status = running.wait(timeout=30)
            assert status == {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}[number]
            assert_gone(workers)

    def test_a_changed_python_file_is_another_task(self, lab: Path, program: str) -> None:
        path = scenario(lab, AWKWARD)
        call(program, "run", path, "--out", "run", "--abort-after-rounds", "2", status=-signal.SIGABRT)
        with open("foreign.py", "a") as file:
            file.write("\n# changed\n")
        refused = call(program, "run", path, "--out", "run", "--resume", status=2).stderr
        assert "the Python file of `awkward` has changed" in refused

    def test_a_study_repeats_runs_after_a_change_in_a_package(self, lab: Path, program: str) -> None:
        """Also if the changed file is not the one that has the environment. One argument of it is varied."""
        package = lab / "shop"
        package.mkdir()
        shutil.copy(lab / "foreign.py", package / "foreign.py")
        (package / "floor.py").write_text("")
        (package / "__init__.py").write_text("from . import floor\nfrom .foreign import Awkward as Shop\n")
        scenario(lab, 'Gymnasium(id: "shop:Shop", kwargs: {"size": 2.5}, time_limit: 30)')
        grid = '(name: "size", set: ["environment.kwargs.size={}"], values: ["2.5", "3.5"])'
        (lab / "sizes.ron").write_text(f'Study(title: "x", scenario: "mine.ron", grid: [{grid}], repeats: 2, measures: [Coverage])')

        def runs_left() -> str:
            output = call(program, "study", "sizes.ron", "--out", "out")
            return (output.stdout + output.stderr).partition("runs each, ")[2].partition(" to run")[0]

        assert [runs_left(), runs_left()] == ["4", "0"]
        (package / "floor.py").write_text("# changed\n")
        assert "runs       4 to run" in call(program, "study", "list", "sizes.ron", "--out", "out").stderr
        assert runs_left() == "4"

    def test_other_versions_are_refused_unless_insisted(self, lab: Path, program: str) -> None:
        path = scenario(lab, CARTPOLE)
        call(program, "run", path, "--out", "run", "--abort-after-rounds", "2", status=-signal.SIGABRT)
        replace_in_run(lab / "run", f'"gymnasium": "{gymnasium.__version__}"', '"gymnasium": "1.0.0"')
        refused = call(program, "run", path, "--out", "run", "--resume", status=2).stderr
        assert f"began with gymnasium 1.0.0; now it is {gymnasium.__version__}" in refused
        call(program, "run", path, "--out", "run", "--resume", "--other-versions")


def replace_in_run(run: Path, old: str, new: str) -> None:
    """Changes the copy of the task, with its checksum."""
    import hashlib

    [task] = (run / "envs").glob("*.ron")
    before = task.read_bytes()
    assert old.encode() in before
    after = before.replace(old.encode(), new.encode())
    task.write_bytes(after)
    sums = run / "SHA256SUMS"
    lines = sums.read_text().replace(hashlib.sha256(before).hexdigest(), hashlib.sha256(after).hexdigest())
    listed = "".join(line for line in lines.splitlines(keepends=True) if not line.startswith("# SHA-256 of the lines"))
    sums.write_text(listed + f"# SHA-256 of the lines above: {hashlib.sha256(listed.encode()).hexdigest()}\n")


def wait_for_workers(parent: int, count: int = 2) -> list[int]:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        listed = Path(f"/proc/{parent}/task").glob("*/children")
        children = [int(child) for path in listed for child in path.read_text().split()]
        if len(children) == count:
            time.sleep(1.0)
            return children
        time.sleep(0.05)
    raise AssertionError("no workers")


def assert_gone(processes: list[int]) -> None:
    deadline = time.monotonic() + 10
    while any(Path(f"/proc/{process}").exists() for process in processes):
        assert time.monotonic() < deadline, "a worker outlives the program"
        time.sleep(0.05)


class TestRepeatability:
    def test_history_is_found_and_said(self, lab: Path, program: str) -> None:
        path = scenario(lab, 'Gymnasium(id: "foreign.py:remembers", time_limit: 20)')
        assert "cannot be repeated bit for bit" in call(program, "check", path).stdout
        assert "cannot be repeated bit for bit" in call(program, "run", path, "--out", "run").stdout
        summary = json.loads((lab / "run/summary.json").read_text())
        assert "repeatability_warning" in summary
        study = lab / "study.ron"
        study.write_text('Study(title: "t", about: "a", cells: [(name: "only", scenario: "mine.ron")], measures: [FinalReturn(window: 3)], repeats: 2)')
        call(program, "study", study, "--out", "results")
        result = call(program, "study", "verify", study, "--out", "results", status=1)
        assert "cannot be repeated bit for bit" in result.stderr

    def test_environments_without_history_are_verified(self, lab: Path, program: str) -> None:
        scenario(lab, AWKWARD)
        study = lab / "study.ron"
        study.write_text('Study(title: "t", about: "a", cells: [(name: "only", scenario: "mine.ron")], measures: [FinalReturn(window: 3)], repeats: 3)')
        call(program, "study", study, "--out", "results")
        assert "3 of 3 repeated runs are bit-identical" in call(
            program, "study", "verify", study, "--out", "results", "--runs", "100%"
        ).stdout


class TestViews:
    def test_a_moved_run_has_all_that_commands_need(self, lab: Path, program: str, tmp_path_factory) -> None:
        call(program, "run", scenario(lab, AWKWARD), "--out", "run")
        moved = tmp_path_factory.mktemp("elsewhere") / "moved"
        shutil.move(lab / "run", moved)
        (lab / "foreign.py").unlink()
        (lab / "mine.ron").unlink()
        call(program, "evaluate", moved)
        call(program, "replay", moved, "--out", lab / "replay.rrd")
        call(program, "explore", moved)
        assert "place_0" in (moved / "explore.html").read_text()
        call(program, "plot", moved, "--out", lab / "run.svg")
        call(program, "film", moved, "--seconds", "1")
        assert "coverage" in call(program, "inspect", moved).stdout
        call(program, "export", moved, "--to", lab / "states.csv")
        assert seedbed.load(moved).states is not None
        call(program, "run", moved / "scenario.ron", "--out", lab / "again")
        assert bits(lab / "again") == bits(moved)

    def test_tuning_and_previews_work(self, lab: Path, program: str) -> None:
        scenario(lab, CARTPOLE)
        call(program, "new", "task", "pole", "--env", "gymnasium:CartPole-v1")
        call(program, "preview", "pole", "--episodes", "2", "--film")
        assert (lab / "recordings/preview/pole.gif").is_file()


SHIPPED = HERE.parents[1] / "scenarios/gymnasium"


SCENARIOS = [path for path in sorted(SHIPPED.glob("*.ron")) if "Scenario(" in path.read_text()]
"""Beside them there are studies."""


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_scenarios_of_the_repository_run(lab: Path, program: str, path: Path) -> None:
    call(program, "run", path, "--out", "run", "--set", "stop=Episodes(2)", "--no-recording")


def test_fields_of_shipped_tasks_are_what_python_says(lab: Path, program: str) -> None:
    """But versions, which are those of the machine where they were asked."""
    for path in SHIPPED.glob("*.py"):
        shutil.copy(path, lab)
    (lab / "envs").mkdir()
    for path in sorted((SHIPPED / "envs").glob("*.ron")):
        stored = path.read_text()
        short = stored[: stored.index("    found: ")] + ")"
        (lab / "envs" / path.name).write_text(short)
        scenario(lab, f'"envs/{path.name}"', agents="(count: 1)", algorithm="Random", stop="Episodes(1)")
        call(program, "run", "mine.ron", "--out", f"run-{path.stem}", "--no-recording")
        found = (lab / f"run-{path.stem}/envs/{path.name}").read_text()
        assert without_versions(found) == without_versions(stored)


def without_versions(text: str) -> str:
    found = text[text.index("    found: ") :]
    return "".join(found[: found.index("versions: ")].split())


class TestInfo:
    """Entries of `info` that are recorded beside the observations."""

    HALF_CHEETAH = 'Gymnasium(id: "HalfCheetah-v5", log_info: ["x_position", "reward_ctrl"], units: {"x_position": "m"}, time_limit: 20)'

    def played_again(self, states: np.ndarray) -> list[dict[str, float]]:
        """The infos of an episode with the same actions, from the same start state."""
        environment = gymnasium.make("HalfCheetah-v5").unwrapped
        environment.reset()
        start = [states[f"observation_{i}"][0] for i in range(17)]
        environment.set_state(np.array([0.0, *start[:8]]), np.array(start[8:]))
        actions = np.stack([states[f"action_{i}"][:-1] for i in range(6)], axis=1)
        return [environment.step(np.clip(action, -1, 1).astype(np.float32))[4] for action in actions]

    def test_recorded_entries_are_those_of_gymnasium(self, lab: Path, program: str) -> None:
        names = [f'"observation_{i}"' for i in range(17)]
        task = self.HALF_CHEETAH.replace("log_info", f"names: [{', '.join(names)}], log_info")
        call(program, "run", scenario(lab, task, stop="Episodes(2)"), "--out", "run")
        call(program, "export", "run", "--to", "states.npz")
        states = np.load("states.npz")
        first = {name: states[name][(states["agent"] == 1) & (states["episode"] == 1)] for name in states.files}
        assert len(first["x_position"]) == 21
        assert np.isfinite(first["x_position"]).all() and np.isnan(first["reward_ctrl"][0])
        control = [0.1 * np.sum(np.clip([first[f"action_{i}"][t] for i in range(6)], -1, 1) ** 2) for t in range(20)]
        assert first["reward_ctrl"][1:] == pytest.approx(-np.array(control), rel=1e-5)
        played = [info["x_position"] for info in self.played_again(first)]
        moved = first["x_position"][1:] - first["x_position"][0]
        assert moved == pytest.approx(played, abs=1e-3)
        assert np.abs(moved).max() > 0.02

    def test_entries_are_axes_and_conditions(self, lab: Path, program: str) -> None:
        call(program, "run", scenario(lab, self.HALF_CHEETAH, stop="Episodes(3)"), "--out", "run")
        call(program, "explore", "run", "--out", "page.html")
        assert "x_position" in Path("page.html").read_text()
        shown = call(program, "plot", "run", "--where", "x_position=-1..1", "--out", "plot.svg")
        assert "x_position" in shown.stdout + Path("plot.svg").read_text()

    def test_agents_do_not_see_them(self, lab: Path, program: str) -> None:
        for out, task in [("with", self.HALF_CHEETAH), ("without", 'Gymnasium(id: "HalfCheetah-v5", time_limit: 20)')]:
            call(program, "run", scenario(lab, task, stop="Episodes(3)"), "--out", out)
        assert bits(lab / "with") == bits(lab / "without")

    @pytest.mark.parametrize("schedule", ["Asynchronous(training: (env_steps: 5))", "Synchronous(episodes: 2)"])
    def test_interrupted_runs_record_the_same_entries(self, lab: Path, program: str, schedule: str) -> None:
        path = scenario(lab, self.HALF_CHEETAH, schedule=schedule)
        call(program, "run", path, "--out", "whole")
        call(program, "run", path, "--out", "part", "--abort-after-rounds", "2", status=-signal.SIGABRT)
        call(program, "run", path, "--out", "part", "--resume")
        for out in ("whole", "part"):
            call(program, "export", out, "--to", f"{out}.npz")
        whole, part = np.load("whole.npz"), np.load("part.npz")
        for name in whole.files:
            np.testing.assert_array_equal(whole[name], part[name])

    @pytest.mark.parametrize(
        ("changed", "expected"),
        [
            ('["spee"]', "info of a step has no `spee`, only: speed"),
            ('["speed", "speed"]', "the name `speed` is given twice"),
            ('["speed"], names: ["a", "b", "c", "d", "speed"]', "the name `speed` is given twice"),
        ],
    )
    def test_wrong_names_are_located(self, lab: Path, program: str, changed: str, expected: str) -> None:
        path = scenario(lab, f'Gymnasium(id: "foreign.py:awkward", time_limit: 9, log_info: {changed})')
        error = call(program, "check", path, status=2).stderr
        assert expected in error and "mine.ron:2:" in error and "log_info" in error


def colors_in_film(path: Path, place: tuple[float, float] = (0.25, 0.35)) -> np.ndarray:
    """The color of each frame at a place, as a share of its width and height: by default in the middle of the picture."""
    with PIL.Image.open(path) as film:
        frames = [frame.convert("RGB") for frame in PIL.ImageSequence.Iterator(film)]
    return np.array([frame.getpixel((int(place[0] * frame.width), int(place[1] * frame.height))) for frame in frames], float)


class TestFilms:
    """Films of environments that draw pictures of themselves."""

    @pytest.mark.parametrize(
        "fields",
        [
            {},
            {"schedule": "Synchronous(episodes: 2)", "stop": "Episodes(6)"},
            {"schedule": "Asynchronous(training: (env_steps: 5))"},
        ],
    )
    def test_recorded_episodes_are_played_again(self, lab: Path, program: str, fields: dict[str, str]) -> None:
        call(program, "run", scenario(lab, 'Gymnasium(id: "foreign.py:drawn")', **fields), "--out", "run")
        made = call(program, "film", "run", "--agent", "1", "--seconds", "1", "--fps", "10", "--out", "run.gif")
        assert made.stderr == ""
        call(program, "export", "run", "--to", "states.npz")
        states = np.load("states.npz")
        x, v = (states[name][states["agent"] == 1] for name in ("place_0", "place_1"))
        # The color of a picture is that of its state: see `Drawn`.
        expected = np.stack([128 + 25 * x, np.full_like(x, 90), 128 + 60 * v], axis=1).clip(0, 255)
        shown = colors_in_film(Path("run.gif"))
        assert len(shown) == 10 and len(np.unique(shown, axis=0)) > 3
        for color in shown:  # a film has 256 colors
            assert np.abs(expected - color).max(axis=1).min() < 20

    def test_previews_are_filmed(self, lab: Path, program: str) -> None:
        (lab / "pole.ron").write_text('Gymnasium(id: "CartPole-v1")\n')
        made = call(program, "preview", "pole.ron", "--film", "--out", "preview.rrd")
        assert "warning" not in made.stderr
        # The track is white, the cart black.
        colors = {tuple(color) for color in colors_in_film(Path("preview.gif"), (0.25, 0.3))}
        assert colors == {(255, 255, 255)}

    @pytest.mark.parametrize(
        ("function", "reason"),
        [
            ("without_pictures", "render(): NotImplementedError"),
            ("awkward", "unexpected keyword argument 'render_mode'"),
            ("remembers", "are others than the recorded ones"),
        ],
    )
    def test_films_without_pictures_say_why(self, lab: Path, program: str, function: str, reason: str) -> None:
        call(program, "run", scenario(lab, f'Gymnasium(id: "foreign.py:{function}", time_limit: 9)'), "--out", "run")
        made = call(program, "film", "run", "--seconds", "0.5", "--scenes", "2")
        assert "the film shows no pictures of the environment" in made.stderr and reason in made.stderr
        assert Path("run/film.gif").is_file()
