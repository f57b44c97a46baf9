"""Computes what the policies of a run do, from `policies.safetensors` alone: needs numpy and safetensors.

    policy = Policy("recordings/cartpole/seed-0/policies.safetensors", agent=2)
    policy.greedy([0.0, 0.1, 0.02, -0.1])       # the action in this state, one number per component
"""

import json

import numpy as np
from safetensors import safe_open


class Policy:
    """The policy of one agent. `model` replaces the agent's model if models are drawn for each round."""

    def __init__(self, path, agent: int = 0, model: int | None = None):
        with safe_open(path, framework="numpy") as file:
            self.metadata = file.metadata()
            self.tensors = {name: file.get_tensor(name).astype(np.float64) for name in file.keys()}
        assert self.metadata["format_version"] == "1", "another version of the format"
        models = int(self.metadata.get("models", 1))
        self.numbers = {"agent": agent, "model": agent % models if model is None else model}
        self.outputs_of = json.loads(self.metadata["outputs"])
        self.heads = json.loads(self.metadata["heads"])
        self.scaling = json.loads(self.metadata["observation_scaling"])
        self.observations = [column["name"] for column in json.loads(self.metadata["observations"])]

    def tensor(self, template: str) -> np.ndarray:
        return self.tensors[template.format(**self.numbers)]

    def scale(self, x) -> np.ndarray:
        """Observations as inputs of networks: `[..., width]`."""
        x = np.asarray(x, dtype=np.float64)
        if self.scaling["offset"] is None:
            return x
        scaled = (x - self.tensor(self.scaling["offset"])) / self.tensor(self.scaling["scale"])
        limit = self.scaling["limit"]
        return scaled if limit is None else np.clip(scaled, -limit, limit)

    def network(self, name: str, inputs: np.ndarray, skip_connection: bool = False) -> np.ndarray:
        """Outputs of a network whose tensors are named `name`: `[..., inputs]` to `[..., outputs]`."""
        name = name.format(**self.numbers)
        layers = sum(f"{name}.layer_{layer}.weight" in self.tensors for layer in range(100))
        assert layers > 0, f"no tensors of {name}"
        x = inputs
        for layer in range(layers):
            if layer > 0:
                x = np.tanh(x) if self.metadata["activation"] == "tanh" else np.maximum(x, 0)
            if skip_connection and layer + 1 == layers:
                x = np.concatenate([x, inputs], axis=-1)
            x = x @ self.tensors[f"{name}.layer_{layer}.weight"] + self.tensors[f"{name}.layer_{layer}.bias"]
        return x

    def outputs(self, observations) -> np.ndarray:
        """Outputs that the heads describe: `[..., width]` to `[..., outputs]`."""
        x = self.scale(observations)
        return sum(term["factor"] * self.network(term["network"], x, term["skip_connection"]) for term in self.outputs_of)

    def value(self, observations) -> np.ndarray:
        """The agent's value function, of algorithms that have one: `[..., width]` to `[...]`."""
        output = self.network("agent_{agent}.value", self.scale(observations))[..., 0]
        return self.tensor("agent_{agent}.value.mean") + self.tensor("agent_{agent}.value.deviation") * output

    def head_outputs(self, observations):
        """The heads with their outputs."""
        o = self.outputs(observations)
        return [(head, o[..., head["first_output"] : head["first_output"] + head["outputs"]]) for head in self.heads]

    def greedy(self, observations) -> np.ndarray:
        """The most likely action, or the one with the largest value: `[..., width]` to `[..., components]`."""
        actions = []
        for head, o in self.head_outputs(observations):
            if head["kind"] == "gaussian":
                actions.append(head["center"] + head["half_range"] * o[..., 0])
            elif head["kind"] == "squashed_gaussian":
                actions.append(head["center"] + head["half_range"] * np.tanh(o[..., 0]))
            else:
                actions.append(np.asarray(head["values"])[np.argmax(o, axis=-1)])
        return np.stack(actions, axis=-1)

    def log_prob(self, observations, actions, temperature: float = 1.0) -> np.ndarray:
        """log π of actions, in the units of their values. Action values are divided by `temperature`, as in Gibbs exploration.
        `[N × width]`, `[N × components]` to `[N]`"""
        total = 0.0
        for column, (head, o) in enumerate(self.head_outputs(observations)):
            action = np.asarray(actions)[:, column]
            if head["kind"] == "gaussian":
                total = total + gaussian_log_prob(head, o, action)
            elif head["kind"] == "squashed_gaussian":
                total = total + squashed_gaussian_log_prob(head, o, action)
            else:
                index = np.argmin(np.abs(np.asarray(head["values"])[None, :] - action[:, None]), axis=1)
                logits = o / temperature if head["kind"] == "action_values" else o
                total = total + log_softmax(logits)[np.arange(len(index)), index]
        return total


def gaussian_log_prob(head: dict, o: np.ndarray, action: np.ndarray) -> np.ndarray:
    mean = head["center"] + head["half_range"] * o[:, 0]
    log_deviation = np.clip(o[:, 1] + head["log_deviation_offset"], *head["log_deviation_clamp"]) + np.log(head["half_range"])
    return -0.5 * ((action - mean) / np.exp(log_deviation)) ** 2 - log_deviation - 0.5 * np.log(2 * np.pi)


def squashed_gaussian_log_prob(head: dict, o: np.ndarray, action: np.ndarray) -> np.ndarray:
    """Actions at an end of the range, where u is infinite, count as actions within it."""
    relative = np.clip((action - head["center"]) / head["half_range"], -0.999999, 0.999999)
    log_deviation = np.clip(o[:, 1], *head["log_deviation_clamp"])
    standardized = (np.arctanh(relative) - o[:, 0]) / np.exp(log_deviation)
    log_density = -0.5 * standardized**2 - log_deviation - 0.5 * np.log(2 * np.pi)
    return log_density - np.log(head["half_range"] * (1 - relative**2))


def log_softmax(logits: np.ndarray) -> np.ndarray:
    shifted = logits - logits.max(axis=1, keepdims=True)
    return shifted - np.log(np.exp(shifted).sum(axis=1, keepdims=True))
