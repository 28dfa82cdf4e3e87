"""Reverse mode through the closest-point projection: from gap, normal and weights back to coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.pairing import reference_axes
from fenics_contact.shape.surface_derivative import normals_pulled_back, rotated_back, slopes_pulled_back
from fenics_contact.surfaces import (
    FacetedSurface,
    heights,
    interpolated_normal,
    newton_matrix,
    shape_functions,
    shape_weight_gradients,
    shape_weights,
)


@dataclass(frozen=True)
class PointDerivatives:
    """Derivatives of a scalar by the results of the projection at each contact point.

    Attributes:
        gap: By the gap, shape (n,).
        normal: By the normal, shape (n, dim).
        tangents: By the tangents, shape (n, dim − 1, dim).
        weight: By the weights of the facet's nodes, shape (n, nodes).
        axes: Axes nearest to the first tangents, shape (n, dim); `reference_axes` by default.
        gradients: Of these weights in local coordinates, shape (n, nodes, dim − 1); by default those of the
            linear shape functions of the corners.
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

    Reverse of `fenics_contact.pairing.contact_points.tangent_frames`.

    Args:
        normal: Unit normals, shape (n, dim).
        by_tangents: Derivative by the tangents, shape (n, dim − 1, dim).
        axes: Axes nearest to the first tangents, shape (n, dim); `reference_axes` by default.
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
    surface.

    Args:
        facet: Facet of each point, shape (n,).
        local: ξ, shape (n, dim − 1).
        gap: r − h, shape (n,), [length].

    Returns:
        Derivative by each slave point, shape (n, dim), and by each node of the master, (n_nodes, dim).
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

    Args:
        facet: Facet of each point, shape (n,).
        local: Local coordinates on it, shape (n, dim − 1).

    Returns:
        Positions among the surface's nodes, shape (n, nodes), and gradients, shape (n, nodes, dim − 1).
    """
    values, gradients = shape_functions(local, surface.corners)
    whole = surface.whole
    if whole is None:
        return surface.facets[facet], gradients
    nodes, _ = shape_weights(whole, facet, values)
    return nodes, shape_weight_gradients(whole, facet, values, gradients)


def _tangential(vectors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    return vectors - np.einsum("nd,nd->n", vectors, normal)[:, None] * normal
