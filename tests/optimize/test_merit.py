"""Penalties grow as far as violations can be reduced, and small violations are corrected."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._optimize.bundle import Bundle, Plane
from fenics_contact._optimize.bundle_trust import first_centre
from fenics_contact._optimize.constraints import Surroundings, feasible_set
from fenics_contact._optimize.merit import correcting_step, priced_step, surroundings
from fenics_contact._optimize.nonlinear import SoftConstraint
from fenics_contact._optimize.problem import pose
from fenics_contact._optimize.subproblem import solve_step
from fenics_contact.design import NonlinearConstraint


def soft(gradient: list[float], value: float, penalty: float = 1.0) -> SoftConstraint:
    return SoftConstraint(Bundle.of_centre(Plane(np.array(gradient)), 0.0), value, penalty, 1.0)


def around(bound: float = 9.0) -> Surroundings:
    return feasible_set(2, (-bound, bound)).around(np.zeros(2), np.ones(2))


DOWN = Bundle.of_centre(Plane(np.array([-1.0, 0.0])), 0.0)


def test_a_penalty_that_is_large_enough_stays() -> None:
    given = [soft([1.0, 0.0], 0.5, 4.0)]
    step, priced = priced_step(DOWN, around(), 10.0, given, 1e-6)
    assert priced == tuple(given)
    assert step.violations[0] == pytest.approx(0.0, abs=1e-8)
    assert step.move == pytest.approx([-0.5, 0.0], abs=1e-6)
    assert not step.stuck


def test_a_penalty_grows_until_the_step_reduces_the_violation() -> None:
    step, (one,) = priced_step(DOWN, around(), 10.0, [soft([1.0, 0.0], 0.5, 0.1)], 1e-6)
    assert one.penalty == pytest.approx(10.0)
    assert step.violations[0] == pytest.approx(0.0, abs=1e-8)


def test_a_penalty_stays_that_takes_off_a_tenth_of_a_violation_and_grows_where_it_takes_off_less() -> None:
    # The step is t (ρ - 1) long, and all of the violation of 0.5 could be taken off.
    for penalty, wanted in ((1.006, 1.006), (1.004, 10.04)):
        _, (one,) = priced_step(DOWN, around(), 10.0, [soft([1.0, 0.0], 0.5, penalty)], 1e-6)
        assert one.penalty == pytest.approx(wanted)


def test_equalities_are_rows_of_length_one_whatever_their_units() -> None:
    for size in (1e-3, 1.0, 1e3):
        circle = NonlinearConstraint(lambda x, size=size: (size * float(x @ x), size * 2.0 * x), size, size)
        problem = pose(lambda x: (float(x[0]), np.array([1.0, 0.0])), [0.6, 0.8], constraints=circle)
        near = surroundings(problem, first_centre(problem, 0.01, 1e-6))
        assert near.equality_rows == pytest.approx(np.array([[0.6, 0.8]]))
        assert near.miss == pytest.approx([0.0])


def test_a_penalty_does_not_grow_for_what_is_out_of_reach() -> None:
    # The box allows a fortieth of the violation to be taken off, which the present penalty does.
    step, (one,) = priced_step(DOWN, around(0.1), 10.0, [soft([1.0, 0.0], 4.0, 5.0)], 1e-6)
    assert one.penalty == 5.0
    assert step.violations[0] == pytest.approx(3.9, abs=1e-6)
    assert not step.stuck


def test_a_step_between_limits_that_contradict_each_other_is_stuck() -> None:
    step, _ = priced_step(DOWN, around(), 10.0, [soft([0.0, 1.0], 1.0), soft([0.0, -1.0], 1.0)], 1e-6)
    assert step.stuck


def test_the_merit_that_a_step_gains_splits_into_aggregate_error_and_norm() -> None:
    given, t = [soft([1.0, 0.5], 0.5, 4.0), soft([0.2, -1.0], -0.1, 4.0)], 2.0
    step = solve_step(DOWN, around(), t, given)
    assert step.decrease == pytest.approx(step.aggregate_error + t * step.aggregate_norm**2, rel=1e-6)
    assert step.decrease > 0.1


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-2])
def test_a_correction_takes_the_shortest_way_to_the_limits_however_near_they_are(size: float) -> None:
    given = [soft([3.0, 4.0], size, 10.0), soft([0.0, 1.0], -0.5, 10.0)]
    start = solve_step(DOWN, around(), 1.0, given)
    step = correcting_step(DOWN, around(), given, start)
    assert step.move == pytest.approx(-size / 25.0 * np.array([3.0, 4.0]), rel=1e-6)
    assert max(step.violations) <= 1e-8 * size
    # What is gained by the penalty, less what J rises.
    assert step.decrease == pytest.approx((10.0 - 3.0 / 25.0) * size, rel=1e-6)


def test_a_step_stays_where_no_point_meets_the_limits() -> None:
    given = [soft([0.0, 1.0], 1.0), soft([0.0, -1.0], 1.0)]
    start = solve_step(DOWN, around(), 1.0, given)
    assert correcting_step(DOWN, around(), given, start) is start
