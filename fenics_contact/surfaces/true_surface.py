"""The surface that facets represent: of a known shape, reconstructed, or the facets themselves."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from typing import Literal, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh, computed_rounding
from fenics_contact.surface_shapes import Joined, SurfaceShape, evaluate_shape
from fenics_contact.surfaces.facets import FacetedSurface, Relief, facet_shape_values, faceted_surface
from fenics_contact.surfaces.projection import interpolated_normal
from fenics_contact.surfaces.reconstruction import reconstructed
from fenics_contact.surfaces.relief import edges_at_corners, heights, slopes

#: Representation of a surface between its nodes, see `fenics_contact.scene.ContactPair`.
Geometry: TypeAlias = Literal["best", "reconstructed", "faceted"]

_KNOWN: WeakKeyDictionary[BodyMesh, dict[Hashable, Relief | None]] = WeakKeyDictionary()
"""Reliefs of the surfaces of meshes, shared with reshaped meshes."""

#: Newton steps along a ray to a shape; distances are nearly linear there.
STEPS = 12
#: Directions count as tangential to a shape if the cosine of their angle to its normal is below this.
ALONG = 0.02
#: Largest angle in radians between the normals of shapes that meet smoothly.
CREASE = 0.02
#: A true surface has no relief if its height over the facets is below this multiple of their size.
FLAT = 1e-12


def true_surface(
    mesh: BodyMesh,
    name: str,
    geometry: Geometry,
    *,
    mirrored: np.ndarray | None = None,
    finer: bool = False,
) -> FacetedSurface:
    """Return a surface of a mesh with its normals and its relief: linear facets through its nodes.

    Args:
        mesh: The mesh.
        name: Name of the surface.
        geometry: Its representation between the nodes.
        mirrored: Which nodes lie on a plane of symmetry normal to each axis, shape (n_nodes, dim).
        finer: Use a better representation, to estimate the error: the shape, or a reconstruction of the next
            order.
    """
    marks = np.zeros(mesh.points.shape, dtype=bool) if mirrored is None else mirrored
    surface = faceted_surface(mesh.points, mesh.linear.surfaces[name], marks)
    surface = _with_areas(surface, mesh, name)
    order = 2
    if finer:
        order, geometry = (2 if geometry == "faceted" else 3), "best"
    if geometry == "faceted":
        return surface
    key = (name, geometry, order, marks.tobytes())
    known = _KNOWN.setdefault(mesh.origin, {})
    if key not in known:
        shape = mesh.origin.shapes.get(name) if geometry == "best" else None
        known[key] = _relief(mesh.origin, name, marks, shape, order)
    return replace(surface, relief=known[key])


def _with_areas(surface: FacetedSurface, mesh: BodyMesh, name: str) -> FacetedSurface:
    """Distribute the area of quadratic facets over the nodes on which a uniform pressure bears."""
    if mesh.order == 1:
        return surface
    facets = mesh.surfaces[name]
    surface = replace(surface, whole=np.searchsorted(surface.nodes, facets))
    return replace(surface, areas=surface.areas_at(surface.points))


def _relief(
    mesh: BodyMesh, name: str, marks: np.ndarray, shape: SurfaceShape | None, order: int
) -> Relief | None:
    surface = faceted_surface(mesh.points, mesh.linear.surfaces[name], marks)
    raised = reconstructed(surface, order) if shape is None else by_shape(surface, shape)
    return None if _is_flat(raised) else raised.relief


def _is_flat(surface: FacetedSurface) -> bool:
    """Return whether the facets coincide with the surface, up to rounding."""
    relief = surface.relief
    assert relief is not None
    edges = np.linalg.norm(edges_at_corners(surface.points[surface.facets]), axis=3)
    limit = FLAT * edges.min() + computed_rounding(surface.points)
    bends = np.abs(slopes(surface, np.arange(len(surface.facets)))).max(), np.abs(relief.rest).max()
    return bool(max(bends) <= limit and np.abs(relief.normals).max() <= limit / edges.min())


def by_shape(surface: FacetedSurface, shape: SurfaceShape) -> FacetedSurface:
    """Return a surface with the relief of the shape on which its nodes lie.

    Nodes slightly off the shape are not moved; the heights between them are relative to them. Where several
    shapes meet in a crease, or one its mirror image, each facet uses its own.

    Args:
        surface: Facets without relief.
        shape: The shape.
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
    normals = _unit(np.where(surface.mirrored, 0.0, normals))
    turned = np.einsum("nkd,nkd->nk", corners, normals[surface.facets]) < np.cos(CREASE)
    creased = np.isin(np.arange(len(normals)), surface.facets[turned])
    normals[creased] = surface.averaged[creased]
    smooth = ~creased[surface.facets]
    corners[smooth] = normals[surface.facets[smooth]]
    return _fitted(surface, parts, normals, corners)


def _parts(shape: SurfaceShape, middles: np.ndarray) -> list[tuple[SurfaceShape, np.ndarray]]:
    """Return the parts of a joined shape, and the facets of each, by their middles."""
    if not isinstance(shape, Joined):
        return [(shape, np.ones(len(middles), dtype=bool))]
    nearest = shape.nearest(middles)
    return [(part, nearest == n) for n, part in enumerate(shape.shapes) if (nearest == n).any()]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _fitted(
    surface: FacetedSurface,
    parts: list[tuple[SurfaceShape, np.ndarray]],
    normals: np.ndarray,
    corners: np.ndarray,
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


def height_over(points: np.ndarray, directions: np.ndarray, shape: SurfaceShape) -> np.ndarray:
    """Return the distances from points along directions to a shape, shape (n,), [length].

    Args:
        points: Points near the shape, shape (n, dim), [length].
        directions: Unit vectors that point out of it, shape (n, dim).
        shape: The shape.

    Raises:
        InvalidInputError: If a direction is tangential to the shape, so that no unique point lies above.
    """
    height = np.zeros(len(points))
    for _ in range(STEPS):
        place = points + height[:, None] * directions
        step = evaluate_shape(shape, "distance", place)
        cosine = np.einsum("nd,nd->n", evaluate_shape(shape, "normals", place), directions)
        _check_across(cosine, place, shape)
        step /= cosine
        height -= step
        if np.abs(step).max(initial=0.0) <= FLAT * np.ptp(points, axis=0).max(initial=0.0):
            break
    return height


def _check_across(cosine: np.ndarray, place: np.ndarray, shape: SurfaceShape) -> None:
    """Reject directions that are tangential to a shape."""
    along = np.abs(cosine) < ALONG
    if along.any():
        where = ", ".join(f"{x:.6g}" for x in place[np.argmax(along)])
        raise InvalidInputError(
            f"each point of a facet needs one point of its shape above it, but at {np.count_nonzero(along)} "
            f"of {len(along)} points {type(shape).__name__} is nearly parallel to the normal of the facets, "
            f"the first at ({where}): refine the mesh there, give the surface another shape, or let the pair "
            "take geometry='reconstructed'"
        )
