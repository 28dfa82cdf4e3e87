"""Eleven friction problems of the literature: rank deficient, without unique forces, two of them cycling."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import FixedPoint
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import DualSolver, FaceNewton, Smalse, solve
from fenics_contact.results import Damping
from tests.qp.published_friction import CASES, CYCLING, cone_residual, published

TOLERANCE = 1e-8
SOLVERS: dict[str, DualSolver] = {
    "face Newton": FaceNewton(tolerance=TOLERANCE),
    "fixed point of SMALSE": FixedPoint(Smalse(tolerance=TOLERANCE)),
    "fixed point of face Newton": FixedPoint(FaceNewton(tolerance=TOLERANCE)),
}
PLAIN = Damping(fractions=(1.0,))
#: Takes long: what claims rest on.
LONG = {("Capsules-i101-404__sym", "fixed point of SMALSE")}
CLAIM = [pytest.mark.slow, pytest.mark.claim]


def notes(history) -> str:
    return " | ".join(step.note for step in history)


def test_there_are_eleven_and_the_forces_of_some_are_not_unique() -> None:
    assert len(CASES) == 11
    problem, _ = published(CYCLING)
    assert np.linalg.matrix_rank(problem.operator(np.eye(problem.layout.size))) < problem.layout.size


def test_the_judge_knows_the_reactions_that_came_with_the_problems_from_others() -> None:
    slipping = 0
    for path in CASES.values():
        problem, mu_f = published(path)
        with np.load(path) as case:
            reaction = case["ref_r"].astype(float).ravel()
        assert cone_residual(problem, mu_f, reaction) < 1e-12
        assert cone_residual(problem, mu_f, 1.001 * reaction) > 1e-7
        slipping += cone_residual(problem, 1.001 * mu_f, reaction) > 1e-7
    assert slipping == 7, "in the others all closed contacts stick: a larger coefficient changes nothing"


@pytest.mark.parametrize(
    ("case", "solver"),
    [
        pytest.param(case, solver, marks=CLAIM if (case, solver) in LONG else [])
        for case in CASES
        for solver in SOLVERS
    ],
)
def test_every_published_problem_is_solved_by_every_solver(case: str, solver: str) -> None:
    problem, mu_f = published(CASES[case])
    found = solve(problem, None, SOLVERS[solver], friction_coefficient=mu_f)
    rels = cone_residual(problem, mu_f, found.multiplier)
    assert rels <= TOLERANCE
    assert cone_residual(problem, mu_f, 1.001 * found.multiplier) > 10 * rels


@pytest.mark.parametrize("inner", [Smalse(tolerance=TOLERANCE), FaceNewton(tolerance=TOLERANCE)])
def test_damping_solves_what_makes_the_plain_fixed_point_cycle(inner: DualSolver) -> None:
    problem, mu_f = published(CYCLING)
    with pytest.raises(
        ConvergenceError, match="cycles or stagnates with every θ of 1; use FaceNewton"
    ) as plain:
        solve(problem, None, FixedPoint(inner, damping=PLAIN), friction_coefficient=mu_f)
    assert "they cycle with period 2: no θ is left" in plain.value.history[-1].note
    found = solve(problem, None, FixedPoint(inner), friction_coefficient=mu_f)
    assert "they cycle with period 2: damping with θ = 0.6" in notes(found.history)
    assert found.residuals.within(TOLERANCE)


def test_an_easy_problem_is_not_damped_and_every_refresh_is_told() -> None:
    problem, mu_f = published(CYCLING)
    found = solve(problem, None, FixedPoint(Smalse()), friction_coefficient=0.1 * mu_f)
    assert found.history[-1].slip > 0
    assert "damping" not in notes(found.history)
    assert 2 < notes(found.history).count("slip bounds changed by") < 15
