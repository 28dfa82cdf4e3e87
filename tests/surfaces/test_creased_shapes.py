"""Surfaces of several shapes: at a crease each facet keeps to its own, elsewhere they go over smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.geometry import Cylinder, Joined, Plane, SurfaceShape, placed
from fenics_contact.surfaces.facets import FacetedSurface, shape_values
from fenics_contact.surfaces.projection import interpolated_normal
from fenics_contact.surfaces.relief import corner_normals, heights
from fenics_contact.surfaces.true_surface import by_shape, height_over
from tests.feti.mortar_surfaces import lattice

CAN = (Cylinder((0, 0, 0), (0, 0, 1), 2.0), Plane((0, 0, 0), (0, 0, 1)))
FILLET = (Cylinder((0, 0, 0), (0, 1, 0), 1.0), Plane((0, 0, 1), (0, 0, 1)))


def can(kind: str, cells: int) -> FacetedSurface:
    """Side and lid of a can around a piece of its rim."""
    angle, along = np.meshgrid(np.linspace(0.2, 1.2, cells + 1), np.linspace(-1, 1, cells + 1), indexing="ij")
    radius = 2.0 - np.maximum(along, 0.0)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.minimum(along, 0.0)], axis=-1)
    return lattice(points, kind, True)


def rounded(kind: str, cells: int) -> FacetedSurface:
    """A flat top that a quarter of a cylinder goes over into."""
    along, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    angle = np.maximum(along, 0.0)
    points = np.stack([np.sin(angle) + np.minimum(along, 0.0), y, np.cos(angle)], axis=-1)
    return lattice(points, kind, True)


def joined(surface: FacetedSurface, shapes: tuple[SurfaceShape, ...]) -> tuple[Joined, np.ndarray]:
    """Return the shape of a surface, and the number of the shape of each facet."""
    corners = surface.points[surface.facets]
    first = (
        (np.abs(shapes[0].distance(corners.reshape(-1, 3))) < 1e-12).reshape(corners.shape[:2]).all(axis=1)
    )
    assert first.any()
    assert not first.all()
    return Joined(shapes, (corners[first], corners[~first])), np.where(first, 0, 1)


def misses(surface: FacetedSurface, shapes: tuple[SurfaceShape, ...], part: np.ndarray) -> float:
    """Distance between each facet and its shape along the normals, root mean square over many points."""
    rng, every, found = np.random.default_rng(5), np.arange(len(surface.facets)), []
    for _ in range(8):
        if surface.corners == 3:
            local = rng.dirichlet([1, 1, 1], len(every))[:, 1:]
        else:
            local = rng.uniform(-1, 1, (len(every), 2))
        values, nodes = shape_values(local, surface.corners), surface.facets
        place = np.einsum("nk,nkd->nd", values, surface.points[nodes])
        direction, _ = interpolated_normal(values, surface.normals[nodes])
        value = heights(surface, every, local).value
        for number, shape in enumerate(shapes):
            mine = part == number
            found.append(height_over(place[mine], direction[mine], shape) - value[mine])
    return float(np.sqrt(np.mean(np.square(np.concatenate(found)))))


@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_facets_on_both_sides_of_a_crease_follow_their_own_shape(kind: str) -> None:
    found = []
    for cells in (8, 16):
        surface = can(kind, cells)
        shape, part = joined(surface, CAN)
        true = by_shape(surface, shape)
        found.append(misses(true, CAN, part))
        assert found[-1] < 0.01 * misses(surface, CAN, part)
    assert np.log2(found[0] / found[1]) > 2.3
    own = np.array([each.normals(surface.points[surface.facets].reshape(-1, 3)) for each in CAN])
    own = own.reshape(2, *surface.facets.shape, 3)[part, np.arange(len(part))]
    np.testing.assert_allclose(corner_normals(true, np.arange(len(part))), own, atol=1e-12)
    rim = (surface.points[:, 2] == 0) & (np.hypot(*surface.points[:, :2].T) > 2 - 1e-9)
    assert rim.sum() == 17
    np.testing.assert_allclose(true.normals[rim], surface.averaged[rim], atol=1e-14)


@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_where_shapes_touch_smoothly_there_is_no_crease(kind: str) -> None:
    surface = rounded(kind, 8)
    shape, part = joined(surface, FILLET)
    true = by_shape(surface, shape)
    np.testing.assert_allclose(true.normals, shape.normals(surface.points), atol=1e-12)
    np.testing.assert_allclose(
        corner_normals(true, np.arange(len(part))), true.normals[surface.facets], atol=1e-12
    )
    assert misses(true, FILLET, part) < 1e-2 * misses(surface, FILLET, part)


def test_joined_shapes_move_with_their_facets() -> None:
    surface = can("quads", 4)
    shape, _ = joined(surface, CAN)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = placed(shape, turn, (1.0, 2.0, 3.0), 2.0)
    x = np.random.default_rng(3).uniform(-1.0, 3.0, (200, 3))
    there = 2.0 * x @ turn.T + np.array([1.0, 2.0, 3.0])
    assert isinstance(moved, Joined)
    np.testing.assert_allclose(moved.distance(there), 2.0 * shape.distance(x), atol=1e-13)
