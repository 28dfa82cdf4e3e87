"""Shape optimisation where a step leads nowhere, the optimum is a kink, or a bound stops it."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ShapeProblem, State, Status, minimize
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import AdaptiveTolerance, BundleTrust, DesignPoint, Result
from fenics_contact.errors import InvalidDesignError
from fenics_contact.qp import FaceNewton
from tests.design.pressed import DESIGN
from tests.design.resumed_cases import BOUND, minimised, posed
from tests.hard.conftest import Record
from tests.hard.shapes import carved, kink, on_a_ramp, thick
from tools.hard_cases.invariants import violations
from tools.hard_cases.trial import scene_size, statuses

GROUP = "optimisation"
#: A slope of one, and how far the ends of the ramp may move.
UP = np.array([1.0, -1.0])
RAMP = (np.full(2, -0.7), np.full(2, 0.45))


def noted(
    record: Record,
    case: str,
    problem: ShapeProblem,
    result: Result | None,
    best: DesignPoint,
    outcome: str = "",
    before: int = 0,
) -> None:
    """Note the row of a minimisation, with what is recomputed of its last state."""
    state: State = best.state
    wrong = violations(state)
    kinds = [] if result is None else [entry.kind for entry in result.history]
    rejected = kinds.count(StepKind.REJECTED)
    record(
        GROUP,
        case,
        outcome=outcome or "solved",
        scene=scene_size(state),
        tolerance=best.tolerance,
        products=problem.products - before,
        steps=len(kinds),
        natural=wrong.natural,
        balance=max(wrong.balance, wrong.nodal),
        cone=wrong.cone,
        law=max(wrong.penetration, wrong.complementarity, wrong.friction),
        status=statuses(state),
        fallbacks=f"{rejected} trial designs rejected" if rejected else "",
    )


def rejected_notes(result: Result) -> list[str]:
    return [entry.note for entry in result.history if entry.kind is StepKind.REJECTED]


def assert_steps_shrink_after_rejections(result: Result) -> None:
    for entry, following in zip(result.history, result.history[1:], strict=False):
        if entry.kind is StepKind.REJECTED:
            assert np.isnan(entry.value)
            assert following.step_length <= 0.501 * entry.step_length


@pytest.mark.parametrize("states", ["accurate", "adaptive"])
def test_a_step_to_designs_on_which_the_body_slides_away_is_taken_back(states: str, record: Record) -> None:
    problem = on_a_ramp(0.235, AdaptiveTolerance() if states == "adaptive" else 1e-8)
    result = minimize(problem, 0.1 * UP - 0.1, BundleTrust(first_step=0.8), bounds=RAMP)
    assert result.reason.success
    assert any("every body must be held" in note for note in rejected_notes(result))
    assert_steps_shrink_after_rejections(result)
    assert result.value < 0.6 * result.history[0].value
    best = problem.evaluate(result.x)
    assert best.value == pytest.approx(result.value, abs=1e-4)
    assert best.state.contact.count(Status.SLIP) > 0
    noted(record, f"a body on a ramp of another design slides away; {states} states", problem, result, best)


def test_an_objective_that_only_a_sliding_body_could_meet_ends_where_friction_still_holds(
    record: Record,
) -> None:
    problem = on_a_ramp(0.5)
    method = BundleTrust(raise_on_failure=False, max_evaluations=80)
    result = minimize(problem, 0.05 * UP, method, bounds=RAMP)
    notes = rejected_notes(result)
    assert any("every body must be held" in note for note in notes)
    assert result.value < 0.9 * result.history[0].value
    best = problem.evaluate(result.x)
    assert 0.28 < abs(result.x @ UP) / 2.0 < 0.31, "the slope is that of the friction coefficient"
    outcome = "solved" if result.reason.success else f"refused: {result.reason.value.partition(':')[0]}"
    noted(record, "the objective wants a slope that friction cannot hold", problem, result, best, outcome)


def test_a_start_without_equilibrium_is_refused_and_names_the_motion(record: Record) -> None:
    problem = on_a_ramp(0.235, friction=0.1)
    message = r"starting design must be valid: the design has no equilibrium: .*'upper' can move away"
    with pytest.raises(InvalidDesignError, match=message) as caught:
        minimize(problem, 0.2 * UP - 0.2, bounds=RAMP)
    record(GROUP, "the first design holds nothing", outcome=f"refused: {str(caught.value)[:120]} ...")


@pytest.mark.parametrize("states", ["accurate", "adaptive"])
def test_contact_that_vanishes_on_the_way_leaves_an_optimum_without_contact(
    states: str, record: Record
) -> None:
    problem = carved(AdaptiveTolerance() if states == "adaptive" else 1e-8)
    result = minimize(problem, np.zeros(problem.size), bounds=(-0.05 * np.ones(6), 0.05 * np.ones(6)))
    assert result.reason.success
    assert result.history[0].value > 0.1
    assert result.value == pytest.approx(0.0, abs=1e-12)
    assert np.all(result.subgradient == 0.0)
    best = problem.evaluate(result.x)
    contact = best.state.contact
    assert contact.points.count > 0
    assert contact.count(Status.OPEN) == contact.points.count
    noted(record, f"the best design touches nothing any more; {states} states", problem, result, best)


def slope_left(result: Result, bound: float, normal: np.ndarray) -> float:
    """Return the largest decrease that the last subgradient promises within the box and the volume, by LP."""
    from scipy.optimize import linprog

    size = len(result.x)
    box = [(max(-bound - x, -0.3 * bound), min(bound - x, 0.3 * bound)) for x in result.x]
    best = linprog(result.subgradient, A_eq=normal[None], b_eq=[0.0], bounds=box)
    assert best.status == 0
    assert len(best.x) == size
    return -float(best.fun)


@pytest.mark.parametrize("name", BOUND)
def test_a_design_that_touches_its_bounds_leaves_no_descent_within_them(name: str, record: Record) -> None:
    problem = posed(name, MPI.COMM_SELF, 1e-8)
    result = minimised(name, problem, None, max_evaluations=60)
    bound = BOUND[name]
    on_bounds = int(np.count_nonzero(np.abs(result.x) > bound * (1 - 1e-6)))
    assert result.reason.success
    assert np.abs(result.x).max() <= bound
    assert on_bounds > 2
    _, by_volume = problem.volume(np.zeros(problem.size))
    # The bundle holds planes of other designs too: one subgradient alone may promise more, but not much.
    assert slope_left(result, bound, by_volume) < 0.02 * (1 + abs(result.value))
    best = problem.evaluate(result.x)
    case = f"{name}: {on_bounds} of {problem.size} variables end on their bounds"
    noted(record, case, problem, result, best)


@pytest.mark.parametrize("switch", ["closing, frictionless", "closing with friction"])
def test_a_minimum_on_a_kink_is_found(switch: str, record: Record) -> None:
    function = kink(switch)
    start = DESIGN + 0.001 * np.random.default_rng(3).standard_normal(6)
    bounds = (DESIGN - 0.01, DESIGN + 0.01)
    before = function.problem.products
    result = minimize(function, start, BundleTrust(tolerance=1e-6), bounds=bounds, scale=1e-3)
    assert result.reason.success
    assert result.history[0].value > 1e-4
    assert 0.0 <= result.value < 1e-6
    # The kink rises by half of the distance across it.
    across = (function.held - function.released) / function.size
    assert abs(across @ (result.x - DESIGN)) < 1e-5
    tried = [function.problem.best, function.problem.last]
    assert all(point is not None for point in tried)
    there = function.problem.evaluate(DESIGN)
    assert there.weak.contacts == 1
    found = function.problem.evaluate(result.x)
    case = f"the optimum is where one more point touches ({switch.partition(' ')[2]}): a kink"
    noted(record, case, function.problem, result, found, before=before)


@pytest.mark.parametrize("switch", ["closing, frictionless", "closing with friction"])
def test_strict_states_tell_how_near_a_kink_is(switch: str, record: Record) -> None:
    """Weak points are recognised at the accuracy of the state, 1e-11: steps see on which side they end."""
    function = kink(switch)
    start = DESIGN + 0.001 * np.random.default_rng(3).standard_normal(6)
    before = function.problem.products
    bounds = (DESIGN - 0.01, DESIGN + 0.01)
    method = BundleTrust(tolerance=1e-8, value_scale=1.0)  # the least value is zero
    result = minimize(function, start, method, bounds=bounds, scale=1e-3)
    assert result.reason.success
    assert abs(result.value) < 1e-9
    across = (function.held - function.released) / function.size
    assert abs(across @ (result.x - DESIGN)) < 1e-9
    found = function.problem.evaluate(result.x)
    case = f"the same kink to a tolerance of 1e-8 ({switch.partition(' ')[2]})"
    noted(record, case, function.problem, result, found, before=before)


def test_designs_that_invert_cells_are_stepped_back_from(record: Record) -> None:
    problem = thick()
    result = minimize(
        problem,
        np.zeros(problem.size),
        BundleTrust(max_evaluations=12, raise_on_failure=False),
        bounds=(-3.0 * np.ones(6), 3.0 * np.ones(6)),
    )
    notes = rejected_notes(result)
    assert notes
    assert all("must have a positive Jacobian" in note for note in notes)
    assert_steps_shrink_after_rejections(result)
    assert result.value < result.history[0].value
    best = problem.evaluate(result.x)
    assert problem.scene_of(result.x).bodies["block"].mesh.volume > 0.0
    outcome = (
        "solved" if result.reason.success else "refused: the limit of evaluations is met, best so far kept"
    )
    noted(record, "bounds that let cells be inverted", problem, result, best, outcome)


def test_a_state_that_no_solver_finds_is_a_rejected_trial_and_no_end(
    record: Record, caplog: pytest.LogCaptureFixture
) -> None:
    problem = carved()
    accurate, calls = FaceNewton(), []

    class Hasty(FaceNewton):
        def with_tolerance(self, tolerance: float) -> FaceNewton:
            calls.append(tolerance)
            # The second design's solver, warm and cold, may do one step only.
            return (
                FaceNewton(tolerance, max_steps=1)
                if len(calls) in (2, 3)
                else accurate.with_tolerance(tolerance)  # type: ignore[return-value]
            )

    problem.contact.solver = Hasty()
    with caplog.at_level(logging.WARNING):
        result = minimize(problem, np.zeros(6), bounds=(-0.05 * np.ones(6), 0.05 * np.ones(6)))
    assert "a warm start failed, a cold one follows" in caplog.text
    (note,) = rejected_notes(result)
    assert "no equilibrium of the design was found: face Newton needs residuals below" in note
    assert_steps_shrink_after_rejections(result)
    assert result.reason.success
    best = problem.evaluate(result.x)
    noted(record, "the solver gives up on one trial design", problem, result, best)
