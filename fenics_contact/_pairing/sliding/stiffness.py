"""Stiffness of contact forces whose directions and places change with the geometry, in factors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.sparse import LAST_PLACES, scaled_rows
from fenics_contact._pairing.points import ContactPoints


@dataclass(frozen=True)
class Differential:
    """What derivatives of contact points need beside gap, normal and weights.

    Attributes:
        tangents: S,_a of the master's surface, zero on rigid obstacles, shape (n, dim − 1, dim), [length].
        bend: n·S,_ab, shape (n, dim − 1, dim − 1), [length].
        slopes: Derivatives W,_a of the weights, shape (n, n_nodes) each.
        curvature: Second derivatives of the distance of rigid obstacles, zero on bodies, shape (n, dim, dim),
            [1 / length].
    """

    tangents: np.ndarray
    bend: np.ndarray
    slopes: tuple[sp.csr_matrix, ...]
    curvature: np.ndarray


def without_patches(curvature: np.ndarray, n_nodes: int) -> Differential:
    """Return the differential of points that are on no patches.

    `curvature`: second derivatives of the distance of rigid obstacles, shape (n, dim, dim), [1 / length].
    """
    count, dim, _ = curvature.shape
    none = (Csr((count, n_nodes)),) * (dim - 1)
    return Differential(np.zeros((count, dim - 1, dim)), np.zeros((count, dim - 1, dim - 1)), none, curvature)


def join_differentials(parts: Sequence[Differential], dim: int, n_nodes: int) -> Differential:
    """Concatenate those of several pairs; empty if there are none."""
    if len(parts) == 1:
        return parts[0]
    every = [without_patches(np.zeros((0, dim, dim)), n_nodes), *parts]
    return Differential(
        np.concatenate([part.tangents for part in every]),
        np.concatenate([part.bend for part in every]),
        tuple(sp.vstack([part.slopes[a] for part in every], format="csr") for a in range(dim - 1)),
        np.concatenate([part.curvature for part in every]),
    )


def spread(vectors: np.ndarray, weights: sp.csr_matrix) -> sp.csr_matrix:
    """Return v · Σ w_j u_j for each point, shape (n, n_nodes · dim); dof dim · node + component.

    `vectors`: v, shape (n, dim); `weights`: w, shape (n, n_nodes).
    """
    count, dim = vectors.shape
    row = np.repeat(np.arange(count), np.diff(weights.indptr))
    data = (weights.data[:, None] * vectors[row]).ravel()
    indices = (dim * weights.indices[:, None] + np.arange(dim)).ravel()
    return Csr((data, indices, dim * weights.indptr), shape=(count, dim * weights.shape[1]))


def inverse_metrics(points: ContactPoints, differential: Differential) -> tuple[np.ndarray, np.ndarray]:
    """Return (S,_a·S,_b)⁻¹ and H⁻¹, H_ab = S,_a·S,_b − r n·S,_ab, r the distance, (n, dim − 1, dim − 1).

    On rigid obstacles both are the identity.
    """
    tangents = differential.tangents
    metric = np.einsum("nad,nbd->nab", tangents, tangents)
    metric[points.facet < 0] = np.eye(tangents.shape[1])
    second = metric - points.distance[:, None, None] * differential.bend
    return np.linalg.inv(metric), np.linalg.inv(second)


@dataclass(frozen=True)
class PointMotion:
    """First derivatives of contact points by the coordinates of all nodes.

    Attributes:
        local: δξ_a, shape (n, n_dofs) each.
        turn: Factors ρ_a of δn = Σ e_a ρ_a, shape (n, n_dofs) each.
        directions: e_a, shape (n, dim − 1, dim).
    """

    local: tuple[sp.csr_matrix, ...]
    turn: tuple[sp.csr_matrix, ...]
    directions: np.ndarray


def point_motion(points: ContactPoints, differential: Differential) -> PointMotion:
    """Differentiate the closest points.

    (x_s − S)·S,_a = 0 gives H δξ = S,_a·δv + r n·δS,_a with δv = δx_s − Σ W_j δx_j, and with the dual
    tangents δn = −S^a (n·δS,_a + n·S,_ab δξ_b). On an obstacle δn is the curvature times δx_s.
    """
    normal, width, jump = points.normal, points.normal.shape[1] - 1, points.jump
    inverse, solved = inverse_metrics(points, differential)
    p = [spread(differential.tangents[:, a], jump) for a in range(width)]
    q = [spread(normal, differential.slopes[a]) for a in range(width)]
    right = [p[a] + scaled_rows(q[a], points.distance) for a in range(width)]
    local = [_combined(solved[:, a], right) for a in range(width)]
    turn = [q[a] + _combined(differential.bend[:, a], local) for a in range(width)]
    directions = -np.einsum("nab,nbd->nad", inverse, differential.tangents)
    rigid = points.facet < 0
    directions[rigid] = points.tangents[rigid]
    along = np.einsum("nad,nde->nae", points.tangents, differential.curvature)
    turn = [turn[a] + spread(along[:, a], jump) for a in range(width)]
    return PointMotion(tuple(local), tuple(turn), directions)


def _combined(factors: np.ndarray, rows: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
    """Return Σ_b factors[:, b] · rows[b]."""
    return sum(scaled_rows(rows[b], factors[:, b]) for b in range(len(rows))).tocsr()


def frame_changes(normal: np.ndarray, axes: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return how tangents turn with their normals, see `tangent_frames`, shape (n, dim − 1, k, dim).

    `normal`: unit normals, shape (n, dim); `axes`: axes nearest to the first tangents, shape (n, dim);
    `change`: changes of the normals, shape (n, k, dim).
    """
    if normal.shape[1] == 2:
        return np.stack([change[..., 1], -change[..., 0]], axis=2)[:, None]
    along = np.einsum("nd,nd->n", axes, normal)[:, None, None]
    first = axes - along[:, 0] * normal
    length = np.linalg.norm(first, axis=1)[:, None, None]
    unit = first[:, None] / length
    turned = -np.einsum("nd,nkd->nk", axes, change)[..., None] * normal[:, None] - along * change
    turned = (
        turned - np.einsum("nkd,nkd->nk", turned, np.broadcast_to(unit, turned.shape))[..., None] * unit
    ) / length
    other = np.cross(change, unit) + np.cross(normal[:, None], turned)
    return np.stack([turned, other], axis=1)


@dataclass(frozen=True)
class GeometricStiffness:
    """−λ_N times the second derivatives of gaps, K = V diag(D) Vᵀ and blocks of single nodes.

    Attributes:
        columns: V, orthonormal at each point, shape (n_dofs, m); dof dim · node + component of all nodes.
        values: D, of both signs, shape (m,), [force / length].
        point: Contact point of each column, ascending, shape (m,).
        blocks: −λ_N times the curvature of rigid obstacles, shape (n_blocks, dim, dim), [force / length].
        block_node: The slave node on which each block acts, shape (n_blocks,).
    """

    columns: sp.csr_matrix
    values: np.ndarray
    point: np.ndarray
    blocks: np.ndarray
    block_node: np.ndarray

    def joined(self, other: GeometricStiffness) -> GeometricStiffness:
        """Return the sum of two, of different points, the other one without blocks of nodes."""
        point = np.concatenate([self.point, other.point])
        order = np.argsort(point, kind="stable")
        columns = sp.hstack([self.columns, other.columns], format="csr")[:, order]
        values = np.concatenate([self.values, other.values])[order]
        return replace(self, columns=columns, values=values, point=point[order])

    def assembled(self) -> sp.csr_matrix:
        """Return K, shape (n_dofs, n_dofs)."""
        dim, size = self.blocks.shape[1], self.columns.shape[0]
        dof = dim * self.block_node[:, None] + np.arange(dim)
        row, column = np.repeat(dof, dim, axis=1).ravel(), np.tile(dof, dim).ravel()
        own = Csr((self.blocks.ravel(), (row, column)), shape=(size, size))
        return (self.columns @ sp.diags(self.values) @ self.columns.T + own).tocsr()


def _between_nodes(points: ContactPoints, which: np.ndarray, blocks: np.ndarray) -> GeometricStiffness:
    """Return the stiffness of blocks, shape (n, dim, dim), at points inside facets of their slaves."""
    values, vectors = np.linalg.eigh(blocks)
    dim, own = values.shape[1], points.own[which]
    rows = spread(np.swapaxes(vectors, 1, 2).reshape(-1, dim), own[np.repeat(np.arange(len(which)), dim)])
    length = np.sqrt(np.repeat(np.asarray(own.multiply(own).sum(axis=1)).ravel(), dim))
    columns, found = scaled_rows(rows, 1.0 / length).T.tocsr(), values.ravel() * length**2
    kept = np.abs(found) > LAST_PLACES * np.abs(found).max()
    no_blocks = np.zeros((0, dim, dim)), np.zeros(0, dtype=np.int64)
    return GeometricStiffness(columns[:, kept], found[kept], np.repeat(which, dim)[kept], *no_blocks)


def geometric_stiffness(
    points: ContactPoints, differential: Differential, multiplier: np.ndarray
) -> GeometricStiffness:
    """Return the derivative of the normal forces Σ −λ_N δg by the coordinates, at fixed λ_N.

    With p_a = S,_a·δv, q_a = n·δS,_a, m = S,_a·S,_b, k = n·S,_ab and H = m − r k,
    −δ²g = pᵀ m⁻¹ k H⁻¹ p + pᵀ H⁻¹ q + qᵀ H⁻¹ p + r qᵀ H⁻¹ q: rank 2 (dim − 1) at each point.

    `multiplier`: λ_N, shape (n,), [force]; points where it is not positive contribute nothing.

    References:
        P. Wriggers, Computational Contact Mechanics, 2nd ed., Springer 2006, chapters 4 and 6.
    """
    pressed = np.flatnonzero((multiplier > 0.0) & (points.facet >= 0))
    bent = differential.curvature.any(axis=(1, 2))
    pushed = np.flatnonzero((multiplier > 0.0) & bent)
    blocks = -multiplier[pushed, None, None] * differential.curvature[pushed]
    between = np.isin(pushed, points.are_inside)
    if between.any():
        own = _between_nodes(points, pushed[between], blocks[between])
        others = multiplier.copy()
        others[pushed[between]] = 0.0
        return geometric_stiffness(points, differential, others).joined(own)
    if len(pressed) == 0:
        nothing = Csr((points.normal.shape[1] * points.jump.shape[1], 0))
        return GeometricStiffness(nothing, np.zeros(0), pressed, blocks, points.slave[pushed])
    core, gram = _core(points, differential, multiplier, pressed)
    lower = np.linalg.cholesky(gram)
    values, vectors = np.linalg.eigh(np.swapaxes(lower, 1, 2) @ core @ lower)
    mixed = np.linalg.solve(np.swapaxes(lower, 1, 2), vectors)
    width, jump = points.normal.shape[1] - 1, points.jump[pressed]
    rows = [spread(differential.tangents[pressed, a], jump) for a in range(width)]
    rows += [spread(points.normal[pressed], differential.slopes[a][pressed]) for a in range(width)]
    kept = np.abs(values) > LAST_PLACES * np.abs(values).max(initial=0.0)
    place, column = np.nonzero(kept)
    chosen = mixed[place, :, column]
    total = sum(scaled_rows(rows[r][place], chosen[:, r]) for r in range(2 * width))
    return GeometricStiffness(
        total.T.tocsr(), values[place, column], pressed[place], blocks, points.slave[pushed]
    )


def _core(
    points: ContactPoints, differential: Differential, multiplier: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix between the rows p and q of chosen points, and the inner products of these rows."""
    inverse, solved = (each[chosen] for each in inverse_metrics(points, differential))
    distance, bend = points.distance[chosen, None, None], differential.bend[chosen]
    upper = np.concatenate([inverse @ bend @ solved, solved], axis=2)
    lower = np.concatenate([solved, distance * solved], axis=2)
    core = multiplier[chosen, None, None] * np.concatenate([upper, lower], axis=1)
    tangents, jump, width = differential.tangents[chosen], points.jump[chosen], bend.shape[1]
    gram = np.zeros_like(core)
    length = np.asarray(jump.multiply(jump).sum(axis=1)).ravel()
    gram[:, :width, :width] = length[:, None, None] * np.einsum("nad,nbd->nab", tangents, tangents)
    for a in range(width):
        for b in range(width):
            product = differential.slopes[a][chosen].multiply(differential.slopes[b][chosen])
            gram[:, width + a, width + b] = np.asarray(product.sum(axis=1)).ravel()
    return 0.5 * (core + np.swapaxes(core, 1, 2)), gram


@dataclass(frozen=True)
class LowRank:
    """An unsymmetric matrix L Rᵀ of few columns a point.

    Attributes:
        left: L, shape (n_dofs, m).
        right: R, shape (n_dofs, m).
        point: Contact point of each column, shape (m,).
    """

    left: sp.csr_matrix
    right: sp.csr_matrix
    point: np.ndarray


def friction_stiffness(points: ContactPoints, differential: Differential, friction: np.ndarray) -> LowRank:
    """Return the derivative of the friction forces Σ τ_a t_a (δx_s − Σ W_j δx_j) at fixed τ.

    The tangents turn with the normal, and the force on the master moves over its nodes. Both depend on the
    coordinates through δn and δξ, see `point_motion`: rank 2 (dim − 1) at each point, unsymmetric.

    `friction`: τ in the points' tangents, shape (n, dim − 1), [force].
    """
    rubbed, jump = np.flatnonzero(friction.any(axis=1)), points.jump
    if not (differential.tangents[rubbed].any() or differential.curvature[rubbed].any()):
        # Means over facets move, too, but not as closest points do.
        nothing = Csr((jump.shape[1] * points.normal.shape[1], 0))
        return LowRank(nothing, nothing, rubbed[:0])
    motion = point_motion(points, differential)
    turned = frame_changes(points.normal, points.axes, motion.directions)
    turning = np.einsum("nc,ncad->nad", friction, turned)
    force = np.einsum("nc,ncd->nd", friction, points.tangents)
    left = [spread(turning[:, a], jump) for a in range(turning.shape[1])]
    left += [spread(-force, slope) for slope in differential.slopes]
    right = [*motion.turn, *motion.local]
    return LowRank(
        sp.vstack([each[rubbed] for each in left]).T.tocsr(),
        sp.vstack([each[rubbed] for each in right]).T.tocsr(),
        np.tile(rubbed, len(left)),
    )
