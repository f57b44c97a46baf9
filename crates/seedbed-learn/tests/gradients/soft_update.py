"""Two gradient steps of soft actor-critic, by NumPy in double precision, without automatic differentiation.

`soft_update.json` beside this file is its output; `crates/seedbed-learn/src/algorithms/seed_sac/tests.rs` reads it. To make it again:

    pip install numpy==2.4.6
    python crates/seedbed-learn/tests/gradients/soft_update.py

The learner has a policy π(s) with outputs (μ, log σ) by turns, two critics Q = f + β p with fixed random networks p, their target
networks f', and log α. All networks are 2 layers of 8 units with max(0, x). A step does, in this order (Haarnoja et al. 2018):

    a' = tanh(μ(s') + σ(s') ε'),  a = tanh(μ(s) + σ(s) ε),  log π = Σ log N(ε; 0, 1) − log σ − log(1 − a²)
    y = r + γ (min Q'(s', a') − α log π(a'|s'))
    f:      Adam along the gradient of ½ mean (Q − y)² + ½ λ ‖f − f̂‖², for each critic
    π:      Adam along the gradient of mean(α log π(a|s) − min Q(s, a)) + ½ λ ‖π − π̂‖², with the critics after their step
    log α:  Adam along the gradient of −log α (mean log π(a|s) + H̄)
    f':     f' + τ (f − f')

The chain rule is written out below. Adam's ε is large, so that a step depends on the length of the gradient and not on its sign alone.
"""

import json
import random
from pathlib import Path

import numpy as np

WIDTH, COMPONENTS, BATCH, STEPS, HIDDEN = 3, 2, 5, 2, 8
SETTINGS = {"discount": 0.875, "target_rate": 0.25, "regularization": 0.125, "prior_scale": 0.5, "initial_alpha": 0.5, "target_entropy": -2.0,
            "step_size": 0.0625, "epsilon": 0.25}
POLICY_SIZES = [WIDTH, HIDDEN, HIDDEN, 2 * COMPONENTS]
CRITIC_SIZES = [WIDTH + COMPONENTS, HIDDEN, HIDDEN, 1]


def main():
    policy, critics = initial("policy", POLICY_SIZES), [initial(f"critic {i}", CRITIC_SIZES) for i in (0, 1)]
    priors = [initial(f"prior {i}", CRITIC_SIZES) for i in (0, 1)]
    steps = [minibatch(step) for step in range(STEPS)]
    learner = Learner(policy, critics, priors)
    for step in steps:
        learner.update({name: np.array(values) for name, values in step.items()})
    after = {"policy": learner.policy.x, "critics": [critic.x for critic in learner.critics], "targets": learner.targets,
             "log_alpha": learner.log_alpha.x}
    document = {"made_by": {"numpy": np.__version__}, "settings": SETTINGS, "hidden": HIDDEN, "policy": policy, "critics": critics,
                "priors": priors, "steps": steps, "after": rounded(after)}
    fields = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in document.items()]
    text = "{\n" + ",\n".join(fields) + "\n}\n"
    Path(__file__).with_name("soft_update.json").write_text(text, encoding="utf-8")


class Adam:
    """A parameter vector with its optimizer (Kingma & Ba 2015)."""

    def __init__(self, x):
        self.x, self.start = np.array(x, dtype=np.float64), np.array(x, dtype=np.float64)
        self.m, self.v, self.t = np.zeros_like(self.x), np.zeros_like(self.x), 0

    def descend(self, gradient, regularization):
        gradient = gradient + regularization * (self.x - self.start)
        self.t += 1
        self.m = 0.9 * self.m + 0.1 * gradient
        self.v = 0.999 * self.v + 0.001 * gradient**2
        m, v = self.m / (1 - 0.9**self.t), self.v / (1 - 0.999**self.t)
        self.x = self.x - SETTINGS["step_size"] * m / (np.sqrt(v) + SETTINGS["epsilon"])


class Learner:
    def __init__(self, policy, critics, priors):
        self.policy, self.critics = Adam(policy), [Adam(critic) for critic in critics]
        self.targets, self.priors = [np.array(critic) for critic in critics], [np.array(prior) for prior in priors]
        self.log_alpha = Adam([np.log(SETTINGS["initial_alpha"])])

    def update(self, batch):
        alpha = np.exp(self.log_alpha.x[0])
        _, _, next_actions, next_log_probs = self.sample(batch["next_states"], batch["next_noise"])
        network, sigma, actions, log_probs = self.sample(batch["states"], batch["noise"])
        next_inputs = np.hstack([batch["next_states"], next_actions])
        judged = [self.value(target, prior, next_inputs)[0] for target, prior in zip(self.targets, self.priors)]
        targets = batch["rewards"] + batch["discounts"] * (np.minimum(*judged) - alpha * next_log_probs)

        inputs = np.hstack([batch["states"], batch["actions"]])
        for critic, prior in zip(self.critics, self.priors):
            values, learned, _ = self.value(critic.x, prior, inputs)
            gradient, _ = learned.backward((values - targets)[:, None] / BATCH)
            critic.descend(gradient, SETTINGS["regularization"])

        # ∂Q/∂a of the critic with the smaller value in each row.
        inputs = np.hstack([batch["states"], actions])
        evaluated = [self.value(critic.x, prior, inputs) for critic, prior in zip(self.critics, self.priors)]
        is_second = evaluated[1][0] < evaluated[0][0]
        slopes = np.zeros_like(actions)
        for weight, (_, learned, fixed) in zip((~is_second, is_second), evaluated):
            for factor, net in ((1.0, learned), (SETTINGS["prior_scale"], fixed)):
                slopes += factor * net.backward(weight[:, None].astype(float))[1][:, WIDTH:]
        # With u = μ + σ ε and a = tanh u: ∂a/∂u = 1 − a², and ∂ log π/∂u = 2a, as −log(1 − tanh² u) has the derivative 2 tanh u;
        # ∂u/∂μ = 1, ∂u/∂log σ = σ ε, and log π has −log σ beside.
        by_u = alpha * 2 * actions - slopes * (1 - actions**2)
        output_gradient = np.zeros((BATCH, 2 * COMPONENTS))
        output_gradient[:, 0::2], output_gradient[:, 1::2] = by_u, by_u * sigma * batch["noise"] - alpha
        gradient, _ = network.backward(output_gradient / BATCH)
        self.policy.descend(gradient, SETTINGS["regularization"])
        self.log_alpha.descend(np.array([-np.mean(log_probs) - SETTINGS["target_entropy"]]), 0.0)
        self.targets = [target + SETTINGS["target_rate"] * (critic.x - target) for target, critic in zip(self.targets, self.critics)]

    def sample(self, states, noise):
        network = Network(POLICY_SIZES, self.policy.x, states)
        mean, log_sigma = network.outputs[:, 0::2], network.outputs[:, 1::2]
        assert np.all(np.abs(log_sigma) < 2), "a clamped deviation"
        actions = np.tanh(mean + np.exp(log_sigma) * noise)
        log_probs = np.sum(-(noise**2) / 2 - np.log(2 * np.pi) / 2 - log_sigma - np.log(1 - actions**2), axis=1)
        return network, np.exp(log_sigma), actions, log_probs

    def value(self, parameters, prior, inputs):
        learned, fixed = Network(CRITIC_SIZES, parameters, inputs), Network(CRITIC_SIZES, prior, inputs)
        return (learned.outputs + SETTINGS["prior_scale"] * fixed.outputs)[:, 0], learned, fixed


class Network:
    """A network with its outputs for some inputs. Parameters are flat: layer by layer weight [in × out], then bias [out]."""

    def __init__(self, sizes, parameters, inputs):
        self.weights, self.activations, start = [], [inputs], 0
        for layer, (rows, columns) in enumerate(zip(sizes, sizes[1:])):
            weight = parameters[start : start + rows * columns].reshape(rows, columns)
            start += rows * columns
            x = self.activations[-1] @ weight + parameters[start : start + columns]
            start += columns
            self.weights.append(weight)
            self.activations.append(np.maximum(x, 0) if layer < len(sizes) - 2 else x)
        self.outputs = self.activations[-1]

    def backward(self, gradient):
        """Gradients with respect to the parameters, flat, and to the inputs."""
        parts = []
        for layer in reversed(range(len(self.weights))):
            x = self.activations[layer]
            parts = [(x.T @ gradient).ravel(), gradient.sum(axis=0), *parts]
            gradient = gradient @ self.weights[layer].T
            if layer > 0:
                gradient = gradient * (x > 0)
        return np.concatenate(parts), gradient


def minibatch(step):
    def drawn(what, shape, low, high):
        return np.reshape(numbers(f"{what} {step}", int(np.prod(shape)), low, high), shape).tolist()

    discounts = [SETTINGS["discount"]] * BATCH
    discounts[1] = 0.0
    return {"states": drawn("states", (BATCH, WIDTH), -2, 2), "next_states": drawn("next states", (BATCH, WIDTH), -2, 2),
            "actions": drawn("actions", (BATCH, COMPONENTS), -1, 1), "rewards": drawn("rewards", (BATCH,), -1, 2), "discounts": discounts,
            "noise": drawn("noise", (BATCH, COMPONENTS), -2, 2), "next_noise": drawn("next noise", (BATCH, COMPONENTS), -2, 2)}


def initial(name, sizes):
    """Uniform within ±1/√(inputs of the layer)."""
    layers = zip(sizes, sizes[1:])
    return [number for layer, (rows, columns) in enumerate(layers)
            for number in numbers(f"{name} {layer}", (rows + 1) * columns, -(rows**-0.5), rows**-0.5)]


def numbers(stream, count, low, high):
    """Uniform multiples of 1/256, which single precision holds exactly."""
    source = random.Random(f"soft update {stream}")
    return [round((low + (high - low) * source.random()) * 256) / 256 + 0.0 for _ in range(count)]


def rounded(value):
    """Nine significant digits: more than single precision has, and few enough to hide how processors differ."""
    if isinstance(value, dict):
        return {name: rounded(part) for name, part in value.items()}
    if np.ndim(value) > 0:
        return [rounded(part) for part in value]
    return float(f"{float(value):.9g}")


if __name__ == "__main__":
    main()
