"""Values and gradients that seedbed's hand-written ones are held against, by automatic differentiation in double precision.

`reference.json` beside this file is its output, byte for byte; `crates/seedbed-learn/tests/it/gradients/` reads it. To make it again, in a
virtual environment of its own:

    pip install jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6 optax==0.2.8
    python crates/seedbed-learn/tests/gradients/reference.py
    git diff --exit-code crates/seedbed-learn/tests/gradients/reference.json

Only losses are written here, never their derivatives. Densities, softmax and Adam are the libraries'. Every input stands in the
JSON; those that are not written here are drawn from named streams, as multiples of 1/256, which single precision holds exactly.
Results are rounded to nine digits: more than single precision has, and few enough to hide how processors differ.
"""

import json
import math
import random
from importlib.metadata import version
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.scipy.stats import norm

jax.config.update("jax_platforms", "cpu")
jax.config.update("jax_enable_x64", True)


def main():
    reference = {
        "made_by": {library: version(library) for library in ("jax", "jaxlib", "numpy", "optax")},
        "networks": [network_case("narrow", [3, 16, 7, 2], 5), network_case("wide", [4, 32, 32, 1], 40)],
        "hidden_layers": [hidden_layer_case("rectified", "Relu", False), hidden_layer_case("rectified, normalized", "Relu", True),
                          hidden_layer_case("tanh, normalized", "Tanh", True)],
        "categorical": categorical_cases(),
        "gaussian": gaussian_cases(),
        "policy_losses": policy_loss_cases(),
        "policies": policy_cases(),
        "values": [value_case("unweighted", [1.0] * 7), value_case("weighted", numbers("sample weights", 7, 0.0, 3.0))],
        "action_values": [action_value_case("plain", False, 0.0, 0.0), action_value_case("double", True, 0.0, 0.0),
                          action_value_case("seeded, with a prior and a pull", False, 3.0, 0.25)],
        "indexed_values": [indexed_value_case("same index", False), indexed_value_case("other index, double", True)],
        "squashed_gaussian": squashed_gaussian_cases(),
        "soft_critics": [soft_critic_case("plain", False, 0.0, 0.0), soft_critic_case("normalized, with priors and a pull", True, 3.0, 0.25)],
        "soft_policies": [soft_policy_case("smallest value", "Min", False, 0.0), soft_policy_case("mean value, normalized, with priors", "Mean", True, 3.0)],
        "adam": adam_cases(),
        "pop_art": [pop_art_case("slow", 0.125), pop_art_case("fast", 0.75)],
    }
    Path(__file__).with_name("reference.json").write_text(text(reference) + "\n", encoding="utf-8")


# Networks: tanh between the layers, a linear output. Parameters are flat: layer by layer weight [in × out], then bias [out].


def mlp(sizes, parameters, inputs, activation="Tanh", normalized=False):
    """[B × in] → [B × out]. Normalized hidden layers have gains and shifts after their biases."""
    start, x = 0, inputs
    for layer, (rows, columns) in enumerate(zip(sizes, sizes[1:])):
        weight = parameters[start : start + rows * columns].reshape(rows, columns)
        bias = parameters[start + rows * columns : start + (rows + 1) * columns]
        start += (rows + 1) * columns
        x = x @ weight + bias
        if layer == len(sizes) - 2:
            return x
        if normalized:
            centered = x - jnp.mean(x, axis=1, keepdims=True)
            deviation = jnp.sqrt(jnp.mean(centered**2, axis=1, keepdims=True) + 1e-5)
            x = parameters[start : start + columns] * centered / deviation + parameters[start + columns : start + 2 * columns]
            start += 2 * columns
        x = jnp.tanh(x) if activation == "Tanh" else jnp.maximum(x, 0)


def initial(name, sizes, normalized=False):
    """Uniform within ±2/√(inputs of the layer): wide enough for tanh to bend. Gains are from ½ to 1½, shifts within ±½."""
    parameters = []
    for layer, (rows, columns) in enumerate(zip(sizes, sizes[1:])):
        bound = 2 / math.sqrt(rows)
        parameters += numbers(f"{name} {layer}", (rows + 1) * columns, -bound, bound)
        if normalized and layer < len(sizes) - 2:
            parameters += numbers(f"{name} {layer} gains", columns, 0.5, 1.5) + numbers(f"{name} {layer} shifts", columns, -0.5, 0.5)
    return parameters


def network_case(name, sizes, batch):
    """L = ½ Σ y²"""
    parameters, inputs = initial(name, sizes), numbers(f"{name} inputs", batch * sizes[0], -2.0, 2.0)

    def loss(parameters):
        return jnp.sum(mlp(sizes, parameters, rows(inputs, sizes[0])) ** 2) / 2

    outputs = mlp(sizes, array(parameters), rows(inputs, sizes[0]))
    return {"name": name, "sizes": sizes, "parameters": parameters, "inputs": inputs,
            "outputs": result(outputs), "gradient": result(jax.grad(loss)(array(parameters)))}


def hidden_layer_case(name, activation, normalized):
    """L = ½ Σ y², and its gradients with respect to parameters and to the second and third input."""
    sizes, batch = [3, 16, 7, 2], 9
    parameters, inputs = initial(name, sizes, normalized), numbers(f"{name} inputs", batch * sizes[0], -2.0, 2.0)

    def loss(parameters, inputs):
        return jnp.sum(mlp(sizes, parameters, inputs, activation, normalized) ** 2) / 2

    point = array(parameters), rows(inputs, sizes[0])
    gradient, input_gradient = jax.grad(loss, (0, 1))(*point)
    return {"name": name, "sizes": sizes, "activation": activation, "normalized": normalized, "parameters": parameters, "inputs": inputs,
            "outputs": result(mlp(sizes, *point, activation, normalized)), "gradient": result(gradient),
            "input_gradient": result(input_gradient[:, 1:])}


# Distributions.


def categorical_entropy(logits):
    log_probs = jax.nn.log_softmax(logits)
    return -jnp.sum(jnp.exp(log_probs) * log_probs, axis=-1)


def gaussian_log_density(action, mean, log_deviation):
    return norm.logpdf(action, mean, jnp.exp(log_deviation))


def gaussian_entropy(mean, log_deviation):
    """−E log π, by Gauss-Hermite quadrature, which is exact for the parabola that log π is."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(4)
    actions = mean[..., None] + jnp.exp(log_deviation)[..., None] * nodes
    density = gaussian_log_density(actions, mean[..., None], log_deviation[..., None])
    return -jnp.sum(density * weights, axis=-1) / math.sqrt(2 * math.pi)


def categorical_cases():
    several = {f"{choices} choices": numbers(f"{choices} logits", choices, -3.0, 3.0) for choices in (2, 3, 5, 18)}
    special = {"equal": [0.5] * 4, "nearly certain": [-8.0, 9.0, 1.0], "beyond single precision": [-200.0, 0.0, 100.0]}
    return [categorical_case(name, logits) for name, logits in (several | special).items()]


def categorical_case(name, logits):
    """Row a of `log_prob_gradients` is ∂log π(a)/∂logits."""
    x = array(logits)
    return {"name": name, "logits": logits,
            "log_probs": result(jax.nn.log_softmax(x)), "entropy": result(categorical_entropy(x)),
            "log_prob_gradients": result(jax.jacrev(jax.nn.log_softmax)(x)),
            "entropy_gradient": result(jax.grad(categorical_entropy)(x))}


def gaussian_cases():
    usual = [(0.5, 0.25, 0.0), (-2.0, 1.5, 0.75), (3.0, 1.0, 0.6875), (-0.75, 0.5, -2.5)]
    special = [(1.0, 1.0, -1.0), (0.125, 0.0, -4.0), (40.0, -8.0, 1.0)]
    return [gaussian_case(*case) for case in usual + special]


def gaussian_case(action, mean, log_deviation):
    """Gradients are with respect to (μ, log σ)."""
    x = (array(action), array(mean), array(log_deviation))
    return {"action": action, "mean": mean, "log_deviation": log_deviation,
            "log_density": result(gaussian_log_density(*x)),
            "gradient": result(jax.grad(gaussian_log_density, (1, 2))(*x)),
            "entropy": result(gaussian_entropy(*x[1:]))}


# Policy losses of one step; a loss is named as Rust's enum of the test is written in JSON.


def surrogate(loss, log_prob, behavior, advantage):
    """The loss at log π(a|s), with log μ(a|s) = `behavior`."""
    ratio = jnp.exp(log_prob - behavior)
    if loss == "Simple":
        return -log_prob * advantage
    if "Ppo" in loss:
        clip = loss["Ppo"]["clip"]
        return -jnp.minimum(ratio * advantage, jnp.clip(ratio, 1 - clip, 1 + clip) * advantage)
    cap = loss["OffPac"]["cap"]
    weight = jax.lax.stop_gradient(ratio if cap is None else jnp.minimum(ratio, cap))
    return -weight * log_prob * advantage


def policy_loss_cases():
    """ρ = e^−1, e^−⅛, 1, e^⅛, e^1 against both signs of A: every branch of the clipped surrogate, and both of the cap."""
    losses = ["Simple", ppo(0.25), ppo(0.625), off_pac(None), off_pac(1.0), off_pac(2.5)]
    log_ratios, advantages = [-1.0, -0.125, 0.0, 0.125, 1.0], [1.5, -0.75]
    return [policy_loss_case(loss, -1.25, -1.25 - log_ratio, advantage)
            for loss in losses for log_ratio in log_ratios for advantage in advantages]


def policy_loss_case(loss, log_prob, behavior, advantage):
    value, slope = jax.value_and_grad(surrogate, 1)(loss, log_prob, behavior, advantage)
    return {"loss": loss, "log_prob": log_prob, "behavior": behavior, "advantage": advantage,
            "value": result(value), "slope": result(slope)}


def ppo(clip):
    return {"Ppo": {"clip": clip}}


def off_pac(cap):
    return {"OffPac": {"cap": cap}}


# Whole policies: mean loss − bonus · mean entropy, from the network's parameters on.

CATEGORICAL = {"Categorical": {"choices": 3}}
# Outputs are relative to the range: μ = center + half-range · y₀, log σ = clip(y₁ + log initial deviation) + log half-range.
GAUSSIAN = {"Gaussian": {"range": [-2.0, 6.0], "initial_deviation": 4.25}}
LOG_DEVIATION_BOUNDS = (-4.0, 1.0)


def moments(head, outputs):
    """([B × 2]) → (μ, log σ), each [B]"""
    low, high = head["Gaussian"]["range"]
    center, half_range = (low + high) / 2, (high - low) / 2
    relative = outputs[:, 1] + math.log(head["Gaussian"]["initial_deviation"])
    return center + half_range * outputs[:, 0], jnp.clip(relative, *LOG_DEVIATION_BOUNDS) + math.log(half_range)


def log_probs_and_entropies(head, outputs, actions):
    """[B × out], [B] → [B], [B]"""
    if "Categorical" in head:
        log_probs = jax.nn.log_softmax(outputs)
        return log_probs[jnp.arange(len(actions)), np.array(actions, dtype=int)], categorical_entropy(outputs)
    mean, log_deviation = moments(head, outputs)
    return gaussian_log_density(array(actions), mean, log_deviation), gaussian_entropy(mean, log_deviation)


def policy_cases():
    losses = {"simple": "Simple", "ppo": ppo(0.25), "off-pac": off_pac(None), "capped off-pac": off_pac(1.0)}
    heads = {"categorical": (CATEGORICAL, [4, 8, 8, 3], [0.0, 2.0, 1.0, 1.0, 0.0, 2.0]),
             "gaussian": (GAUSSIAN, [4, 8, 8, 2], [14.0, -9.0, 2.0, 21.0, 0.25, -4.0])}
    return [policy_case(f"{head} {loss}", *heads[head], losses[loss]) for head in heads for loss in losses]


def policy_case(name, head, sizes, actions, loss, bonus=0.01):
    family = name.split()[0]
    parameters, states = initial(family, sizes), numbers(f"{family} states", len(actions) * sizes[0], -2.0, 2.0)
    advantages = [1.0, -0.5, 0.75, -2.0, 1.25, -1.5]
    outputs = mlp(sizes, array(parameters), rows(states, sizes[0]))
    log_probs, _ = log_probs_and_entropies(head, outputs, actions)
    # Both sides of the clip with both signs of the advantage, and within it.
    behavior = exact(log_probs - array([0.75, 0.5, 0.0625, -0.625, -0.5, -0.125]))

    def objective(parameters):
        outputs = mlp(sizes, parameters, rows(states, sizes[0]))
        log_probs, entropies = log_probs_and_entropies(head, outputs, actions)
        return jnp.mean(surrogate(loss, log_probs, array(behavior), array(advantages))) - bonus * jnp.mean(entropies)

    keep_off_kinks(head, outputs, log_probs - array(behavior), loss)
    value, gradient = jax.value_and_grad(objective)(array(parameters))
    return {"name": name, "head": head, "loss": loss, "entropy_bonus": bonus, "sizes": sizes, "parameters": parameters,
            "states": states, "actions": actions, "behavior": behavior, "advantages": advantages,
            "value": result(value), "gradient": result(gradient)}


def keep_off_kinks(head, outputs, log_ratios, loss):
    """Where a loss has no derivative there is nothing to compare; and a bound that nothing passes is not compared either."""
    if "Ppo" in loss:
        keep_off(jnp.exp(log_ratios), (1 - loss["Ppo"]["clip"], 1 + loss["Ppo"]["clip"]))
    if "Gaussian" in head:
        keep_off(outputs[:, 1] + math.log(head["Gaussian"]["initial_deviation"]), LOG_DEVIATION_BOUNDS[1:])


def keep_off(quantities, bounds):
    for bound in bounds:
        assert jnp.min(jnp.abs(quantities - bound)) > 0.01, (quantities, bound)
        assert jnp.any(quantities < bound) and jnp.any(quantities > bound), (quantities, bound)


def value_case(name, weights):
    """½ mean w (Ŷ − Y)², Y being normalized already."""
    sizes, batch = [4, 8, 8, 1], len(weights)
    parameters, states = initial("value", sizes), numbers("value states", batch * sizes[0], -2.0, 2.0)
    targets = numbers("value targets", batch, -2.0, 2.0)

    def objective(parameters):
        values = mlp(sizes, parameters, rows(states, sizes[0]))[:, 0]
        return jnp.mean(array(weights) * (values - array(targets)) ** 2) / 2

    value, gradient = jax.value_and_grad(objective)(array(parameters))
    return {"name": name, "sizes": sizes, "parameters": parameters, "states": states, "targets": targets, "weights": weights,
            "value": result(value), "gradient": result(gradient)}


def action_value_case(name, double, prior_scale, regularization):
    """½ mean w (r + z + γ Q'(s', b) − Q(s, a))² + ½ λ ‖θ − θ̂‖², where Q = f + β p and b is the best by Q' or, if double, by Q."""
    sizes, batch, stream = [3, 8, 8, 4], 7, f"action values {name}"
    parameters, target, prior, start = (initial(f"{stream} {role}", sizes) for role in ("learned", "target", "prior", "start"))
    states, next_states = (numbers(f"{stream} {when}", batch * sizes[0], -2.0, 2.0) for when in ("now", "next"))
    rewards, seeds, weights = (numbers(f"{stream} {what}", batch, -1.0, 2.0) for what in ("rewards", "seeds", "weights"))
    actions, discounts = [0, 3, 1, 2, 2, 0, 1], [0.875, 0.875, 0.0, 0.875, 0.875, 0.875, 0.0]
    weights = [abs(weight) for weight in weights]

    def values(parameters, states):
        return sum(scale * mlp(sizes, array(p), rows(states, sizes[0])) for scale, p in ((1.0, parameters), (prior_scale, prior)))

    def objective(parameters):
        judged = values(target, next_states)
        best = jnp.argmax(values(parameters, next_states) if double else judged, axis=1)
        followed = jax.lax.stop_gradient(judged[jnp.arange(batch), best])
        targets = array(rewards) + array(seeds) + array(discounts) * followed
        errors = targets - values(parameters, states)[jnp.arange(batch), jnp.array(actions)]
        pull = regularization * jnp.sum((parameters - array(start)) ** 2) / 2
        return jnp.mean(array(weights) * errors**2) / 2 + pull

    value, gradient = jax.value_and_grad(objective)(array(parameters))
    return {"name": name, "sizes": sizes, "parameters": parameters, "target": target, "prior": prior, "start": start,
            "states": states, "next_states": next_states, "actions": actions, "rewards": rewards, "seeds": seeds,
            "discounts": discounts, "weights": weights, "double": double, "prior_scale": prior_scale,
            "regularization": regularization, "value": result(value), "gradient": result(gradient)}


def indexed_value_case(name, independent):
    """½ mean (r + σ zᵀξ + γ Q'(s', b; ξ⁻) − Q(s, a; ξ))², where Q(·; ξ) = o₀ + Σ ξₘ oₘ, and b is the best at ξ⁻ by Q' or, if independent, by Q."""
    choices, dimension, samples, batch, sigma, stream = 3, 2, 4, 5, 0.5, f"indexed values {name}"
    sizes = [3, 8, (1 + dimension) * choices]
    parameters, target = (initial(f"{stream} {role}", sizes) for role in ("learned", "target"))
    states, next_states = (numbers(f"{stream} {when}", batch * sizes[0], -2.0, 2.0) for when in ("now", "next"))
    rewards, noise = numbers(f"{stream} rewards", batch, -1.0, 2.0), numbers(f"{stream} noise", batch * dimension, -1.0, 1.0)
    indices, others = (numbers(f"{stream} {which}", batch * samples * dimension, -1.0, 1.0) for which in ("indices", "others"))
    target_indices = others if independent else indices
    actions, discounts = [0, 2, 1, 1, 0], [0.875, 0.0, 0.875, 0.875, 0.875]

    def cube(indices):
        return array(indices).reshape(batch, samples, dimension)

    def values(parameters, states, indices):
        heads = mlp(sizes, array(parameters), rows(states, sizes[0])).reshape(batch, 1 + dimension, choices)
        return heads[:, None, 0] + jnp.einsum("bjm,bmn->bjn", cube(indices), heads[:, 1:])

    def objective(parameters):
        judged = values(target, next_states, target_indices)
        best = jnp.argmax(values(parameters, next_states, target_indices) if independent else judged, axis=2)
        followed = jax.lax.stop_gradient(jnp.take_along_axis(judged, best[:, :, None], axis=2)[:, :, 0])
        perturbed = array(rewards)[:, None] + sigma * jnp.einsum("bjm,bm->bj", cube(indices), rows(noise, dimension))
        targets = perturbed + array(discounts)[:, None] * followed
        chosen = values(parameters, states, indices)[jnp.arange(batch), :, jnp.array(actions)]
        return jnp.mean((targets - chosen) ** 2) / 2

    value, gradient = jax.value_and_grad(objective)(array(parameters))
    return {"name": name, "sizes": sizes, "dimension": dimension, "samples": samples, "sigma": sigma, "parameters": parameters,
            "target": target, "states": states, "next_states": next_states, "actions": actions, "rewards": rewards, "noise": noise,
            "indices": indices, "target_indices": target_indices, "discounts": discounts, "double": independent,
            "value": result(value), "gradient": result(gradient)}


# Soft actor-critic: actions are tanh(μ + σ ε), and log π has the density of the squashed action. Outputs are μ and log σ by turns.

SQUASHED_BOUNDS = (-20.0, 2.0)


def squashed(outputs, noise):
    """[B × 2d], [B × d] → actions [B × d], log π of each component [B × d]"""
    mean, log_deviation = outputs[:, 0::2], jnp.clip(outputs[:, 1::2], *SQUASHED_BOUNDS)
    deviation = jnp.exp(log_deviation)
    before = mean + deviation * noise
    return jnp.tanh(before), norm.logpdf(before, mean, deviation) - jnp.log(1 - jnp.tanh(before) ** 2)


def squashed_gaussian_cases():
    """(μ, log σ, ε): usual ones, a nearly greedy one, and one that is nearly an end of the range."""
    return [squashed_gaussian_case(*case) for case in ((0.5, 0.25, -1.0), (-1.5, -0.75, 0.5), (0.0, 1.5, 1.25), (0.25, -6.0, 2.0), (3.0, 0.0, 1.0))]


def squashed_gaussian_case(mean, log_deviation, noise):
    """The gradient is that of α log π(a) − 2a with α = ¾, with respect to (μ, log σ), for constant ε."""

    def loss(outputs):
        action, log_density = squashed(outputs[None], array([[noise]]))
        return (0.75 * log_density - 2.0 * action)[0, 0]

    outputs = array([mean, log_deviation])
    action, log_density = squashed(outputs[None], array([[noise]]))
    return {"mean": mean, "log_deviation": log_deviation, "noise": noise, "action": result(action[0, 0]),
            "log_density": result(log_density[0, 0]), "gradient": result(jax.grad(loss)(outputs))}


def soft_critic_case(name, normalized, prior_scale, regularization):
    """½ mean (r + γ (min Q'(s', a') − α log π(a'|s')) − Q(s, a))² + ½ λ ‖θ − θ̂‖², where Q = f + β p, for one of two critics."""
    width, components, batch, alpha, stream = 3, 2, 6, 0.5, f"soft critic {name}"
    policy_sizes, sizes = [width, 8, 8, 2 * components], [width + components, 8, 8, 1]
    policy = initial(f"{stream} policy", policy_sizes)
    parameters, start, *others = (initial(f"{stream} {role}", sizes, normalized)
                                  for role in ("learned", "start", "target 0", "target 1", "prior 0", "prior 1"))
    targets, priors = others[:2], others[2:]
    states, next_states = (numbers(f"{stream} {when}", batch * width, -2.0, 2.0) for when in ("now", "next"))
    actions, noise = numbers(f"{stream} actions", batch * components, -1.0, 1.0), numbers(f"{stream} noise", batch * components, -2.0, 2.0)
    rewards, discounts = numbers(f"{stream} rewards", batch, -1.0, 2.0), [0.875, 0.0, 0.875, 0.875, 0.75, 0.875]

    def values(parameters, prior, states, actions):
        inputs = jnp.concatenate([states, actions], axis=1)
        return sum(scale * mlp(sizes, array(p), inputs, "Relu", normalized)[:, 0] for scale, p in ((1.0, parameters), (prior_scale, prior)))

    after = rows(next_states, width)
    next_actions, log_densities = squashed(mlp(policy_sizes, array(policy), after, "Relu"), rows(noise, components))
    judged = [values(target, prior, after, next_actions) for target, prior in zip(targets, priors)]
    followed = jnp.minimum(*judged) - alpha * jnp.sum(log_densities, axis=1)
    wanted = array(rewards) + array(discounts) * followed

    def objective(parameters):
        errors = values(parameters, priors[0], rows(states, width), rows(actions, components)) - wanted
        return jnp.mean(errors**2) / 2 + regularization * jnp.sum((parameters - array(start)) ** 2) / 2

    value, gradient = jax.value_and_grad(objective)(array(parameters))
    return {"name": name, "normalized": normalized, "prior_scale": prior_scale, "regularization": regularization, "alpha": alpha,
            "policy_sizes": policy_sizes, "policy": policy, "sizes": sizes, "parameters": parameters, "start": start, "targets": targets,
            "priors": priors, "states": states, "next_states": next_states, "actions": actions, "noise": noise, "rewards": rewards,
            "discounts": discounts, "wanted": result(wanted), "value": result(value), "gradient": result(gradient)}


def soft_policy_case(name, combination, normalized, prior_scale):
    """mean(α log π(a|s) − Q(s, a)), where Q is the minimum or the mean over two critics; and the derivative of −log α (mean log π + H̄)."""
    width, components, batch, alpha, target_entropy, stream = 3, 2, 6, 0.5, -2.0, f"squashed policy {name}"
    policy_sizes, sizes = [width, 8, 8, 2 * components], [width + components, 8, 8, 1]
    policy = initial(f"{stream} policy", policy_sizes)
    critics, priors = ([initial(f"{stream} {role} {number}", sizes, normalized) for number in (0, 1)] for role in ("critic", "prior"))
    states, noise = numbers(f"{stream} states", batch * width, -3.0, 3.0), numbers(f"{stream} noise", batch * components, -2.0, 2.0)

    def values(actions):
        inputs = jnp.concatenate([rows(states, width), actions], axis=1)
        terms = ((1.0, critics), (prior_scale, priors))
        return [sum(scale * mlp(sizes, array(networks[number]), inputs, "Relu", normalized)[:, 0] for scale, networks in terms) for number in (0, 1)]

    def sample(policy):
        return squashed(mlp(policy_sizes, policy, rows(states, width), "Relu"), rows(noise, components))

    def objective(policy):
        actions, log_densities = sample(policy)
        judged = values(actions)
        value = jnp.minimum(*judged) if combination == "Min" else (judged[0] + judged[1]) / 2
        return jnp.mean(alpha * jnp.sum(log_densities, axis=1) - value)

    def temperature_loss(log_alpha):
        return -log_alpha * (jnp.mean(jnp.sum(sample(array(policy))[1], axis=1)) + target_entropy)

    keep_off(mlp(policy_sizes, array(policy), rows(states, width), "Relu")[:, 1::2], SQUASHED_BOUNDS[1:])
    keep_off(jnp.subtract(*values(sample(array(policy))[0])), (0.0,))
    value, gradient = jax.value_and_grad(objective)(array(policy))
    return {"name": name, "combination": combination, "normalized": normalized, "prior_scale": prior_scale, "alpha": alpha,
            "target_entropy": target_entropy, "policy_sizes": policy_sizes, "policy": policy, "sizes": sizes, "critics": critics,
            "priors": priors, "states": states, "noise": noise, "value": result(value), "gradient": result(gradient),
            "temperature_slope": result(jax.grad(temperature_loss)(math.log(alpha)))}


# Adam and Pop-Art.


def adam_cases():
    """A large ε, against which it shows where ε is added: to √v̂, the root of the corrected moment."""
    usual = {"step_size": 0.125, "beta1": 0.9, "beta2": 0.999, "epsilon": 1e-8}
    return [adam_case("usual", usual, 1.0), adam_case("large epsilon, half steps", usual | {"epsilon": 0.5}, 0.5),
            adam_case("short memory", usual | {"beta1": 0.5, "beta2": 0.75, "epsilon": 0.0625}, 1.0)]


def adam_case(name, settings, factor):
    """Row t of `trajectory` is θ after step t, along row t of `gradients`."""
    count, steps = 5, 3
    start, gradients = numbers("adam start", count, -1.0, 1.0), numbers("adam gradients", steps * count, -2.0, 2.0)
    optimizer = optax.adam(factor * settings["step_size"], settings["beta1"], settings["beta2"], settings["epsilon"])
    parameters, trajectory = array(start), []
    state = optimizer.init(parameters)
    for gradient in rows(gradients, count):
        change, state = optimizer.update(gradient, state)
        parameters = optax.apply_updates(parameters, change)
        trajectory.append(parameters)
    return {"name": name, "settings": settings, "factor": factor, "start": start, "gradients": gradients,
            "trajectory": result(jnp.stack(trajectory))}


def pop_art_case(name, beta):
    """Moment p is Σ β (1−β)^age mean Yᵖ, and (1−β)^updates of where it starts: 0 and 1. Denormalized outputs do not change."""
    sizes, batch, updates, count = [3, 8, 1], 6, 3, 4
    parameters, inputs = initial("pop-art", sizes), numbers("pop-art inputs", batch * sizes[0], -2.0, 2.0)
    targets = [numbers(f"pop-art targets {update}", count, -20.0, 80.0 + 100.0 * update) for update in range(updates)]
    means = [moment(1, beta, targets[:update]) for update in range(1, updates + 1)]
    squares = [moment(2, beta, targets[:update]) + (1 - beta) ** update for update in range(1, updates + 1)]
    return {"name": name, "beta": beta, "sizes": sizes, "parameters": parameters, "inputs": inputs, "targets": targets,
            "means": result(means), "deviations": result([math.sqrt(square - mean**2) for square, mean in zip(squares, means)]),
            "denormalized": result(mlp(sizes, array(parameters), rows(inputs, sizes[0])))}


def moment(power, beta, targets):
    ages = range(len(targets) - 1, -1, -1)
    return sum(beta * (1 - beta) ** age * np.mean(np.array(y) ** power) for age, y in zip(ages, targets))


# Numbers in and out.


def numbers(stream, count, low, high):
    """Uniform multiples of 1/256."""
    source = random.Random(stream)
    return exact([low + (high - low) * source.random() for _ in range(count)])


def exact(numbers):
    """Rounded to multiples of 1/256."""
    return [round(float(number) * 256) / 256 + 0.0 for number in numbers]


def array(numbers):
    return jnp.array(numbers, dtype=jnp.float64)


def rows(numbers, width):
    return array(numbers).reshape(-1, width)


def result(numbers):
    """Nine significant digits and at most thirteen decimals, flat; what rounding errors leave of a zero is zero."""
    if np.ndim(numbers) == 0:
        return round(float(f"{float(numbers):.9g}"), 13) + 0.0
    return [result(number) for number in np.asarray(numbers).ravel()]


def text(value, indent=""):
    """JSON, a line for each field."""
    inner = indent + "  "
    if isinstance(value, dict) and any(isinstance(field, (dict, list)) for field in value.values()) and len(value) > 1:
        fields = [f"{inner}{json.dumps(name)}: {text(field, inner)}" for name, field in value.items()]
        return "{\n" + ",\n".join(fields) + "\n" + indent + "}"
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(inner + text(field, inner) for field in value) + "\n" + indent + "]"
    return json.dumps(value)


if __name__ == "__main__":
    main()
