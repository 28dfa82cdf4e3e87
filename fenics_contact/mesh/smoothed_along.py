"""New nodes are drawn along by those that are put on true shapes, so that cells keep their form."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags

from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes


def smoothed_along(
    moved: np.ndarray,
    free: np.ndarray,
    straight: np.ndarray,
    cells: np.ndarray,
    along: np.ndarray,
    hanging: HangingNodes = NO_HANGING,
    iterations: int = 100,
) -> np.ndarray:
    """Return displacements of all nodes for those of the nodes that were put on shapes.

    They minimise Σ |dᵢ − dⱼ|² / lᵢⱼ² over the edges of cells with lengths l: along the short edges of thin
    layers all of these move, and with it what is as near to the surface as its new nodes are to each other.
    Conjugate gradients: each iteration reaches one layer further. `free`: marks of the nodes that follow, all
    others keep theirs; `along`: projections onto the directions in which nodes may move.
    """
    joined = _joined(cells, straight)
    if hanging:
        follow = hanging.followed(len(straight))
        joined = csr_matrix(follow.T @ joined @ follow)
    joined, along = joined[free], along[free]
    scale = 1.0 / np.sqrt(joined[:, free].diagonal())[:, None]
    inside = diags(scale.ravel()) @ joined[:, free] @ diags(scale.ravel())

    def within(vectors: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("nde,ne->nd", along, vectors))

    start = np.where(free[:, None], 0.0, moved)
    left = within(-scale * (joined @ start))
    found, step, size = np.zeros_like(left), left.copy(), float(np.sum(left**2))
    least = 1e-12 * size
    for _ in range(iterations):
        if size <= least:
            break
        product = within(inside @ step)
        length = size / np.sum(step * product)
        found, left, before = found + length * step, left - length * product, size
        size = float(np.sum(left**2))
        step = left + size / before * step
    start[free] = scale * found
    return start


def _joined(cells: np.ndarray, points: np.ndarray) -> csr_matrix:
    """Return the Laplacian of edges of cells with weights 1 / l², shape (n_nodes, n_nodes)."""
    kind = cell_type_of(cells, points.shape[1])
    ends = np.array([[v, far] for v, around in enumerate(kind.edges) for far in around if v < far])
    both = np.sort(cells[:, ends].reshape(-1, 2), axis=1)
    edges = np.divmod(np.unique(both[:, 0] * len(points) + both[:, 1]), len(points))
    weight = 1.0 / np.sum((points[edges[0]] - points[edges[1]]) ** 2, axis=1)
    matrix = coo_matrix((weight, edges), shape=2 * (len(points),)).tocsr()
    matrix = matrix + matrix.T
    return csr_matrix(diags(np.asarray(matrix.sum(axis=1)).ravel()) - matrix)
