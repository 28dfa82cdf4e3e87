"""Auxiliary planes onto which facing facets are projected, by centre and mean normal; sums by group."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from fenics_contact._base.csr import Csc
from fenics_contact._surfaces.facets import FacetedSurface, corner_products, shape_functions
from fenics_contact.errors.kinds import FoldedFacetsError
from fenics_contact.mesh.cell_types import CELL_TYPES, FACET_TYPES, quadrature


def local_coordinates_pulled_back(
    local: np.ndarray, flat: np.ndarray, by_local: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of the local coordinates of points with respect to the points and the corners.

    From x = Σ N_j(ξ) x_j follows J δξ = δx − Σ N_j δx_j with J = ∂x/∂ξ.

    `local`: ξ, shape (n, q, dim − 1); `flat`: corners, shape (n, corners, dim − 1); `by_local`: derivative by
    ξ, in its shape.

    Derivatives by the points, shape (n, q, dim − 1), and by the corners, in the shape of ``flat``.
    """
    n, points, width = local.shape
    values, slopes = shape_functions(local.reshape(-1, width), flat.shape[1])
    tangents = np.einsum("nqka,nkd->nqad", slopes.reshape(n, points, -1, width), flat)
    if width == 1:
        by_points = by_local / tangents[:, :, 0]
    else:
        a, b = tangents[:, :, 0], tangents[:, :, 1]
        det = a[:, :, 0] * b[:, :, 1] - a[:, :, 1] * b[:, :, 0]
        first, second = by_local[:, :, 0] / det, by_local[:, :, 1] / det
        by_points = np.stack(
            [first * b[:, :, 1] - second * a[:, :, 1], second * a[:, :, 0] - first * b[:, :, 0]], axis=2
        )
    return by_points, -values.reshape(n, points, -1).transpose(0, 2, 1) @ by_points


def rule(dim: int, degree: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Return a quadrature rule: of degree 5 three points of intervals (dim 2), seven of triangles (dim 3).

    Returns barycentric coordinates, shape (q, dim), and weights that add up to one, shape (q,).
    """
    positions, weights = quadrature(FACET_TYPES[3, 2] if dim == 2 else CELL_TYPES["triangle6"], degree)
    return np.column_stack([1 - positions.sum(axis=1), positions]), weights / weights.sum()


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

    def part(self, chosen: np.ndarray) -> Planes:
        """Return some of the planes, by indices or a mask."""
        return Planes(**{each.name: getattr(self, each.name)[chosen] for each in fields(self)})


def measure(flat: np.ndarray) -> np.ndarray:
    """Return the signed area of polygons (n, k, 2), the signed length of intervals (n, 2, 1), shape (n,)."""
    if flat.shape[2] == 1:
        return flat[:, 1, 0] - flat[:, 0, 0]
    x, y = flat[:, :, 0], flat[:, :, 1]
    return 0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)


def measure_pulled_back(flat: np.ndarray, by_measure: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of `measure` with respect to the corners, in the shape of ``flat``."""
    if flat.shape[2] == 1:
        return np.asarray(by_measure[:, None, None] * np.array([[-1.0], [1.0]]))
    across = np.roll(flat, -1, axis=1) - np.roll(flat, 1, axis=1)
    turned = np.stack([across[:, :, 1], -across[:, :, 0]], axis=2)
    return np.asarray(0.5 * by_measure[:, None, None] * turned)


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

    `points`: shape (n, k, dim), [length]; `index`: plane of each group of points, shape (n,).

    Returns coordinates in the plane, shape (n, k, dim − 1), and heights above it, shape (n, k), [length].
    """
    away = points - planes.origin[index][:, None]
    flat = away @ planes.axes[index].transpose(0, 2, 1)
    return flat, np.einsum("nkd,nd->nk", away, planes.normal[index])


def planes_pulled_back(
    planes: Planes,
    corners: np.ndarray,
    by_flat: np.ndarray,
    by_normal: np.ndarray,
    opposite: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of flat points with respect to the facets' corners and the points.

    The derived function must not depend on where in a plane its origin is and how its axes lie in it, which
    an integral does not. So origins may stay, and axes a change by −(a · δn) n only.

    `corners`: corners of their facets, shape (n, corners, dim); `by_normal`: direct derivative by the
    normals, shape (n, dim); `opposite`: points laid flat, shape (m, k, dim), their planes, shape (m,), and
    the derivative by their coordinates in the plane, shape (m, k, dim − 1).

    The result is in the shapes of ``corners`` and of the points.
    """
    points, index, by_points = opposite
    axes, normal = planes.axes, planes.normal
    # The heights of the points, times the derivatives by their coordinates, turn the axes.
    tilt = np.einsum("nka,nkd,nd->na", by_flat, corners - planes.origin[:, None], normal)
    height = np.einsum("nkd,nd->nk", points - planes.origin[index][:, None], normal[index])
    tilt += SumsBy(index, len(normal))(np.einsum("nka,nk->na", by_points, height))
    by_normal = by_normal - np.einsum("na,nad->nd", tilt, axes)
    by_corners = by_flat @ axes + _normals_pulled_back(corners, normal, by_normal)
    return by_corners, by_points @ axes[index]


def _normals_pulled_back(corners: np.ndarray, normal: np.ndarray, by_normal: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the mean normals with respect to the corners, shape (n, corners, dim)."""
    by_unit = by_normal - np.einsum("nd,nd->n", by_normal, normal)[:, None] * normal
    if corners.shape[1] == 2:
        length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
        turned = np.stack([-by_unit[:, 1], by_unit[:, 0]], axis=1) / length[:, None]
        return np.stack([-turned, turned], axis=1)
    following = np.roll(corners, -1, axis=1)
    # Twice the area vector is Σ x_k × x_(k+1), taken relative to the first corner.
    away = corners - corners[:, :1]
    double = np.linalg.norm(np.cross(away, following - corners[:, :1]).sum(axis=1), axis=1)
    across = following - np.roll(corners, 1, axis=1)
    return np.asarray(np.cross(across, (by_unit / double[:, None])[:, None]))


def check_convex(planes: Planes, chosen: np.ndarray, convex: float = -1e-10) -> None:
    """Check that the flat facets are convex, as required of clipping windows.

    `convex`: double area of a corner's triangle, relative to the facet's area, below which a facet counts as
    re-entrant.
    """
    if planes.flat.shape[1] != 4:
        return
    turned = [np.roll(planes.flat, shift, axis=1) - planes.flat for shift in (-1, 1)]
    corner = turned[0][:, :, 0] * turned[1][:, :, 1] - turned[0][:, :, 1] * turned[1][:, :, 0]
    bad = np.flatnonzero(~(corner.min(axis=1) >= convex * planes.area))
    if len(bad):
        raise FoldedFacetsError(
            f"mortar coupling needs convex facets on the slave surface, but {len(bad)} are folded or have a "
            f"re-entrant corner, among them facet {chosen[bad[0]]}: mesh it better, or make it the master"
        )


class SumsBy:
    """Sums of arrays over the entries with the same number.

    Args:
        number: Group of each entry, shape (n,).
        groups: Number of groups; by default up to the largest that occurs.
    """

    def __init__(self, number: np.ndarray, groups: int | None = None) -> None:
        self.groups, count = groups or int(number.max(initial=-1)) + 1, len(number)
        # By columns, of which each has one entry: there is nothing to sort.
        entries = np.ones(count), number, np.arange(count + 1)
        self._matrix = Csc(entries, shape=(self.groups, count))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the sums of values, shape (n, ...), shape (groups, ...)."""
        shape = values.shape[1:]
        summed = self._matrix @ values.reshape(len(values), math.prod(shape))
        return np.asarray(summed.reshape(len(summed), *shape), dtype=np.float64)
