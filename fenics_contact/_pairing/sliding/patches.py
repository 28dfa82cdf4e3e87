"""A smooth surface through the nodes of a mesh, linear in their coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp

from fenics_contact._surfaces.facets import (
    FacetedSurface,
    corner_places,
    facet_shape_values,
    height_functions,
)
from fenics_contact._surfaces.pieces import shape_weights
from fenics_contact._surfaces.tangents import SurfaceTangents, surface_tangents
from fenics_contact.mesh.cell_types import FACET_TYPES, CellType, quadrature, shape_values


def turning_functions(local: np.ndarray, corners: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Evaluate two functions for each edge of a patch with 4 or 3 corners.

    They vanish on all edges. The derivatives of those of an edge are 3t(1 − t)² and 3t²(1 − t) across it, and
    zero across the others. With the coordinates b along the edge, from the end next to which it is steeper,
    and c across it, a function is

        3 b (1 − b)² c (1 − c)² w,  in triangles 3 b c (1 − b − c)² w,  w = b² / (b² + c²),

    so that each of two edges has the twist that it needs where they meet. First derivatives are continuous.

    `local`: local coordinates, shape (n, 2).

    Returns values, shape (n, 2 · corners), first derivatives, (n, 2 · corners, 2), and second ones, (n, 2 ·
    corners, 2, 2).

    References:
        H. Chiyokura, F. Kimura, Design of solids with free-form surfaces, Computer Graphics 17 (1983), with
        b and c in the blend for b² and c²: that has poles beside the patch.
    """
    start, slope = _coordinates(corners)
    b, c = start[:, :, None] + slope @ local.T  # one row for each function
    blend = _blend(b, c)
    product = _over_triangles(b, c) if corners == 3 else _over_quadrilaterals(b, c)
    value, d_b, d_c, d_bb, d_bc, d_cc = _product(product, blend)
    first = d_b[..., None] * slope[0][:, None] + d_c[..., None] * slope[1][:, None]
    bb, bc, cc = (np.einsum("ka,kb->kab", slope[i], slope[j])[:, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    mixed = bc + np.swapaxes(bc, 2, 3)
    second = d_bb[..., None, None] * bb + d_bc[..., None, None] * mixed + d_cc[..., None, None] * cc
    return value.T, np.swapaxes(first, 0, 1), np.swapaxes(second, 0, 1)


def _coordinates(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Return b and c at the origin, shape (2, 2 · corners), and their gradients, (2, 2 · corners, 2)."""
    place = corner_places(corners)
    along, across = np.roll(place, -1, axis=0) - place, np.roll(place, 1, axis=0) - place
    # Barycentric in triangles, from 0 to 1 in quadrilaterals: dual to the edge and the way across it.
    dual = np.linalg.inv(np.stack([along, across], axis=2))
    start = -np.einsum("eka,ea->ek", dual, place)
    t, c = (start[:, 0], dual[:, 0]), (start[:, 1], dual[:, 1])
    rest = (1.0 - t[0] - c[0], -t[1] - c[1]) if corners == 3 else (1.0 - t[0], -t[1])
    b = [np.stack([one, other], axis=1) for one, other in zip(t, rest, strict=True)]
    both = [np.repeat(each, 2, axis=0) for each in c]
    return (
        np.stack([b[0].ravel(), both[0]]),
        np.stack([b[1].reshape(-1, 2), both[1]]),
    )


_Jet = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _product(f: _Jet, g: _Jet) -> _Jet:
    """Return f g with its derivatives by b, c, bb, bc and cc."""
    return (
        f[0] * g[0],
        f[1] * g[0] + f[0] * g[1],
        f[2] * g[0] + f[0] * g[2],
        f[3] * g[0] + 2 * f[1] * g[1] + f[0] * g[3],
        f[4] * g[0] + f[1] * g[2] + f[2] * g[1] + f[0] * g[4],
        f[5] * g[0] + 2 * f[2] * g[2] + f[0] * g[5],
    )


def _over_quadrilaterals(b: np.ndarray, c: np.ndarray) -> _Jet:
    """Return 3 b (1 − b)² c (1 − c)²."""
    (f, f_b, f_bb), (g, g_c, g_cc) = ((x * (1 - x) ** 2, (1 - x) * (1 - 3 * x), 6 * x - 4) for x in (b, c))
    return 3 * f * g, 3 * f_b * g, 3 * f * g_c, 3 * f_bb * g, 3 * f_b * g_c, 3 * f * g_cc


def _over_triangles(b: np.ndarray, c: np.ndarray) -> _Jet:
    """Return 3 a² b c with a = 1 − b − c."""
    a = 1 - b - c
    return (
        3 * a**2 * b * c,
        3 * a * c * (a - 2 * b),
        3 * a * b * (a - 2 * c),
        6 * c * (b - 2 * a),
        3 * (a**2 - 2 * a * (b + c) + 2 * b * c),
        6 * b * (c - 2 * a),
    )


def _blend(b: np.ndarray, c: np.ndarray) -> _Jet:
    """Return b² / (b² + c²), zero with its derivatives at the corner itself."""
    whole = b**2 + c**2
    s = np.where(whole > 0.0, whole, 1.0)
    return (
        b**2 / s,
        2 * b * c**2 / s**2,
        -2 * b**2 * c / s**2,
        2 * c**2 * (c**2 - 3 * b**2) / s**3,
        4 * b * c * (b**2 - c**2) / s**3,
        -2 * b**2 * (b**2 - 3 * c**2) / s**3,
    )


@dataclass(frozen=True)
class PatchValues:
    """Basis functions at some points.

    Attributes:
        value: Of positions, of tangents at the corners, and of turns about edges, shape (n, n_functions).
        first: Derivatives, shape (n, n_functions, dim − 1).
        second: Second derivatives, shape (n, n_functions, dim − 1, dim − 1).
    """

    value: np.ndarray
    first: np.ndarray
    second: np.ndarray


def n_values(corners: int, order: int) -> int:
    """Return the number of functions of positions: the corners, or the nodes of a quadratic facet."""
    return corners if order == 1 else {2: 3, 3: 6, 4: 9}[corners]


def n_functions(corners: int, order: int) -> int:
    """Return the number of functions: of positions, of edges that meet at corners, of turns about edges."""
    return n_values(corners, order) + (4 * corners if corners > 2 else 2 * corners)


def patch_functions(local: np.ndarray, corners: int, order: int) -> PatchValues:
    """Evaluate the functions of patches with 4, 3 or 2 corners: `edge_functions`, `turning_functions`.

    `local`: local coordinates as for `fenics_contact._surfaces.facets.shape_functions`, shape (n, dim − 1).
    """
    edges = edge_functions(local, corners, order)
    if corners == 2:
        return edges
    turns = turning_functions(local, corners)
    if order > 1:
        means, bubble = _turned_means(corners), _evaluated(local, *_bubble(corners))
        turns = tuple(
            turn - np.expand_dims(means, tuple(range(1, turn.ndim - 1))) * one
            for turn, one in zip(turns, (bubble.value, bubble.first, bubble.second), strict=True)
        )
    before = edges.value, edges.first, edges.second
    return PatchValues(*(np.concatenate(parts, axis=1) for parts in zip(before, turns, strict=True)))


def edge_functions(local: np.ndarray, corners: int, order: int) -> PatchValues:
    """Evaluate the functions that make edges: of positions and of tangents at the corners.

    Along edges those of tangents are Hermite's cubics, over triangles cubic, over quadrilaterals blended
    bilinearly. On pieces of quadratic facets positions are quadratic, and all functions of tangents and of
    turns have the mean zero, by bubbles that leave the rim of a piece as it is: forces of a uniform pressure
    are then those of the quadratic shape functions, 0 and a third of a triangle at its corners and midpoints
    and not the eighth and eighth more of the pieces around each node.
    """
    return _evaluated(local, *_polynomials(corners, order))


def edge_derivatives(control: sp.csr_matrix, corners: int, order: int, t: float, way: int) -> sp.csr_matrix:
    """Return weights of the nodes in derivatives at t of all edges, towards their next or last corner.

    `control`: weights of the nodes in `edge_functions`, shape (n_facets · functions, n_nodes).
    """
    place = corner_places(corners)
    after, step = np.roll(place, -1, axis=0), np.roll(place, -way, axis=0) - place
    values = np.einsum("eba,ea->eb", edge_functions((1 - t) * place + t * after, corners, order).first, step)
    facets = sp.identity(control.shape[0] // values.shape[1])
    return (sp.kron(facets, sp.csr_matrix(values)) @ control).tocsr()


def _evaluated(local: np.ndarray, powers: np.ndarray, coefficients: np.ndarray) -> PatchValues:
    """Evaluate polynomials with their derivatives."""
    width = local.shape[1]
    tables = [_powers_of(local[:, axis]) for axis in range(width)]

    def derived(*orders: int) -> np.ndarray:
        terms = np.ones((len(local), len(powers)))
        for axis, order in enumerate(orders):
            terms *= tables[axis][order][:, powers[:, axis]]
        return np.asarray(terms @ coefficients)

    unit = np.eye(width, dtype=np.int64)
    first = np.stack([derived(*unit[a]) for a in range(width)], axis=2)
    second = np.stack(
        [np.stack([derived(*(unit[a] + unit[b])) for b in range(width)], axis=2) for a in range(width)],
        axis=2,
    )
    return PatchValues(derived(*np.zeros(width, dtype=np.int64)), first, second)


def _powers_of(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return 1, x, ..., x⁴ and their first and second derivatives, shape (n, 5) each."""
    one, none = np.ones_like(x), np.zeros_like(x)
    return (
        np.stack([one, x, x**2, x**3, x**4], axis=1),
        np.stack([none, one, 2 * x, 3 * x**2, 4 * x**3], axis=1),
        np.stack([none, none, 2 * one, 6 * x, 12 * x**2], axis=1),
    )


@cache
def _polynomials(corners: int, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return powers of the local coordinates, (n, dim − 1), and coefficients of them, (n, n_functions)."""

    def wanted(local: np.ndarray) -> np.ndarray:
        slopes = height_functions(local, corners)[0].reshape(len(local), -1)
        values = facet_shape_values(local, corners)
        if order == 1:
            return np.hstack([values, slopes])
        means = _means(lambda at: height_functions(at, corners)[0], corners)
        slopes = slopes - _bubbles(local, corners) * means
        return np.hstack([shape_values(_kind(corners, 2), values @ _kind(corners, 1).nodes), slopes])

    return _fitted(wanted, corners, 2 + order)


@cache
def _bubble(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Return powers and coefficients of a function that vanishes on all edges, with its derivatives."""
    return _fitted(lambda local: _bubbles(local, corners), corners, 4)


@cache
def _turned_means(corners: int) -> np.ndarray:
    return _means(lambda local: turning_functions(local, corners)[0], corners)


def _fitted(
    wanted: Callable[[np.ndarray], np.ndarray], corners: int, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return powers of the local coordinates and the coefficients of polynomials, see `_polynomials`."""
    width = 1 if corners == 2 else 2
    powers, local = (
        np.stack(np.meshgrid(*[ticks] * width, indexing="ij"), axis=-1).reshape(-1, width)
        for ticks in (np.arange(degree + 1), np.linspace(-1.0, 1.0, degree + 2))
    )
    terms = np.prod(local[:, None] ** powers, axis=2)
    found = np.linalg.lstsq(terms, wanted(local), rcond=None)[0]
    return powers, np.where(np.abs(found) < 1e-13, 0.0, found)


def _bubbles(local: np.ndarray, corners: int) -> np.ndarray:
    """Return the squared product of the distances from all edges, shape (n, 1)."""
    if corners == 3:
        return np.asarray(facet_shape_values(local, 3).prod(axis=1, keepdims=True) ** 2)
    return np.asarray(((1 - local**2) ** 2).prod(axis=1, keepdims=True))


def _means(functions: Callable[[np.ndarray], np.ndarray], corners: int, degree: int = 20) -> np.ndarray:
    """Return the means of functions over a facet, over that of the bubble, shape (n_functions,)."""
    places, weights = quadrature(_kind(corners, 1), degree)
    local = places if corners == 3 else 2 * places - 1
    values = functions(local).reshape(len(local), -1)
    return np.asarray(weights @ values / (weights @ _bubbles(local, corners)))


def _kind(corners: int, order: int) -> CellType:
    return FACET_TYPES[n_values(corners, order), 2 if corners == 2 else 3]


FITTED = ((3.0, -1.5), (-1.5, 3.0))


def edge_turns(
    tangents: SurfaceTangents,
    control: sp.csr_matrix,
    order: int,
    parameters: tuple[float, ...] = (1 / 3, 2 / 3),
) -> sp.csr_matrix:
    """Return the weights of the functions that give neighbouring patches one tangent plane along their edge.

    Along an edge with the curve C(t), the patches on both sides get derivatives across it that are

        D(t) = p(t) M(t) + q(t) C'(t),

    with the same M, linear in t between vectors that are orthogonal to the edge at its ends in the
    undeformed surface; p and q, linear too, follow at each end from the tangent of the patch's other edge. M
    and C' are linear in the nodes with fixed weights, p and q are fixed: so whatever becomes of the nodes, M
    and C' span a plane that both patches have in common.

    `control`: weights of the nodes in the patches' functions along edges, see `edge_functions`, shape
    (n_facets · functions, n_nodes); `parameters`: where derivatives along an edge are compared, and the
    coefficients of 3t(1 − t)² and 3t²(1 − t) from there.

    The result has shape (n_facets · corners · 2, n_nodes): of both functions of each edge, see
    `turning_functions`; zero at edges that end in a straight tangent.

    References:
        H. Chiyokura, F. Kimura, Design of solids with free-form surfaces, Computer Graphics 17 (1983).
    """
    first, second = tangents.shares, np.roll(tangents.shares, -1, axis=1)
    starts, stops = first[:, :, 0], -second[:, :, 1]
    # Across the edge is towards the corner before it: in triangles that is past the next edge's tangent.
    begun, ended = first[:, :, 1], second[:, :, 0] + (stops if first.shape[1] == 3 else 0.0)
    m0, p0, q0 = _split(starts, begun, first)
    m1, p1, q1 = _split(stops, ended, second)
    here = _combined(tangents, tangents.of_corner, m0)
    there = _combined(tangents, np.roll(tangents.of_corner, -1, axis=1), m1)
    smooth = tangents.smooth.all(axis=2)
    smooth = (smooth & np.roll(smooth, -1, axis=1)).ravel().astype(np.float64)
    lacking = []
    for t in parameters:
        p, q = (sp.diags(((1 - t) * a + t * b).ravel()) for a, b in ((p0, p1), (q0, q1)))
        along, across = (edge_derivatives(control, first.shape[1], order, t, way) for way in (1, -1))
        lacking.append(sp.diags(smooth) @ (p @ ((1 - t) * here + t * there) + q @ along - across))
    both = [sum(f * rows for f, rows in zip(line, lacking, strict=True)) for line in FITTED]
    in_turn = np.arange(2 * len(smooth)).reshape(2, -1).T.ravel()
    return sp.vstack(both, format="csr")[in_turn]


def _split(edge: np.ndarray, across: np.ndarray, pair: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return unit vectors M orthogonal to the edge, on the side of its patch's corner, p and q.

    `edge`: C' in the axes of the tangent plane, shape (n_facets, corners, 2); `pair`: both tangents of the
    corner, whose sense is that of the facet, shape (n_facets, corners, 2, 2).
    """
    sense = np.sign(np.linalg.det(pair))[..., None]
    length = np.linalg.norm(edge, axis=2)
    length = np.where(length > 0.0, length, 1.0)
    normal = sense * np.stack([-edge[..., 1], edge[..., 0]], axis=2) / length[..., None]
    return normal, (across * normal).sum(axis=2), (across * edge).sum(axis=2) / length**2


def _combined(tangents: SurfaceTangents, wedge: np.ndarray, shares: np.ndarray) -> sp.csr_matrix:
    """Return weights of the nodes in combinations of the derivatives of wedges, (wedge.size, n_nodes)."""
    row = np.repeat(np.arange(wedge.size), 2)
    column = (2 * wedge.reshape(-1, 1) + np.arange(2)).ravel()
    shape = (wedge.size, tangents.derivatives.shape[0])
    return (sp.csr_matrix((shares.ravel(), (row, column)), shape=shape) @ tangents.derivatives).tocsr()


@dataclass(frozen=True)
class SmoothPatches:
    """S(ξ) = Σ_j W_j(ξ) x_j on every facet, with weights that the reference configuration fixes.

    Edges are cubic; their tangents at the corners are linear combinations of the nodes around them, common to
    all facets that meet there without a crease. So are tangent planes along edges, see `edge_turns`: the
    normal is continuous whatever becomes of the nodes. As S is linear in the nodes and follows every affine
    motion, the closest point's gap has the derivative n·(x_s − Σ W_j x_j)' exactly, and is frame indifferent.

    Attributes:
        facets: Facets as rows of node positions on the surface, shape (n_facets, corners).
        control: Weights of the surface's nodes in the coefficients of each facet's functions, shape (n_facets
            · n_functions, n_nodes).
        order: 1, or 2 where facets are pieces of quadratic ones: patches then are these, but for what smooths
            the edges between them.
    """

    facets: np.ndarray
    control: sp.csr_matrix
    dim: int
    order: int

    @classmethod
    def of(cls, surface: FacetedSurface, *, smooth: bool = True) -> SmoothPatches:
        """Return the patches of a surface in its reference configuration; its facets if not smooth."""
        corners, order = surface.corners, surface.order
        first, functions = n_values(corners, order), n_functions(corners, order)
        positions, size = _positions(surface, first), first + 2 * corners
        if not smooth:
            return cls(surface.facets, _spaced(positions, first, 0, functions), surface.dim, order)
        tangents = surface_tangents(surface)
        control = _spaced(positions, first, 0, size)
        bends = tangents.bends if order == 1 else tangents.bends - _bent(surface, tangents, control)
        control = control + _spaced(bends, 2 * corners, first, size)
        if corners == 2:
            return cls(surface.facets, control, surface.dim, order)
        turns = _spaced(edge_turns(tangents, control, order), functions - size, size, functions)
        return cls(surface.facets, _spaced(control, size, 0, functions) + turns, surface.dim, order)

    @property
    def corners(self) -> int:
        """Corners of a facet."""
        return int(self.facets.shape[1])

    def coefficients(self, points: np.ndarray) -> np.ndarray:
        """Return the coefficients of all patches, shape (n_facets, n_functions, dim).

        `points`: present coordinates of the surface's nodes, shape (n_nodes, dim), [length].
        """
        return np.asarray(self.control @ points).reshape(len(self.facets), -1, self.dim)

    def functions(self, local: np.ndarray) -> PatchValues:
        """Return the functions at local coordinates, see `patch_functions`."""
        return patch_functions(local, self.corners, self.order)

    def weights(self, facet: np.ndarray, values: np.ndarray) -> sp.csr_matrix:
        """Return the weights of the surface's nodes at points, shape (n, n_nodes).

        `facet`: facets, shape (n,); `values`: functions there, or one of their derivatives, shape (n,
        n_functions).
        """
        count, size = values.shape
        column = size * facet[:, None] + np.arange(size)
        row = np.repeat(np.arange(count), size)
        spread = sp.csr_matrix((values.ravel(), (row, column.ravel())), shape=(count, self.control.shape[0]))
        return (spread @ self.control).tocsr()


def _positions(surface: FacetedSurface, count: int) -> sp.csr_matrix:
    """Return the weights of nodes in so many positions on each facet, shape (n_facets · count, n_nodes)."""
    nodes, values = surface.facets.reshape(-1, 1), np.ones((surface.facets.size, 1))
    if surface.order > 1:
        kinds = (FACET_TYPES[each, surface.dim] for each in (surface.corners, count))
        linear, quadratic = kinds
        shares = np.tile(shape_values(linear, quadratic.nodes), (len(surface.facets), 1))
        nodes, values = shape_weights(surface, np.repeat(np.arange(len(surface.facets)), count), shares)
    row = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    shape = len(nodes), len(surface.nodes)
    return sp.csr_matrix((values.ravel(), (row, nodes.ravel())), shape=shape)


def _bent(surface: FacetedSurface, tangents: SurfaceTangents, control: sp.csr_matrix) -> sp.csr_matrix:
    """Return the weights by which tangents of quadratic edges differ from straight ones, as ``bends``."""
    corner, parts = surface.facets.ravel(), []
    for way in (1, -1):
        other = np.roll(surface.facets, -way, axis=1).ravel()
        row, one = np.tile(np.arange(len(corner)), 2), np.ones(len(corner))
        chords = (np.concatenate([one, -one]), (row, np.concatenate([other, corner])))
        straight = sp.csr_matrix(chords, shape=(len(corner), control.shape[1]))
        parts.append(edge_derivatives(control, surface.corners, 2, 0.0, way) - straight)
    order = np.arange(2 * len(corner)).reshape(2, -1).T.ravel()
    return sp.diags(tangents.smooth.ravel().astype(np.float64)) @ sp.vstack(parts, format="csr")[order]


def _spaced(rows: sp.csr_matrix, size: int, start: int, total: int) -> sp.csr_matrix:
    """Return ``size`` rows of every facet at ``start`` among ``total`` ones of each."""
    entries = rows.tocoo()
    facet, place = np.divmod(entries.row, size)
    shape = (rows.shape[0] // size * total, rows.shape[1])
    return sp.csr_matrix((entries.data, (facet * total + start + place, entries.col)), shape=shape)
