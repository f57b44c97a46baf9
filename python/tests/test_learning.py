"""Algorithms of others learn our tasks. Random agents have a mean return of about 20 on CartPole."""

from __future__ import annotations

import subprocess
import sys

import pytest
from conftest import REPOSITORY

import seedbed

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]


def test_stable_baselines3_solves_the_cartpole():
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.evaluation import evaluate_policy

    environments = make_vec_env("seedbed/CartPole-v0", n_envs=8, seed=0)
    model = PPO(
        "MlpPolicy",
        environments,
        n_steps=32,
        batch_size=256,
        gae_lambda=0.8,
        gamma=0.98,
        n_epochs=20,
        ent_coef=0.0,
        learning_rate=lambda left: 0.001 * left,
        clip_range=lambda left: 0.2 * left,
        seed=0,
        device="cpu",
    )
    model.learn(60_000)
    mean, _ = evaluate_policy(model, make_vec_env("seedbed/CartPole-v0", seed=99), n_eval_episodes=20)
    assert mean == seedbed.Task("cartpole").time_limit == 200


def test_a_single_file_algorithm_solves_the_cartpole():
    script = REPOSITORY / "python/examples/ppo.py"
    command = [sys.executable, str(script), "--env-id", "seedbed:seedbed/CartPole-v0"]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    last = float(output.splitlines()[-1].rpartition(" ")[2])
    assert last >= 195, output
