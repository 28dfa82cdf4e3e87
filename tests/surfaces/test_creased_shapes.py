"""Surfaces of several shapes: at a crease each facet keeps to its own, elsewhere they go over smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._surfaces.facets import (
    FacetedSurface,
    corner_normals,
    facet_shape_values,
    faceted_surface,
    heights,
)
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact._surfaces.true_surface import by_shape, height_over, reconstructed
from fenics_contact.shapes import Cylinder, Plane, SurfaceShape
from fenics_contact.shapes.combined import Joined, placed
from tests.pairing.mortar_surfaces import lattice

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
        values, nodes = facet_shape_values(local, surface.corners), surface.facets
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


def arch(kind: str, shift: float, *, half: bool) -> tuple[FacetedSurface, SurfaceShape]:
    """A pointed arch of two cylinders, or its half beside the plane of symmetry y = 0 with its own one."""
    x, y = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 7))
    points = np.stack([x, y, np.sqrt(4.0 - (y + shift) ** 2)], axis=-1).transpose(1, 0, 2)
    surface = lattice(points, kind, True)
    right, left = (Cylinder((0, sign * shift, 0), (1, 0, 0), 2.0) for sign in (-1, 1))
    mirrored = np.zeros(surface.points.shape, dtype=bool)
    mirrored[surface.points[:, 1] == 0.0, 1] = True
    if half:
        return faceted_surface(surface.points, surface.facets, mirrored), right
    on_plane, count = mirrored[:, 1], len(surface.points)
    image = np.where(on_plane, np.arange(count), count + np.cumsum(~on_plane) - 1)
    both = np.concatenate([surface.points, surface.points[~on_plane] * (1, -1, 1)])
    facets = np.concatenate([surface.facets, image[surface.facets[:, ::-1]]])
    corners = np.split(both[facets], 2)
    return faceted_surface(both, facets), Joined((right, left), corners)


@pytest.mark.parametrize("known", ["shape", "nodes"])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_half_an_arch_is_half_of_the_whole(kind: str, known: str) -> None:
    """At the plane of symmetry there is a crease with the mirror image, whose normals lie in the plane."""
    true = []
    for half in (False, True):
        surface, shape = arch(kind, 0.8, half=half)
        true.append(by_shape(surface, shape) if known == "shape" else reconstructed(surface))
    whole, part = true
    facets = np.arange(len(part.facets))
    np.testing.assert_array_equal(part.facets, whole.facets[facets])
    np.testing.assert_allclose(part.normals, whole.normals[: len(part.normals)], atol=1e-12)
    np.testing.assert_allclose(corner_normals(part, facets), corner_normals(whole, facets), atol=1e-12)
    for local in np.random.default_rng(4).uniform(0.1, 0.4, (4, 2)):
        at = np.tile(local, (len(facets), 1))
        found, wanted = heights(part, facets, at).value, heights(whole, facets, at).value
        assert np.abs(wanted).max() > 1e-3
        np.testing.assert_allclose(found, wanted, atol=1e-12)
    ridge = part.mirrored.any(axis=1)
    np.testing.assert_array_equal(part.normals[ridge, 1], 0.0)
    assert np.abs(corner_normals(part, facets)[ridge[part.facets]][:, 1]).min() > 0.2, "it has no ridge"


@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_a_shape_that_a_plane_of_symmetry_cuts_squarely_has_no_ridge_there(kind: str) -> None:
    surface, shape = arch(kind, 0.0, half=True)
    true = by_shape(surface, shape)
    np.testing.assert_allclose(true.normals, shape.normals(surface.points), atol=1e-12)
    np.testing.assert_allclose(
        corner_normals(true, np.arange(len(true.facets))), true.normals[true.facets], atol=1e-12
    )


def test_joined_shapes_move_with_their_facets() -> None:
    surface = can("quads", 4)
    shape, _ = joined(surface, CAN)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = placed(shape, turn, (1.0, 2.0, 3.0), 2.0)
    x = np.random.default_rng(3).uniform(-1.0, 3.0, (200, 3))
    there = 2.0 * x @ turn.T + np.array([1.0, 2.0, 3.0])
    assert isinstance(moved, Joined)
    np.testing.assert_allclose(moved.distance(there), 2.0 * shape.distance(x), atol=1e-13)
