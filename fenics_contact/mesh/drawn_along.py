"""New nodes are drawn along by those that are put on true shapes, so that cells keep their form."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity

from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.faces import corners_of, vector_areas


def drawn_along(
    moved: np.ndarray,
    placed: np.ndarray,
    straight: np.ndarray,
    cells: np.ndarray,
    boundary: np.ndarray,
    still: np.ndarray,
    iterations: int = 100,
) -> np.ndarray:
    """Return displacements of all new nodes for those of the nodes that were put on shapes.

    Each is the mean of those of the new nodes around it: between two old layers of cells along a curved
    surface all of a new layer moves. Nodes of plane parts of the boundary stay in these, those of gently
    curved ones without a shape are free. Conjugate gradients: each iteration reaches one layer further.

    `moved`: displacements, shape (n_nodes, dim); `placed`: marks of nodes on shapes; `straight`: coordinates
    with all nodes on facets; `cells`: node numbers of linear cells; `boundary`: their outer faces; `still`:
    marks of old and of hanging nodes, which stay and do not count.
    """
    free = ~still & ~placed
    joined = _joined(cells, straight.shape[1], ~still)[free]
    along = _directions(straight, boundary)[free]
    scale = 1.0 / np.sqrt(np.maximum(np.asarray(joined.sum(axis=1)), 1.0))
    inside = diags(scale.ravel())
    inside = identity(len(along)) - inside @ joined[:, free] @ inside

    def within(vectors: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("nde,ne->nd", along, vectors))

    left = within(scale * (joined @ moved))
    found, step, size = np.zeros_like(left), left.copy(), float(np.sum(left**2))
    for _ in range(iterations):
        if size <= 1e-10 * np.sum(moved**2):
            break
        product = within(inside @ step)
        length = size / np.sum(step * product)
        found, left, before = found + length * step, left - length * product, size
        size = float(np.sum(left**2))
        step = left + size / before * step
    result = moved.copy()
    result[free] = scale * found
    return result


def _joined(cells: np.ndarray, dim: int, new: np.ndarray) -> csr_matrix:
    """Return which new nodes share an edge of a cell, shape (n_nodes, n_nodes)."""
    kind = cell_type_of(cells, dim)
    ends = np.array([[v, far] for v, around in enumerate(kind.edges) for far in around if v < far])
    edges = np.unique(np.sort(cells[:, ends].reshape(-1, 2), axis=1), axis=0)
    edges = edges[new[edges].all(axis=1)]
    matrix = coo_matrix((np.ones(len(edges)), tuple(edges.T)), shape=2 * (len(new),)).tocsr()
    return csr_matrix(matrix + matrix.T)


def _directions(points: np.ndarray, boundary: np.ndarray, gentle: float = 0.12) -> np.ndarray:
    """Return projections onto the directions in which nodes of a boundary may move, (n_nodes, dim, dim).

    `gentle`: share of the squares of normals across their mean up to which a boundary is gently curved: they
    differ by less than about 40 degrees.
    """
    count, dim = points.shape
    areas = vector_areas(points, boundary)
    normals = areas / np.linalg.norm(areas, axis=1)[:, None]
    corners = corners_of(boundary, dim)
    squares = np.zeros((count, dim, dim))
    np.add.at(squares, corners, np.einsum("nd,ne->nde", normals, normals)[:, None])
    around = np.zeros_like(squares)
    np.add.at(around, corners, squares[corners].sum(axis=1)[:, None])
    there = np.unique(corners)
    result = np.tile(np.eye(dim), (count, 1, 1))
    (own, axes), (wider, _) = (np.linalg.eigh(_shares(each[there])) for each in (squares, around))
    curved = [(values[:, -2] > 1e-8) & (values[:, :-1].sum(axis=1) < gentle) for values in (own, wider)]
    held = (own > 0.1) & ~(curved[0] | curved[1])[:, None]
    result[there] -= np.einsum("nda,na,nea->nde", axes, held.astype(float), axes)
    return result


def _shares(squares: np.ndarray) -> np.ndarray:
    return np.asarray(squares / np.trace(squares, axis1=1, axis2=2)[:, None, None])
