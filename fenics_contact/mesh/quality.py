"""Jacobians, volumes and shape quality of cells, for all cells at once.

Points with three coordinates belong to hexahedra or tetrahedra, points with two to quadrilaterals or
triangles, for which "volume" is the area.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import CellType, cell_type_of, quadrature, shape_gradients
from fenics_contact.mesh.collapsed import SHAPES, collapse, places_of, shapes_in
from fenics_contact.mesh.faces import computed_rounding, coordinate_rounding, corners_of
from fenics_contact.shapes.combined import Joined
from fenics_contact.shapes.parametric import tensor_grid
from fenics_contact.shapes.simple import Plane, SurfaceShape, evaluate_shape

HEXAHEDRON_LATTICE = tensor_grid(3 * [[0.0, 0.5, 1.0]])
"""Vertices, edge and face midpoints and centre: points at which the Jacobian of a hexahedron is evaluated.

The determinant is quadratic in each coordinate, so these 27 values determine it everywhere."""

_BEST_CORNER = {3: np.sqrt(2.0), 2: 2.0 / np.sqrt(3.0)}
"""One over the corner determinant of unit edge vectors in a regular simplex, by dimension."""


def determinants(matrices: np.ndarray) -> np.ndarray:
    """Compute 3 x 3 or 2 x 2 determinants of a stack, (..., d, d) to (...)."""
    a, b = matrices[..., 0, :], matrices[..., 1, :]
    if matrices.shape[-1] == 2:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    c = matrices[..., 2, :]
    return np.asarray(
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


def _critical_positions(cell: CellType) -> np.ndarray:
    """Points at which the Jacobian is evaluated.

    That of a quadrilateral is linear and determined by its vertices; that of a hexahedron by the lattice. On
    quadratic cells, where no small set of values bounds it, nodes and Gauss points are taken.
    """
    if cell.order == 2:
        return np.concatenate([cell.nodes, quadrature(cell)[0]])
    return HEXAHEDRON_LATTICE if cell.dim == 3 else cell.vertices


AT_GAUSS_POINTS = np.zeros((0, 0))
"""In place of positions: those at which cells are integrated."""


def jacobians(points: np.ndarray, cells: np.ndarray, positions: np.ndarray | None = None) -> np.ndarray:
    """Evaluate the Jacobian determinant of the map from the reference cell, (n_cells, m).

    `positions`: reference coordinates; unless given the 27 points of `HEXAHEDRON_LATTICE`, the four vertices,
    or nodes and Gauss points of quadratic cells; `AT_GAUSS_POINTS` for those at which cells of whatever shape
    are integrated. A linear simplex has one constant Jacobian, six times its volume or twice its area.
    """
    cell = cell_type_of(cells, points.shape[1])
    if cell.is_affine:
        corners = points[cells]
        return determinants(corners[:, 1:] - corners[:, :1])[:, None]
    if positions is None or positions is AT_GAUSS_POINTS:
        positions = _critical_positions(cell) if positions is None else quadrature(cell)[0]
        if groups := shapes_in(cells, cell.dim):
            return _of_shapes(points, cells, positions, groups)
    corners = places_of(points, cells)
    if _are_parallelepipeds(corners, cell):
        edges = corners[:, cell.edges[0]] - corners[:, :1]
        return np.broadcast_to(determinants(edges)[:, None], (len(cells), len(positions)))
    columns = np.ascontiguousarray(corners.transpose(0, 2, 1)).reshape(-1, cells.shape[1])
    values = np.empty((cells.shape[0], positions.shape[0]))
    # A few positions, all cells at once, which keeps the arrays small.
    for m, gradients in enumerate(shape_gradients(cell, positions)):
        values[:, m] = determinants((columns @ gradients).reshape(-1, cell.dim, cell.dim))
    return values


def _are_parallelepipeds(corners: np.ndarray, cell: CellType, straight: float = 1e-10) -> bool:
    """Return whether all are linear parallelepipeds up to rounding: one Jacobian for each will do.

    `straight`: how far corners may be off at most, relative to the longest edge at the first.
    """
    if cell.order > 1 or len(corners) == 0:
        return False
    edges = corners[:, cell.edges[0]] - corners[:, :1]
    bent = np.abs(corners - corners[:, :1] - cell.vertices @ edges).max()
    return bool(bent <= min(coordinate_rounding(corners), straight * np.abs(edges).max(axis=(1, 2)).min()))


def _of_shapes(
    points: np.ndarray,
    cells: np.ndarray,
    positions: np.ndarray,
    groups: Mapping[str, np.ndarray],
    inward: float = 1e-3,
) -> np.ndarray:
    """Return Jacobians of prisms, pyramids and simplices over those of the collapsed map of straight ones.

    `inward`: the positions are moved towards the middle by this fraction, as both vanish at collapsed edges.
    """
    values = np.empty((len(cells), len(positions)))
    for name, mine in groups.items():
        shape, at = SHAPES[name], positions
        if not shape.is_whole:
            at = positions + inward * (0.5 - positions)
        values[mine] = jacobians(points, cells[mine], at) / shape.shrinkage(at)
    return values


def jacobian_ratio(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the ratio of the smallest to the largest Jacobian in every cell.

    It is 1 for a parallelepiped, a parallelogram or a proper simplex, 0 or less for a degenerate or inverted
    cell.
    """
    values = jacobians(points, cells)
    largest = np.maximum(np.abs(values).max(axis=1), np.finfo(float).tiny)
    return np.asarray(values.min(axis=1) / largest)


def scaled_jacobian(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute the smallest corner determinant of the unit edge vectors of every cell.

    For simplices it is scaled such that the regular one has 1.

    Returns:
        (n_cells,) values in [-1, 1]: 1 for a box or a regular simplex, 0 or less where inverted.
    """
    cell = cell_type_of(cells, points.shape[1])
    if groups := shapes_in(cells, cell.dim):
        values = np.empty(len(cells))
        for name, mine in groups.items():
            own = cells[mine][:, collapse(name, cell.order).places]
            values[mine] = _best_shape(name) * _corner_determinants(points, own, SHAPES[name].corner_edges)
        return values
    corners = points[cells[:, : len(cell.edges)]]
    edges = corners[:, cell.edges] - corners[:, :, None, :]
    length = np.linalg.norm(edges, axis=-1, keepdims=True)
    values = determinants(edges / np.maximum(length, np.finfo(float).tiny)).min(axis=1)
    return np.asarray((_BEST_CORNER[cell.dim] if cell.is_simplex else 1.0) * values)


def _corner_determinants(points: np.ndarray, cells: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the smallest determinant of the unit edge vectors at corners, (n_cells,)."""
    edges = points[cells[:, corners[:, 1:]]] - points[cells[:, corners[:, :1]]]
    length = np.linalg.norm(edges, axis=-1, keepdims=True)
    return np.asarray(determinants(edges / np.maximum(length, np.finfo(float).tiny)).min(axis=1))


def _best_shape(name: str) -> float:
    """Return one over the corner determinant of a shape whose edges are all equal."""
    return {"prism": _BEST_CORNER[2], "pyramid": _BEST_CORNER[3]}.get(
        name, _BEST_CORNER[SHAPES[name].dim] if name in ("triangle", "tetrahedron") else 1.0
    )


def cell_volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute the volume (area) of every cell, exactly.

    Two Gauss points in each direction integrate the quadratic Jacobian of a trilinear map, three that of a
    triquadratic one, of degree five.
    """
    cell = cell_type_of(cells, points.shape[1])
    if cell.is_affine:
        return np.asarray(cell.reference_volume * jacobians(points, cells)[:, 0])
    positions, weights = quadrature(cell)
    return _in_parts(cells, lambda some: jacobians(points, some, positions) @ weights)


def volume(points: np.ndarray, cells: np.ndarray) -> float:
    """Compute the volume (area) of the whole mesh."""
    return float(cell_volumes(points, cells).sum())


def node_volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the share of each node in the volume (area), that of a cell being shared evenly, (n_nodes,)."""
    shares = np.repeat(cell_volumes(points, cells) / cells.shape[1], cells.shape[1])
    return np.bincount(cells.ravel(), shares, len(points))


def thickness(points: np.ndarray, cells: np.ndarray, positions: np.ndarray | None = None) -> np.ndarray:
    """Return the smallest Jacobian of every cell over the area (length) of its bounding box's diagonal.

    It is 0 where a cell is inverted or flat, else a fraction of the diagonal, [length].
    """

    def of(cells: np.ndarray) -> np.ndarray:
        corners = points[cells]
        size = np.linalg.norm(corners.max(axis=1) - corners.min(axis=1), axis=1)
        least = jacobians(points, cells, positions).min(axis=1)
        smallest = least / np.maximum(size, 1e-100) ** points.shape[1]
        return np.asarray(np.where(smallest <= LAST_PLACES, 0.0, smallest) * size)

    return _in_parts(cells, of)


def _in_parts(
    cells: np.ndarray, function: Callable[[np.ndarray], np.ndarray], most: int = 2048
) -> np.ndarray:
    """Return a function's values at all cells, shape (n_cells,); it sees `most` at once, to save memory."""
    parts = [function(cells[start : start + most]) for start in range(0, max(len(cells), 1), most)]
    return np.concatenate(parts)


#: Largest distance of nodes from their shape, relative to the shortest edge of a facet around them.
FARTHEST = 0.1


def distance_in_edges(points: np.ndarray, facets: np.ndarray, shape: SurfaceShape) -> np.ndarray:
    """Return the distance of a surface's nodes from a shape, relative to the shortest edge around each.

    The nodes are in ascending order.
    """
    nodes, local = np.unique(facets, return_inverse=True)
    corners = corners_of(facets, points.shape[1])
    edges = np.linalg.norm(points[np.roll(corners, -1, axis=1)] - points[corners], axis=2)
    size = np.full(len(nodes), np.inf)
    np.minimum.at(
        size, local.reshape(facets.shape), np.broadcast_to(edges.min(axis=1)[:, None], facets.shape)
    )
    return np.asarray(np.abs(evaluate_shape(shape, "distance", points[nodes])) / size)


def check_shapes(
    points: np.ndarray,
    surfaces: Mapping[str, np.ndarray],
    shapes: Mapping[str, SurfaceShape],
    hanging: np.ndarray,
) -> dict[str, np.ndarray]:
    """Reject shapes on which a surface does not lie; return the distances, see `distance_in_edges`.

    `hanging`: nodes that lie on larger facets, not on shapes.
    """
    distances = {}
    for name, shape in shapes.items():
        if name not in surfaces:
            raise InvalidInputError(f"shapes names surface {name!r}, the mesh has {sorted(surfaces)}")
        dim = getattr(shape, "dim", points.shape[1])
        if dim != points.shape[1]:
            raise InvalidInputError(
                f"surface {name!r} needs a shape of dimension {points.shape[1]}, got one of {dim}"
            )
        away = distance_in_edges(points, surfaces[name], shape)
        away[np.isin(np.unique(surfaces[name]), hanging)] = 0.0
        off = away > FARTHEST
        if off.any():
            raise InvalidInputError(
                f"the nodes of surface {name!r} must lie on its shape, {np.count_nonzero(off)} of {len(off)} "
                f"lie off {type(shape).__name__} by up to {away.max():.3g} edges: check its place, size and "
                "unit of length"
            )
        _check_side(name, points, surfaces[name], shape)
        distances[name] = away
    return distances


def _check_side(
    name: str, points: np.ndarray, facets: np.ndarray, shape: SurfaceShape, turned_in: float = 0.5
) -> None:
    """Reject a shape, or a part of a joined one, whose normals point into the body.

    `turned_in`: cosine of the angle between a facet's normal and the inward normal of a shape above which it
    faces inwards.
    """
    corners = points[corners_of(facets, points.shape[1])]
    if points.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        outward = np.column_stack([along[:, 1], -along[:, 0]])
    else:
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0])
    middles = corners.mean(axis=1)
    area = np.linalg.norm(outward, axis=1)
    along = np.einsum("nd,nd->n", outward, evaluate_shape(shape, "normals", middles))
    parts: Sequence[SurfaceShape] = [shape]
    part = np.zeros(len(middles), dtype=np.int64)
    if isinstance(shape, Joined):
        parts, part = shape.shapes, shape.nearest(middles)
    inward = np.bincount(part, np.where(along < -turned_in * area, area, 0.0), len(parts))
    # By area, as normals of a coarse facet beside a sharp edge may be those of the next part.
    wrong = np.flatnonzero(inward > 0.5 * np.bincount(part, area, len(parts)))
    if len(wrong):
        turned = parts[wrong[0]]
        raise InvalidInputError(
            f"{type(turned).__name__} of surface {name!r} points into the body: {_turning(turned)}"
        )


def _turning(shape: SurfaceShape) -> str:
    """Return how to let a shape face the other way."""
    for switch in ("hollow", "flipped"):
        if hasattr(shape, switch):
            return f"give it {switch}={not getattr(shape, switch)}"
    if isinstance(shape, Plane):
        return f"give it the normal {tuple(-x for x in shape.normal)}"
    return "turn it round, its distance is negative inside the body"


def similarity(points: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return rotation R, translation t and scale s that move points, x -> s R x + t, or None.

    References:
        Umeyama, S.: Least-squares estimation of transformation parameters between two point patterns. IEEE
        Transactions on Pattern Analysis and Machine Intelligence 13 (1991).
    """
    centre, there = points.mean(axis=0), moved.mean(axis=0)
    away, arrived = points - centre, moved - there
    left, stretch, right = np.linalg.svd(arrived.T @ away)
    sign = np.ones(len(stretch))
    sign[-1] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    scale = float((stretch * sign).sum() / (away**2).sum())
    rotation = (left * sign) @ right
    # Pure shifts, and half turns and the like, are exact.
    scale = 1.0 if abs(scale - 1.0) < 1e-14 else scale
    rotation = np.where(np.abs(rotation - np.round(rotation)) < 1e-14, np.round(rotation), rotation)
    shift = there - scale * rotation @ centre
    off = np.abs(scale * points @ rotation.T + shift - moved).max()
    if not (scale > 0 and off <= computed_rounding(moved) + scale * computed_rounding(points)):
        return None
    return rotation, shift, scale
