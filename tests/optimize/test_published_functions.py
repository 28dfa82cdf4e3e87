"""The method reaches the published minima of published functions, in a bounded number of evaluations."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from fenics_contact import minimize
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import BundleTrust, LinearConstraints, Result
from tests.optimize.cases import BY_NAME, CONSTRAINED, CONVEX, NONCONVEX, Case
from tests.optimize.functions import cb3, hs86, maxq

TOLERANCE = 1e-6
# The minima are published with seven digits or more.
PUBLISHED = 1e-7

all_cases = pytest.mark.parametrize("case", [*CONVEX, *NONCONVEX, *CONSTRAINED], ids=lambda case: case.name)


METHOD = BundleTrust(tolerance=TOLERANCE, max_iterations=500, max_evaluations=1000)


@cache
def solved(case: Case, method: BundleTrust = METHOD) -> Result:
    return minimize(case.fun, case.start, method, bounds=case.bounds, constraints=case.constraints)


def relative_error(case: Case, result: Result) -> float:
    return (result.value - case.minimum) / (1.0 + abs(case.minimum))


@all_cases
def test_subgradient_is_the_gradient_where_the_function_is_smooth(case: Case) -> None:
    generator = np.random.default_rng(1)
    x = case.start + 0.1 * np.abs(generator.standard_normal(case.start.size))
    direction = generator.standard_normal(case.start.size)
    h = 1e-6
    slope = (case.fun(x + h * direction)[0] - case.fun(x - h * direction)[0]) / (2 * h)
    assert abs(slope) > 1e-3, "a direction without slope tests nothing"
    assert case.fun(x)[1] @ direction == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("case", CONVEX, ids=lambda case: case.name)
def test_minimum_of_a_convex_function_is_found_to_the_tolerance(case: Case) -> None:
    result = solved(case)
    assert result.reason.success
    assert -PUBLISHED <= relative_error(case, result) <= TOLERANCE
    assert 5 < result.evaluations <= case.most_evaluations


@pytest.mark.parametrize("case", NONCONVEX, ids=lambda case: case.name)
def test_minimum_of_a_nonconvex_function_is_found_to_twenty_tolerances(case: Case) -> None:
    result = solved(case)
    assert result.reason.success
    assert -PUBLISHED <= relative_error(case, result) <= 20 * TOLERANCE
    assert 5 < result.evaluations <= case.most_evaluations


@pytest.mark.parametrize("case", CONSTRAINED, ids=lambda case: case.name)
def test_constrained_minimum_is_found_with_a_constraint_active(case: Case) -> None:
    result = solved(case)
    assert -PUBLISHED <= relative_error(case, result) <= TOLERANCE
    assert 5 < result.evaluations <= case.most_evaluations
    assert case.constraints is not None
    room = np.asarray(case.constraints.limit) - np.asarray(case.constraints.matrix) @ result.x
    assert -1e-8 < room.min() < 1e-6


@pytest.mark.parametrize("name", ["Maxl", "Goffin", "MXHILB"])
def test_a_convex_function_that_is_known_to_be_so_costs_fewer_evaluations(name: str) -> None:
    case = BY_NAME[name]
    trusting, careful = solved(case, replace(METHOD, locality=0.0)), solved(case)
    assert relative_error(case, trusting) <= TOLERANCE
    assert trusting.evaluations < 0.7 * careful.evaluations


@pytest.mark.parametrize("name", ["Rosen-Suzuki", "Shor", "Maxquad", "Mifflin1"])
def test_aggregation_keeps_a_small_bundle_convergent(name: str) -> None:
    case = BY_NAME[name]
    result = solved(case, replace(METHOD, max_bundle=6))
    assert max(record.bundle_size for record in result.history) == 6
    assert relative_error(case, result) <= TOLERANCE


@pytest.mark.parametrize("name", ["CB2", "Shor", "Maxquad", "Wolfe", "HS86"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_error_follows_the_tolerance(name: str, tolerance: float) -> None:
    case = BY_NAME[name]
    assert relative_error(case, solved(case, replace(METHOD, tolerance=tolerance))) <= max(
        tolerance, PUBLISHED
    )


@all_cases
def test_every_serious_step_descends_and_every_null_step_leaves_the_best_value(case: Case) -> None:
    history = solved(case).history
    kinds = {record.kind for record in history}
    assert StepKind.SERIOUS in kinds, "without a serious step this tests nothing"
    for before, after in pairwise(history):
        if after.kind is StepKind.SERIOUS:
            assert after.best == after.value < before.best - 0.05 * after.predicted_decrease * (1 - 1e-9)
        else:
            assert after.best == before.best


def test_minimum_with_an_active_bound_is_the_analytic_one() -> None:
    # The largest square over x_k ≥ k/10 is the square of the largest bound.
    lower = np.arange(1, 6) / 10
    result = minimize(maxq, np.full(5, 2.0), BundleTrust(tolerance=1e-8), bounds=(lower, 3.0))
    assert result.value == pytest.approx(0.25, rel=1e-7)
    assert (result.x >= lower).all()
    assert result.x[4] == pytest.approx(0.5, abs=1e-7)


def test_bounds_cut_off_the_free_minimum() -> None:
    # CB3 has its minimum 2 at (1, 1); on the edge x_0 = 0.5 its second piece rules, least at x_1 = b with
    # (2 - 0.5)² + (2 - b)² against 2 exp(b - 0.5).
    result = minimize(cb3, [0.0, 0.0], BundleTrust(tolerance=1e-8), bounds=([-1.0, -1.0], [0.5, 2.0]))
    b = np.linspace(-1.0, 2.0, 300_001)
    edge = np.max([0.5**4 + b**2, 1.5**2 + (2 - b) ** 2, 2 * np.exp(b - 0.5)], axis=0).min()
    assert result.x[0] == pytest.approx(0.5, abs=1e-8)
    assert result.value == pytest.approx(edge, abs=1e-5)
    assert result.value > 2.5


def test_linear_equality_is_kept_on_the_way() -> None:
    # Nearest point to the origin on x_0 + 2 x_1 - x_2 = 3 in the maximum norm: |x_k| = 3/4.
    row, met = np.array([[1.0, 2.0, -1.0]]), []

    def fun(x: np.ndarray) -> tuple[float, np.ndarray]:
        met.append(row @ x - 3.0)
        k = int(np.argmax(np.abs(x)))
        return abs(x[k]), np.sign(x[k]) * np.eye(3)[k]

    nothing = LinearConstraints(np.zeros((0, 3)), np.zeros(0), row, [3.0])
    result = minimize(fun, [0.0, 0.0, -3.0], BundleTrust(tolerance=1e-8), constraints=nothing)
    assert result.value == pytest.approx(0.75, abs=1e-7)
    assert len(met) > 3
    assert np.abs(met).max() < 1e-8


def test_variable_whose_bounds_coincide_stays_where_it_is() -> None:
    case = BY_NAME["HS86"]
    lower, upper = np.zeros(5), np.full(5, np.inf)
    lower[3] = upper[3] = 0.3
    start = np.array([0.0, 0.0, 0.0, 0.3, 1.0])
    fixed = minimize(hs86, start, bounds=(lower, upper), constraints=case.constraints)
    assert fixed.x[3] == 0.3
    assert fixed.value > case.minimum + 1e-3
    assert fixed.reason.success
