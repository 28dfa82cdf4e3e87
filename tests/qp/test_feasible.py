from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fenics_contact.errors import InvalidInputError
from fenics_contact.qp import FeasibleSet
from fenics_contact.qp.layout import ContactLayout

LAYOUT = ContactLayout.build(11, normal=[0, 5, 7], tangential=[[1, 9], [3, 8]], friction_of=[2, 0])
FLAT = ContactLayout.build(4, normal=[0], tangential=[[2]])
vectors = arrays(float, 11, elements=st.floats(-5, 5, allow_subnormal=False))
bounds = arrays(float, 2, elements=st.sampled_from([0.0, 0.3, 1.0, 4.0]))


def one_disc(bound: float) -> FeasibleSet:
    return FeasibleSet(ContactLayout.build(3, normal=[0], tangential=[[1, 2]]), np.array([bound]))


@given(vectors, bounds)
def test_projection_lands_in_the_set_and_stays(x, bound):
    feasible = FeasibleSet(LAYOUT, bound)
    projected = feasible.project(x)
    assert feasible.violation(projected) <= 1e-15 * 5
    np.testing.assert_allclose(feasible.project(projected), projected, rtol=1e-15, atol=1e-15)
    np.testing.assert_array_equal(projected[LAYOUT.equality], x[LAYOUT.equality])


@given(vectors, vectors, bounds)
def test_projection_is_nonexpansive(x, y, bound):
    feasible = FeasibleSet(LAYOUT, bound)
    moved = np.linalg.norm(feasible.project(x) - feasible.project(y))
    assert moved <= np.linalg.norm(x - y) * (1 + 1e-14)


@given(vectors, vectors, bounds)
def test_projection_is_the_nearest_admissible_point(x, y, bound):
    feasible = FeasibleSet(LAYOUT, bound)
    nearest, admissible = feasible.project(x), feasible.project(y)
    assert (x - nearest) @ (admissible - nearest) <= 1e-12


@given(vectors, vectors, bounds)
def test_step_to_boundary_ends_on_the_boundary(x, direction, bound):
    feasible = FeasibleSet(LAYOUT, bound)
    inside = feasible.project(x)
    moving = np.where(feasible.active(inside), 0.0, direction)
    step = feasible.step_to_boundary(inside, moving)
    assert step >= 0.0
    if np.isfinite(step) and step < 1e8:
        assert feasible.violation(inside - step * moving) <= 1e-9
        assert (
            feasible.violation(inside - (1 + 1e-4) * step * moving) > 0.0
            or step * np.abs(moving).max() < 1e-3
        )
    else:
        assert np.all(np.abs(moving[LAYOUT.tangential]) < 1e-6)


@given(vectors, vectors, bounds)
def test_projected_gradient_vanishes_exactly_where_a_projected_step_goes_nowhere(x, gradient, bound):
    feasible = FeasibleSet(LAYOUT, bound)
    inside = feasible.project(x)
    projected = feasible.projected_gradient(inside, gradient)
    small = 1e-7
    moved = (inside - feasible.project(inside - small * gradient)) / small
    assert np.linalg.norm(moved) <= np.linalg.norm(projected) * (1 + 1e-6) + 1e-6
    assert projected @ gradient >= -1e-12


def test_step_along_a_disc_is_the_root_of_the_quadratic():
    feasible = one_disc(2.0)
    step = feasible.step_to_boundary(np.array([1.0, 1.0, 0.5]), np.array([0.0, -0.3, 0.4]))
    end = np.array([1.0, 0.5]) - step * np.array([-0.3, 0.4])
    assert np.linalg.norm(end) == pytest.approx(2.0, rel=1e-14)


def test_step_from_the_boundary_inwards_crosses_the_disc():
    step = one_disc(2.0).step_to_boundary(np.array([1.0, 2.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert step == pytest.approx(4.0, rel=1e-14)


def test_step_from_the_boundary_outwards_is_zero():
    step = one_disc(2.0).step_to_boundary(np.array([1.0, 2.0, 0.0]), np.array([0.0, -1.0, 0.0]))
    assert step == 0.0


def test_step_along_the_tangent_of_a_circle_is_zero():
    step = one_disc(2.0).step_to_boundary(np.array([1.0, 2.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    assert step == pytest.approx(0.0, abs=1e-7)


def test_step_of_a_pinned_disc_is_zero():
    step = one_disc(0.0).step_to_boundary(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 1.0]))
    assert step == 0.0


def test_step_is_unlimited_away_from_every_bound():
    step = one_disc(2.0).step_to_boundary(np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))
    assert step == np.inf


def test_step_to_the_bound_of_a_normal_force():
    step = one_disc(2.0).step_to_boundary(np.array([3.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
    assert step == pytest.approx(1.5)


def test_nearly_tangential_steps_lose_no_digits():
    x, p = np.array([1.0, 2.0 * (1 - 1e-12), 0.0]), np.array([0.0, -1.0, 0.0])
    assert one_disc(2.0).step_to_boundary(x, p) == pytest.approx(2e-12, rel=1e-3)


def test_plane_friction_is_an_interval():
    feasible = FeasibleSet(FLAT, np.array([0.5]))
    np.testing.assert_allclose(feasible.project(np.array([-1.0, 7.0, -3.0, 2.0])), [0.0, 7.0, -0.5, 2.0])
    inside, along = np.array([1.0, 0.0, 0.1, 0.0]), np.array([0.0, 0.0, 1.0, 0.0])
    assert feasible.step_to_boundary(inside, along) == pytest.approx(0.6)


def test_set_without_contact_leaves_vectors_alone():
    feasible = FeasibleSet(ContactLayout.build(3), np.zeros(0))
    x = np.array([-1.0, 2.0, 3.0])
    np.testing.assert_array_equal(feasible.project(x), x)
    assert feasible.violation(x) == 0.0
    assert feasible.step_to_boundary(x, x) == np.inf
    assert not feasible.active(x).any()


@pytest.mark.parametrize(
    ("bound", "message"),
    [
        (np.array([1.0]), r"slip_bound must have shape \(2,\), got \(1,\)"),
        (np.array([1.0, -1e-3]), r"slip_bound must be in \[0, ∞\)"),
        (np.array([1.0, np.nan]), r"slip_bound must be in \[0, ∞\)"),
    ],
)
def test_bad_slip_bound_is_refused(bound, message):
    with pytest.raises(InvalidInputError, match=message):
        FeasibleSet(LAYOUT, bound)
