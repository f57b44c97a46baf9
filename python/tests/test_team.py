"""Teams in loops of Python learn the same as those of the program, to the bit, and refuse what cannot be right."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from conftest import Train
from gymnasium import spaces
from safetensors.numpy import load_file

import seedbed

COUNT = 4
BOX = spaces.Box(-1, 1, (3,), np.float32)


def team_for(environments: seedbed.VectorEnv, algorithm: Any, agents: Any = COUNT, **options: Any) -> seedbed.Team:
    """A team for environments of `seedbed.make`."""
    observations, actions = environments.single_observation_space, environments.single_action_space
    return seedbed.Team(algorithm, observations, actions, agents=agents, task=environments.task, **options)


def play_round(team: seedbed.Team, environments: seedbed.VectorEnv) -> dict[str, np.ndarray]:
    """A synchronous round of the run with the seed of the team."""
    observations, _ = environments.reset(seed=team.seed, options={"round": team.round})
    while not team.ready:
        actions = team.act(observations)
        observations, rewards, terminated, truncated, infos = environments.step(actions)
        team.record(observations, rewards, terminated, truncated, infos)
    return team.learn()


def same(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> bool:
    """Whether arrays are the same, to the bit."""
    return found.keys() == expected.keys() and all(
        found[name].shape == expected[name].shape and found[name].tobytes() == expected[name].tobytes() for name in found
    )


VIME = "SeedPg(value_data: Shared, policy_data: Shared, policy_loss: Ppo(clip: 0.2), returns: PopArt(beta: 0.1), observations: Running, bonus: Vime())"
SAC = "SeedSac(hidden: [32, 32], minibatch: 32, random_steps: 200, observations: Running, n_step: 2)"

RUNS = {
    "SeedPg with Vime": ("cartpole", VIME, "Synchronous(episodes: 1)", 4),
    "two episodes per round": ("cartpole", "SeedPg(policy_loss: Ppo(clip: 0.2))", "Synchronous(episodes: 2)", 3),
    "continuous actions": ("cartpole_continuous", "SeedPg(bonus: Rnd())", "Synchronous(episodes: 1)", 3),
    "QLearning in lockstep": ("cartpole", "QLearning(learning: (minibatch: 16))", "Lockstep(learn_every: 3)", 4),
    "SeedTd per transition of the team": (
        "cartpole",
        "SeedTd(models: Own, learning: (minibatch: 16))",
        "Lockstep(learn_every: 6, steps_of: Team)",
        4,
    ),
    "HyperAgent with a bonus": ("cartpole", "HyperAgent(bonus: Rnd())", "Lockstep(learn_every: 5)", 3),
    "BootstrappedDqn after episodes": ("cartpole", "BootstrappedDqn()", "Synchronous(episodes: 1)", 4),
    "SeedSac in lockstep": ("pendulum", SAC, "Lockstep(learn_every: 4)", 2),
    "SeedPsrl": ("pendulum", "SeedPsrl(horizon: 4, candidates: 8, elites: 2, replan_every: 2)", "Synchronous(episodes: 1)", 2),
    "CrossEntropy": ("cartpole", "CrossEntropy()", "Synchronous(episodes: 1)", 4),
    "LeaderFollowers": ("cartpole", "LeaderFollowers()", "Synchronous(episodes: 1)", 3),
}


def loop_options(schedule: str) -> dict[str, Any]:
    """What a team is given for a schedule of a scenario."""
    numbers = [int(part) for part in schedule.replace(")", " ").replace(",", " ").split() if part.isdigit()]
    if schedule.startswith("Synchronous"):
        return {"episodes": numbers[0]}
    return {"episodes": 1, "learn_every": numbers[0], "steps_of": "Team" if "Team" in schedule else "Agent"}


@pytest.mark.parametrize("name", RUNS)
def test_teams_learn_what_runs_learn_to_the_bit(name: str, train: Train):
    task, algorithm, schedule, rounds = RUNS[name]
    options = loop_options(schedule)
    settings = (
        f"environment={task!r}".replace("'", '"'),
        f"algorithm={algorithm}",
        f"agents=(count: {COUNT}, seeds: Normal(sigma: 0.2))",
        f"schedule={schedule}",
        f"stop=Episodes({rounds * options['episodes']})",
    )
    folder = train("cartpole", *settings, options=("--seed", "3", "--no-recording"))
    environments = seedbed.make(task, num_envs=COUNT)
    agents = {"count": COUNT, "seeds": "Normal(sigma: 0.2)"}
    team = team_for(environments, algorithm, agents, seed=3, threads=2, **options)
    for _ in range(rounds):
        metrics = play_round(team, environments)
    assert same(team.parameters(), load_file(folder / "policies.safetensors"))
    rows = seedbed.load(folder).table("rounds", frames="pandas").query("round == round.max()").sort_values("agent")
    for column in metrics.keys() - {"return"}:
        found, expected = metrics[column].astype(np.float32), rows[column].to_numpy(np.float32)
        assert np.array_equal(found, expected, equal_nan=True), column
    episodes = seedbed.load(folder).table("episodes", frames="pandas")
    returns = episodes[episodes["episode"] >= (rounds - 1) * options["episodes"]].groupby("agent")["return"].mean()
    assert metrics["return"] == pytest.approx(returns.to_numpy())


def test_policies_are_those_of_the_run(train: Train, tmp_path: Path):
    """The same metadata but for the name of the scenario, and the actions that agents choose."""
    settings = ("stop=Episodes(1)", "agents=(count: 4)", "algorithm=SeedPg()")
    folder = train("cartpole", *settings, options=("--no-recording",))
    environments = seedbed.make("cartpole", num_envs=COUNT)
    team = team_for(environments, "SeedPg", episodes=1)
    play_round(team, environments)
    of_run, policy = seedbed.load(folder).policy(2), team.policy(2)
    assert policy.metadata == {key: text for key, text in of_run.metadata.items() if key != "scenario"}
    observations = np.random.default_rng(0).standard_normal((50, 4))
    assert np.array_equal(policy(observations), of_run(observations))
    team.save_policies(tmp_path / "policies.safetensors")
    assert np.array_equal(seedbed.Policy(tmp_path / "policies.safetensors", 2)(observations), policy(observations))
    with pytest.raises(seedbed.RunError, match="have no networks"):
        team_for(environments, "Random").policy()


CONTINUED = {
    "SeedPg": {"algorithm": VIME},
    "SeedPsrl": {"algorithm": "SeedPsrl(horizon: 4, candidates: 8, elites: 2, replan_every: 2)"},
    "QLearning": {"algorithm": "QLearning(learning: (minibatch: 16, replay: 100))", "learn_every": 3},
    "HyperAgent": {"algorithm": "HyperAgent()"},
    "CrossEntropy": {"algorithm": "CrossEntropy()"},
}


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("name", CONTINUED)
def test_saved_teams_continue_with_the_same_bits(name: str, mode: Any, tmp_path: Path):
    """Also episodes that are in progress when the team is saved."""

    def play(team: seedbed.Team, rounds: int) -> None:
        nonlocal observations
        end = team.round + rounds
        while team.round < end:
            observations, rewards, terminated, truncated, infos = environments.step(team.act(observations))
            team.record(observations, rewards, terminated, truncated, infos)
            if team.ready:
                team.learn()

    environments = seedbed.make("cartpole", num_envs=COUNT, autoreset_mode=mode)
    team = team_for(environments, **CONTINUED[name], autoreset_mode=mode)
    observations, _ = environments.reset(seed=5)
    play(team, 3)
    assert team.playing.any()
    team.save(tmp_path / "team")
    states, saved_observations = environments.get_state(), observations
    play(team, 3)
    expected = team.parameters()

    observations = saved_observations
    environments.set_state(states)
    loaded = seedbed.Team.load(tmp_path / "team", threads=1)
    assert (loaded.round, loaded.algorithm, loaded.agents) == (3, CONTINUED[name]["algorithm"], COUNT)
    assert (loaded.observation_space, loaded.action_space) == (team.observation_space, team.action_space)
    play(loaded, 3)
    assert same(loaded.parameters(), expected)


def test_results_do_not_depend_on_the_number_of_threads():
    def parameters(threads: int) -> dict[str, np.ndarray]:
        environments = seedbed.make("cartpole", num_envs=COUNT)
        team = team_for(environments, VIME, episodes=1, threads=threads)
        for _ in range(2):
            play_round(team, environments)
        return team.parameters()

    assert same(parameters(1), parameters(3))


def test_other_threads_of_python_run_while_agents_learn():
    ticks, is_over = 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not is_over.wait(0.001):
            ticks += 1

    team = team_of("SeedPg(epochs: 2000, hidden: [64, 64])", threads=1)
    for step in range(100):
        team.act(ZEROS)
        team.record(ZEROS, [1, 1], [step == 99] * 2, NO)
    thread = threading.Thread(target=tick)
    thread.start()
    before = ticks
    team.learn()
    during = ticks - before
    is_over.set()
    thread.join()
    assert during > 5


def gymnasium_environments(mode: str) -> gymnasium.vector.VectorEnv:
    return gymnasium.make_vec("CartPole-v1", COUNT, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode})


def test_both_modes_of_automatic_resets_have_the_same_episodes():
    """The step that only resets a copy is none of the agent, so that both learn the same in their first round."""
    learned = []
    for mode in ("NextStep", "SameStep"):
        environments = gymnasium_environments(mode)
        observations, _ = environments.reset(seed=1)
        team = seedbed.Team(
            "SeedPg",
            environments.single_observation_space,
            environments.single_action_space,
            agents=COUNT,
            autoreset_mode=environments.metadata["autoreset_mode"],
            episodes=1,
        )
        steps = 0
        while not team.ready:
            observations, *others = environments.step(team.act(observations))
            team.record(observations, *others)
            steps += 1
        metrics = team.learn()
        assert metrics["return"].max() == steps
        learned.append(team.parameters())
    assert same(*learned)


def test_agents_that_have_ended_wait_for_the_others():
    environments = seedbed.make("cartpole", num_envs=COUNT)
    team = team_for(environments, "SeedPg", episodes=1)
    observations, _ = environments.reset(seed=0)
    has_ended = np.zeros(COUNT, bool)
    while not team.ready:
        observations, rewards, terminated, truncated, infos = environments.step(team.act(observations))
        team.record(observations, rewards, terminated, truncated, infos)
        has_ended |= terminated | truncated
        assert np.array_equal(team.playing, ~has_ended)
    with pytest.raises(RuntimeError, match=r"all agents have ended their episodes of this round: call learn\(\)"):
        team.act(observations)
    team.learn()
    assert not team.playing.any() and not team.ready


class TwoSteps(gymnasium.Env[Any, Any]):
    """An environment whose episodes have two steps, in which observations count."""

    def __init__(self, action_space: spaces.Space[Any], observation_space: spaces.Space[Any] = BOX) -> None:
        self.observation_space, self.action_space = observation_space, action_space

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.steps = 0
        return self._observation(), {}

    def step(self, action: Any) -> Any:
        assert self.action_space.contains(action), action
        self.steps += 1
        return self._observation(), 1.0, self.steps == 2, False, {}

    def _observation(self) -> Any:
        shape, dtype = self.observation_space.shape, self.observation_space.dtype
        return np.full(shape, self.steps, dtype)


ACTION_SPACES = [
    spaces.Discrete(3),
    spaces.Discrete(2, start=-1),
    spaces.MultiDiscrete([2, 3]),
    spaces.MultiDiscrete([4]),
    spaces.MultiDiscrete([[2, 3], [4, 5]], start=[[1, 0], [0, 2]]),
    spaces.MultiBinary(3),
    spaces.Box(-2, 1, (1,), np.float32),
    spaces.Box(np.array([-1.0, 0.0]), np.array([1.0, 0.3]), dtype=np.float64),
    spaces.Box(0, 9, (2, 2), np.int32),
    spaces.Dict([("switch", spaces.Discrete(3)), ("push", spaces.Box(-1, 1, (), np.float32))]),
]


@pytest.mark.filterwarnings("ignore:.*Casting input x to numpy array")
@pytest.mark.parametrize("space", ACTION_SPACES, ids=str)
def test_actions_are_those_of_the_space(space: spaces.Space[Any], tmp_path: Path):
    observation_space = spaces.Box(0, 9, (2, 1), np.float64)
    environments = gymnasium.vector.SyncVectorEnv([lambda: TwoSteps(space, observation_space)] * 3)
    team = seedbed.Team("SeedPg", observation_space, space, agents=3, seed=1)
    observations, _ = environments.reset(seed=0)
    for _ in range(7):
        actions = team.act(observations)
        assert environments.action_space.contains(actions)
        observations, *others = environments.step(actions)
        team.record(observations, *others)
    assert team.learn()["return"].tolist() == [2.0, 2.0, 2.0]
    team.save(tmp_path / "team")
    assert seedbed.Team.load(tmp_path / "team").action_space == space


def test_arrays_may_be_in_any_order_and_of_any_type():
    random = np.random.default_rng(0)
    rows = [random.standard_normal((2, 3)).astype(np.float32) for _ in range(8)]
    learned = []
    for form in (np.asarray, np.asfortranarray, np.float64, lambda row: np.repeat(row, 2, axis=1)[:, ::2], lambda row: row.tolist()):
        team = team_of()
        for before, after in zip(rows[:-1], rows[1:], strict=True):
            team.act(form(before))
            team.record(form(after), [1, 2], [after is rows[-1]] * 2, NO)
        team.learn()
        learned.append(team.parameters())
    assert all(same(parameters, learned[0]) for parameters in learned)


def test_vector_environments_of_stable_baselines3():
    """They return `dones` and a list of `infos`, and reset in the same step."""

    def step(actions: Any) -> Any:
        observations, rewards, terminated, truncated, infos = environments.step(actions)
        dones = terminated | truncated
        of_copies: list[dict[str, Any]] = [{} for _ in range(COUNT)]
        for index in np.flatnonzero(dones):
            of_copies[index] = {
                "terminal_observation": infos["final_obs"][index],
                "TimeLimit.truncated": bool(truncated[index] and not terminated[index]),
            }
        return observations, rewards.astype(np.float32), dones, of_copies

    learned = []
    for is_of_sb3 in (False, True):
        environments = gymnasium_environments("SameStep")
        spaces_of_one = environments.single_observation_space, environments.single_action_space
        team = seedbed.Team("SeedPg", *spaces_of_one, agents=COUNT, autoreset_mode="SameStep")
        observations, _ = environments.reset(seed=2)
        while team.round < 2:
            actions = team.act(observations)
            result = step(actions) if is_of_sb3 else environments.step(actions)
            team.record(*result)
            observations = result[0]
            if team.ready:
                team.learn()
        learned.append(team.parameters())
    assert same(*learned)


def test_episodes_that_a_reset_cuts_off_are_truncated():
    environments = seedbed.make("cartpole", num_envs=2)
    team = team_for(environments, "SeedPg", agents=2)
    observations, _ = environments.reset(seed=0)
    for _ in range(3):
        observations, *others = environments.step(team.act(observations))
        team.record(observations, *others)
    assert not team.ready
    observations, _ = environments.reset(seed=1)
    with pytest.raises(ValueError, match=r"observations\[0\] is not the observation that was recorded last"):
        team.act(observations)
    team.start(observations)
    assert team.ready
    assert team.learn()["return"].tolist() == [3.0, 3.0]


def test_recorders_record_what_teams_visit(tmp_path: Path):
    environments = seedbed.make("cartpole", num_envs=2, autoreset_mode="SameStep")
    team = team_for(environments, "SeedPg", agents=2, autoreset_mode="SameStep")
    recorded = seedbed.RecordVisitationVector(environments, tmp_path / "run", learners=range(2))
    observations, _ = recorded.reset(seed=0)
    returns = []
    for _ in range(100):
        observations, *others = recorded.step(team.act(observations))
        team.record(observations, *others)
        if team.ready:
            returns.append(team.learn()["return"])
    recorded.close()
    run = seedbed.load(tmp_path / "run")
    episodes = run.table("episodes", frames="pandas")
    assert episodes["return"].sum() >= np.sum(returns) > 0
    assert run.agents == 2


# Errors


def team_of(algorithm: Any = "SeedPg", action_space: spaces.Space[Any] | None = None, **options: Any) -> seedbed.Team:
    action_space = spaces.Discrete(2) if action_space is None else action_space
    return seedbed.Team(algorithm, BOX, action_space, **{"agents": 2, **options})


SIMPLE = "SeedPg(policy_loss: SimplePg, policy_data: Own, epochs: 1, minibatch: Trajectory)"

WRONG_TEAMS: list[tuple[Callable[[], Any], type[Exception], str]] = [
    (lambda: team_of("SeedPgg"), ValueError, "algorithm:1:1: .*expected"),
    (lambda: team_of("SeedPg(discount: 2)"), ValueError, "algorithm:1:18: in `SeedPg.discount`: expected a number from 0 to 1, found 2"),
    (lambda: team_of({"SeedPg": {"discount": "high"}}), ValueError, "in `SeedPg.discount`"),
    (lambda: team_of({"SeedPg": {"a b": 1}}), ValueError, "SeedPg has the setting 'a b', expected a name"),
    (lambda: team_of({"SeedPg": {}, "Random": {}}), TypeError, "expected a text, or a map such as"),
    (lambda: team_of("PPO"), ValueError, "help: `PPO`: .*write `algorithm: SeedPg\\(value_data: Own, policy_data: Own"),
    (lambda: team_of("SAC"), ValueError, "help: `SAC`: .*write `algorithm: SeedSac\\(\\)`"),
    (lambda: team_of({"SeedPg": {"gamma": 0.9}}), ValueError, "write `algorithm: SeedPg\\(discount: 0.9\\)`|discount: 0.9"),
    (lambda: team_of(3), TypeError, "algorithm is 3, expected a text"),
    (lambda: team_of("SeedSac"), ValueError, "`SeedSac` needs continuous actions.*expected `SeedPg`"),
    (lambda: team_of("QLearning", spaces.Box(-1, 1, (1,))), ValueError, "need one discrete action"),
    (lambda: team_of("SeedPg", learn_every=4), ValueError, "`SeedPg` learns after episodes, not during them"),
    (lambda: team_of(SIMPLE, episodes=2), ValueError, "`SimplePg` is correct only with one episode"),
    (lambda: team_of(agents=0), ValueError, "agents is 0, expected at least 1"),
    (lambda: team_of(agents=1.5), TypeError, "agents is 1.5, expected an integer"),
    (lambda: team_of(agents={"count": 0}), ValueError, "agents:1:9: in `count`"),
    (lambda: team_of(agents={"counts": 2}), ValueError, "agents:1:2: .*counts"),
    (lambda: team_of("SeedTd", agents={"seeds": "Network(sigma: 1)"}), ValueError, "in `seeds`: value-based learners draw"),
    (lambda: team_of(seed=-1), ValueError, "seed is -1, expected 0 to"),
    (lambda: team_of(episodes=0), ValueError, "episodes is 0, expected at least 1"),
    (lambda: team_of(threads=0), ValueError, "threads is 0, expected 1 to"),
    (lambda: team_of(steps_of="All"), ValueError, 'expected "Agent" or "Team"'),
    (lambda: team_of(autoreset_mode="Sometimes"), ValueError, "Sometimes"),
    (lambda: team_of(ranges={"speed": (0, 1)}), ValueError, "ranges names 'speed', expected names of observations: observation_0"),
    (lambda: team_of(names=["a"]), ValueError, "expected 3 names"),
    (lambda: team_of(action_space=spaces.Box(-np.inf, 1, (1,))), TypeError, "expected finite bounds"),
    (lambda: team_of(action_space=spaces.Text(3)), TypeError, "expected Discrete, MultiDiscrete"),
    (lambda: seedbed.Team("SeedPg", spaces.Discrete(3), spaces.Discrete(2)), TypeError, "expected a Box: wrap"),
    (lambda: seedbed.Team("SeedPg", spaces.Box(0, 255, (84, 84)), spaces.Discrete(2)), TypeError, "expected 1 to 1000 numbers"),
    (lambda: team_of(task="cartpole"), TypeError, "task is 'cartpole', expected a seedbed.Task"),
    (lambda: team_of(task=seedbed.Task("cartpole")), ValueError, "but the task has 4 observations"),
]


@pytest.mark.parametrize("number", range(len(WRONG_TEAMS)))
def test_settings_that_cannot_be_right_are_refused(number: int):
    make, kind, message = WRONG_TEAMS[number]
    with pytest.raises(kind, match=f"(?s){message}"):
        make()


ZEROS = np.zeros((2, 3), np.float32)
NO = np.zeros(2, bool)


def with_number(number: float) -> Any:
    changed = ZEROS.copy()
    changed[1, 2] = number
    return changed


WRONG_STEPS: list[tuple[tuple[Any, ...], str]] = [
    ((ZEROS[0], [0, 0], NO, NO), r"`observations` has the shape \(3,\), expected \(2, 3\)"),
    ((ZEROS.astype(str), [0, 0], NO, NO), "`observations` is of type <U32, expected numbers"),
    ((with_number(np.nan), [0, 0], NO, NO), r"observations\[1, 2\] is nan, expected a finite number"),
    ((with_number(np.inf), [0, 0], NO, NO), r"observations\[1, 2\] is inf, expected a finite number"),
    ((ZEROS, 1.0, NO, NO), r"`rewards` has the shape \(\), expected \(2,\)"),
    ((ZEROS, [0, 1e300], NO, NO), r"rewards\[1\] is inf, expected a finite number in single precision"),
    ((ZEROS, [0, np.nan], NO, NO), r"rewards\[1\] is nan"),
    ((ZEROS, [0, 0], [0, 1], NO), "`terminated` is of type int64, expected an array of bool"),
    ((ZEROS, [0, 0], NO, [False]), r"`truncated` has the shape \(1,\), expected \(2,\)"),
    ((ZEROS, [0, 0], NO, NO, {"final_obs": [None, None]}), "expected Team.*autoreset_mode=\"SameStep\""),
]


@pytest.mark.parametrize("number", range(len(WRONG_STEPS)))
def test_results_that_cannot_be_right_are_refused_and_change_nothing(number: int):
    result, message = WRONG_STEPS[number]
    team = team_of()
    team.act(ZEROS)
    with pytest.raises(ValueError, match=message):
        team.record(*result)
    team.record(ZEROS, [1, 1], [True, True], NO)
    assert team.learn()["return"].tolist() == [1.0, 1.0]


def test_calls_in_a_wrong_order_are_refused(tmp_path: Path):
    team = team_of()
    with pytest.raises(RuntimeError, match=r"the agents have not acted: call act"):
        team.record(ZEROS, [0, 0], NO, NO)
    with pytest.raises(RuntimeError, match=r"agent 0 has ended 0 episodes since the last learn\(\), expected at least 1"):
        team.learn()
    with pytest.raises(ValueError, match=r"observations\[1, 2\] is nan"):
        team.act(with_number(np.nan))
    team.act(ZEROS)
    for call in (lambda: team.act(ZEROS), team.learn, lambda: team.start(ZEROS)):
        with pytest.raises(RuntimeError, match="the agents have acted: call record"):
            call()
    team.record(ZEROS, [0, 0], [True, False], NO)
    with pytest.raises(RuntimeError, match="agent 1 has ended 0 episodes"):
        team.learn()
    with pytest.raises(RuntimeError, match="a round is in progress: save a team before its first step, or after learn"):
        team.save(tmp_path / "team")
    assert not (tmp_path / "team").exists()


def test_last_observations_are_needed_if_environments_reset_in_the_same_step():
    team = team_of(autoreset_mode="SameStep")
    team.act(ZEROS)
    for infos in (None, {}):
        with pytest.raises(ValueError, match=r'the episode of agent 0 has ended.*expected infos\["final_obs"\]'):
            team.record(ZEROS, [0, 0], [True, False], NO, infos)
    with pytest.raises(ValueError, match="infos has 1 last observations"):
        team.record(ZEROS, [0, 0], [True, False], NO, {"final_obs": [ZEROS[0]]})
    with pytest.raises(ValueError, match=r"final observations\[0, 0\] is nan"):
        team.record(ZEROS, [0, 0], [True, False], NO, {"final_obs": [ZEROS[0] * np.nan, None]})
    team.record(ZEROS, [0, 0], [True, False], NO, {"final_obs": [ZEROS[0] + 1, None]})


def test_algorithms_for_one_episode_of_each_agent_refuse_more():
    team = team_of(SIMPLE, autoreset_mode="Disabled")
    for ended in ([True, False], [True, True]):
        team.act(ZEROS)
        team.record(ZEROS, [0, 0], ended, NO)
    with pytest.raises(RuntimeError, match=r"ended 2 episodes.*give Team\(episodes=1\)"):
        team.learn()


def test_episodes_longer_than_the_limit_are_refused():
    team = team_of(max_episode_steps=1)
    team.act(ZEROS)
    team.record(ZEROS, [0, 0], NO, NO)
    team.act(ZEROS)
    with pytest.raises(ValueError, match="more than max_episode_steps=1 steps"):
        team.record(ZEROS, [0, 0], NO, NO)


def test_networks_that_diverge_are_an_error():
    team = team_of("SeedPg(policy_optimizer: (step_size: 1e30), value_optimizer: (step_size: 1e30))")
    with pytest.raises(FloatingPointError, match=r"non-finite network parameters \(agent"):
        for _ in range(20):
            team.act(ZEROS)
            team.record(ZEROS, [1e6, -1e6], [True, True], NO)
            team.act(ZEROS)
            team.record(ZEROS, [0, 0], NO, NO)
            team.learn()


def test_damaged_files_are_refused(tmp_path: Path):
    path = tmp_path / "team"
    team_of().save(path)
    content = path.read_bytes()
    for damaged, message in (
        (content[:-1], "damaged"),
        (content[:100] + bytes([content[100] ^ 1]) + content[101:], "damaged"),
        (b"", "not a saved team"),
        (b"seedbed" + content[7:], "not a saved team"),
        (content[:7] + b"\xff" + content[8:], "another version"),
    ):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=f"team: .*{message}"):
            seedbed.Team.load(path)
    with pytest.raises(FileNotFoundError):
        seedbed.Team.load(tmp_path / "missing")
