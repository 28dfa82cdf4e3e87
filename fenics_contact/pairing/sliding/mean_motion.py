"""How the weighted means of mortar contact move with the nodes, and what Newton's method needs of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.linalg import scaled_rows
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.pairing.sliding.differential import frame_changes, spread
from fenics_contact.pairing.sliding.stiffness import LowRank


@dataclass(frozen=True)
class MeanMotion:
    """First derivatives of normals and weights by the coordinates of all nodes.

    Attributes:
        turn: t_a·δn, shape (n, n_dofs) each.
        point: Point of each weight, shape (m,).
        node: Its node of the master among those of all bodies, shape (m,).
        weights: Derivatives of the weights, shape (m, n_dofs), [1 / length].
    """

    turn: tuple[sp.csr_matrix, ...]
    point: np.ndarray
    node: np.ndarray
    weights: sp.csr_matrix

    def feet(self, points: ContactPoints, coordinates: np.ndarray, along: np.ndarray) -> sp.csr_matrix:
        """Return v·Σ δW_j x_j, how the mean of the master moves as its weights change, (n, n_dofs).

        Args:
            points: The contact points.
            coordinates: Of all nodes, shape (n_nodes, dim), [length].
            along: v, shape (n, dim).
        """
        away = coordinates[self.node] - coordinates[points.slave[self.point]]
        lever = np.einsum("md,md->m", away, along[self.point])
        entries = lever, (self.point, np.arange(len(lever)))
        return (sp.csr_matrix(entries, shape=(points.count, len(lever))) @ self.weights).tocsr()

    def gap_rows(self, points: ContactPoints, coordinates: np.ndarray) -> sp.csr_matrix:
        """Return the derivative of the gaps less the rows n·(δx_i − Σ W_ij δx_j) of the forces, (n, n_dofs).

        That is δn·(x_i − Σ W_ij x_j) − n·Σ δW_ij x_j.
        """
        jump = points.jump @ coordinates
        turned = sum(
            scaled_rows(turn, np.einsum("nd,nd->n", points.tangents[:, a], jump))
            for a, turn in enumerate(self.turn)
        )
        return (turned - self.feet(points, coordinates, points.normal)).tocsr()

    def slip_rows(
        self, points: ContactPoints, coordinates: np.ndarray, way: np.ndarray
    ) -> list[sp.csr_matrix]:
        """Return what the derivative of the slip has beside t_c·Σ (W_j − W_j,start) δx_j, (n, n_dofs) each.

        That is t_c·Σ δW_j x_j + δt_c·way.

        Args:
            points: The contact points.
            coordinates: Of all nodes, shape (n_nodes, dim), [length].
            way: The slip as vectors, shape (n, dim), [length].
        """
        turned = frame_changes(points.normal, points.axes, points.tangents)
        change = np.einsum("ncad,nd->nca", turned, way)
        rows = []
        for c in range(turned.shape[1]):
            frames = sum(scaled_rows(turn, change[:, c, a]) for a, turn in enumerate(self.turn))
            rows.append((self.feet(points, coordinates, points.tangents[:, c]) + frames).tocsr())
        return rows

    def stiffness(self, points: ContactPoints, normal: np.ndarray, friction: np.ndarray) -> LowRank:
        """Return the derivative of the forces Σ p_i·(δx_i − Σ W_ij δx_j) at fixed multipliers.

        With p = −λ_N n + Σ τ_a t_a these change by δp, and over the master by −δW_ij p_i: one column for each
        tangent of a point and each component of a node.

        Args:
            points: The contact points.
            normal: λ_N, shape (n,), [force].
            friction: τ in the points' tangents, shape (n, dim − 1), [force].
        """
        turned = frame_changes(points.normal, points.axes, points.tangents)
        change = np.einsum("nc,ncad->nad", friction, turned) - normal[:, None, None] * points.tangents
        acting = np.flatnonzero(change.any(axis=(1, 2)))
        left = [spread(change[acting, a], points.jump[acting]) for a in range(change.shape[1])]
        right = [turn[acting] for turn in self.turn]
        force = np.einsum("nc,ncd->nd", friction, points.tangents) - normal[:, None] * points.normal
        node, first, place = np.unique(self.node, return_index=True, return_inverse=True)
        # One row for each component of each node, component by component.
        dim, every, component = force.shape[1], np.arange(len(self.node)), np.arange(force.shape[1])[:, None]
        entry = (len(node) * component + place.ravel()).ravel(), np.tile(every, dim)
        acted = sp.csr_matrix((force[self.point].T.ravel(), entry), shape=(dim * len(node), len(every)))
        right.append(acted @ self.weights)
        column, row = (dim * node + component).ravel(), np.arange(dim * len(node) + 1)
        shape = dim * len(node), self.weights.shape[1]
        left.append(sp.csr_matrix((-np.ones(len(column)), column, row), shape=shape))
        point = [np.tile(acting, change.shape[1]), np.tile(self.point[first], dim)]
        return LowRank(
            sp.vstack(left).T.tocsr(), sp.vstack(right).T.tocsr(), np.concatenate(point).astype(np.int64)
        )


@dataclass(frozen=True)
class MeanTangents:
    """What the linearisation of mortar contact has beside the rows of its forces.

    Attributes:
        stiffness: Derivative of the forces by the coordinates at fixed multipliers.
        gap: Where a point has a force, the derivative of its gap less the row n·(δx_i − Σ W_ij δx_j), shape
            (n, n_dofs).
        slip: The same of its slip less the rows t_a·(δx_i − Σ W_ij δx_j), shape (n · (dim − 1), n_dofs).
    """

    stiffness: LowRank
    gap: sp.csr_matrix
    slip: sp.csr_matrix

    @classmethod
    def none(cls, count: int, width: int, size: int) -> MeanTangents:
        """Return those of points without forces.

        Args:
            count: Number of points.
            width: Number of tangents of each.
            size: Number of coordinates of all nodes.
        """
        nothing = sp.csr_matrix((size, 0))
        stiffness = LowRank(nothing, nothing, np.zeros(0, dtype=np.int64))
        return cls(stiffness, sp.csr_matrix((count, size)), sp.csr_matrix((count * width, size)))

    def with_points(self, mine: np.ndarray, other: MeanTangents) -> MeanTangents:
        """Return these and those of some of the points, by their numbers among all."""
        count, own = self.gap.shape[0], other.stiffness
        width = self.slip.shape[0] // max(count, 1)
        rows = (width * mine[:, None] + np.arange(width)).ravel()
        left, right = (
            sp.hstack([getattr(part, side) for part in (self.stiffness, own)], "csr")
            for side in ("left", "right")
        )
        point = np.concatenate([self.stiffness.point, mine[own.point]])
        return MeanTangents(
            LowRank(left, right, point),
            (self.gap + placed(mine, count) @ other.gap).tocsr(),
            (self.slip + placed(rows, count * width) @ other.slip).tocsr(),
        )


def placed(chosen: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the matrix that puts rows to chosen places among a number of rows."""
    entries = np.ones(len(chosen)), (chosen, np.arange(len(chosen)))
    return sp.csr_matrix(entries, shape=(count, len(chosen)))


def interleaved(parts: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
    """Return the first row of each part, the second one of each, and so on."""
    width, count = len(parts), parts[0].shape[0]
    if width == 1:
        return parts[0]
    order = np.arange(width * count).reshape(width, count).T.ravel()
    return sp.vstack(parts, format="csr")[order]
