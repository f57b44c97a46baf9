"""Policies as ONNX files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

if TYPE_CHECKING:
    from .policies import Head, Policy, Term

# Old enough for all readers of the last years: opset 17 is of 2022.
OPSET = 17
IR_VERSION = 8


def write(policy: Policy, path: Path) -> Path:
    """Write a policy; see `Policy.to_onnx`."""
    graph = _Graph()
    x = graph.scaled(policy, "observation")
    terms = [graph.network(term, x) for term in policy.terms]
    graph.node("Sum", terms, "outputs")
    results = graph.actions(policy.heads, "outputs")
    width, outputs = len(policy.observations), sum(head.outputs for head in policy.heads)
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            f"policy of agent {policy.agent}",
            [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["N", width])],
            [helper.make_tensor_value_info("outputs", TensorProto.FLOAT, ["N", outputs]), *results],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="seedbed",
        producer_version=policy.metadata["seedbed_version"],
    )
    helper.set_model_props(model, policy.metadata | {"agent": str(policy.agent), "model": str(policy.model)})
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)
    return path


class _Graph:
    """Nodes and constants of a graph, which are added in the order in which they are computed."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def node(self, kind: str, inputs: list[str], output: str | None = None, **attributes: Any) -> str:
        """Add a node, and return the name of its output."""
        name = output or f"{kind.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def constant(self, values: Any, kind: type = np.float32) -> str:
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(values, kind), name))
        return name

    def scaled(self, policy: Policy, x: str) -> str:
        if policy.offset is None or policy.scale is None:
            return x
        centered = self.node("Sub", [x, self.constant(policy.offset)])
        x = self.node("Div", [centered, self.constant(policy.scale)])
        if policy.limit is None:
            return x
        return self.node("Clip", [x, self.constant(-policy.limit), self.constant(policy.limit)])

    def network(self, term: Term, inputs: str) -> str:
        x = inputs
        for number, (weight, bias) in enumerate(term.layers):
            if number > 0:
                x = self.node("Tanh" if term.activation == "tanh" else "Relu", [x])
            if term.skip_connection and number + 1 == len(term.layers):
                x = self.node("Concat", [x, inputs], axis=1)
            x = self.node("Gemm", [x, self.constant(weight), self.constant(bias)])
        return x if term.factor == 1.0 else self.node("Mul", [x, self.constant(term.factor)])

    def actions(self, heads: list[Head], outputs: str) -> list[Any]:
        """Add greedy actions, and return the outputs of the graph."""
        discrete = [head.is_discrete for head in heads]
        if len(heads) == 1 and discrete[0]:
            self.node("Identity", [self.component(heads[0], outputs)], "action")
            return [helper.make_tensor_value_info("action", TensorProto.INT64, ["N"])]
        if len(set(discrete)) == 1:
            axis = self.constant([1], np.int64)
            columns = [self.node("Unsqueeze", [self.component(head, outputs), axis]) for head in heads]
            self.node("Concat", columns, "action", axis=1)
            return [helper.make_tensor_value_info("action", _type(heads[0]), ["N", len(heads)])]
        for head in heads:
            self.node("Identity", [self.component(head, outputs)], f"action.{head.name}")
        return [helper.make_tensor_value_info(f"action.{head.name}", _type(head), ["N"]) for head in heads]

    def component(self, head: Head, outputs: str) -> str:
        """The greedy value of a component: `[N]`."""
        last = head.first_output + head.outputs
        ends = [self.constant([end], np.int64) for end in (head.first_output, last, 1)]
        part = self.node("Slice", [outputs, *ends])
        if head.is_discrete:
            return self.node("ArgMax", [part], axis=1, keepdims=0)
        mean = self.node("Gather", [part, self.constant(0, np.int64)], axis=1)
        if head.is_squashed:
            mean = self.node("Tanh", [mean])
        mean = self.node("Mul", [mean, self.constant(head.half_range)])
        mean = self.node("Add", [mean, self.constant(head.center)])
        low, high = head.center - head.half_range, head.center + head.half_range
        return self.node("Clip", [mean, self.constant(low), self.constant(high)])


def _type(head: Head) -> int:
    return int(TensorProto.INT64 if head.is_discrete else TensorProto.FLOAT)
