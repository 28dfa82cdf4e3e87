"""A function that may be inexact is asked for no more than needed, and its minimum is found all the same."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Checkpoint, minimize
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import BundleTrust, Result
from fenics_contact.errors import InvalidInputError
from tests.optimize.cases import BY_NAME, Case
from tests.optimize.functions import Array

#: Convex and constrained, with and without kinks at the minimum.
NAMES = ("CB2", "QL", "Shor", "Maxquad", "Maxl", "MAD4", "HS86")
#: Relative errors above which a solver is not called one.
ROUGHEST = (0.3, 0.1)


class Rough:
    """A function that is wrong by as much as it may be: the value up or down, the subgradient anywhere."""

    inexact = True

    def __init__(self, case: Case, seed: int = 1, floor: float = 0.0) -> None:
        self.case, self.rng, self.floor = case, np.random.default_rng(seed), floor
        self.asked: list[tuple[float, float]] = []

    def __call__(self, x: Array) -> tuple[float, Array]:
        raise AssertionError("the exact value was never to be asked for")

    def within(self, x: Array, value: float, subgradient: float) -> tuple[float, Array, float]:
        self.asked.append((value, subgradient))
        exact, gradient = self.case.fun(x)
        error = max(min(value, ROUGHEST[0] * (1 + abs(exact))), self.floor)
        slope = max(min(subgradient, ROUGHEST[1]), self.floor)
        noise = self.rng.standard_normal(x.size)
        turned = gradient + slope * np.linalg.norm(gradient) * noise / np.linalg.norm(noise)
        return exact + error * self.rng.choice([-1.0, 1.0]), turned, error


@cache
def solved(name: str, tolerance: float) -> tuple[Rough, Result]:
    case = BY_NAME[name]
    rough = Rough(case)
    method = BundleTrust(tolerance=tolerance, max_iterations=1000, max_evaluations=2000)
    return rough, minimize(rough, case.start, method, bounds=case.bounds, constraints=case.constraints)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
@pytest.mark.parametrize("name", NAMES)
def test_the_minimum_is_found_to_the_tolerance_of_the_optimiser(name: str, tolerance: float) -> None:
    rough, result = solved(name, tolerance)
    case = BY_NAME[name]
    assert result.reason.success
    # The function errs at random in every evaluation: twice the tolerance is left to that.
    limit = tolerance * (1 + abs(case.minimum))
    assert case.fun(result.x)[0] - case.minimum < 2 * limit
    assert abs(result.value - case.fun(result.x)[0]) < 1.001 * result.error
    assert result.error <= 0.02 * limit
    errors = [record.error for record in result.history]
    assert max(errors) > 100 * limit, "the function was never inexact"
    assert len(rough.asked) == result.evaluations == len(result.history)


@pytest.mark.parametrize("name", NAMES)
def test_accuracy_follows_the_predicted_decrease(name: str) -> None:
    rough, result = solved(name, 1e-6)
    assert rough.asked[0] == (np.inf, 0.01)
    tried = [record for record in result.history if record.kind in (StepKind.SERIOUS, StepKind.NULL)]
    assert all(record.error <= 0.02 * record.predicted_decrease for record in tried)
    assert all(2e-3 * record.predicted_decrease < record.error for record in tried[1:])


@pytest.mark.parametrize("name", NAMES)
def test_the_centre_is_confirmed_before_the_method_stops(name: str) -> None:
    _, result = solved(name, 1e-6)
    kinds = [record.kind for record in result.history]
    assert kinds[-1] is StepKind.REFINED
    again = [k for k, record in enumerate(result.history) if record.kind is StepKind.REFINED]
    assert all(result.history[k].iteration == result.history[k - 1].iteration for k in again)
    assert all(result.history[k].value == result.history[k].best for k in again)
    assert len(again) < 0.4 * len(kinds)


def test_what_an_exact_function_costs_is_not_changed() -> None:
    case = BY_NAME["Shor"]
    exact = minimize(case.fun, case.start)
    assert StepKind.REFINED not in {record.kind for record in exact.history}
    assert {record.error for record in exact.history} == {exact.error} == {0.0}
    method = BundleTrust(inexactness=1e-3)
    assert minimize(case.fun, case.start, method).history == exact.history


def test_a_function_that_cannot_do_better_ends_with_what_it_has() -> None:
    case = BY_NAME["Maxquad"]
    rough = Rough(case, floor=1e-7)
    result = minimize(rough, case.start, BundleTrust(tolerance=1e-4, max_iterations=500))
    assert result.reason.success
    assert case.fun(result.x)[0] - case.minimum < 2e-4 * (1 + abs(case.minimum))
    assert min(value for value, _ in rough.asked) < 1e-6


@pytest.mark.parametrize("share", [0.0, 0.025, -1.0])
def test_errors_that_could_pass_for_a_descent_are_refused(share: float) -> None:
    with pytest.raises(InvalidInputError, match=r"inexactness must lie between 0 and half of descent, 0.025"):
        BundleTrust(inexactness=share)


def test_an_inexact_run_goes_on_from_its_checkpoint_with_the_same_demands(tmp_path: Path) -> None:
    case, path = BY_NAME["Shor"], tmp_path / "run.npz"
    whole = Rough(case)
    expected = minimize(whole, case.start)
    first, second = Rough(case), Rough(case)
    short = replace(BundleTrust(), max_evaluations=9, raise_on_failure=False)
    minimize(first, case.start, short, checkpoint=Checkpoint(path))
    second.rng = first.rng
    result = minimize(second, case.start, checkpoint=Checkpoint(path))
    assert first.asked + second.asked == whole.asked
    assert result.history == expected.history
