"""The workbench's gradient steps, written in JAX and compiled by XLA, on one core.

`update`: one agent of sixteen learns from a round of 16 trajectories of 200 steps. For each trajectory, in turn: value
targets are per-decision importance-weighted returns whose products of ratios are at most 1, the policy takes one step
of Adam on PPO's clipped surrogate, and the value function one on the squared error. Both networks are 4-32-32.

`ensemble`: thirty value networks 6-50-50-3 with fixed prior networks take one step of Adam each on the squared TD
error of a minibatch of 16.

`soft`: soft actor-critic with 17 observations and 6 actions. For each environment step the policy acts for one
observation, its transition enters the replay buffer, and two critics, the policy and the temperature take a gradient
step on a minibatch that is drawn in the compiled program. Twenty steps are compiled into one call, which an environment
outside of JAX would not allow: the cost of twenty calls is left out.
"""

import argparse
import json
import os
import time

os.environ["JAX_PLATFORMS"] = "cpu"
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # XLA uses all cores, whatever its flags say.
os.environ["XLA_FLAGS"] = (
    "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

STEPS, TRAJECTORIES, MODELS, MINIBATCH = 200, 16, 30, 16
OBSERVATIONS, ACTIONS, REPLAY, SOFT_STEPS = 17, 6, 100_000, 20
DISCOUNT, CLIP, PRIOR_SCALE = 0.99, 0.2, 3.0


def network(key, sizes):
    """Weights and biases, uniform within ±1/√inputs."""
    layers = []
    for inputs, outputs in zip(sizes, sizes[1:]):
        key, first, second = jax.random.split(key, 3)
        bound = inputs**-0.5
        weight = jax.random.uniform(first, (inputs, outputs), minval=-bound, maxval=bound)
        bias = jax.random.uniform(second, (outputs,), minval=-bound, maxval=bound)
        layers.append((weight, bias))
    return layers


def forward(layers, x, activation=jnp.tanh):
    for weight, bias in layers[:-1]:
        x = activation(x @ weight + bias)
    weight, bias = layers[-1]
    return x @ weight + bias


def adam_start(parameters):
    zeros = jax.tree.map(jnp.zeros_like, parameters)
    return zeros, zeros, jnp.zeros(())


def adam(parameters, gradient, state, rate=1e-3, beta1=0.9, beta2=0.999, epsilon=1e-8):
    first, second, count = state
    count += 1
    first = jax.tree.map(lambda m, g: beta1 * m + (1 - beta1) * g, first, gradient)
    second = jax.tree.map(lambda v, g: beta2 * v + (1 - beta2) * g * g, second, gradient)
    rate = rate * jnp.sqrt(1 - beta2**count) / (1 - beta1**count)
    step = jax.tree.map(lambda m, v: rate * m / (jnp.sqrt(v) + epsilon), first, second)
    return jax.tree.map(jnp.subtract, parameters, step), (first, second, count)


def log_probabilities(policy, states, actions):
    logits = jax.nn.log_softmax(forward(policy, states))
    return jnp.take_along_axis(logits, actions[:, None], axis=1)[:, 0]


def capped_returns(log_ratios, rewards):
    """Σ_k γ^(k−t) min(1, ρ_t … ρ_k) r_k for each t: all pairs (t, k) at once, without an exponential per pair."""
    sums = jnp.cumsum(log_ratios)
    before = sums - log_ratios
    products = jnp.minimum(jnp.exp(sums)[None, :] * jnp.exp(-before)[:, None], 1.0)
    index = np.arange(STEPS)
    lag = index[None, :] - index[:, None]
    weights = np.where(lag >= 0, DISCOUNT ** np.maximum(lag, 0), 0.0).astype(np.float32)
    return (weights * products) @ rewards


def learn_from_trajectory(carry, trajectory):
    policy, policy_state, value, value_state, mean, deviation = carry
    states, actions, behavior, rewards = trajectory
    log_ratios = jnp.clip(log_probabilities(policy, states, actions) - behavior, -20, 20)
    outputs = forward(value, states)[:, 0]
    values = deviation * outputs + mean
    targets = capped_returns(log_ratios, rewards)
    following = jnp.append(targets[1:], 0.0)
    advantages = rewards + DISCOUNT * following - values
    mean = 0.9 * mean + 0.1 * targets.mean()
    deviation = jnp.maximum(0.9 * deviation + 0.1 * targets.std(), 1e-2)

    def surrogate(policy):
        ratios = jnp.exp(log_probabilities(policy, states, actions) - behavior)
        clipped = jnp.clip(ratios, 1 - CLIP, 1 + CLIP)
        return -jnp.minimum(ratios * advantages, clipped * advantages).mean()

    def squared_error(value):
        outputs = forward(value, states)[:, 0]
        return 0.5 * jnp.mean((outputs - (targets - mean) / deviation) ** 2)

    policy, policy_state = adam(policy, jax.grad(surrogate)(policy), policy_state)
    value, value_state = adam(value, jax.grad(squared_error)(value), value_state)
    return (policy, policy_state, value, value_state, mean, deviation), None


def update():
    keys = jax.random.split(jax.random.key(0), 6)
    policy, value = network(keys[0], [4, 32, 32, 2]), network(keys[1], [4, 32, 32, 1])
    shape = (TRAJECTORIES, STEPS)
    trajectories = (
        jax.random.uniform(keys[2], (*shape, 4), minval=-1.0),
        jax.random.randint(keys[3], shape, 0, 2),
        jax.random.uniform(keys[4], shape, minval=-0.8, maxval=-0.6),
        jnp.ones(shape),
    )
    carry = (policy, adam_start(policy), value, adam_start(value), jnp.zeros(()), jnp.ones(()))
    learn = jax.jit(lambda carry: jax.lax.scan(learn_from_trajectory, carry, trajectories)[0])
    return lambda: learn(carry), TRAJECTORIES * STEPS


def td_step(parameters, state, target, prior, batch):
    states, actions, rewards, following, discounts = batch
    bootstrap = forward(target, following) + PRIOR_SCALE * forward(prior, following)
    targets = rewards + discounts * bootstrap.max(axis=1)
    fixed = PRIOR_SCALE * forward(prior, states)

    def loss(parameters):
        values = forward(parameters, states) + fixed
        chosen = jnp.take_along_axis(values, actions[:, None], axis=1)[:, 0]
        return 0.5 * jnp.mean((targets - chosen) ** 2)

    return adam(parameters, jax.grad(loss)(parameters), state)


def ensemble():
    sizes = [6, 50, 50, 3]
    keys = jax.random.split(jax.random.key(0), 3 * MODELS).reshape(3, MODELS)
    parameters = jax.vmap(lambda key: network(key, sizes))(keys[0])
    prior = jax.vmap(lambda key: network(key, sizes))(keys[1])
    keys = jax.random.split(keys[2, 0], 4)
    shape = (MODELS, MINIBATCH)
    batch = (
        jax.random.uniform(keys[0], (*shape, 6), minval=-1.0),
        jax.random.randint(keys[1], shape, 0, 3),
        jax.random.uniform(keys[2], shape),
        jax.random.uniform(keys[3], (*shape, 6), minval=-1.0),
        jnp.full(shape, DISCOUNT),
    )
    state = jax.vmap(adam_start)(parameters)
    learn = jax.jit(jax.vmap(td_step))
    return lambda: learn(parameters, state, parameters, prior, batch), MODELS


def soft_action(policy, observations, key):
    """Actions tanh(μ + σ ε) and their log densities."""
    mean, log_deviation = jnp.split(forward(policy, observations, jax.nn.relu), 2, axis=-1)
    log_deviation = jnp.clip(log_deviation, -20, 2)
    noise = jax.random.normal(key, mean.shape)
    raw = mean + jnp.exp(log_deviation) * noise
    correction = 2 * (jnp.log(2.0) - raw - jax.nn.softplus(-2 * raw))
    log_density = -0.5 * noise**2 - log_deviation - 0.5 * jnp.log(2 * jnp.pi) - correction
    return jnp.tanh(raw), log_density.sum(axis=-1)


def critic_values(critics, observations, actions):
    """Values of both critics, [2, batch]."""
    inputs = jnp.concatenate([observations, actions], axis=-1)
    return jax.vmap(lambda critic: forward(critic, inputs, jax.nn.relu)[:, 0])(critics)


def soft_step(carry, key, minibatch):
    (policy, policy_state), (critics, critic_state), target, (log_alpha, alpha_state), replay, count = carry
    keys = jax.random.split(key, 4)
    states, actions, rewards, following = replay
    action, _ = soft_action(policy, states[count % REPLAY], keys[0])
    actions = actions.at[count % REPLAY].set(action)
    rows = jax.random.randint(keys[1], (minibatch,), 0, REPLAY)
    states, chosen, reward, after = states[rows], actions[rows], rewards[rows], following[rows]
    alpha = jnp.exp(log_alpha)
    next_action, next_log_density = soft_action(policy, after, keys[2])
    bootstrap = critic_values(target, after, next_action).min(axis=0) - alpha * next_log_density
    targets = reward + DISCOUNT * bootstrap

    def critic_loss(critics):
        return 0.5 * ((critic_values(critics, states, chosen) - targets) ** 2).mean(axis=1).sum()

    critics, critic_state = adam(critics, jax.grad(critic_loss)(critics), critic_state, 3e-4)

    def policy_loss(policy):
        sampled, log_density = soft_action(policy, states, keys[3])
        value = critic_values(critics, states, sampled).min(axis=0)
        return (alpha * log_density - value).mean(), log_density.mean()

    gradient, log_density = jax.grad(policy_loss, has_aux=True)(policy)
    policy, policy_state = adam(policy, gradient, policy_state, 3e-4)
    log_alpha, alpha_state = adam(log_alpha, ACTIONS - log_density, alpha_state, 3e-4)
    target = jax.tree.map(lambda slow, fast: slow + 0.005 * (fast - slow), target, critics)
    replay = (replay[0], actions, rewards, following)
    return ((policy, policy_state), (critics, critic_state), target, (log_alpha, alpha_state), replay, count + 1), None


def soft(units, minibatch):
    keys = jax.random.split(jax.random.key(0), 8)
    policy = network(keys[0], [OBSERVATIONS, units, units, 2 * ACTIONS])
    critics = jax.vmap(lambda key: network(key, [OBSERVATIONS + ACTIONS, units, units, 1]))(jax.random.split(keys[1]))
    target = jax.tree.map(jnp.copy, critics)
    replay = (
        jax.random.uniform(keys[2], (REPLAY, OBSERVATIONS), minval=-1.0),
        jax.random.uniform(keys[3], (REPLAY, ACTIONS), minval=-1.0),
        jax.random.uniform(keys[4], (REPLAY,), minval=-1.0),
        jax.random.uniform(keys[5], (REPLAY, OBSERVATIONS), minval=-1.0),
    )
    alpha = jnp.zeros(())
    carry = ((policy, adam_start(policy)), (critics, adam_start(critics)), target, (alpha, adam_start(alpha)), replay, 0)

    def steps(carry, key):
        return jax.lax.scan(lambda carry, key: soft_step(carry, key, minibatch), carry, jax.random.split(key, SOFT_STEPS))[0]

    # Copies, because no array can be given away twice.
    learn, state = jax.jit(steps, donate_argnums=0), [jax.tree.map(jnp.copy, carry)]

    def run():
        state[0] = learn(state[0], keys[6])
        return state[0][-1]

    return run, SOFT_STEPS


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("work", choices=["update", "ensemble", "soft"])
parser.add_argument("--seconds", type=float, default=1.0, help="CPU time of the measurement")
parser.add_argument("--units", type=int, default=256, help="units of each of two layers of `soft`")
parser.add_argument("--minibatch", type=int, default=256, help="transitions per gradient step of `soft`")
arguments = parser.parse_args()
works = {"update": update, "ensemble": ensemble, "soft": lambda: soft(arguments.units, arguments.minibatch)}
run, units = works[arguments.work]()
for _ in range(3):
    jax.block_until_ready(run())
count, start, wall = 0, time.process_time(), time.perf_counter()
while time.process_time() - start < arguments.seconds:
    jax.block_until_ready(run())
    count += units
# XLA's threads may spin while they wait: the smaller of CPU time and wall time is to JAX's advantage.
seconds = min(time.process_time() - start, time.perf_counter() - wall)
print(json.dumps({"units": count, "cpu_seconds": seconds}))
