"""The flat sides of a body beside its designed surfaces, with their edges; in the plane the one face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fenics_contact.gallery import DesignSurface
from fenics_contact.io.spline_fit import CadError
from fenics_contact.mesh import BodyMesh, boundary_faces, vector_areas


@dataclass(frozen=True)
class Edge:
    """An edge of a flat side.

    Attributes:
        nodes: Its nodes in the order of the loop, the body's side on the left, (n,).
        surface: Number of the designed surface that it borders on, None for a straight line.
    """

    nodes: np.ndarray
    surface: int | None = None
    side: int = 0
    reversed: bool = False

    def bend(self, points: np.ndarray) -> float:
        """Return how far its nodes are from the straight line between its ends, [length]."""
        way = points[self.nodes] - points[self.nodes[0]]
        along = way[-1] / np.linalg.norm(way[-1])
        return float(np.linalg.norm(way - np.outer(way @ along, along), axis=1).max())


@dataclass(frozen=True)
class FlatSide:
    """A flat side: its edges in closed loops, that around it first, and its plane.

    Attributes:
        off: Largest distance of the moved nodes from it, in the plane from its straight edges, [length].
        normal: Unit normal out of the body, (3,); None in the plane.
        level: Distance of its plane from the origin along the normal, [length].
    """

    loops: list[list[Edge]]
    off: float
    normal: np.ndarray | None = None
    level: float = 0.0


def flat_sides(
    mesh: BodyMesh,
    moved: np.ndarray,
    surfaces: Sequence[DesignSurface],
    *,
    angle: float = 1e-5,
    most: int = 100,
) -> list[FlatSide]:
    """Return all sides of a body but its designed surfaces.

    Sides are flat where they are so in the reference shape; the nodes of the mesh near a designed surface
    follow it a little.

    Raises:
        CadError: If the other sides are not flat, or a rim of a surface is not one edge of a flat side.
    """
    facets, _ = boundary_faces(mesh.linear.cells, mesh.dim)
    areas = vector_areas(mesh.points, facets)
    across = _across(facets)
    labels = _labels(facets, areas, across, surfaces, angle)
    if mesh.dim == 2:
        loops = _loops(moved, facets, labels, surfaces)
        bends = [edge.bend(moved) for loop in loops for edge in loop if edge.surface is None]
        return [FlatSide(loops, max(bends, default=0.0))]
    sides = np.unique(labels[labels >= len(surfaces)])
    if len(sides) > most:
        raise CadError(
            "a body in a CAD file needs few flat sides beside its designed surfaces, its mesh has "
            f"{len(sides)}: write the surfaces alone with solid=False"
        )
    found = []
    for side in sides:
        mine = labels == side
        normal = areas[mine].sum(axis=0) / np.linalg.norm(areas[mine].sum(axis=0))
        level = float(np.mean(mesh.points[facets[mine]] @ normal))
        behind = labels[across[mine]]
        edges = np.stack([facets[mine], np.roll(facets[mine], -1, axis=1)], axis=2)[behind != side]
        loops = _loops(moved, edges, behind[behind != side], surfaces)
        off = float(np.abs(moved[facets[mine]] @ normal - level).max())
        found.append(FlatSide(loops, off, normal, level))
    return found


def _across(facets: np.ndarray) -> np.ndarray:
    """Return the facet behind every edge of facets, (n, 4 | 3), or the one after each edge, (n, 1)."""
    if facets.shape[1] == 2:
        order = np.argsort(facets[:, 0])
        return order[np.searchsorted(facets[order, 0], facets[:, 1])][:, None]
    after, base = np.roll(facets, -1, axis=1), int(facets.max()) + 1
    keys = (facets * base + after).ravel()
    order = np.argsort(keys)
    found = order[np.searchsorted(keys[order], (after * base + facets).ravel())]
    return found.reshape(facets.shape) // facets.shape[1]


def _labels(
    facets: np.ndarray,
    areas: np.ndarray,
    across: np.ndarray,
    surfaces: Sequence[DesignSurface],
    angle: float,
) -> np.ndarray:
    """Return of each facet the number of its designed surface, or behind these of its flat side, (n,)."""
    owner = np.full(len(facets), -1)
    for number, surface in enumerate(surfaces):
        owner[np.isin(facets, surface.nodes).all(axis=1)] = number
    normals = areas / np.linalg.norm(areas, axis=1)[:, None]
    here = np.repeat(np.arange(len(facets)), across.shape[1])
    there = across.ravel()
    turns = np.linalg.norm(normals[here] - normals[there], axis=1)
    flat = (owner[here] < 0) & (owner[there] < 0) & (turns < angle)
    links = coo_array((np.ones(flat.sum()), (here[flat], there[flat])), shape=[len(facets)] * 2)
    _, components = connected_components(links, directed=False)
    return np.where(owner < 0, components + len(surfaces), owner)


def _loops(
    points: np.ndarray, edges: np.ndarray, labels: np.ndarray, surfaces: Sequence[DesignSurface]
) -> list[list[Edge]]:
    """Join neighbouring edges of the mesh, (n, 2), with the same label; the widest loop first."""
    after = {int(start): (int(end), int(label)) for (start, end), label in zip(edges, labels, strict=True)}
    before = {end: (start, label) for start, (end, label) in after.items()}
    corners = {int(node) for surface in surfaces for line in _lines(surface) for node in line[[0, -1]]}
    breaks = {node for node in after if node in corners or after[node][1] != before[node][1]}
    left, loops = dict.fromkeys(node for node in after if node in breaks), []
    while left:
        loop, node = [], next(iter(left))
        while node in left:
            del left[node]
            label, nodes = after[node][1], [node, after[node][0]]
            while nodes[-1] not in breaks:
                nodes.append(after[nodes[-1]][0])
            loop.append(_edge(np.array(nodes), label, surfaces))
            node = nodes[-1]
        loops.append(loop)
    spans = [np.ptp(points[[edge.nodes[0] for edge in loop]], axis=0).max() for loop in loops]
    return [loops[number] for number in np.argsort(spans)[::-1]]


def _edge(nodes: np.ndarray, label: int, surfaces: Sequence[DesignSurface]) -> Edge:
    if label >= len(surfaces):
        return Edge(nodes)
    for side, line in enumerate(_lines(surfaces[label])):
        for turned in (False, True):
            if np.array_equal(line[::-1] if turned else line, nodes):
                return Edge(nodes, label, side, turned)
    raise CadError(
        "each side of a designed surface must be one edge of a flat side of a body in a CAD file, one is "
        "not: write the surfaces alone with solid=False"
    )


def _lines(surface: DesignSurface) -> tuple[np.ndarray, ...]:
    """Return the nodes along the sides of a designed surface, as in `SplineFit.sides`."""
    grid = surface.nodes.reshape(surface.counts)
    return (grid,) if grid.ndim == 1 else (grid[0], grid[-1], grid[:, 0], grid[:, -1])
