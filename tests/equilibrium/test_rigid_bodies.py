"""Friction of rigid bodies whose forces are not unique: the default solves it, and in how many products."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._equilibrium.linear import default_solver
from fenics_contact._scene.plan import SolverKind
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import DualProblem, FaceNewton, InTurn, solve
from fenics_contact.qp.rescue import Rescue
from tests.qp.published_friction import CASES, cone_residual, published
from tests.qp.rigid_bodies import rigid_problem

TOLERANCE = 1e-8
DEFAULT = InTurn().with_tolerance(TOLERANCE)
#: Seeds and the contacts of their problems: stacks, capsules, piles and a groove of up to eight bodies.
SEEDS = {7: 36, 12: 72, 13: 38, 47: 30, 68: 42, 70: 40, 96: 63, 98: 54, 107: 42, 112: 63}


def rank(problem: DualProblem) -> int:
    return int(np.linalg.matrix_rank(problem.operator(np.eye(problem.layout.size))))


def test_the_default_is_the_solvers_in_turn() -> None:
    assert default_solver(SolverKind.FACE_NEWTON) == InTurn()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_default_solves_bodies_with_many_contacts(seed: int) -> None:
    problem, mu_f = rigid_problem(seed)
    assert problem.layout.n_contact == SEEDS[seed]
    assert rank(problem) < 0.6 * problem.layout.size
    found = solve(problem, None, DEFAULT, friction_coefficient=mu_f)
    assert cone_residual(problem, mu_f, found.multiplier) <= TOLERANCE
    assert found.products < 12_000


@pytest.mark.parametrize("case", CASES)
def test_the_default_solves_every_published_problem(case: str) -> None:
    problem, mu_f = published(CASES[case])
    found = solve(problem, None, DEFAULT, friction_coefficient=mu_f)
    assert cone_residual(problem, mu_f, found.multiplier) <= TOLERANCE
    assert found.products < 3_000


def test_springs_of_other_stiffness_free_a_stuck_newton(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, mu_f = rigid_problem(118)
    solver = FaceNewton(tolerance=TOLERANCE, max_products=6_000)
    found = solve(problem, None, solver, friction_coefficient=mu_f)
    assert sum(step.method == "proximal rescue" for step in found.history) > 4
    monkeypatch.setattr(
        Rescue.__init__,
        "__defaults__",
        tuple((1.0,) if each == Rescue.variety else each for each in Rescue.__init__.__defaults__),
    )
    with pytest.raises(ConvergenceError, match="rescues did not help"):
        solve(problem, None, solver, friction_coefficient=mu_f)
