"""Compares the policies that `policy_reader.py` rebuilds from `policies.safetensors` with those that `seedbed replay` plays.

    policies.py SEEDBED      SEEDBED is the path of the program

Run by tests/interop/run. Reads the states, actions and log-probabilities of replays with the Rerun SDK.
"""

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import rerun as rr

from policy_reader import Policy

TOLERANCE = 1e-5
GIBBS = ["--temperature", "0.5"]
# Scenario, settings, and options of the replay with sampled actions.
CASES = [
    ("cartpole", ["algorithm.observations=Range"], []),
    ("cartpole", ["algorithm.observations=Running"], []),
    ("pendulum", [], []),
    ("cartpole", ["environment=\"hopper\"", "algorithm.observations=Running"], []),
    ("cartpole", ["algorithm=QLearning()"], GIBBS),
    ("cartpole", ["algorithm=SeedTd(learning: (observations: Running))"], GIBBS),
    ("cartpole", ["algorithm=SeedTd(learning: (skip_connection: true))"], GIBBS),
]


def main(seedbed: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for number, (scenario, settings, options) in enumerate(CASES):
            run = pathlib.Path(folder) / str(number)
            overrides = [part for setting in ["agents.count=2", "stop=Episodes(4)", *settings] for part in ("--set", setting)]
            subprocess.run([seedbed, "run", f"scenarios/{scenario}.ron", "--out", run, "--no-recording", "--quiet", *overrides], check=True)
            sampled = compare(seedbed, run, options, check_log_probs)
            greedy = compare(seedbed, run, ["--actions", "greedy"], check_greedy)
            print(f"policies of {scenario} {' '.join(settings)}: {sampled} probabilities and {greedy} greedy actions agree")


def compare(seedbed: str, run: pathlib.Path, options: list[str], check) -> int:
    """Replays a run and checks the steps of both agents. Returns the number of steps."""
    replay = run / "replay.rrd"
    subprocess.run([seedbed, "replay", run, "--episodes", "2", "--out", replay, *options], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    steps = 0
    with rr.server.Server(datasets={"replay": [str(replay)]}) as server:
        dataset = server.client().get_dataset("replay")
        for agent in range(2):
            policy = Policy(run / "policies.safetensors", agent)
            states, actions, log_probs = recorded_steps(dataset, agent, policy)
            check(policy, states, actions, log_probs)
            steps += len(states)
    replay.unlink()
    assert steps >= 16, f"only {steps} steps"
    return steps


def recorded_steps(dataset, agent: int, policy: Policy):
    """Observations `[N × width]`, actions `[N × components]` and log-probabilities `[N]` of all steps of an agent."""
    entity = f"/raw/agent_{agent}"
    table = dataset.filter_contents([entity]).reader(index="env_step").to_arrow_table().sort_by("env_step")

    def column(name: str) -> list:
        return [cell[0] if cell else None for cell in table.column(f"{entity}:State:{name}").to_pylist()]

    log_probs = column("log_prob")
    rows = [index for index, log_prob in enumerate(log_probs) if log_prob is not None]
    states = np.array([column(name) for name in policy.observations], dtype=np.float64).T[rows]
    actions = np.array([[value for value in column(head["name"])] for head in policy.heads], dtype=np.float64).T[rows]
    return states, actions, np.array(log_probs, dtype=object)[rows].astype(np.float64)


def check_log_probs(policy: Policy, states, actions, log_probs) -> None:
    computed = policy.log_prob(states, actions, temperature=0.5)
    difference = np.abs(np.exp(computed) - np.exp(log_probs)) / np.maximum(1.0, np.exp(log_probs))
    assert difference.max() < TOLERANCE, f"probabilities differ by {difference.max()}"


def check_greedy(policy: Policy, states, actions, _) -> None:
    difference = np.abs(policy.greedy(states) - actions)
    assert difference.max() < TOLERANCE * np.maximum(1.0, np.abs(actions)).max(), f"greedy actions differ by {difference.max()}"


if __name__ == "__main__":
    main(sys.argv[1])
