"""SciPy's methods solve the package's problems: in its own words, scaled, and where designs do not exist."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize

from fenics_contact import minimize
from fenics_contact.design import ForScipy, LinearConstraints
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
    with pytest.raises(InvalidInputError, match="needs a method that keeps them, got 'L-BFGS-B': use SLSQP"):
        task.arguments("L-BFGS-B")


def test_a_problem_that_was_not_evaluated_has_no_best_design() -> None:
    with pytest.raises(InvalidInputError, match="none of 0 designs that were evaluated is feasible"):
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
