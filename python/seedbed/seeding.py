"""Seeds of environments."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np


def checked_seed(seed: Any) -> int:
    """The seed as an integer.

    Raises:
        TypeError: It is no integer.
        ValueError: It is negative, or has more than 64 bits.
    """
    return _unsigned("seed", seed, 64, "an integer from 0 to 2**64 - 1")


def checked_round(number: Any) -> int:
    """The number of a round as an integer.

    Raises:
        TypeError: It is no integer.
        ValueError: It is negative, or has more than 32 bits.
    """
    return _unsigned('options["round"]', number, 32, "an integer")


def _unsigned(name: str, value: Any, bits: int, integer: str) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} is {value!r}, expected {integer}") from None
    if not 0 <= number < 2**bits:
        raise ValueError(f"{name} is {number}, expected 0 to 2**{bits} - 1")
    return number


def random_seed() -> int:
    """A seed from the operating system's source of randomness, for environments without a seed."""
    return int(np.random.SeedSequence().generate_state(1, np.uint64)[0])
