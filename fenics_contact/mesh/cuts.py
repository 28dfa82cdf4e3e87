"""Meshes cut in two along faces of their cells, so that both sides can move apart or into each other."""

from __future__ import annotations

from collections.abc import Hashable
from copy import copy

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fenics_contact.mesh.body_mesh import BodyMesh, Cut
from fenics_contact.mesh.faces import boundary_faces, corners_of, match_faces, neighbours, shared_faces
from fenics_contact.mesh.hanging import NO_CENTRES, Centres, require_none
from fenics_contact.mesh.serendipity_cells import centres_of


def nodes_between(mesh: BodyMesh, before: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Return the nodes that cells before and behind a cut share, ascending."""
    return np.intersect1d(mesh.cells[before], mesh.cells[behind])


def cut_between(mesh: BodyMesh, name: Hashable, before: np.ndarray, behind: np.ndarray) -> BodyMesh:
    """Return the mesh in which cells behind a cut have nodes of their own, after all others.

    Cells keep their numbers, surfaces and shapes their names. Coordinates are given for the nodes before or
    after the cut, see `BodyMesh.moved`. Centres that followed other nodes do so on both sides.
    """
    require_none(mesh.hanging, "a section", "refine no cells there, or take simplices")
    shared = nodes_between(mesh, before, behind)
    faces, sides = shared_faces(mesh.cells, mesh.dim)
    side = np.zeros(mesh.n_cells)
    side[before], side[behind] = -1.0, 1.0
    between = faces[side[sides[:, 0]] * side[sides[:, 1]] < 0.0]
    renumbered = np.arange(mesh.n_nodes)
    renumbered[shared] = mesh.n_nodes + np.arange(len(shared))
    cells = mesh.cells.copy()
    cells[behind] = renumbered[cells[behind]]
    outer, owner = boundary_faces(mesh.cells, mesh.dim)
    surfaces = {}
    for surface, facets in mesh.surfaces.items():
        cell = owner[match_faces(corners_of(facets, mesh.dim), corners_of(outer, mesh.dim))]
        surfaces[surface] = np.where((side[cell] > 0.0)[:, None], renumbered[facets], facets)
    result = BodyMesh(
        np.vstack([mesh.points, mesh.points[shared]]), cells, surfaces, mesh.grid, mesh.regions,
        coincident_nodes=True, shapes=mesh.shapes, node_sets=mesh.node_sets,
        centres=_centres(mesh, cells, np.append(np.arange(mesh.n_nodes), shared)),
    )  # fmt: skip
    facets, _ = boundary_faces(cells, mesh.dim)
    number = match_faces(corners_of(between, mesh.dim), corners_of(facets, mesh.dim))
    cut = Cut(np.column_stack([renumbered[shared], shared]), facets[number])
    origin = None if mesh.origin is mesh else cut_between(mesh.origin, name, before, behind)
    chart = mesh.chart and mesh.chart.extended([shared[:, None]])
    result._set(_cuts={**mesh.cuts, name: cut}, _origin=origin, chart=chart)
    return result


def _centres(mesh: BodyMesh, cells: np.ndarray, node: np.ndarray) -> Centres:
    """Return the centres of new cells that followed in a mesh, given the old node of each new one."""
    found = centres_of(cells, mesh.dim) if mesh.centres else NO_CENTRES
    return found.without(found.nodes[~np.isin(node[found.nodes], mesh.centres.nodes)])


def closed(mesh: BodyMesh) -> BodyMesh:
    """Return the cells as if no cut had been made; some of the points are unused then."""
    result = copy(mesh)
    for known in ("linear", "apart"):
        result.__dict__.pop(known, None)
    result._set(cells=_before_cuts(mesh)[mesh.cells], surfaces={}, _cuts={})
    return result


def _before_cuts(mesh: BodyMesh) -> np.ndarray:
    """Return the node before all cuts of each node, shape (n_nodes,)."""
    node = np.arange(mesh.n_nodes)
    for cut in reversed(list(mesh.cuts.values())):
        node[cut.pairs[:, 0]] = cut.pairs[:, 1]
    return node


def sewn(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh before it was cut, with its surfaces; cells and nodes keep numbers."""
    if not mesh.cuts:
        return mesh
    node = _before_cuts(mesh)
    kept = mesh.n_nodes - sum(len(cut.pairs) for cut in mesh.cuts.values())
    surfaces = {name: node[facets] for name, facets in mesh.surfaces.items()}
    result = BodyMesh(
        mesh.points[:kept], node[mesh.cells], surfaces, mesh.grid, mesh.regions, shapes=mesh.shapes,
        node_sets=mesh.node_sets, centres=_centres(mesh, node[mesh.cells], np.arange(kept)),
    )  # fmt: skip
    result._set(
        chart=mesh.chart and mesh.chart.of(np.arange(kept)[:, None]),
        _origin=None if mesh.origin is mesh else sewn(mesh.origin),
    )
    return result


def pieces(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    """Return a partition whose subdomains no cut crosses; the same one where none does."""
    if not mesh.cuts or np.shape(partition) != (mesh.n_cells,):
        return partition
    piece = _joined(mesh, partition)
    if len(np.unique(piece)) == len(np.unique(partition)):
        return partition
    _, first, number = np.unique(piece, return_index=True, return_inverse=True)
    order = np.lexsort((first, np.asarray(partition)[first]))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[number.ravel()]


def parts_of(mesh: BodyMesh) -> np.ndarray:
    """Return into which parts cuts separate a mesh: the part of each node, shape (n_nodes,)."""
    part = np.zeros(mesh.n_nodes, dtype=np.int64)
    part[mesh.cells] = _joined(mesh, np.zeros(mesh.n_cells))[:, None]
    return part


def _joined(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    """Number the pieces of subdomains that are connected through faces, shape (n_cells,)."""
    pairs = neighbours(mesh.cells, mesh.dim)
    inside = pairs[partition[pairs[:, 0]] == partition[pairs[:, 1]]]
    graph = coo_matrix((np.ones(len(inside), dtype=bool), tuple(inside.T)), shape=2 * (mesh.n_cells,))
    return np.asarray(connected_components(graph, directed=False)[1])
