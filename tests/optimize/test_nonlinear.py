"""Nonlinear constraints are met at the stop, and their minima are the published or analytic ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize

from fenics_contact import Checkpoint, minimize
from fenics_contact._optimize.nonlinear import scaled_constraints
from fenics_contact._optimize.result import Reason, StepKind
from fenics_contact.design import (
    BundleTrust,
    ForScipy,
    LinearConstraints,
    NonlinearConstraint,
    NotConvergedError,
    Result,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import InvalidDesignError
from tests.optimize.functions import Array, Fun, cb2, hs86, maxquad, mifflin1
from tests.optimize.nonlinear_cases import CASES, NONLINEAR, Case, downhill, equal, square

METHOD = BundleTrust(tolerance=1e-6, max_iterations=500, max_evaluations=1000)


every = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


@cache
def solved(name: str, method: BundleTrust = METHOD) -> Result:
    case = NONLINEAR[name]
    constraints = list(case.constraints)
    return minimize(case.fun, case.start, method, bounds=case.bounds, constraints=constraints, restore=True)


@every
def test_constrained_minimum_is_found_and_constraints_are_met(case: Case) -> None:
    result = solved(case.name)
    assert result.reason.success
    assert abs(result.value - case.minimum) <= 3e-6 * (1 + abs(case.minimum))
    assert result.violation <= 1e-6
    assert 5 < result.evaluations <= case.most


@every
def test_multipliers_are_those_of_the_limits(case: Case) -> None:
    found = [one.multiplier for one in solved(case.name).constraints]
    assert found == pytest.approx(case.multipliers, rel=1e-2, abs=1e-6)
    assert [one.active for one in solved(case.name).constraints] == [m != 0.0 for m in case.multipliers]


@every
def test_equalities_are_met_at_every_point_that_is_tried(case: Case) -> None:
    tried = []

    def fun(x: Array) -> tuple[float, Array]:
        tried.append([abs(one.fun(x)[0] - one.upper) / one.size for one in case.constraints if one.equality])
        return case.fun(x)

    minimize(fun, case.start, METHOD, bounds=case.bounds, constraints=case.constraints, restore=True)
    assert len(tried) == solved(case.name).evaluations
    assert np.max(tried, initial=0.0) <= 1e-6


def test_value_and_violation_of_each_evaluation_are_recorded() -> None:
    history = solved("Rosen-Suzuki").history
    assert {record.kind for record in history} == {StepKind.START, StepKind.SERIOUS, StepKind.NULL}
    assert max(record.violation for record in history) > 0.1, "no trial point was infeasible"
    assert history[-1].violation <= 1e-6


@pytest.mark.parametrize("size", [1e-4, 1e5])
def test_units_of_objective_and_constraint_do_not_matter(size: float) -> None:
    plain = solved("LQ")
    limit = NonlinearConstraint(lambda x: (float(x @ x) / size, 2 * x / size), 1.0 / size)
    result = minimize(
        lambda x: (size * downhill(x)[0], size * downhill(x)[1]),
        [-0.5, -0.5],
        replace(METHOD, value_scale=size),
        constraints=limit,
    )
    assert result.evaluations == plain.evaluations
    assert result.x == pytest.approx(plain.x, abs=1e-6)
    assert result.constraints[0].multiplier == pytest.approx(
        size**2 * plain.constraints[0].multiplier, rel=1e-6
    )


def test_nonsmooth_objective_and_nonsmooth_constraint_agree_with_smooth_programming() -> None:
    # max of CB2's three pieces over the disc, as a smooth programme with the value as a variable.
    result = minimize(cb2, [0.0, 0.0], METHOD, constraints=NonlinearConstraint(square, 1.0))
    pieces = [
        lambda z: z[2] - z[0] ** 2 - z[1] ** 4,
        lambda z: z[2] - (2 - z[0]) ** 2 - (2 - z[1]) ** 2,
        lambda z: z[2] - 2 * np.exp(z[1] - z[0]),
        lambda z: 1 - z[0] ** 2 - z[1] ** 2,
    ]
    smooth = scipy.optimize.minimize(
        lambda z: z[2], [0.5, 0.5, 9.0], constraints=[{"type": "ineq", "fun": piece} for piece in pieces]
    )
    assert smooth.success
    assert result.value == pytest.approx(smooth.fun, abs=1e-5)
    assert result.constraints[0].active


def test_both_limits_of_a_constraint_hold() -> None:
    line: Fun = lambda x: (float(x[0] + x[1]), np.ones(2))  # noqa: E731
    result = minimize(square, [0.6, 0.6], METHOD, constraints=NonlinearConstraint(line, upper=2.0, lower=1.0))
    assert result.x == pytest.approx([0.5, 0.5], abs=1e-5)
    assert result.constraints[0].multiplier == pytest.approx(-1.0, rel=1e-3)
    other = minimize(
        downhill, [0.6, 0.6], METHOD, constraints=NonlinearConstraint(line, upper=2.0, lower=1.0)
    )
    assert other.value == pytest.approx(-2.0, abs=1e-6)
    assert other.constraints[0].multiplier == pytest.approx(1.0, rel=1e-3)


def test_an_equality_and_a_limit_that_meet_at_an_angle_have_the_multipliers_that_balance_j() -> None:
    rise: Fun = lambda x: (float(-x[1]), np.array([0.0, -1.0]))  # noqa: E731
    line: Fun = lambda x: (float(x[1] - x[0]), np.array([-1.0, 1.0]))  # noqa: E731
    both = [equal(square, 2.0, "circle"), NonlinearConstraint(line, 0.5, name="line")]
    result = minimize(rise, [1.2, 0.5], METHOD, constraints=both, restore=True)
    across = (np.sqrt(15.0) - 1.0) / 4.0
    assert result.x == pytest.approx([across, across + 0.5], abs=1e-6)
    on_circle = 0.5 / (2.0 * across + 0.5)
    found = [one.multiplier for one in result.constraints]
    assert found == pytest.approx([on_circle, 2.0 * on_circle * across], rel=1e-4)


def test_linear_and_nonlinear_constraints_hold_together() -> None:
    rows = LinearConstraints([[1.0, -1.0]], [-0.5])
    result = minimize(downhill, [-0.5, 0.0], METHOD, constraints=[rows, NonlinearConstraint(square, 1.0)])
    assert np.array([1.0, -1.0]) @ result.x <= -0.5 + 1e-9
    # On the line x_1 = x_0 + 1/2 within the circle: 2 x_0² + x_0 - 3/4 = 0.
    end = (-1 + np.sqrt(7)) / 4
    assert result.x == pytest.approx([end, end + 0.5], abs=1e-5)


@pytest.mark.parametrize("constraint", [NonlinearConstraint(square, 0.01), equal(square, 0.01)])
def test_a_violated_start_is_restored_where_that_is_asked_for(constraint: NonlinearConstraint) -> None:
    start = np.full(10, 10.0)
    result = minimize(maxquad, start, METHOD, constraints=constraint, restore=True)
    assert result.reason.success
    assert result.x @ result.x == pytest.approx(0.01, rel=2e-6)
    assert result.evaluations < 170


@pytest.mark.parametrize(
    "constraint", [NonlinearConstraint(square, 2.0, name="disc"), equal(square, 2.0, "disc")]
)
def test_a_violated_start_is_named_with_its_value_and_limits(constraint: NonlinearConstraint) -> None:
    message = r"constraints, but disc is 3.25, limits \[(-inf|2), 2\]: .* restore=True"
    with pytest.raises(InvalidInputError, match=message):
        minimize(downhill, [1.5, 1.0], constraints=constraint)


def test_constraints_that_contradict_each_other_end_with_those_that_stay_violated() -> None:
    away: Fun = lambda x: (float((x - 4) @ (x - 4)), 2 * (x - 4))  # noqa: E731
    given = [
        NonlinearConstraint(square, 1.0, name="near zero"),
        NonlinearConstraint(away, 1.0, name="near four"),
    ]
    with pytest.raises(
        NotConvergedError, match=r"no step reduces .* violated: near zero: .*near four"
    ) as caught:
        minimize(downhill, [3.0, 2.0], METHOD, constraints=given, restore=True)
    best = caught.value.best
    assert best is not None
    assert best.reason is Reason.INFEASIBLE
    assert best.evaluations < 60


def test_a_constraint_that_no_point_meets_is_reported_where_its_violation_is_least() -> None:
    never = NonlinearConstraint(lambda x: (float(x @ x) + 1.0, 2 * x), 0.5)
    quiet = replace(METHOD, raise_on_failure=False)
    result = minimize(downhill, [3.0, 2.0], quiet, constraints=never, restore=True)
    assert result.reason is Reason.INFEASIBLE
    assert result.violation == pytest.approx(1.0, rel=0.2)


def test_an_equality_that_no_point_meets_is_named() -> None:
    never = equal(lambda x: (float(x @ x) + 1.0, 2 * x), 0.5, "volume")
    with pytest.raises(
        InvalidDesignError, match=r"starting design .* no design near it meets volume, .* misses it"
    ):
        minimize(downhill, [3.0, 2.0], METHOD, constraints=never, restore=True)


@pytest.mark.parametrize("name", ["Rosen-Suzuki", "Wong", "HS78", "stress"])
def test_a_small_bundle_stays_convergent(name: str) -> None:
    result = solved(name, replace(METHOD, max_bundle=8))
    assert result.reason.success
    assert abs(result.value - NONLINEAR[name].minimum) <= 1e-5 * (1 + abs(NONLINEAR[name].minimum))
    assert result.violation <= 1e-6


class Rough:
    """A function that is wrong by as much as it may be."""

    inexact = True

    def __init__(self, fun: Fun) -> None:
        self.fun, self.rng = fun, np.random.default_rng(1)
        self.errors: list[float] = []

    def __call__(self, x: Array) -> tuple[float, Array]:
        raise AssertionError("the exact value was never to be asked for")

    def within(self, x: Array, value: float, subgradient: float) -> tuple[float, Array, float]:
        exact, gradient = self.fun(x)
        error, noise = min(value, 0.3 * (1 + abs(exact))), self.rng.standard_normal(x.size)
        turned = min(subgradient, 0.1) * np.linalg.norm(gradient) * noise / np.linalg.norm(noise)
        self.errors.append(error)
        return exact + error * self.rng.choice([-1.0, 1.0]), gradient + turned, error


@pytest.mark.parametrize("name", ["Rosen-Suzuki", "LQ", "stress"])
def test_inexact_objectives_and_constraints_lead_to_the_same_minimum(name: str) -> None:
    case = NONLINEAR[name]
    rough = [replace(one, fun=Rough(one.fun)) for one in case.constraints]
    method = replace(METHOD, tolerance=1e-5)
    fun = Rough(case.fun)
    result = minimize(fun, case.start, method, bounds=case.bounds, constraints=rough, restore=True)
    assert result.reason.success
    assert abs(result.value - case.minimum) < 3e-5 * (1 + abs(case.minimum))
    exact = max(one.excess(one.fun(result.x)[0])[0] for one in case.constraints)
    assert exact < 1e-4
    for one in rough:
        assert isinstance(one.fun, Rough)
        assert max(one.fun.errors) > 1e-3, "the constraint was never inexact"


class Interrupted(Exception):
    """The process ends here."""


@pytest.mark.parametrize("name", ["Rosen-Suzuki", "HS78", "stress"])
def test_a_run_in_pieces_takes_the_same_bits(name: str, tmp_path: Path) -> None:
    case, checkpoint = NONLINEAR[name], Checkpoint(tmp_path / "run.npz")

    def run(most: int) -> Result:
        left = [most]

        def fun(x: Array) -> tuple[float, Array]:
            left[0] -= 1
            if left[0] < 0:
                raise Interrupted
            return case.fun(x)

        given = list(case.constraints)
        return minimize(
            fun,
            case.start,
            METHOD,
            bounds=case.bounds,
            constraints=given,
            restore=True,
            checkpoint=checkpoint,
        )

    for _ in range(2):
        with pytest.raises(Interrupted):
            run(4)
    result, whole = run(1000), solved(name)
    assert result.x.tobytes() == whole.x.tobytes()
    assert result.history == whole.history
    assert result.constraints == whole.constraints
    with pytest.raises(InvalidInputError, match="in nonlinear constraints"):
        minimize(case.fun, case.start, METHOD, bounds=case.bounds, checkpoint=checkpoint)


def test_a_design_on_which_a_constraint_does_not_exist_is_stepped_back_from() -> None:
    def limited(x: Array) -> tuple[float, Array]:
        if x[0] > 0.9:
            raise InvalidDesignError("no equilibrium")
        return square(x)

    method = replace(METHOD, first_step=3.0)
    result = minimize(mifflin1, [-0.5, 0.0], method, constraints=NonlinearConstraint(limited, 0.5))
    rejected = [record for record in result.history if record.kind is StepKind.REJECTED]
    assert rejected
    assert rejected[0].note == "no equilibrium"
    assert np.isnan(rejected[0].violation)
    assert result.value == pytest.approx(-np.sqrt(0.5), abs=1e-5)


class Doubting:
    """The kink of |x_0| as a constraint that returns the mean of both gradients there, and says so."""

    def __init__(self) -> None:
        self.beside_calls = 0

    def __call__(self, x: Array) -> tuple[float, Array]:
        return abs(float(x[0])) + float(x[1] ** 2), np.array([np.sign(x[0]), 2 * x[1]])

    def may_be_invalid(self, x: Array) -> bool:
        return bool(x[0] == 0.0)

    def gradient_near(self, x: Array, end: Array) -> Array:
        self.beside_calls += 1
        return np.array([np.sign(end[0]), 2 * x[1]])


def test_doubtful_subgradients_of_a_constraint_are_replaced_before_the_method_stops() -> None:
    doubting = Doubting()
    fun: Fun = lambda x: (float(-x[1]), np.array([0.0, -1.0]))  # noqa: E731
    result = minimize(fun, [0.0, 0.0], METHOD, constraints=NonlinearConstraint(doubting, 1.0))
    assert doubting.beside_calls > 0
    assert result.reason.success
    assert result.value == pytest.approx(-1.0, abs=1e-5)
    assert result.violation <= 1e-6


def test_scipy_keeps_the_same_constraints() -> None:
    case = NONLINEAR["Rosen-Suzuki"]
    task = ForScipy(case.fun, case.start, constraints=list(case.constraints))
    found = scipy.optimize.minimize(**task.arguments("SLSQP"))
    assert found.success
    assert task.best.value == pytest.approx(case.minimum, abs=1e-4)
    assert task.best.violation <= 1e-6
    with pytest.raises(InvalidInputError, match="constraints need SLSQP, trust-constr or COBYLA"):
        task.arguments("L-BFGS-B")


def test_a_result_names_its_active_constraints() -> None:
    names = ("disc", "unused")
    given = [
        NonlinearConstraint(square, limit, name=name) for limit, name in zip((1.0, 9.0), names, strict=True)
    ]
    result = minimize(downhill, [-0.5, -0.5], METHOD, constraints=given)
    assert "active disc; largest violation" in repr(result)
    assert str(result.constraints[0]).startswith("disc: 1 (≤ 1), active, multiplier 0.707")
    assert str(result.constraints[1]) == "unused: 1 (≤ 9), inactive"
    assert "constraints" not in repr(minimize(square, [1.0, 1.0]))
    assert "= 1)" in str(solved("circle").constraints[0])


def no_pair(x: Array) -> Any:
    return 1.0


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: NonlinearConstraint(3.0, 1.0), "needs x -> .*, got float"),
        (lambda: NonlinearConstraint(square), "a finite upper or lower is needed, got -inf and inf"),
        (lambda: NonlinearConstraint(square, 1.0, 2.0), "lower must not exceed upper, got 2.0 and 1.0"),
        (lambda: NonlinearConstraint(square, np.nan), "lower must not exceed upper, got"),
        (lambda: NonlinearConstraint(square, 1.0, scale=0.0), "scale of a constraint must be positive"),
        (lambda: BundleTrust(feasibility=0.0), "feasibility must be positive and finite"),
        (
            lambda: minimize(hs86, np.ones(5), constraints=NonlinearConstraint(no_pair, 2.0, name="force")),
            r"fun of force must return \(value, subgradient\), got float at evaluation 1",
        ),
    ],
)
def test_constraints_that_are_none_are_refused(build: Callable[[], Any], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        build()


def test_violations_are_parts_of_the_sizes_of_limits_on_either_side() -> None:
    four = [equal(square, 4.0), NonlinearConstraint(square, 4.0), NonlinearConstraint(square, lower=4.0)]
    assert scaled_constraints(four, np.full(3, 5.0)).violations == pytest.approx([0.25, 0.25, 0.0])
    assert scaled_constraints(four, np.full(3, 3.0)).violations == pytest.approx([0.25, 0.0, 0.25])


def test_sizes_of_constraints_follow_their_limits() -> None:
    assert NonlinearConstraint(square, 4.0, -5.0).size == 5.0
    assert NonlinearConstraint(square, 0.0).size == 1.0
    assert NonlinearConstraint(square, 4.0, scale=0.5).excess(5.0) == (2.0, 2.0)
    assert NonlinearConstraint(square, lower=4.0).excess(3.0) == (0.25, -0.25)
    assert equal(square, 4.0).excess(3.0) == (-0.25, 0.25)
