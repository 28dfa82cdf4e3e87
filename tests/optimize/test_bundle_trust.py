"""How the method behaves: scales, limits, designs that do not exist, subgradients that are wrong."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import clarabel
import numpy as np
import pytest

from fenics_contact import minimize
from fenics_contact._base.launching import finished
from fenics_contact._optimize import bundle as quadratic_program
from fenics_contact._optimize.result import Reason, Record, StepKind
from fenics_contact.design import BundleTrust, LinearConstraints, NotConvergedError
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.errors.kinds import InvalidDesignError
from tests.optimize.cases import BY_NAME
from tests.optimize.functions import Array, cb2, mifflin1, shor

ROOT = Path(__file__).resolve().parents[2]
FINE = BundleTrust(tolerance=1e-6)


def path(history: tuple[Record, ...]) -> Array:
    return np.array([record.step_length for record in history])


@pytest.mark.parametrize("name", ["Shor", "Maxquad", "Wolfe", "MAD2"])
def test_scaled_and_shifted_objective_takes_the_same_steps(name: str) -> None:
    case = BY_NAME[name]

    def energy(x: Array) -> tuple[float, Array]:
        value, gradient = case.fun(x)
        return 1e5 * value - 3e5, 1e5 * gradient

    plain = minimize(case.fun, case.start, FINE, constraints=case.constraints)
    # The stopping test knows the size of J, so that the two stop at different steps of one path.
    large = minimize(energy, case.start, replace(FINE, tolerance=1e-7), constraints=case.constraints)
    common = min(plain.evaluations, large.evaluations, 15)
    assert common > 5
    assert path(large.history)[:common] == pytest.approx(path(plain.history)[:common], rel=1e-4)
    assert large.value == pytest.approx(1e5 * case.minimum - 3e5, abs=1e-6 * 3e5)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_objective_of_any_size_is_minimised(factor: float) -> None:
    case = BY_NAME["Rosen-Suzuki"]
    method = replace(FINE, value_scale=factor)
    result = minimize(lambda x: (factor * case.fun(x)[0], factor * case.fun(x)[1]), case.start, method)
    assert result.value == pytest.approx(factor * case.minimum, rel=2e-6)


def test_a_small_objective_is_minimised_as_a_large_one_is_by_default() -> None:
    case = BY_NAME["Shor"]
    start = minimize(lambda x: (case.fun(x)[0], case.fun(x)[1]), case.start, FINE)
    small = minimize(lambda x: (1e-9 * case.fun(x)[0], 1e-9 * case.fun(x)[1]), case.start, FINE)
    assert small.evaluations > 10
    first = case.fun(case.start)[0]
    assert 1e9 * small.value == pytest.approx(start.value, abs=FINE.tolerance * first)


def test_variables_of_very_different_size_take_the_same_steps_when_scale_names_them() -> None:
    case, size = BY_NAME["Shor"], 10.0 ** np.array([-6, -3, 0, 3, 6])

    def stretched(x: Array) -> tuple[float, Array]:
        value, gradient = shor(x / size)
        return value, gradient / size

    plain = minimize(shor, case.start, FINE)
    result = minimize(stretched, case.start * size, FINE, scale=size)
    assert result.value == pytest.approx(case.minimum, rel=1e-6)
    assert path(result.history)[:15] == pytest.approx(path(plain.history)[:15], rel=1e-4)


def test_widths_of_the_box_are_the_scale_when_none_is_named() -> None:
    size = np.array([1e-3, 1.0, 1e4])

    def fun(x: Array) -> tuple[float, Array]:
        y = x / size - 0.2
        k = int(np.argmax(np.abs(y)))
        return abs(y[k]), np.sign(y[k]) * np.eye(3)[k] / size

    result = minimize(fun, 0.9 * size, FINE, bounds=(0.0 * size, size))
    assert result.x == pytest.approx(0.2 * size, rel=1e-4)


def test_a_fixed_variable_costs_nothing_in_any_unit() -> None:
    case = BY_NAME["Shor"]

    def minimised(unit: float) -> tuple[int, float]:
        def fun(x: Array) -> tuple[float, Array]:
            value, gradient = shor(x[1:] / unit)
            return value + x[0] / unit, np.append(1.0, gradient) / unit

        widths = unit * np.array([0.0, *[60.0] * 5])
        result = minimize(fun, unit * np.append(0.0, case.start), bounds=(-widths, widths))
        return result.evaluations, result.value

    evaluations, value = minimised(1.0)
    assert value == pytest.approx(case.minimum, rel=1e-4)
    assert minimised(1e-6) == (evaluations, pytest.approx(value, rel=1e-6))


def test_gradients_of_very_different_size_are_handled_in_one_bundle() -> None:
    # A cliff of slope 1e6 beside a slope of 1: the penalty of a constraint x_0 ≥ 0.
    def fun(x: Array) -> tuple[float, Array]:
        value, gradient = float(x[0] + x[1] ** 2), np.array([1.0, 2 * x[1]])
        return (value, gradient) if x[0] >= 0 else (value - 1e6 * float(x[0]), gradient - [1e6, 0.0])

    result = minimize(fun, [3.0, 2.0], FINE)
    assert result.value == pytest.approx(0.0, abs=5e-6)
    assert any(record.value > 1e3 for record in result.history), "the cliff was never met"


def test_noise_of_the_state_solver_below_the_tolerance_does_no_harm() -> None:
    case = BY_NAME["Maxquad"]

    def noisy(x: Array) -> tuple[float, Array]:
        value, gradient = case.fun(x)
        return value + 1e-6 * np.sin(1e7 * x.sum()), gradient * (1.0 + 1e-6 * np.cos(1e7 * x))

    result = minimize(noisy, case.start, BundleTrust(tolerance=1e-4))
    assert result.value == pytest.approx(case.minimum, abs=2e-4)


def test_same_input_gives_the_same_bits_in_another_process() -> None:
    script = (
        "from fenics_contact import minimize\n"
        "from fenics_contact.design import BundleTrust\n"
        "from tests.optimize.cases import BY_NAME\n"
        "case = BY_NAME['Maxquad']\n"
        "print(minimize(case.fun, case.start, BundleTrust(tolerance=1e-6)).x.tobytes().hex())\n"
    )
    command = [sys.executable, "-c", script]
    run = finished(command, 60.0, folder=ROOT)
    case = BY_NAME["Maxquad"]
    assert run.output.strip() == minimize(case.fun, case.start, FINE).x.tobytes().hex()


def test_invalid_designs_shorten_the_step_and_are_recorded() -> None:
    tried = []

    def fun(x: Array) -> tuple[float, Array]:
        tried.append(x.copy())
        if x[0] > 1.3:
            raise InvalidDesignError("a cell is inverted")
        return mifflin1(x - [0.25, 0.0])

    start = np.array([0.0, 0.0])
    result = minimize(fun, start, replace(FINE, first_step=2.0))
    rejected = [record for record in result.history if record.kind is StepKind.REJECTED]
    assert len(rejected) > 0
    assert np.isnan([record.value for record in rejected]).all()
    assert result.evaluations == len(tried) == len(result.history)
    assert result.value == pytest.approx(-1.0, abs=1e-5)
    for record, following in pairwise(result.history):
        if record.kind is StepKind.REJECTED:
            assert following.step_length <= 0.501 * record.step_length


def test_method_stops_with_the_reason_when_a_minimum_lies_in_the_invalid_region() -> None:
    def fun(x: Array) -> tuple[float, Array]:
        if x[0] < 1.0:
            raise InvalidDesignError("a cell is inverted")
        return float(x[0]), np.array([1.0])

    with pytest.raises(
        NotConvergedError, match=r"every trial.*bound the.* last trial: a cell is inverted"
    ) as caught:
        minimize(fun, [1.5])
    best = caught.value.best
    assert best is not None
    assert best.reason is Reason.INVALID_DESIGNS
    assert best.x[0] == pytest.approx(1.0, abs=1e-3)
    assert best.evaluations < 100


def test_invalid_start_is_an_error_and_says_why() -> None:
    def fun(x: Array) -> tuple[float, Array]:
        raise InvalidDesignError("cell 17 is inverted")

    with pytest.raises(InvalidDesignError, match="starting design must be valid: cell 17 is inverted"):
        minimize(fun, [0.0])


@pytest.mark.parametrize(
    ("parameters", "reason", "text"),
    [
        (
            {"max_iterations": 3},
            Reason.ITERATION_LIMIT,
            "max_iterations serious steps.*after 3 serious steps",
        ),
        ({"max_evaluations": 7}, Reason.EVALUATION_LIMIT, "max_evaluations.*7 evaluations"),
    ],
)
def test_a_limit_raises_with_the_history_and_the_best_point(
    parameters: dict[str, int], reason: Reason, text: str
) -> None:
    case = BY_NAME["Maxquad"]
    method = replace(FINE, **parameters)  # type: ignore[arg-type]
    with pytest.raises(ConvergenceError, match=text) as caught:
        minimize(case.fun, case.start, method)
    assert isinstance(caught.value, NotConvergedError)
    best = caught.value.best
    assert best is not None
    assert best.reason is reason
    assert len(caught.value.history) == best.evaluations > 3
    assert best.value == case.fun(best.x)[0] < case.fun(case.start)[0]
    quiet = minimize(case.fun, case.start, replace(method, raise_on_failure=False))
    assert quiet.reason is reason
    assert not quiet.reason.success
    assert (quiet.x == best.x).all()


@pytest.mark.parametrize("name", ["Shor", "Maxquad", "Rosenbrock", "Maxl", "CB2"])
def test_subgradient_of_the_wrong_sign_ends_soon_and_is_named(name: str) -> None:
    case = BY_NAME[name]

    def wrong(x: Array) -> tuple[float, Array]:
        value, gradient = case.fun(x)
        return value, -gradient

    with pytest.raises(NotConvergedError, match=r"difference quotient.*wrong sign") as caught:
        minimize(wrong, case.start)
    assert len(caught.value.history) < 60
    assert caught.value.best is not None
    assert caught.value.best.reason is Reason.NO_DESCENT


def test_programme_that_cannot_be_solved_stops_with_the_best_point(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, run = [], quadratic_program._run_clarabel

    def failing(*arguments: Any) -> Any:
        calls.append(arguments)
        answer = run(*arguments)
        status = answer.status if len(calls) < 6 else clarabel.SolverStatus.NumericalError
        return type("Answer", (), {"x": answer.x, "z": answer.z, "status": status})

    monkeypatch.setattr(quadratic_program, "_run_clarabel", failing)
    case = BY_NAME["Shor"]
    with pytest.raises(
        NotConvergedError, match="quadratic programme of a step could not be solved"
    ) as caught:
        minimize(case.fun, case.start)
    assert caught.value.best is not None
    assert caught.value.best.reason is Reason.STEP_FAILED
    assert case.minimum < caught.value.best.value < case.fun(case.start)[0]


def test_minimum_at_the_start_takes_one_evaluation() -> None:
    result = minimize(lambda x: (float(x @ x), 2 * x), np.zeros(3))
    assert (result.evaluations, result.iterations, result.reason) == (1, 0, Reason.STATIONARY)


def test_start_in_a_corner_that_is_the_minimum_stays_there() -> None:
    result = minimize(lambda x: (float(x.sum()), np.ones(3)), np.zeros(3), bounds=(0.0, 1.0))
    assert result.evaluations <= 2
    assert result.x == pytest.approx(np.zeros(3), abs=1e-12)


def test_linear_objective_without_bounds_runs_into_a_limit_and_not_forever() -> None:
    with pytest.raises(NotConvergedError, match="max_iterations"):
        minimize(
            lambda x: (float(x[0]), np.array([1.0, 0.0])),
            np.zeros(2),
            BundleTrust(max_iterations=40),
        )


def test_callback_sees_every_record_and_cannot_change_the_iterates() -> None:
    case, seen = BY_NAME["CB2"], []

    def spoil(record: Record, x: Array) -> None:
        seen.append(record)
        assert record.best == cb2(x)[0]
        x[:] = np.nan

    result = minimize(case.fun, case.start, callback=spoil)
    assert tuple(seen) == result.history
    assert np.isfinite(result.x).all()


def test_arrays_of_the_caller_stay_as_they_are_and_its_function_may_write_on_its_own() -> None:
    start, row, limit = np.array([-2.0, -1.0]), np.array([[3.0, 1.0]]), np.array([-2.5])
    lower, upper = np.full(2, -5.0), np.full(2, 5.0)
    arrays = (start, row, limit, lower, upper)
    before = [array.copy() for array in arrays]
    out = np.zeros(2)

    def fun(x: Array) -> tuple[float, Array]:
        value, out[:] = BY_NAME["MAD2"].fun(x)
        x[:] = np.nan
        return value, out

    result = minimize(fun, start, FINE, bounds=(lower, upper), constraints=LinearConstraints(row, limit))
    assert result.value == pytest.approx(BY_NAME["MAD2"].minimum, abs=1e-6)
    for array, copy in zip(arrays, before, strict=True):
        assert (array == copy).all()


def test_history_tells_of_every_evaluation_in_order() -> None:
    result = minimize(cb2, BY_NAME["CB2"].start, FINE)
    assert [record.evaluations for record in result.history] == list(range(1, result.evaluations + 1))
    assert result.history[0].kind is StepKind.START
    assert result.history[-1].iteration == result.iterations
    assert result.history[-1].best == result.value == cb2(result.x)[0]
    assert (result.subgradient == cb2(result.x)[1]).all()
    assert {record.kind for record in result.history} == {StepKind.START, StepKind.SERIOUS, StepKind.NULL}


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"tolerance": 0.0}, "tolerance must be positive and finite, got 0.0"),
        ({"first_step": np.nan}, "first_step must be positive and finite, got nan"),
        ({"reach": 0.0}, "reach must be positive and finite, got 0.0"),
        ({"least_t": 0.0}, "least_t must be positive and finite, got 0.0"),
        ({"max_bundle": 2}, "max_bundle must be at least 3, got 2"),
        ({"max_evaluations": 0}, "max_evaluations must be at least 1, got 0"),
        ({"descent": 1.0}, r"descent must lie in \(0, 1\), got 1.0"),
        ({"locality": -1.0}, "locality must not be negative .*, got -1.0"),
    ],
)
def test_parameters_that_cannot_work_are_refused(parameters: dict[str, float], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        BundleTrust(**parameters)  # type: ignore[arg-type]


def test_a_reach_is_the_distance_within_which_nothing_lower_is_left() -> None:
    def slope(x: np.ndarray) -> tuple[float, np.ndarray]:
        return 1.0 + 1e-3 * float(x[0]), np.array([1e-3])

    near = BundleTrust(tolerance=2e-4, first_step=1e-2)
    results = [
        minimize(slope, [0.0], method, bounds=(-1.0, 1.0)) for method in (near, replace(near, reach=2.0))
    ]
    assert [each.x[0] for each in results] == [0.0, pytest.approx(-1.0, abs=1e-9)]
    assert all(each.reason.success for each in results)
