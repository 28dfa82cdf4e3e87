"""Linear constraints for manufacture hold for the shapes, not only for the control points."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from fenics_contact import SurfaceDesign, minimize
from fenics_contact._optimize.manufacture import joined
from fenics_contact.design import (
    LinearConstraints,
    convex,
    fixed_rim,
    monotone,
    nearest_feasible,
    smallest_radius,
    symmetric,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface, block, rectangle, side_of

Array = np.ndarray
MESH = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (40, 20, 1))
SURFACE = side_of(MESH, "z1")
DESIGN = SurfaceDesign("block", SURFACE, net=(6, 4))
PLANE = rectangle((0.0, 0.0), (3.0, 1.0), (30, 4))
CURVE = SurfaceDesign("plate", side_of(PLANE, "y1"), net=7)


def arc(radius: float, hollow: bool, nodes: int = 61) -> tuple[SurfaceDesign, Array]:
    """An arc of one radian whose body lies inside, or outside where it is hollow."""
    angle = np.linspace(0.0, 1.0, nodes)
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    surface = DesignSurface(np.arange(nodes), angle[:, None], -out if hollow else out, (nodes,))
    return SurfaceDesign("disc", surface, net=8), radius * out


def on_grid(design: SurfaceDesign, alpha: Array) -> Array:
    """Displacements along the normals on the grid of nodes."""
    return (design.basis @ alpha).reshape(design.lattice.counts)


def made(constraints: LinearConstraints, seed: int, size: float = 0.1) -> Array:
    """The feasible control points nearest to random ones, some of which are not feasible."""
    wanted = size * np.random.default_rng(seed).standard_normal(np.shape(constraints.matrix)[1])
    found = nearest_feasible(wanted, None, constraints)
    assert np.abs(found - wanted).max() > 0.1 * size, "a point that was feasible tests nothing"
    assert np.abs(found).max() > 0.01 * size, "the reference shape tests nothing"
    return found


def curvature(points: Array) -> Array:
    """Curvature of a plane curve, positive where it turns left."""
    first = np.gradient(points, axis=0)
    second = np.gradient(first, axis=0)
    return (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / (first**2).sum(axis=1) ** 1.5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_symmetric_shape_equals_its_mirror_image(axis: int, seed: int) -> None:
    moved = on_grid(DESIGN, made(symmetric(DESIGN, axis), seed))
    assert moved == pytest.approx(np.flip(moved, axis), abs=1e-9)
    assert np.abs(moved - np.flip(moved, 1 - axis)).max() > 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_monotone_displacement_never_turns(axis: int, sign: int, seed: int) -> None:
    moved = on_grid(DESIGN, made(monotone(DESIGN, axis, sign), seed))
    assert (sign * np.diff(moved, axis=axis)).min() > -1e-8
    assert (sign * np.diff(moved, axis=axis)).max() > 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_convex_profile_of_a_flat_side_is_nowhere_hollow(axis: int, seed: int) -> None:
    moved = on_grid(DESIGN, made(convex(DESIGN, axis), seed))
    assert np.diff(moved, n=2, axis=axis).max() < 1e-9
    assert np.diff(moved, n=2, axis=axis).min() < -1e-5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [0, 1])
def test_the_radius_of_a_flat_side_is_kept(axis: int, seed: int) -> None:
    radius, spacing = 8.0, 0.1
    moved = on_grid(DESIGN, made(smallest_radius(DESIGN, axis, radius, MESH.points), seed))
    bends = np.diff(moved, n=2, axis=axis) / spacing**2
    assert np.abs(bends).max() < (1 + 1e-6) / radius
    assert np.abs(bends).max() > 0.1 / radius


def test_a_curve_of_a_plane_body_has_one_parameter() -> None:
    moved = on_grid(CURVE, made(smallest_radius(CURVE, 0, 8.0, PLANE.points), 1))
    assert 0.1 / 8.0 < np.abs(np.diff(moved, n=2)).max() / 0.1**2 < (1 + 1e-6) / 8.0
    assert len(np.asarray(symmetric(CURVE, 0).equality_matrix)) == 3


@pytest.mark.parametrize("hollow", [False, True])
def test_the_radius_of_an_arc_is_kept_with_its_own_curvature(hollow: bool) -> None:
    design, points = arc(2.0, hollow)
    for seed in range(5):
        alpha = made(smallest_radius(design, 0, 1.5, points), seed, 0.05)
        moved = points + design.displacement(alpha)
        # The curvature is that to first order in the displacement.
        assert np.abs(curvature(moved)[3:-3]).max() < 1.05 / 1.5


def test_the_radius_of_an_arc_that_moves_out_grows_and_shrinks_as_it_does() -> None:
    design, points = arc(2.0, hollow=False)
    rows = smallest_radius(design, 0, 1.5, points)
    matrix, limit = np.asarray(rows.matrix), np.asarray(rows.limit)
    for shift in (-0.1, 0.1):
        room = limit - matrix @ np.full(8, shift)
        wanted = 1 / 2.0 - shift / 4.0
        assert room == pytest.approx(np.repeat([wanted + 1 / 1.5, 1 / 1.5 - wanted], 6), rel=1e-3)


def test_an_arc_may_be_flattened_but_not_hollowed() -> None:
    design, points = arc(2.0, hollow=False)
    moved = points + design.displacement(made(convex(design, 0, points), 3, 0.3))
    assert curvature(moved)[3:-3].min() > -0.02
    without = made(convex(design, 0, points), 3, 0.3) @ np.asarray(convex(design, 0).matrix).T
    assert without.max() > 1e-3, "the arc's own curvature was not used"


def test_a_fixed_rim_moves_inside_alone() -> None:
    alpha = made(fixed_rim(DESIGN), 1)
    moved = on_grid(DESIGN, alpha)
    assert np.abs(np.concatenate([moved[0], moved[-1], moved[:, 0], moved[:, -1]])).max() < 1e-12
    assert np.abs(moved).max() > 1e-3
    wide = made(fixed_rim(CURVE, 2), 1)
    assert np.flatnonzero(np.abs(wide) > 1e-12).tolist() == [2, 3, 4]
    ends = on_grid(DESIGN, made(fixed_rim(DESIGN, (1, 0)), 1))
    assert np.abs(ends[[0, -1]]).max() < 1e-12
    assert min(np.abs(ends[1:-1, column]).max() for column in (0, -1)) > 1e-3


def test_constraints_of_several_designs_are_placed_in_all_variables() -> None:
    both = joined((DESIGN, CURVE), (1, fixed_rim(CURVE)), (0, monotone(DESIGN, 0)), (1, convex(CURVE, 0)))
    alpha = made(both, 2)
    first, second = alpha[: DESIGN.size], alpha[DESIGN.size :]
    assert np.diff(on_grid(DESIGN, first), axis=0).min() > -1e-8
    assert np.abs(on_grid(CURVE, second)[[0, -1]]).max() < 1e-12
    assert np.diff(on_grid(CURVE, second), n=2).max() < 1e-9


def test_the_nearest_symmetric_convex_shape_is_found_by_minimising() -> None:
    wanted = 0.1 * np.sin(np.arange(CURVE.size))

    def away(alpha: Array) -> tuple[float, Array]:
        return float((alpha - wanted) @ (alpha - wanted)), 2 * (alpha - wanted)

    rules = [symmetric(CURVE, 0), convex(CURVE, 0)]
    result = minimize(away, np.zeros(CURVE.size), constraints=rules)
    moved = on_grid(CURVE, result.x)
    assert moved == pytest.approx(moved[::-1], abs=1e-8)
    assert np.diff(moved, n=2).max() < 1e-9
    assert 1e-3 < np.abs(result.x).max()
    assert result.value < float(wanted @ wanted)


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (partial(symmetric, DESIGN, 2), "axis must be one of the 2 parameters of the net, got 2"),
        (partial(symmetric, CURVE, 1), "axis must be one of the 1 parameters of the net, got 1"),
        (partial(monotone, DESIGN, 0, 2), "sign of a monotone displacement must be 1 or -1, got 2"),
        (
            partial(convex, SurfaceDesign("b", SURFACE, net=(2, 4)), 0),
            "at least 3 control points along it, got 2",
        ),
        (
            partial(monotone, SurfaceDesign("b", SURFACE, net=(1, 4)), 0),
            "at least 2 control points .*, got 1",
        ),
        (partial(smallest_radius, DESIGN, 0, 0.0, MESH.points), "radius must be positive and finite, got 0"),
        (
            lambda: smallest_radius(arc(2.0, True)[0], 0, 3.0, arc(2.0, True)[1]),
            "must not exceed those of the reference, got 3 for one of 2: give",
        ),
        (partial(fixed_rim, DESIGN, 2), r"a rim of 2 control points must leave some of a net of .* inside"),
        (partial(fixed_rim, DESIGN, (0, 0)), r"a rim of \(0, 0\) control points must leave"),
        (partial(fixed_rim, DESIGN, (1, 0, 0)), r"a rim of \(1, 0, 0\) control points must leave"),
        (partial(joined, (DESIGN,), (1, symmetric(DESIGN, 0))), "there are 1 designs, got number 1"),
        (partial(joined, (CURVE,), (0, symmetric(DESIGN, 0))), r"design 0 must have 7 columns, .* \(0, 24\)"),
    ],
)
def test_wrong_requests_are_refused(build: Callable[[], object], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        build()
