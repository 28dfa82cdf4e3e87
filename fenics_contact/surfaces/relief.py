"""Heights of a true surface over its flat facets, see `fenics_contact.surfaces.facets.Relief`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.surfaces.facets import FacetedSurface, shape_functions


@dataclass(frozen=True)
class Heights:
    """Heights of the true surface at some points of facets.

    Attributes:
        value: The heights, shape (n,), [length].
        by_local: Their derivatives by the local coordinates, shape (n, dim − 1).
        by_slopes: Their derivatives by the slopes at the corners, see `slopes`, shape (n, corners, 2).
    """

    value: np.ndarray
    by_local: np.ndarray
    by_slopes: np.ndarray


def heights(surface: FacetedSurface, facet: np.ndarray, local: np.ndarray) -> Heights:
    """Return the heights of the true surface over points of facets, along the interpolated normals.

    Args:
        surface: The surface.
        facet: Facet of each point, shape (n,).
        local: Local coordinates on it, shape (n, dim − 1).
    """
    relief = surface.relief
    if relief is None:
        shape = (len(facet), surface.corners, 2)
        return Heights(np.zeros(len(facet)), np.zeros(local.shape), np.zeros(shape))
    slope, d_slope, rest, d_rest = height_functions(local, surface.corners)
    at_corners = slopes(surface, facet)
    value = np.einsum("nke,nke->n", slope, at_corners) + np.einsum("nm,nm->n", rest, relief.rest[facet])
    by_local = np.einsum("nkea,nke->na", d_slope, at_corners)
    by_local += np.einsum("nma,nm->na", d_rest, relief.rest[facet])
    return Heights(value, by_local, slope)


def slopes(surface: FacetedSurface, facet: np.ndarray) -> np.ndarray:
    """Return the slopes of the heights at the corners along both edges, shape (n, corners, 2), [length].

    The derivative of x(ξ) + h n(ξ) along an edge d is d + h' n at its ends; it lies in the tangent plane of
    the normal c where h' = −d·c / n·c.

    Args:
        surface: The surface.
        facet: Facets, shape (n,).
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

    Args:
        local: Local coordinates as for `shape_functions`, shape (n, dim − 1).
        corners: 4, 3 or 2.

    Returns:
        Those of the slopes, shape (n, corners, 2), their derivatives, shape (n, corners, 2, dim − 1), those
        of the rests, shape (n, m), and their derivatives, shape (n, m, dim − 1).
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
