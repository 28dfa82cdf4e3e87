"""Derivatives by the nodes of surfaces, in reverse mode: of normals, areas, integrals and closest points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenics_contact._kinematics.measure import PLAIN, Measure
from fenics_contact._pairing.points import reference_axes
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    GaussPoint,
    bearing_pulled_back,
    corner_normals,
    corner_products,
    edges_at_corners,
    gauss_points,
    heights,
    shape_functions,
    slopes,
)
from fenics_contact._surfaces.projection import interpolated_normal, newton_matrix
from fenics_contact.mesh.faces import of_one_shape


def normals_pulled_back(
    surface: FacetedSurface, by_normals: np.ndarray, by_averaged: np.ndarray | float = 0.0
) -> np.ndarray:
    """Vector-Jacobian product of the unit normals with respect to the surface's nodes, shape (n, dim)."""
    along = np.einsum("nd,nd->n", surface.normals, by_normals)
    by_true = by_normals - along[:, None] * surface.normals
    if surface.relief is not None:
        by_true = by_true / np.linalg.norm(surface.averaged + surface.relief.normals, axis=1)[:, None]
    by_averaged = by_averaged + by_true
    products = corner_products(surface.points, surface.facets)
    summed = np.zeros_like(surface.points)
    np.add.at(summed, surface.facets, products)
    summed = surface.within(summed, surface.mirrored)
    length = np.linalg.norm(summed, axis=1)
    along = np.einsum("nd,nd->n", surface.averaged, by_averaged)
    by_summed = (by_averaged - along[:, None] * surface.averaged) / length[:, None]
    by_summed = surface.within(by_summed, surface.mirrored)
    return _products_pulled_back(surface, by_summed[surface.facets])


def slopes_pulled_back(
    surface: FacetedSurface, facet: np.ndarray, by_slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return derivatives from those by the slopes of true surfaces, see `surfaces.relief.slopes`.

    Derivatives by nodes, by true normals and by averaged normals, shape (n_nodes, dim) each.
    """
    by_points, by_normals, by_averaged = (np.zeros_like(surface.points) for _ in range(3))
    if surface.relief is None:
        return by_points, by_normals, by_averaged
    nodes, c, slope = surface.facets[facet], corner_normals(surface, facet), slopes(surface, facet)
    edges, along = (
        edges_at_corners(surface.points[nodes]),
        np.einsum("nkd,nkd->nk", surface.normals[nodes], c),
    )
    # s = −d·c / a·c
    scaled = by_slopes / along[:, :, None]
    by_edges = -scaled[..., None] * c[:, :, None]
    turned = np.einsum("nke,nke->nk", scaled, slope)[:, :, None]
    np.add.at(by_normals, nodes, -turned * c)
    np.add.at(
        by_averaged, nodes, -np.einsum("nke,nked->nkd", scaled, edges) - turned * surface.normals[nodes]
    )
    to_next, to_previous = by_edges[:, :, 0], by_edges[:, :, 1]
    by_corner = np.roll(to_next, 1, axis=1) + np.roll(to_previous, -1, axis=1) - to_next - to_previous
    np.add.at(by_points, nodes, by_corner)
    return by_points, by_normals, by_averaged


def areas_pulled_back(surface: FacetedSurface, by_areas: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the nodal areas with respect to the surface's nodes, shape (n, dim)."""
    facets = surface.bearing
    if facets is not surface.facets or surface.measure.varies:
        return sum(
            (_bearing_areas_pulled_back(surface, some, by_areas) for _, some in of_one_shape(facets)),
            start=np.zeros_like(surface.points),
        )
    total = corner_products(surface.points, surface.facets).sum(axis=1)
    direction = total / np.linalg.norm(total, axis=1)[:, None]
    divisor = {2: 2, 3: 6, 4: 4}[surface.corners] * surface.corners
    by_total = by_areas[surface.facets].sum(axis=1)[:, None] * direction / divisor
    return _products_pulled_back(surface, np.repeat(by_total[:, None], surface.corners, axis=1))


def point_areas_pulled_back(surface: FacetedSurface, by_areas: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of `point_areas_at` with respect to the surface's nodes, shape (n, dim)."""
    end, middle = surface.discs
    if not len(end):
        return areas_pulled_back(surface, by_areas)
    by_ends, rest = by_areas[end], by_areas.copy()
    rest[end] = 0.0
    result = areas_pulled_back(surface, rest)
    along = surface.points[middle] - surface.points[end]
    length = np.linalg.norm(along, axis=1)
    by_along = (np.pi / 3.0 * by_ends * surface.points[middle, 0] / length)[:, None] * along
    np.add.at(result, middle, by_along)
    np.add.at(result, end, -by_along)
    np.add.at(result[:, 0], middle, np.pi / 3.0 * by_ends * length)
    return result


def _bearing_areas_pulled_back(
    surface: FacetedSurface, facets: np.ndarray, by_areas: np.ndarray
) -> np.ndarray:
    """Return what whole facets of one shape have in `areas_pulled_back`, (n, dim)."""
    by_bearing = bearing_pulled_back(by_areas[facets])
    by_nodal = surface.measure.bearing_pulled_back(surface.points, facets, by_bearing)
    return integral_pulled_back(
        surface.points, facets, lambda at: (by_nodal @ at.values, np.zeros((1, 1))), surface.measure
    )


#: Returns an integrand at a Gauss point of every facet, shape (n_facets,), and its derivative by the place.
SurfaceDensity = Callable[[GaussPoint], tuple[np.ndarray, np.ndarray]]


def integral_pulled_back(
    points: np.ndarray, facets: np.ndarray, density: SurfaceDensity, measure: Measure = PLAIN
) -> np.ndarray:
    """Return the derivative of an integral over facets by the nodes, shape (n_nodes, dim)."""
    result = np.zeros_like(points)
    for at in gauss_points(points, facets):
        value, by_place = measure.density(*density(at), at.of(points, facets)[:, 0])
        unit = at.normals / at.areas[:, None]
        if points.shape[1] == 3:
            first, second = at.tangents[:, 0], at.tangents[:, 1]
            by_tangents = np.stack([np.cross(second, unit), np.cross(unit, first)], axis=1)
        else:
            by_tangents = rotated_back(unit)[:, None]
        by_tangents = at.weight * value[:, None, None] * by_tangents
        by_corners = np.einsum("ka,nad->nkd", at.gradients, by_tangents)
        np.add.at(result, facets, by_corners + at.values[:, None] * (at.areas[:, None] * by_place)[:, None])
    return result


def _products_pulled_back(surface: FacetedSurface, by_products: np.ndarray) -> np.ndarray:
    """Reverse of `corner_products`: (next − x) × (previous − x) at each corner, of edges their rotation."""
    result, x = np.zeros_like(surface.points), surface.points[surface.facets]
    if surface.corners == 2:
        by_end = rotated_back(by_products.sum(axis=1))
        np.add.at(result, surface.facets, np.stack([-by_end, by_end], axis=1))
        return result
    to_next, to_previous = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    # d(a × b)·c = (b × c)·da + (c × a)·db
    by_next, by_previous = np.cross(to_previous, by_products), np.cross(by_products, to_next)
    by_corner = np.roll(by_next, 1, axis=1) + np.roll(by_previous, -1, axis=1) - by_next - by_previous
    np.add.at(result, surface.facets, by_corner)
    return result


def rotated_back(vectors: np.ndarray) -> np.ndarray:
    """Return plane vectors, shape (n, 2), rotated counterclockwise: reverse of (x, y) -> (y, −x)."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


@dataclass(frozen=True)
class PointDerivatives:
    """Derivatives of a scalar by the results of the projection at each contact point.

    `axes`: axes nearest to the first tangents; `reference_axes` by default; `gradients`: of these weights in
    local coordinates; by default those of the linear shape functions of the corners.
    """

    gap: np.ndarray
    normal: np.ndarray
    tangents: np.ndarray
    weight: np.ndarray
    axes: np.ndarray | None = None
    gradients: np.ndarray | None = None


def frames_pulled_back(
    normal: np.ndarray, by_tangents: np.ndarray, axes: np.ndarray | None = None
) -> np.ndarray:
    """Vector-Jacobian product of `tangent_frames` with respect to the unit normals, shape (n, dim).

    Reverse of `fenics_contact._pairing.points.tangent_frames`. `axes`: axes nearest to the first tangents;
    `reference_axes` by default.
    """
    if normal.shape[1] == 2:
        return rotated_back(by_tangents[:, 0])
    axes = reference_axes(normal) if axes is None else axes
    along = np.einsum("nd,nd->n", axes, normal)
    first = axes - along[:, None] * normal
    length = np.linalg.norm(first, axis=1)
    t1 = first / length[:, None]
    # t2 = n × t1
    by_t1 = by_tangents[:, 0] + np.cross(by_tangents[:, 1], normal)
    by_normal = np.cross(t1, by_tangents[:, 1])
    by_first = (by_t1 - np.einsum("nd,nd->n", by_t1, t1)[:, None] * t1) / length[:, None]
    by_normal -= along[:, None] * by_first + np.einsum("nd,nd->n", by_first, normal)[:, None] * axes
    return by_normal


def projection_pulled_back(
    master: FacetedSurface, facet: np.ndarray, local: np.ndarray, gap: np.ndarray, by: PointDerivatives
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of the projection with respect to the slave points and the master's nodes.

    The projection solves Σ N_j(ξ) x_j + r n(ξ) − x_s = 0 with n = m/‖m‖, m = Σ N_j(ξ) a_j, a_j the nodal
    normals; the implicit function theorem gives ξ and r. The gap is r − h, h(ξ) the height of the true
    surface. Returns derivative by each slave point, shape (n, dim), and by each node of the master, (n_nodes,
    dim).
    """
    nodes = master.facets[facet]
    corners, normals = master.points[nodes], master.normals[nodes]
    height = heights(master, facet, local)
    values, derivatives = shape_functions(local, master.corners)
    normal, length = interpolated_normal(values, normals)
    by_normal = by.normal + frames_pulled_back(normal, by.tangents, by.axes)
    by_mean = _tangential(by_normal, normal) / length[:, None]
    gradients = derivatives if by.gradients is None else by.gradients
    by_local = np.einsum("nk,nka->na", by.weight, gradients) - by.gap[:, None] * height.by_local
    by_local += np.einsum("nka,nkd,nd->na", derivatives, normals, by_mean)
    along_ray = gap + height.value
    matrix = newton_matrix(corners, normals, derivatives, along_ray, normal, length)
    right = np.concatenate([by_local, by.gap[:, None]], axis=1)
    z = -np.linalg.solve(np.swapaxes(matrix, 1, 2), right[:, :, None])[:, :, 0]
    # z is the derivative by the residual; the residual depends on x_s, x_j and, through g n, on a_j.
    by_mean = by_mean + along_ray[:, None] * _tangential(z, normal) / length[:, None]
    by_points, by_normals, by_averaged = slopes_pulled_back(
        master, facet, -by.gap[:, None, None] * height.by_slopes
    )
    np.add.at(by_points, nodes, values[:, :, None] * z[:, None])
    np.add.at(by_normals, nodes, values[:, :, None] * by_mean[:, None])
    return -z, by_points + normals_pulled_back(master, by_normals, by_averaged)


def carriers(surface: FacetedSurface, facet: np.ndarray, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes that carry a master's motion at points and the gradients of their weights.

    Returns positions among the surface's nodes, shape (n, nodes), and gradients, shape (n, nodes, dim − 1).
    """
    values, gradients = shape_functions(local, surface.corners)
    return surface.cut.nodes(surface.facets, facet), surface.cut.gradients(facet, values, gradients)


def _tangential(vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return vectors - np.einsum("nd,nd->n", vectors, normal)[:, None] * normal
