"""Python values as RON, the format of scenarios and tasks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any


class Expression(str):
    """A text that is RON already, such as `SeedPg()`: it gets no quotes."""

    __slots__ = ()


def ron_text(value: Any, place: str) -> str:
    """A number, a text, a list, a tuple, a map or None as RON; `place` names it in errors.

    Raises:
        TypeError: It is something else.
        ValueError: It is a number that is not finite.
    """
    value = value.item() if hasattr(value, "item") and getattr(value, "ndim", None) == 0 else value
    match value:
        case None:
            return "None"
        case Expression():
            return str(value)
        case str():
            return quoted(value)
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float():
            if not math.isfinite(value):
                raise ValueError(f"{place} is {value}, expected a finite number")
            return repr(value)
        case Mapping():
            entries = (f"{ron_text(str(key), place)}: {ron_text(each, f'{place}.{key}')}" for key, each in value.items())
            return "{" + ", ".join(entries) + "}"
        case tuple():
            return "(" + ", ".join(ron_text(each, place) for each in value) + ")"
        case Sequence():
            return "[" + ", ".join(ron_text(each, place) for each in value) + "]"
    raise TypeError(f"{place} is {value!r}, expected numbers, texts, lists and maps")


ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}


def quoted(text: str) -> str:
    """A text in quotes."""
    inner = (ESCAPES.get(sign) or (sign if sign.isprintable() else f"\\u{{{ord(sign):x}}}") for sign in text)
    return f'"{"".join(inner)}"'


def with_lists(value: Any) -> Any:
    """The value with lists in place of tuples, for what is passed on as JSON."""
    if isinstance(value, Mapping):
        return {key: with_lists(each) for key, each in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [with_lists(each) for each in value]
    return value


def struct(name: str, fields: Mapping[str, Any]) -> str:
    """`name(field: value, …)` with all fields that are not None."""
    given = (f"{field}: {ron_text(value, field)}" for field, value in fields.items() if value is not None)
    return f"{name}({', '.join(given)})"


def algorithm_text(algorithm: str | Mapping[str, Any]) -> str:
    """An algorithm in RON, from a text or from a map of its name to its settings.

    Raises:
        TypeError: It is something else.
    """
    if isinstance(algorithm, str):
        return algorithm
    if not isinstance(algorithm, Mapping) or len(algorithm) != 1:
        raise TypeError(f'algorithm is {algorithm!r}, expected a text, or a map such as {{"SeedPg": {{"discount": 0.9}}}}')
    name, fields = next(iter(algorithm.items()))
    return f"{name}{fields_of_map(fields, str(name))}"


def fields_of_map(fields: Any, place: str) -> str:
    """A map as fields in RON, in which texts are RON already; `place` names it in errors."""
    if not isinstance(fields, Mapping):
        raise TypeError(f"{place} is {fields!r}, expected a map of settings")
    for name in fields:
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError(f"{place} has the setting {name!r}, expected a name")
    return "(" + ", ".join(f"{name}: {_value(value, f'{place}.{name}')}" for name, value in fields.items()) + ")"


def _value(value: Any, place: str) -> str:
    if isinstance(value, Mapping):
        return fields_of_map(value, place)
    return ron_text(Expression(value) if isinstance(value, str) else value, place)
