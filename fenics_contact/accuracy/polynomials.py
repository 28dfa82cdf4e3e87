"""Polynomials about a point by their derivatives there, scaled to be rotationally invariant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from math import factorial, prod

import numpy as np


@dataclass(frozen=True)
class Polynomials:
    """All polynomials up to a degree that vanish at a point.

    The coefficient of a mixed derivative is √(number of its permutations) times it: the sum of squares is
    that of the full tensor of derivatives. Derivatives of the highest degree come last.

    Attributes:
        dim: Number of coordinates.
        degree: Highest degree, at least 2.
    """

    dim: int
    degree: int

    @property
    def count(self) -> int:
        """Number m of polynomials."""
        return sum(len(self._indices(degree)) for degree in range(1, self.degree + 1))

    @property
    def highest(self) -> slice:
        """The polynomials of the highest degree."""
        return slice(self.count - len(self._indices(self.degree)), self.count)

    def values(self, away: np.ndarray) -> np.ndarray:
        """Evaluate them: d_i, then ½ d_i², d_i d_j / √2, and so on.

        Args:
            away: Differences of positions, shape (..., dim).

        Returns:
            Shape (..., m).
        """
        columns = []
        for degree in range(1, self.degree + 1):
            for index in self._indices(degree):
                scale = np.sqrt(_orders(index)) / factorial(degree)
                columns.append(scale * prod((away[..., i] for i in index[1:]), start=away[..., index[0]]))
        return np.stack(columns, axis=-1)

    def tensors(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the tensors of highest derivatives, (n, m', k) -> (n, dim, ..., dim, k)."""
        place, scale = self._places
        return np.asarray((coefficients / scale[:, None])[:, place])

    def coefficients_of(self, tensors: np.ndarray) -> np.ndarray:
        """Return the coefficients of the given tensors, the inverse of `tensors`."""
        index = tuple(np.array(self._indices(self.degree)).T)
        return np.asarray(tensors[(slice(None), *index)] * self._places[1][:, None])

    def turned(self, tensors: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Return Σ t_i..j T_ia ... T_jb: highest derivatives by coordinates x of those by T x.

        Args:
            tensors: Shape (n, dim, ..., dim, k).
            turn: T, shape (n, dim, dim).
        """
        for axis in range(1, self.degree + 1):
            front = np.moveaxis(tensors, axis, 1)
            flat = front.reshape(len(front), self.dim, front[0, 0].size if len(front) else 0)
            done = np.matmul(turn.transpose(0, 2, 1), flat).reshape(front.shape)
            tensors = np.moveaxis(done, 1, axis)
        return tensors

    def _indices(self, degree: int) -> list[tuple[int, ...]]:
        return list(combinations_with_replacement(range(self.dim), degree))

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficient of each entry of the tensor of highest derivatives, and their scales."""
        indices = self._indices(self.degree)
        entries = np.moveaxis(np.indices((self.dim,) * self.degree), 0, -1)
        number = {index: position for position, index in enumerate(indices)}
        ordered = np.sort(entries, axis=-1).reshape(-1, self.degree)
        place = np.array([number[tuple(map(int, index))] for index in ordered])
        return place.reshape(entries.shape[:-1]), np.sqrt([_orders(index) for index in indices])


def _orders(index: tuple[int, ...]) -> int:
    """Return the number of permutations of the factors of a product."""
    return factorial(len(index)) // prod(factorial(index.count(i)) for i in set(index))
