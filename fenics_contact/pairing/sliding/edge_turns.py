"""One tangent plane along the edges of smooth patches: what the derivatives across them lack for that."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.pairing.sliding.patch_functions import edge_derivatives
from fenics_contact.surfaces import SurfaceTangents

#: Where derivatives along an edge are compared, and the coefficients of 3t(1 − t)² and 3t²(1 − t) from there.
AT = (1 / 3, 2 / 3)
FITTED = ((3.0, -1.5), (-1.5, 3.0))


def edge_turns(tangents: SurfaceTangents, control: sp.csr_matrix, order: int) -> sp.csr_matrix:
    """Return the weights of the functions that give neighbouring patches one tangent plane along their edge.

    Along an edge with the curve C(t), the patches on both sides get derivatives across it that are

        D(t) = p(t) M(t) + q(t) C'(t),

    with the same M, linear in t between vectors that are orthogonal to the edge at its ends in the
    undeformed surface; p and q, linear too, follow at each end from the tangent of the patch's other edge. M
    and C' are linear in the nodes with fixed weights, p and q are fixed: so whatever becomes of the nodes, M
    and C' span a plane that both patches have in common.

    Args:
        tangents: The tangents at the corners, of a surface in space.
        control: Weights of the nodes in the patches' functions along edges, see `edge_functions`, shape
            (n_facets · functions, n_nodes).
        order: As for `edge_functions`.

    Returns:
        Shape (n_facets · corners · 2, n_nodes): of both functions of each edge, see `turning_functions`; zero
        at edges that end in a straight tangent.

    References:
        H. Chiyokura, F. Kimura, Design of solids with free-form surfaces, Computer Graphics 17 (1983).
    """
    first, second = tangents.shares, np.roll(tangents.shares, -1, axis=1)
    starts, stops = first[:, :, 0], -second[:, :, 1]
    # Across the edge is towards the corner before it: in triangles that is past the next edge's tangent.
    begun, ended = first[:, :, 1], second[:, :, 0] + (stops if first.shape[1] == 3 else 0.0)
    m0, p0, q0 = _split(starts, begun, first)
    m1, p1, q1 = _split(stops, ended, second)
    here = _combined(tangents, tangents.of_corner, m0)
    there = _combined(tangents, np.roll(tangents.of_corner, -1, axis=1), m1)
    smooth = tangents.smooth.all(axis=2)
    smooth = (smooth & np.roll(smooth, -1, axis=1)).ravel().astype(np.float64)
    lacking = []
    for t in AT:
        p, q = (sp.diags(((1 - t) * a + t * b).ravel()) for a, b in ((p0, p1), (q0, q1)))
        along, across = (edge_derivatives(control, first.shape[1], order, t, way) for way in (1, -1))
        lacking.append(sp.diags(smooth) @ (p @ ((1 - t) * here + t * there) + q @ along - across))
    both = [sum(f * rows for f, rows in zip(line, lacking, strict=True)) for line in FITTED]
    in_turn = np.arange(2 * len(smooth)).reshape(2, -1).T.ravel()
    return sp.vstack(both, format="csr")[in_turn]


def _split(edge: np.ndarray, across: np.ndarray, pair: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return unit vectors M orthogonal to the edge, on the side of its patch's corner, p and q.

    Args:
        edge: C' in the axes of the tangent plane, shape (n_facets, corners, 2).
        across: p M + q C' likewise.
        pair: Both tangents of the corner, whose sense is that of the facet, shape (n_facets, corners, 2, 2).
    """
    sense = np.sign(np.linalg.det(pair))[..., None]
    length = np.linalg.norm(edge, axis=2)
    length = np.where(length > 0.0, length, 1.0)
    normal = sense * np.stack([-edge[..., 1], edge[..., 0]], axis=2) / length[..., None]
    return normal, (across * normal).sum(axis=2), (across * edge).sum(axis=2) / length**2


def _combined(tangents: SurfaceTangents, wedge: np.ndarray, shares: np.ndarray) -> sp.csr_matrix:
    """Return weights of the nodes in combinations of the derivatives of wedges, (wedge.size, n_nodes)."""
    row = np.repeat(np.arange(wedge.size), 2)
    column = (2 * wedge.reshape(-1, 1) + np.arange(2)).ravel()
    shape = (wedge.size, tangents.derivatives.shape[0])
    return (sp.csr_matrix((shares.ravel(), (row, column)), shape=shape) @ tangents.derivatives).tocsr()
