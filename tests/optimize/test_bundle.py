"""The bundle of cutting planes: merit, trust region, inexact and kinked functions."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact import Checkpoint, minimize
from fenics_contact._optimize.bundle import Bundle, Plane
from fenics_contact._optimize.bundle_trust import first_centre, stopping_test
from fenics_contact._optimize.constraints import LocalFeasibleSet, feasible_set
from fenics_contact._optimize.merit import correcting_step, neighbour, penalised_step, surroundings
from fenics_contact._optimize.nonlinear import SoftConstraint
from fenics_contact._optimize.problem import pose
from fenics_contact._optimize.result import Reason, StepKind
from fenics_contact._optimize.subproblem import Step, Trial, Trust, solve_step
from fenics_contact.design import BundleTrust, Kinked, LinearConstraints, NonlinearConstraint, Result
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from tests.optimize.cases import BY_NAME, Case
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


# Penalties grow as far as violations can be reduced, and small violations are corrected.
def soft(gradient: list[float], value: float, penalty: float = 1.0) -> SoftConstraint:
    return SoftConstraint(Bundle.of_centre(Plane(np.array(gradient)), 0.0), value, penalty, 1.0)


def around(bound: float = 9.0) -> LocalFeasibleSet:
    return feasible_set(2, (-bound, bound)).around(np.zeros(2), np.ones(2))


DOWN = Bundle.of_centre(Plane(np.array([-1.0, 0.0])), 0.0)


def test_a_penalty_that_is_large_enough_stays() -> None:
    given = [soft([1.0, 0.0], 0.5, 4.0)]
    step, priced = penalised_step(DOWN, around(), 10.0, given, 1e-6)
    assert priced == tuple(given)
    assert step.violations[0] == pytest.approx(0.0, abs=1e-8)
    assert step.move == pytest.approx([-0.5, 0.0], abs=1e-6)
    assert not step.stuck


def test_a_penalty_grows_until_the_step_reduces_the_violation() -> None:
    step, (one,) = penalised_step(DOWN, around(), 10.0, [soft([1.0, 0.0], 0.5, 0.1)], 1e-6)
    assert one.penalty == pytest.approx(10.0)
    assert step.violations[0] == pytest.approx(0.0, abs=1e-8)


def test_a_penalty_stays_that_takes_off_a_tenth_of_a_violation_and_grows_where_it_takes_off_less() -> None:
    # The step is t (ρ - 1) long, and all of the violation of 0.5 could be taken off.
    for penalty, wanted in ((1.006, 1.006), (1.004, 10.04)):
        _, (one,) = penalised_step(DOWN, around(), 10.0, [soft([1.0, 0.0], 0.5, penalty)], 1e-6)
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
    step, (one,) = penalised_step(DOWN, around(0.1), 10.0, [soft([1.0, 0.0], 4.0, 5.0)], 1e-6)
    assert one.penalty == 5.0
    assert step.violations[0] == pytest.approx(3.9, abs=1e-6)
    assert not step.stuck


def test_a_step_between_limits_that_contradict_each_other_is_stuck() -> None:
    step, _ = penalised_step(DOWN, around(), 10.0, [soft([0.0, 1.0], 1.0), soft([0.0, -1.0], 1.0)], 1e-6)
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


# The proximal parameter grows, waits and shrinks as the trial deserves.
TRUST = Trust(t=1.0, radius=10.0, t_least=1e-3, t_most=50.0, radius_least=1e-6)


def trial(change: float, slope: float, measure: float = 0.0, length: float = 1.0) -> Trial:
    step = Step(np.array([length]), 1.0, np.ones(1), 0.5, 0.1, 1.0)
    return Trial(step, change, slope, measure)


def test_parabola_through_prediction_and_value_gives_the_newton_step() -> None:
    # J = a y²/2 with slope -1 at the centre: t = 1 predicts 1 for y = 1; the minimiser is t = 1/a.
    for a in (0.5, 1.0, 4.0):
        assert trial(change=-1.0 + a / 2, slope=-1.0 + a).parabola == pytest.approx(1.0 / a)


@pytest.mark.parametrize(("change", "t"), [(-0.1, 1.0), (-0.75, 2.0), (-1.0, 10.0), (-7.0, 10.0)])
def test_t_grows_with_the_agreement_of_a_serious_step(change: float, t: float) -> None:
    assert TRUST.after_serious(trial(change, slope=-0.5)).t == pytest.approx(t)


def test_t_doubles_when_serious_steps_repeat_and_stays_below_its_limit() -> None:
    trust, seen = TRUST, []
    for _ in range(12):
        trust = trust.after_serious(trial(-0.3, slope=-0.1))
        seen.append(trust.t)
    assert seen[:4] == [1.0, 1.0, 2.0, 4.0]
    assert seen[-1] == 50.0


def test_null_step_that_improves_the_model_keeps_t() -> None:
    assert TRUST.after_null(trial(change=0.2, slope=0.5, measure=0.3)).t == 1.0


def test_null_step_whose_plane_lies_too_deep_shortens_t() -> None:
    assert TRUST.after_null(trial(change=0.2, slope=0.5, measure=1.1)).t == pytest.approx(0.5 / 1.2)


def test_null_step_that_is_far_off_shortens_t_at_the_second_time() -> None:
    far = trial(change=5.0, slope=9.0, measure=4.0)
    once = TRUST.after_null(far)
    assert once.t == 1.0
    assert once.after_null(far).t == pytest.approx(0.1)


def test_t_never_falls_below_its_least_value() -> None:
    trust = TRUST
    for _ in range(20):
        trust = trust.after_null(trial(change=9.0, slope=1.0, measure=8.0))
    assert trust.t == TRUST.t_least
    assert trust.exhausted
    assert not TRUST.exhausted


def test_radius_halves_the_rejected_step_and_doubles_after_a_long_serious_one() -> None:
    trust = TRUST.after_rejection(4.0)
    assert trust.radius == 2.0
    assert trust.after_serious(trial(-0.9, -0.5, length=1.9)).radius == 4.0
    assert trust.after_serious(trial(-0.9, -0.5, length=0.3)).radius == 2.0
    assert TRUST.after_rejection(1e-6).cornered


def stop(error: float, norm: float, t: float, longer: float = 0.0) -> Reason | None:
    test = stopping_test(99.0, tolerance=1e-2, value_scale=1.0, reach=2.0, first_t=1.0)
    assert test.limit == pytest.approx(1.0)
    step = Step(np.array([t * norm]), error + t * norm**2, np.ones(1), norm, error, t)
    other = Step(np.zeros(1), longer, np.ones(1), 0.0, longer, 1.0)
    return test.reason(step, lambda _: other)


@pytest.mark.parametrize("t", [1e-6, 1.0, 10.0])
def test_certificate_alone_stops_whatever_t_is(t: float) -> None:
    assert stop(error=0.5, norm=0.2, t=t, longer=9.0) is Reason.STATIONARY


def test_certificate_reaches_as_far_as_the_step_does() -> None:
    assert stop(error=0.5, norm=0.2, t=1e3) is None


def test_predicted_decrease_stops_when_the_certificate_is_near() -> None:
    assert stop(error=0.2, norm=0.8, t=1.0) is Reason.CONVERGED


def test_small_predicted_decrease_does_not_stop_far_from_the_certificate() -> None:
    assert stop(error=0.2, norm=8.0, t=0.01) is None


def test_small_predicted_decrease_does_not_stop_when_it_is_small_only_for_a_small_t() -> None:
    assert stop(error=0.2, norm=2.0, t=0.1, longer=1.5) is None
    assert stop(error=0.2, norm=2.0, t=0.1, longer=0.9) is Reason.CONVERGED


# A function that may be inexact is asked for no more than needed, and its minimum is found all the same.

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
    with pytest.raises(InvalidInputError, match=r"inexactness must be in \[0, 0.025\], got"):
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


# A function that may return what is no subgradient, and says so: the method does not stop on it.
KinkedArray = np.ndarray


@dataclass
class Folded:
    """c·x plus a parabola and kinks, computed as contacts would: of pieces that open and close at x_k = 0.

    c_k x_k is c_k max(0, x_k) − c_k max(0, −x_k). At x_k = 0 both pieces are weakly active: released they
    give the slope 0, held 2 c_k, and neither is a subgradient.
    """

    slopes: KinkedArray
    centre: KinkedArray
    kinks: float = 0.0
    held: bool = False
    asked: list[KinkedArray] = field(default_factory=list)

    def value(self, x: KinkedArray) -> float:
        parabola = 0.5 * (x - self.centre) @ (x - self.centre)
        return float(self.slopes @ x + parabola + self.kinks * np.abs(x).sum())

    def gradient(self, x: KinkedArray) -> KinkedArray:
        ahead, behind = (x >= 0.0, x <= 0.0) if self.held else (x > 0.0, x < 0.0)
        folded = self.slopes * (1.0 * ahead + 1.0 * behind) + self.kinks * (1.0 * ahead - 1.0 * behind)
        return np.asarray(folded + x - self.centre)

    @property
    def minimiser(self) -> KinkedArray:
        free = self.centre - self.slopes
        return np.asarray(np.sign(free) * np.maximum(np.abs(free) - self.kinks, 0.0))

    def __call__(self, x: KinkedArray) -> tuple[float, KinkedArray]:
        return self.value(x), self.gradient(x)

    def may_be_invalid(self, x: KinkedArray) -> bool:
        return bool(np.any(x == 0.0))

    def gradient_near(self, x: KinkedArray, end: KinkedArray) -> KinkedArray:
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


class KinkedRough(Folded):
    """The same, as inexact as it may be."""

    inexact = True

    def within(self, x: KinkedArray, value: float, subgradient: float) -> tuple[float, KinkedArray, float]:
        error, slope = min(value, 0.1), min(subgradient, 0.1)
        gradient = self.gradient(x)
        return self.value(x) + error, gradient * (1.0 + slope), error


def test_an_inexact_function_is_looked_into_as_well() -> None:
    known = folded(kinks=0.5)
    fun = KinkedRough(known.slopes, known.centre, known.kinks)
    result = minimize(fun, np.zeros(3), bounds=(-5.0, 5.0))
    assert result.reason.success
    assert result.value - fun.value(fun.minimiser) < 2e-4
    assert result.evaluations < 60


class Alone(Folded):
    """It does not exist near the origin."""

    def gradient_near(self, x: KinkedArray, end: KinkedArray) -> KinkedArray:
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


# Every wrong argument is an error that says what is needed, what was given and what to do.
def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
    return float(x @ x) + 1.0, 2 * x


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"bounds": (0.0, 1.0, 2.0)}, r"pair \(lower, upper\), got 3"),
        ({"bounds": (np.zeros(3), 1.0)}, r"lower bound must have shape \(2,\) like x0, got \(3,\)"),
        ({"bounds": (-5.0, [np.nan, 1.0])}, "upper bound must hold numbers, got nan"),
        ({"bounds": ([0.0, 3.0], 2.0)}, r"lower must be <= upper, got 3 > 2 for x\[1\]"),
        ({"bounds": (2.0, 9.0)}, r"x\[0\] = 1 is below its lower bound 2.*nearest_feasible"),
        ({"bounds": (-9.0, [9.0, 0.5])}, r"x\[1\] = 1 is above its upper bound 0.5"),
        ({"constraints": LinearConstraints(np.ones(2), np.ones(1))}, "A must have 2 dim"),
        ({"constraints": LinearConstraints(np.ones((1, 3)), np.ones(1))}, r"A must have shape \(1, 2\)"),
        ({"constraints": LinearConstraints(np.ones((1, 2)), [np.inf])}, "A and b must be finite"),
        ({"constraints": LinearConstraints([[2.0, 1.0]], [1.0])}, "row 0 of A x ≤ b is exceeded by 2"),
        (
            {"constraints": LinearConstraints([[2.0, 1.0]], [9.0], [[1.0, 0.0]], [2.0])},
            "row 0 of E x = e is missed by -1",
        ),
        (
            {"constraints": LinearConstraints([[2.0, 1.0]], [9.0], [[1.0, 0.0]])},
            "both equality_matrix and equality_value",
        ),
        ({"scale": [1.0, -1.0]}, "scale must be positive"),
        ({"scale": np.ones(3)}, r"scale must be positive, a number or of shape \(2,\)"),
    ],
)
def test_wrong_feasible_set_is_refused(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        minimize(bowl, [1.0, 1.0], **arguments)


@pytest.mark.parametrize(
    ("start", "text"),
    [
        ([[1.0, 2.0]], r"x0 must have shape \(n,\).*got \(1, 2\)"),
        ([], "n ≥ 1"),
        ([1.0, np.nan], r"x0 must be finite, got x0\[1\] = nan"),
    ],
)
def test_wrong_start_is_refused(start: Any, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        minimize(bowl, start)


def test_many_violations_are_counted() -> None:
    with pytest.raises(InvalidInputError, match=r"x\[2\].* and 7 more"):
        minimize(bowl, np.zeros(10), bounds=(1.0, 2.0))


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (3.0, r"must return \(value, subgradient\), got float at evaluation 1"),
        ((3.0, np.ones(3)), r"subgradient \(2,\), got \(\), \(3,\)"),
        ((np.ones(2), np.ones(2)), r"needs a number and subgradient.*got \(2,\)"),
        (
            (np.nan, np.ones(2)),
            "finite value, got nan in entry 0 at evaluation 1: or raise InvalidDesignError",
        ),
        ((1.0, np.array([0.0, -np.inf])), "finite subgradient, got -inf in entry 1 at evaluation 1"),
    ],
)
def test_answer_of_the_function_is_checked(answer: Any, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        minimize(lambda x: answer, [1.0, 1.0])


def test_nan_in_a_later_evaluation_is_named_with_its_number() -> None:
    calls = []

    def fun(x: np.ndarray) -> tuple[float, np.ndarray]:
        calls.append(x)
        return (np.nan if len(calls) == 3 else bowl(x)[0]), bowl(x)[1] + [0.0, 0.1]

    with pytest.raises(InvalidInputError, match="got nan in entry 0 at evaluation 3"):
        minimize(fun, [4.0, 1.0])


def test_number_as_array_of_one_entry_is_a_number() -> None:
    result = minimize(lambda x: (np.array([bowl(x)[0]]), list(bowl(x)[1])), [1.0, 1.0])  # type: ignore[arg-type,return-value]
    assert result.value == pytest.approx(1.0, abs=2e-4)
