"""Names of a task file: letters, digits and `_`, and none of them twice."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

RESERVED = frozenset(
    "pi degree previous world abstract as async await become box break const continue crate do dyn else enum extern false "
    "final fn for if impl in let loop macro match mod move mut override priv pub ref return self Self static struct super "
    "trait true try type typeof unsafe unsized use virtual where while yield _".split()
)
"""Names with a meaning of their own in formulas, and keywords of Rust, which the file format excludes."""


def identifier(name: str, fallback: str) -> str:
    """A name of letters, digits and `_` that resembles `name`; `fallback` if nothing of it remains."""
    cleaned = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") or fallback
    if cleaned[:1].isdigit():
        cleaned = f"_{cleaned}"
    return f"{cleaned}_" if cleaned in RESERVED else cleaned


@dataclass
class Names:
    """Names that are taken."""

    taken: set[str] = field(default_factory=set)

    def unique(self, name: str, fallback: str) -> str:
        """A valid name that is not taken yet; it is then."""
        wanted = identifier(name, fallback)
        candidate, number = wanted, 2
        while candidate in self.taken:
            candidate = f"{wanted}_{number}"
            number += 1
        self.taken.add(candidate)
        return candidate

    def has(self, name: str) -> bool:
        """Whether the valid name that `name` becomes is taken."""
        return identifier(name, "") in self.taken
