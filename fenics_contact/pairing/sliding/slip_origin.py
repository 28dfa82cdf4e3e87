"""How slip depends on where the nodes stood when it began."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.pairing.sliding.differential import Differential, point_motion, spread


def slip_by_start(
    points: ContactPoints,
    coordinates: np.ndarray,
    start: ContactPoints,
    differential: Differential,
    alike: tuple[np.ndarray, np.ndarray],
    turned: Sequence[np.ndarray],
) -> sp.csr_matrix:
    """Return the derivative of `SlidingPoints.slip` by the coordinates at its start.

    Of t_a·(x_s − Σ W_j(ξ₀) x_j) it is −t_a·S,_b(ξ₀) δξ₀_b, with the master where it lies now; on obstacles
    −t_a·Q δf, with the obstacle's rotation Q since the start and the foot f of the node on it.

    Args:
        points: The points now.
        coordinates: Coordinates of all nodes now, shape (n_nodes, dim), [length].
        start: The points at the start.
        differential: Theirs.
        alike: Numbers of points now and of the same points at the start; others have no derivative.
        turned: Q of each pair, shape (dim, dim).

    Returns:
        Shape (n · (dim − 1), n_dofs), dof dim · node + component, rows as those of `SlidingPoints.slip_rows`.
    """
    count, nodes = points.count, len(coordinates)
    width, dim = points.tangents.shape[1:]
    local, slaves = point_motion(start, differential).local, _of_nodes(start.slave, nodes)
    result = sp.csr_matrix((width * count, dim * nodes))
    for index, rotation in enumerate(turned):
        now, then = (each[points.pair[alike[0]] == index] for each in alike)
        rigid = bool(np.any(start.facet[then] < 0))
        for a in range(width):
            tangent = points.tangents[now, a]
            if rigid:
                foot = rotation @ _foot_by_node(start, differential, then)
                rows = spread(-np.einsum("nd,nde->ne", tangent, foot), slaves[then])
            else:
                rows = sp.csr_matrix((len(now), dim * nodes))
                for b in range(width):
                    rate = np.einsum("nd,nd->n", tangent, differential.slopes[b][then] @ coordinates)
                    rows = rows - sp.diags(rate) @ local[b][then]
            result = result + _of_nodes(width * now + a, width * count).T @ rows
    return result.tocsr()


def _foot_by_node(start: ContactPoints, differential: Differential, chosen: np.ndarray) -> np.ndarray:
    """Return the derivative of the feet of nodes on an obstacle, shape (n, dim, dim)."""
    normal, distance = start.normal[chosen], start.distance[chosen]
    along = np.eye(normal.shape[1]) - normal[:, :, None] * normal[:, None]
    return np.asarray(along - distance[:, None, None] * differential.curvature[chosen])


def _of_nodes(chosen: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the matrix that picks some of ``count`` entries."""
    return sp.csr_matrix((np.ones(len(chosen)), (np.arange(len(chosen)), chosen)), shape=(len(chosen), count))
