"""Faceted surfaces: areas, moments, averaged normals, heights of a true surface over them.

The shape functions of the corners of a quadratic triangle have the mean zero, those of the midpoints a third:
a uniform pressure makes forces at the midpoints alone. With the midpoints as points of contact, each with a
third of the facet, forces are those of a quadrature rule that is exact for quadratic displacements, and a
uniform pressure is found exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import FACET_TYPES, quadrature, shape_gradients, shape_values
from fenics_contact.mesh.faces import in_columns, is_triangle, narrowed, of_one_shape


def quadrature_areas(points: np.ndarray, facets: np.ndarray, measure: Measure = PLAIN) -> np.ndarray:
    """Return the areas of facets, in the plane the lengths of edges."""
    areas = np.empty(len(facets))
    for numbers, some in of_one_shape(facets):
        areas[numbers] = nodal_areas(points, some, measure).sum(axis=1)
    return areas


def nodal_areas(points: np.ndarray, facets: np.ndarray, measure: Measure = PLAIN) -> np.ndarray:
    """Integrate the shape functions over every facet: nodal forces of a unit pressure.

    Two Gauss points per direction on linear facets, three on quadratic ones.
    """
    total = np.zeros(facets.shape)
    for at in gauss_points(points, facets, measure):
        total += at.areas[:, None] * at.values
    return total


@dataclass(frozen=True, eq=False)
class SurfaceMoments:
    """Area of a surface and its first moments."""

    area: float
    centroid: np.ndarray
    second_moment: np.ndarray


def surface_moments(points: np.ndarray, facets: np.ndarray, measure: Measure = PLAIN) -> SurfaceMoments:
    """Return area, centroid and second moments of a surface; arguments as of `quadrature_areas`."""
    origin = points[facets[0, 0]]  # moments are as exact far from the origin of coordinates as near it
    rule = [
        (at.areas, np.einsum("k,nkd->nd", at.values, points[some] - origin))
        for _, some in of_one_shape(facets)
        for at in gauss_points(points, some, measure)
    ]
    areas, places = np.concatenate([area for area, _ in rule]), np.concatenate([place for _, place in rule])
    area = float(areas.sum())
    # A line on an axis has none: its middle is its centre.
    centre = areas @ places / area if area > 0.0 else places.mean(axis=0)
    arms = places - centre
    return SurfaceMoments(area, origin + centre, (areas[:, None] * arms).T @ arms)


@dataclass(frozen=True, eq=False)
class GaussPoint:
    """One point of a quadrature rule in every facet.

    `weight`: of the rule, times `Measure.around` in every facet, a number or (n_facets, 1); `tangents`:
    derivatives of the place by these.
    """

    weight: float | np.ndarray
    values: np.ndarray
    gradients: np.ndarray
    tangents: np.ndarray

    @cached_property
    def normals(self) -> np.ndarray:
        """Outward normals times the area that belongs to the point, shape (n_facets, dim)."""
        if self.tangents.shape[2] == 3:
            return np.asarray(self.weight * np.cross(self.tangents[:, 0], self.tangents[:, 1]))
        along = self.tangents[:, 0]
        return np.asarray(self.weight * np.stack([along[:, 1], -along[:, 0]], axis=1))

    def of(self, nodal: np.ndarray, facets: np.ndarray) -> np.ndarray:
        """Return nodal vectors, or the coordinates, at the point in every facet, shape (n_facets, dim)."""
        return np.asarray(np.einsum("k,nkd->nd", self.values, nodal[facets]))

    @cached_property
    def areas(self) -> np.ndarray:
        """The area that belongs to the point, shape (n_facets,), [length²] or [length]."""
        return np.asarray(np.linalg.norm(self.normals, axis=1))


def gauss_points(points: np.ndarray, facets: np.ndarray, measure: Measure = PLAIN) -> Iterator[GaussPoint]:
    """Return the points of a quadrature rule on facets, of one shape; others as of `quadrature_areas`."""
    assert not is_triangle(facets).any()
    kind = FACET_TYPES[facets.shape[1], points.shape[1]]
    positions, weights = quadrature(kind, 2 * kind.order)  # as in load forms: resultants are exact
    values, gradients = shape_values(kind, positions), shape_gradients(kind, positions)
    corners = points[facets]
    for weight, value, gradient in zip(weights, values, gradients, strict=True):
        around = measure.around((corners[..., 0] @ value)[:, None])
        yield GaussPoint(float(weight) * around, value, gradient, np.einsum("ka,nkd->nad", gradient, corners))


#: The nodes of a quadratic triangle.
_CORNERS, _MIDPOINTS = slice(0, 3), slice(3, 6)


def has_midside_pressure(facets: np.ndarray) -> bool:
    """Return whether facets are quadratic triangles, (n, 6)."""
    return facets.shape[1] == _MIDPOINTS.stop


def bearing_areas(points: np.ndarray, facets: np.ndarray, measure: Measure = PLAIN) -> np.ndarray:
    """Return the area of each facet that bears on each of its nodes.

    It is the nodal force of a unit pressure, but that of the corners of quadratic triangles, which vanishes
    on flat ones, is shared by their midpoints; see also `Measure.bearing`.
    """
    if is_triangle(facets).any():
        result = np.zeros(facets.shape)
        for numbers, some in of_one_shape(facets):
            result[numbers] = in_columns(bearing_areas(points, some), facets.shape[1])
        return result
    areas = measure.bearing(points, facets, nodal_areas(points, facets, measure))
    if has_midside_pressure(facets):
        areas[:, _MIDPOINTS] += areas[:, _CORNERS].mean(axis=1, keepdims=True)
        areas[:, _CORNERS] = 0.0
    return areas


def bearing_pulled_back(by_areas: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of `bearing_areas` with respect to `nodal_areas`, the shape of facets."""
    if not has_midside_pressure(by_areas):
        return by_areas
    result = by_areas.copy()
    result[:, _CORNERS] = by_areas[:, _MIDPOINTS].mean(axis=1, keepdims=True)
    return result


def share_areas(mesh: BodyMesh, name: str) -> np.ndarray:
    """Return areas by which the nodes of a surface share what is on it, (n_nodes of the mesh,), all positive.

    The nodal forces of a unit pressure; on quadratic triangles those on the linear facets between the nodes.
    The nodes of a node set have one and the same.
    """
    if name in mesh.node_sets:
        size = mesh.volume / mesh.n_nodes
        return np.where(np.isin(np.arange(mesh.n_nodes), mesh.node_sets[name]), size, 0.0)
    facets = mesh.surfaces[name]
    if has_midside_pressure(facets) or is_triangle(facets).any():
        facets = mesh.linear.surfaces[name]
    return np.bincount(facets.ravel(), nodal_areas(mesh.points, facets).ravel(), minlength=mesh.n_nodes)


def filled_at_corners(facets: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Fill in values at the corners of quadratic triangles from those at the midpoints.

    At each corner the mean over the facets around it of ¾ (a + b) − ½ c, where a and b are the values at the
    midpoints beside it and c is that opposite: between the mean beside it and the linear function through all
    three, so that quadratic fields on regular meshes are exact. `facets`: node numbers; values stay as they
    are unless there are six, and at corners of quadrilaterals among triangles.
    """
    if (both := is_triangle(facets)).any():
        filled = filled_at_corners(narrowed(facets[both]), values)
        filled[facets[~both]] = values[facets[~both]]
        return filled
    if not has_midside_pressure(facets):
        return values
    result, corners = values.copy(), facets[:, _CORNERS]
    after = values[facets[:, _MIDPOINTS]]
    before, opposite = np.roll(after, 1, axis=1), np.roll(after, -1, axis=1)
    total, count = np.zeros_like(values), np.bincount(corners.ravel(), minlength=len(values))
    np.add.at(total, corners, 0.75 * (after + before) - 0.5 * opposite)
    mine = np.flatnonzero(count)
    result[mine] = (total[mine].T / count[mine]).T
    return result


#: Local coordinates of the corners of quadrilaterals.
_S, _T = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])

#: A plane of symmetry cuts a surface if this fraction of its normal lies in that plane.
CUT = 0.5


def facet_shape_values(local: np.ndarray, corners: int) -> np.ndarray:
    """Evaluate only the values of the shape functions, at points of any shape; see `shape_functions`."""
    if corners == 2:
        return np.asarray(0.5 * (1 + np.array([-1.0, 1.0]) * local), dtype=np.float64)
    s, t = local[..., 0], local[..., 1]
    if corners == 3:
        return np.stack([1 - s - t, s, t], axis=-1)
    u, v = 1 + _S * s[..., None], 1 + _T * t[..., None]
    return np.asarray(0.25 * u * v, dtype=np.float64)


def shape_functions(local: np.ndarray, corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the shape functions of facets with 4 (bilinear), 3 or 2 (linear) corners."""
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
    nodes move slightly: normals then rotate with those of the facets. `normals`: True unit normals of the
    nodes less the averaged ones; `corners`: the same for each corner of the facets, which differ where the
    surface has a crease; `rest`: corrections of the cubics at the midpoints of the edges, from each corner to
    the next, and in the middle; in the plane at the midpoint; `flattened`: number of facets left flat, as the
    surface over them would fold; `offsets`: height at the corners of facets, which is zero but at hanging
    nodes; None without any.
    """

    normals: np.ndarray
    corners: np.ndarray
    rest: np.ndarray
    flattened: int = 0
    offsets: np.ndarray | None = None


class Uncut:
    """Facets that are whole, on which displacements have the linear functions of their corners."""

    #: Degree of displacements.
    order = 1
    #: Degree of the quadrature with which mortar integrals are exact enough.
    degree = 5
    #: Whether these are pieces of facets, and of facets of several shapes.
    is_cut = is_mixed = False

    def whole_of(self, facets: np.ndarray) -> np.ndarray:
        """Return the facets before they were cut."""
        return facets

    def nodes(self, facets: np.ndarray, facet: np.ndarray) -> np.ndarray:
        """Return the nodes whose displacements move facets, shape (n, nodes)."""
        return np.asarray(facets[facet])

    def functions(self, facet: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the shape functions of displacements at points of facets, shape (n, ..., nodes).

        `facet`: facet of each group of points, shape (n,); `values`: linear ones, shape (n, ..., corners).
        """
        return values

    def gradients(self, facet: np.ndarray, values: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        """Return their derivatives by local coordinates, from those of the linear ones, one point a facet."""
        return gradients

    def pulled_back(self, facet: np.ndarray, values: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `functions` with respect to the linear ones, in their shape."""
        return by

    def mean_nodes(self, facets: np.ndarray, facet: np.ndarray) -> np.ndarray:
        """Return the nodes in the means of slaves, none where these are nodes, shape (n, nodes)."""
        return np.zeros((len(facet), 0), dtype=np.int64)

    def mean_functions(self, facet: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the shape functions in these means, see `functions`."""
        return np.zeros((*values.shape[:-1], 0))

    def means_pulled_back(self, facet: np.ndarray, values: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `mean_functions`, see `pulled_back`."""
        return np.zeros_like(values)


UNCUT = Uncut()


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
        mirrored: On which planes of symmetry the nodes lie, across which the normals have no component: a
            column for each plane, those normal to the axes first, shape (n, n_planes).
        relief: The true surface relative to the facets; None if it is unknown or coincides with them.
        cut: How these facets are pieces of quadratic ones, or of triangles and quadrilaterals together.
        measure: What is a length or an area.
        planes: Unit normals of the planes of symmetry, the axes first, shape (n_planes, dim).
        followed: What makes values at hanging nodes the means of their masters', shape (n, n); None without
            any.
        by_pieces: Whether the areas of nodes are those of the linear pieces around them, all of them
            positive, as of slaves of mortar contact.
        sharp: Area that has to face the master for a node on a corner or an edge of the body to have its
            normal, infinite elsewhere, shape (n,), of slaves of mortar contact; None: infinite everywhere.
    """

    nodes: np.ndarray
    facets: np.ndarray
    points: np.ndarray
    averaged: np.ndarray
    areas: np.ndarray
    mirrored: np.ndarray
    planes: np.ndarray
    relief: Relief | None = None
    cut: Uncut = UNCUT
    measure: Measure = PLAIN
    followed: sp.csr_matrix | None = None
    by_pieces: bool = False
    sharp: np.ndarray | None = None

    def within(self, vectors: np.ndarray, mirrored: np.ndarray) -> np.ndarray:
        """Return vectors without their components across planes of symmetry, both (n, dim), (n, n_planes)."""
        return within_planes(vectors, mirrored, self.planes)

    def across(self, vectors: np.ndarray) -> np.ndarray:
        """Return the components of vectors across all planes of symmetry, shape (n, n_planes)."""
        return np.asarray(vectors @ self.planes.T)

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
    def order(self) -> int:
        """Degree of the facets of the body: 1 or 2."""
        return self.cut.order

    @property
    def dim(self) -> int:
        """Dimension of the space around it: 3 or 2."""
        return int(self.points.shape[1])

    @property
    def bearing(self) -> np.ndarray:
        """The facets whose areas belong to nodes, quadratic ones or linear pieces, (n_facets, nodes)."""
        return self.facets if self.by_pieces else self.whole

    @property
    def whole(self) -> np.ndarray:
        """The facets before they were cut, as rows of positions in ``nodes``, (n_facets, nodes)."""
        return self.cut.whole_of(self.facets)

    def with_areas_of_pieces(self) -> FacetedSurface:
        """Return the surface with the areas that belong to nodes as a slave of mortar contact."""
        if not self.cut.is_cut:
            return self
        surface = replace(self, by_pieces=True)
        return replace(surface, areas=surface.areas_at(self.points))

    def areas_at(self, points: np.ndarray) -> np.ndarray:
        """Return the areas that belong to the nodes where these lie elsewhere, shape (n,)."""
        facets = self.bearing
        if facets is self.facets and not self.measure.varies:
            return self.widths_at(points)
        bearing = bearing_areas(points, facets, self.measure)
        return np.bincount(facets.ravel(), bearing.ravel(), minlength=len(points))

    def point_areas_at(self, points: np.ndarray) -> np.ndarray:
        """Return the areas of contact points where the nodes lie elsewhere, shape (n,).

        The end of a facet to which no area belongs has that of the linear piece beside it.
        """
        areas, (end, middle) = self.areas_at(points), self.discs
        if not len(end):
            return areas
        length = np.linalg.norm(points[middle] - points[end], axis=1)
        areas[end] = np.pi / 3.0 * length * points[middle, 0]
        return areas

    @cached_property
    def discs(self) -> tuple[np.ndarray, np.ndarray]:
        """The ends of facets to which no area belongs; none by mortar, where the pieces have areas."""
        return self.measure.ends(self.points, self.bearing)

    @property
    def point_areas(self) -> np.ndarray:
        """Areas of contact points, see `point_areas_at`, shape (n,)."""
        return self.areas if not len(self.discs[0]) else self.point_areas_at(self.points)

    def widths_at(self, points: np.ndarray) -> np.ndarray:
        """Return the area of linear facets around each node, in the plane the length of edges."""
        return _linear_areas(points, self.facets)

    @property
    def sizes(self) -> np.ndarray:
        """Size of the facets around each node, shape (n,), [length]."""
        areas = self.widths_at(self.points) if self.measure.varies else self.areas
        return np.asarray(areas ** (1.0 / (self.dim - 1)))


def within_planes(
    vectors: np.ndarray, marks: np.ndarray, planes: np.ndarray, same: float = 1e-6
) -> np.ndarray:
    """Return vectors without their components across planes, shape (n, dim).

    `same`: planes are the same if the sine of the angle between them is below this.
    """
    dim = vectors.shape[1]
    result = np.where(marks[:, :dim], 0.0, vectors)
    if len(planes) == dim:
        return result
    across = [np.where(marks[:, axis, None], np.eye(dim)[axis], 0.0) for axis in range(dim)]
    for normal, marked in zip(planes[dim:], marks[:, dim:].T, strict=True):
        own = np.where(marked[:, None], normal, 0.0)
        for other in across:  # planes at one node need not be perpendicular to each other
            own = own - np.einsum("nd,nd->n", own, other)[:, None] * other
        size = np.linalg.norm(own, axis=1)[:, None]
        own = np.where(size > same, own / np.where(size > 0.0, size, 1.0), 0.0)
        across.append(own)
        result = result - np.einsum("nd,nd->n", result, own)[:, None] * own
    return result


def faceted_surface(
    points: np.ndarray,
    facets: np.ndarray,
    mirrored: np.ndarray | None = None,
    planes: np.ndarray | None = None,
) -> FacetedSurface:
    """Build the surface from the coordinates of a body and rows of its node numbers.

    On a plane of symmetry the average includes the facets of the mirror image: the normals lie in it.
    `mirrored`: which nodes lie on which plane of symmetry, by default none; `planes`: their normals, by
    default the axes.
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
    planes = np.eye(dim) if planes is None else planes
    within = within_planes(summed, flat, planes)
    # A surface that lies in the plane itself is not cut by it.
    flat &= (np.linalg.norm(within, axis=1) > CUT * np.linalg.norm(summed, axis=1))[:, None]
    summed = within_planes(summed, flat, planes)
    size = np.linalg.norm(summed, axis=1)
    if not (size > 0.0).all():
        at = ", ".join(f"{x:.6g}" for x in own[np.argmin(size)])
        raise InvalidInputError(
            f"every node of a surface must have a normal, that at ({at}) has none, as its facets have no "
            "area there or fold back: correct the mesh, or leave these facets out of the surface"
        )
    averaged = summed / size[:, None]
    return FacetedSurface(nodes, local, own, averaged, _linear_areas(own, local), flat, planes)


def _linear_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Distribute the areas of linear facets evenly over their corners."""
    corners = facets.shape[1]
    # The corner products of a quadrilateral add up to four times its area vector, those of a triangle to six,
    # those of an edge to two.
    total = np.linalg.norm(corner_products(points, facets).sum(axis=1), axis=1)
    share = total / {2: 2, 3: 6, 4: 4}[corners] / corners
    return np.bincount(facets.ravel(), np.repeat(share, corners), minlength=len(points))


@dataclass(frozen=True)
class Heights:
    """Heights of the true surface at some points of facets.

    `by_slopes`: their derivatives by the slopes at the corners, see `slopes`.
    """

    value: np.ndarray
    by_local: np.ndarray
    by_slopes: np.ndarray


def heights(surface: FacetedSurface, facet: np.ndarray, local: np.ndarray) -> Heights:
    """Return the heights of the true surface over points of facets, along the interpolated normals."""
    relief = surface.relief
    if relief is None:
        shape = (len(facet), surface.corners, 2)
        return Heights(np.zeros(len(facet)), np.zeros(local.shape), np.zeros(shape))
    slope, d_slope, rest, d_rest = height_functions(local, surface.corners)
    some, place = np.unique(facet, return_inverse=True)
    at_corners = slopes(surface, some)[place]
    if relief.offsets is not None:
        ends = relief.offsets[facet]
        at_corners = at_corners - edges_at_corners(ends[..., None])[..., 0]
    value = np.einsum("nke,nke->n", slope, at_corners) + np.einsum("nm,nm->n", rest, relief.rest[facet])
    by_local = np.einsum("nkea,nke->na", d_slope, at_corners)
    by_local += np.einsum("nma,nm->na", d_rest, relief.rest[facet])
    if relief.offsets is not None:
        functions, gradients = shape_functions(local, surface.corners)
        value += np.einsum("nk,nk->n", functions, ends)
        by_local += np.einsum("nka,nk->na", gradients, ends)
    return Heights(value, by_local, slope)


def slopes(surface: FacetedSurface, facet: np.ndarray) -> np.ndarray:
    """Return the slopes of the heights at the corners along both edges, shape (n, corners, 2), [length].

    The derivative of x(ξ) + h n(ξ) along an edge d is d + h' n at its ends; it lies in the tangent plane of
    the normal c where h' = −d·c / n·c.
    """
    nodes, normals = surface.facets[facet], corner_normals(surface, facet)
    edges = edges_at_corners(surface.points[nodes])
    along = np.einsum("nkd,nkd->nk", surface.normals[nodes], normals)
    return np.asarray(-np.einsum("nked,nkd->nke", edges, normals) / along[:, :, None])


def corner_normals(surface: FacetedSurface, facet: np.ndarray) -> np.ndarray:
    """Return the true normals at the corners of facets, of length close to one, shape (n, corners, dim)."""
    assert surface.relief is not None
    return surface.averaged[surface.facets[facet]] + surface.relief.corners[facet]


def edges_at_corners(points: np.ndarray) -> np.ndarray:
    """Return the edges from each corner to the next and to the one before, shape (n, corners, 2, dim)."""
    return np.stack([np.roll(points, -1, axis=1) - points, np.roll(points, 1, axis=1) - points], axis=2)


def height_functions(
    local: np.ndarray, corners: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Evaluate the polynomials that multiply slopes and rests, and their derivatives.

    Returns those of the slopes, shape (n, corners, 2), their derivatives, shape (n, corners, 2, dim − 1),
    those of the rests, shape (n, m), and their derivatives, shape (n, m, dim − 1).
    """
    if corners == 3:
        return _over_triangles(local)
    t, dt, w, dw = _edge_coordinates(local, corners)
    after, before = t * (1 - t) ** 2 * w, t**2 * (1 - t) * w
    d_after = ((1 - t) * (1 - 3 * t) * w)[..., None] * dt + (t * (1 - t) ** 2)[..., None] * dw
    d_before = (t * (2 - 3 * t) * w)[..., None] * dt + (t**2 * (1 - t))[..., None] * dw
    bubble, d_bubble = 16 * (t * (1 - t)) ** 2, (32 * t * (1 - t) * (1 - 2 * t))[..., None] * dt
    rest, d_rest = bubble * w, d_bubble * w[..., None] + bubble[..., None] * dw
    if corners == 2:
        none = np.zeros_like(after)
        slope = np.stack([np.stack([after[:, 0], none[:, 0]], 1), np.stack([none[:, 0], before[:, 0]], 1)], 1)
        d_slope = np.zeros((*slope.shape, 1))
        d_slope[:, 0, 0], d_slope[:, 1, 1] = d_after[:, 0], d_before[:, 0]
        return slope, d_slope, rest[:, :1], d_rest[:, :1]
    # The edge that ends at a corner starts at the one before.
    slope = np.stack([after, np.roll(before, 1, axis=1)], axis=2)
    d_slope = np.stack([d_after, np.roll(d_before, 1, axis=1)], axis=2)
    s, r = 1 - local[:, :1] ** 2, 1 - local[:, 1:] ** 2
    middle, d_middle = s * r, -2 * np.concatenate([local[:, :1] * r, local[:, 1:] * s], axis=1)
    return slope, d_slope, np.hstack([rest, middle]), np.concatenate([d_rest, d_middle[:, None]], axis=1)


def _edge_coordinates(local: np.ndarray, corners: int) -> tuple[np.ndarray, ...]:
    """Return position along each edge and weight of each edge, (n, edges), with their derivatives."""
    n = len(local)
    if corners == 2:
        return (
            np.broadcast_to((1 + local) / 2, (n, 1)), np.full((n, 1, 1), 0.5), np.ones((n, 1)),
            np.zeros((n, 1, 1)),
        )  # fmt: skip
    s, t = (1 + local[:, 0]) / 2, (1 + local[:, 1]) / 2
    along = np.array([[0.5, 0], [0, 0.5], [-0.5, 0], [0, -0.5]])
    position = np.stack([s, t, 1 - s, 1 - t], axis=1)
    return (
        position, np.broadcast_to(along, (n, 4, 2)), np.roll(position, 1, axis=1),
        np.broadcast_to(np.roll(along, 1, axis=0), (n, 4, 2)),
    )  # fmt: skip


def _over_triangles(local: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Evaluate `height_functions` in barycentric coordinates L: L_i² L_j + L_1 L_2 L_3 / 2 and so on."""
    here, d_here = shape_functions(local, 3)
    d_here = np.asarray(d_here)
    others = [np.roll(here, -1, axis=1), np.roll(here, 1, axis=1)]
    d_others = [np.roll(d_here, -1, axis=1), np.roll(d_here, 1, axis=1)]
    every = here.prod(axis=1)
    pairs = here * others[0]
    d_pairs = d_here * others[0][..., None] + here[..., None] * d_others[0]
    d_every = sum(d_here[:, k] * np.roll(pairs, -1, axis=1)[:, k, None] for k in range(3))
    slope = np.stack([here**2 * other + 0.5 * every[:, None] for other in others], axis=2)
    d_slope = np.stack(
        [
            (2 * here * other)[..., None] * d_here + (here**2)[..., None] * d_other + 0.5 * d_every[:, None]
            for other, d_other in zip(others, d_others, strict=True)
        ],
        axis=2,
    )
    rest = np.concatenate([16 * pairs**2, 27 * every[:, None]], axis=1)
    d_rest = np.concatenate([32 * pairs[..., None] * d_pairs, 27 * d_every[:, None]], axis=1)
    return slope, d_slope, rest, d_rest
