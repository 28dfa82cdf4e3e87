"""True surfaces beside facets: creased, narrow and folded ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    corner_normals,
    edge_distance,
    facet_shape_values,
    faceted_surface,
    heights,
    outside,
    quadrature_areas,
    shape_functions,
    slopes,
)
from fenics_contact._surfaces.fitting import PolynomialFit
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact._surfaces.tangents import surface_tangents
from fenics_contact._surfaces.true_surface import (
    by_shape,
    height_over,
    reconstructed,
    true_surface,
    without_folds,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, hemisphere
from fenics_contact.shapes import Cylinder, Plane, Sphere, SurfaceShape, Torus
from fenics_contact.shapes.combined import Joined, placed
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


@pytest.mark.parametrize("slope", [0.3, 1e-3, 1e-9])
def test_a_plane_that_meets_its_mirror_image_at_an_angle_is_flat(slope: float) -> None:
    straight = block((0, 0, 0), (1, 2, 1), (3, 4, 2))
    inclined = straight.points + slope * straight.points[:, :1] * [0.0, 0.0, 1.0]
    mesh = BodyMesh(inclined, straight.cells, straight.surfaces)
    at_symmetry = np.zeros(mesh.points.shape, dtype=bool)
    at_symmetry[:, 0] = mesh.points[:, 0] == 0.0
    assert true_surface(mesh, "z1", "best", mirrored=at_symmetry).relief is None
    inclined[:, 2] += 1e-6 * straight.points[:, 0] ** 2
    bent = BodyMesh(inclined, straight.cells, straight.surfaces)
    assert true_surface(bent, "z1", "best").relief is not None


# Curves around plane bodies: outward normals, lengths, local coordinates; and what makes no surface.
def disc(n: int, radius: float = 2.0) -> FacetedSurface:
    """The rim of a disc, counterclockwise, its nodes numbered among others."""
    angle = 2 * np.pi * np.arange(n) / n
    points = np.full((2 * n, 2), 99.0)
    points[1::2] = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    numbers = 2 * np.arange(n) + 1
    return faceted_surface(points, np.column_stack([numbers, np.roll(numbers, -1)]))


def test_the_normals_of_a_disc_point_outwards() -> None:
    rim = disc(12)
    assert (rim.corners, rim.dim) == (2, 2)
    np.testing.assert_array_equal(rim.nodes, 2 * np.arange(12) + 1)
    np.testing.assert_allclose(rim.normals, rim.points / 2.0, atol=1e-14)


def test_nodal_lengths_add_up_to_the_curve() -> None:
    ticks = np.array([0.0, 1.0, 4.0])
    line = faceted_surface(np.column_stack([3 * ticks, 4 * ticks]), np.array([[0, 1], [1, 2]]))
    np.testing.assert_allclose(line.areas, [2.5, 10.0, 7.5])
    np.testing.assert_allclose(quadrature_areas(line.points, line.facets), [5.0, 15.0])
    np.testing.assert_allclose(line.normals, np.tile([0.8, -0.6], (3, 1)))


def test_long_edges_weigh_more_in_the_normal_of_a_corner() -> None:
    bent = faceted_surface(np.array([[0.0, 1], [0, 0], [3, 0]]), np.array([[0, 1], [1, 2]]))
    np.testing.assert_allclose(bent.normals[1], np.array([-1.0, -3.0]) / np.sqrt(10))


def test_shape_functions_of_edges_interpolate_linearly() -> None:
    local = np.array([[-1.0], [0.5], [1.0]])
    values, slopes = shape_functions(local, 2)
    np.testing.assert_allclose(values, [[1, 0], [0.25, 0.75], [0, 1]])
    np.testing.assert_allclose(slopes, np.tile([[[-0.5], [0.5]]], (3, 1, 1)))


def test_local_coordinates_tell_how_far_outside_or_inside_an_edge_a_point_lies() -> None:
    local = np.array([[-1.5], [-0.25], [1.0], [2.0]])
    np.testing.assert_allclose(outside(local, 2), [0.5, 0, 0, 1])
    np.testing.assert_allclose(edge_distance(local[1:3], 2), [0.75, 0])


@pytest.mark.parametrize(("corners", "dim"), [(2, 3), (3, 2), (4, 2), (6, 3)])
def test_facets_of_another_dimension_make_no_surface(corners: int, dim: int) -> None:
    with pytest.raises(InvalidInputError, match=f"{corners} corners and points with {dim} coordinates"):
        faceted_surface(np.eye(6, dim), np.arange(corners)[None])


# Surfaces of several shapes: at a crease each facet keeps to its own, elsewhere they go over smoothly.
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


# Surfaces one or two layers of facets wide: their normals do not depend on how they lie in space.
def orientations() -> Iterator[np.ndarray]:
    """The 24 rotations of a cube and one of no symmetry."""
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.eye(3)[list(order)] * signs
        if np.linalg.det(turn) > 0:
            yield turn
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    yield turn * np.sign(np.linalg.det(turn))


def ways(cells: int, layers: int, width: float, uneven: float) -> tuple[np.ndarray, np.ndarray]:
    """Parameters along and across a strip of length π/2, nodes moved by a fraction of the edges."""
    along, across = np.meshgrid(
        np.linspace(0, np.pi / 2, cells + 1), np.linspace(0, width, layers + 1), indexing="ij"
    )
    edge = min(np.pi / 2 / cells, width / layers)
    moved = uneven * edge * np.random.default_rng(7).uniform(-1, 1, (2, *along.shape))
    moved[0, [0, -1]] = 0.0
    return along + moved[0], across + moved[1]


def sheet(name: str, t: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals of a surface of radius 2 around y; t goes around, s across."""
    if name == "helix":  # a strip that winds around a cylinder
        t, s = t * np.cos(0.5) - s * np.sin(0.5), t * np.sin(0.5) + s * np.cos(0.5)
    high = s / 2 + 0.3
    # radius, height, and outward normal of the meridian
    meridian = {
        "cone": (2 - s * np.sin(0.4), s * np.cos(0.4), np.cos(0.4) + 0 * s, np.sin(0.4) + 0 * s),
        "torus": (1 + np.cos(s + 0.2), np.sin(s + 0.2), np.cos(s + 0.2), np.sin(s + 0.2)),
        "sphere": (2 * np.cos(high), 2 * np.sin(high), np.cos(high), np.sin(high)),
    }
    if name == "plane":
        return np.stack([t, s, 0 * t], axis=-1), np.stack([0 * t, 0 * t, 1 + 0 * t], axis=-1)
    radius, height, out, up = meridian.get(name, (2 + 0 * s, s, 1 + 0 * s, 0 * s))
    return (
        np.stack([radius * np.sin(t), height, radius * np.cos(t)], axis=-1),
        np.stack([out * np.sin(t), up, out * np.cos(t)], axis=-1),
    )


def lean(found: np.ndarray, normals: np.ndarray) -> float:
    """Largest angle between found and true normals."""
    return float(2 * np.arcsin(np.linalg.norm(found - normals, axis=-1).max() / 2))


def strip(kind: str, cells: int, layers: int, turn: np.ndarray) -> FacetedSurface:
    """A quarter of a cylinder of radius 2 around y, turned."""
    angle, y = np.meshgrid(np.linspace(0, np.pi / 2, cells + 1), np.linspace(0, 1, layers + 1), indexing="ij")
    return lattice(np.stack([2 * np.sin(angle), y, 2 * np.cos(angle)], axis=-1) @ turn.T, kind, True)


def narrow_miss(surface: FacetedSurface, turn: np.ndarray) -> float:
    """Largest error of a strip's normals."""
    radial = surface.points @ turn * [0.5, 0.0, 0.5]
    return float(np.abs(surface.normals @ turn - radial).max())


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("order", [2, 3])
def test_a_narrow_strip_has_radial_normals_in_every_orientation(kind: str, layers: int, order: int) -> None:
    misses = np.array(
        [
            [narrow_miss(reconstructed(strip(kind, cells, layers, turn), order), turn) for cells in (8, 16)]
            for turn in orientations()
        ]
    )
    assert misses.shape == (25, 2)
    np.testing.assert_allclose(misses, np.broadcast_to(misses[0], misses.shape), atol=1e-11)
    assert np.log2(misses[0, 0] / misses[0, 1]) > 2.9
    assert misses[0, 1] < 2e-2 * narrow_miss(strip(kind, 16, layers, np.eye(3)), np.eye(3)), (
        "as good as facets"
    )


def slid(surface: FacetedSurface) -> np.ndarray:
    """Normals at the nodes of the patches of surfaces that slide."""
    found = surface_tangents(surface)
    first, second = np.moveaxis((found.derivatives @ surface.points).reshape(-1, 2, 3), 1, 0)
    normals, out = np.empty_like(surface.points), np.cross(first, second)
    normals[surface.facets.ravel()] = out[found.of_corner.ravel()]
    normals *= np.sign(np.einsum("nd,nd->n", normals, surface.averaged))[:, None]  # in bases of either hand
    return normals / np.linalg.norm(normals, axis=1)[:, None]


#: How uneven the nodes are, in edges, and what is missed at most, in parts of what facets miss.
STRIPS = {
    "plane": (0.2, 0.0),
    "cylinder": (0.2, 0.02),
    "cone": (0.1, 0.08),
    "helix": (0.1, 0.06),
    "torus": (0.01, 1.0),
    "sphere": (0.01, 1.0),
}


@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("name", STRIPS)
def test_the_normals_of_one_layer_lean_alike_in_every_orientation(name: str, kind: str) -> None:
    """Developable surfaces are found; how others bend across one layer cannot be known, by facets neither."""
    uneven, part = STRIPS[name]
    points, normals = sheet(name, *ways(16, 1, 0.5, uneven))
    leans = []
    for turn in orientations():
        surface = lattice(points @ turn.T, kind, True)
        found = reconstructed(surface).normals, slid(surface), surface.averaged
        leans.append([lean(each @ turn, normals.reshape(-1, 3)) for each in found])
    first = leans[0]
    assert np.shape(leans) == (25, 3)
    np.testing.assert_allclose(leans, np.broadcast_to(first, np.shape(leans)), atol=1e-8)
    assert max(first[:2]) <= part * first[2] + 1e-9, first


@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("name", ["cylinder", "cone", "helix"])
def test_normals_of_a_developable_layer_are_of_the_second_order_in_the_edges(name: str, kind: str) -> None:
    misses = []
    for cells, width in ((8, 0.4), (16, 0.2), (32, 0.1)):
        points, normals = sheet(name, *ways(cells, 1, width, 0.01))
        misses.append(lean(reconstructed(lattice(points, kind, True)).normals, normals.reshape(-1, 3)))
    assert np.log2(np.divide(misses[:-1], misses[1:])).min() > 1.8


@pytest.mark.parametrize("order", [2, 3])
def test_what_the_nodes_determine_is_fitted_by_least_squares_alone(order: int) -> None:
    """On a lattice of four rows of uneven nodes."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-3.0, 4.0), np.arange(-1.0, 3.0)))
    place = np.column_stack([x, y])[(x != 0) | (y != 0)] / 3
    place += 0.01 * np.random.default_rng(1).normal(size=place.shape)
    x, y = place.T
    height = x + 0.3 * x**2 - 0.2 * x * y + 0.1 * y**2 + 0.05 * np.cos(3 * x + y)
    fit = PolynomialFit.of(place, height, np.zeros(27, dtype=int), np.zeros(1, dtype=bool), order)
    powers = [(k - m, m) for k in range(1, order + 1) for m in range(k + 1)]
    rows = np.column_stack([x**a * y**b for a, b in powers]) / np.linalg.norm(place, axis=1)[:, None]
    expected = np.linalg.lstsq(rows, height / np.linalg.norm(place, axis=1), rcond=None)[0]
    np.testing.assert_allclose(fit.coefficients(height)[0], expected, atol=1e-10)


@pytest.mark.parametrize("corners", [3, 4])
def test_one_twisted_facet_alone_is_the_same_surface_in_every_orientation(corners: int) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [1.1, 1.0, -0.2], [0.0, 0.9, 0.2]])[:corners]
    facet = np.arange(corners)[None]
    found = []
    for turn in orientations():
        relief = reconstructed(faceted_surface(points @ turn.T, facet)).relief
        assert relief is not None
        found.append(np.concatenate([relief.corners[0] @ turn, relief.normals @ turn]))
    np.testing.assert_allclose(found, np.broadcast_to(found[0], np.shape(found)), atol=1e-12)


def test_the_next_order_adds_what_an_arc_is_higher_than_its_cubic() -> None:
    """The arc of angle a is a⁴ / 128 of its radius higher in its middle than Hermite's cubic."""
    angle = np.linspace(0.0, 1.2, 25)
    arc = lattice(np.column_stack([np.cos(angle), np.sin(angle)])[::-1], "edges", False)
    for sign, surface in ((1.0, arc), (-1.0, faceted_surface(arc.points, arc.facets[:, ::-1]))):
        relief = reconstructed(surface, 3).relief
        assert relief is not None
        np.testing.assert_allclose(relief.rest, sign * angle[1] ** 4 / 128, rtol=0.02)


# Where a surface would fold it stays flat, and where a shape has no point above a facet that is said.
def bump(kind: str) -> FacetedSurface:
    """A shallow bump."""
    x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 7), indexing="ij")
    points = np.stack([x, y, 0.1 * np.sin(3 * x) * np.cos(2 * y)], axis=-1)
    if kind == "edges":
        return lattice(np.ascontiguousarray(points[:, 0, ::2]), kind, True)
    return lattice(points, kind, True)


def middles(surface: FacetedSurface) -> np.ndarray:
    """Heights somewhere on each facet."""
    every = np.arange(len(surface.facets))
    return heights(surface, every, np.full((len(every), surface.dim - 1), 0.25)).value


@pytest.mark.parametrize("kind", ["quads", "triangles", "edges"])
@pytest.mark.parametrize("over", ["steep", "folded back"])
def test_facets_with_a_fold_stay_flat_and_others_as_they_are(kind: str, over: str) -> None:
    smooth = reconstructed(bump(kind))
    relief = smooth.relief
    assert relief is not None
    assert relief.flattened == 0
    assert without_folds(smooth) is smooth
    corners = relief.corners.copy()
    edge = smooth.points[smooth.facets[2, 1]] - smooth.points[smooth.facets[2, 0]]
    normal = smooth.averaged[smooth.facets[2, 0]]
    turned = normal + 2.0 * edge / np.linalg.norm(edge) if over == "steep" else -normal
    corners[2, 0] = turned / np.linalg.norm(turned) - normal
    found = without_folds(replace(smooth, relief=replace(relief, corners=corners)))
    assert found.relief is not None
    assert found.relief.flattened == 1
    np.testing.assert_allclose(slopes(found, np.array([2])), 0.0, atol=1e-15)
    assert abs(middles(smooth)[2]) > 1e-4
    np.testing.assert_allclose(np.delete(middles(found), 2), np.delete(middles(smooth), 2), rtol=1e-12)
    assert abs(middles(found)[2]) < 1e-15


def test_a_direction_along_a_shape_is_refused() -> None:
    wire = Cylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0)
    points, up = np.array([[0.3, 0.0, 1.1], [0.0, 0.2, 0.9]]), np.array([[0.0, 0.0, 1.0]] * 2)
    top = np.sqrt(1.0 - points[:, 0] ** 2)
    np.testing.assert_allclose(height_over(points, up, wire), top - points[:, 2], atol=1e-12)
    with pytest.raises(
        InvalidInputError,
        match=r"at 1 of 2 points Cylinder is nearly parallel to .* of the facets, the first at \(0, 0.2",
    ):
        height_over(points, np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.01]]), wire)
