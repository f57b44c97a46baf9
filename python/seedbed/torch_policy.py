"""Policies as PyTorch modules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from torch import nn

if TYPE_CHECKING:
    from .policies import Head, Policy, Term


class PolicyModule(nn.Module):  # type: ignore[misc, unused-ignore]
    """A policy; see `Policy.to_torch`.

    Attributes:
        heads: The components of an action, which describe the outputs.
    """

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.heads: list[Head] = policy.heads
        self.limit = policy.limit
        self.register_buffer("offset", _tensor(policy.offset))
        self.register_buffer("scale", _tensor(policy.scale))
        self.networks = nn.ModuleList([_Network(term) for term in policy.terms])

    def forward(self, observations: Any) -> Any:
        """Outputs of the networks: `[..., width]` to `[..., outputs]`."""
        x = observations
        if self.offset is not None:
            x = (x - self.offset) / self.scale
            x = x if self.limit is None else x.clamp(-self.limit, self.limit)
        total = self.networks[0](x)
        for network in self.networks[1:]:
            total = total + network(x)
        return total

    def act(self, observations: Any) -> Any:
        """Greedy actions, in the form of calls of `Policy`: `[..., width]` to `[...]` or `[..., components]`."""
        with torch.no_grad():
            outputs = self(observations)
        chosen = {head.name: _greedy(head, outputs) for head in self.heads}
        discrete = [head.is_discrete for head in self.heads]
        if len(chosen) == 1 and discrete[0]:
            return chosen[self.heads[0].name]
        return torch.stack(list(chosen.values()), dim=-1) if len(set(discrete)) == 1 else chosen


class _Network(nn.Module):  # type: ignore[misc, unused-ignore]
    def __init__(self, term: Term) -> None:
        super().__init__()
        self.factor = term.factor
        self.skip_connection = term.skip_connection
        self.activation = torch.tanh if term.activation == "tanh" else torch.relu
        self.layers = nn.ModuleList([_linear(weight, bias) for weight, bias in term.layers])

    def forward(self, inputs: Any) -> Any:
        x = inputs
        for number, layer in enumerate(self.layers):
            if number > 0:
                x = self.activation(x)
            if self.skip_connection and number + 1 == len(self.layers):
                x = torch.cat([x, inputs], dim=-1)
            x = layer(x)
        return self.factor * x


def _tensor(array: Any) -> Any:
    return None if array is None else torch.as_tensor(array, dtype=torch.float32)


def _linear(weight: Any, bias: Any) -> Any:
    # Without random initial weights, which would advance PyTorch's generator.
    skip_init: Any = nn.utils.skip_init  # has no types
    layer = skip_init(nn.Linear, *weight.shape)
    with torch.no_grad():
        layer.weight.copy_(torch.as_tensor(weight.T.copy()))
        layer.bias.copy_(torch.as_tensor(bias))
    return layer


def _greedy(head: Head, outputs: Any) -> Any:
    part = outputs[..., head.first_output : head.first_output + head.outputs]
    if head.is_discrete:
        return part.argmax(dim=-1)
    if head.is_squashed:
        return head.center + head.half_range * part[..., 0].tanh()
    mean = head.center + head.half_range * part[..., 0]
    return mean.clamp(head.center - head.half_range, head.center + head.half_range)
