"""Soft actor-critic plays the same episodes as that of Stable-Baselines3, if both get the same random bits and initial networks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import seedbed
from random_streams import ACTION, REPLAY, RESET, UPDATE_NOISE, Stream

RUN_SEED, RANDOM_STEPS, STEPS = 1000, 150, 300


class Bits:
    """The streams of the only agent of a run, for whoever asks: the round in which it acts or learns is known here."""

    def __init__(self) -> None:
        self.acts_in = -1
        self.learns_in = -1
        self.is_learning = False
        self._streams: dict[tuple[int, int], Stream] = {}

    def of(self, purpose: int, round_number: int) -> Stream:
        key = (purpose, round_number)
        if key not in self._streams:
            self._streams[key] = Stream(RUN_SEED, purpose, 0, round_number)
        return self._streams[key]

    def standard_normal(self, shape: Any, dtype: Any, device: Any) -> Any:
        import torch

        stream = self.of(UPDATE_NOISE, self.learns_in) if self.is_learning else self.of(ACTION, self.acts_in)
        numbers = [stream.normal() for _ in range(int(np.prod(shape)))]
        return torch.tensor(numbers, dtype=dtype, device=device).reshape(tuple(shape))


def environment_with(bits: Bits) -> Any:
    import gymnasium

    class WithSeeds(gymnasium.Wrapper):
        """Each episode is a round."""

        def reset(self, **_: Any) -> Any:
            bits.acts_in += 1
            return self.env.reset(seed=bits.of(RESET, bits.acts_in).u32())

        def step(self, action: Any) -> Any:
            bits.learns_in = bits.acts_in
            return self.env.step(action)

    return WithSeeds(gymnasium.make("Hopper-v5"))


def model_with(bits: Bits, environment: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A model of Stable-Baselines3 whose random numbers are those of the streams."""
    import torch
    from stable_baselines3 import SAC

    class WithBits(SAC):
        def train(self, gradient_steps: int, batch_size: int = 64) -> None:
            bits.is_learning = True
            super().train(gradient_steps, batch_size)
            bits.is_learning = False

        def _on_step(self) -> None:
            super()._on_step()
            # Stable-Baselines3 begins to learn one step later.
            if self.num_timesteps == RANDOM_STEPS:
                self.train(1, self.batch_size)

    of_numpy = np.random.randint

    def randint(low: int, high: int | None = None, size: Any = None, **further: Any) -> Any:
        if bits.is_learning and high is not None and high > 1:
            stream = bits.of(REPLAY, bits.learns_in)
            return np.array([stream.index(high) for _ in range(size)])
        return of_numpy(low, high, size, **further)

    monkeypatch.setattr(np.random, "randint", randint)
    monkeypatch.setattr(torch.distributions.normal, "_standard_normal", bits.standard_normal)
    networks = {"net_arch": [128, 128]}
    model = WithBits(
        "MlpPolicy", environment, 3e-4, 20_000, learning_starts=RANDOM_STEPS, batch_size=128, policy_kwargs=networks, seed=0, device="cpu"
    )
    actions = model.action_space

    def sample() -> np.ndarray:
        stream = bits.of(ACTION, bits.acts_in)
        return np.array([stream.between_minus_one_and_one() for _ in range(3)], np.float32)

    monkeypatch.setattr(actions, "sample", sample)
    return model


def copy_initial_networks(model: Any, tensors: dict[str, np.ndarray]) -> None:
    import torch

    def copy(layer: Any, name: str, part: slice = slice(None)) -> None:
        weight, bias = tensors[f"{name}.weight"][:, part], tensors[f"{name}.bias"][part]
        layer.weight.data.copy_(torch.tensor(weight.T.copy()))
        layer.bias.data.copy_(torch.tensor(bias.copy()))

    name = "model_0.initial.policy.layer_{}".format
    for number, layer in enumerate((model.actor.latent_pi[0], model.actor.latent_pi[2])):
        copy(layer, name(number))
    # Our outputs are mean and log-deviation of one component after the other.
    copy(model.actor.mu, name(2), slice(0, None, 2))
    copy(model.actor.log_std, name(2), slice(1, None, 2))
    for critic, network in enumerate(model.critic.q_networks):
        for number in range(3):
            copy(network[2 * number], f"model_0.initial.critic_{critic}.layer_{number}")
    model.critic_target.load_state_dict(model.critic.state_dict())


@pytest.mark.slow
def test_soft_actor_critic_is_that_of_stable_baselines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from safetensors.numpy import load_file
    from stable_baselines3.common.monitor import Monitor

    settings = ["algorithm.hidden=[128, 128]", "algorithm.minibatch=128", f"algorithm.random_steps={RANDOM_STEPS}"]
    settings += [f"stop=Steps(team: {STEPS}, at_most: 1000)"]
    run = seedbed.train(
        seedbed.Gymnasium("Hopper-v5"), scenario="sac", seed=RUN_SEED, set=settings, save_initial=True, progress=False, out=tmp_path / "run"
    )
    ours = run.table("episodes", frames="pandas")
    tensors = load_file(run.path / "policies.safetensors")

    bits = Bits()
    environment = Monitor(environment_with(bits))
    model = model_with(bits, environment, monkeypatch)
    copy_initial_networks(model, tensors)
    model.learn(int(ours["length"].sum()))

    assert model._n_updates == run.table("rounds", frames="pandas")["gradient_steps"].sum() > 150
    assert environment.get_episode_lengths() == ours["length"].to_list()
    # Rounding of single precision grows with each gradient step.
    np.testing.assert_allclose(environment.get_episode_rewards(), ours["return"], rtol=5e-3)
    assert model.log_ent_coef.detach().exp().item() == pytest.approx(tensors["model_0.temperature"].item(), rel=1e-5)
