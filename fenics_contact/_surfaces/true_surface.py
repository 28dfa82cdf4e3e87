"""The surface that facets represent: of a known shape, reconstructed, or the facets themselves."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.csr import Csr
from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    Relief,
    corner_products,
    edges_at_corners,
    facet_shape_values,
    faceted_surface,
    heights,
    slopes,
)
from fenics_contact._surfaces.fitting import PolynomialFit, powers_of
from fenics_contact._surfaces.pieces import MixedPieces, Pieces
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import computed_rounding
from fenics_contact.mesh.linear_facets import has_both, linear_facets
from fenics_contact.shapes.combined import Joined
from fenics_contact.shapes.simple import SurfaceShape, evaluate_shape, tangent_bases

#: Angle between the normals of neighbouring facets above which their common edge is a crease, in degrees.
CREASE = 40.0
#: Ratio of a crease's angle to those of a smooth surface at the next edges.
SEVERAL = 3.0
#: Surfaces with a slope above this at the end of an edge have a cusp there, or fold.
STEEPEST = 1.0


def reconstructed(surface: FacetedSurface, order: int = 2) -> FacetedSurface:
    """Return a surface with the relief reconstructed from its nodes.

    At every node a quadratic polynomial is fitted to the nodes within two rings of facets, which gives its
    normal with an error of the second order, also at the rim; the error of cubics with these normals is of
    the third order. Creases are kept, where the surface turns by more than `CREASE` degrees from facet to
    facet or by several times as much as nearby: nodes have different normals on their two sides.

    With cubic polynomials over three rings, and with the error of Hermite's cubics in the middle of an arc of
    their curvature, the error is of the fourth order: the difference estimates that of the former.

    References:
        Cazals, F., Pouget, M.: Estimating differential quantities using polynomial fitting of osculating
        jets. Computer Aided Geometric Design 22 (2005).
        Nagata, T.: Simple local interpolation of surfaces using normal vectors. Computer Aided Geometric
        Design 22 (2005).
    """
    wedges = wedges_of(surface)
    normals, bends = _fitted(surface, wedges, order)
    corners = normals[wedges.of_corner] - surface.averaged[surface.facets]
    rest = np.zeros((len(surface.facets), 1 if surface.corners == 2 else surface.corners + 1))
    if order > 2:
        edges = 1 if surface.corners == 2 else surface.corners
        points, of_corner = surface.points[surface.facets], wedges.of_corner
        along = (np.roll(points, -1, axis=1) - points)[:, :edges]
        # An arc of curvature κ over the edge d is κ³ d⁴ / 128 higher in its middle than the cubic.
        ends = (bends[of_corner[:, :edges]], bends[np.roll(of_corner, -1, axis=1)[:, :edges]])
        curved = sum(np.einsum("nki,nkij,nkj->nk", along, bend, along) for bend in ends) / 2
        rest[:, :edges] = -(curved**3) / (128.0 * np.einsum("nkd,nkd->nk", along, along))
    at_nodes = np.zeros_like(surface.averaged)
    # On creases the averaged normals are kept, also where a surface forms one with its mirror image.
    whole = np.bincount(wedges.node)[wedges.node] == 1
    whole &= (wedges.mirrored == surface.mirrored[wedges.node]).all(axis=1)
    at_nodes[wedges.node[whole]] = normals[whole] - surface.averaged[wedges.node[whole]]
    return without_folds(replace(surface, relief=Relief(at_nodes, corners, rest)))


def without_folds(surface: FacetedSurface) -> FacetedSurface:
    """Return a surface that is flat over facets over which its relief has cusps or folds."""
    relief = surface.relief
    assert relief is not None
    points, averaged = surface.points[surface.facets], surface.averaged[surface.facets]
    length = np.linalg.norm(edges_at_corners(points), axis=3)
    rising = slopes(surface, np.arange(len(surface.facets)))
    over = np.einsum("nkd,nkd->nk", surface.normals[surface.facets], averaged + relief.corners)
    folded = ((np.abs(rising) > STEEPEST * length).any(axis=2) | (over <= 0.0)).any(axis=1)
    if not folded.any():
        return surface
    own = corner_products(surface.points, surface.facets[folded])
    own /= np.linalg.norm(own, axis=2)[:, :, None]
    corners, rest = relief.corners.copy(), relief.rest.copy()
    corners[folded], rest[folded] = own - averaged[folded], 0.0
    flattened = int(np.count_nonzero(folded))
    return replace(surface, relief=replace(relief, corners=corners, rest=rest, flattened=flattened))


@dataclass(frozen=True)
class Joints:
    """Edges between two facets, in the plane the nodes between two edges.

    `corners`: their corners that meet there, numbered facet by facet.
    """

    facets: np.ndarray
    corners: np.ndarray
    angle: np.ndarray

    NAMES: ClassVar = ("facets", "corners", "angle")


@dataclass(frozen=True)
class Wedges:
    """Corners of facets that meet at a node without a crease in between.

    `mirrored`: planes of symmetry across which it continues smoothly; `rim`: whether it ends at an edge, the
    surface's or a crease.
    """

    of_corner: np.ndarray
    node: np.ndarray
    mirrored: np.ndarray
    rim: np.ndarray

    def patches(self, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the wedges within so many rings of facets around each, and which patches are narrow.

        Returns:
            Pairs of wedges as from `rings_of`, and whether all of a patch lies at the rim, shape (n_wedges,).
        """
        centre, around = rings_of(self.of_corner, len(self.node), order)
        inside = np.bincount(centre, ~self.rim[around], len(self.node)) > 0
        return centre, around, self.rim & ~inside


def wedges_of(surface: FacetedSurface) -> Wedges:
    """Group the corners of facets."""
    joints, images = joints_of(surface), _joints_with_images(surface)
    every = Joints(*(np.concatenate([getattr(p, name) for p in (joints, *images)]) for name in Joints.NAMES))
    smooth = ~is_crease(surface, every)
    one, other = (every.corners[smooth, side].ravel() for side in (0, 1))
    count = surface.facets.size
    graph = sp.coo_matrix((np.ones(len(one)), (one, other)), shape=(count, count))
    number, wedge = connected_components(graph, directed=False)
    node = np.zeros(number, dtype=np.int64)
    node[wedge] = surface.facets.ravel()
    mirrored = np.zeros((number, surface.mirrored.shape[1]), dtype=bool)
    start = stop = len(joints.angle)
    for axis, image in enumerate(images):
        begin, stop = stop, stop + len(image.angle)
        mirrored[wedge[image.corners[smooth[begin:stop], 0].ravel()], axis] = True
    # Every corner has two edges, of plane bodies one end of an edge; both sides of an image are the same.
    first = np.arange(len(smooth)) < start
    joined = [every.corners[smooth & first].ravel(), every.corners[smooth & ~first, 0].ravel()]
    edges = np.bincount(wedge, minlength=number) * min(surface.corners - 1, 2)
    rim = np.bincount(wedge[np.concatenate(joined)], minlength=number) < edges
    return Wedges(wedge.reshape(surface.facets.shape), node, mirrored, rim)


def _joints_with_images(surface: FacetedSurface) -> list[Joints]:
    """Return the joints of a surface with its mirror images across each plane of symmetry."""
    count, corners = surface.facets.shape
    corner, joints = np.arange(count * corners).reshape(count, corners), []
    summed = corner_products(surface.points, surface.facets).sum(axis=1)
    unit = summed / np.linalg.norm(summed, axis=1)[:, None]
    for number, plane in enumerate(surface.planes):
        there = surface.mirrored[surface.facets, number]
        if corners > 2:
            there &= np.roll(there, -1, axis=1)
        facet, place = np.nonzero(there)
        ends = corner[facet, place][:, None]
        if corners > 2:
            ends = np.column_stack([ends, corner[facet, (place + 1) % corners]])
        angle = 2 * np.arcsin(np.minimum(np.abs(unit[facet] @ plane), 1.0))
        joints.append(Joints(np.stack([facet, facet], 1), np.stack([ends, ends], 1), angle))
    return joints


def is_crease(
    surface: FacetedSurface, joints: Joints, rounding: float = 1e-6, parallel: float = 0.9
) -> np.ndarray:
    """Return which joints are creases.

    A smooth surface turns by similar angles at the next parallel joints on both sides; where it turns by
    several times as much as at one of them, and by more than at the others there, it has a crease, however
    shallow. `rounding`: angles below this count as zero, in radians; `parallel`: edges are parallel if the
    cosine of the angle between them is above this.
    """
    nodes = surface.facets.ravel()[joints.corners[:, 0]]
    count, size = nodes.shape[0], len(surface.nodes)
    number = np.repeat(np.arange(count), nodes.shape[1])
    at_node = Csr((np.ones(nodes.size), (nodes.ravel(), number)), shape=(size, count))
    along = surface.points[nodes[:, -1]] - surface.points[nodes[:, 0]]
    along = along / np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
    rim = at_node.getnnz(axis=1) < np.bincount(surface.facets.ravel(), minlength=size)
    expected = np.full(count, np.inf)  # unknown beyond the rim
    for side in (0, 1):
        beside = surface.facets[joints.facets[:, side]]
        apart = (beside[..., None] != nodes[:, None]).all(axis=-1)
        joint, corner = np.nonzero(apart)
        across = Csr((np.ones(len(joint)), (joint, beside[joint, corner])), shape=(count, size))
        pairs = (across @ at_node).tocoo()
        alike = np.abs(np.einsum("nd,nd->n", along[pairs.row], along[pairs.col])) > parallel
        alike |= surface.dim == 2
        share = np.where(alike, 1.0, 1.0 / SEVERAL)
        turned, known = np.zeros(count), np.bincount(pairs.row, alike, count) > 0
        if surface.corners == 3:  # at the rim, the parallel joint may be missing
            known &= across @ rim == 0
        np.maximum.at(turned, pairs.row, share * joints.angle[pairs.col])
        expected = np.minimum(expected, np.where(known, turned, np.inf))
    alone = joints.angle > SEVERAL * expected + rounding
    return np.asarray(alone | (joints.angle > np.radians(CREASE)))


def joints_of(surface: FacetedSurface) -> Joints:
    """Return the joints of a surface."""
    count, corners = surface.facets.shape
    corner = np.arange(count * corners).reshape(count, corners)
    if corners == 2:
        start, stop = surface.facets[:, 0], surface.facets[:, 1]
        place, met = _matches(stop, start)
        ends = np.stack([corner[place, 1], corner[met, 0]], axis=1)[:, :, None]
    else:
        start, stop = surface.facets.ravel(), np.roll(surface.facets, -1, axis=1).ravel()
        size, following = len(surface.nodes), np.roll(corner, -1, axis=1).ravel()
        place, met = _matches(start * size + stop, stop * size + start)
        once = start[met] < stop[met]
        place, met = place[once], met[once]
        ends = np.stack([np.stack([met, following[met]], 1), np.stack([following[place], place], 1)], axis=1)
    facets = ends[:, :, 0] // corners
    summed = corner_products(surface.points, surface.facets).sum(axis=1)
    one, other = (summed[facets[:, side]] for side in (0, 1))
    across = np.linalg.norm(_crossed(one, other), axis=1)
    return Joints(facets, ends, np.arctan2(across, np.einsum("nd,nd->n", one, other)))


def _matches(keys: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions of wanted keys among the keys, and which of them exist."""
    order = np.argsort(keys)
    place = order[np.clip(np.searchsorted(keys[order], wanted), 0, len(keys) - 1)]
    met = np.flatnonzero(keys[place] == wanted)
    return place[met], met


def _crossed(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return cross products, in the plane as one component."""
    if one.shape[1] == 3:
        return np.cross(one, other)
    return (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])[:, None]


def _fitted(
    surface: FacetedSurface, wedges: Wedges, order: int, most: int = 512
) -> tuple[np.ndarray, np.ndarray]:
    """Fit polynomials around all wedges, `most` at once: what lies around many fills the memory.

    Returns their normals, shape (n_wedges, dim), and their second derivatives along the surface, positive
    where it is concave, shape (n_wedges, dim, dim), [1 / length].
    """
    count, mirrored = len(wedges.node), wedges.mirrored
    summed = np.zeros((count, surface.dim))
    np.add.at(summed, wedges.of_corner, corner_products(surface.points, surface.facets))
    summed = surface.within(summed, mirrored)
    mean = summed / np.linalg.norm(summed, axis=1)[:, None]
    axes, (centre, around, narrow) = tangent_bases(mean), wedges.patches(order)
    normal, in_space = np.empty_like(mean), np.empty((count, surface.dim, surface.dim))
    for start in range(0, count, most):
        some = slice(start, start + most)
        pairs = slice(*np.searchsorted(centre, (start, start + most)))
        away = surface.points[wedges.node[around[pairs]]] - surface.points[wedges.node[centre[pairs]]]
        patch = _with_mirror_images(away, centre[pairs] - start, mirrored[some], surface.planes)
        normal[some], in_space[some] = _fit_around(*patch, mean[some], axes[some], narrow[some], order)
    normal = surface.within(normal, mirrored)
    return normal / np.linalg.norm(normal, axis=1)[:, None], in_space


def _fit_around(
    away: np.ndarray, centre: np.ndarray, mean: np.ndarray, axes: np.ndarray, narrow: np.ndarray, order: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return vectors along the normals and the second derivatives of surfaces through the nodes around some.

    `away`: from the centre of a patch to its nodes; `axes`: axes of the planes across.
    """
    count, width = axes.shape[:2]
    size = np.zeros(count)
    np.maximum.at(size, centre, np.linalg.norm(away, axis=1))
    # Relative to the patch's size: powers of the coordinates are then of order one, however fine the mesh.
    place = np.einsum("nad,nd->na", axes[centre], away) / size[centre][:, None]
    height = np.einsum("nd,nd->n", mean[centre], away) / size[centre]
    coefficients = PolynomialFit.of(place, height, centre, narrow, order).coefficients(height)
    slope, bend = coefficients[:, :width], np.zeros((count, width, width))
    for power, coefficient in zip(powers_of(width, order), coefficients.T, strict=True):
        if sum(power) == 2:
            one, other = np.repeat(np.arange(width), power)
            bend[:, one, other] += coefficient
            bend[:, other, one] += coefficient
    in_space = np.einsum("nab,nad,nbe->nde", bend, axes, axes) / size[:, None, None]
    return mean - np.einsum("na,nad->nd", slope, axes), in_space


def rings_of(wedge: np.ndarray, count: int, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the wedges within a number of rings of facets around each, as pairs without itself."""
    facet = np.repeat(np.arange(len(wedge)), wedge.shape[1])
    of_facet = Csr((np.ones(wedge.size), (wedge.ravel(), facet)), shape=(count, len(wedge)))
    ring = within = (of_facet @ of_facet.T).tocsr()
    for _ in range(rings - 1):
        within = within @ ring
    pairs = within.tocoo()
    other = pairs.row != pairs.col
    return pairs.row[other], pairs.col[other]


def _with_mirror_images(
    away: np.ndarray, centre: np.ndarray, mirrored: np.ndarray, planes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Add the mirror images of the neighbours of nodes on planes of symmetry."""
    for number, plane in enumerate(planes):
        across = mirrored[centre, number]
        image = away[across] - 2.0 * (away[across] @ plane)[:, None] * plane
        away, centre = np.concatenate([away, image]), np.concatenate([centre, centre[across]])
    return away, centre


#: Representation of a surface between its nodes, see `fenics_contact.ContactPair`.
Geometry: TypeAlias = Literal["best", "reconstructed", "faceted"]

_KNOWN: WeakKeyDictionary[BodyMesh, dict[Hashable, Relief | None]] = WeakKeyDictionary()
"""Reliefs of the surfaces of meshes, shared with reshaped meshes."""

#: A true surface has no relief if its height over the facets is below this multiple of their size.
FLAT = 1e-12


def true_surface(
    mesh: BodyMesh,
    name: str,
    geometry: Geometry,
    *,
    mirrored: np.ndarray | None = None,
    planes: np.ndarray | None = None,
    finer: bool = False,
    measure: Measure = PLAIN,
) -> FacetedSurface:
    """Return a surface of a mesh with its normals and its relief: linear facets through its nodes.

    `finer`: use a better representation, to estimate the error: the shape, or a reconstruction of the next
    order.
    """
    marks = np.zeros(mesh.points.shape, dtype=bool) if mirrored is None else mirrored
    surface = faceted_surface(mesh.points, mesh.linear.surfaces[name], marks, planes)
    surface = _with_areas(surface, mesh, name, measure)
    if mesh.hanging:
        none = np.zeros(len(surface.nodes), dtype=bool)
        surface = replace(surface, followed=mesh.hanging.filled(surface.nodes, none))
    order = 2
    if finer:
        order, geometry = (2 if geometry == "faceted" else 3), "best"
    if geometry == "faceted":
        return surface
    key = (name, geometry, order, marks.tobytes(), surface.planes.tobytes())
    known = _KNOWN.setdefault(mesh.origin, {})
    if key not in known:
        shape = mesh.origin.shapes.get(name) if geometry == "best" else None
        known[key] = _relief(mesh.origin, name, (marks, surface.planes), shape, order)
    return replace(surface, relief=known[key])


def _with_areas(surface: FacetedSurface, mesh: BodyMesh, name: str, measure: Measure) -> FacetedSurface:
    """Distribute the area of quadratic or turned facets over the nodes on which a uniform pressure bears."""
    facets = mesh.surfaces[name]
    both = has_both(facets)
    if mesh.order == 1 and not (measure.varies or both):
        return surface
    whole = np.searchsorted(surface.nodes, facets)
    if both:
        cut = MixedPieces.of(surface.points, whole, linear_facets(facets, mesh.dim))
        surface = replace(surface, cut=cut)
    elif mesh.order > 1:
        surface = replace(surface, cut=Pieces(whole, mesh.dim))
    surface = replace(surface, measure=measure)
    return replace(surface, areas=surface.areas_at(surface.points))


def _relief(
    mesh: BodyMesh,
    name: str,
    mirrors: tuple[np.ndarray, np.ndarray],
    shape: SurfaceShape | None,
    order: int,
) -> Relief | None:
    surface = faceted_surface(mesh.points, mesh.linear.surfaces[name], *mirrors)
    if shape is None:
        raised = surface if _is_plane(surface) else reconstructed(surface, order)
    else:
        raised = by_shape(surface, shape, np.isin(surface.nodes, mesh.hanging.nodes))
    return raised.relief if raised.relief and not is_flat(raised) else None


def _is_plane(surface: FacetedSurface) -> bool:
    """Return whether all nodes lie in one plane up to rounding; its mirror image begins at a crease."""
    places, products = surface.points[surface.facets], corner_products(surface.points, surface.facets)
    normal = products.sum(axis=(0, 1))
    normal /= np.linalg.norm(normal) or 1.0
    limit = FLAT * np.linalg.norm(edges_at_corners(places), axis=3).min() + computed_rounding(surface.points)
    return bool(np.ptp(places @ normal) <= limit and np.all(products @ normal > 0.0))


def is_flat(surface: FacetedSurface) -> bool:
    """Return whether the facets coincide with the surface, up to rounding."""
    relief = surface.relief
    assert relief is not None
    edges = np.linalg.norm(edges_at_corners(surface.points[surface.facets]), axis=3)
    limit = FLAT * edges.min() + computed_rounding(surface.points)
    bends = [np.abs(slopes(surface, np.arange(len(surface.facets)))).max(), np.abs(relief.rest).max()]
    if relief.offsets is not None:
        bends.append(np.abs(relief.offsets).max())
    return bool(max(bends) <= limit and np.abs(relief.normals).max() <= limit / edges.min())


def by_shape(
    surface: FacetedSurface, shape: SurfaceShape, hangs: np.ndarray | None = None, sharp: float = 0.02
) -> FacetedSurface:
    """Return a surface with the relief of the shape on which its nodes lie.

    Nodes slightly off the shape are not moved; the heights between them are relative to them, but for hanging
    nodes, which lie on larger facets. Where several shapes meet in a crease, or one its mirror image, each
    facet uses its own. `sharp`: largest angle in radians between the normals of shapes that meet smoothly.
    """
    parts = _parts(shape, surface.points[surface.facets].mean(axis=1))
    corners = np.zeros((*surface.facets.shape, surface.dim))
    for part, mine in parts:
        nodes = surface.facets[mine]
        shape_normals = evaluate_shape(part, "normals", surface.points[nodes.ravel()]).reshape(
            *nodes.shape, surface.dim
        )
        corners[mine] = _unit(shape_normals)
    normals = np.zeros_like(surface.averaged)
    np.add.at(normals, surface.facets, corners)
    normals = _unit(surface.within(normals, surface.mirrored))
    turned = np.einsum("nkd,nkd->nk", corners, normals[surface.facets]) < np.cos(sharp)
    creased = np.isin(np.arange(len(normals)), surface.facets[turned])
    normals[creased] = surface.averaged[creased]
    smooth = ~creased[surface.facets]
    corners[smooth] = normals[surface.facets[smooth]]
    return _fitted_shapes(surface, parts, normals, corners, hangs)


def _parts(shape: SurfaceShape, middles: np.ndarray) -> list[tuple[SurfaceShape, np.ndarray]]:
    """Return the parts of a joined shape, and the facets of each, by their middles."""
    if not isinstance(shape, Joined):
        return [(shape, np.ones(len(middles), dtype=bool))]
    nearest = shape.nearest(middles)
    return [(part, nearest == n) for n, part in enumerate(shape.shapes) if (nearest == n).any()]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _fitted_shapes(
    surface: FacetedSurface,
    parts: list[tuple[SurfaceShape, np.ndarray]],
    normals: np.ndarray,
    corners: np.ndarray,
    hangs: np.ndarray | None,
) -> FacetedSurface:
    """Return a surface with the normals of nodes and of corners, and the heights of parts over it."""
    samples = sample_points(surface.corners)
    count, nodes = len(surface.facets), surface.facets
    relief = Relief(
        normals - surface.averaged, corners - surface.averaged[nodes], np.zeros((count, len(samples)))
    )
    fitted = replace(surface, relief=relief)
    facet = np.arange(count)
    off_nodes = [
        _height_over_parts(fitted.points[nodes[:, k]], fitted.normals[nodes[:, k]], parts)
        for k in range(surface.corners)
    ]
    if hangs is not None and hangs.any():
        own = np.where(hangs[nodes], np.stack(off_nodes, axis=1), 0.0)
        off_nodes = [off - offset for off, offset in zip(off_nodes, own.T, strict=True)]
        relief = replace(relief, offsets=own)
        fitted = replace(surface, relief=relief)
    # The middle last: its correction is relative to that of the midpoints of the edges.
    for number, sample in enumerate(samples):
        local = np.broadcast_to(sample, (count, len(sample)))
        values = facet_shape_values(local, surface.corners)
        place = np.einsum("nk,nkd->nd", values, surface.points[nodes])
        direction, _ = interpolated_normal(values, fitted.normals[nodes])
        missing = _height_over_parts(place, direction, parts) - np.einsum("nk,kn->n", values, off_nodes)
        relief.rest[:, number] = missing - heights(fitted, facet, local).value
    return fitted


def _height_over_parts(
    points: np.ndarray, directions: np.ndarray, parts: list[tuple[SurfaceShape, np.ndarray]]
) -> np.ndarray:
    """Return the distance from a point on each facet to the shape of the facet, shape (n,)."""
    height = np.zeros(len(points))
    for part, mine in parts:
        height[mine] = height_over(points[mine], directions[mine], part)
    return height


def sample_points(corners: int) -> np.ndarray:
    """Return the midpoints of the edges and the middle, in local coordinates, shape (m, dim − 1)."""
    if corners == 2:
        return np.zeros((1, 1))
    if corners == 3:
        return np.array([[0.5, 0.0], [0.5, 0.5], [0.0, 0.5], [1 / 3, 1 / 3]])
    return np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]])


def height_over(
    points: np.ndarray, directions: np.ndarray, shape: SurfaceShape, max_steps: int = 12
) -> np.ndarray:
    """Return the distances from points along directions to a shape, shape (n,), [length]."""
    height = np.zeros(len(points))
    for _ in range(max_steps):
        place = points + height[:, None] * directions
        step = evaluate_shape(shape, "distance", place)
        cosine = np.einsum("nd,nd->n", evaluate_shape(shape, "normals", place), directions)
        _check_across(cosine, place, shape)
        step /= cosine
        height -= step
        if np.abs(step).max(initial=0.0) <= FLAT * np.ptp(points, axis=0).max(initial=0.0):
            break
    return height


def _check_across(
    cosine: np.ndarray, place: np.ndarray, shape: SurfaceShape, tangential: float = 0.02
) -> None:
    """Reject directions that are tangential to a shape.

    `tangential`: directions count as tangential to a shape if the cosine of their angle to its normal is
    below this.
    """
    along = np.abs(cosine) < tangential
    if along.any():
        where = ", ".join(f"{x:.6g}" for x in place[np.argmax(along)])
        raise InvalidInputError(
            f"each point of a facet needs one point of its shape above it, but at {np.count_nonzero(along)} "
            f"of {len(along)} points {type(shape).__name__} is nearly parallel to the normal of the facets, "
            f"the first at ({where}): refine it there, or let the pair take geometry='reconstructed'"
        )
