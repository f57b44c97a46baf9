"""Trained policies as functions of NumPy arrays, PyTorch modules and ONNX files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from safetensors import SafetensorError, safe_open

from .checksums import verify
from .errors import RunError

if TYPE_CHECKING:
    from .torch_policy import PolicyModule

Array: TypeAlias = NDArray[np.float64]

FORMAT_VERSION = "1"
DISCRETE_KINDS = ("categorical", "action_values")
KINDS = (*DISCRETE_KINDS, "gaussian", "squashed_gaussian")
ACTIVATIONS = ("tanh", "relu")


@dataclass(frozen=True)
class Head:
    """One component of an action, and the outputs of networks that describe it.

    Attributes:
        name: Name of the component.
        unit: Its unit.
        first_output: Index of its first output.
        outputs: Number of its outputs.
        kind: "categorical" (outputs are logits), "action_values" (outputs are Q values), "gaussian" (outputs are the
            mean and the logarithm of the deviation, relative to half the range) or "squashed_gaussian" (the same of a
            number u; the action is the center plus half the range times tanh u).
        values: Values of a discrete component.
        center: Middle of the range of a continuous component.
        half_range: Half of that range.
        log_deviation_offset: Added to the second output of a Gaussian.
        log_deviation_clamp: Bounds of the sum.
    """

    name: str
    unit: str
    first_output: int
    outputs: int
    kind: str
    values: tuple[float, ...] = ()
    center: float = 0.0
    half_range: float = 1.0
    log_deviation_offset: float = 0.0
    log_deviation_clamp: tuple[float, float] = (-np.inf, np.inf)

    @property
    def is_discrete(self) -> bool:
        """Whether the component has finitely many values."""
        return self.kind in DISCRETE_KINDS

    @property
    def is_squashed(self) -> bool:
        """Whether tanh squashes samples of a Gaussian into the range."""
        return self.kind == "squashed_gaussian"


@dataclass(frozen=True)
class Term:
    """A network, whose outputs are multiplied by a factor and added to those of other networks.

    Attributes:
        factor: The factor.
        skip_connection: Whether the scaled observations are appended to the inputs of the last layer.
        layers: Weights `[inputs, outputs]` and biases `[outputs]`.
        activation: Function after all layers but the last: "tanh" or "relu".
    """

    factor: float
    skip_connection: bool
    layers: tuple[tuple[Array, Array], ...]
    activation: str = "tanh"

    def __call__(self, inputs: Array) -> Array:
        """The network's outputs times the factor: `[..., inputs]` to `[..., outputs]`."""
        x = inputs
        for number, (weight, bias) in enumerate(self.layers):
            if number > 0:
                x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, 0.0)
            if self.skip_connection and number + 1 == len(self.layers):
                x = np.concatenate([x, inputs], axis=-1)
            x = x @ weight + bias
        return self.factor * x


class Policy:
    """The trained policy of an agent: a function of observations, computed by NumPy alone.

    `seedbed.load(folder).policy(agent)` reads it.

    Args:
        path: A file `policies.safetensors`.
        agent: Number of the agent.
        model: Number of the model; see `Run.policy`.

    Attributes:
        agent: Number of the agent.
        model: Number of the model by which the agent acts; 0 if agents have networks of their own.
        algorithm: Name of the algorithm.
        task: Name of the task.
        observations: Names of the observations, in their order.
        heads: The components of an action.
        terms: The networks, whose outputs are added.
        offset: Offset of the scaling (x − offset) / scale of observations, or None.
        scale: Scale, or None.
        limit: Limit of the absolute values of scaled observations, or None.
        metadata: All metadata of the file, as texts.

    Raises:
        RunError: The file is missing or damaged, or the algorithm has no networks.
        IndexError: There is no such agent or model.
    """

    def __init__(self, path: str | os.PathLike[str], agent: int = 0, model: int | None = None) -> None:
        file = _File(Path(path))
        self._samples: np.random.Generator | None = None
        self.metadata = file.metadata
        self.algorithm, self.task = file.text("algorithm"), file.text("task")
        if "outputs" not in file.metadata:
            raise RunError(
                file.path, f"agents of the algorithm {self.algorithm} have no networks, and no policy of a network"
            )
        self.agent = _checked_number("agent", agent, int(file.text("agents")))
        models = int(file.metadata.get("models", "1"))
        self.model = _checked_number("model", agent % models if model is None else model, models)
        file.numbers = {"agent": self.agent, "model": self.model}
        self.observations = [column["name"] for column in file.json("observations")]
        self.heads = [_head(head, file.path) for head in file.json("heads")]
        scaling = file.json("observation_scaling")
        self.offset, self.scale = file.optional_tensor(scaling["offset"]), file.optional_tensor(scaling["scale"])
        self.limit: float | None = scaling["limit"]
        self.terms = [_term(file, output) for output in file.json("outputs")]
        self._value = _value(file, self.algorithm) if "value" in file.metadata else None
        _check_shapes(self, file.path)

    def __call__(
        self,
        observations: ArrayLike,
        *,
        greedy: bool = True,
        rng: np.random.Generator | None = None,
        temperature: float | None = None,
    ) -> Any:
        """Choose actions, in the form that the environment takes.

        Args:
            observations: One observation `[width]`, or a batch `[N, width]`, in units of the task (not scaled). A Dict of arrays
                is flattened in the order of its names.
            greedy: Whether to take the most likely action, that with the largest action value, or the mean of a
                Gaussian, squashed or not. Otherwise actions are sampled.
            rng: Generator for sampling; required then.
            temperature: Sample from π^(1/τ) with this temperature τ; by default 1. Action values Q are no
                probabilities: with a temperature, they are sampled from softmax(Q / τ), as in Gibbs exploration.

        Returns:
            For a batch, the first axis of each array is N.

            * One discrete component: the index of its value, int64.
            * Several discrete components: their indices, int64, `[components]`.
            * Continuous components: float32, `[components]`, in their units, limited to their ranges.
            * Both kinds: a dict with an entry per component.

        Raises:
            ValueError: Observations have another shape or are not finite, or a sample lacks `rng` or `temperature`.
        """
        outputs = self.outputs(observations)
        if greedy:
            chosen = [_greedy(head, _of(head, outputs)) for head in self.heads]
        else:
            if rng is None:
                raise ValueError("greedy=False needs rng, such as np.random.default_rng(0)")
            chosen = [self._sample(head, outputs, rng, temperature) for head in self.heads]
        return _as_action(self.heads, chosen)

    def predict(
        self, observation: ArrayLike, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Choose actions as a model of Stable-Baselines3, so that its `evaluate_policy` takes this policy.

        Args:
            observation: One observation `[width]`, or a batch `[N, width]`.
            state: Returned as it is: the policy has no memory.
            episode_start: Not used.
            deterministic: As `greedy` of calls. Samples are those of a generator of this policy, seeded with 0.

        Returns:
            Actions, as of calls, and `state`.
        """
        if not deterministic and self._samples is None:
            self._samples = np.random.default_rng(0)
        # Action values are no probabilities.
        greedy = deterministic or any(head.kind == "action_values" for head in self.heads)
        return self(observation, greedy=greedy, rng=self._samples), state

    def probabilities(self, observations: ArrayLike, *, temperature: float | None = None) -> Any:
        """Probabilities of the values of discrete actions.

        Args:
            observations: `[width]` or `[N, width]`.
            temperature: As for calls: required for action values.

        Returns:
            `[values]` or `[N, values]`; for several components a dict with such an array per discrete component.

        Raises:
            ValueError: No component of actions is discrete: see `normal`.
        """
        outputs = self.outputs(observations)
        discrete = [head for head in self.heads if head.is_discrete]
        if not discrete:
            raise ValueError("actions are continuous: `normal` returns their means and standard deviations")
        found = {head.name: self._softmax(head, outputs, temperature) for head in discrete}
        return found[discrete[0].name] if len(self.heads) == 1 else found

    def normal(self, observations: ArrayLike) -> tuple[Array, Array]:
        """Means and standard deviations of continuous actions, in their units, before they are limited to their ranges.

        For a squashed Gaussian they are those of the number u, without unit, that tanh squashes.

        Args:
            observations: `[width]` or `[N, width]`.

        Returns:
            Two arrays `[continuous components]` or `[N, continuous components]`.

        Raises:
            ValueError: No component of actions is continuous: see `probabilities`.
        """
        outputs = self.outputs(observations)
        pairs = [_normal(head, _of(head, outputs)) for head in self.heads if not head.is_discrete]
        if not pairs:
            raise ValueError("actions are discrete: `probabilities` returns the probabilities of their values")
        return np.stack([mean for mean, _ in pairs], axis=-1), np.stack([deviation for _, deviation in pairs], axis=-1)

    def value(self, observations: ArrayLike) -> Array:
        """Values of states: those of the value function, or the largest action value.

        Args:
            observations: `[width]` or `[N, width]`.

        Returns:
            A number or `[N]`.

        Raises:
            ValueError: The algorithm has no value function.
        """
        if self._value is not None:
            term, mean, deviation = self._value
            return np.asarray(mean + deviation * term(self.scaled(observations))[..., 0])
        if any(head.kind != "action_values" for head in self.heads):
            raise ValueError(f"the algorithm {self.algorithm} has no value function")
        return np.asarray(self.outputs(observations).max(axis=-1))

    def outputs(self, observations: ArrayLike) -> Array:
        """Outputs of the networks, which `heads` describe: `[width]` to `[outputs]`, or `[N, width]` to `[N, outputs]`."""
        scaled = self.scaled(observations)
        total = self.terms[0](scaled)
        for term in self.terms[1:]:
            total = total + term(scaled)
        return total

    def scaled(self, observations: ArrayLike) -> Array:
        """Observations as inputs of the networks: `[..., width]` to `[..., width]`."""
        x = self._flat(observations) if isinstance(observations, Mapping) else np.asarray(observations, dtype=np.float64)
        if x.ndim not in (1, 2) or x.shape[-1] != len(self.observations):
            width = len(self.observations)
            raise ValueError(
                f"observations have the shape {list(x.shape)}, expected [{width}] or [N, {width}]: {self._names()}"
            )
        if not np.isfinite(x).all():
            raise ValueError("an observation is not finite")
        if self.offset is None or self.scale is None:
            return x
        scaled = (x - self.offset) / self.scale
        return scaled if self.limit is None else np.clip(scaled, -self.limit, self.limit)

    def _flat(self, observations: Mapping[Any, Any]) -> Array:
        """The numbers of a Dict, in the order of names: `[width]`, or `[N, width]` if each entry has N rows."""
        entries = list(_entries(observations))
        if all(_is_named(columns, stem) for columns, stem in self._columns_of(entries)):
            return np.concatenate([values.reshape(-1) for _, values in entries])
        rows = {len(values) if values.ndim else 0 for _, values in entries}
        if len(rows) == 1 and 0 not in rows:
            row = [(stem, values[0]) for stem, values in entries]
            if all(_is_named(columns, stem) for columns, stem in self._columns_of(row)):
                return np.concatenate([values.reshape(len(values), -1) for _, values in entries], axis=-1)
        found = ", ".join(f"{stem} {list(values.shape)}" for stem, values in entries)
        raise ValueError(
            f"the observation is a Dict of {found}, which are not the policy's observations {self._names()}: give numbers in "
            "their order, such as those of seedbed.make(run.task)"
        )

    def _columns_of(self, entries: list[tuple[str, Array]]) -> list[tuple[list[str], str]]:
        """The policy's observations that each entry has, with the entry's name; none if the numbers are fewer or more."""
        if sum(values.size for _, values in entries) != len(self.observations):
            return [([], "")]
        columns, end = [], 0
        for stem, values in entries:
            columns.append((self.observations[end : end + values.size], stem))
            end += values.size
        return columns

    def _names(self) -> str:
        return ", ".join(self.observations[:8]) + (", …" if len(self.observations) > 8 else "")

    def in_units(self, actions: Any) -> Array:
        """Actions as numbers in the units of the task, like those in `run.states`: −10 N instead of the index 0.

        Args:
            actions: What a call returned.

        Returns:
            `[components]` or `[N, components]`.
        """
        if isinstance(actions, dict):
            columns = [np.asarray(actions[head.name]) for head in self.heads]
        elif len(self.heads) == 1 and self.heads[0].is_discrete:
            columns = [np.asarray(actions)]
        else:
            columns = list(np.moveaxis(np.asarray(actions), -1, 0))
        pairs = zip(self.heads, columns, strict=True)
        return np.stack(
            [np.asarray(head.values)[column] if head.is_discrete else column for head, column in pairs], axis=-1
        )

    def to_torch(self) -> PolicyModule:
        """The policy as a PyTorch module, whose parameters can be trained.

        Returns:
            A module that maps observations `[..., width]`, not scaled, to `outputs`, in float32. Its method `act`
            returns greedy actions.

        Raises:
            ImportError: PyTorch is not installed.
        """
        from .torch_policy import PolicyModule

        return PolicyModule(self)

    def to_onnx(self, path: str | os.PathLike[str]) -> Path:
        """Write the policy as an ONNX file: `observation` `[N, width]` to `outputs` `[N, outputs]` and greedy actions.

        Greedy actions are in the form of calls: the output `action`, or with discrete and continuous components one
        output `action.NAME` for each. The metadata of the file are those of the policy.

        Args:
            path: The file.

        Returns:
            Path of the file.

        Raises:
            ImportError: The package `onnx` is not installed: `pip install onnx`.
        """
        from .onnx_policy import write

        return write(self, Path(path))

    def __repr__(self) -> str:
        actions = ", ".join(head.name for head in self.heads)
        owner = f"agent {self.agent}" + (f", model {self.model}" if "models" in self.metadata else "")
        return (
            f"<policy of {owner} ({self.algorithm}, {self.task}): {len(self.observations)} observations to {actions}>"
        )

    def _sample(self, head: Head, outputs: Array, rng: np.random.Generator, temperature: float | None) -> NDArray[Any]:
        if head.is_discrete:
            cumulative = np.cumsum(self._softmax(head, outputs, temperature), axis=-1)
            drawn = rng.random(cumulative.shape[:-1])[..., None] * cumulative[..., -1:]
            return np.asarray((drawn >= cumulative[..., :-1]).sum(axis=-1))
        mean, deviation = _normal(head, _of(head, outputs))
        spread = np.sqrt(_checked_temperature(temperature, 1.0))
        return _within_range(head, mean + spread * deviation * rng.standard_normal(mean.shape))

    def _softmax(self, head: Head, outputs: Array, temperature: float | None) -> Array:
        if head.kind == "action_values" and temperature is None:
            raise ValueError(
                f"action values of {self.algorithm} are no probabilities: give a temperature, or act greedily. "
                f"In training, actions were chosen by {self.metadata.get('action_selection')}"
            )
        logits = _of(head, outputs) / _checked_temperature(temperature, 1.0)
        exponentials = np.exp(logits - logits.max(axis=-1, keepdims=True))
        return np.asarray(exponentials / exponentials.sum(axis=-1, keepdims=True))


class _File:
    """The tensors and metadata of a file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.numbers: dict[str, int] = {}
        if not path.is_file():
            raise RunError(path, "there is no such file; it is written at the end of a run")
        verify(path)
        try:
            file: Any = safe_open(path, framework="numpy")
        except (SafetensorError, OSError) as error:
            raise RunError(path, f"it is damaged: {error}") from error
        self._file = file
        self.names = set(file.keys())
        self.metadata: dict[str, str] = dict(file.metadata() or {})
        version = self.text("format_version")
        if version != FORMAT_VERSION:
            raise RunError(
                path, f"it has format version {version}, expected {FORMAT_VERSION}: update the package seedbed"
            )

    def text(self, key: str) -> str:
        if key not in self.metadata:
            raise RunError(self.path, f"its metadata have no {key}")
        return self.metadata[key]

    def json(self, key: str) -> Any:
        try:
            return json.loads(self.text(key))
        except json.JSONDecodeError as error:
            raise RunError(self.path, f"`{key}` of its metadata is no valid JSON: {error}") from error

    def tensor(self, template: str) -> Array:
        name = template.format(**self.numbers)
        if name not in self.names:
            raise RunError(self.path, f"it has no tensor {name}")
        found: Array = self._file.get_tensor(name).astype(np.float64)
        if not np.isfinite(found).all():
            raise RunError(self.path, f"a number in the tensor {name} is not finite")
        return found

    def optional_tensor(self, template: str | None) -> Array | None:
        return None if template is None else self.tensor(template)

    def layers(self, template: str) -> tuple[tuple[Array, Array], ...]:
        name = template.format(**self.numbers)
        count = 0
        while f"{name}.layer_{count}.weight" in self.names:
            count += 1
        if count == 0:
            raise RunError(self.path, f"it has no tensors of the network {name}")
        return tuple(
            (self.tensor(f"{name}.layer_{layer}.weight"), self.tensor(f"{name}.layer_{layer}.bias"))
            for layer in range(count)
        )


def _head(fields: dict[str, Any], path: Path) -> Head:
    if fields["kind"] not in KINDS:
        raise RunError(
            path, f"the action {fields['name']} is of the unknown kind {fields['kind']}: update the package seedbed"
        )
    known = {key: fields[key] for key in Head.__dataclass_fields__ if key in fields}
    lists = {key: tuple(value) for key, value in known.items() if isinstance(value, list)}
    return Head(**(known | lists))


def _term(file: _File, output: dict[str, Any]) -> Term:
    activation = file.metadata.get("activation", "tanh")
    if activation not in ACTIVATIONS:
        raise RunError(file.path, f"its networks have the unknown activation {activation}: update the package seedbed")
    return Term(output["factor"], output["skip_connection"], file.layers(output["network"]), activation)


def _value(file: _File, algorithm: str) -> tuple[Term, float, float]:
    name = "agent_{agent}.value"
    mean, deviation = file.tensor(f"{name}.mean"), file.tensor(f"{name}.deviation")
    return Term(1.0, False, file.layers(name)), float(mean[0]), float(deviation[0])


def _check_shapes(policy: Policy, path: Path) -> None:
    """Try the networks, so that a file with tensors of wrong shapes is found when it is read."""
    expected = sum(head.outputs for head in policy.heads)
    try:
        found = policy.outputs(np.zeros(len(policy.observations))).shape
    except ValueError as error:
        raise RunError(path, f"shapes of its tensors do not fit: {error}") from error
    if found != (expected,):
        raise RunError(path, f"its networks have {found[-1]} outputs, expected {expected}")


def _entries(observations: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Array]]:
    """The arrays of a Dict and their names, in the order of names, as the program flattens them."""
    for key in sorted(observations, key=str):
        if isinstance(observations[key], Mapping):
            yield from _entries(observations[key], f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", np.asarray(observations[key], dtype=np.float64)


def _is_named(columns: list[str], stem: str) -> bool:
    """Whether these observations are those of an entry: `x`, or `x_0`, `x_1`, …"""
    return columns == ([stem] if len(columns) == 1 else [f"{stem}_{i}" for i in range(len(columns))]) != []


def _checked_number(what: str, number: int, count: int) -> int:
    if not 0 <= number < count:
        raise IndexError(f"there is no {what} {number}: the run has {count}, from 0 to {count - 1}")
    return number


def _checked_temperature(temperature: float | None, default: float) -> float:
    chosen = default if temperature is None else temperature
    if not chosen > 0:
        raise ValueError(f"temperature is {chosen}, expected a positive number")
    return chosen


def _of(head: Head, outputs: Array) -> Array:
    """The outputs of a head: `[..., its outputs]`."""
    return outputs[..., head.first_output : head.first_output + head.outputs]


def _normal(head: Head, outputs: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of a Gaussian, before it is squashed: `[..., 2]` to `[...]` each."""
    low, high = head.log_deviation_clamp
    deviation = np.exp(np.clip(outputs[..., 1] + head.log_deviation_offset, low, high))
    if head.is_squashed:
        return outputs[..., 0], np.asarray(deviation)
    mean = head.center + head.half_range * outputs[..., 0]
    return np.asarray(mean), np.asarray(head.half_range * deviation)


def _greedy(head: Head, outputs: Array) -> NDArray[Any]:
    if head.is_discrete:
        return np.asarray(np.argmax(outputs, axis=-1))
    return _within_range(head, _normal(head, outputs)[0])


def _within_range(head: Head, values: Array) -> Array:
    """Squashed values, or limited ones."""
    if head.is_squashed:
        return np.asarray(head.center + head.half_range * np.tanh(values))
    return np.clip(values, head.center - head.half_range, head.center + head.half_range)


def _as_action(heads: list[Head], chosen: list[NDArray[Any]]) -> Any:
    """Actions in the form that the environment takes."""
    discrete = [head.is_discrete for head in heads]
    pairs = zip(heads, chosen, strict=True)
    # `[()]` makes a number of an array without axes; `Box.contains` expects an array.
    typed = [
        np.asarray(values, np.int64)[()] if head.is_discrete else np.asarray(values, np.float32)
        for head, values in pairs
    ]
    if len(heads) == 1 and discrete[0]:
        return typed[0]
    if all(discrete) or not any(discrete):
        return np.stack(typed, axis=-1)
    return {head.name: values for head, values in zip(heads, typed, strict=True)}
