"""Points project onto faceted surfaces exactly on planes, ever better on curved ones, and without jumps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fenics_contact._surfaces import projection as searched
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface, quadrature_areas, shape_functions
from fenics_contact._surfaces.projection import Projection, project
from fenics_contact.errors import InvalidInputError

CORNERS = [4, 3]
Height = Callable[[np.ndarray, np.ndarray], np.ndarray]


def sphere(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.sqrt(1.0 - x**2 - y**2)


def cylinder(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.sqrt(1.0 - x**2) + 0.0 * y


def lattice(x: np.ndarray, y: np.ndarray, z: np.ndarray, corners: int) -> FacetedSurface:
    """The surface over a lattice of points (ij-indexed), seen from above."""
    number = np.arange(x.size).reshape(x.shape)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(
        -1, 4
    )
    facets = quads if corners == 4 else quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return faceted_surface(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), facets)


def cap(height: Height, n: int, corners: int) -> FacetedSurface:
    """A piece of a unit sphere or cylinder over a square of side 1.2, smoothly uneven."""
    ticks = np.linspace(-0.6, 0.6, n + 1)
    x, y = np.meshgrid(ticks + 0.05 * np.sin(4 * ticks), ticks - 0.04 * np.cos(3 * ticks), indexing="ij")
    return lattice(x, y, height(x, y), corners)


def downwards(count: int) -> np.ndarray:
    return np.tile([0.0, 0.0, -1.0], (count, 1))


def foot(found: Projection, surface: FacetedSurface) -> np.ndarray:
    values, _ = shape_functions(found.local, surface.corners)
    return np.einsum("nk,nkd->nd", values, surface.points[surface.facets[found.facet]])


@pytest.mark.parametrize("corners", CORNERS)
def test_planes_are_exact(corners: int) -> None:
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.linspace(0, 3, 13), np.linspace(0, 2, 9), indexing="ij")
    x, y = x + rng.uniform(-0.06, 0.06, x.shape), y + rng.uniform(-0.06, 0.06, y.shape)
    plane = lattice(x, y, np.zeros_like(x), corners)
    points = np.column_stack(
        [rng.uniform(0.1, 2.9, 300), rng.uniform(0.1, 1.9, 300), rng.uniform(-0.5, 2, 300)]
    )
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    turned = faceted_surface(plane.points @ turn.T, plane.facets)
    found = project(points @ turn.T, downwards(300) @ turn.T, turned)
    np.testing.assert_array_equal(found.point, np.arange(300))
    np.testing.assert_allclose(found.gap, points[:, 2], atol=1e-13)
    np.testing.assert_allclose(found.normal, np.tile(turn[:, 2], (300, 1)), atol=1e-13)
    np.testing.assert_allclose(foot(found, turned) @ turn, points * [1, 1, 0], atol=1e-13)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("height", [sphere, cylinder])
def test_distance_and_normal_converge_with_second_order(height: Height, corners: int) -> None:
    rng = np.random.default_rng(2)
    direction = np.column_stack([rng.uniform(-0.3, 0.3, (50, 2)), np.ones(50)])
    if height is cylinder:
        direction[:, 1] = 0.0
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    distance = rng.uniform(-0.05, 0.2, 50)
    points = (1 + distance)[:, None] * direction
    errors = []
    for n in (8, 16, 32, 64):
        found = project(points, -direction, cap(height, n, corners))
        assert len(found.point) == 50
        errors.append([np.abs(found.gap - distance).max(), np.abs(found.normal - direction).max()])
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates[-1].min() > 1.8, f"orders of gap and normal: {rates}"
    assert errors[0][0] > 1e-4, "the coarse surface is too good: nothing was tested"


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("level", [0.04, 0.0, -0.03])
def test_gap_normal_and_weights_do_not_jump_between_facets(corners: int, level: float) -> None:
    surface = cap(sphere, 7, corners)

    def along(steps: int) -> tuple[Projection, np.ndarray]:
        t = np.linspace(-0.4, 0.4, steps + 1)
        x, y = t, 0.3 * np.sin(3 * t + 0.4)
        found = project(np.column_stack([x, y, sphere(x, y) + level]), downwards(steps + 1), surface)
        assert len(found.point) == steps + 1, "a point between two facets was lost"
        weights = np.zeros((steps + 1, len(surface.points)))
        values, _ = shape_functions(found.local, corners)
        np.add.at(weights, (np.arange(steps + 1)[:, None], surface.facets[found.facet]), values)
        return found, np.column_stack([found.gap, found.normal, weights])

    found, coarse = along(400)
    assert len(np.unique(found.facet)) > 6, "hardly an edge was crossed"
    jumps = [np.abs(np.diff(field, axis=0)).max(axis=0) for field in (coarse, along(3200)[1])]
    assert (jumps[1] < jumps[0] / 6 + 1e-12).all()


@pytest.mark.parametrize("corners", CORNERS)
def test_nodes_of_the_surface_itself_project_onto_themselves(corners: int) -> None:
    surface = cap(sphere, 6, corners)
    found = project(surface.points, -surface.normals, surface)
    np.testing.assert_array_equal(found.point, np.arange(len(surface.points)))
    np.testing.assert_allclose(foot(found, surface), surface.points, atol=1e-12)
    np.testing.assert_allclose(found.gap, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.normal, surface.normals, atol=1e-9)


def test_points_beyond_the_rim_have_no_projection() -> None:
    x, y = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    points = np.array([[0.5, 0.5, 0.1], [1.02, 0.5, 0.1], [0.5, -0.02, 0.1], [1.0, 1.0, 0.1]])
    found = project(points, downwards(4), lattice(x, y, 0 * x, 4))
    assert found.point.tolist() == [0, 3]


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("gap", [0.05, -0.05])
def test_nodes_in_a_plane_of_symmetry_meet_the_half_that_is_meshed(corners: int, gap: float) -> None:
    """The averaged normals of the half lean out of that plane, and away from every point above it."""
    x, y = np.meshgrid(np.linspace(0.0, 0.6, 7), np.linspace(-0.3, 0.3, 7), indexing="ij")
    half = lattice(x, y, cylinder(x, y), corners)
    assert half.normals[np.isclose(half.points[:, 0], 0.0), 0].min() > 0.04
    along = np.linspace(-0.29, 0.29, 30)
    points = np.column_stack([np.zeros(30), along, np.full(30, 1.0 + gap)])
    found = project(points, downwards(30), half)
    np.testing.assert_array_equal(found.point, np.arange(30))
    np.testing.assert_allclose(found.gap, gap, atol=2e-3 * abs(gap))
    np.testing.assert_allclose(foot(found, half), [[0.0, y, 1.0] for y in along], atol=0.06 * abs(gap))


@pytest.mark.parametrize("corners", CORNERS)
def test_points_meet_the_continuation_of_a_surface_for_a_twentieth_of_a_facet(corners: int) -> None:
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5), indexing="ij")
    plane = lattice(x, y, np.zeros_like(x), corners)
    beside = np.array([0.0, 0.01, 0.0124, 0.0126, 0.1])
    points = np.column_stack([1.0 + beside, np.full(5, 0.55), np.full(5, 0.3)])
    found = project(points, downwards(5), plane)
    np.testing.assert_array_equal(found.point, [0, 1, 2])
    np.testing.assert_allclose(foot(found, plane), points[:3] * [1, 1, 0], atol=1e-13)


def test_surfaces_that_face_the_same_way_do_not_touch() -> None:
    surface = cap(sphere, 5, 4)
    point = np.array([[0.0, 0.0, 1.1]])
    assert len(project(point, -downwards(1), surface).point) == 0
    assert len(project(point, downwards(1), surface).point) == 1


def test_the_nearer_of_two_sheets_is_met() -> None:
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    upper, lower = lattice(x, y, 0 * x, 4), lattice(x, y, 0 * x - 0.2, 4)
    both = faceted_surface(
        np.vstack([lower.points, upper.points]), np.vstack([lower.facets, upper.facets + 25])
    )
    points = np.array([[0.4, 0.3, 0.05], [0.4, 0.3, -0.15]])
    assert project(points, downwards(2), both).gap == pytest.approx([0.05, 0.05])


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("cells", [4, 40])
def test_no_point_is_lost_where_large_facets_meet_small_ones(corners: int, cells: int) -> None:
    ticks = np.concatenate([[0.0], np.linspace(1, 2, cells + 1)])
    x, y = np.meshgrid(ticks, np.linspace(0, 2, 2 * cells + 1), indexing="ij")
    points = np.random.default_rng(0).uniform([0, 0, 0.01], [2, 2, 0.01], (500, 3))
    found = project(points, downwards(500), lattice(x, y, 0 * x, corners))
    np.testing.assert_array_equal(found.point, np.arange(500))


def test_no_points_have_no_projections() -> None:
    found = project(np.zeros((0, 3)), np.zeros((0, 3)), cap(sphere, 4, 4))
    assert len(found.point) == len(found.gap) == 0


@pytest.mark.parametrize("corners", CORNERS)
def test_nodal_areas_add_up_to_the_surface(corners: int) -> None:
    x, y = np.meshgrid(np.linspace(0, 3, 5), np.linspace(0, 2, 4), indexing="ij")
    tilted = lattice(x, y, 0.75 * x, corners)
    assert tilted.areas.sum() == pytest.approx(1.25 * 6)
    assert quadrature_areas(tilted.points, tilted.facets).sum() == pytest.approx(1.25 * 6)
    np.testing.assert_allclose(tilted.normals, np.tile([-0.6, 0.0, 0.8], (20, 1)), atol=1e-14)


@pytest.mark.parametrize("corners", CORNERS)
def test_shape_functions_add_up_to_one_and_their_slopes_are_right(corners: int) -> None:
    local = np.random.default_rng(7).uniform(0, 0.5, (10, 2))
    values, slopes = shape_functions(local, corners)
    np.testing.assert_allclose(values.sum(axis=1), 1.0)
    for direction in range(2):
        step = np.eye(2)[direction] * 1e-6
        numeric = (
            shape_functions(local + step, corners)[0] - shape_functions(local - step, corners)[0]
        ) / 2e-6
        np.testing.assert_allclose(slopes[:, :, direction], numeric, atol=1e-9)


# In the plane, where surfaces are curves.


def arc(n: int, radius: float = 1.0, uneven: float = 0.03) -> FacetedSurface:
    """The upper part of a disc's rim, seen from outside; the disc lies on the left of its edges."""
    angle = np.linspace(2.6, 0.5, n + 1)
    angle = angle + uneven * np.sin(5 * angle)
    points = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return faceted_surface(points, np.column_stack([np.arange(1, n + 1), np.arange(n)]))


def ring(angle: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    return radius[:, None] * direction, direction


def test_straight_lines_are_exact() -> None:
    rng = np.random.default_rng(1)
    ticks = np.sort(np.concatenate([[0, 3], rng.uniform(0, 3, 11)]))
    points = np.column_stack([rng.uniform(0, 3, 200), rng.uniform(-0.5, 2, 200)])
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    edges = np.column_stack([np.arange(1, 13), np.arange(12)])
    line = faceted_surface(np.column_stack([ticks, 0 * ticks]) @ turn.T, edges)
    found = project(points @ turn.T, np.tile([0.0, -1.0], (200, 1)) @ turn.T, line)
    np.testing.assert_array_equal(found.point, np.arange(200))
    assert found.local.shape == (200, 1)
    np.testing.assert_allclose(found.gap, points[:, 1], atol=1e-13)
    np.testing.assert_allclose(found.normal, np.tile(turn[:, 1], (200, 1)), atol=1e-13)
    np.testing.assert_allclose(foot(found, line) @ turn, points * [1, 0], atol=1e-13)


def test_distance_and_normal_of_curves_converge_with_second_order() -> None:
    rng = np.random.default_rng(2)
    distance = rng.uniform(-0.05, 0.2, 50)
    points, direction = ring(rng.uniform(0.8, 2.3, 50), 1 + distance)
    errors = []
    for n in (8, 16, 32, 64):
        found = project(points, -direction, arc(n))
        assert len(found.point) == 50
        errors.append([np.abs(found.gap - distance).max(), np.abs(found.normal - direction).max()])
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates[-1].min() > 1.8, f"orders of gap and normal: {rates}"
    assert errors[0][0] > 1e-4, "the coarse curve is too good: nothing was tested"


def test_gap_and_normal_do_not_jump_between_edges() -> None:
    def jumps(steps: int) -> np.ndarray:
        points, direction = ring(np.linspace(0.8, 2.3, steps + 1), np.full(steps + 1, 1.03))
        found = project(points, -direction, arc(9))
        assert len(found.point) == steps + 1, "a point between two edges was lost"
        assert len(np.unique(found.facet)) > 4, "hardly a corner was crossed"
        return np.abs(np.diff(np.column_stack([found.gap, found.normal]), axis=0)).max(axis=0)

    assert (jumps(3200) < jumps(400) / 6 + 1e-12).all()


def test_points_beyond_the_ends_of_a_curve_and_from_behind_have_no_projection() -> None:
    line = faceted_surface(np.array([[0.0, 0], [0.5, 0], [1, 0]]), np.array([[1, 0], [2, 1]]))
    points = np.array([[0.5, 0.1], [1.03, 0.1], [-0.03, 0.1], [1.0, 0.1], [0.3, 0.1]])
    normals = np.array([[0.0, -1], [0, -1], [0, -1], [0, -1], [0, 1]])
    assert project(points, normals, line).point.tolist() == [0, 3]


# Wherever the surface lies, and in whatever unit.


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize(("size", "shift"), [(1e-9, 0.0), (1.0, 0.0), (1e9, 0.0), (1.0, 1e5), (1.0, 1e7)])
def test_of_facets_that_share_a_point_the_first_is_taken(corners: int, size: float, shift: float) -> None:
    """Points over nodes and over the middles of edges, on a turned surface: all that decides is rounding."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    ticks = np.linspace(0.0, 0.7, 8)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    flat = lattice(x, y, np.zeros_like(x), corners)

    def placed(points: np.ndarray) -> np.ndarray:
        return size * (points @ turn.T) + shift

    surface = faceted_surface(placed(flat.points), flat.facets)
    sides = np.sort(np.stack([flat.facets, np.roll(flat.facets, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    facet_of_side = np.repeat(np.arange(len(flat.facets)), corners)
    pairs, first = np.unique(sides, axis=0, return_index=True)
    middles = flat.points[pairs].mean(axis=1)
    points = np.concatenate([flat.points, middles]) + np.array([0.0, 0.0, 0.03])
    found = project(placed(points), downwards(len(points)) @ turn.T, surface)
    np.testing.assert_array_equal(found.point, np.arange(len(points)))
    assert (found.beside == 0.0).all()
    assert len(found.lost) == 0
    lowest = np.array([np.argmax((flat.facets == node).any(axis=1)) for node in range(len(flat.points))])
    np.testing.assert_array_equal(found.facet, np.concatenate([lowest, facet_of_side[first]]))
    np.testing.assert_allclose(found.gap, 0.03 * size, rtol=1e-12 + 1e-14 * shift)


# Facets that are too far away are not tried, and no projection is another one for that.


def tried(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Number of facets on which points are projected, one entry a call."""
    solve, counts = searched._solve, []

    def counting(*of: Any) -> Projection:
        counts.append(len(of[3]))
        return solve(*of)

    monkeypatch.setattr(searched, "_solve", counting)
    return counts


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize(("height", "most"), [(0.0, 1.1), (1e-3, 1.1), (0.05, 2.0), (0.3, 5.0)])
def test_points_near_a_surface_are_projected_on_hardly_more_than_one_facet(
    corners: int, height: float, most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    surface, rng, counts = cap(sphere, 12, corners), np.random.default_rng(5), tried(monkeypatch)
    places = np.column_stack([rng.uniform(-0.5, 0.5, (400, 2)), np.ones(400)])
    places[:, 2] = sphere(*places[:, :2].T)
    assert len(project((1.0 + height) * places, -places, surface).point) == 400
    assert sum(counts) < most * 400


def rough(corners: int, rng: np.random.Generator, bumps: float) -> FacetedSurface:
    """Uneven facets over uneven ground, graded, turned, and anywhere."""
    ticks = np.sort(rng.uniform(0.0, 1.0, 9)) + 0.02 * np.arange(9)
    if corners == 2:
        points = np.column_stack([ticks, bumps * rng.uniform(-1.0, 1.0, 9)])
        return faceted_surface(points + rng.normal(size=2), np.column_stack([np.arange(1, 9), np.arange(8)]))
    x, y = np.meshgrid(ticks, np.sort(rng.uniform(0.0, 1.0, 9)) + 0.02 * np.arange(9), indexing="ij")
    x, y = x + 0.01 * rng.uniform(-1, 1, x.shape), y + 0.01 * rng.uniform(-1, 1, x.shape)
    surface = lattice(x, y, bumps * rng.uniform(-1.0, 1.0, x.shape), corners)
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return faceted_surface(
        surface.points @ (turn * np.sign(np.linalg.det(turn))).T + rng.normal(size=3), surface.facets
    )


@pytest.mark.parametrize("bumps", [0.0, 1e-3, 0.03, 0.2])
@pytest.mark.parametrize("corners", [2, 3, 4])
def test_no_facet_is_left_out_that_would_have_the_projection(
    corners: int, bumps: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also at nodes and edges, beyond the rim, deep inside, far above, and on creases as high as wide."""
    rng, found = np.random.default_rng(6), []
    cases = []
    for _ in range(5):
        surface = rough(corners, rng, bumps)
        facet = rng.integers(0, len(surface.facets), 300)
        weights = rng.dirichlet(np.ones(corners), 300)
        weights[:100] = np.round(weights[:100])  # many at nodes
        weights[:100] += weights[:100].sum(axis=1, keepdims=True) == 0.0
        weights /= weights.sum(axis=1, keepdims=True)
        normals = np.einsum("nk,nkd->nd", weights, surface.normals[surface.facets[facet]])
        places = np.einsum("nk,nkd->nd", weights, surface.points[surface.facets[facet]])
        away = rng.choice([0.0, 1e-9, 1e-4, 0.01, 0.1, 0.5], 300) * rng.choice([-1.0, 1.0], 300)
        cases.append((places + away[:, None] * (normals + 0.3 * rng.normal(size=normals.shape)), -normals))
        found.append((surface, project(*cases[-1], surface)))
    counts = tried(monkeypatch)
    for case, (surface, _) in zip(cases, found, strict=True):
        project(*case, surface)
    few = sum(counts)
    monkeypatch.setattr(searched, "_least_distances", lambda points, master, facet: np.zeros(facet.shape))
    for case, (surface, few_tried) in zip(cases, found, strict=True):
        every = project(*case, surface)
        for name in ("point", "facet", "local", "gap", "normal", "beside", "lost"):
            both = getattr(few_tried, name), getattr(every, name)
            np.testing.assert_allclose(*both, rtol=0.0, atol=1e-13, err_msg=name)
    assert few < 0.7 * (sum(counts) - few), "hardly a facet was left out"


@pytest.mark.parametrize("bumps", [0.0, 1e-3, 0.03, 0.2])
@pytest.mark.parametrize("corners", [2, 3, 4])
def test_facets_that_no_far_point_can_be_over_are_all_that_are_left_out(
    corners: int, bumps: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of points as far away as several facets, which no nearest facet has, all others are tried."""
    rng, cases = np.random.default_rng(8), []
    for _ in range(5):
        surface = rough(corners, rng, bumps)
        places = surface.points[rng.integers(0, len(surface.points), 200)]
        normals = surface.normals[rng.integers(0, len(surface.normals), 200)]
        away = rng.choice([0.5, 2.0, 10.0], (200, 1)) * (normals + rng.normal(size=normals.shape))
        case = places + away, -normals * rng.choice([-1.0, 1.0], (200, 1)), surface
        cases.append((case, project(*case)))
    counts = tried(monkeypatch)
    for case, _ in cases:
        project(*case)
    few = sum(counts)

    def every(self: object, points: object, normals: object, point: np.ndarray, facet: object) -> np.ndarray:
        return np.arange(len(point))

    monkeypatch.setattr(searched._Sides, "may_be_over", every)
    for case, found in cases:
        wanted = project(*case)
        for name in ("point", "facet", "local", "gap", "normal", "beside"):
            both = getattr(found, name), getattr(wanted, name)
            np.testing.assert_allclose(*both, rtol=0.0, atol=1e-13, err_msg=name)
    assert few < 0.9 * (sum(counts) - few), "hardly a facet was left out"


def test_a_node_without_a_normal_is_named_by_its_place() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 3, 0], [2, 3, 0]])
    with pytest.raises(InvalidInputError, match=r"must have a normal, that at \(2, 3, 0\) has none"):
        faceted_surface(points, np.array([[0, 1, 2], [2, 3, 4]]))
