"""Both solvers for given slip bounds, against a conic solver."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.qp import FaceNewton, Smalse, solve
from tests.qp.random_problems import conic_solution, count_statuses, dense_operator, random_problem
from tests.qp.torn_bricks import Bricks, torn_problem

SOLVERS = [
    pytest.param(FaceNewton(tolerance=1e-9), id="face-newton"),
    pytest.param(Smalse(tolerance=1e-9, max_products=100_000), id="smalse"),
]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("m", [0, 6])
@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize("seed", [0, 1])
def test_random_bodies_agree_with_a_conic_solver(solver, m, tangents, seed):
    problem = random_problem(seed, m=m, tangents=tangents, n_contact=15, n_friction=13)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    assert min(count_statuses(problem.layout, expected, problem.slip_bound)) >= 2
    found = solve(problem.dual, problem.slip_bound, solver)
    np.testing.assert_allclose(found.multiplier, expected, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_allclose(problem.G @ found.multiplier, problem.e, atol=1e-7)
    assert found.residuals.within(1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("m", [0, 5])
def test_dependent_rows_leave_the_energy_right(solver, m):
    problem = random_problem(21, m=m, rank=45, n_contact=15)
    assert np.linalg.matrix_rank(problem.F) == 45 < len(problem.d)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    assert min(count_statuses(problem.layout, expected, problem.slip_bound)) >= 1
    found = solve(problem.dual, problem.slip_bound, solver)
    assert problem.energy(found.multiplier) == pytest.approx(problem.energy(expected), rel=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_contact_without_friction_has_no_tangential_rows(solver):
    problem = random_problem(3, n_friction=0, n_contact=20)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    assert 3 <= count_statuses(problem.layout, expected, problem.slip_bound)[0] <= 17
    found = solve(problem.dual, None, solver)
    np.testing.assert_allclose(found.multiplier, expected, atol=1e-7)


@pytest.mark.parametrize("solver", SOLVERS)
def test_two_torn_bricks_agree_with_a_conic_solver(solver):
    dual, torn = torn_problem(Bricks(n=2, crown=0.2, tilt=0.5, press=0.02))
    assert dual.coarse.m == 24
    slip_bound = np.full(dual.layout.n_friction, 4e-4)
    F, G = dense_operator(dual), dual.coarse.matrix.toarray()
    expected = conic_solution(F, dual.rhs, G, dual.coarse.load, dual.layout, slip_bound)
    assert min(count_statuses(dual.layout, expected, slip_bound)) >= 1
    found = solve(dual, slip_bound, solver)
    contact = dual.layout.contact
    scale = np.abs(expected[contact]).max()
    np.testing.assert_allclose(found.multiplier[contact], expected[contact], atol=1e-6 * scale)
    displacement = torn.pseudo_inverse(torn.f - torn.B.T @ found.multiplier)
    displacement += np.einsum("ij,sj->si", torn.kernel, found.alpha.reshape(-1, 6)).ravel()
    np.testing.assert_allclose(torn.B @ displacement - torn.c, -found.residual, atol=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_signs_of_the_optimality_conditions(solver):
    problem = random_problem(5, n_contact=20)
    layout = problem.layout
    found = solve(problem.dual, problem.slip_bound, solver)
    r, lam = found.residual, found.multiplier
    np.testing.assert_allclose(r, problem.F @ lam - problem.d - problem.G.T @ found.alpha, atol=1e-12)
    np.testing.assert_allclose(r[layout.equality], 0.0, atol=1e-7)
    assert r[layout.normal].min() >= -1e-7
    assert lam[layout.normal].min() >= -1e-7
    np.testing.assert_allclose(lam[layout.normal] * r[layout.normal], 0.0, atol=1e-7)
    slip, tau = -r[layout.tangential], lam[layout.tangential]
    speed = np.linalg.norm(slip, axis=1)
    assert np.count_nonzero(speed > 0.1) >= 2
    work = np.einsum("ia,ia->i", slip, tau)
    np.testing.assert_allclose(work, problem.slip_bound * speed, atol=1e-6)


def test_warm_start_costs_little():
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    slip_bound = np.full(dual.layout.n_friction, 5e-4)
    for solver in (FaceNewton(), Smalse()):
        cold = solve(dual, slip_bound, solver)
        again = solve(dual, slip_bound, solver, cold)
        near = solve(dual, 1.001 * slip_bound, solver, cold)
        assert again.products <= 6 < cold.products
        assert near.products < cold.products
        from_vector = solve(dual, slip_bound, solver, cold.multiplier)
        assert from_vector.products < cold.products


def test_face_newton_takes_far_fewer_products_than_smalse():
    dual, _ = torn_problem(Bricks(n=4, cubes=(2, 2), crown=0.2, tilt=0.5))
    slip_bound = np.full(dual.layout.n_friction, 2.5e-4)
    newton, smalse = (solve(dual, slip_bound, solver) for solver in (FaceNewton(), Smalse()))
    np.testing.assert_allclose(
        newton.multiplier[dual.layout.normal], smalse.multiplier[dual.layout.normal], atol=1e-5
    )
    assert newton.history[-1].slip > 5 < newton.history[-1].stick
    assert newton.products < 60 < smalse.products


def test_products_are_counted_honestly():
    dual, _ = torn_problem(Bricks())
    calls = []
    counting = type(dual)(
        dual.comm,
        lambda x: calls.append(1) or dual.operator(x),
        dual.rhs,
        dual.coarse,
        dual.layout,
        dual.diagonal,
        dual.preconditioner,
    )
    slip_bound = np.full(dual.layout.n_friction, 2.5e-4)
    for solver in (FaceNewton(), Smalse()):
        calls.clear()
        assert solve(counting, slip_bound, solver).products == len(calls) > 10


def test_history_tells_what_happened():
    dual, _ = torn_problem(Bricks(crown=0.2))
    found = solve(dual, np.full(dual.layout.n_friction, 2.5e-4), FaceNewton())
    assert found.iterations == len(found.history) > 2
    assert [step.iteration for step in found.history] == list(range(found.iterations))
    assert found.history[-1].closed < dual.layout.n_contact
    assert "CG steps" in str(found.history[0])
    products = [step.products for step in found.history]
    assert products == sorted(products)
