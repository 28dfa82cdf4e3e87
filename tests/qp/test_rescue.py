"""Where Newton's method fails it is rescued, and where nothing helps the error says why."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import FaceNewton, Residuals, Smalse, Start, measure, solve
from fenics_contact.qp.cones import CoulombLaw, TrescaLaw
from fenics_contact.qp.face_newton import slides
from fenics_contact.qp.newton_steps import Forcing
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.rescue import ProximalPoint, Rescue
from fenics_contact.qp.solution import SolverStep, contact_step, iterate_at
from tests.qp.torn_bricks import Bricks, torn_problem
from tests.qp.violations import coulomb_violations


@pytest.mark.parametrize("load", [1e-2, 1e-4, 1e-6, 1e-8])
def test_an_almost_unloaded_brick_on_a_round_one_is_solved(load: float) -> None:
    dual, _ = torn_problem(Bricks(n=4, crown=2.0, press=load, shear=0.1 * load, tilt=0.3))
    mu_f = np.full(dual.layout.n_friction, 0.3)
    found = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    assert 0 < found.history[-1].closed < dual.layout.n_contact / 2
    violations = coulomb_violations(dual.layout, found.multiplier / load, found.residual, mu_f)
    assert max(violations.values()) < 1e-4
    assert found.products < 500  # more than 20 000 where iterates were compared in scales of their own


@pytest.mark.parametrize("preconditioned", [True, False])
def test_a_rescue_comes_nearer_from_anywhere(preconditioned: bool) -> None:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5, preconditioned=preconditioned))
    dual = dual.with_law(CoulombLaw(dual.layout, np.full(dual.layout.n_friction, 0.3)))
    far, operator = dual.coarse.particular(), CountedOperator(dual.operator)
    begin = iterate_at(dual, far, dual.operator(far), np.zeros(dual.coarse.m))
    rescue = Rescue(dual, Forcing(0.25, 0.1, 1e-6), 20_000, Smalse())
    rescued = rescue(Start(begin, operator, None, cold=False), 400)
    before, after = begin.residuals, rescued.iterate.residuals
    assert after.worst_in_scales_with(before) < 0.3 * before.worst_in_scales_with(after)
    assert rescued.line.method == ("proximal rescue" if preconditioned else "SMALSE rescue")
    assert rescued.line.residuals == after
    assert rescued.line.products == operator.products < 400
    assert (rescued.memory is None) == preconditioned


def test_the_history_says_why_a_rescue_was_called_and_what_it_reached() -> None:
    dual, _ = torn_problem(Bricks(cubes=(2, 2), crown=0.2, tilt=0.5))
    hasty = FaceNewton(tolerance=1e-10, patience=1, forcing=0.9, loosest=0.5)
    found = solve(dual, None, hasty, friction_coefficient=np.full(dual.layout.n_friction, 0.3))
    (line,) = (step for step in found.history if "rescue" in step.method)
    assert re.fullmatch(r"rescue from \S+ because the .+: (met its target|used its budget)", line.note)
    assert [step.iteration for step in found.history] == list(range(found.iterations))


def test_at_the_solution_springs_at_rest_change_nothing() -> None:
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    bound = np.full(dual.layout.n_friction, 1e-3)
    solution = solve(dual, bound, FaceNewton(tolerance=1e-10))
    dual, operator = dual.with_law(TrescaLaw(dual.layout, bound)), CountedOperator(dual.operator)
    point = ProximalPoint.build(dual, operator, 10.0).centred(solution.multiplier)
    there = iterate_at(dual, solution.multiplier, solution.product, solution.alpha)
    inside = point.enter(there)
    assert inside.residuals.worst < 1e-8
    np.testing.assert_allclose(
        point.force(inside)[dual.layout.contact], there.multiplier[dual.layout.contact], atol=1e-10
    )
    np.testing.assert_allclose(point.leave(inside).residual, there.residual, atol=1e-14)
    away = point.centred(2.0 * solution.multiplier).enter(there)
    assert away.residuals.natural > 0.1
    assert operator.products == 0
    np.testing.assert_allclose(
        contact_step(dual.layout, point.problem.diagonal), 10 * contact_step(dual.layout, dual.diagonal)
    )


def test_forces_that_are_rounding_are_none() -> None:
    dual, _ = torn_problem(Bricks(crown=0.1))
    dual = dual.with_law(TrescaLaw(dual.layout, np.full(dual.layout.n_friction, 1e-3)))
    rng, size = np.random.default_rng(0), dual.layout.size
    multiplier = np.where(np.isin(np.arange(size), dual.layout.equality), 1.0, 0.0)
    noise = np.zeros(size)
    noise[dual.layout.contact] = rng.standard_normal(len(dual.layout.contact))
    zero = np.zeros(size)
    for scale, counts in ((1e-17, False), (1e-8, True)):
        found = measure(dual, multiplier + scale * noise, zero, zero)
        assert (found.natural > 0.0) == counts
        assert (found.violation > 0.0) == counts


def test_a_failure_says_what_was_reached_and_what_to_try() -> None:
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=2.0, shear=0.0, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, 0.01)
    slipping = r"all \d+ discs slip, and friction may not suffice for any equilibrium; raise the friction, "
    with pytest.raises(
        ConvergenceError, match=slipping + "lower the load, add a support, or raise max_steps"
    ):
        solve(dual, None, FaceNewton(max_steps=1), friction_coefficient=mu_f)
    told = r"the best was .*, the .* and 0 rescues did not help: raise max_products, start from the solution"
    with pytest.raises(ConvergenceError, match=told) as caught:
        solve(dual, None, replace(FaceNewton(), max_products=30), friction_coefficient=40 * mu_f)
    assert caught.value.history


def test_one_step_in_which_all_slips_does_not_mean_that_friction_is_too_small() -> None:
    def step(stick: int, slip: int) -> SolverStep:
        return SolverStep("face", 0, 1, Residuals(1.0, 1.0, 1.0, 1.0, 1.0, 1.0), stick + slip, stick, slip)

    sticking, slipping = step(3, 5), step(0, 8)
    assert slides([sticking] + 6 * [slipping])
    assert not slides(6 * [slipping] + [sticking, slipping])
    assert not slides(6 * [step(0, 0)])
    assert not slides([])
