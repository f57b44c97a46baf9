"""Random streams of the workbench, written again in Python: ChaCha with 8 rounds, and numbers as the Rust packages `rand` and `rand_distr` draw them."""

from __future__ import annotations

import math
import struct

RESET, ACTION, REPLAY, UPDATE_NOISE = 3, 4, 21, 29
"""Purposes: start states, sampled actions, drawn transitions, actions that are sampled in gradient steps."""


class Stream:
    """The stream of an agent in a round."""

    def __init__(self, run_seed: int, purpose: int, agent: int, round_number: int):
        self._key = struct.unpack("<8I", struct.pack("<4Q", run_seed, purpose, agent, round_number))
        self._block = 0
        self._words: list[int] = []

    def u32(self) -> int:
        if not self._words:
            self._words = _chacha8(self._key, self._block)[::-1]
            self._block += 1
        return self._words.pop()

    def u64(self) -> int:
        low = self.u32()
        return low | self.u32() << 32

    def index(self, count: int) -> int:
        """A whole number below `count`: Canon's method, with one more word where the first leaves a bias."""
        product = self.u32() * count
        index, rest = product >> 32, product & 0xFFFFFFFF
        if rest > -count % 2**32:
            index += rest + (self.u32() * count >> 32) >= 2**32
        return index

    def between_minus_one_and_one(self) -> float:
        return (self.u32() >> 9) / 2**23 * 2 - 1

    def normal(self) -> float:
        """A standard normal number, by the ziggurat of Marsaglia and Tsang (2000)."""
        while True:
            bits = self.u64()
            layer, uniform = bits & 0xFF, (bits >> 12) / 2**52 * 2 - 1
            x = uniform * EDGES[layer]
            if abs(x) < EDGES[layer + 1]:
                return x
            if layer == 0:
                return self._tail(uniform < 0)
            low, high = DENSITIES[layer], DENSITIES[layer + 1]
            if high + (low - high) * ((self.u64() >> 11) / 2**53) < math.exp(-x * x / 2):
                return x

    def _tail(self, is_negative: bool) -> float:
        while True:
            x, y = math.log(self._open()) / EDGES[1], math.log(self._open())
            if -2 * y >= x * x:
                return x - EDGES[1] if is_negative else EDGES[1] - x

    def _open(self) -> float:
        """Above 0 and below 1."""
        return (self.u64() >> 12) / 2**52 + 2**-53


def _chacha8(key: tuple[int, ...], block: int) -> list[int]:
    state = [*struct.unpack("<4I", b"expand 32-byte k"), *key, block & 0xFFFFFFFF, block >> 32, 0, 0]
    words = list(state)

    def quarter(a: int, b: int, c: int, d: int) -> None:
        for first, other, target, rotation in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
            words[first] = (words[first] + words[other]) & 0xFFFFFFFF
            mixed = words[target] ^ words[first]
            words[target] = (mixed << rotation | mixed >> (32 - rotation)) & 0xFFFFFFFF

    for _ in range(4):
        for column in range(4):
            quarter(column, column + 4, column + 8, column + 12)
        for column in range(4):
            quarter(column, (column + 1) % 4 + 4, (column + 2) % 4 + 8, (column + 3) % 4 + 12)
    return [(word + first) & 0xFFFFFFFF for word, first in zip(words, state)]


def _ziggurat() -> tuple[list[float], list[float]]:
    """Right edges of 256 layers of equal area under exp(−x² / 2), the widest first, and the density there."""
    tail, area = 3.654152885361008796, 0.00492867323399
    edges = [area / math.exp(-tail * tail / 2), tail]
    while len(edges) < 256:
        edges.append(math.sqrt(-2 * math.log(area / edges[-1] + math.exp(-edges[-1] ** 2 / 2))))
    edges.append(0.0)
    return edges, [math.exp(-edge * edge / 2) for edge in edges]


EDGES, DENSITIES = _ziggurat()
