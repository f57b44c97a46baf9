"""Teams are trained from Python with the bits of the program."""

from __future__ import annotations

import functools
import hashlib
import inspect
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, get_args

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import seedbed
from seedbed.training import AlgorithmName

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bits(folder: Path) -> list[str]:
    """Checksums of the tables and of the numbers of the networks, without the name of the scenario."""
    tables = [(folder / name).read_bytes() for name in ("episodes.csv", "rounds.csv")]
    policies = (folder / "policies.safetensors").read_bytes()
    numbers = policies[8 + int.from_bytes(policies[:8], "little") :]
    return [hashlib.sha256(content).hexdigest() for content in (*tables, numbers)]


def program(*arguments: object, status: int = 0) -> str:
    """What the program prints, or its error."""
    done = subprocess.run([seedbed.command(), *map(str, arguments)], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == status, done.stderr
    return done.stdout if status == 0 else done.stderr


SHORT = ["stop=Episodes(5)", "algorithm.value_data=Shared"]


class TestRuns:
    def test_the_bits_are_those_of_the_program(self):
        run = seedbed.train("cartpole", algorithm="SeedPg", agents=3, seed=4, set=SHORT)
        assert run.path == Path("recordings/cartpole/seed-4").absolute()
        Path("mine.ron").write_text(
            'Scenario(environment: "cartpole", agents: (count: 3, seeds: Normal(sigma: 0)), '
            "algorithm: SeedPg(value_data: Shared), stop: Episodes(5))"
        )
        program("run", "mine.ron", "--seed", 4, "--out", "mine", "--threads", 1)
        assert bits(run.path) == bits(Path("mine"))
        assert (run.name, run.state, run.agents) == ("cartpole, run seed 4", "finished", 3)

    def test_the_settings_are_those_of_a_new_scenario(self):
        run = seedbed.train("cartpole", set=["stop=Episodes(5)"])
        program("new", "scenario", "mine", "--env", "cartpole")
        program("run", "mine", "--set", "stop=Episodes(5)", "--out", "mine")
        assert bits(run.path) == bits(Path("mine"))

    def test_a_scenario_and_settings_as_a_map(self):
        changes = {"agents.count": 2, "stop": "Episodes(3)", "algorithm.discount": 0.9, "recording.scene": None}
        run = seedbed.train(scenario="cartpole", set=changes, out="one", threads=2)
        program("run", "cartpole", *(f"--set={path}={value}" for path, value in changes.items()), "--out", "other")
        assert bits(run.path) == bits(Path("other"))
        assert (run.path / "run.rrd").is_file()

    def test_a_task_file_is_found_from_the_working_directory(self):
        Path("cartpole.ron").write_text(seedbed.Task("cartpole").text)
        Path("mine.ron").write_text('Environment(extends: "cartpole", time_limit: 9)')
        run = seedbed.train("mine.ron", agents=1, set=["stop=Episodes(4)"], recording=False)
        assert run.path.parent.name == "mine" and run.task.time_limit == 9
        assert not list(run.path.glob("*.rrd"))
        again = seedbed.train(Path("mine.ron"), agents=1, set=["stop=Episodes(4)"], recording=False, overwrite=True)
        assert again.path == run.path

    def test_options_of_the_program(self):
        run = seedbed.train("cartpole", agents=1, set=["stop=Episodes(2)"], save_initial=True, frames="pandas")
        assert b"initial" in (run.path / "policies.safetensors").read_bytes()
        assert type(run.episodes).__module__.startswith("pandas")


class TestCallbacks:
    def test_each_round_is_told(self):
        states: list[seedbed.RunState] = []
        run = seedbed.train("cartpole", agents=3, set=[*SHORT, "schedule.episodes=2"][:2], on_round=states.append)
        assert [state.round for state in states] == [1, 2, 3, 4, 5] == [state.episodes for state in states]
        assert {(state.max_episodes, state.path) for state in states} == {(5, run.path)}
        table = run.table("episodes", frames="pandas")
        for state in states:
            rows = table[table["round"] == state.round - 1]
            assert state.returns == rows.sort_values("agent")["return"].tolist()
            assert state.mean_return == pytest.approx(rows["return"].mean())
            assert state.env_steps == rows["env_steps"].max()
            assert [row["length"] for row in state.finished] == rows["length"].tolist()
        losses = run.table("rounds", frames="pandas")["value_loss"].tolist()
        assert [row["value_loss"] for state in states for row in state.updates] == pytest.approx(losses)
        assert states[-1].recent_return == pytest.approx(run.summary["final_return"])

    def test_agents_without_an_episode_have_no_return(self):
        states: list[seedbed.RunState] = []
        # A tabular run reports each episode by itself.
        seedbed.train(scenario="tabular/deep_sea", set=["agents.count=3", "episodes=2"], on_round=states.append)
        assert len(states) == 6
        for state in states:
            assert len(state.returns) == 3 and sum(map(math.isnan, state.returns)) == 2 and state.updates == []

    @pytest.mark.parametrize("stop", ["Episodes(50)", "Solved(return: 1000, at_most: 50)", "Steps(team: 100000, at_most: 50)"])
    def test_a_run_that_a_callback_ends_is_finished(self, stop: str):
        called: list[int] = []

        def until_three(state: seedbed.RunState) -> bool:
            called.append(state.round)
            return state.round < 3

        run = seedbed.train("cartpole", agents=2, set=[f"stop={stop}"], on_round=until_three, out="stopped")
        assert called == [1, 2, 3] and run.state == "finished"
        assert run.summary["episodes_per_agent"] == 3 and run.policy(0)(np.zeros(4)) in (0, 1)
        whole = seedbed.train("cartpole", agents=2, set=["stop=Episodes(3)"], out="whole")
        assert bits(run.path) == bits(whole.path)

    def test_a_run_that_a_callback_ends_may_have_solved_its_task(self):
        stop = "stop=Solved(return: 1000, window: 2, at_most: 50)"
        run = seedbed.train("cartpole", agents=1, set=[stop], on_round=lambda state: state.round < 3)
        assert run.summary["episodes_per_agent"] == 3 and "window: 2" in run.scenario

    def test_a_callback_may_end_a_run_at_its_end(self):
        run = seedbed.train("cartpole", agents=1, set=["stop=Episodes(2)"], on_round=lambda state: state.round < 2)
        assert run.summary["episodes_per_agent"] == 2

    def test_answers_of_callbacks(self):
        """NumPy's False is False; what trackers return does not matter; 0 may be meant as False, but is not."""
        answers: dict[int, Any] = {1: np.True_, 2: None, 3: ["logged"], 4: [], 5: np.False_}
        run = seedbed.train("cartpole", agents=1, set=["stop=Episodes(9)"], on_round=lambda state: answers[state.round])
        assert run.summary["episodes_per_agent"] == 5
        with pytest.raises(TypeError, match="on_round returned 0, expected False to end the run, or True or None to go on"):
            seedbed.train("cartpole", agents=1, set=["stop=Episodes(9)"], on_round=lambda state: 0, out="zero")

    def test_errors_of_callbacks_show_no_words_for_control_c(self, capsys: pytest.CaptureFixture[str]):
        with pytest.raises(ZeroDivisionError):
            seedbed.train("cartpole", agents=1, set=["stop=Episodes(9)"], on_round=lambda state: 1 // 0)
        assert "Ctrl-C" not in capsys.readouterr().err

    def test_asynchronous_runs_that_a_callback_ends(self):
        settings = ["schedule=Asynchronous(training: (env_steps: 30))", "stop=Episodes(40)"]
        run = seedbed.train("cartpole", agents=3, set=settings, on_round=lambda state: state.episodes < 2)
        assert run.state == "finished" and run.summary["episodes_per_agent"] >= 2

    def test_tabular_runs_cannot_be_ended(self):
        with pytest.raises(seedbed.RunError, match="cannot be resumed, start it again"):
            seedbed.train(scenario="tabular/bipolar_chain", on_round=lambda state: state.round < 2)

    def test_the_policy_of_a_run_in_progress(self):
        """When it is asked after its fourth round, the newest checkpoint is that of the third."""
        early: list[Any] = []

        def look(state: seedbed.RunState) -> None:
            if state.round == 4:
                early.append(seedbed.load(state.path).policy(1))

        settings = [*SHORT, "checkpoint_every=1", "checkpoint_share=1"]
        run = seedbed.train("cartpole", agents=2, set=settings, on_round=look)
        seedbed.train("cartpole", agents=2, set=[*settings, "stop=Episodes(3)"], out="short")
        observation = [0.1, 0.2, -0.1, 0.3]
        expected = [seedbed.load(path).policy(1).probabilities(observation).tolist() for path in ("short", run.path)]
        assert early[0].probabilities(observation).tolist() == expected[0] != expected[1]

    def test_errors_of_callbacks_leave_the_run(self):
        def fail(state: seedbed.RunState) -> None:
            if state.round == 2:
                raise ZeroDivisionError("mine")

        with pytest.raises(ZeroDivisionError, match="mine"):
            seedbed.train("cartpole", agents=2, set=SHORT, on_round=fail, out="part")
        assert seedbed.load("part").state == "unfinished"
        seedbed.train("cartpole", agents=2, set=SHORT, out="part", resume=True)
        seedbed.train("cartpole", agents=2, set=SHORT, out="whole")
        assert bits(Path("part")) == bits(Path("whole"))


SCRIPT = """
import sys, time
import seedbed

def on_round(state):
    print("round", state.round, flush=True)
    time.sleep(0.05)

arguments = dict(agents=2, set=["stop=Episodes(25)"], out="run")
if __name__ == "__main__":
    try:
        run = seedbed.train("cartpole", **arguments, on_round=on_round, resume="resume" in sys.argv)
    except KeyboardInterrupt as error:
        print("interrupted:", error)
        sys.exit(3)
    print("returned", run.state)
"""


class TestInterruption:
    @pytest.mark.parametrize("to_group", [False, True], ids=["as in a notebook", "as in a terminal"])
    def test_control_c_leaves_the_run_to_be_resumed(self, tmp_path: Path, to_group: bool):
        Path("script.py").write_text(SCRIPT)
        line = [sys.executable, "script.py"]
        process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
        assert process.stdout is not None
        for text in process.stdout:
            if text == "round 5\n":
                break
        (os.killpg if to_group else os.kill)(process.pid, signal.SIGINT)
        printed, errors = process.communicate(timeout=60)
        assert process.returncode == 3, errors
        assert f"interrupted: the run in {tmp_path / 'run'} is interrupted" in printed and "resume=True" in printed
        assert seedbed.load("run").state == "unfinished"
        done = subprocess.run([*line, "resume"], capture_output=True, text=True, timeout=120)
        assert "returned finished" in done.stdout, done.stderr
        assert "round 3\n" not in done.stdout
        whole = seedbed.train("cartpole", agents=2, set=["stop=Episodes(25)"], out="whole")
        assert bits(Path("run")) == bits(whole.path)

    def test_a_killed_python_stops_the_program(self):
        Path("script.py").write_text(SCRIPT)
        process = subprocess.Popen([sys.executable, "script.py"], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        while process.stdout.readline() != "round 5\n":
            pass
        process.kill()
        process.communicate()
        deadline = time.monotonic() + 30
        while True:
            # The program still has the folder until it has stopped.
            try:
                run = seedbed.train("cartpole", agents=2, set=["stop=Episodes(25)"], out="run", resume=True)
                break
            except seedbed.InputError as error:
                assert "another seedbed process" in str(error) and time.monotonic() < deadline, error
                time.sleep(0.1)
        whole = seedbed.train("cartpole", agents=2, set=["stop=Episodes(25)"], out="whole")
        assert bits(run.path) == bits(whole.path)


class TestErrors:
    @pytest.mark.parametrize("change", ["agents.count=0", "algorithm.lr=3", "stop=Episodes(0)", "environment=nothing"])
    def test_messages_are_those_of_the_program(self, change: str):
        with pytest.raises(seedbed.InputError) as caught:
            seedbed.train(scenario="cartpole", set=[change])
        expected = program("run", "cartpole", "--set", change, status=2)
        assert f"error: {caught.value}" == expected.strip().replace("--set", "set")
        assert isinstance(caught.value, ValueError | seedbed.RunError)

    def test_errors_do_not_name_the_file_that_was_written(self):
        with pytest.raises(seedbed.InputError) as caught:
            seedbed.train(seedbed.Gymnasium("CartPole-v1", time_limit=0))
        assert str(caught.value).startswith("environment:1:"), caught.value
        assert "time_limit" in str(caught.value) and "tmp" not in str(caught.value)

    def test_a_run_is_not_overwritten(self):
        settings: dict[str, Any] = {"agents": 1, "set": ["stop=Episodes(2)"], "out": "run"}
        seedbed.train("cartpole", **settings)
        with pytest.raises(seedbed.InputError, match="contains a finished run; choose another out to keep both, or overwrite=True to"):
            seedbed.train("cartpole", **settings)
        with pytest.raises(seedbed.InputError, match="there is nothing to resume"):
            seedbed.train("cartpole", **settings, resume=True)
        with pytest.raises(seedbed.InputError, match="contains no checkpoint"):
            seedbed.train("cartpole", resume=True, out="other")

    def test_wrong_arguments(self):
        with pytest.raises(TypeError, match="expected an environment or a scenario"):
            seedbed.train()
        with pytest.raises(TypeError, match=r"has no argument 'learning_rate'; settings are given by set=\{'learning_rate': 0\.001\}"):
            seedbed.train("cartpole", learning_rate=0.001)  # type: ignore[call-arg]
        for name, expected in {"callback": "on_round=", "n_agents": "agents=", "bonus": r"set=\{'algorithm.bonus': 'Rnd\(\)'\}"}.items():
            with pytest.raises(TypeError, match=f"has no argument '{name}'; expected {expected}"):
                seedbed.train("cartpole", **{name: 4})  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=r"given by seedbed\.Gymnasium\(environment, time_limit=9\)"):
            seedbed.train(make_corridor, time_limit=9)  # type: ignore[call-arg]
        with pytest.raises(TypeError, match="expected a list such as"):
            seedbed.train("cartpole", set="stop=Episodes(3)")
        with pytest.raises(TypeError, match="a function that returns one, such as lambda"):
            seedbed.train(gymnasium.make("CartPole-v1"))  # type: ignore[arg-type]
        with pytest.raises(TypeError, match="a file, a seedbed.Gymnasium or a function"):
            seedbed.train(3)  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=r"seed is \[0, 1\], expected an integer from 0"):
            seedbed.train("cartpole", seed=[0, 1])  # type: ignore[arg-type]
        with pytest.raises(seedbed.InputError, match="recordings/cartpole/seed-0|threads"):
            seedbed.train("cartpole", threads=0)


class Corridor(gymnasium.Env):
    """A corridor, of which both ends are goals."""

    observation_space = spaces.Box(np.float32([0]), np.float32([8]))
    action_space = spaces.Discrete(2)

    def __init__(self, length: int = 8, fails_at: int | None = None) -> None:
        self.length, self.fails_at, self.steps = length, fails_at, 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = int(self.np_random.integers(1, self.length))
        return np.float32([self.place]), {}

    def step(self, action):
        self.place += 1 if action else -1
        self.steps += 1
        if self.steps == self.fails_at:
            raise RuntimeError("the corridor is on fire")
        is_end = self.place in (0, self.length)
        return np.float32([self.place]), float(is_end), is_end, False, {}


def make_corridor(length: int = 8) -> gymnasium.Env:
    return Corridor(length)


CORRIDOR: dict[str, Any] = {"agents": 2, "set": ["stop=Episodes(4)"]}


def limited(environment: Any, **settings: Any) -> seedbed.Gymnasium:
    return seedbed.Gymnasium(environment, time_limit=20, names=["place"], workers=1, probe_steps=200, **settings)


class TestEnvironments:
    def test_environments_of_gymnasium(self):
        task = seedbed.Gymnasium("CartPole-v1", names=["x", "v", "angle", "turning"], ranges={"v": (-3, 3), "turning": (-3, 3)})
        run = seedbed.train(task, algorithm="SeedPg", agents=2, set=["stop=Episodes(3)", "agents.seeds=Normal(sigma: 0.1)"])
        assert run.path == Path("recordings/CartPole-v1/seed-0").absolute()
        assert {"x", "turning"} < set(run.states.columns)
        program("run", "cartpole_team", "--set", f"environment={task}", "--set=agents=(count: 2)", "--set=algorithm=SeedPg()",
                "--set=stop=Episodes(3)", "--set=schedule=Synchronous()", "--out", "other")  # fmt: skip
        assert bits(run.path) == bits(Path("other"))

    @pytest.mark.parametrize(
        ("environment", "name"),
        [
            (make_corridor, "make_corridor"),
            (Corridor, "Corridor"),
            (lambda: Corridor(6), "environment"),
            (functools.partial(make_corridor, 5), "make_corridor"),
        ],
    )
    def test_functions(self, environment: Any, name: str):
        run = seedbed.train(limited(environment), **CORRIDOR)
        assert run.path.parent.name == name and run.summary["episodes_per_agent"] == 4
        assert (run.path / "envs" / f"{name}.py").is_file()
        # The program alone reads the run, also elsewhere.
        moved = run.path.rename(Path("moved").absolute())
        assert "return" in program("evaluate", moved, "--episodes", 2, "--python", sys.executable)

    def test_a_run_of_a_function_that_a_callback_ends(self):
        run = seedbed.train(limited(lambda: make_corridor(5)), agents=2, on_round=lambda state: state.round < 2)
        assert (run.state, run.summary["episodes_per_agent"]) == ("finished", 2)

    def test_functions_of_functions_and_their_arguments(self):
        limit = 6

        def make(length: int = limit) -> gymnasium.Env:
            return make_corridor(length)

        run = seedbed.train(limited(make, kwargs={"length": 5}), **CORRIDOR)
        assert run.table("states", ["place"], frames="pandas")["place"].max() <= 5
        source = (run.path / "envs/make.py").read_text()
        assert "return make_corridor(length)" in source and "class Corridor" in source

    def test_functions_of_modules_are_taken_from_their_files(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
        text = "import gymnasium\n\ndef make_pole():\n    return gymnasium.make('CartPole-v1')\n"
        (tmp_path / "poles_of_a_test.py").write_text(text)
        (tmp_path / "package_of_a_test").mkdir()
        (tmp_path / "package_of_a_test/__init__.py").write_text("")
        (tmp_path / "package_of_a_test/poles.py").write_text(text)
        monkeypatch.syspath_prepend(str(tmp_path))
        import package_of_a_test.poles  # type: ignore[import-not-found]
        import poles_of_a_test  # type: ignore[import-not-found]

        run = seedbed.train(poles_of_a_test.make_pole, **CORRIDOR, out="module")
        assert (run.path / "envs/poles_of_a_test.py").read_text() == text
        other = seedbed.train(package_of_a_test.poles.make_pole, **CORRIDOR, out="package")
        assert bits(run.path) == bits(other.path)

    def test_a_function_is_resumed_as_it_was(self):
        def fail(state: seedbed.RunState) -> None:
            if state.round == 2:
                raise ZeroDivisionError

        def train(environment: Any, **arguments: Any) -> seedbed.Run:
            return seedbed.train(limited(environment), **CORRIDOR, **arguments)

        for out in ("same", "other"):
            with pytest.raises(ZeroDivisionError):
                train(make_corridor, on_round=fail, out=out)
        whole = train(make_corridor, out="whole")
        assert bits(train(make_corridor, out="same", resume=True).path) == bits(whole.path)

        def make_another(length: int = 8) -> gymnasium.Env:
            return Corridor(length - 1)

        make_another.__name__ = "make_corridor"
        with pytest.warns(RuntimeWarning, match="`make_corridor` has changed since the run began"):
            resumed = train(make_another, out="other", resume=True)
        assert bits(resumed.path) == bits(whole.path)

    def test_a_scenario_in_another_environment(self):
        settings: dict[str, Any] = {"scenario": "ppo", "set": ["stop=Episodes(16)"]}
        run = seedbed.train(limited(make_corridor), **settings)
        assert run.path == Path("recordings/make_corridor/seed-0").absolute()
        assert "policy_data: Own" in (run.path / "scenario.ron").read_text()
        algorithm = re.search(r"algorithm: (SeedPg\(.*?\n    \)),", (REPOSITORY / "scenarios/ppo.ron").read_text(), re.DOTALL)
        assert algorithm is not None
        same = {"set": ["stop=Episodes(16)", "schedule=Synchronous(episodes: 8)", "agents=(count: 1, seeds: Normal(sigma: 0))"]}
        other = seedbed.train(limited(make_corridor), algorithm=algorithm[1], out="other", **same)
        assert bits(run.path) == bits(other.path)

        with pytest.raises(ZeroDivisionError):
            seedbed.train(limited(make_corridor), **settings, out="resumed", on_round=lambda state: 1 // 0)
        assert bits(seedbed.train(limited(make_corridor), **settings, out="resumed", resume=True).path) == bits(run.path)
        named = seedbed.train("mountain_car_continuous", scenario="ppo", set=["stop=Episodes(8)"], recording=False)
        assert named.path.parent.name == "mountain_car_continuous"
        with pytest.raises(seedbed.InputError, match="mountain_car") as caught:
            seedbed.train("mountain_carr", scenario="ppo")
        assert "tmp" not in str(caught.value)

    def test_an_algorithm_as_a_map(self):
        settings: dict[str, Any] = {"agents": 2, "set": ["stop=Episodes(3)"]}
        random = seedbed.train("cartpole", algorithm="Random", out="random", **settings)
        assert len(random.episodes) == 6
        run = seedbed.train("cartpole", algorithm={"SeedPg": {"discount": 0.9, "bonus": "Rnd()"}}, out="map", **settings)
        same = seedbed.train("cartpole", algorithm="SeedPg(discount: 0.9, bonus: Rnd())", out="text", **settings)
        assert bits(run.path) == bits(same.path)
        with pytest.raises(TypeError, match="expected a text, or a map such as"):
            seedbed.train("cartpole", algorithm=["SeedPg"])  # type: ignore[arg-type]

    def test_observations_that_are_a_dict(self):
        """The policy takes what the environment returns, whose entries are not in the order of their names."""

        class Entries(gymnasium.ObservationWrapper[Any, Any, Any]):
            def __init__(self) -> None:
                super().__init__(gymnasium.make("CartPole-v1", max_episode_steps=50))
                box = gymnasium.spaces.Box(-9, 9, (2,), np.float32)
                self.observation_space = gymnasium.spaces.Dict(pole=box, cart=box, inner=gymnasium.spaces.Dict(x=box))

            def observation(self, observation: Any) -> Any:
                return {"pole": observation[2:], "cart": observation[:2], "inner": {"x": observation[:2]}}

        run = seedbed.train(Entries, agents=1, set=["stop=Episodes(4)"])
        policy = run.policy(0)
        assert policy.observations == ["cart_0", "cart_1", "inner.x_0", "inner.x_1", "pole_0", "pole_1"]
        state = {"pole": np.array([0.3, 0.4]), "cart": np.array([0.1, 0.2]), "inner": {"x": np.array([5.0, 6.0])}}
        flat = [0.1, 0.2, 5.0, 6.0, 0.3, 0.4]
        assert policy.outputs(state).tolist() == policy.outputs(flat).tolist()
        batch = {"pole": np.ones((3, 2)), "cart": np.zeros((3, 2)), "inner": {"x": np.zeros((3, 2))}}
        assert policy(batch).shape == (3,)
        for wrong in ({"a": np.zeros(6)}, {"cart": [0, 0], "inner": {"x": [0, 0]}, "pole": [0]}, {"cart": 1.0}):
            with pytest.raises(ValueError, match="the observation is a Dict of .*, which are not the policy's observations cart_0"):
                policy(wrong)

    def test_an_environment_without_a_time_limit(self):
        with pytest.raises(seedbed.InputError, match=r"help: `seedbed\.Gymnasium\(environment, time_limit=1000\)`"):
            seedbed.train(make_corridor)

    def test_failures_of_an_environment_are_exceptions_with_its_traceback(self):
        with pytest.raises(seedbed.RunError, match="the corridor is on fire") as caught:
            seedbed.train(limited(lambda: Corridor(fails_at=300)), agents=1, set=["stop=Episodes(400)"])
        assert "Traceback" in str(caught.value) and not isinstance(caught.value, ValueError)
        assert "resume=True" in str(caught.value) or "resume" not in str(caught.value)

    def test_what_cannot_be_pickled(self):
        lock = __import__("threading").Lock()
        with pytest.raises(TypeError, match="`environment` that makes the environment cannot be sent to another process"):
            seedbed.train(lambda: Corridor(8 if lock.locked() else 7))

    def test_all_settings_of_scenarios_are_arguments(self):
        page = (REPOSITORY / "docs/gymnasium_tasks.md").read_text().split("## Settings")[1].split("\n## ")[0]
        documented = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
        assert len(documented) > 10
        assert set(documented) <= set(inspect.signature(seedbed.Gymnasium).parameters)

    def test_settings_are_written_as_in_scenarios(self):
        task = seedbed.Gymnasium(
            "a:b/C-v0",
            kwargs={"text": 'quote " \\ \n \x01 é', "numbers": (1, 2.5), "map": {"yes": True, "none": None}},
            ranges={"x": (np.float32(-1), 3)},
            discrete="Number",
        )
        assert task.name == "b-C-v0"
        assert str(task) == (
            'Gymnasium(id: "a:b/C-v0", kwargs: {"text": "quote \\" \\\\ \\n \\u{1} é", "numbers": [1, 2.5], '
            '"map": {"yes": true, "none": None}}, ranges: {"x": (-1.0, 3)}, discrete: Number)'
        )
        assert repr(seedbed.Gymnasium("A-v0", time_limit=3)) == "Gymnasium('A-v0', time_limit=3)"
        with pytest.raises(TypeError, match=r"kwargs.size is .*, expected numbers, texts"):
            str(seedbed.Gymnasium("A-v0", kwargs={"size": object()}))
        with pytest.raises(ValueError, match="kwargs.size is nan"):
            str(seedbed.Gymnasium("A-v0", kwargs={"size": math.nan}))
        with pytest.raises(TypeError, match="is a function, which has no text"):
            str(seedbed.Gymnasium(make_corridor))


class TestProgress:
    def test_lines_where_nobody_waits(self, capsys: pytest.CaptureFixture[str]):
        seedbed.train("cartpole", agents=2, set=["stop=Episodes(20)"])
        lines = capsys.readouterr().err.splitlines()
        assert 1 <= len(lines) <= 10
        assert re.fullmatch(r"cartpole: 20/20 episodes · mean return [\d.]+ · [\d,]+ env steps/s", lines[-1]), lines
        seedbed.train("cartpole", agents=2, set=["stop=Episodes(20)"], progress=False, out="quiet")
        assert capsys.readouterr() == ("", "")

    def test_a_line_in_a_terminal_that_makes_place_for_others(self):
        import pty

        script = "import seedbed; seedbed.train('cartpole', agents=2, set=['stop=Episodes(6)'], on_round=lambda s: print('round', s.round))"
        parent, child = pty.openpty()
        process = subprocess.Popen([sys.executable, "-c", script], stdout=child, stderr=child)
        os.close(child)
        seen = b""
        while True:
            try:
                part = os.read(parent, 4096)
            except OSError:
                break
            seen += part
            if not part:
                break
        os.close(parent)
        assert process.wait() == 0, seen
        text = seen.decode()
        assert "cartpole ████" in text and "6/6 episodes" in text
        assert text.count("\x1b[2Kround ") == 6, text


class TestSignatures:
    def test_all_arguments_have_names(self):
        for name in seedbed.__all__:
            found = getattr(seedbed, name)
            if not callable(found) or name in ("RecordingError", "RunError", "TaskError", "InputError"):
                continue
            kinds = [parameter.kind for parameter in inspect.signature(found).parameters.values()]
            assert inspect.Parameter.VAR_KEYWORD not in kinds, name
        assert dir(seedbed) == sorted(seedbed.__all__)

    def test_names_of_algorithms(self):
        listed = program("list", "algorithms").split("Tabular algorithms")[0]
        assert re.findall(r"^  ([A-Z]\w+)", listed, re.MULTILINE) == list(get_args(AlgorithmName))


def test_the_protocol_of_the_program():
    """Any program can drive a run: a line of JSON per round, and an answer."""
    line = [seedbed.command(), "run", "cartpole", "--set=stop=Episodes(3)", "--quiet", "--ask-after-rounds", "--out", "run"]
    done = subprocess.run(line, input="continue\ncontinue\ncontinue\n", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    begun, *rounds = [json.loads(text) for text in done.stdout.splitlines()]
    assert begun["begun"]["folder"] == "run" and begun["begun"]["agents"] == 4
    assert [each["round"]["rounds"] for each in rounds] == [1, 2, 3]
    # Without an answer, the run is interrupted after its first round.
    done = subprocess.run([*line[:-1], "other"], input="", capture_output=True, text=True)
    assert done.returncode == 130 and "interrupted after 1 round; resume with" in done.stderr
    assert len(done.stdout.splitlines()) == 2


def test_ids_of_gymnasium_are_environments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    by_id = seedbed.train("CartPole-v1", set=["stop=Episodes(3)"], progress=False)
    as_task = seedbed.train(seedbed.Gymnasium("CartPole-v1"), set=["stop=Episodes(3)"], out="other", progress=False)
    assert by_id.path.parts[-2] == "CartPole-v1"
    assert (by_id.path / "episodes.csv").read_bytes() == (as_task.path / "episodes.csv").read_bytes()
    (tmp_path / "mine.py").write_text("import gymnasium\n\ndef pole():\n    return gymnasium.make('CartPole-v1')\n")
    assert "pole" in seedbed.check(seedbed.Gymnasium("mine.py:pole")) and "pole" in seedbed.check("mine.py:pole")
