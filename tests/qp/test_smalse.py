"""SMALSE-M and MPGP: what their parameters may be, what they cost, and the rates that theory has for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.many_ranks import TRACTIONS, Cube, spectrum
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import DualProblem, DualSolution, FeasibleSet, Mpgp, Smalse, Start, solve
from fenics_contact.qp.smalse import BoundedQuadratic, minimise, outer_iterations
from tests.qp.random_problems import random_problem

NAN = float("nan")


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: Mpgp(expansion=2.0), r"expansion of Mpgp, ᾱ‖A‖, must be in \(0, 2.0\), got 2.0: leave"),
        (lambda: Mpgp(expansion=0.0), r"expansion of Mpgp, ᾱ‖A‖, must be in \(0, 2.0\), got 0.0"),
        (lambda: Mpgp(expansion=NAN), r"expansion of Mpgp, ᾱ‖A‖, must be in \(0, 2.0\), got nan"),
        (lambda: Mpgp(proportioning=0.0), r"proportioning of Mpgp, Γ, must be in \(0, ∞\), got 0.0"),
        (lambda: Smalse(balance=-1.0), r"balance of Smalse, M, must be in \(0, ∞\), got -1.0"),
        (lambda: Smalse(loosest=np.inf), r"loosest of Smalse, η, must be in \(0, ∞\), got inf"),
        (
            lambda: Smalse(balance_reduction=1.0),
            r"balance_reduction of Smalse, 1/β, must be in \(0, 1.0\), got 1.0: leave it out for the default",
        ),
    ],
)
def test_parameters_without_a_proof_of_convergence_are_refused(
    made: Callable[[], Smalse | Mpgp], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        made()


def test_parameters_within_their_ranges_are_taken() -> None:
    assert Smalse(mpgp=Mpgp(1e-3, 1e3), balance=1e-3, balance_reduction=0.999).mpgp.expansion == 1e-3


@pytest.mark.parametrize("seed", range(1, 5))
@pytest.mark.parametrize("most", [20, 40, 100])
def test_no_more_products_are_used_than_allowed(seed: int, most: int) -> None:
    """But the second one of a last gradient projection; it used to be up to 70 % more."""
    problem = random_problem(seed, n_contact=60)
    solver = Smalse(tolerance=1e-12, max_products=most, loosest=1e-13)
    with pytest.raises(ConvergenceError, match="raise max_products") as caught:
        solve(problem.dual, problem.slip_bound, solver)
    assert most <= caught.value.history[-1].products <= most + 1


@pytest.mark.parametrize("gamma", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("expansion", [0.7, 1.0, 1.9])
@pytest.mark.parametrize("seed", [5, 9])
def test_every_step_of_mpgp_decreases_the_quadratic_at_the_rate_of_theory(
    seed: int, expansion: float, gamma: float
) -> None:
    """By 1 − α̂λ/(2 max(ᾱ‖A‖, 1)(1 + max(Γ, 1/Γ)²)), α̂ = min(ᾱ, 2/‖A‖ − ᾱ), λ the least eigenvalue."""
    problem, values = random_problem(seed, m=0), list[float]()
    eigenvalues = np.linalg.eigvalsh(problem.F)
    norm, feasible = float(eigenvalues[-1]), FeasibleSet(problem.layout, problem.slip_bound)

    def target(x: np.ndarray) -> float:
        assert feasible.violation(x) < 1e-13
        values.append(problem.energy(x))
        return 1e-10

    quadratic = BoundedQuadratic(MPI.COMM_SELF, lambda x: problem.F @ x, problem.d, feasible, norm)
    start, parameters = np.zeros_like(problem.d), Mpgp(expansion, gamma)
    found = minimise(quadratic, start, target, parameters=parameters, max_products=2000)
    assert found.reached
    assert 10 < found.iterations == len(values) - 1
    shorter = min(expansion, 2.0 - expansion) * eigenvalues[0] / norm
    rate = 1.0 - shorter / (2.0 * max(expansion, 1.0) * (1.0 + max(gamma, 1.0 / gamma) ** 2))
    above = np.array(values) - values[-1]
    assert 0.0 < rate < 1.0
    assert np.all(above[1:] <= rate * above[:-1] + 1e-12 * above[0])


@dataclass(frozen=True, eq=False)
class Outer:
    """An outer iteration: M before and after it, ‖Q x − λ₀‖ and L at its end, where ‖P F P‖ = 1."""

    before: float
    after: float
    error: float
    value: float


@dataclass(frozen=True)
class Watched:
    """SMALSE that is followed by its own algebra."""

    followed: list[Outer]
    smalse: Smalse

    @property
    def tolerance(self) -> float:
        return self.smalse.tolerance

    def with_tolerance(self, tolerance: float) -> Watched:
        return Watched(self.followed, self.smalse.with_tolerance(tolerance))

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        project, operator, M = problem.coarse.project, problem.operator, self.smalse.balance
        first, v = problem.coarse.particular(), np.zeros(problem.layout.size)
        for state in outer_iterations(problem, start, self.smalse):
            norm = state.memory.norm
            if not self.followed:  # μ is such that the gradient of the start is its residual
                v = (start.iterate.residual - project(start.iterate.residual)) / norm
            x, inside = state.multiplier, project(state.multiplier)
            b, miss = project(problem.rhs - operator(first)) / norm, x - inside - first
            energy = 0.5 * inside @ operator(inside) / norm - b @ x + v @ miss + 0.5 * miss @ miss
            error = float(np.linalg.norm(miss))
            self.followed.append(Outer(M, state.memory.balance, error, float(energy)))
            v, M = v + miss, state.memory.balance
            if state.residuals.within(0.5 * self.tolerance):
                break
        return self.smalse.run(problem, Start(start.iterate, start.operator.anew()))


@cache
def followed(side: int, law: str, words: str) -> tuple[list[Outer], DualSolution, tuple[float, float]]:
    """The outer iterations of SMALSE on a cube, its solution, and the spectrum of P F P on Ker G."""
    watched = Watched([], Smalse())
    state = Cube(side, 4, TRACTIONS[words]).solved(law, watched)
    assert isinstance(state.solution, DualSolution)
    return watched.followed, state.solution, spectrum(state.dual.problem)


SIDES = [2, 3, pytest.param(4, marks=pytest.mark.claim)]
#: Most products and outer iterations at H/h = 4, of any number of subdomains.
MOST = {
    ("linear", "all nodes closed"): (55, 2),
    ("frictionless", "all nodes closed"): (60, 2),
    ("frictionless", "some open"): (95, 8),
    ("Tresca", "all nodes closed"): (220, 10),
    ("Tresca", "some open"): (250, 11),
}


@pytest.mark.parametrize("side", SIDES)
def test_the_spectrum_of_the_hessian_does_not_depend_on_the_number_of_subdomains(side: int) -> None:
    least, largest = followed(side, "Tresca", "all nodes closed")[2]
    assert 30.0 < largest / least < 37.0


def test_the_condition_number_grows_no_faster_than_the_size_of_subdomains() -> None:
    """κ ≤ C H/h."""
    coarse, fine = Cube(2, 2).condition, Cube(2, 4).condition
    assert 1.2 * coarse < fine < 2.0 * coarse


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("law", "words"), MOST)
def test_smalse_needs_as_many_products_for_any_number_of_subdomains(side: int, law: str, words: str) -> None:
    outer, solution, _ = followed(side, law, words)
    products, iterations = MOST[law, words]
    assert 0.6 * products < solution.products
    assert solution.products <= products
    assert len(outer) == solution.iterations <= iterations


def rises(last: Outer, now: Outer) -> bool:
    """Whether L rises by half the squared error of equilibrium."""
    return now.value >= last.value + 0.5 * now.error**2 - 1e-12 * abs(now.value)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("words", TRACTIONS)
def test_the_lagrangian_rises_and_m_stays_above_the_bound_of_theory(side: int, words: str) -> None:
    """M = √a/5 lets it rise by half the squared error: M falls no further than to a tenth of that."""
    outer, _, (least, largest) = followed(side, "Tresca", words)
    root = float(np.sqrt(least / largest))
    assert len(outer) > 4
    for last, now in pairwise(outer):
        assert now.after == pytest.approx(now.before * (1.0 if rises(last, now) else 0.1))
        assert rises(last, now) or now.before > 0.2 * root
        assert now.error < last.error
    assert any(now.after < now.before for now in outer), "M never fell: nothing was tested"
    assert outer[-1].after >= 0.02 * root


def test_m_falls_where_the_lagrangian_rises_by_less_than_half_the_squared_error() -> None:
    steps = list[tuple[Outer, Outer]]()
    for seed in range(1, 7):
        problem, outer = random_problem(seed), list[Outer]()
        solve(problem.dual, problem.slip_bound, Watched(outer, Smalse(1e-6, balance_reduction=0.7)))
        steps.extend(pairwise(outer))
    for last, now in steps:
        assert now.after == pytest.approx(now.before * (1.0 if rises(last, now) else 0.7))
    gains = [(now.value - last.value) / (0.5 * now.error**2) for last, now in steps]
    assert any(0.0 < gain < 1.0 for gain in gains), "no Lagrangian rose a little: the bound was not tested"
    assert any(1.0 < gain < 3.0 for gain in gains)
