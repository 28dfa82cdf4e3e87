"""Faceted surfaces with a continuous normal field: shape functions, averaged nodal normals, nodal areas."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.surfaces.midpoints import bearing_areas

#: Local coordinates of the corners of quadrilaterals.
_S, _T = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])

#: A plane of symmetry cuts a surface if this fraction of its normal lies in that plane.
CUT = 0.5


def facet_shape_values(local: np.ndarray, corners: int) -> np.ndarray:
    """Evaluate only the values of the shape functions, at points of any leading shape; see `shape_functions`.

    Args:
        local: Local coordinates, shape (..., dim − 1).
        corners: 4, 3 or 2.

    Returns:
        Values, shape (..., corners).
    """
    if corners == 2:
        return np.asarray(0.5 * (1 + np.array([-1.0, 1.0]) * local), dtype=np.float64)
    s, t = local[..., 0], local[..., 1]
    if corners == 3:
        return np.stack([1 - s - t, s, t], axis=-1)
    u, v = 1 + _S * s[..., None], 1 + _T * t[..., None]
    return np.asarray(0.25 * u * v, dtype=np.float64)


def shape_functions(local: np.ndarray, corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the shape functions of facets with 4 (bilinear), 3 or 2 (linear) corners.

    Args:
        local: Local coordinates, in [−1, 1]² for quadrilaterals, shape (n, 2), in the unit triangle for
            triangles, shape (n, 2), in [−1, 1] for the edges of plane bodies, shape (n, 1).
        corners: 4, 3 or 2.

    Returns:
        Values, shape (n, corners), and derivatives, shape (n, corners, dim − 1).
    """
    values = facet_shape_values(local, corners)
    if corners == 2:
        return values, np.broadcast_to(np.array([[-0.5], [0.5]]), (len(local), 2, 1))
    if corners == 3:
        slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
        return values, np.broadcast_to(slopes, (len(local), 3, 2))
    u, v = 1 + _S * local[:, :1], 1 + _T * local[:, 1:]
    return values, 0.25 * np.stack([_S * v, u * _T], axis=2)


def corner_places(corners: int) -> np.ndarray:
    """Return the local coordinates of the corners of a facet, shape (corners, dim − 1)."""
    if corners == 3:
        return np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    return np.stack([_S, _T], axis=1) if corners == 4 else np.array([(-1.0,), (1.0,)])


def outside(local: np.ndarray, corners: int) -> np.ndarray:
    """Return by how much local coordinates lie outside the facet, shape (n,); zero inside."""
    if corners == 2:
        return np.maximum(np.abs(local[:, 0]) - 1, 0)
    s, t = local[:, 0], local[:, 1]
    if corners == 4:
        return np.maximum(np.maximum(np.abs(s), np.abs(t)) - 1, 0)
    return np.maximum(np.maximum.reduce([-s, -t, s + t - 1]), 0)


def edge_distance(local: np.ndarray, corners: int) -> np.ndarray:
    """Return how far inside facets points are, in local coordinates, negative outside, shape (n,)."""
    if corners == 2:
        return 1 - np.abs(local[:, 0])
    s, t = local[:, 0], local[:, 1]
    if corners == 4:
        return 1 - np.maximum(np.abs(s), np.abs(t))
    return np.minimum.reduce([s, t, 1 - s - t])


def corner_products(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return the cross product of the two edges at each corner, outward, shape (n_facets, corners, dim).

    In the plane it is at both ends of an edge the edge rotated clockwise: the body lies on its left.
    """
    x = points[facets]
    if facets.shape[1] == 2:
        along = x[:, 1] - x[:, 0]
        turned = np.stack([along[:, 1], -along[:, 0]], axis=1)
        return np.stack([turned, turned], axis=1)
    return np.cross(np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x)


@dataclass(frozen=True)
class Relief:
    """The true surface over facets, as a height along the interpolated normals of the nodes.

    On each facet the height is a cubic polynomial whose slopes at the corners lie in the true tangent planes
    (Hermite interpolation along the edges, blended in between), plus corrections at the midpoints of the
    edges and in the middle of the facet. The error is of the fourth order in the size of the facets, of the
    sixth along arcs of circles. All entries are relative to the facets, so that they are unchanged when the
    nodes move slightly: normals then rotate with those of the facets.

    Attributes:
        normals: True unit normals of the nodes less the averaged ones, shape (n, dim).
        corners: The same for each corner of the facets, which differ where the surface has a crease, shape
            (n_facets, corners, dim).
        rest: Corrections of the cubics at the midpoints of the edges, from each corner to the next, and in
            the middle, shape (n_facets, corners + 1); in the plane at the midpoint, (n_facets, 1), [length].
        flattened: Number of facets left flat, as the surface over them would fold.
    """

    normals: np.ndarray
    corners: np.ndarray
    rest: np.ndarray
    flattened: int = 0


@dataclass(frozen=True)
class FacetedSurface:
    """Facets with unit nodal normals and, if known, the true surface that they approximate.

    The normal field interpolated between the nodes is continuous across facets, unlike the facets' own.

    Attributes:
        nodes: Nodes of the body on this surface, ascending, shape (n,).
        facets: Facets as rows of positions in ``nodes``, shape (n_facets, corners): triangles or
            quadrilaterals counterclockwise seen from outside, in the plane edges with the body on their left.
        points: Coordinates of the nodes, shape (n, dim), [length].
        averaged: Outward unit normals at the nodes, averaged over the facets around each, shape (n, dim).
        areas: Area, in the plane length, that belongs to each node, shape (n,), [length²] or [length]; zero
            at the corners of quadratic triangles, on which a pressure does not bear.
        mirrored: Components that the normals lack on planes of symmetry, shape (n, dim).
        relief: The true surface relative to the facets; None if it is unknown or coincides with them.
        whole: The quadratic facets that were cut into these, as rows of positions in ``nodes``; None if they
            are whole.
    """

    nodes: np.ndarray
    facets: np.ndarray
    points: np.ndarray
    averaged: np.ndarray
    areas: np.ndarray
    mirrored: np.ndarray
    relief: Relief | None = None
    whole: np.ndarray | None = None

    @cached_property
    def normals(self) -> np.ndarray:
        """Outward unit normals at the nodes, the true ones if known, shape (n, dim)."""
        if self.relief is None:
            return self.averaged
        true = self.averaged + self.relief.normals
        return np.asarray(true / np.linalg.norm(true, axis=1)[:, None])

    @property
    def corners(self) -> int:
        """Corners of a facet: 3 or 4, in the plane 2."""
        return int(self.facets.shape[1])

    @property
    def dim(self) -> int:
        """Dimension of the space around it: 3 or 2."""
        return int(self.points.shape[1])

    def areas_at(self, points: np.ndarray) -> np.ndarray:
        """Return the areas that belong to the nodes where these lie elsewhere, shape (n,).

        Args:
            points: Coordinates of the nodes, shape (n, dim), [length].
        """
        if self.whole is None:
            return _linear_areas(points, self.facets)
        bearing = bearing_areas(points, self.whole)
        return np.bincount(self.whole.ravel(), bearing.ravel(), minlength=len(points))


def faceted_surface(
    points: np.ndarray, facets: np.ndarray, mirrored: np.ndarray | None = None
) -> FacetedSurface:
    """Build the surface from the coordinates of a body and rows of its node numbers.

    On a plane of symmetry the average includes the facets of the mirror image: the normals lie in it.

    Args:
        points: Coordinates, shape (n_nodes, 3), or (n_nodes, 2) where the facets are edges, [length].
        facets: Node numbers of triangles, quadrilaterals or edges, shape (n_facets, 3, 4 or 2).
        mirrored: Which nodes lie on a plane of symmetry normal to each axis, shape (n_nodes, dim); by default
            none.

    Raises:
        InvalidInputError: If coordinates and facets are not of the same dimension.
    """
    corners, dim = facets.shape[1], points.shape[1]
    if (corners, dim) not in {(2, 2), (3, 3), (4, 3)}:
        raise InvalidInputError(
            "a surface needs edges in the plane or triangles or quadrilaterals in space, got facets with "
            f"{corners} corners and points with {dim} coordinates: give the points of plane bodies two"
        )
    nodes, local = np.unique(facets, return_inverse=True)
    local = local.reshape(facets.shape)
    own = points[nodes]
    products = corner_products(own, local)
    summed = np.zeros_like(own)
    np.add.at(summed, local, products)
    flat = np.zeros(own.shape, dtype=bool) if mirrored is None else mirrored[nodes]
    within = np.where(flat, 0.0, summed)
    # A surface that lies in the plane itself is not cut by it.
    flat &= (np.linalg.norm(within, axis=1) > CUT * np.linalg.norm(summed, axis=1))[:, None]
    summed[flat] = 0.0
    areas = _linear_areas(own, local)
    return FacetedSurface(nodes, local, own, summed / np.linalg.norm(summed, axis=1)[:, None], areas, flat)


def _linear_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Distribute the areas of linear facets evenly over their corners."""
    corners = facets.shape[1]
    # The corner products of a quadrilateral add up to four times its area vector, those of a triangle to six,
    # those of an edge to two.
    total = np.linalg.norm(corner_products(points, facets).sum(axis=1), axis=1)
    share = total / {2: 2, 3: 6, 4: 4}[corners] / corners
    return np.bincount(facets.ravel(), np.repeat(share, corners), minlength=len(points))
