from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from fenics_contact.qp import Face, Stop
from fenics_contact.qp.face_system import FaceSystems
from fenics_contact.qp.krylov import projected_cg
from tests.qp.random_problems import random_problem
from tests.qp.torn_bricks import Bricks, torn_problem


def mixed_face(layout, slip_bound, rng):
    """Open, closed, sticking, slipping and pinned contacts by turns."""
    kind = np.arange(layout.n_friction) % 3
    width = layout.tangential.shape[1]
    direction = rng.standard_normal((layout.n_friction, width))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    slip = kind == 1
    return Face(
        layout=layout,
        closed=np.arange(layout.n_contact) % 4 != 0,
        stick=kind == 0,
        slip=slip,
        slip_bound=np.where(kind == 2, 0.0, slip_bound),
        direction=np.where(slip[:, None], direction, 0.0),
        overshoot=np.where(slip, rng.uniform(1, 3, layout.n_friction), 1.0),
        flexibility=rng.uniform(0.5, 2, layout.n_friction),
    )


def saddle_point_solution(problem, face, Z):
    """Solve min over the face by one dense factorisation; returns λ and α."""
    A = Z.T @ problem.F @ Z + np.diag(face.curvature)
    GZ = problem.G @ Z
    m = len(problem.e)
    rhs = np.concatenate([Z.T @ (problem.d - problem.F @ face.fixed), problem.e - problem.G @ face.fixed])
    solution = np.linalg.solve(np.block([[A, GZ.T], [GZ, np.zeros((m, m))]]), rhs)
    return face.fixed + Z @ solution[: len(A)], -solution[len(A) :]


def solve_on_face(system, start, dual, tolerance, limit=500):
    entered = system.enter(start)
    gradient = system.gradient(entered, dual.operator(entered) - dual.rhs)
    answer = projected_cg(system, gradient, np.ones(len(gradient)), tolerance, limit)
    return entered + system.face.prolong(answer.step), answer


@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize("m", [0, 6])
def test_solution_on_a_mixed_face_equals_the_dense_saddle_point_solution(tangents, m):
    problem = random_problem(4, m=m, tangents=tangents)
    dual, rng = problem.dual, np.random.default_rng(0)
    face = mixed_face(problem.layout, problem.slip_bound, rng)
    Z = face.restriction.toarray()
    np.testing.assert_allclose(Z.T @ Z, np.eye(face.n_face), atol=1e-14)
    assert np.count_nonzero(face.curvature) == (4 if tangents == 2 else 0)
    expected, alpha = saddle_point_solution(problem, face, Z)
    system = FaceSystems(dual, dual.operator).build(face)
    found, answer = solve_on_face(system, rng.standard_normal(len(problem.d)), dual, 1e-12)
    assert answer.stop is Stop.CONVERGED
    np.testing.assert_allclose(found, expected, atol=1e-10)
    np.testing.assert_allclose(problem.G @ found, problem.e, atol=1e-11)
    gradient = system.gradient(found, problem.F @ found - problem.d)
    np.testing.assert_allclose(system.coarse.coefficients(gradient), alpha, atol=1e-9)


def test_carried_product_and_residual_equal_recomputed_ones():
    problem = random_problem(8)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(1))
    system = FaceSystems(dual, dual.operator).build(face)
    found, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-6)
    np.testing.assert_allclose(answer.product, problem.F @ face.prolong(answer.step), atol=1e-11)
    gradient = system.gradient(found, problem.F @ found - problem.d)
    np.testing.assert_allclose(answer.residual, system.coarse.project(gradient), atol=1e-11)
    assert answer.measure == pytest.approx(np.linalg.norm(answer.residual))


def test_linear_torn_body_takes_few_steps_with_the_dirichlet_preconditioner():
    counts = {}
    for preconditioned in (False, True):
        dual, _ = torn_problem(Bricks(cubes=(2, 2), contact=False, preconditioned=preconditioned))
        face = mixed_face(dual.layout, np.zeros(0), np.random.default_rng(0))
        system = FaceSystems(dual, dual.operator).build(face)
        found, answer = solve_on_face(system, np.zeros(dual.layout.size), dual, 1e-9)
        assert answer.stop is Stop.CONVERGED
        residual = dual.operator(found) - dual.rhs
        assert np.linalg.norm(dual.coarse.project(residual)) < 2e-9
        counts[preconditioned] = answer.iterations
    assert counts[True] < 0.6 * counts[False]


def test_singular_operator_with_consistent_right_side_converges():
    problem = random_problem(11, rank=30, m=4)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(2))
    face = replace(face, slip_bound=np.zeros_like(face.slip_bound))
    system = FaceSystems(dual, dual.operator).build(face)
    Z = face.restriction.toarray()
    inner = scipy.linalg.null_space(system.coarse.matrix.toarray())
    rank = np.linalg.matrix_rank(inner.T @ Z.T @ problem.F @ Z @ inner, tol=1e-10)
    assert rank < inner.shape[1]
    consistent = Z.T @ problem.F @ Z @ inner @ np.ones(inner.shape[1])
    answer = projected_cg(replace(system, face=face), consistent, np.ones(len(consistent)), 1e-9, 300)
    assert answer.stop is Stop.CONVERGED


def test_inconsistent_singular_system_stops_with_a_reason():
    problem = random_problem(11, rank=10, m=0)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(2))
    system = FaceSystems(dual, dual.operator).build(face)
    gradient = np.random.default_rng(3).standard_normal(face.n_face)
    answer = projected_cg(system, gradient, np.ones(face.n_face), 1e-9, 300)
    assert answer.stop in (Stop.NO_CURVATURE, Stop.STAGNATION)


def test_iteration_limit_is_reported():
    problem = random_problem(4)
    dual = problem.dual
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(0))
    system = FaceSystems(dual, dual.operator).build(face)
    _, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-12, limit=5)
    assert answer.stop is Stop.ITERATION_LIMIT
    assert answer.iterations == 5


def test_indefinite_preconditioner_is_reported():
    problem = random_problem(4)
    dual = replace(problem.dual, preconditioner=lambda x: -x)
    face = mixed_face(problem.layout, problem.slip_bound, np.random.default_rng(0))
    system = FaceSystems(dual, dual.operator).build(face)
    _, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-12)
    assert answer.stop is Stop.BAD_PRECONDITIONER


def test_more_directions_than_the_first_block_holds():
    problem = random_problem(6, n_equality=120, n_contact=0, m=3)
    dual = problem.dual
    face = mixed_face(problem.layout, np.zeros(0), np.random.default_rng(0))
    system = FaceSystems(dual, dual.operator).build(face)
    found, answer = solve_on_face(system, np.zeros(len(problem.d)), dual, 1e-13)
    assert 32 < answer.iterations <= 125
    expected, _ = saddle_point_solution(problem, face, face.restriction.toarray())
    np.testing.assert_allclose(found, expected, atol=1e-10)
