from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from mpi4py import MPI
from scipy.optimize import nnls

from fenics_contact.qp import FeasibleSet
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.smalse import BoundedQuadratic, Mpgp, largest_eigenvalue, minimise
from tests.qp.random_problems import conic_solution, count_statuses, random_problem


def minimum(A, b, feasible, start=None, target=1e-12, **parameters):
    quadratic = BoundedQuadratic(MPI.COMM_SELF, lambda x: A @ x, b, feasible, np.linalg.norm(A, 2))
    start = np.zeros(len(b)) if start is None else start
    return minimise(quadratic, start, lambda x: target, parameters=Mpgp(**parameters), max_iterations=2000)


def test_nonnegative_least_squares_agrees_with_lawson_and_hanson():
    rng = np.random.default_rng(1)
    matrix, right = rng.standard_normal((40, 25)), rng.standard_normal(40)
    expected, _ = nnls(matrix, right)
    assert 5 < np.count_nonzero(expected) < 20
    feasible = FeasibleSet(ContactLayout.build(25, normal=np.arange(25)), np.zeros(0))
    found = minimum(matrix.T @ matrix, matrix.T @ right, feasible)
    assert found.reached
    np.testing.assert_allclose(found.x, expected, atol=1e-10)
    np.testing.assert_array_equal(found.x == 0.0, expected == 0.0)


def test_identity_gives_the_projection():
    layout = ContactLayout.build(4, normal=[0], tangential=[[1, 2]])
    found = minimum(np.eye(4), np.array([-1.0, 3.0, 4.0, 2.0]), FeasibleSet(layout, np.array([1.0])))
    np.testing.assert_allclose(found.x, [0.0, 0.6, 0.8, 2.0], atol=1e-12)


def test_bounds_and_discs_agree_with_a_conic_solver():
    problem = random_problem(5, m=0, n_contact=15)
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    assert min(count_statuses(problem.layout, expected, problem.slip_bound)) >= 2
    found = minimum(problem.F, problem.d, feasible)
    assert found.reached
    np.testing.assert_allclose(found.x, expected, atol=1e-6)


def test_quadratic_without_constraints_is_solved_by_conjugate_gradients():
    problem = random_problem(2, n_equality=30, n_contact=0, m=0)
    found = minimum(problem.F, problem.d, FeasibleSet(problem.layout, np.zeros(0)), target=1e-10)
    np.testing.assert_allclose(found.x, np.linalg.solve(problem.F, problem.d), atol=1e-8)
    assert found.iterations <= 45


def test_singular_quadratic_with_consistent_right_side_converges():
    problem = random_problem(7, m=0, rank=30)
    assert np.linalg.matrix_rank(problem.F) == 30 < len(problem.d)
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    expected = conic_solution(problem.F, problem.d, problem.G, problem.e, problem.layout, problem.slip_bound)
    found = minimum(problem.F, problem.d, feasible, target=1e-8)
    assert found.reached
    assert problem.energy(found.x) == pytest.approx(problem.energy(expected), rel=1e-9)


def test_iterates_stay_in_the_set_and_the_gradient_is_honest():
    problem = random_problem(9, m=0)
    feasible = FeasibleSet(problem.layout, problem.slip_bound)
    found = minimum(problem.F, problem.d, feasible, target=1e-3)
    assert feasible.violation(found.x) <= 1e-14
    np.testing.assert_allclose(found.gradient, problem.F @ found.x - problem.d, atol=1e-12)
    assert 0 < found.projected <= 1e-3


def test_iteration_limit_is_reported():
    problem = random_problem(9, m=0)
    quadratic = BoundedQuadratic(
        MPI.COMM_SELF,
        lambda x: problem.F @ x,
        problem.d,
        FeasibleSet(problem.layout, problem.slip_bound),
        10.0,
    )
    found = minimise(
        quadratic, np.zeros(len(problem.d)), lambda x: 1e-12, parameters=Mpgp(), max_iterations=3
    )
    assert not found.reached
    assert found.iterations == 3


@pytest.mark.parametrize("n", [1, 4, 60])
def test_norm_estimate_bounds_the_norm_from_above_and_closely(n):
    rng = np.random.default_rng(n)
    A = rng.standard_normal((n, n))
    A = A @ A.T
    counted = []
    estimate = largest_eigenvalue(MPI.COMM_SELF, lambda x: counted.append(1) or A @ x, n)
    exact = scipy.linalg.eigvalsh(A)[-1]
    assert exact * (1 - 1e-12) <= estimate <= 1.06 * exact
    assert len(counted) <= 20


def test_norm_of_the_zero_operator_is_zero():
    assert largest_eigenvalue(MPI.COMM_SELF, np.zeros_like, 5) == 0.0
