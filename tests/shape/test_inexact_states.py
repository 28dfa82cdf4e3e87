"""What a loosely solved state does to value and subgradient, and an optimiser that asks for what it needs."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, ShapeProblem
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import AdaptiveTolerance, DesignPoint, Result, WeakChoice
from fenics_contact.errors import InvalidInputError
from tests.contact.gallery import partitions
from tests.shape.objectives import objectives
from tests.shape.pressed import DESIGN, SWITCHES
from tests.shape.resumed_cases import BOUND, minimised, posed

JUDGES = tuple(objectives("block"))
LOOSE = (1e-2, 1e-3, 1e-4)
SEEDS = range(3)
EXACT, STOPPING = 1e-11, 1e-4


@cache
def point(judge: str, seed: int, tolerance: float) -> DesignPoint:
    """A random design of the block, solved from nothing."""
    problem = posed("block", MPI.COMM_SELF, AdaptiveTolerance(tolerance, tolerance))
    problem.objective = objectives("block")[judge]
    return problem.evaluate(0.01 * np.random.default_rng(seed).standard_normal(problem.size))


def missing(judge: str, seed: int, tolerance: float) -> tuple[float, float]:
    """What the value of a loose state misses, before and after its correction."""
    found, exact = point(judge, seed, tolerance), point(judge, seed, EXACT)
    return exact.value - (found.value - found.correction), exact.value - found.value


@pytest.mark.parametrize("tolerance", LOOSE)
@pytest.mark.parametrize("judge", JUDGES)
def test_the_error_of_the_value_is_known_from_the_adjoint(judge: str, tolerance: float) -> None:
    for seed in SEEDS:
        plain, corrected = missing(judge, seed, tolerance)
        found = point(judge, seed, tolerance)
        assert abs(plain) > 1e-10 * abs(found.value), "the state was accurate: nothing was tested"
        assert abs(corrected) < found.error
        assert found.error < 100 * tolerance * abs(found.value)


def test_the_correction_takes_most_of_the_error_away() -> None:
    pairs = np.array([missing(judge, seed, t) for judge in JUDGES for seed in SEEDS for t in LOOSE])
    left = np.abs(pairs[:, 1] / pairs[:, 0])
    assert np.median(left) < 0.01
    # Where shares of both signs cancel, an error may be small before it is corrected.
    assert np.mean(left > 1.0) < 0.1


@pytest.mark.parametrize("judge", JUDGES)
def test_the_subgradient_is_about_as_accurate_as_the_state(judge: str) -> None:
    for tolerance in LOOSE:
        errors = []
        for seed in SEEDS:
            found, exact = point(judge, seed, tolerance).gradient, point(judge, seed, EXACT).gradient
            errors.append(np.linalg.norm(found - exact) / np.linalg.norm(exact))
        assert 0.0 < np.median(errors) < 10 * tolerance


@cache
def found_by(name: str, adaptive: bool) -> tuple[ShapeProblem, Result]:
    problem = posed(name, MPI.COMM_SELF, AdaptiveTolerance() if adaptive else 1e-8)
    return problem, minimised(name, problem, None, max_evaluations=40, tolerance=STOPPING)


@pytest.mark.parametrize("name", BOUND)
def test_the_optimum_is_that_of_accurate_states_with_fewer_products(name: str) -> None:
    (rough, found), (fine, expected) = found_by(name, True), found_by(name, False)
    assert found.reason.success
    assert found.reason is expected.reason
    exact = posed(name, MPI.COMM_SELF, EXACT)
    value = exact.evaluate(found.x).value
    assert value < expected.value + STOPPING * (1 + abs(expected.value))
    assert abs(found.value - value) < max(found.error, 1e-9 * abs(value))
    assert rough.products < 0.75 * fine.products


@pytest.mark.parametrize("name", BOUND)
def test_errors_follow_the_predicted_decrease(name: str) -> None:
    _, found = found_by(name, True)
    tried = [record for record in found.history if record.kind in (StepKind.SERIOUS, StepKind.NULL)]
    assert len(tried) > 1
    assert all(0.0 < record.error < 0.02 * record.predicted_decrease for record in tried)
    assert found.history[-1].kind is StepKind.REFINED
    assert 0.0 < found.error < 0.02 * STOPPING * (1 + abs(found.value))


def test_no_more_accuracy_is_spent_than_asked_for() -> None:
    spent = []
    for share in (1e-2, 1e-5, 1e-8):
        problem = posed("block", MPI.COMM_SELF, AdaptiveTolerance(1e-2, 1e-10))
        alpha = 0.01 * np.random.default_rng(1).standard_normal(problem.size)
        value, _, error = problem.within(alpha, share * 0.1, 1.0)
        assert error <= share * 0.1
        assert abs(value) > 0.1
        spent.append(problem.products)
        assert problem.evaluations == 1
    assert spent[0] < spent[1] < spent[2]


def test_a_design_that_is_asked_for_again_is_solved_on() -> None:
    problem = posed("block", MPI.COMM_SELF, AdaptiveTolerance(1e-2, 1e-10))
    alpha = 0.01 * np.random.default_rng(1).standard_normal(problem.size)
    problem.within(alpha, np.inf, 1.0)
    first, loose = problem.products, problem.last
    problem.evaluate(alpha)
    fresh = posed("block", MPI.COMM_SELF, AdaptiveTolerance(1e-2, 1e-10))
    exact = fresh.evaluate(alpha)
    assert problem.products - first < fresh.products
    assert problem.last is not None
    assert problem.first is problem.best is problem.last is not loose
    assert problem.last.value == pytest.approx(exact.value, rel=1e-9)
    assert problem.last.gradient == pytest.approx(exact.gradient, rel=1e-6, abs=1e-7)


def test_states_of_one_tolerance_are_as_exact_as_they_get() -> None:
    problem = posed("block", MPI.COMM_SELF, 1e-6)
    value, _, error = problem.within(np.zeros(problem.size), np.inf, 1.0)
    assert not problem.inexact
    assert error == 0.0
    assert problem.last is not None
    assert value == problem.last.value
    assert problem.last.tolerance == 1e-6
    assert 0.0 < problem.last.error < 1e-4 * abs(value)


@pytest.mark.parametrize(("loosest", "tightest"), [(1e-3, 1e-2), (1.0, 1e-8), (1e-3, 0.0)])
def test_tolerances_that_are_no_range_are_refused(loosest: float, tightest: float) -> None:
    with pytest.raises(
        InvalidInputError, match=r"0 < tightest <= loosest < 1, got .*: try AdaptiveTolerance"
    ):
        AdaptiveTolerance(loosest, tightest)


@cache
def at_switch(switch: str, tolerance: float, choice: WeakChoice) -> DesignPoint:
    """The design at which one point lies on a switch of the contact law, by its stress."""
    exact = SWITCHES[switch]().problem()
    problem = ShapeProblem(
        ContactProblem(exact.scene, MPI.COMM_SELF, partitions=partitions(exact.scene)),
        exact.designs,
        objectives("block")["stress"],
        choice=choice,
        tolerance=tolerance,
    )
    return problem.evaluate(DESIGN)


@pytest.mark.slow
@pytest.mark.parametrize("switch", SWITCHES)
def test_on_a_wrong_face_the_subgradient_is_nearly_that_of_the_other_side(switch: str) -> None:
    """A loose state may lie on either side of a kink; what it gives is an inexact Clarke subgradient."""
    one, other = (at_switch(switch, EXACT, choice).gradient for choice in WeakChoice)
    kink, far = other - one, []
    for tolerance in (1e-2, 1e-3):
        found = at_switch(switch, tolerance, WeakChoice.RELEASED).gradient
        between = np.clip((found - one) @ kink / (kink @ kink), 0.0, 1.0)
        size = np.linalg.norm(one)
        assert np.linalg.norm(found - one - between * kink) < 0.3 * tolerance * size
        far.append(min(np.linalg.norm(found - side) / size for side in (one, other)))
    assert np.linalg.norm(kink) > 1e-3 * np.linalg.norm(one), "the two sides hardly differ"
    assert max(far) < 0.3 * np.linalg.norm(kink) / np.linalg.norm(one), "the subgradient is of neither side"
