"""A function that may return what is no subgradient, and says so: the method does not stop on it."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Checkpoint, minimize
from fenics_contact._optimize.merit import neighbour
from fenics_contact._optimize.problem import pose
from fenics_contact._optimize.result import Reason, StepKind
from fenics_contact.design import BundleTrust, Kinked, LinearConstraints
from fenics_contact.errors import InvalidDesignError

Array = np.ndarray


@dataclass
class Folded:
    """c·x plus a parabola and kinks, computed as contacts would: of pieces that open and close at x_k = 0.

    c_k x_k is c_k max(0, x_k) − c_k max(0, −x_k). At x_k = 0 both pieces are weakly active: released they
    give the slope 0, held 2 c_k, and neither is a subgradient.
    """

    slopes: Array
    centre: Array
    kinks: float = 0.0
    held: bool = False
    asked: list[Array] = field(default_factory=list)

    def value(self, x: Array) -> float:
        parabola = 0.5 * (x - self.centre) @ (x - self.centre)
        return float(self.slopes @ x + parabola + self.kinks * np.abs(x).sum())

    def gradient(self, x: Array) -> Array:
        ahead, behind = (x >= 0.0, x <= 0.0) if self.held else (x > 0.0, x < 0.0)
        folded = self.slopes * (1.0 * ahead + 1.0 * behind) + self.kinks * (1.0 * ahead - 1.0 * behind)
        return np.asarray(folded + x - self.centre)

    @property
    def minimiser(self) -> Array:
        free = self.centre - self.slopes
        return np.asarray(np.sign(free) * np.maximum(np.abs(free) - self.kinks, 0.0))

    def __call__(self, x: Array) -> tuple[float, Array]:
        return self.value(x), self.gradient(x)

    def may_be_invalid(self, x: Array) -> bool:
        return bool(np.any(x == 0.0))

    def gradient_near(self, x: Array, end: Array) -> Array:
        self.asked.append(end)
        return self.gradient(x + 1e-6 * (end - x))


def folded(seed: int = 1, size: int = 3, **more: object) -> Folded:
    """Its pieces cancel at the origin: released it seems to be at rest there."""
    return replace(Folded(np.random.default_rng(seed).standard_normal(size), np.zeros(size)), **more)


@pytest.mark.parametrize("size", [1, 3, 7])
def test_an_optimum_that_is_none_is_left(size: int) -> None:
    fun, box = folded(size=size), (-5.0, 5.0)
    believed = minimize(lambda x: fun(x), np.zeros(size), bounds=box)
    assert (believed.reason, believed.evaluations) == (Reason.STATIONARY, 1)
    assert np.all(believed.x == 0.0)
    result = minimize(fun, np.zeros(size), bounds=box)
    assert result.reason.success
    assert result.value == pytest.approx(fun.value(fun.minimiser), abs=1e-4)
    assert result.x == pytest.approx(fun.minimiser, abs=0.02)
    second = result.history[1]
    assert (second.kind, second.value) == (StepKind.REFINED, fun.value(np.zeros(size)))
    assert "nearby" in second.note


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("held", [False, True])
def test_kinks_that_are_some_are_told_from_those_that_are_none(seed: int, held: bool) -> None:
    """Variables end on true kinks at zero, where what is returned is no subgradient either."""
    fun = folded(seed, 5, kinks=0.7, held=held)
    assert np.any(fun.minimiser == 0.0)
    method = BundleTrust(tolerance=1e-6, locality=0.0)
    result = minimize(fun, np.zeros(5), method, bounds=(-3.0, 3.0))
    assert result.reason.success
    assert result.value - fun.value(fun.minimiser) < 5e-6


def test_a_promise_that_is_none_is_no_end() -> None:
    """Held at the start, the pieces promise a descent along which the function rises."""
    fun = Folded(np.array([1.0, -1.0]), np.array([1.5, -1.5]), held=True)
    start = np.zeros(2)
    assert fun.gradient(start) @ (fun.minimiser - start) > 0.0
    believed = minimize(lambda x: fun(x), start, bounds=(-5.0, 5.0))
    assert np.array_equal(believed.x, start)
    assert believed.value > fun.value(fun.minimiser) + 0.2
    result = minimize(fun, start, bounds=(-5.0, 5.0))
    assert result.reason.success
    assert result.value == pytest.approx(fun.value(fun.minimiser), abs=1e-3)


def test_what_is_no_kink_costs_nothing() -> None:
    fun = folded(kinks=0.7)
    start = np.array([1.0, 2.0, -1.0])
    plain = minimize(lambda x: fun(x), start, BundleTrust(max_evaluations=4, raise_on_failure=False))
    result = minimize(fun, start, BundleTrust(max_evaluations=4, raise_on_failure=False))
    assert result.history == plain.history
    assert fun.asked == []


def test_no_stop_is_called_stationary_for_want_of_evaluations() -> None:
    method = BundleTrust(max_evaluations=1, raise_on_failure=False)
    assert minimize(folded(), np.zeros(3), method).reason is Reason.EVALUATION_LIMIT


@pytest.mark.parametrize("stop", range(1, 7))
def test_a_run_goes_on_where_it_was_also_in_doubt(stop: int, tmp_path: Path) -> None:
    whole = minimize(folded(kinks=0.3), np.zeros(3), bounds=(-5.0, 5.0))
    assert whole.evaluations > stop
    kept = Checkpoint(tmp_path / "run.npz")
    short = BundleTrust(max_evaluations=stop, raise_on_failure=False)
    minimize(folded(kinks=0.3), np.zeros(3), short, bounds=(-5.0, 5.0), checkpoint=kept)
    result = minimize(folded(kinks=0.3), np.zeros(3), bounds=(-5.0, 5.0), checkpoint=kept)
    assert result.history == whole.history
    assert np.array_equal(result.x, whole.x)


class Rough(Folded):
    """The same, as inexact as it may be."""

    inexact = True

    def within(self, x: Array, value: float, subgradient: float) -> tuple[float, Array, float]:
        error, slope = min(value, 0.1), min(subgradient, 0.1)
        gradient = self.gradient(x)
        return self.value(x) + error, gradient * (1.0 + slope), error


def test_an_inexact_function_is_looked_into_as_well() -> None:
    known = folded(kinks=0.5)
    fun = Rough(known.slopes, known.centre, known.kinks)
    result = minimize(fun, np.zeros(3), bounds=(-5.0, 5.0))
    assert result.reason.success
    assert result.value - fun.value(fun.minimiser) < 2e-4
    assert result.evaluations < 60


class Alone(Folded):
    """It does not exist near the origin."""

    def gradient_near(self, x: Array, end: Array) -> Array:
        raise InvalidDesignError("nothing is here")


def test_where_no_point_nearby_can_be_evaluated_a_warning_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    fun = Alone(np.ones(2), np.zeros(2))
    with caplog.at_level(logging.WARNING):
        result = minimize(fun, np.zeros(2), bounds=(-5.0, 5.0))
    assert result.reason.success
    assert "the subgradient of evaluation 2 may be invalid: nothing is here" in caplog.text


def test_functions_that_know_nothing_of_kinks_are_none() -> None:
    assert isinstance(folded(), Kinked)
    assert not isinstance(lambda x: (0.0, x), Kinked)


CONSTRAINED = {
    "free": (None, None),
    "a corner of the box": ((0.0, 1.0), None),
    "a narrow box": ((-1e-9, 1e-9), None),
    "a plane": ((-1.0, 1.0), LinearConstraints(np.zeros((0, 5)), np.zeros(0), np.ones((1, 5)), np.zeros(1))),
    "a half space": (None, LinearConstraints(np.ones((1, 5)), np.zeros(1))),
}


@pytest.mark.parametrize("name", CONSTRAINED)
def test_neighbours_are_feasible_near_and_always_the_same(name: str) -> None:
    bounds, constraints = CONSTRAINED[name]
    problem = pose(folded(size=5), np.zeros(5), bounds, constraints)
    point = neighbour(problem, problem.start)
    assert problem.allowed.violations(point) == []
    assert 0.0 < np.linalg.norm((point - problem.start) / problem.scale) <= 0.0101 * problem.length
    assert np.array_equal(point, neighbour(problem, problem.start))
    assert np.abs((point - problem.start) / problem.scale).min() > 1e-6 * problem.length


def test_where_one_point_alone_is_feasible_it_has_no_neighbour() -> None:
    problem = pose(folded(size=2), np.ones(2), (1.0, 1.0))
    assert np.array_equal(neighbour(problem, problem.start), np.ones(2))
