"""Constraints in the form of SciPy: linear and nonlinear ones are taken, others refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import Bounds, LinearConstraint, NonlinearConstraint

from fenics_contact import minimize
from fenics_contact._optimize.constraints import feasible_set
from fenics_contact.design import BundleTrust, ForScipy, LinearConstraints, nearest_feasible
from fenics_contact.errors import InvalidInputError

START = np.zeros(3)
OWN = LinearConstraints([[1.0, 1.0, 0.0], [-1.0, -2.0, 0.0]], [1.5, 2.0], [[0.0, 1.0, -1.0]], [0.0])
A = np.array([[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, -1.0]])
LOW, HIGH = [-np.inf, -2.0, 0.0], [1.5, np.inf, 0.0]


def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
    away = x - np.array([2.0, 1.0, 3.0])
    return float(away @ away), 2.0 * away


def curve(x: np.ndarray) -> float:
    return float(x @ x)


@pytest.mark.parametrize("lower", [0.25, [0.25, -1.0]])
def test_bounds_of_scipy_are_a_box(lower: Any) -> None:
    box, far = Bounds(lower, 2.0), [0.0, 3.0]
    np.testing.assert_array_equal(nearest_feasible(far, box), nearest_feasible(far, (lower, 2.0)))
    assert nearest_feasible(far, box).tolist() == pytest.approx([0.25, 2.0])


@pytest.mark.parametrize(
    "given",
    [
        LinearConstraint(A, LOW, HIGH),
        LinearConstraint(sp.csr_matrix(A), LOW, HIGH),
        [LinearConstraint(A[:1], ub=1.5), LinearConstraint(A[1], lb=-2.0), LinearConstraint(A[2:], 0.0, 0.0)],
    ],
    ids=["dense", "sparse", "several"],
)
def test_linear_constraints_of_scipy_are_those_of_the_package(given: Any) -> None:
    taken, wanted = feasible_set(3, None, given), feasible_set(3, None, OWN)
    np.testing.assert_array_equal(taken.matrix, wanted.matrix)
    np.testing.assert_array_equal(taken.limit, wanted.limit)
    np.testing.assert_array_equal(taken.equality_matrix, wanted.equality_matrix)
    np.testing.assert_array_equal(taken.equality_value, wanted.equality_value)
    result = minimize(bowl, START, constraints=given)
    np.testing.assert_array_equal(result.x, minimize(bowl, START, constraints=OWN).x)
    assert result.x[:2].sum() == pytest.approx(1.5, abs=1e-6)
    far = np.array([5.0, 5.0, -5.0])
    np.testing.assert_array_equal(nearest_feasible(far, None, given), nearest_feasible(far, None, OWN))
    assert len(ForScipy(bowl, START, constraints=given).arguments("SLSQP")["constraints"]) == 2


def test_a_row_between_two_limits_is_two_rows() -> None:
    taken = feasible_set(3, None, LinearConstraint(A[0], -1.0, 2.0))
    np.testing.assert_array_equal(taken.matrix, [A[0], -A[0]])
    np.testing.assert_array_equal(taken.limit, [2.0, 1.0])


def test_no_constraints_are_none() -> None:
    assert len(feasible_set(3, None, []).matrix) == 0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (NonlinearConstraint(curve, 0.0, 1.0), "must have its derivative as the function jac, got '2-point'"),
        (
            NonlinearConstraint(curve, [0.0, 0.0], [1.0, 1.0], jac=lambda x: 2 * x),
            "a NonlinearConstraint with 1 components must have as many limits, or one for all, got lb",
        ),
        ({"type": "ineq", "fun": curve}, "must be objects, got a dict: write NonlinearConstraint"),
        (A, "must be LinearConstraints or NonlinearConstraint, or SciPy's, .*, got a ndarray: write"),
        (LinearConstraint(A[:, :2]), r"a matrix of 3 columns, one for each variable, got shape \(3, 2\)"),
        (LinearConstraint(A[0], 2.0, 1.0), "must have lb <= ub in every row, got lb"),
        (LinearConstraint(A[0], np.nan, 1.0), "must have lb <= ub in every row, got lb"),
    ],
)
def test_other_constraints_are_refused_by_name(given: Any, told: str) -> None:
    with pytest.raises(InvalidInputError, match=told):
        minimize(bowl, START, constraints=given)


def test_a_nonlinear_constraint_of_scipy_is_taken_component_by_component() -> None:
    def values(x: np.ndarray) -> np.ndarray:
        return np.array([x @ x, x[0] * x[1]])

    def slopes(x: np.ndarray) -> sp.csr_matrix:
        return sp.csr_matrix([2 * x, [x[1], x[0], 0.0]])

    given = [
        NonlinearConstraint(values, [-np.inf, 0.25], [4.0, 0.25], jac=slopes),
        LinearConstraint(A[0], ub=9),
    ]
    result = minimize(bowl, [0.5, 0.5, 0.0], BundleTrust(tolerance=1e-8), constraints=given)
    ball, product = result.constraints
    assert (ball.upper, ball.active, product.lower, product.upper) == (4.0, True, 0.25, 0.25)
    assert values(result.x) == pytest.approx([4.0, 0.25], rel=1e-6)


def test_points_are_not_projected_onto_nonlinear_constraints() -> None:
    with pytest.raises(
        InvalidInputError, match="onto linear constraints only, got a NonlinearConstraint: leave"
    ):
        nearest_feasible(START, None, [NonlinearConstraint(curve, 0.0, 1.0)])


def test_a_value_alone_that_is_no_number_is_refused() -> None:
    task = ForScipy(bowl, START, value=lambda x: np.nan)
    with pytest.raises(
        InvalidInputError, match="value must return a finite number, got nan in entry 0 at ev"
    ):
        task.arguments("COBYLA")["fun"](START)
