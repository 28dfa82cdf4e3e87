"""The front door: what is refused, what is reported, and the edges where something is missing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import FaceNewton, FeasibleSet, ProjectedCG, Residuals, Smalse, measure, solve
from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.solution import contact_step
from tests.qp.random_problems import random_problem
from tests.qp.torn_bricks import Bricks, torn_problem

SOLVERS = [FaceNewton(), Smalse(), ProjectedCG()]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("m", [0, 4])
def test_linear_problem_equals_the_dense_saddle_point_solution(solver, m):
    problem = random_problem(1, n_equality=30, n_contact=0, m=m)
    found = solve(problem.dual, None, solver)
    block = np.block([[problem.F, problem.G.T], [problem.G, np.zeros((m, m))]])
    expected = np.linalg.solve(block, np.concatenate([problem.d, problem.e]))
    accuracy = 1e2 * solver.tolerance * np.abs(expected).max()
    np.testing.assert_allclose(found.multiplier, expected[:30], atol=accuracy)
    np.testing.assert_allclose(found.alpha, -expected[30:], atol=accuracy)


def test_projected_cg_needs_one_run_for_a_torn_body():
    dual, _ = torn_problem(Bricks(n=4, cubes=(2, 2), contact=False))
    found = solve(dual, None, ProjectedCG(tolerance=1e-10))
    assert found.iterations == 1
    assert found.gluing_residual <= 1e-10
    assert found.coarse_residual <= 1e-13
    assert 5 < found.products < 25


@pytest.mark.parametrize("solver", SOLVERS)
def test_unloaded_body_has_no_multipliers(solver):
    dual, _ = torn_problem(Bricks(contact=False, press=0.0, shear=0.0))
    found = solve(dual, None, solver)
    assert np.all(found.multiplier == 0.0)
    assert found.residuals.worst == 0.0


@pytest.mark.parametrize("solver", [FaceNewton(), Smalse()])
def test_contact_that_stays_open_has_no_force(solver):
    problem = random_problem(6, n_contact=8, m=0)
    d = problem.d.copy()
    d[problem.layout.normal] = -50.0
    found = solve(replace(problem.dual, rhs=d), np.zeros(8), solver)
    assert np.all(found.multiplier[problem.layout.contact] == 0.0)
    assert np.linalg.norm(found.multiplier) > 1.0
    assert found.natural_residual == 0.0


@pytest.mark.parametrize("solver", [FaceNewton(), Smalse()])
def test_tresca_friction_acts_without_normal_force_too(solver):
    problem = random_problem(6, n_contact=8, m=0)
    d = problem.d.copy()
    d[problem.layout.normal] = -50.0
    found = solve(replace(problem.dual, rhs=d), np.full(8, 0.2), solver)
    assert np.all(found.multiplier[problem.layout.normal] == 0.0)
    assert np.linalg.norm(found.multiplier[problem.layout.tangential]) > 0.3
    assert 0.0 < found.natural_residual <= 1e-6


def test_projected_cg_refuses_contact():
    with pytest.raises(InvalidInputError, match="projected CG needs no contact, got 12"):
        solve(random_problem(1).dual, np.ones(12), ProjectedCG())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rhs": np.zeros(5)}, "rhs must have 56 entries"),
        ({"diagonal": np.ones(5)}, "diagonal must have 56 entries"),
        ({"rhs": np.full(56, np.nan)}, "rhs must be finite, got 56 entries that are not"),
        ({"diagonal": np.zeros(56)}, "diagonal must be positive on contact, got 0.0"),
        ({"layout": ContactLayout.build(50)}, "must have 50 entries"),
    ],
)
def test_unusable_problem_is_refused(change, message):
    problem = random_problem(1)
    with pytest.raises(InvalidInputError, match=message):
        solve(replace(problem.dual, **change), problem.slip_bound, FaceNewton())


@pytest.mark.parametrize(
    ("slip_bound", "mu_f", "message"),
    [
        (None, None, "friction discs need a slip_bound or friction_coefficient, got neither"),
        (np.ones(11), np.ones(12), r"slip_bound must have shape \(12,\)"),
        (np.ones(12), -np.ones(12), r"friction_coefficient must be in \[0, ∞\)"),
        (np.ones(11), None, r"slip_bound must have shape \(12,\)"),
        (-np.ones(12), None, r"slip_bound must be in \[0, ∞\)"),
    ],
)
def test_unclear_friction_is_refused(slip_bound, mu_f, message):
    with pytest.raises(InvalidInputError, match=message):
        solve(random_problem(1).dual, slip_bound, FaceNewton(), friction_coefficient=mu_f)


def test_start_of_the_wrong_length_is_refused():
    problem = random_problem(1)
    with pytest.raises(InvalidInputError, match=r"start must have shape \(56,\), got \(3,\)"):
        solve(problem.dual, problem.slip_bound, FaceNewton(), np.zeros(3))


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        (
            Smalse(tolerance=1e-12, max_products=40),
            r"SMALSE needs residuals below 1.0e-12, got",
        ),
        (FaceNewton(tolerance=1e-12, max_products=20), r"face Newton needs residuals below 1.0e-12"),
    ],
)
def test_failure_is_an_error_with_history(solver, message):
    problem = random_problem(1)
    with pytest.raises(ConvergenceError, match=message) as caught:
        solve(problem.dual, problem.slip_bound, solver)
    assert len(caught.value.history) >= 1


def test_solver_that_claims_too_much_is_found_out():
    @dataclass(frozen=True)
    class Boaster:
        tolerance: float = 1e-9

        def run(self, problem, start):
            return FaceNewton(tolerance=1e-2).run(problem, start)

    problem = random_problem(1)
    with pytest.raises(ConvergenceError, match="the solver's answer must have residuals below"):
        solve(problem.dual, problem.slip_bound, Boaster())


def measured(problem, lam, alpha):
    product = problem.F @ lam
    residual = product - problem.d - problem.G.T @ alpha
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    dual = problem.dual.with_law(TrescaLaw(problem.layout, problem.slip_bound))
    return measure(dual, lam, product, residual), residual, feasible


def test_residuals_are_what_their_formulas_say():
    problem = random_problem(3)
    rng = np.random.default_rng(0)
    lam, layout = rng.standard_normal(problem.layout.size), problem.layout
    found, r, feasible = measured(problem, lam, rng.standard_normal(6))
    step = contact_step(layout, np.diagonal(problem.F))
    assert np.all(step[layout.equality] == 0.0)
    np.testing.assert_allclose(step[layout.normal], 1.0 / np.diagonal(problem.F)[layout.normal])
    assert np.all(step[layout.tangential[:, 0]] == step[layout.tangential[:, 1]])
    mapped = feasible.project(lam - step * r)
    force = max(np.linalg.norm(lam[layout.normal]), np.linalg.norm(mapped[layout.normal]))
    assert found.natural == pytest.approx(np.linalg.norm((lam - mapped)[layout.contact]) / force)
    flexed = (problem.F @ lam - problem.d)[layout.equality]
    scale = max(np.linalg.norm(flexed), np.linalg.norm(problem.d[layout.equality]))
    assert found.gluing == pytest.approx(np.linalg.norm(r[layout.equality]) / scale)
    shortest = np.linalg.lstsq(problem.G, problem.G @ lam - problem.e, rcond=None)[0]
    balanced = np.linalg.lstsq(problem.G, problem.e, rcond=None)[0]
    larger = max(np.linalg.norm(lam), np.linalg.norm(balanced))
    assert found.coarse == pytest.approx(np.linalg.norm(shortest) / larger)
    assert found.violation == pytest.approx(feasible.violation(lam) / force)
    assert found.worst == max(found.natural, found.gluing, found.coarse)
    assert min(found.natural, found.gluing, found.coarse, found.violation) > 1e-3


@pytest.mark.parametrize("seed", range(20))
def test_the_natural_residual_is_at_least_the_violation(seed):
    """So the worst residual, by which solvers go on, leaves no violation out."""
    problem = random_problem(seed)
    rng = np.random.default_rng(seed)
    found, _, _ = measured(problem, rng.standard_normal(problem.layout.size), rng.standard_normal(6))
    assert 0.0 < found.violation <= found.natural * (1 + 1e-12)


def test_a_gap_between_supports_excuses_errors_of_its_own_point_alone():
    """What counts as rounding beside forces that would close the gaps: none closes one between supports."""
    problem = random_problem(3)
    layout, dual = problem.layout, problem.dual
    held, other = layout.normal[:2]
    stiff, gap = dual.diagonal.copy(), np.where(np.arange(layout.size) == held, -1.0, 0.0)
    stiff[held] = 1e-12
    supported = np.arange(layout.size) == held

    def natural(row, marks):
        """Return the natural residual and its force scale where a contact of force 1 lacks 1e-3 of it."""
        law = TrescaLaw(layout, problem.slip_bound)
        beside = replace(dual, diagonal=stiff, rhs=gap, supported=marks, friction=law)
        force = np.where(np.arange(layout.size) == row, 1.0, 0.0)
        found = measure(beside, force, gap, -1e-3 * stiff * force)
        return found.natural, found.force_scale

    assert natural(other, supported) == pytest.approx((1e-3, 1.0), rel=2e-3)
    assert natural(held, supported) == pytest.approx((0.0, 1.0), rel=2e-3)
    assert natural(other, np.zeros(layout.size, dtype=bool)) == pytest.approx((0.0, 100.0))


@pytest.mark.parametrize("one", range(4))
def test_one_large_residual_keeps_an_answer_from_being_within_a_tolerance(one):
    residuals = np.zeros(4)
    residuals[one] = 0.1
    assert Residuals(*residuals, 1.0, 1.0).within(0.1)  # type: ignore[call-arg]
    assert not Residuals(*residuals, 1.0, 1.0).within(0.099)  # type: ignore[call-arg]


def test_not_a_number_is_never_within_a_tolerance():
    assert not Residuals(np.nan, 0.0, 0.0, 0.0, 1.0, 1.0).within(1.0)
    assert Residuals(0.1, 0.0, 0.0, 0.0, 1.0, 1.0).within(0.1)
