"""True surfaces over facets: known shapes to a high order, reconstructed ones to the third."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact._surfaces.facets import FacetedSurface, facet_shape_values, faceted_surface, heights
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact._surfaces.true_surface import by_shape, height_over, reconstructed, true_surface
from fenics_contact.gallery import block, hemisphere
from fenics_contact.shapes import Cylinder, Sphere, SurfaceShape, Torus
from tests.pairing.mortar_surfaces import lattice, ticks

TORUS = Torus((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3.0, 1.0)
CYLINDER = Cylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 2.0)
DISC = Sphere((0.0, 0.0), 2.0)

Build = Callable[[str, int], tuple[FacetedSurface, SurfaceShape]]


def torus(kind: str, cells: int) -> tuple[FacetedSurface, SurfaceShape]:
    """A piece of a torus with convex and concave directions, unevenly divided."""
    around, across = ticks(-0.6, 0.5, cells, 0.4), ticks(0.4, 2.6, cells, -0.3)
    u, v = np.meshgrid(around, across, indexing="ij")
    ring = 3.0 + np.cos(v)
    return lattice(np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=-1), kind, True), TORUS


def cylinder(kind: str, cells: int) -> tuple[FacetedSurface, SurfaceShape]:
    """A quarter of a cylinder, or of a circle."""
    angle = ticks(0.2, 1.7, cells, 0.5)
    if kind == "edges":
        return lattice(2.0 * np.column_stack([np.cos(angle), np.sin(angle)]), kind, True), DISC
    u, y = np.meshgrid(angle, ticks(0.0, 1.0, cells, 0.2), indexing="ij")
    points = np.stack([2 * np.sin(u), y, 2 * np.cos(u)], axis=-1)
    return lattice(points, kind, True), CYLINDER


CASES = [(torus, "quads"), (torus, "triangles"), (cylinder, "quads"), (cylinder, "edges")]


def miss(surface: FacetedSurface, shape: SurfaceShape) -> float:
    """Distance between a surface and a shape along the normals, root mean square over many points."""
    rng, found = np.random.default_rng(5), []
    every = np.arange(len(surface.facets))
    for _ in range(8):
        if surface.corners == 3:
            local = rng.dirichlet([1, 1, 1], len(every))[:, 1:]
        else:
            local = rng.uniform(-1, 1, (len(every), surface.dim - 1))
        values, nodes = facet_shape_values(local, surface.corners), surface.facets
        place = np.einsum("nk,nkd->nd", values, surface.points[nodes])
        direction, _ = interpolated_normal(values, surface.normals[nodes])
        found.append(height_over(place, direction, shape) - heights(surface, every, local).value)
    return float(np.sqrt(np.mean(np.square(found))))


def orders(build: Build, kind: str, known: Callable[[FacetedSurface, SurfaceShape], FacetedSurface]) -> float:
    """Observed order of convergence of what a surface misses."""
    misses = []
    for cells in (8, 16):
        surface, shape = build(kind, cells)
        misses.append(miss(known(surface, shape), shape))
    return float(np.log2(misses[0] / misses[1]))


@pytest.mark.parametrize(("build", "kind"), CASES)
def test_facets_miss_a_curved_surface_by_the_second_order(build: Build, kind: str) -> None:
    assert orders(build, kind, lambda surface, _: surface) == pytest.approx(2.0, abs=0.35)


@pytest.mark.parametrize(("build", "kind"), CASES)
def test_a_reconstructed_surface_misses_it_by_the_third_order_or_less(build: Build, kind: str) -> None:
    assert orders(build, kind, lambda surface, _: reconstructed(surface)) > 3.0


@pytest.mark.parametrize(("build", "kind"), CASES)
def test_the_relief_of_a_shape_misses_it_by_the_fourth_order_or_less(build: Build, kind: str) -> None:
    assert orders(build, kind, by_shape) > (3.9 if kind == "triangles" else 4.9)
    surface, shape = build(kind, 16)
    assert miss(by_shape(surface, shape), shape) < 1e-3 * miss(surface, shape)


@pytest.mark.parametrize(("build", "kind"), CASES)
def test_true_normals_are_those_of_the_shape(build: Build, kind: str) -> None:
    surface, shape = build(kind, 8)
    true = by_shape(surface, shape)
    np.testing.assert_allclose(true.normals, shape.normals(surface.points), atol=1e-14)
    assert np.abs(surface.normals - true.normals).max() > 1e-2, "the facets tell as much"


def test_a_surface_that_turns_and_shifts_keeps_its_relief() -> None:
    surface, shape = torus("quads", 8)
    true = by_shape(surface, shape)
    moved = replace(true, points=true.points + np.array([1.0, 2.0, 3.0]))
    every, local = np.arange(len(surface.facets)), np.full((len(surface.facets), 2), 0.3)
    np.testing.assert_allclose(
        heights(moved, every, local).value, heights(true, every, local).value, atol=1e-14
    )


def test_heights_have_the_derivatives_that_they_say() -> None:
    rng, step = np.random.default_rng(2), 1e-6
    for build, kind in CASES:
        surface, shape = build(kind, 6)
        true = by_shape(surface, shape)
        every = np.arange(len(surface.facets))
        local = 0.25 + 0.1 * rng.uniform(-1, 1, (len(every), surface.dim - 1))
        way = rng.uniform(-1, 1, local.shape)
        above, below = (heights(true, every, local + sign * step * way).value for sign in (1, -1))
        slope = np.einsum("na,na->n", heights(true, every, local).by_local, way)
        np.testing.assert_allclose(slope, (above - below) / (2 * step), atol=1e-8)


def roof(kind: str, angle: float) -> FacetedSurface:
    """Two squares of 4 × 4 facets that meet at a crease, in degrees."""
    x = np.linspace(-1, 1, 9)
    u, y = np.meshgrid(x, np.linspace(0, 1, 5), indexing="ij")
    half = np.radians(angle) / 2
    return lattice(np.stack([u * np.cos(half), y, -np.abs(u) * np.sin(half)], axis=-1), kind, True)


@pytest.mark.parametrize("angle", [90.0, 30.0, 1.0])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_creases_stay_as_they_are(kind: str, angle: float) -> None:
    surface = roof(kind, angle)
    every, local = np.arange(len(surface.facets)), np.full((len(surface.facets), 2), 0.2)
    assert np.abs(heights(reconstructed(surface), every, local).value).max() < 1e-13


def test_a_crease_beside_a_round_surface_stays() -> None:
    angle = np.radians(np.array([0, 9, 21, 30, 42, 50, 60]))
    arc = 2.0 * np.column_stack([np.sin(angle), np.cos(angle)])
    along = np.array([np.cos(angle[-1]), -np.sin(angle[-1])])
    for bend, crease in ((0.0, False), (0.5, True)):
        turned = np.array([[np.cos(bend), np.sin(bend)], [-np.sin(bend), np.cos(bend)]]) @ along
        points = np.concatenate([arc, arc[-1] + np.linspace(0.4, 2.0, 5)[:, None] * turned])
        surface = reconstructed(lattice(points, "edges", False))
        found = heights(surface, np.arange(len(surface.facets)), np.zeros((len(surface.facets), 1))).value
        round_ = 2.0 * (1 - np.cos(np.diff(angle) / 2))
        np.testing.assert_allclose(found[:6], round_, rtol=0.1)
        assert np.abs(found[6:]).max() < 1e-12, f"the straight part is bent, crease {crease}"


def test_on_a_plane_of_symmetry_a_surface_goes_on_as_its_mirror_image() -> None:
    angle = np.linspace(0.0, 1.0, 6)
    points = 2.0 * np.column_stack([np.sin(angle), np.cos(angle)])
    facets = np.column_stack([np.arange(1, 6), np.arange(5)])
    mirrored = np.zeros(points.shape, dtype=bool)
    mirrored[0, 0] = True
    surface = reconstructed(faceted_surface(points, facets, mirrored))
    local = np.zeros((5, 1))
    found = heights(surface, np.arange(5), local).value
    assert found[0] == pytest.approx(2.0 * (1 - np.cos(0.1)), rel=2e-3)


def known(mesh: BodyMesh, name: str) -> dict[str, FacetedSurface]:
    """A surface of a mesh in all three ways."""
    ways = ("faceted", "reconstructed", "best")
    return {way: true_surface(mesh, name, way) for way in ways}  # type: ignore[arg-type]


def test_a_scene_takes_the_best_that_is_known_unless_it_asks_for_less() -> None:
    ball = hemisphere(3.0, 4)
    shape = ball.shapes["contact"]
    found = {way: miss(surface, shape) for way, surface in known(ball, "contact").items()}
    assert found["best"] < 0.1 * found["reconstructed"] < 0.1 * 0.2 * found["faceted"]
    bare = known(ball.with_shapes({}), "contact")
    assert miss(bare["best"], shape) == pytest.approx(found["reconstructed"], rel=1e-9)


def test_flat_surfaces_have_no_relief() -> None:
    mesh = block((1e3, 1e3, 1e3), (1e3 + 1, 1e3 + 2, 1e3 + 1), (3, 4, 2))
    named = {
        **mesh.surfaces,
        "top": mesh.surfaces["z1"],
        "two": np.concatenate([mesh.surfaces[s] for s in ("x0", "y0")]),
    }
    mesh = BodyMesh(mesh.points, mesh.cells, named)
    for name in ("top", "two"):
        assert all(surface.relief is None for surface in known(mesh, name).values())
