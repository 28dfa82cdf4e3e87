"""Slip of nodes since an earlier time, whose places on the master are carried along by it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class LastPoints:
    """What points are found again by, at nearby coordinates, see `ContactPoints`.

    Attributes:
        pair: Contact pair, shape (n,).
        slave: Slave node, shape (n,).
        facet: Facet of the master on which it stood, −1 on others, shape (n,).
        local: Where on it, shape (n, dim − 1).
        axes: Axis next to the first tangent, shape (n, dim).
    """

    pair: np.ndarray
    slave: np.ndarray
    facet: np.ndarray
    local: np.ndarray
    axes: np.ndarray

    @classmethod
    def of(cls, stored: Mapping[str, np.ndarray]) -> LastPoints:
        """Return those of arrays of `SlidingPoints.stored`."""
        return cls(*(stored[f"found.{name}"] for name in LAST))


#: Names of what points are found again by.
LAST = tuple(part.name for part in fields(LastPoints))


@dataclass(frozen=True)
class MaterialPoints:
    """Where nodes stood on their masters, by weights of its nodes; on obstacles by places in them.

    Attributes:
        key: Number of each node in its pair, ascending, see `SlidingPoints.key`, shape (n,).
        pair: Contact pair, shape (n,).
        weights: Weights of the nodes of all bodies, empty rows on rigid obstacles, shape (n, n_nodes).
        place: Places on obstacles as they stand before any motion, zero on bodies, shape (n, dim), [length].
    """

    key: np.ndarray
    pair: np.ndarray
    weights: sp.csr_matrix
    place: np.ndarray

    def extended(self, other: MaterialPoints) -> MaterialPoints:
        """Return these points and those of another set that are not among them.

        Nodes that had no point at the start of a step begin to slip where they are first found within it.
        """
        new = ~np.isin(other.key, self.key)
        if not new.any():
            return self
        order = np.argsort(np.concatenate([self.key, other.key[new]]))
        joined = {
            name: np.concatenate([getattr(self, name), getattr(other, name)[new]])[order]
            for name in ("key", "pair", "place")
        }
        weights = sp.vstack([self.weights, other.weights[new]], format="csr")[order]
        return replace(self, weights=weights, **joined)

    def stored(self) -> dict[str, np.ndarray]:
        """Return the points as arrays."""
        weights = self.weights.tocoo()
        entries = np.array([weights.row, weights.col, weights.data])
        plain = {f"stood.{name}": getattr(self, name) for name in ("key", "pair", "place")}
        return plain | {"stood.weights": entries}

    @classmethod
    def of(cls, stored: Mapping[str, np.ndarray], n_nodes: int) -> MaterialPoints:
        """Return the points of arrays from `stored`, with the number of nodes of all bodies."""
        row, column, value = stored["stood.weights"]
        key, pair, place = (stored[f"stood.{name}"] for name in ("key", "pair", "place"))
        at = row.astype(np.int64), column.astype(np.int64)
        return cls(key, pair, sp.csr_matrix((value, at), shape=(len(key), n_nodes)), place)

    def part(self, chosen: np.ndarray) -> MaterialPoints:
        """Return some of the points, by indices or a mask."""
        return MaterialPoints(self.key[chosen], self.pair[chosen], self.weights[chosen], self.place[chosen])
