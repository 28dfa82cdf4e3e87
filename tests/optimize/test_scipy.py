"""Optimisers of SciPy minimise what the package poses, and the package what SciPy poses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse as sp
from scipy.optimize import Bounds, LinearConstraint, NonlinearConstraint

from fenics_contact import minimize
from fenics_contact._optimize.constraints import feasible_set
from fenics_contact.design import BundleTrust, ForScipy, LinearConstraints, nearest_feasible
from fenics_contact.design import NonlinearConstraint as PiecesNonlinearConstraint
from fenics_contact.errors import InvalidDesignError, InvalidInputError

#: Sizes of the variables and of the objective like those of a design in millimetres.
SIZE, UNIT = np.array([0.25, 1e-3, 20.0]), 1e5
TARGET = np.array([0.2, 0.4, -0.1])
#: The nearest point to TARGET in y = x / SIZE with y_0 ≤ 0.1, Σ y = 0 and y_1 ≤ 0.2.
ANSWER = np.array([0.05, 0.2, -0.25])
BOX = (-0.5 * SIZE, np.array([0.1, 0.5, 0.5]) * SIZE)
ROWS = LinearConstraints([[0.0, 1.0 / SIZE[1], 0.0]], [0.2])
PLANE = LinearConstraints(ROWS.matrix, ROWS.limit, [1.0 / SIZE], [0.0])


def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
    """A quadratic function of large value in badly scaled variables."""
    away = x / SIZE - TARGET
    return UNIT * (1.0 + float(away @ away)), 2.0 * UNIT * away / SIZE


@pytest.mark.parametrize("method", ["SLSQP", "trust-constr"])
def test_methods_with_derivative_keep_bounds_rows_and_equalities(method: str) -> None:
    task = ForScipy(bowl, np.zeros(3), bounds=BOX, constraints=PLANE)
    found = scipy.optimize.minimize(**task.arguments(method))
    np.testing.assert_allclose(task.design(found.x) / SIZE, ANSWER, atol=2e-3)
    reference = minimize(bowl, np.zeros(3), bounds=BOX, constraints=PLANE)
    near = task.best_within(1e-6)
    assert near.value == pytest.approx(reference.value, rel=1e-4)
    assert task.objective_value(found.fun) == pytest.approx(reference.value, rel=1e-3)
    assert task.evaluations == len(task.visits) > 3


def test_a_method_without_derivative_keeps_bounds_as_rows_and_asks_for_values_alone() -> None:
    asked: list[np.ndarray] = []

    def value(x: np.ndarray) -> float:
        asked.append(x)
        return bowl(x)[0]

    def never(x: np.ndarray) -> tuple[float, np.ndarray]:
        raise AssertionError("a derivative was asked for")

    task = ForScipy(never, np.zeros(3), bounds=BOX, constraints=ROWS, value=value)
    scipy.optimize.minimize(**task.arguments("COBYLA"), options={"rhobeg": 0.2, "tol": 1e-4})
    expected = np.minimum(TARGET, [0.1, 0.2, 0.5])
    np.testing.assert_allclose(task.best_within(1e-3).x / SIZE, expected, atol=5e-3)
    assert len(asked) == task.evaluations


def test_a_method_that_takes_no_equality_is_given_its_row_and_a_fixed_variable_from_both_sides() -> None:
    fixed = (BOX[0] * [0.0, 1.0, 1.0], BOX[1] * [0.0, 1.0, 1.0])
    task = ForScipy(bowl, np.zeros(3), bounds=fixed, constraints=PLANE)
    scipy.optimize.minimize(**task.arguments("COBYLA"), options={"rhobeg": 0.2, "tol": 1e-5, "catol": 1e-5})
    np.testing.assert_allclose(task.best_within(1e-3).x / SIZE, [0.0, 0.2, -0.2], atol=5e-3)


def test_methods_for_boxes_alone_are_given_the_box() -> None:
    task = ForScipy(bowl, np.zeros(3), bounds=BOX)
    scipy.optimize.minimize(**task.arguments("L-BFGS-B"))
    np.testing.assert_allclose(task.best.x / SIZE, np.minimum(TARGET, [0.1, 0.5, 0.5]), atol=1e-5)
    free = ForScipy(bowl, np.zeros(3), scale=SIZE)
    assert "bounds" not in free.arguments("BFGS")
    scipy.optimize.minimize(**free.arguments("BFGS"))
    np.testing.assert_allclose(free.best.x / SIZE, TARGET, atol=1e-5)


def half(x: np.ndarray) -> tuple[float, np.ndarray]:
    """Falls towards designs that do not exist, beyond x_0 = 0.3."""
    if x[0] > 0.3:
        raise InvalidDesignError("a cell is inverted")
    return float((x[0] - 1.0) ** 2 + x[1] ** 2), np.array([2.0 * (x[0] - 1.0), 2.0 * x[1]])


@pytest.mark.parametrize("method", ["SLSQP", "L-BFGS-B", "COBYLA", "trust-constr", "Nelder-Mead"])
def test_designs_that_do_not_exist_turn_the_method_back(method: str) -> None:
    task = ForScipy(half, [-0.5, 0.4], bounds=(-2.0, 2.0))
    scipy.optimize.minimize(**task.arguments(method))
    refused = [visit for visit in task.visits if visit.note]
    assert refused, "the method never went there: nothing was tested"
    assert refused[0].note == "a cell is inverted"
    assert np.isnan(refused[0].value)
    assert task.best.x[0] == pytest.approx(0.3, abs=0.1)
    assert task.best.value < half(np.array([-0.5, 0.4]))[0]


def test_the_wall_has_the_gradient_that_it_returns() -> None:
    task = ForScipy(half, [0.0, 0.0], bounds=(-2.0, 2.0))
    task(np.zeros(2))
    z, direction = np.array([0.4, 0.1]), np.array([0.3, -0.7])
    (ahead, _), (behind, _) = task(z + 1e-6 * direction), task(z - 1e-6 * direction)
    assert task(z)[1] @ direction == pytest.approx((ahead - behind) / 2e-6, rel=1e-6)
    assert task(z)[0] > task.visits[0].value


def test_another_value_may_stand_for_designs_that_do_not_exist() -> None:
    task = ForScipy(half, [0.0, 0.0], bounds=(-2.0, 2.0), invalid=np.inf)
    task(np.zeros(2))
    assert task(np.array([0.5, 0.0]))[0] == np.inf


def test_a_start_that_does_not_exist_is_an_error() -> None:
    task = ForScipy(half, [0.5, 0.0])
    with pytest.raises(InvalidDesignError, match="a cell is inverted"):
        scipy.optimize.minimize(**task.arguments("BFGS"))


def test_a_method_that_would_forget_the_rows_is_refused() -> None:
    task = ForScipy(bowl, np.zeros(3), constraints=ROWS)
    with pytest.raises(InvalidInputError, match=r"constraints need SLSQP, .*, got 'L-BFGS-B'"):
        task.arguments("L-BFGS-B")


def test_a_problem_that_was_not_evaluated_has_no_best_design() -> None:
    with pytest.raises(InvalidInputError, match="no design of 0 is feasible"):
        _ = ForScipy(bowl, np.zeros(3)).best


def test_bounds_and_constraints_are_scipys_own() -> None:
    given = ForScipy(bowl, np.zeros(3), bounds=BOX, constraints=PLANE, scale=SIZE).arguments("trust-constr")
    box, (rows, plane) = given["bounds"], given["constraints"]
    np.testing.assert_allclose(box.ub * SIZE, BOX[1])
    assert np.all(box.keep_feasible)
    assert len(ForScipy(bowl, np.zeros(3), constraints=ROWS).arguments("SLSQP")["constraints"]) == 1
    for y, below, level in (
        (ANSWER, True, True),
        ([0.0, 0.3, -0.3], False, True),
        ([0.1, 0.1, 0.1], True, False),
    ):
        assert bool(np.all(rows.A @ np.array(y) <= rows.ub + 1e-12)) is below
        assert bool(np.all(np.abs(plane.A @ np.array(y) - plane.lb) <= 1e-12)) is level


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_shapes_are_optimised_by_scipy_on_any_number_of_ranks(mpirun: Callable[..., str], ranks: int) -> None:
    script = Path(__file__).parent / "scipy_on_ranks.py"
    value, start, same, invalid = mpirun(script, ranks, timeout=300.0).split()
    assert (same, invalid) == ("True", "True")
    assert float(value) < float(start)
    assert float(value) == pytest.approx(-0.166209, rel=1e-4)


# Constraints in the form of SciPy: linear and nonlinear ones are taken, others refused by name.
START = np.zeros(3)
OWN = LinearConstraints([[1.0, 1.0, 0.0], [-1.0, -2.0, 0.0]], [1.5, 2.0], [[0.0, 1.0, -1.0]], [0.0])
A = np.array([[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, -1.0]])
LOW, HIGH = [-np.inf, -2.0, 0.0], [1.5, np.inf, 0.0]


def tilted_bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
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
    result = minimize(tilted_bowl, START, constraints=given)
    np.testing.assert_array_equal(result.x, minimize(tilted_bowl, START, constraints=OWN).x)
    assert result.x[:2].sum() == pytest.approx(1.5, abs=1e-6)
    far = np.array([5.0, 5.0, -5.0])
    np.testing.assert_array_equal(nearest_feasible(far, None, given), nearest_feasible(far, None, OWN))
    assert len(ForScipy(tilted_bowl, START, constraints=given).arguments("SLSQP")["constraints"]) == 2


def test_a_row_between_two_limits_is_two_rows() -> None:
    taken = feasible_set(3, None, LinearConstraint(A[0], -1.0, 2.0))
    np.testing.assert_array_equal(taken.matrix, [A[0], -A[0]])
    np.testing.assert_array_equal(taken.limit, [2.0, 1.0])


def test_no_constraints_are_none() -> None:
    assert len(feasible_set(3, None, []).matrix) == 0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (NonlinearConstraint(curve, 0.0, 1.0), r"jac must be a function \(the derivative\), got '2-point'"),
        (
            NonlinearConstraint(curve, [0.0, 0.0], [1.0, 1.0], jac=lambda x: 2 * x),
            "1 components need as many limits, got",
        ),
        ({"type": "ineq", "fun": curve}, "must be objects, got a dict: write NonlinearConstraint"),
        (A, "must be LinearConstraints or NonlinearConstraint, or SciPy's, .*, got a ndarray: write"),
        (LinearConstraint(A[:, :2]), r"a matrix of 3 columns, got shape \(3, 2\)"),
        (LinearConstraint(A[0], 2.0, 1.0), "must have lb <= ub, got lb"),
        (LinearConstraint(A[0], np.nan, 1.0), "must have lb <= ub, got lb"),
    ],
)
def test_other_constraints_are_refused_by_name(given: Any, told: str) -> None:
    with pytest.raises(InvalidInputError, match=told):
        minimize(tilted_bowl, START, constraints=given)


def test_a_nonlinear_constraint_of_scipy_is_taken_component_by_component() -> None:
    def values(x: np.ndarray) -> np.ndarray:
        return np.array([x @ x, x[0] * x[1]])

    def slopes(x: np.ndarray) -> sp.csr_matrix:
        return sp.csr_matrix([2 * x, [x[1], x[0], 0.0]])

    given = [
        NonlinearConstraint(values, [-np.inf, 0.25], [4.0, 0.25], jac=slopes),
        LinearConstraint(A[0], ub=9),
    ]
    result = minimize(tilted_bowl, [0.5, 0.5, 0.0], BundleTrust(tolerance=1e-8), constraints=given)
    ball, product = result.constraints
    assert (ball.upper, ball.active, product.lower, product.upper) == (4.0, True, 0.25, 0.25)
    assert values(result.x) == pytest.approx([4.0, 0.25], rel=1e-6)


def test_points_are_not_projected_onto_nonlinear_constraints() -> None:
    with pytest.raises(
        InvalidInputError, match="onto linear constraints only, got a NonlinearConstraint: leave"
    ):
        nearest_feasible(START, None, [NonlinearConstraint(curve, 0.0, 1.0)])


def test_a_value_alone_that_is_no_number_is_refused() -> None:
    task = ForScipy(tilted_bowl, START, value=lambda x: np.nan)
    with pytest.raises(
        InvalidInputError, match="value must return a finite number, got nan in entry 0 at ev"
    ):
        task.arguments("COBYLA")["fun"](START)


# Maxima of which several functions are known at a point: fewer evaluations, the same minimum.
METHOD = BundleTrust(tolerance=1e-7)


class LargestQuadratic:
    """The largest of some convex quadratics, of which it tells all or one."""

    def __init__(self, told: bool, count: int = 12, n: int = 8) -> None:
        rng = np.random.default_rng(7)
        roots = rng.standard_normal((count, n, n))
        self.matrices = np.einsum("kij,klj->kil", roots, roots) / n + np.eye(n)
        self.centres, self.told, self.calls = rng.standard_normal((count, n)), told, 0

    def all(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = np.einsum("kij,kj->ki", self.matrices, x - self.centres)
        return 0.5 * np.einsum("ki,ki->k", turned, x - self.centres), turned

    def __call__(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        self.calls += 1
        values, slopes = self.all(x)
        return float(values.max()), slopes[values.argmax()]

    def pieces(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = self.all(x)
        rest = np.delete(np.arange(len(values)), values.argmax()) if self.told else []
        return values[rest], slopes[rest].reshape(-1, len(x))


@pytest.mark.parametrize("start", [0.0, 3.0])
def test_all_planes_find_the_minimum_in_fewer_evaluations(start: float) -> None:
    one, all_told = LargestQuadratic(False), LargestQuadratic(True)
    x0 = np.full(8, start)
    slow, fast = minimize(one, x0, METHOD), minimize(all_told, x0, METHOD)
    assert fast.reason.success
    assert fast.value == pytest.approx(slow.value, rel=1e-6)
    assert fast.evaluations == all_told.calls
    assert fast.evaluations < 0.6 * slow.evaluations


def test_small_bundles_and_constraints_go_with_them() -> None:
    fun, plain = LargestQuadratic(True), LargestQuadratic(False)
    ball = PiecesNonlinearConstraint(lambda x: (float(x @ x), 2.0 * x), upper=0.01, name="ball")
    known = minimize(plain, np.zeros(8), METHOD, constraints=ball)
    small = minimize(fun, np.zeros(8), BundleTrust(tolerance=1e-7, max_bundle=5), constraints=ball)
    assert small.value == pytest.approx(known.value, rel=1e-5)
    assert small.x @ small.x <= 0.01 * (1 + 1e-6)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((np.zeros(2), np.zeros((2, 3))), r"pieces must return \(k,\), \(k, 8\), got"),
        ((np.array([np.nan]), np.zeros((1, 8))), "pieces must return finite values"),
    ],
)
def test_pieces_of_another_shape_are_refused(given: Any, words: str) -> None:
    fun = LargestQuadratic(True)
    fun.pieces = lambda x: given  # type: ignore[method-assign]
    with pytest.raises(InvalidInputError, match=words):
        minimize(fun, np.zeros(8), METHOD)
