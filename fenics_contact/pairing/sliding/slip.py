"""Slip of nodes since an earlier time, whose places on the master are carried along by it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp


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
        order = np.argsort(np.concatenate([self.key, other.key[new]]))
        joined = {
            name: np.concatenate([getattr(self, name), getattr(other, name)[new]])[order]
            for name in ("key", "pair", "place")
        }
        weights = sp.vstack([self.weights, other.weights[new]], format="csr")[order]
        return replace(self, weights=weights, **joined)

    def part(self, chosen: np.ndarray) -> MaterialPoints:
        """Return some of the points, by indices or a mask."""
        return MaterialPoints(self.key[chosen], self.pair[chosen], self.weights[chosen], self.place[chosen])
