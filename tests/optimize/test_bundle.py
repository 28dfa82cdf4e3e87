"""Planes stay below a convex function wherever they are seen from, and aggregation keeps what they say."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._optimize.bundle import Bundle, Plane
from fenics_contact._optimize.constraints import feasible_set
from fenics_contact._optimize.subproblem import solve_step
from tests.optimize.functions import Array, crescent, maxquad


def bundle_of(fun, points: Array, locality: float = 0.0) -> Bundle:  # type: ignore[no-untyped-def]
    centre = points[0]
    value, gradient = fun(centre)
    bundle = Bundle.of_centre(Plane(gradient), locality)
    for point in points[1:]:
        other, slope = fun(point)
        error = value - other - slope @ (centre - point)
        bundle = bundle.with_cut(Plane(slope), error, float(np.linalg.norm(point - centre)))
    return bundle


def points(count: int, n: int = 10) -> Array:
    return np.random.default_rng(3).standard_normal((count, n))


def test_model_is_exact_at_the_centre_and_below_a_convex_function_elsewhere() -> None:
    cloud = points(12)
    bundle, centre = bundle_of(maxquad, cloud), cloud[0]
    assert bundle.model(np.zeros(10)) == 0.0
    differences = [maxquad(x)[0] - maxquad(centre)[0] - bundle.model(x - centre) for x in points(40)]
    assert min(differences) > -1e-10
    assert bundle.model(cloud[5] - centre) == pytest.approx(maxquad(cloud[5])[0] - maxquad(centre)[0])


def test_moving_the_centre_gives_the_bundle_that_is_built_there() -> None:
    cloud = points(8)
    bundle = bundle_of(maxquad, cloud)
    change = maxquad(cloud[-1])[0] - maxquad(cloud[0])[0]
    moved = bundle.moved(cloud[-1] - cloud[0], change, 0.5)
    built = bundle_of(maxquad, np.vstack([cloud[-1], cloud[:-1]]))
    assert moved.gradients == pytest.approx(built.gradients)
    assert moved.errors == pytest.approx(built.errors)
    assert moved.errors[0] == moved.distances[0] == 0.0
    assert moved.locality == 0.5
    assert (moved.distances >= built.distances - 1e-12).all()


def test_plane_above_a_nonconvex_function_is_pushed_below_its_value_at_the_centre() -> None:
    cloud = np.array([[-1.0, 0.5], [0.0, -0.5], [-1.5, 1.8], [0.7, 0.7]])
    bundle = bundle_of(crescent, cloud, locality=0.01)
    assert bundle.errors.min() < -0.1, "all planes lie below: nothing was tested"
    assert (bundle.measures >= 0.0).all()
    assert bundle.model(np.zeros(2)) == 0.0
    assert (bundle.measures >= 0.01 * bundle.distances**2).all()


def test_planes_without_weight_go_first() -> None:
    bundle = bundle_of(maxquad, points(9))
    weights = np.array([0.2, 0, 0, 0.5, 0, 0, 0, 0.3, 0])
    kept = bundle.reduced(weights, 5)
    assert kept.size == 5
    for row in (0, 3, 7):
        assert any((bundle.gradients[row] == gradient).all() for gradient in kept.gradients)
    assert (kept.gradients[0] == bundle.gradients[0]).all()


@pytest.mark.parametrize("room", [2, 3])
def test_aggregate_plane_keeps_the_step(room: int) -> None:
    cloud = 0.02 * points(30)
    bundle = bundle_of(maxquad, cloud)
    near = feasible_set(10).around(cloud[0], np.ones(10))
    step = solve_step(bundle, near, 3.0)
    assert np.count_nonzero(step.weights > 1e-6) > room, (
        "no plane that matters is dropped: nothing was tested"
    )
    kept = bundle.reduced(step.weights, room)
    assert kept.size == room
    again = solve_step(kept, near, 3.0)
    assert again.move == pytest.approx(step.move, abs=1e-4 * step.length)
    assert again.decrease == pytest.approx(step.decrease, rel=1e-6)


def test_bundle_with_room_is_left_alone() -> None:
    bundle = bundle_of(maxquad, points(4))
    assert bundle.reduced(np.full(4, 0.25), 4) is bundle
