"""The step solves its quadratic programme, whatever the size of its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import clarabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize as scipy_minimize

from fenics_contact._optimize import bundle as quadratic_program
from fenics_contact._optimize.bundle import Bundle, Plane, QuadraticProgram, SubproblemError, solve
from fenics_contact._optimize.constraints import FeasibleSet, feasible_set
from fenics_contact._optimize.subproblem import solve_step
from fenics_contact.design import LinearConstraints
from fenics_contact.errors import InvalidInputError

# Kept here because tests put something else in its place.
RUN_CLARABEL = quadratic_program._run_clarabel


def random_bundle(seed: int, m: int = 7, n: int = 4) -> Bundle:
    generator = np.random.default_rng(seed)
    errors = np.append(0.0, generator.uniform(0.0, 2.0, m - 1))
    return Bundle(
        generator.standard_normal((m, n)) + 0.3,
        errors,
        np.zeros(m),
        0.0,
        np.zeros(m),
        np.zeros(m, dtype=bool),
        np.zeros((m, 0)),
    )


def boxed(n: int = 4) -> FeasibleSet:
    return feasible_set(n, (-0.4, 0.9), LinearConstraints(np.ones((1, n)), [0.5]))


@given(seed=st.integers(0, 10_000), t=st.floats(0.05, 20.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_step_is_the_minimiser_that_an_independent_method_finds(seed: int, t: float) -> None:
    bundle, allowed = random_bundle(seed), boxed()
    near = allowed.around(np.zeros(4), np.ones(4))
    step = solve_step(bundle, near, t)
    limits = np.concatenate([bundle.measures, near.room])
    rows = np.vstack(
        [np.hstack([bundle.gradients, -np.ones((7, 1))]), np.hstack([near.rows, np.zeros((9, 1))])]
    )
    reference = scipy_minimize(
        lambda z: z[-1] + z[:-1] @ z[:-1] / (2 * t),
        np.zeros(5),
        jac=lambda z: np.append(z[:-1] / t, 1.0),
        constraints={"type": "ineq", "fun": lambda z: limits - rows @ z, "jac": lambda z: -rows},
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    ours = -step.decrease + step.length**2 / (2 * t)
    assert ours == pytest.approx(reference.fun, abs=1e-7)
    assert (rows @ np.append(step.move, -step.decrease) <= limits + 1e-8).all()


@given(seed=st.integers(0, 10_000), t=st.floats(0.05, 20.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_predicted_decrease_splits_into_aggregate_error_and_norm(seed: int, t: float) -> None:
    step = solve_step(random_bundle(seed), boxed().around(np.zeros(4), np.ones(4)), t)
    assert step.weights.sum() == pytest.approx(1.0)
    assert (step.weights >= 0.0).all()
    assert step.decrease == pytest.approx(step.aggregate_error + t * step.aggregate_norm**2, abs=1e-6)


@pytest.mark.parametrize("value", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_units_of_value_and_length_do_not_matter(value: float, length: float) -> None:
    plain, allowed = random_bundle(5), feasible_set(4, (-0.4, 0.9))
    step = solve_step(plain, allowed.around(np.zeros(4), np.ones(4)), 0.7)
    bundle = Bundle(
        plain.gradients * value / length,
        plain.errors * value,
        plain.distances,
        0.0,
        plain.noise,
        plain.doubtful,
        plain.pushes,
    )
    near = feasible_set(4, (-0.4 * length, 0.9 * length)).around(np.zeros(4), np.ones(4))
    other = solve_step(bundle, near, 0.7 * length**2 / value)
    assert other.move / length == pytest.approx(step.move, abs=1e-7)
    assert other.decrease / value == pytest.approx(step.decrease, rel=1e-7)


def test_aggregate_much_shorter_than_the_subgradients_is_resolved() -> None:
    # Two opposite slopes of size one whose shortest convex combination has the length 1e-6.
    bundle = Bundle(
        np.array([[1.0, 1e-6], [-1.0, 1e-6]]),
        np.zeros(2),
        np.zeros(2),
        0.0,
        np.zeros(2),
        np.zeros(2, dtype=bool),
        np.zeros((2, 0)),
    )
    step = solve_step(bundle, feasible_set(2).around(np.zeros(2), np.ones(2)), 1.0)
    assert step.aggregate_norm == pytest.approx(1e-6, rel=1e-3)
    assert step.decrease == pytest.approx(1e-12, rel=1e-2)


def test_planes_far_below_do_not_blur_the_step() -> None:
    gradients = np.array([[1.0, 1e-4], [-1.0, 1e-4], [1e3, 1e3]])
    bundle = Bundle(
        gradients,
        np.array([0.0, 0.0, 1e12]),
        np.zeros(3),
        0.0,
        np.zeros(3),
        np.zeros(3, dtype=bool),
        np.zeros((3, 0)),
    )
    step = solve_step(bundle, feasible_set(2).around(np.zeros(2), np.ones(2)), 1.0)
    assert step.aggregate_norm == pytest.approx(1e-4, rel=1e-4)
    assert step.weights[2] == pytest.approx(0.0, abs=1e-9)


def test_vanishing_subgradient_makes_no_step() -> None:
    bundle = Bundle.of_centre(Plane(np.zeros(3)), 0.0)
    step = solve_step(bundle, feasible_set(3).around(np.zeros(3), np.ones(3)), 1.0)
    assert step.length == pytest.approx(0.0, abs=1e-8)
    assert step.decrease == 0.0


def little_program(limits: list[float]) -> QuadraticProgram:
    rows = np.array([[1.0], [-1.0]])
    return QuadraticProgram(np.ones(1), np.zeros(1), np.zeros((0, 1)), np.zeros(0), rows, np.array(limits))


def test_multiplier_of_an_active_row_is_the_force_on_it() -> None:
    solution = solve(little_program([5.0, -2.0]))  # y ≤ 5, y ≥ 2
    assert solution.point == pytest.approx([2.0])
    assert solution.multipliers == pytest.approx([0.0, 2.0], abs=1e-7)
    assert solution.exact


def test_contradicting_rows_are_reported() -> None:
    with pytest.raises(InvalidInputError, match="PrimalInfeasible: remove or relax the rows"):
        solve(little_program([1.0, -2.0]))


class Refusing:
    """Stands for Clarabel: gives up, or almost solves, a number of times, then solves."""

    def __init__(self, statuses: list[Any]) -> None:
        self.statuses, self.seen = statuses, 0

    def __call__(self, program: QuadraticProgram, changes: Mapping[str, Any]) -> Any:
        answer = RUN_CLARABEL(program, changes)
        status = self.statuses[self.seen] if self.seen < len(self.statuses) else answer.status
        self.seen += 1
        return type("Answer", (), {"x": answer.x, "z": answer.z, "status": status})


def test_trouble_is_answered_with_other_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    refusing = Refusing([clarabel.SolverStatus.InsufficientProgress, clarabel.SolverStatus.NumericalError])
    monkeypatch.setattr(quadratic_program, "_run_clarabel", refusing)
    assert solve(little_program([5.0, -2.0])).point == pytest.approx([2.0])
    assert refusing.seen == 3


def test_almost_solved_serves_only_when_nothing_better_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    almost = clarabel.SolverStatus.AlmostSolved
    monkeypatch.setattr(quadratic_program, "_run_clarabel", Refusing([almost] * 9))
    assert not solve(little_program([5.0, -2.0])).exact
    monkeypatch.setattr(quadratic_program, "_run_clarabel", Refusing([almost]))
    assert solve(little_program([5.0, -2.0])).exact


def test_failure_of_every_attempt_lists_what_was_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        quadratic_program, "_run_clarabel", Refusing([clarabel.SolverStatus.MaxIterations] * 9)
    )
    with pytest.raises(SubproblemError, match=r"reported MaxIterations, .*rescale the variables"):
        solve(little_program([5.0, -2.0]))
