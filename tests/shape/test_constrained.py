"""Designs under nonlinear constraints: the volume itself and a bound on a contact force."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import Checkpoint, ShapeProblem, minimize
from fenics_contact.design import (
    AdaptiveTolerance,
    ContactForces,
    NonlinearConstraint,
    Result,
    TotalPotential,
)
from fenics_contact.design.base import DesignFunction
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import read_result, write_optimisation_result
from tests.shape.constrained_blocks import BOUND, FORCE, largest_force, minimised, posed
from tests.shape.objectives import normal_forces

VOLUMES: list[float] = []


@cache
def solved() -> tuple[ShapeProblem, DesignFunction, Result]:
    """The minimum; the volumes of all designs on the way are noted."""
    problem = posed()
    return problem, *minimised(problem, callback=lambda record, x: VOLUMES.append(problem.volume(x)[0]))


def test_a_function_has_the_value_and_gradient_of_a_problem_with_that_objective() -> None:
    problem, alone = posed(), posed()
    alone.objective = ContactForces(normal_forces)
    alpha = 0.005 * np.random.default_rng(1).standard_normal(problem.size)
    function = problem.function(ContactForces(normal_forces))
    problem(alpha)
    value, gradient = function(alpha)
    wanted, by_design = alone(alpha)
    assert value == pytest.approx(wanted, rel=1e-7)
    assert gradient == pytest.approx(by_design, rel=1e-5, abs=1e-5 * np.abs(by_design).max())
    assert np.abs(gradient).max() > 0.0
    assert problem.objective == TotalPotential()


def test_a_function_costs_one_adjoint_at_a_design_that_is_known() -> None:
    problem = posed()
    alpha = np.full(problem.size, 0.004)
    function = problem.function(ContactForces(normal_forces), "forces")
    problem(alpha)
    whole, states = problem.products, problem.seconds
    state = problem.last.state if problem.last else None
    assert state is not None
    function(alpha)
    spent = problem.products - whole
    assert 0 < spent < 0.7 * whole
    assert problem.evaluations == 1
    function(alpha)
    assert problem.products == whole + spent, "the same design is not differentiated twice"
    assert problem.last is not None
    assert problem.last.state is state
    assert states["adjoint"] > 0.0
    unknown = np.full(problem.size, 0.006)
    assert function(unknown)[0] != function(alpha)[0]
    assert problem.products > whole + 2 * spent
    assert "forces" in repr(function)


def test_products_count_each_state_and_adjoint_once() -> None:
    problem = posed()
    state = problem.state_of(np.zeros(problem.size))
    alone = problem.products
    assert alone == state.dual.products > 0
    point = problem.evaluate(np.full(problem.size, 0.004))
    assert problem.products == alone + point.state.dual.products
    assert 0 < point.adjoint_iterations < point.state.dual.products


def test_the_volume_is_kept_and_the_force_meets_its_limit() -> None:
    problem, force, result = solved()
    assert result.reason.success
    assert problem.volume(result.x)[0] == pytest.approx(problem.volume(np.zeros(problem.size))[0], rel=1e-6)
    volume, bound = result.constraints
    assert (volume.active, bound.active) == (True, True)
    assert force(result.x)[0] <= bound.upper * (1 + 1e-6)
    assert bound.value == pytest.approx(bound.upper, rel=1e-4)
    assert bound.multiplier > 0.0
    assert 3 < result.evaluations <= 60
    assert np.abs(result.x).max() <= BOUND


def test_the_multiplier_of_the_force_is_the_price_of_its_limit() -> None:
    _, _, result = solved()
    _, other = minimised(posed(), share=FORCE + 0.01)
    raised = other.constraints[1].upper - result.constraints[1].upper
    price = np.mean([one.constraints[1].multiplier for one in (result, other)])
    assert other.value - result.value == pytest.approx(-price * raised, rel=0.2)
    assert other.value < result.value


def test_every_design_that_is_solved_has_the_volume() -> None:
    solved()
    assert len(VOLUMES) > 3
    assert pytest.approx([VOLUMES[0]] * len(VOLUMES), rel=1e-6) == VOLUMES


def test_states_as_accurate_as_needed_lead_to_the_same_design() -> None:
    _, _, exact = solved()
    problem = posed(AdaptiveTolerance())
    _, result = minimised(problem)
    assert result.reason.success
    assert result.value == pytest.approx(exact.value, rel=3e-4)
    assert result.violation <= 1e-5
    assert {record.error > 0.0 for record in result.history} == {True}


def test_the_file_of_a_result_has_the_design_that_meets_the_constraints(tmp_path: Path) -> None:
    problem, _, result = solved()
    problem(np.full(problem.size, BOUND))  # lower, and neither has the volume
    assert problem.best is not None
    assert problem.best.value < result.value
    told = read_result(write_optimisation_result(result, problem, tmp_path))["optimisation"]
    assert told["objective"]["final"] == pytest.approx(result.value, rel=1e-7)
    assert [one["name"] for one in told["constraints"]] == ["volume", "force"]
    assert told["constraints"][1]["lower"] is None
    assert told["constraints"][1]["multiplier"] == result.constraints[1].multiplier
    assert told["history"]["violation"][-1] == result.history[-1].violation


@pytest.mark.parametrize("ranks", [2, 4])
def test_several_ranks_take_the_same_steps(ranks: int, mpirun: Callable[..., str]) -> None:
    script = Path(__file__).with_name("constrained_blocks.py")
    _, _, whole = solved()
    alike, evaluations, value, *x = (float(word) for word in mpirun(script, ranks).split())
    assert (alike, evaluations) == (1, whole.evaluations)
    assert value == pytest.approx(whole.value, rel=1e-7)
    assert x == pytest.approx(whole.x.tolist(), abs=1e-6)


def test_a_run_in_pieces_ends_at_the_same_design(tmp_path: Path) -> None:
    _, _, whole = solved()
    checkpoint = Checkpoint(tmp_path / "run.npz")
    _, first = minimised(
        posed(), checkpoint=checkpoint, method={"max_evaluations": 3, "raise_on_failure": False}
    )
    assert not first.reason.success
    _, result = minimised(posed(), checkpoint=checkpoint)
    assert result.evaluations == whole.evaluations
    assert result.x == pytest.approx(whole.x, abs=1e-9)


def test_a_start_with_too_large_a_force_is_an_error_that_says_by_how_much() -> None:
    problem = posed()
    start = np.zeros(problem.size)
    force = problem.function(ContactForces(largest_force), "largest force")
    value = force(start)[0]
    limit = NonlinearConstraint(force, FORCE * value, name="force")
    with pytest.raises(
        InvalidInputError, match=rf"but force is {value:.6g}, to lie in \[-inf, .*restore=True"
    ):
        minimize(problem, start, bounds=(start - BOUND, start + BOUND), constraints=limit)
