"""Slip of nodes since an earlier time, whose places on the master are carried along by it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._pairing.sliding.stiffness import Differential, point_motion, spread

if TYPE_CHECKING:
    from fenics_contact._pairing.sliding.means import MovingMeans


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

    @classmethod
    def none(cls, dim: int) -> LastPoints:
        """Return none in a space of a dimension."""
        nothing = np.zeros(0, dtype=np.int64)
        return cls(nothing, nothing, nothing, np.zeros((0, dim - 1)), np.zeros((0, dim)))

    @property
    def points(self) -> LastPoints:
        """These, as of `SlidingPoints`."""
        return self


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

    @classmethod
    def none(cls, n_nodes: int, dim: int) -> MaterialPoints:
        """Return none, with the number of nodes of all bodies."""
        nothing = np.zeros(0, dtype=np.int64)
        return cls(nothing, nothing, Csr((0, n_nodes)), np.zeros((0, dim)))

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
        return cls(key, pair, Csr((value, at), shape=(len(key), n_nodes)), place)

    def part(self, chosen: np.ndarray) -> MaterialPoints:
        """Return some of the points, by indices or a mask."""
        return MaterialPoints(self.key[chosen], self.pair[chosen], self.weights[chosen], self.place[chosen])


def slip_by_start(
    points: ContactPoints,
    coordinates: np.ndarray,
    start: ContactPoints,
    differential: Differential,
    common: tuple[np.ndarray, np.ndarray],
    turned: Mapping[int, np.ndarray],
) -> sp.csr_matrix:
    """Return the derivative of `SlidingPoints.slip` by the coordinates at its start.

    Of t_a·(x_s − Σ W_j(ξ₀) x_j) it is −t_a·S,_b(ξ₀) δξ₀_b, with the master where it lies now; on obstacles
    −t_a·Q δf, with the obstacle's rotation Q since the start and the foot f of the node on it.

    `coordinates`: coordinates of all nodes now, shape (n_nodes, dim), [length]; `turned`: Q of the pairs
    by nodes, shape (dim, dim).

    The result has shape (n · (dim − 1), n_dofs), dof dim · node + component, rows as those of
    `SlidingPoints.slip_rows`.
    """
    count, nodes = points.count, len(coordinates)
    width, dim = points.tangents.shape[1:]
    local, slaves = point_motion(start, differential).local, start.own
    result = Csr((width * count, dim * nodes))
    for index, rotation in turned.items():
        now, then = (each[points.pair[common[0]] == index] for each in common)
        rigid = bool(np.any(start.facet[then] < 0))
        for a in range(width):
            tangent = points.tangents[now, a]
            if rigid:
                foot = rotation @ _foot_by_node(start, differential, then)
                rows = spread(-np.einsum("nd,nde->ne", tangent, foot), slaves[then])
            else:
                rows = Csr((len(now), dim * nodes))
                for b in range(width):
                    rate = np.einsum("nd,nd->n", tangent, differential.slopes[b][then] @ coordinates)
                    rows = rows - sp.diags(rate) @ local[b][then]
            result = result + _of_nodes(width * now + a, width * count).T @ rows
    return result.tocsr()


def slip_by_start_of_means(
    points: ContactPoints,
    coordinates: np.ndarray,
    start: tuple[ContactPoints, np.ndarray],
    means: MovingMeans,
    common: tuple[np.ndarray, np.ndarray],
) -> sp.csr_matrix:
    """Return the same of a pair of mortar contact. Collective.

    Of t_a·Σ (W_j − W_j,start) x_j it is −t_a·Σ δW_j,start x_j, with the master where it lies now.

    `coordinates`: coordinates of all nodes now, shape (n_nodes, dim), [length].
    """
    every, mine = start
    count, (width, dim) = points.count, points.tangents.shape[1:]
    now = np.full(every.count, -1)
    now[common[1]] = common[0]
    now, some = now[mine], every.part(mine)
    motion, met = means.motion(some, now >= 0), np.flatnonzero(now >= 0)
    result = Csr((width * count, dim * len(coordinates)))
    for a in range(width):
        along = np.zeros((len(mine), dim))
        along[met] = points.tangents[now[met], a]
        rows = motion.feet(some, coordinates, along)[met]
        result = result - _of_nodes(width * now[met] + a, width * count).T @ rows
    return result.tocsr()


def _foot_by_node(start: ContactPoints, differential: Differential, chosen: np.ndarray) -> np.ndarray:
    """Return the derivative of the feet of nodes on an obstacle, shape (n, dim, dim)."""
    normal, distance = start.normal[chosen], start.distance[chosen]
    along = np.eye(normal.shape[1]) - normal[:, :, None] * normal[:, None]
    return np.asarray(along - distance[:, None, None] * differential.curvature[chosen])


def _of_nodes(chosen: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the matrix that picks some of ``count`` entries."""
    return Csr((np.ones(len(chosen)), (np.arange(len(chosen)), chosen)), shape=(len(chosen), count))
