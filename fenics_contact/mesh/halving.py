"""Halving of quadrilaterals and hexahedra: marked cells become 2^dim, nodes beside larger cells hang."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import HEXAHEDRON27, QUADRILATERAL9, CellType
from fenics_contact.mesh.chart import Chart
from fenics_contact.mesh.faces import match_faces, number_faces
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes
from fenics_contact.mesh.on_shapes import on_shapes, with_parts
from fenics_contact.mesh.quality import thickness
from fenics_contact.shapes.simple import SurfaceShape

_HALVED = {2: QUADRILATERAL9, 3: HEXAHEDRON27}
"""Quadratic cells, whose nodes are those of the halved linear ones, and whose pieces are their parts."""


def halved(mesh: BodyMesh, chosen: np.ndarray) -> Parts:
    """Halve linear quadrilaterals or hexahedra in every direction, and what is two levels larger beside them.

    Cells that share a point differ by one level at most, so that no master of a hanging node hangs. Where a
    surface is so curved that cells between nodes on its shape and hanging nodes on its facets are inverted,
    the larger cells beside them are halved, too.
    """
    kind = _HALVED[mesh.dim]
    while True:
        parts = Parts.of(mesh, kind, chosen)
        more = parts.beside_inverted(kind)
        if not len(more):
            return parts
        chosen = np.union1d(chosen, more)


@dataclass(frozen=True, eq=False)
class Parts:
    """Cells of which some were halved.

    `positions`: where in its parent each node of each cell lies.
    """

    points: np.ndarray
    cells: np.ndarray
    surfaces: dict[str, np.ndarray]
    hanging: HangingNodes
    chart: Chart | None
    parents: np.ndarray
    positions: np.ndarray
    split: np.ndarray

    @classmethod
    def of(cls, mesh: BodyMesh, kind: CellType, chosen: np.ndarray) -> Parts:
        """Halve chosen cells, and those that are two levels larger beside them."""
        levels = mesh.hanging.levels if mesh.hanging else np.zeros(mesh.n_cells, dtype=np.int64)
        split = _balanced(mesh, kind, levels, chosen)
        large, small = np.flatnonzero(split), np.flatnonzero(~split)
        between, number = _new_nodes(mesh, kind, large)
        nodes, count = np.column_stack([mesh.cells[large], number]), len(kind.vertices)
        parents = np.concatenate([small, np.repeat(large, len(kind.pieces))])
        order = np.argsort(parents, kind="stable")
        parents = parents[order]
        cells = np.concatenate([mesh.cells[small], nodes[:, kind.pieces].reshape(-1, count)])[order]
        whole, halves = np.tile(kind.vertices, (len(small), 1, 1)), kind.nodes[kind.pieces]
        positions = np.concatenate([whole, np.tile(halves, (len(large), 1, 1))])[order]
        hanging = _still_hanging(mesh, kind, cells, between, (levels + split)[parents])
        joined, shapes = with_parts(mesh)
        surfaces = _parts_of_surfaces(joined, kind, nodes)
        chart = mesh.chart and mesh.chart.extended([between, mesh.cells[large]])
        if chart is None:
            points = _placed(mesh, between, (nodes, cells), surfaces, shapes, hanging)
        else:
            points = _mapped(mesh, chart, hanging)
        named = {name: surfaces[name] for name in mesh.surfaces}
        return cls(points, cells, named, hanging, chart, parents, positions, split)

    def beside_inverted(self, kind: CellType) -> np.ndarray:
        """Return the coarse cells that were not halved on which nodes of inverted cells hang."""
        inverted = thickness(self.points, self.cells) <= 0.0
        if not self.hanging or not inverted.any():
            return np.zeros(0, dtype=np.int64)
        mine = np.isin(self.hanging.nodes, self.cells[inverted])
        there = _entities(kind, self.cells)
        which = match_faces(there.reshape(-1, there.shape[2]), self.hanging.masters[mine])
        parents = self.parents[np.flatnonzero(which >= 0) // there.shape[1]]
        return np.unique(parents[~self.split[parents]])


def _entities(kind: CellType, cells: np.ndarray) -> np.ndarray:
    """Return the corners of edges and faces of cells in the order of a quadratic cell's nodes there.

    Each end of edges is there twice in space.
    """
    corners = [np.flatnonzero(values > 0.1) for values in _corner_weights(kind)[:-1]]
    width = 2 ** (kind.dim - 1)
    return cells[:, np.stack([np.tile(own, width // len(own)) for own in corners])]


def _corner_weights(kind: CellType) -> np.ndarray:
    """Return the weights of the vertices in the middles of edges, faces and cell, (n, n_vertices)."""
    count = len(kind.vertices)
    linear = kind.nodes[count:]
    signed = np.where(kind.vertices[None] > 0.5, linear[:, None], 1.0 - linear[:, None])
    return np.asarray(signed.prod(axis=2))


def _balanced(mesh: BodyMesh, kind: CellType, levels: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Mark the chosen cells, and others until those that share a point differ by one level, (n_cells,)."""
    cell, node = np.repeat(np.arange(mesh.n_cells), mesh.cells.shape[1]), mesh.cells.ravel()
    if mesh.hanging:  # larger cells touch the nodes that hang on them
        there = _entities(kind, mesh.cells)
        which = match_faces(there.reshape(-1, there.shape[2]), mesh.hanging.masters)
        found = np.flatnonzero(which >= 0)
        cell = np.concatenate([cell, found // there.shape[1]])
        node = np.concatenate([node, mesh.hanging.nodes[which[found]]])
    split = np.zeros(mesh.n_cells, dtype=bool)
    split[chosen] = True
    while True:
        highest = np.zeros(mesh.n_nodes, dtype=np.int64)
        np.maximum.at(highest, node, (levels + split)[cell])
        behind = np.unique(cell[(levels + split)[cell] < highest[node] - 1])
        if not len(behind):
            return split
        split[behind] = True


def _new_nodes(mesh: BodyMesh, kind: CellType, large: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the nodes in the middle of edges, faces and cells, those that were there by their old numbers.

    Returns also the corners between which new nodes lie, in the order of their numbers.
    """
    there = _entities(kind, mesh.cells[large])
    flat = there.reshape(-1, there.shape[2])
    known = mesh.hanging.masters if mesh.hanging else np.zeros((0, there.shape[2]), dtype=np.int64)
    key = number_faces(np.concatenate([known, flat]))
    node_of = np.full(key.max(initial=-1) + 1, -1)
    node_of[key[: len(known)]] = mesh.hanging.nodes
    unique, first = np.unique(key[len(known) :], return_index=True)
    new = node_of[unique] < 0
    node_of[unique[new]] = mesh.n_nodes + np.arange(new.sum())
    number = node_of[key[len(known) :]].reshape(there.shape[:2])
    centres = mesh.n_nodes + np.count_nonzero(new) + np.arange(len(large))
    return flat[first[new]], np.column_stack([number, centres])


def _still_hanging(
    mesh: BodyMesh, kind: CellType, cells: np.ndarray, between: np.ndarray, levels: np.ndarray
) -> HangingNodes:
    """Return the nodes in the middle of edges and faces of the refined cells."""
    masters, nodes = between, mesh.n_nodes + np.arange(len(between))
    if mesh.hanging:
        masters = np.concatenate([mesh.hanging.masters, masters])
        nodes = np.concatenate([mesh.hanging.nodes, nodes])
    touched = np.zeros(int(cells.max()) + 1, dtype=bool)
    touched[masters] = True
    larger = _entities(kind, cells[touched[cells].sum(axis=1) > 1]).reshape(-1, masters.shape[1])
    hangs = np.zeros(len(masters), dtype=bool)
    which = match_faces(larger, masters)
    hangs[which[which >= 0]] = True
    if not hangs.any():
        return NO_HANGING
    return HangingNodes(nodes[hangs], masters[hangs], levels)


def _parts_of_surfaces(
    surfaces: dict[str, np.ndarray], kind: CellType, nodes: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the facets of the surfaces, those of halved cells replaced by their parts.

    `nodes`: all nodes of the halved cells, as of quadratic ones.
    """
    faces = nodes[:, kind.faces].reshape(-1, kind.faces.shape[1])
    corners = 2 ** (kind.dim - 1)
    result = {}
    for name, facets in surfaces.items():
        both = number_faces(np.concatenate([facets, faces[:, :corners]]))
        place = np.full(both.max(initial=-1) + 1, -1)
        place[both[len(facets) :]] = np.arange(len(faces))
        of_face = place[both[: len(facets)]]
        parts = faces[of_face[of_face >= 0]][:, kind.face_pieces].reshape(-1, corners)
        result[name] = np.concatenate([facets[of_face < 0], parts])
    return result


def _mapped(mesh: BodyMesh, chart: Chart, hanging: HangingNodes) -> np.ndarray:
    """Return coordinates: new nodes and those that hang no more are the images of a chart."""
    points = chart.points()
    stays = np.ones(mesh.n_nodes, dtype=bool)
    stays[mesh.hanging.nodes] = False
    points[: mesh.n_nodes][stays] = mesh.points[stays]
    return hanging.placed(points)


def _placed(
    mesh: BodyMesh,
    between: np.ndarray,
    numbers: tuple[np.ndarray, np.ndarray],
    surfaces: dict[str, np.ndarray],
    shapes: dict[str, SurfaceShape],
    hanging: HangingNodes,
) -> np.ndarray:
    """Return coordinates: new nodes and those that hang no more lie on the shapes of their surfaces.

    Others around them follow, see `smoothed_along`; nodes that hang lie at the mean of their masters.
    `numbers`: all nodes of the halved cells, and the refined cells.
    """
    nodes, cells = numbers
    n_old, count = mesh.n_nodes, mesh.n_nodes + len(between) + len(nodes)
    moves = np.zeros(count, dtype=bool)
    moves[n_old:] = True
    moves[mesh.hanging.nodes] = True
    moves[hanging.nodes] = False
    points = np.concatenate([mesh.points, np.empty((count - n_old, mesh.dim))])
    points[n_old : n_old + len(between)] = points[between].mean(axis=1)
    points[nodes[:, -1]] = points[nodes[:, : 2**mesh.dim]].mean(axis=1)
    return on_shapes(points, cells, surfaces, shapes, moves, hanging)
