"""Cutting a Newton step short costs nothing and is never worse than the whole step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.qp import DualProblem, FaceNewton, solve
from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.newton_steps import shorten
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.rescue import ProximalPoint, descend
from fenics_contact.qp.solution import Iterate, iterate_at
from tests.qp.published_friction import CYCLING, published
from tests.qp.random_problems import DenseProblem, random_problem


def no_product(x):
    raise AssertionError("all products on a segment are known")


def with_bounds(problem: DenseProblem) -> DualProblem:
    return problem.dual.with_law(TrescaLaw(problem.layout, problem.slip_bound))


def iterate(problem: DenseProblem, multiplier: np.ndarray, alpha: np.ndarray) -> Iterate:
    return iterate_at(with_bounds(problem), multiplier, problem.F @ multiplier, alpha)


def test_solution_between_two_iterates_is_found():
    problem = random_problem(3)
    dual = replace(with_bounds(problem), operator=no_product)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    offset = np.random.default_rng(0).standard_normal(len(problem.d))
    before = iterate(problem, solution.multiplier - 0.1 * offset, solution.alpha - 0.1)
    after = iterate(problem, solution.multiplier + 0.3 * offset, solution.alpha + 0.3)
    damped = shorten(dual, before, after)
    assert damped.fraction == 0.25
    assert damped.point.residuals.size < 1e-8 < before.residuals.size < after.residuals.size
    np.testing.assert_allclose(damped.point.multiplier, solution.multiplier, atol=1e-8)
    np.testing.assert_allclose(damped.point.product, problem.F @ damped.point.multiplier, atol=1e-12)


def test_step_that_improves_is_kept_whole():
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    worse = iterate(problem, 1.1 * solution.multiplier, solution.alpha)
    better = iterate(problem, 1.01 * solution.multiplier, solution.alpha)
    damped = shorten(with_bounds(problem), worse, better)
    assert damped.fraction == 1.0
    assert damped.point is better


def test_a_huge_wrong_force_is_worse_than_one_that_is_nearly_right():
    """Relative to itself each is wrong by about one: only a common scale tells them apart."""
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    huge = iterate(problem, -1e4 * np.abs(solution.multiplier), solution.alpha)
    small = iterate(problem, np.zeros_like(solution.multiplier), solution.alpha)
    assert small.residuals.worst > 0.5 * huge.residuals.worst
    one, other = huge.residuals, small.residuals
    assert one.worst_in_scales_with(other) > 100 * other.worst_in_scales_with(one)
    assert shorten(with_bounds(problem), huge, small).point is small


def test_a_step_may_be_worse_than_the_last_iterate_if_it_is_better_than_the_one_before():
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    good, fair, bad = (
        iterate(problem, part * solution.multiplier, solution.alpha) for part in (1.01, 1.1, 2.0)
    )
    assert shorten(with_bounds(problem), good, fair).point is not fair
    assert shorten(with_bounds(problem), good, fair, bad.residuals).point is fair


@pytest.mark.parametrize(("size", "fraction"), [(1.0, 0.01), (100.0, 0.1)], ids=["near", "far"])
def test_the_shortest_step_is_taken_near_a_solution_only(size, fraction):
    """Far from one the residual is made of contacts that are still to close, and falls little by little."""
    problem = random_problem(3)
    solution = solve(problem.dual, problem.slip_bound, FaceNewton(tolerance=1e-10))
    before, after = (
        iterate(problem, solution.multiplier, solution.alpha + size * part) for part in (-0.01, 0.99)
    )
    assert shorten(with_bounds(problem), before, after).fraction == fraction


def test_the_minimum_of_the_potential_on_a_segment_is_found():
    problem = random_problem(3)
    dual = with_bounds(problem)
    solution = solve(dual, problem.slip_bound, FaceNewton(tolerance=1e-11))
    point = ProximalPoint.build(dual, CountedOperator(dual.operator), 10.0).centred(solution.multiplier)
    begin = point.enter(iterate(problem, solution.multiplier, solution.alpha))
    offset = np.random.default_rng(0).standard_normal(len(solution.alpha))
    ends = [iterate(problem, solution.multiplier, solution.alpha + part * offset) for part in (-1e-3, 4e-3)]
    found = descend(point.problem, *(point.enter(end) for end in ends))
    assert found.fraction == pytest.approx(0.2, abs=0.03)
    assert found.point.residuals.natural < 0.2 * point.enter(ends[0]).residuals.natural
    assert descend(point.problem, point.enter(ends[0]), begin).fraction == 1.0


def test_a_step_that_was_cut_is_told():
    dual, mu_f = published(CYCLING)
    found = solve(dual, None, FaceNewton(tolerance=1e-8), friction_coefficient=mu_f)
    assert any("of the step" in step.note for step in found.history)
