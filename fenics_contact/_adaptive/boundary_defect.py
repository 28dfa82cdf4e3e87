"""How far the boundary of a mesh is from the true body whose chart it has."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import match_faces, vector_areas
from fenics_contact.mesh.hanging import HangingNodes


def boundary_defect(mesh: BodyMesh) -> np.ndarray:
    """Return how nodes move so that facets enclose as much as the images by the chart, shape (n_nodes, dim).

    What is between a facet and the images is integrated as of quadratic facets through the images of its
    middles (Simpson's rule), and divided among its corners; hanging nodes leave theirs to their masters. Rims
    move as their edges do, in the plane not at all.
    """
    chart = mesh.chart
    assert chart is not None
    facets, _ = mesh.boundary
    areas, count = vector_areas(mesh.points, facets), facets.shape[1]
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2)

    def off(nodes: np.ndarray) -> np.ndarray:
        return np.asarray(chart.of(nodes).points() - mesh.points[nodes].mean(axis=1))

    # Weights of middles, of edges, and of corners, which are off their images where they hang.
    middle, of_edge, of_corner = {2: (4, 0, 1), 3: (0, 2, 0), 4: (16, 4, 1)}[count]
    bulge = float(middle) * off(facets)
    for k in range(count):
        bulge += of_edge * off(edges[:, k]) + of_corner * off(facets[:, [k]])
    missing = np.einsum("nd,nd->n", bulge, areas) / (middle + count * (of_edge + of_corner))
    size = np.linalg.norm(areas, axis=1)
    curved = np.abs(missing) > 1e-12 * size * np.ptp(mesh.points, axis=0).max()
    shares = np.column_stack([missing, size, areas])[curved] / count
    sums = np.zeros((mesh.n_nodes, shares.shape[1]))
    np.add.at(sums, facets[curved], shares[:, None])
    sums = mesh.hanging.followed(mesh.n_nodes).T @ sums
    length, there = np.linalg.norm(sums[:, 2:], axis=1), sums[:, 1] > 0.0
    way = np.zeros_like(mesh.points)
    way[there] = (sums[there, 0] / sums[there, 1] / length[there])[:, None] * sums[there, 2:]
    if count == 2:
        way[np.bincount(facets[curved].ravel(), minlength=len(way)) == 1] = 0.0
        return way
    rim = _rims(edges[curved], mesh.hanging)
    around = np.bincount(rim.ravel(), minlength=len(way))
    by_rim = np.zeros_like(way)
    np.add.at(by_rim, rim, off(rim)[:, None])
    way[around > 0] = 2.0 / 3.0 * by_rim[around > 0] / around[around > 0, None]
    return way


def _rims(edges: np.ndarray, hanging: HangingNodes) -> np.ndarray:
    """Return the edges of only one facet, shape (n, 2), but for those of larger facets that were halved."""
    known, times = np.unique(np.sort(edges.reshape(-1, 2), axis=1), axis=0, return_counts=True)
    rim = known[times == 1]
    ends = np.unique(np.sort(hanging.masters, axis=1)[:, [0, -1]], axis=0)
    halved = (match_faces(rim, ends) >= 0) | np.isin(rim, hanging.nodes).any(axis=1)
    return rim[~halved]
