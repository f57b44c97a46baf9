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
