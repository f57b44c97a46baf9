"""Text of task files."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TypeAlias

from .plane import Array

WIDTH = 140
"""Longest line that is not broken."""

INDENT = "    "


@dataclass
class Record:
    """`Name(field: value, …)`; without a name `(field: value, …)`."""

    fields: list[tuple[str, Value]]
    name: str = ""
    comment: str = ""
    """Written above the record, in an enclosing list."""
    comments: dict[str, str] | None = None
    """Comments above fields."""


Value: TypeAlias = "str | Record | list[Record] | list[str]"
"""A text is written as it is."""


def number(value: float) -> str:
    """The shortest text that gives the same number."""
    return repr(float(value) + 0.0)


def length(value: float) -> str:
    """A number of the geometry, without the rounding errors of rotations: 12 digits after the point if they lose nothing else."""
    rounded = round(float(value), 12)
    is_noise = math.isclose(rounded, value, rel_tol=8e-16, abs_tol=1e-12 if rounded == 0 else 1e-16)
    return number(rounded if is_noise else value)


def vector(values: Array) -> str:
    """`(x, y)` of the geometry."""
    return f"({', '.join(length(value) for value in values)})"


def interval(values: tuple[float, float]) -> str:
    """`(low, high)`."""
    return f"({number(values[0])}, {number(values[1])})"


def quoted(text: str) -> str:
    """Text in quotes."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def written(value: Value, indent: int = 0, used: int = 0) -> str:
    """Text of a value: in one line if it fits and has no comments, otherwise one field or entry per line.

    Args:
        value: What is written.
        indent: Number of indentations of the line on which it begins.
        used: Characters before it on this line.
    """
    line = inline(value)
    if line is not None and len(line) + used + len(INDENT) * indent < WIDTH:
        return line
    if isinstance(value, str):
        return value
    return written_list(value, indent) if isinstance(value, list) else written_record(value, indent)


def inline(value: Value) -> str | None:
    """The value in one line, or None if it has comments."""
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        entries = [None if is_commented(entry) else inline(entry) for entry in value]
        texts = [text for text in entries if text is not None]
        return f"[{', '.join(texts)}]" if len(texts) == len(entries) else None
    if value.comments:
        return None
    parts = [(name, inline(field)) for name, field in value.fields]
    if any(text is None for _, text in parts):
        return None
    return f"{value.name}({', '.join(f'{name}: {text}' for name, text in parts)})"


def is_commented(value: str | Record) -> bool:
    return isinstance(value, Record) and bool(value.comment)


def written_list(entries: list[Record] | list[str], indent: int) -> str:
    outer, inner = INDENT * indent, INDENT * (indent + 1)
    lines = []
    for entry in entries:
        if isinstance(entry, Record) and entry.comment:
            lines += comment_lines(entry.comment, inner)
        lines.append(f"{inner}{written(entry, indent + 1, 1)},")
    return "\n".join(["[", *lines, f"{outer}]"])


def written_record(record: Record, indent: int) -> str:
    outer, inner = INDENT * indent, INDENT * (indent + 1)
    lines = []
    for name, value in record.fields:
        lines += comment_lines((record.comments or {}).get(name, ""), inner)
        lines.append(f"{inner}{name}: {written(value, indent + 1, len(name) + 3)},")
    return "\n".join([f"{record.name}(", *lines, f"{outer})"])


def comment_lines(text: str, indent: str = "") -> list[str]:
    """Lines of a comment, wrapped at the width of files. Lines of the text stay apart."""
    lines = []
    text = re.sub(r"[\x00-\x09\x0b-\x1f\x7f\x85\u2028\u2029]", " ", text)
    for paragraph in filter(None, text.split("\n")):
        line = ""
        for word in paragraph.split(" "):
            if line and len(indent) + len(line) + len(word) + 4 > WIDTH:
                lines.append(f"{indent}// {line}")
                line = word
            else:
                line = f"{line} {word}" if line else word
        lines.append(f"{indent}// {line}")
    return lines
