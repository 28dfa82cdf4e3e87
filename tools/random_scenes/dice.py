"""Random choices that tell what they chose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


class Dice:
    """A seeded generator that keeps words about what it chose, which make up the description of a scene."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.words: list[str] = []

    def say(self, words: str) -> None:
        """Add to the description."""
        self.words.append(words)

    def chance(self, share: float) -> bool:
        """Return true in a share of all cases."""
        return bool(self.random.random() < share)

    def one_of(self, values: Sequence[T]) -> T:
        """Return any of some values."""
        return values[int(self.random.integers(len(values)))]

    def weighted(self, weights: Mapping[T, float]) -> T:
        """Return one of the keys, with probabilities in proportion to the values."""
        share = np.array(list(weights.values()))
        return list(weights)[int(self.random.choice(len(share), p=share / share.sum()))]

    def between(self, low: float, high: float) -> float:
        """Return a number between two, all digits used."""
        return float(self.random.uniform(low, high))

    def power(self, low: float, high: float) -> float:
        """Return ten to a power between two."""
        return float(10.0 ** self.random.uniform(low, high))

    def direction(self, dim: int) -> np.ndarray:
        """Return a unit vector."""
        vector = self.random.normal(size=dim)
        return np.asarray(vector / np.linalg.norm(vector))

    def turn(self, dim: int) -> np.ndarray:
        """Return any rotation matrix."""
        q, r = np.linalg.qr(self.random.normal(size=(dim, dim)))
        q = q * np.sign(np.diag(r))
        if np.linalg.det(q) < 0:
            q[:, 0] = -q[:, 0]
        return np.asarray(q)

    def quarter_turn(self, dim: int) -> np.ndarray:
        """Return any rotation that maps axes on axes."""
        q = np.eye(dim)[self.random.permutation(dim)] * self.random.choice([-1.0, 1.0], size=dim)
        if np.linalg.det(q) < 0:
            q[0] = -q[0]
        return np.asarray(q)
