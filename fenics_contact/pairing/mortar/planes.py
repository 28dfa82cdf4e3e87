"""Auxiliary planes: each facet's centre and mean normal, onto which facing facets are projected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.surfaces import FacetedSurface, corner_products

#: Double area of a corner's triangle, relative to the facet's area, below which a facet counts as re-entrant.
CONVEX = -1e-10


@dataclass(frozen=True)
class Planes:
    """One plane (in plane problems: line) per facet, with orthonormal axes.

    Attributes:
        origin: Mean of the facet's corners, shape (n, dim), [length].
        normal: Unit vector along the facet's area vector, outward, shape (n, dim).
        axes: Axes in the plane, right-handed with the normal in space, shape (n, dim − 1, dim).
        radius: Largest distance of a corner from the origin, shape (n,), [length].
        flat: Corners in the plane, counterclockwise in space, shape (n, corners, dim − 1), [length].
        area: Area (length) of the flat facet, shape (n,), [length²] or [length].
    """

    origin: np.ndarray
    normal: np.ndarray
    axes: np.ndarray
    radius: np.ndarray
    flat: np.ndarray
    area: np.ndarray


def measure(flat: np.ndarray) -> np.ndarray:
    """Return the signed area of polygons (n, k, 2), the signed length of intervals (n, 2, 1), shape (n,)."""
    if flat.shape[2] == 1:
        return flat[:, 1, 0] - flat[:, 0, 0]
    x, y = flat[:, :, 0], flat[:, :, 1]
    return 0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)


def planes_of(surface: FacetedSurface, chosen: np.ndarray) -> Planes:
    """Build the planes of the chosen facets."""
    facets = surface.facets[chosen]
    corners = surface.points[facets]
    origin = corners.mean(axis=1)
    normal = corner_products(surface.points, facets).sum(axis=1)
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    along = corners[:, 1] - corners[:, 0]
    along = along - np.einsum("nd,nd->n", along, normal)[:, None] * normal
    along = along / np.linalg.norm(along, axis=1)[:, None]
    axes = along[:, None] if surface.dim == 2 else np.stack([along, np.cross(normal, along)], axis=1)
    away = corners - origin[:, None]
    flat = away @ axes.transpose(0, 2, 1)
    radius = np.linalg.norm(away, axis=2).max(axis=1)
    return Planes(origin, normal, axes, radius, flat, measure(flat))


def laid_flat(points: np.ndarray, planes: Planes, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project points along the normals onto planes.

    Args:
        points: Shape (n, k, dim), [length].
        planes: The planes.
        index: Plane of each group of points, shape (n,).

    Returns:
        Coordinates in the plane, shape (n, k, dim − 1), and heights above it, shape (n, k), [length].
    """
    away = points - planes.origin[index][:, None]
    flat = away @ planes.axes[index].transpose(0, 2, 1)
    return flat, np.einsum("nkd,nd->nk", away, planes.normal[index])


def check_convex(planes: Planes, chosen: np.ndarray) -> None:
    """Check that the flat facets are convex, as required of clipping windows.

    Raises:
        InvalidInputError: If a quadrilateral is folded or has a re-entrant corner.
    """
    if planes.flat.shape[1] != 4:
        return
    turned = [np.roll(planes.flat, shift, axis=1) - planes.flat for shift in (-1, 1)]
    corner = turned[0][:, :, 0] * turned[1][:, :, 1] - turned[0][:, :, 1] * turned[1][:, :, 0]
    bad = np.flatnonzero(~(corner.min(axis=1) >= CONVEX * planes.area))
    if len(bad):
        raise InvalidInputError(
            f"mortar coupling needs convex facets on the slave surface, but {len(bad)} are folded or have a "
            f"re-entrant corner, among them facet {chosen[bad[0]]}: improve the mesh there or take that side "
            "for the master"
        )
