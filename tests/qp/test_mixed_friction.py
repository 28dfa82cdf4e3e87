"""A slip bound with a given part and one that follows the normal force, Ψ = Ψ₀ + μ λ_N."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.qp import FaceNewton, Smalse, solve
from fenics_contact.qp.cones import CoulombLaw, TrescaLaw
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.problem import Scaling
from tests.qp.random_problems import random_problem
from tests.qp.torn_bricks import Bricks, torn_problem

COUNT = 400


def layout() -> ContactLayout:
    rows = np.arange(3 * COUNT).reshape(COUNT, 3)
    return ContactLayout.build(3 * COUNT, normal=rows[:, 0], tangential=rows[:, 1:])


def random_points(seed: int, size: float = 3.0) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal((COUNT, 3))


def random_law(seed: int) -> CoulombLaw:
    rng = np.random.default_rng(seed)
    coefficient, given = rng.uniform(0, 1.5, COUNT), rng.uniform(0, 1.5, COUNT)
    coefficient[::5], given[::7] = 0.0, 0.0
    return CoulombLaw(layout(), coefficient, given)


def excess(law: CoulombLaw, points: np.ndarray) -> np.ndarray:
    """Return by how much points lie outside their cones."""
    bound = law.given + law.friction_coefficient * points[:, 0]
    return np.maximum(np.linalg.norm(points[:, 1:], axis=1) - bound, -points[:, 0])


def admitted(law: CoulombLaw, points: np.ndarray) -> np.ndarray:
    return law.admit(points.ravel()).reshape(COUNT, 3)


def test_the_admitted_multiplier_is_the_nearest_one_in_its_cone() -> None:
    law, points = random_law(1), random_points(2)
    nearest = admitted(law, points)
    assert np.count_nonzero(excess(law, points) > 0) > COUNT / 3
    assert excess(law, nearest).max() < 1e-12
    tried = 0
    for seed in range(3, 40):
        others = admitted(law, random_points(seed))  # points of the cones
        tried += np.count_nonzero(np.abs(others - nearest).max(axis=1) > 0.1)
        assert np.einsum("nd,nd->n", points - nearest, others - nearest).max() < 1e-10
    assert tried > 10 * COUNT


def test_an_admissible_multiplier_is_left_as_it_is() -> None:
    law = random_law(1)
    inside = admitted(law, random_points(2))
    assert admitted(law, inside) == pytest.approx(inside, abs=1e-12)
    assert np.count_nonzero(inside[:, 0] > 0) > COUNT / 4


def test_the_bound_has_both_parts() -> None:
    law, points = random_law(1), random_points(2)
    expected = law.given + law.friction_coefficient * np.maximum(points[:, 0], 0.0)
    assert law.bound(points.ravel()) == pytest.approx(expected)
    assert law.feasible(points.ravel()).slip_bound == pytest.approx(expected)


def test_a_coefficient_of_zero_is_tresca_and_a_given_bound_of_zero_is_coulomb() -> None:
    dual, _ = torn_problem(Bricks(n=3, crown=0.1, tilt=0.5))
    discs, solver = dual.layout.n_friction, FaceNewton(tolerance=1e-10)
    given, mu_f = np.full(discs, 2.5e-4), np.full(discs, 0.3)
    pairs = [
        (solve(dual, given, solver), solve(dual, given, solver, friction_coefficient=np.zeros(discs))),
        (
            solve(dual, None, solver, friction_coefficient=mu_f),
            solve(dual, np.zeros(discs), solver, friction_coefficient=mu_f),
        ),
    ]
    for plain, mixed in pairs:
        size = plain.multiplier[dual.layout.normal].max()
        assert np.abs(plain.multiplier - mixed.multiplier).max() < 1e-8 * size
    assert np.abs(pairs[0][0].multiplier - pairs[1][0].multiplier).max() > 1e-3 * size


def test_the_mixed_law_holds_and_one_loop_equals_tresca_problems_with_its_bound() -> None:
    dual, _ = torn_problem(Bricks(n=3, crown=0.1, tilt=0.5))
    discs = dual.layout.n_friction
    given, mu_f = np.where(np.arange(discs) % 2, 1e-4, 0.0), np.full(discs, 0.19)
    found = solve(dual, given, FaceNewton(tolerance=1e-10), friction_coefficient=mu_f)
    last = found.history[-1]
    assert min(last.stick, last.slip, dual.layout.n_contact - last.closed) > 0
    normal = found.multiplier[dual.layout.tangential_frictional]
    assert found.slip_bound == pytest.approx(given + mu_f * normal, abs=1e-14)
    again = solve(dual, found.slip_bound, Smalse(tolerance=1e-10))
    assert np.abs(again.multiplier - found.multiplier).max() < 1e-7 * normal.max()


def test_a_law_in_scaled_multipliers_has_the_same_answer() -> None:
    problem = random_problem(4)
    rng = np.random.default_rng(0)
    factor, mu_f = (
        rng.uniform(0.1, 10.0, problem.layout.size),
        rng.uniform(0.1, 0.8, problem.layout.n_friction),
    )
    factor[problem.layout.tangential] = factor[problem.layout.tangential_frictional, None]
    scaled = replace(problem.dual, scaling=Scaling.build(factor, problem.dual.coarse))
    solver = FaceNewton(tolerance=1e-9)
    for bound, coefficient in ((problem.slip_bound, None), (0.3 * problem.slip_bound, mu_f)):
        plain = solve(problem.dual, bound, solver, friction_coefficient=coefficient)
        found = solve(scaled, bound, solver, friction_coefficient=coefficient)
        assert found.problem is scaled
        assert found.multiplier == pytest.approx(plain.multiplier, abs=1e-6 * np.abs(plain.multiplier).max())
        assert found.slip_bound == pytest.approx(plain.slip_bound, rel=1e-5)


@pytest.mark.parametrize("given", [-1.0, np.nan, np.full(COUNT, -1.0)])
def test_a_given_bound_that_is_none_is_refused(given) -> None:
    with pytest.raises(ValueError, match="slip_bound must be finite and not negative"):
        CoulombLaw(layout(), np.zeros(COUNT), given)
    assert TrescaLaw(layout(), np.zeros(COUNT)).growth.max() == 0
