"""Seeds of environments."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np

MAX_SEED = 2**64 - 1


def checked_seed(seed: Any) -> int:
    """The seed as an integer.

    Raises:
        TypeError: It is no integer.
        ValueError: It is negative, or has more than 64 bits.
    """
    try:
        number = operator.index(seed)
    except TypeError:
        raise TypeError(f"seed is {seed!r}, expected an integer from 0 to 2**64 - 1") from None
    if not 0 <= number <= MAX_SEED:
        raise ValueError(f"seed is {number}, expected 0 to 2**64 - 1")
    return number


def checked_round(number: Any) -> int:
    """The number of a round as an integer.

    Raises:
        TypeError: It is no integer.
        ValueError: It is negative, or has more than 32 bits.
    """
    try:
        checked = operator.index(number)
    except TypeError:
        raise TypeError(f'options["round"] is {number!r}, expected an integer') from None
    if not 0 <= checked < 2**32:
        raise ValueError(f'options["round"] is {checked}, expected 0 to 2**32 - 1')
    return checked


def random_seed() -> int:
    """A seed from the operating system's source of randomness, for environments without a seed."""
    return int(np.random.SeedSequence().generate_state(1, np.uint64)[0])
