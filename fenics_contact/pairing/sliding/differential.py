"""How contact points move with the nodes: on the master's surface, and with them normal and frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.linalg import scaled_rows
from fenics_contact.pairing.contact_points import ContactPoints


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

    Args:
        curvature: Second derivatives of the distance of rigid obstacles, shape (n, dim, dim), [1 / length].
        n_nodes: Number of nodes of all bodies.
    """
    count, dim, _ = curvature.shape
    none = (sp.csr_matrix((count, n_nodes)),) * (dim - 1)
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

    Args:
        vectors: v, shape (n, dim).
        weights: w, shape (n, n_nodes).
    """
    count, dim = vectors.shape
    row = np.repeat(np.arange(count), np.diff(weights.indptr))
    data = (weights.data[:, None] * vectors[row]).ravel()
    indices = (dim * weights.indices[:, None] + np.arange(dim)).ravel()
    return sp.csr_matrix((data, indices, dim * weights.indptr), shape=(count, dim * weights.shape[1]))


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

    Args:
        points: Contact points.
        differential: Their differential.
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

    Args:
        normal: Unit normals, shape (n, dim).
        axes: Axes nearest to the first tangents, shape (n, dim).
        change: Changes of the normals, shape (n, k, dim).
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
