"""Eleven published friction problems, each by three solvers, judged by the residual of its publishers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from fenics_contact import FixedPoint
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import DualSolution, DualSolver, FaceNewton, Smalse, solve
from fenics_contact.results import Damping
from tests.hard.conftest import Record
from tests.qp.published_friction import CASES, cone_residual, published
from tools.hard_cases.trial import fallbacks

TOLERANCE = 1e-8
SOLVERS: dict[str, DualSolver] = {
    "FaceNewton": FaceNewton(tolerance=TOLERANCE),
    "FixedPoint(Smalse)": FixedPoint(Smalse(tolerance=TOLERANCE)),
    "FixedPoint(FaceNewton)": FixedPoint(FaceNewton(tolerance=TOLERANCE)),
}
#: Problems whose plain fixed point, Ψ ← μ λ_N without damping, runs in circles.
CYCLES = {"Capsules-i101-404__sym", "OneObject-i100000-499__sym"}


@dataclass(frozen=True)
class Timed:
    """A solution and the seconds that it took."""

    solution: DualSolution
    seconds: float


@cache
def solved(path: Path, solver: str) -> Timed:
    problem, mu_f = published(path)
    start = perf_counter()
    solution = solve(problem, None, SOLVERS[solver], friction_coefficient=mu_f)
    return Timed(solution, perf_counter() - start)


@cache
def kind(path: Path) -> str:
    """Say how many contacts there are, and whether their forces are unique."""
    problem, _ = published(path)
    size = problem.layout.size
    rank = int(np.linalg.matrix_rank(np.column_stack([problem.operator(row) for row in np.eye(size)])))
    return f"{size // 3} contacts, W of rank {rank} of {size}" + (
        ": forces not unique" if rank < size else ""
    )


@cache
def cycles(path: Path) -> bool:
    """Tell whether the plain fixed point runs in circles."""
    problem, mu_f = published(path)
    plain = FixedPoint(Smalse(tolerance=TOLERANCE), damping=Damping(fractions=(1.0,)))
    try:
        solve(problem, None, plain, friction_coefficient=mu_f)
    except ConvergenceError as failure:
        return "cycle with period" in failure.history[-1].note
    return False


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("case", CASES)
def test_published_problem(case: str, solver: str, record: Record) -> None:
    path = CASES[case]
    problem, mu_f = published(path)
    timed = solved(path, solver)
    solution, last = timed.solution, timed.solution.history[-1]
    rels = cone_residual(problem, mu_f, solution.multiplier)
    assert rels <= TOLERANCE
    assert cone_residual(problem, mu_f, 1.001 * solution.multiplier) > 10 * rels
    around = cycles(path) and solver.startswith("FixedPoint")
    time = timed.seconds / solved(path, "FaceNewton").seconds
    record(
        "published", f"{case}, {solver}",
        scene=kind(path), tolerance=TOLERANCE, products=solution.products, steps=solution.iterations,
        natural=rels, cone=solution.residuals.violation, fallbacks=fallbacks(solution.history),
        status=f"{problem.layout.n_contact - last.closed} / {last.stick} / {last.slip}",
        outcome=f"solved in {time:.1f} times the time of FaceNewton"
        + ("; without damping the fixed point cycles" if around else ""),
    )  # fmt: skip


def test_two_of_the_eleven_make_the_plain_fixed_point_cycle() -> None:
    assert {case for case, path in CASES.items() if cycles(path)} == CYCLES
