"""Policies act as the program does, and as PyTorch modules and ONNX files do."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import onnx
import onnxruntime
import pytest
from conftest import MIXED_TASK, REPOSITORY, Train
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

import seedbed

TOLERANCE = 1e-6

SOFT = "algorithm=SeedSac(observations: Running, hidden: [8, 8], minibatch: 8, random_steps: 40)"

CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "policy gradients": ("cartpole", ("algorithm.observations=Range",)),
    "running scaling": ("cartpole", ("algorithm.observations=Running",)),
    "continuous": ("pendulum", ()),
    "three continuous components": ("cartpole", ('environment="hopper"', "algorithm.observations=Running")),
    "deep Q-learning": ("cartpole", ("algorithm=QLearning()",)),
    "seed TD": ("cartpole", ("algorithm=SeedTd(learning: (observations: Running))",)),
    "skip connection": ("cartpole", ("algorithm=SeedTd(learning: (skip_connection: true))",)),
    "ensemble with priors": ("deep_sea_bootstrapped_dqn", ("algorithm.prior_scale=3.0",)),
    "index of each agent": ("deep_sea_hyperagent", ()),
    "leader and followers": ("cartpole_leader", ()),
    "soft actor-critic": ("pendulum", (SOFT,)),
    "soft actor-critic, one learner": ("pendulum", (SOFT.replace("hidden", "learners: Shared, activation: Tanh, hidden"),)),
    "cross-entropy": ("cartpole", ("algorithm=CrossEntropy()",)),
    "discrete and continuous components": ("cartpole", ('environment="{mixed}"',)),
    "two discrete components": ("cartpole", ('environment="{switches}"',)),
}
"""Scenario and settings of each kind of policy."""


@pytest.fixture(scope="module", params=list(CASES))
def run(request: pytest.FixtureRequest, train: Train, tmp_path_factory: pytest.TempPathFactory) -> seedbed.Run:
    """A short run of each kind."""
    scenario, settings = CASES[request.param]
    folder = tmp_path_factory.mktemp("tasks")
    (folder / "mixed.ron").write_text(MIXED_TASK)
    (folder / "switches.ron").write_text(MIXED_TASK.replace("Continuous(-2.0, 2.0)", "Discrete([-2.0, 2.0])"))
    paths = {"{mixed}": str(folder / "mixed.ron"), "{switches}": str(folder / "switches.ron")}
    for name, path in paths.items():
        settings = tuple(setting.replace(name, path) for setting in settings)
    return seedbed.load(train(scenario, "agents.count=2", "stop=Episodes(4)", *settings, options=("--no-recording",)))


@pytest.fixture(scope="module")
def replays(run: seedbed.Run, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """States and actions of greedy and of sampled replays: pandas frames, without last states."""
    folder = tmp_path_factory.mktemp("replays")
    frames = {}
    for actions, options in {"greedy": ["--actions", "greedy"], "sampled": ["--temperature", "0.5"]}.items():
        path = folder / f"{actions}.rrd"
        command = [seedbed.command(), "replay", run.path, "--episodes", "2", "--out", path, *options]
        subprocess.run(command, check=True, capture_output=True)
        states = seedbed.load(path, frames="pandas").states
        frames[actions] = states[states["reward"].notna()]
    return frames


def models_of(run: seedbed.Run, agent: int) -> list[seedbed.Policy]:
    """The policies by which an agent may act in a replay."""
    policy = run.policy(agent)
    if "drawn uniformly" not in policy.metadata.get("model_of_agent", ""):
        return [policy]
    return [run.policy(agent, model=model) for model in range(int(policy.metadata["models"]))]


def own_actions(policy: seedbed.Policy, states: Any) -> np.ndarray:
    return states[[head.name for head in policy.heads]].to_numpy(np.float64)


def test_greedy_actions_are_those_of_the_program(run: seedbed.Run, replays: dict[str, Any]):
    states = replays["greedy"]
    compared = 0
    for (agent, _), episode in states.groupby(["agent", "episode"]):
        differences = []
        for policy in models_of(run, int(agent)):
            actions = policy.in_units(policy(episode[policy.observations].to_numpy()))
            expected = own_actions(policy, episode)
            # Continuous actions are recorded before they are limited.
            ends = np.array(
                [
                    [h.center - h.half_range, h.center + h.half_range] if not h.is_discrete else [-1e9, 1e9]
                    for h in policy.heads
                ]
            )
            expected = np.clip(expected, ends[:, 0], ends[:, 1])
            differences.append(np.abs(actions - expected).max())
        assert min(differences) < 1e-5, f"agent {agent}: {min(differences)}"
        compared += len(episode)
    assert compared >= 16


def load_reader() -> Any:
    """The reader of `tests/interop`, whose probabilities are compared there with those that the program records."""
    spec = importlib.util.spec_from_file_location("policy_reader", REPOSITORY / "tests/interop/policy_reader.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Policy


def test_probabilities_are_those_of_the_reference(run: seedbed.Run, replays: dict[str, Any]):
    states = replays["sampled"]
    for agent in range(2):
        policy = run.policy(agent)
        own = states[states["agent"] == agent]
        observations, actions = own[policy.observations].to_numpy(), own_actions(policy, own)
        expected = load_reader()(str(run.path / "policies.safetensors"), agent).log_prob(observations, actions, 0.5)
        temperature = 0.5 if policy.heads[0].kind == "action_values" else None
        computed = np.zeros(len(own))
        continuous = [head for head in policy.heads if not head.is_discrete]
        for column, head in enumerate(policy.heads):
            if head.is_discrete:
                table = policy.probabilities(observations, temperature=temperature)
                table = table[head.name] if isinstance(table, dict) else table
                index = np.array([head.values.index(value) for value in actions[:, column]])
                computed += np.log(table[np.arange(len(index)), index])
            else:
                mean, deviation = (part[:, continuous.index(head)] for part in policy.normal(observations))
                values = actions[:, column]
                if head.is_squashed:
                    relative = np.clip((values - head.center) / head.half_range, -0.999999, 0.999999)
                    values = np.arctanh(relative)
                    computed -= np.log(head.half_range * (1 - relative**2))
                computed += -0.5 * ((values - mean) / deviation) ** 2 - np.log(deviation * np.sqrt(2 * np.pi))
        np.testing.assert_allclose(computed, expected, rtol=1e-9, atol=1e-9)


def test_values_are_those_of_the_reference(run: seedbed.Run, replays: dict[str, Any]):
    policy = run.policy(1)
    observations = replays["greedy"][policy.observations].to_numpy()
    if policy.algorithm in ("CrossEntropy", "SeedSac"):
        with pytest.raises(ValueError, match=f"the algorithm {policy.algorithm} has no value function"):
            policy.value(observations)
        return
    reference = load_reader()(str(run.path / "policies.safetensors"), 1)
    is_value_based = policy.heads[0].kind == "action_values"
    expected = reference.outputs(observations).max(axis=1) if is_value_based else reference.value(observations)
    np.testing.assert_allclose(policy.value(observations), expected, rtol=1e-12)
    assert policy.value(observations[0]).shape == ()


def test_samples_have_the_probabilities(run: seedbed.Run, replays: dict[str, Any]):
    """Frequencies, means and deviations of 20,000 samples in one state, within five standard errors."""
    policy, count = run.policy(0), 20_000
    observation = replays["greedy"][policy.observations].to_numpy()[3]
    batch = np.tile(observation, (count, 1))
    actions = policy(batch, greedy=False, rng=np.random.default_rng(0), temperature=2.0)
    again = policy(batch, greedy=False, rng=np.random.default_rng(0), temperature=2.0)
    units = policy.in_units(actions)
    assert np.array_equal(units, policy.in_units(again)), "the same generator gives the same actions"
    continuous = [head for head in policy.heads if not head.is_discrete]
    for column, head in enumerate(policy.heads):
        sample = units[:, column]
        if head.is_discrete:
            table = policy.probabilities(observation, temperature=2.0)
            expected = table[head.name] if isinstance(table, dict) else table
            assert abs(expected.sum() - 1) < 1e-12
            found = np.array([(sample == value).mean() for value in head.values])
            assert (np.abs(found - expected) < 5 * np.sqrt(expected * (1 - expected) / count) + 1e-9).all()
        else:
            mean, deviation = (part[continuous.index(head)] for part in policy.normal(observation))
            low, high = head.center - head.half_range, head.center + head.half_range
            assert low <= sample.min() < sample.max() <= high
            inside = mean + 0.5 * np.sqrt(2.0) * deviation
            if head.is_squashed:
                mean, inside = (head.center + head.half_range * np.tanh(u) for u in (mean, inside))
            assert inside < high
            # The median is not moved by the limits; the temperature is a factor of the variance.
            assert abs((sample < mean).mean() - 0.5) < 0.02
            assert abs((sample < inside).mean() - 0.6915) < 0.02


def test_actions_are_in_the_space_of_the_task(run: seedbed.Run):
    task = run.task
    single, several = seedbed.make(task), seedbed.make(task, num_envs=3)
    policy, rng = run.policy(0), np.random.default_rng(1)
    observation, batch = single.reset(seed=0)[0], several.reset(seed=0)[0]
    for options in ({}, {"greedy": False, "rng": rng, "temperature": 1.0}):
        action = policy(observation, **options)
        assert single.action_space.contains(action), action
        single.step(action)
        assert several.action_space.contains(policy(batch, **options))
        several.step(policy(batch, **options))
    rows = [policy.in_units(policy(row)) for row in batch]
    np.testing.assert_allclose(policy.in_units(policy(batch)), np.stack(rows), rtol=1e-6)
    assert policy.in_units(policy(batch)).shape == (3, len(task.actions))
    assert [head.name for head in policy.heads] == [action.name for action in task.actions]


def states_for_comparison(policy: seedbed.Policy, replays: dict[str, Any]) -> np.ndarray:
    """Visited states, and states around them: float32, as networks of other libraries compute."""
    visited = replays["greedy"][policy.observations].to_numpy(np.float32)
    return np.concatenate([visited, visited + np.random.default_rng(0).normal(size=visited.shape).astype(np.float32)])


def assert_outputs_agree(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.shape == expected.shape
    error = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
    assert error.max() <= TOLERANCE, error.max()


def test_onnx_agrees(run: seedbed.Run, replays: dict[str, Any], tmp_path: Path):
    policy = run.policy(1)
    states = states_for_comparison(policy, replays)
    path = policy.to_onnx(tmp_path / "policy.onnx")
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    found = dict(zip(names, session.run(None, {"observation": states}), strict=True))
    assert_outputs_agree(found.pop("outputs"), policy.outputs(states))
    expected = policy(states)
    if isinstance(expected, dict):
        assert names[1:] == [f"action.{name}" for name in expected]
        expected = np.stack(list(expected.values()), axis=1)
        actions = np.stack(list(found.values()), axis=1)
    else:
        assert names[1:] == ["action"]
        actions = found["action"]
        assert actions.dtype == expected.dtype
    assert actions.shape == expected.shape
    np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)
    properties = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
    assert properties["algorithm"] == policy.algorithm and properties["agent"] == "1"
    assert json.loads(properties["heads"])[0]["name"] == policy.heads[0].name


@pytest.mark.slow
def test_torch_agrees(run: seedbed.Run, replays: dict[str, Any]):
    import torch

    policy = run.policy(1)
    states = states_for_comparison(policy, replays)
    module = policy.to_torch()
    outputs = module(torch.as_tensor(states))
    assert_outputs_agree(outputs.detach().numpy(), policy.outputs(states))
    actions, expected = module.act(torch.as_tensor(states)), policy(states)
    if not isinstance(expected, dict):
        actions, expected = {"action": actions}, {"action": expected}
    for name in expected:
        np.testing.assert_allclose(actions[name].numpy(), expected[name], rtol=0, atol=1e-5)
    # Its parameters can be trained, and are saved with it.
    outputs.square().mean().backward()
    assert all(parameter.grad is not None for parameter in module.parameters())
    other = run.policy(0).to_torch()
    other.load_state_dict(module.state_dict())
    assert torch.equal(other(torch.as_tensor(states)), outputs)


def returns(environment: gymnasium.vector.VectorEnv, policy: seedbed.Policy, episodes: int = 20) -> np.ndarray:
    """Returns of the first episode of each copy."""
    observations, _ = environment.reset(seed=100)
    total, running = np.zeros(environment.num_envs), np.ones(environment.num_envs, bool)
    while running.any():
        observations, rewards, terminated, truncated, _ = environment.step(policy(observations))
        total += running * rewards
        running &= ~(terminated | truncated)
    assert len(total) == episodes
    return total


@pytest.mark.parametrize("agent", range(4))
def test_trained_policies_balance_poles_here_and_in_gymnasium(cartpole_run: Path, agent: int):
    policy = seedbed.load(cartpole_run).policy(agent)
    theirs = gymnasium.make_vec("CartPole-v1", num_envs=20, max_episode_steps=200, vectorization_mode="sync")
    ours = seedbed.make("cartpole", num_envs=20, max_episode_steps=200)
    for environment in (theirs, ours):
        assert (returns(environment, policy) == 200).all()


def test_models_are_chosen(train: Train):
    run = seedbed.load(
        train("deep_sea_bootstrapped_dqn", "agents.count=2", "stop=Episodes(2)", options=("--no-recording",))
    )
    one, other = run.policy(1), run.policy(1, model=7)
    assert (one.model, other.model) == (1, 7)
    state = np.eye(len(one.observations))[0]
    assert not np.array_equal(one.outputs(state), other.outputs(state))
    with pytest.raises(IndexError, match="there is no model 20: the run has 20, from 0 to 19"):
        run.policy(0, model=20)
    with pytest.raises(IndexError, match="there is no agent -1: the run has 2, from 0 to 1"):
        run.policy(-1)
    with pytest.raises(ValueError, match="action values of BootstrappedDqn are no probabilities: give a temperature"):
        one.probabilities(state)
    assert one.probabilities(state, temperature=1e-6).max() == 1.0, "a low temperature is greedy"


def test_wrong_arguments_are_errors(cartpole_run: Path):
    policy = seedbed.load(cartpole_run).policy(0)
    state = np.zeros(4)
    with pytest.raises(ValueError, match=r"the shape \[3\], expected \[4\] or \[N, 4\]: x, x_dot, theta, theta_dot"):
        policy(np.zeros(3))
    with pytest.raises(ValueError, match=r"the shape \[1, 1, 4\]"):
        policy(np.zeros((1, 1, 4)))
    with pytest.raises(ValueError, match="an observation is not finite"):
        policy([0.0, np.nan, 0.0, 0.0])
    with pytest.raises(ValueError, match="greedy=False needs rng"):
        policy(state, greedy=False)
    with pytest.raises(ValueError, match="temperature is 0, expected a positive number"):
        policy.probabilities(state, temperature=0)
    with pytest.raises(ValueError, match="actions are discrete"):
        policy.normal(state)


def change_metadata(path: Path, change: Callable[[dict[str, str]], object]) -> None:
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    change(metadata)
    save_file(load_file(path), path, metadata)


def change_tensors(path: Path, change: Callable[[dict[str, np.ndarray]], object]) -> None:
    with safe_open(path, framework="numpy") as file:
        metadata = file.metadata()
    tensors = load_file(path)
    change(tensors)
    save_file(tensors, path, metadata)


BIAS, WEIGHT = "agent_0.policy.layer_2.bias", "agent_0.policy.layer_1.weight"

DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "missing": (Path.unlink, "there is no such file"),
    "cut": (lambda path: path.write_bytes(path.read_bytes()[:-100]), "it is damaged: "),
    "empty": (lambda path: path.write_bytes(b""), "it is damaged: "),
    "version": (
        lambda path: change_metadata(path, lambda m: m.update(format_version="2")),
        "format version 2, expected 1",
    ),
    "metadata": (lambda path: change_metadata(path, lambda m: m.pop("heads")), "its metadata have no heads"),
    "JSON": (
        lambda path: change_metadata(path, lambda m: m.update(heads="[")),
        "`heads` of its metadata is no valid JSON",
    ),
    "kind": (
        lambda path: change_metadata(path, lambda m: m.update(heads=m["heads"].replace("categorical", "beta"))),
        "of the unknown kind beta",
    ),
    "tensor": (lambda path: change_tensors(path, lambda t: t.pop(BIAS)), f"it has no tensor {BIAS}"),
    "number": (lambda path: change_tensors(path, lambda t: t[BIAS].fill(np.nan)), "is not finite"),
    "shape": (
        lambda path: change_tensors(path, lambda t: t.update({WEIGHT: t[WEIGHT][:5].copy()})),
        "shapes of its tensors do not fit",
    ),
    "outputs": (
        lambda path: change_metadata(path, lambda m: m.update(heads=m["heads"].replace('"outputs":2', '"outputs":3'))),
        "its networks have 2 outputs, expected 3",
    ),
}


@pytest.mark.parametrize("damage", list(DAMAGES))
def test_damaged_files_are_errors(cartpole_run: Path, tmp_path: Path, damage: str):
    run = Path(shutil.copytree(cartpole_run, tmp_path / "copy"))
    change, message = DAMAGES[damage]
    (run / "SHA256SUMS").unlink()  # as of an earlier version
    change(run / "policies.safetensors")
    with pytest.raises(seedbed.RunError, match=r"policies\.safetensors: .*" + re.escape(message)):
        seedbed.load(run).policy(0)


def test_predict_is_that_of_a_model_of_stable_baselines(run: seedbed.Run):
    policy = run.policy(0)
    observations = np.zeros((3, len(policy.observations)))
    actions, state = policy.predict(observations, state=None, episode_start=np.ones(3), deterministic=True)
    np.testing.assert_equal(actions, policy(observations))
    assert state is None
    with pytest.raises(ValueError, match="the observation is a Dict of x"):
        policy.predict({"x": np.zeros(3)})
