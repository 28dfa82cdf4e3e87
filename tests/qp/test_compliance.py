"""Contact rows that give way: dense problems, their laws row by row, and the limit of exact contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import ClosureLaw, ClosureTable, ExponentialClosure, LinearClosure
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp import FaceNewton, Smalse, solve
from fenics_contact.qp.compliance import Closures, Compliance
from fenics_contact.qp.cones import FeasibleSet
from fenics_contact.qp.problem import DualProblem, Scaling
from fenics_contact.qp.solution import DualSolution
from tests.qp.random_problems import random_problem


class Asperities(ClosureLaw):
    """p = (closure / 0.3)^1.5, steep at zero."""

    def closure(self, pressure: np.ndarray) -> np.ndarray:
        return 0.3 * pressure ** (2.0 / 3.0)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        return 0.2 * pressure ** (-1.0 / 3.0)


LAWS: dict[str, ClosureLaw] = {
    "linear": LinearClosure(0.7),
    "soft": LinearClosure(0.01),
    "exponential": ExponentialClosure(1.5, 0.8),
    "table": ClosureTable((-0.1, 0.2, 0.3, 1.0), (0.0, 0.1, 2.0, 3.0)),
    "own": Asperities(),
}


def closures(laws: list[ClosureLaw], count: int, seed: int = 0) -> Closures:
    """Every third contact is exact."""
    rng = np.random.default_rng(seed)
    curve = np.where(np.arange(count) % 3 == 2, -1, np.arange(count) % len(laws))
    return Closures(rng.uniform(0.5, 2.0, count), curve, np.ones(count), laws)


def softened(seed: int, laws: list[ClosureLaw], slip: float = 0.0) -> tuple[DualProblem, np.ndarray]:
    problem = random_problem(seed)
    layout = problem.layout
    compliance = Compliance(layout, closures(laws, layout.n_contact), np.full(layout.n_friction, slip))
    return replace(problem.dual, compliance=compliance), problem.slip_bound


def check_law(problem: DualProblem, found: DualSolution, bound: np.ndarray) -> None:
    """Check closed, open, sticking and slipping rows one by one."""
    layout, compliance = problem.layout, problem.compliance
    assert compliance is not None
    lam, way = found.multiplier, found.residual + compliance.given_way(found.multiplier)
    normal, opening = lam[layout.normal], way[layout.normal]
    size = np.abs(normal).max()
    assert (normal >= -1e-9 * size).all()
    assert (opening >= -1e-8).all()
    assert np.abs(normal * opening).max() < 1e-7 * size
    tau, slip = lam[layout.tangential], -way[layout.tangential]
    length, speed = np.linalg.norm(tau, axis=1), np.linalg.norm(slip, axis=1)
    assert (length <= bound + 1e-8 * size).all()
    assert np.abs(np.einsum("ia,ia->i", tau, slip) - bound * speed).max() < 1e-6 * size
    assert np.abs(way[layout.equality]).max() < 1e-7


@pytest.mark.parametrize("slip", [0.0, 0.8])
@pytest.mark.parametrize("name", LAWS)
def test_a_solution_obeys_the_law_row_by_row(name: str, slip: float) -> None:
    for seed in range(3):
        problem, bound = softened(seed, [LAWS[name]], slip)
        found = solve(problem, bound, FaceNewton(tolerance=1e-11))
        check_law(problem, found, bound)
        assert min(found.history[-1].closed, found.history[-1].slip + found.history[-1].stick) > 0
        mu = np.full(problem.layout.n_friction, 0.3)
        rough = solve(problem, None, FaceNewton(tolerance=1e-11), friction_coefficient=mu)
        check_law(
            problem, rough, mu * np.maximum(rough.multiplier[problem.layout.tangential_frictional], 0.0)
        )


def test_several_laws_and_scaled_multipliers_have_the_same_answer() -> None:
    problem, bound = softened(1, list(LAWS.values()), 0.4)
    factor = np.random.default_rng(0).uniform(0.2, 5.0, problem.layout.size)
    factor[problem.layout.tangential] = factor[problem.layout.tangential_frictional, None]
    scaled = replace(problem, scaling=Scaling.build(factor, problem.coarse))
    plain, found = (solve(each, bound, FaceNewton(tolerance=1e-10)) for each in (problem, scaled))
    check_law(problem, plain, bound)
    np.testing.assert_allclose(found.multiplier, plain.multiplier, atol=1e-7 * np.abs(plain.multiplier).max())


def test_stiff_laws_tend_to_exact_contact_and_cost_the_same() -> None:
    exact = random_problem(2)
    reference = solve(exact.dual, exact.slip_bound, FaceNewton(tolerance=1e-10))
    distances = []
    for stiffness in (1e2, 1e4, 1e6, 1e12):
        problem, bound = softened(2, [LinearClosure(stiffness)])
        found = solve(problem, bound, FaceNewton(tolerance=1e-10))
        distances.append(np.linalg.norm(found.multiplier - reference.multiplier))
        assert found.products <= 1.1 * reference.products + 2
    np.testing.assert_allclose(np.array(distances[1:3]) / distances[:2], 1e-2, rtol=0.2)
    assert distances[3] < 1e-8 * np.linalg.norm(reference.multiplier)


@pytest.mark.parametrize("name", LAWS)
def test_members_of_a_law_are_integral_and_derivative_of_each_other(name: str) -> None:
    law, p = LAWS[name], np.linspace(0.05, 4.0, 31) + 0.0013
    slope = (law.closure(p + 1e-6) - law.closure(p - 1e-6)) / 2e-6
    np.testing.assert_allclose(law.growth(p), slope, rtol=1e-6)
    rate = (law.work(p + 1e-6) - law.work(p - 1e-6)) / 2e-6
    np.testing.assert_allclose(rate, law.closure(p), rtol=1e-5)
    assert law.work(np.array([1e-9]))[0] == pytest.approx(0.0, abs=1e-9)


def test_the_resolvent_solves_its_equation_over_all_sizes() -> None:
    rng = np.random.default_rng(3)
    laws = list(LAWS.values())
    for _ in range(20):
        some = Closures(10.0 ** rng.uniform(-3, 3, 40), np.arange(40) % 6 - 1, np.ones(40), laws)
        trial = rng.choice([-1.0, 1.0, 1.0], 40) * 10.0 ** rng.uniform(-6, 6, 40)
        step = 10.0 ** rng.uniform(-6, 6, 40)
        force = some.resolve(trial, step)
        assert (force[trial <= 0.0] == 0.0).all()
        left = force + step * some.closure(force) - trial
        # An exponential law is flat below a hundredth of its pressure and steep above.
        error = np.abs(left) / (trial * (1.0 + step * some.growth(force) * force / trial))
        assert error[trial > 0.0].max() < 1e-12


def test_the_resolvent_is_that_of_a_disc_on_a_spring() -> None:
    problem, _ = softened(0, [LinearClosure(1.0)], slip=0.5)
    layout, compliance = problem.layout, problem.compliance
    assert compliance is not None
    rng = np.random.default_rng(0)
    bound, trial = rng.uniform(0.2, 1.0, layout.n_friction), rng.standard_normal(layout.size)
    step = np.ones(layout.size)
    tau = compliance.resolve(FeasibleSet(layout, bound), trial, step)[layout.tangential]
    left = trial[layout.tangential] - 1.5 * tau  # the normal part of the resolvent
    inside = np.linalg.norm(tau, axis=1) < bound * (1.0 - 1e-9)
    assert inside.any()
    assert not inside.all()
    assert np.abs(left[inside]).max() < 1e-12
    outward = np.einsum("ia,ia->i", left[~inside], tau[~inside])
    np.testing.assert_allclose(outward, np.linalg.norm(left[~inside], axis=1) * bound[~inside])


def test_smalse_refuses_rows_that_give_way() -> None:
    problem, bound = softened(0, [LinearClosure(1.0)])
    with pytest.raises(InvalidInputError, match="SMALSE needs no closure laws"):
        solve(problem, bound, Smalse())
