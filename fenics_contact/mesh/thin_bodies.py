"""Surfaces of thin bodies, quadrilaterals or triangles in space, as one layer of quadratic solid cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._base.checks import LARGEST, brief, check_each, naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import joined_cells
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.mesh.quadratic_nodes import with_centres
from fenics_contact.mesh.serendipity_cells import serendipity

#: Corners of facets by their number of nodes.
CORNERS = {3: 3, 4: 4, 6: 3, 8: 4}


def raised(
    points: np.ndarray, facets: Sequence[np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Return points, new ones at the end, facets with nodes in the middle of their edges, and their sources.

    `facets`: arrays of facets of 3, 4, 6 or 8 nodes each; sources: twice a given point, the ends of the edge
    of a new one, (n, 2).
    """
    itself = np.repeat(np.arange(len(points))[:, None], 2, axis=1)
    ends = [np.sort(np.stack([f, np.roll(f, -1, axis=1)], axis=2), axis=2).reshape(-1, 2) for f in facets]
    linear = [each for each, own in zip(ends, facets, strict=True) if own.shape[1] < 5]
    edges, number = np.unique(np.concatenate([itself[:0], *linear]), axis=0, return_inverse=True)
    middles = iter(np.split(len(points) + number.ravel(), np.cumsum([len(each) for each in linear])))
    whole = [
        np.hstack([own, next(middles).reshape(own.shape)]) if own.shape[1] < 5 else own for own in facets
    ]
    return np.vstack([points, points[edges].mean(axis=1)]), whole, np.vstack([itself, edges])


def facet_normals(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the unit normals of quadratic facets at their nodes, (n_cells, 6 | 8, 3).

    They are zero where a facet has no area.
    """
    slopes = _slopes_of_triangles() if cells.shape[1] == 6 else _slopes_of_quadrilaterals()
    along = np.einsum("pid,eix->epdx", slopes, points[cells])
    normal = np.cross(along[:, :, 0], along[:, :, 1])
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    return np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)


def _slopes_of_quadrilaterals() -> np.ndarray:
    """Return ∂N_i/∂(ξ, η) of 8 nodes at these, (8, 8, 2)."""
    at = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]], dtype=float)
    (x, y), (a, b) = at.T[:, :, None], at.T[:, None]
    corner = np.stack(
        [a * (1 + b * y) * (2 * a * x + b * y) / 4, b * (1 + a * x) * (a * x + 2 * b * y) / 4], axis=2
    )
    level = np.stack([-x * (1 + b * y), b * (1 - x * x) / 2], axis=2)
    upright = np.stack([a * (1 - y * y) / 2, -y * (1 + a * x)], axis=2)
    return np.where((a * b != 0)[..., None], corner, np.where((a == 0)[..., None], level, upright))


def _slopes_of_triangles() -> np.ndarray:
    """Return ∂N_i/∂(ξ, η) of 6 nodes at these, (6, 6, 2)."""
    at = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    share = np.column_stack([1 - at.sum(axis=1), at])  # of the corners
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corner = (4 * share - 1)[..., None] * slope
    ends = [(0, 1), (1, 2), (2, 0)]
    middle = [4 * (share[:, [a]] * slope[b] + share[:, [b]] * slope[a]) for a, b in ends]
    return np.concatenate([corner, np.stack(middle, axis=1)], axis=1)


def layer_cells(lower: np.ndarray, upper: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Return hexahedra of 20 or prisms of 15 nodes between two facets each.

    `lower` and `upper`: nodes of these, (n, 8 | 6); `middle`: nodes between their corners, (n, 4 | 3).
    """
    width = middle.shape[1]
    return np.hstack([lower[:, :width], upper[:, :width], lower[:, width:], upper[:, width:], middle])


@displayed
@dataclass(frozen=True, eq=False)
class Thickened:
    """A thin body as one layer of cells.

    Attributes:
        mesh: Its mesh, with the surfaces "bottom" and "top", on the side of the normals, "edge", all around,
            and those named by nodes.
        nodes: Node of the given surface -> its nodes at the bottom, in the middle and on top, shape
            (n_points, 3); −1 where there is none: in the middle of edges, and of points of no cell.
        normals: Normals at the given nodes, shape (n_points, 3).
    """

    mesh: BodyMesh
    nodes: np.ndarray
    normals: np.ndarray

    def at(self, values: np.ndarray) -> np.ndarray:
        """Return values of the nodes of the mesh at the given nodes.

        They are (bottom + 4 middle + top) / 6, in the middle of edges the mean of bottom and top, as
        CalculiX prints displacements of shells; NaN at points of no cell.

        Args:
            values: One for each node of the mesh, shape (n_nodes, ...), such as displacements.

        Returns:
            Shape (n_points, ...).
        """
        given = np.asarray(values, dtype=np.float64)
        bottom, middle, top = (given[column] for column in self.nodes.T)
        shape = (-1,) + (1,) * (given.ndim - 1)
        corner = (self.nodes[:, 1] >= 0).reshape(shape)
        found = np.where(corner, (bottom + 4.0 * middle + top) / 6.0, 0.5 * (bottom + top))
        found[self.nodes[:, 0] < 0] = np.nan
        return found


@naming_arguments
def thickened(
    points: ArrayLike,
    cells: ArrayLike,
    thickness: ArrayLike,
    offset: float = 0.0,
    normals: ArrayLike | None = None,
    edges: Mapping[str, ArrayLike] | None = None,
) -> Thickened:
    """Return a surface in space as one layer of quadratic solid cells, for plates and shells.

    Quadrilaterals become hexahedra of 20 nodes, triangles prisms of 15; facets of 4 and 3 nodes get nodes in
    the middle of their edges first. Give the body ``integration="reduced"`` where it has hexahedra: by full
    integration they lock on thin curved bodies. Cells should be no wider than 12 times their thickness.

    Args:
        points: Coordinates, shape (n_points, 3), [length].
        cells: Facets, shape (n_cells, 8 | 6 | 4 | 3), corners first and then the nodes in the middle of the
            edges that follow them; all counter-clockwise seen from the same side, to which normals point.
        thickness: Of the body, or at each point, shape (n_points,), [length].
        offset: Distance of the surface in the middle of the body from the points along the normals, as a
            share of the thickness: 0.5 puts the points at the bottom.
        normals: Directions across the body at the points, shape (n_points, 3), of any length; by default the
            means of the normals of the facets.
        edges: Name to points on a part of the rim, whose faces are a surface then.

    Returns:
        The mesh, and which of its nodes belong to which point. With facets of 4 and 3 nodes the new points
        follow the given ones.

    Raises:
        InvalidInputError: If arrays do not fit each other, a thickness is not above zero, facets at a node
            have no common normal, or a cell is inverted, as where a body is thicker than it may be by its
            curvature.

    Example:
        >>> from fenics_contact.mesh import thickened
        >>> square = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]  # mm
        >>> plate = thickened(square, [[0, 1, 2, 3]], 0.1)
        >>> plate.mesh.cells_in_words, plate.nodes[0].tolist()
        ('1 serendipity hexahedra', [0, 16, 8])
    """
    places, facets = _checked(points, cells)
    count = len(places)
    depth = _checked_thickness(thickness, count)
    places, (facets,), _ = raised(places, [facets])
    depth = _at_middles(depth, facets, len(places))
    if normals is None:
        across = _mean_normals(places, facets)
    else:
        across = _at_middles(_checked_normals(normals, count), facets, len(places))
    arm = across * (depth / np.linalg.norm(across, axis=1).clip(1e-300))[:, None]
    solid, own, nodes = _layer(places, facets, arm, float(offset))
    mesh = _mesh(solid, own, nodes, {k: np.asarray(v, dtype=np.int64) for k, v in (edges or {}).items()})
    return Thickened(mesh, nodes, across)


def _layer(
    points: np.ndarray, facets: np.ndarray, arm: np.ndarray, offset: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points and cells of the layer, and the nodes of each given point."""
    width = CORNERS[facets.shape[1]]
    used, corners = np.unique(facets), np.unique(facets[:, :width])
    nodes = np.full((len(points), 3), -1)
    nodes[used, 0] = np.arange(len(used))
    nodes[used, 2] = len(used) + np.arange(len(used))
    nodes[corners, 1] = 2 * len(used) + np.arange(len(corners))
    places = points + offset * arm
    solid = np.concatenate([places[used] - 0.5 * arm[used], places[used] + 0.5 * arm[used], places[corners]])
    lower, middle, upper = (nodes[facets, k] for k in range(3))
    return solid, layer_cells(lower, upper, middle[:, :width]), nodes


def _mesh(
    points: np.ndarray, cells: np.ndarray, nodes: np.ndarray, edges: Mapping[str, np.ndarray]
) -> BodyMesh:
    """Return the mesh of a layer with its surfaces."""
    prisms = cells.shape[1] == 15
    points, whole = with_centres(points, {"cells": cells}, 3)
    complete = joined_cells({"prism": whole["cells"]}) if prisms else whole["cells"]
    faces, _ = boundary_faces(complete)
    corners = faces[:, :4]
    side = np.full(len(points), 2)
    for k, column in enumerate((nodes[:, 0], nodes[:, 2])):
        side[column[column >= 0]] = k
    low, high = ((side[corners] == k).all(axis=1) for k in (0, 1))
    rim = ~low & ~high
    surfaces = {"bottom": faces[low], "top": faces[high], "edge": faces[rim]}
    for name, members in edges.items():
        mark = np.zeros(len(points), dtype=bool)
        ends = nodes[members][:, [0, 2]]
        mark[ends[ends >= 0]] = True
        surfaces[name] = faces[rim & mark[corners].all(axis=1)]
        if not len(surfaces[name]):
            raise InvalidInputError(
                f"edge {name!r} must have all nodes of an edge on the rim, got {brief(members)}: give them"
            )
    named = {name: own for name, own in surfaces.items() if len(own)}
    return serendipity(BodyMesh(points, complete, named))


def _checked(points: ArrayLike, cells: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return points and facets as arrays that fit each other."""
    places, facets = np.asarray(points, dtype=np.float64), np.asarray(cells)
    if places.ndim != 2 or places.shape[1] != 3 or not (np.abs(places) < LARGEST).all():
        raise InvalidInputError(f"points must be finite and of shape (n, 3), got {brief(points)}: correct it")
    right = facets.ndim == 2 and len(facets) and facets.shape[1] in CORNERS
    if not right or not np.issubdtype(facets.dtype, np.integer):
        raise InvalidInputError(
            f"cells must be node numbers of shape (n, 8), (n, 6), (n, 4) or (n, 3), got {facets.dtype} of "
            f"shape {facets.shape}: give one array for quadrilaterals or one for triangles"
        )
    if facets.min() < 0 or facets.max() >= len(places):
        raise InvalidInputError(
            f"cells must name points from 0 to {len(places) - 1}, got {facets.min()} to {facets.max()}"
        )
    return places, facets.astype(np.int64)


def _checked_thickness(thickness: ArrayLike, count: int) -> np.ndarray:
    depth = np.asarray(thickness, dtype=np.float64)
    if depth.shape not in ((), (count,)):
        raise InvalidInputError(
            f"thickness must be a number, or one for each of {count} points, got shape {depth.shape}"
        )
    depth = np.broadcast_to(depth, (count,))
    good = np.isfinite(depth) & (depth > 0)
    check_each(good, "thickness must be above zero", "correct it", lambda k: f"{depth[k]} at point {k}")
    return depth


def _checked_normals(normals: ArrayLike, count: int) -> np.ndarray:
    across = np.asarray(normals, dtype=np.float64)
    if across.shape != (count, 3) or not np.isfinite(across).all() or not across.any(axis=1).all():
        raise InvalidInputError(
            f"normals must be a vector other than zero for each of {count} points, got shape {across.shape}"
        )
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def _at_middles(values: np.ndarray, facets: np.ndarray, count: int) -> np.ndarray:
    """Return values of given points with the means of both ends at new ones in the middle of edges."""
    if count == len(values):
        return values
    width = CORNERS[facets.shape[1]]
    found = np.zeros((count, *values.shape[1:]))
    found[: len(values)] = values
    both = values[facets[:, :width]], values[np.roll(facets[:, :width], -1, axis=1)]
    found[facets[:, width:]] = 0.5 * (both[0] + both[1])
    return found


def _mean_normals(points: np.ndarray, facets: np.ndarray, least: float = 0.5) -> np.ndarray:
    """Return the means of the normals of the facets at the points.

    `least`: cosine of the largest angle between a facet and the mean at one of its nodes, 60 degrees: those
    of facets at a sharper fold say nothing of how thick the body is there.
    """
    own = facet_normals(points, facets)
    found = np.zeros_like(points)
    np.add.at(found, facets.ravel(), own.reshape(-1, 3))
    size = np.linalg.norm(found, axis=1, keepdims=True)
    found = np.divide(found, size, out=np.zeros_like(found), where=size > 0)
    across = np.einsum("epx,epx->ep", own, found[facets])
    worst = np.unravel_index(np.argmin(across), across.shape)
    if across[worst] < least:
        at = ", ".join(f"{x:.6g}" for x in points[facets[worst]])
        raise InvalidInputError(
            f"facets at a node must have a common normal, those at ({at}) are folded or face both ways: turn "
            "their nodes round, give normals, or make two bodies and join them"
        )
    return found
