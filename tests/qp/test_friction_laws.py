"""Coulomb, Tresca and mixed friction of quadratic programmes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import FaceNewton, Smalse, solve
from fenics_contact.qp.cones import CoulombLaw, Proportional, TrescaLaw
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.problem import Scaling
from fenics_contact.qp.solve import find_equilibrium
from tests.qp.random_problems import conic_solution, count_statuses, dense_operator, random_problem
from tests.qp.torn_bricks import Bricks, torn_problem
from tests.qp.violations import coulomb_violations


@pytest.mark.parametrize("friction_coefficient", [0.21, 0.3, 0.6, 2.0])
def test_pulled_brick_obeys_the_whole_law(friction_coefficient):
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=0.1, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, friction_coefficient)
    found = solve(dual, None, FaceNewton(tolerance=1e-9), friction_coefficient=mu_f)
    last = found.history[-1]
    assert min(last.stick, last.slip, dual.layout.n_contact - last.closed) >= 2
    for name, value in coulomb_violations(dual.layout, found.multiplier, found.residual, mu_f).items():
        assert value < 1e-8, name
    np.testing.assert_allclose(found.slip_bound, mu_f * found.multiplier[dual.layout.tangential_frictional])
    np.testing.assert_allclose(dual.coarse.matrix @ found.multiplier, dual.coarse.load, atol=1e-12)
    assert found.residuals.within(1e-9)
    assert found.products < 90


def test_every_node_slips_near_the_limit_of_equilibrium():
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=0.1))
    mu_f = np.full(dual.layout.n_friction, 0.2005)
    found = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    assert found.history[-1].stick == 0 < found.history[-1].slip
    assert max(coulomb_violations(dual.layout, found.multiplier, found.residual, mu_f).values()) < 1e-5


@pytest.mark.parametrize("friction_coefficient", [0.01, 0.001])
def test_brick_held_by_next_to_nothing_converges(friction_coefficient):
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=0.1, shear=0.0))
    mu_f = np.full(dual.layout.n_friction, friction_coefficient)
    found = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    assert max(coulomb_violations(dual.layout, found.multiplier, found.residual, mu_f).values()) < 1e-5
    assert found.products < 200


def test_one_loop_equals_the_fixed_point_of_tresca_problems():
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    mu_f = np.linspace(0.25, 0.5, dual.layout.n_friction)
    law = CoulombLaw(dual.layout, Proportional(mu_f))
    one_loop = solve(dual, None, FaceNewton(tolerance=1e-10), friction_coefficient=mu_f)
    step, products = None, 0
    first = find_equilibrium(dual.with_law(law)).multiplier
    for _ in range(60):
        bound = law.bound(first if step is None else step.multiplier)
        step = solve(dual, bound, Smalse(tolerance=1e-10), step)
        products += step.products
    scale = one_loop.multiplier[dual.layout.normal].max()
    np.testing.assert_allclose(
        step.multiplier[dual.layout.contact], one_loop.multiplier[dual.layout.contact], atol=1e-7 * scale
    )
    assert one_loop.products < 0.2 * products


def test_solution_of_coulomb_solves_tresca_with_its_own_bound():
    problem = random_problem(2, n_contact=15)
    mu_f = np.full(15, 0.4)
    found = solve(problem.dual, None, FaceNewton(tolerance=1e-9), friction_coefficient=mu_f)
    assert 0 < found.history[-1].slip
    tresca = solve(problem.dual, found.slip_bound, Smalse(tolerance=1e-9))
    np.testing.assert_allclose(tresca.multiplier, found.multiplier, atol=1e-6)


def test_plane_problems_have_intervals_for_discs():
    problem = random_problem(4, n_contact=12, tangents=1)
    mu_f = np.full(12, 0.4)
    found = solve(problem.dual, None, FaceNewton(tolerance=1e-9), friction_coefficient=mu_f)
    assert 0 < found.history[-1].slip
    violations = coulomb_violations(problem.layout, found.multiplier, found.residual, mu_f)
    assert max(violations.values()) < 1e-7


def test_too_soft_a_diagonal_does_not_make_friction_flip_for_ever():
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=0.02, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, 0.3)
    exact = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    wrong = replace(dual, diagonal=dual.diagonal / 3)
    found = solve(wrong, None, FaceNewton(), friction_coefficient=mu_f)
    assert "rescue" not in " ".join(step.method for step in found.history)
    np.testing.assert_allclose(found.multiplier, exact.multiplier, atol=1e-4 * exact.residuals.force_scale)


def test_impatient_newton_is_rescued_and_still_right():
    dual, _ = torn_problem(Bricks(n=4, cubes=(2, 2), crown=0.3, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, 0.25)
    plain = solve(dual, None, FaceNewton(tolerance=1e-8), friction_coefficient=mu_f)
    hasty = FaceNewton(tolerance=1e-8, patience=1, forcing=0.9, loosest=0.5, rescue_products=40)
    found = solve(dual, None, hasty, friction_coefficient=mu_f)
    rescues = [step for step in found.history if "rescue" in step.method]
    assert rescues
    assert "rescue from" in rescues[0].note
    assert " because the " in rescues[0].note
    after = found.history[rescues[0].iteration + 1 :]
    assert any(step.method == "face Newton" for step in after)
    np.testing.assert_allclose(found.multiplier, plain.multiplier, atol=1e-6 * plain.residuals.force_scale)


def test_failure_carries_the_history():
    dual, _ = torn_problem(Bricks(crown=0.1, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, 0.3)
    with pytest.raises(
        ConvergenceError, match=r"face Newton needs residuals below 1.0e-12.*raise max_"
    ) as caught:
        solve(dual, None, FaceNewton(tolerance=1e-12, max_steps=3), friction_coefficient=mu_f)
    assert len(caught.value.history) == 3


def test_smalse_refuses_a_bound_that_follows_the_multiplier():
    problem = random_problem(2)
    with pytest.raises(
        InvalidInputError, match="SMALSE needs a given slip bound, got CoulombLaw: use FaceNewton"
    ):
        solve(problem.dual, None, Smalse(), friction_coefficient=np.full(12, 0.4))


@pytest.mark.parametrize(
    ("friction_coefficient", "message"),
    [
        (np.full(11, 0.3), r"friction_coefficient needs shape \(12,\), got \(11,\)"),
        (np.full(12, -0.1), r"friction_coefficient must be in \[0, ∞\), got -0.1"),
        (np.full(12, np.inf), r"friction_coefficient must be in \[0, ∞\), got 0.*inf|inf"),
    ],
)
def test_bad_friction_coefficient_is_refused(friction_coefficient, message):
    with pytest.raises(InvalidInputError, match=message):
        solve(random_problem(2).dual, None, FaceNewton(), friction_coefficient=friction_coefficient)


def test_friction_cone_projection_is_the_nearest_point():
    problem = random_problem(3, n_contact=9, n_friction=7)
    law = CoulombLaw(problem.layout, Proportional(np.array([0.0, 0.1, 0.3, 1.0, 2.0, 0.5, 0.7])))
    rng = np.random.default_rng(0)
    cases = 3.0 * rng.standard_normal((200, problem.layout.size))
    for x, y in zip(cases[::2], cases[1::2], strict=True):
        nearest, other = law.admit(x), law.admit(y)
        assert law.feasible(nearest).violation(nearest) < 1e-14
        assert (x - nearest) @ (other - nearest) <= 1e-12
        np.testing.assert_allclose(law.admit(nearest), nearest, atol=1e-14)


def test_tresca_bound_does_not_depend_on_the_multiplier():
    problem = random_problem(3)
    law = TrescaLaw(problem.layout, problem.slip_bound)
    np.testing.assert_array_equal(law.bound(np.zeros(problem.layout.size)), problem.slip_bound)


def test_forces_that_pull_without_any_friction_are_admitted_as_none() -> None:
    layout = ContactLayout.build(6, normal=[0, 3], tangential=[[1, 2], [4, 5]])
    law = CoulombLaw(layout, Proportional(np.array([0.3, 0.3])), 0.0)
    admitted = law.admit(np.array([-1.0, 0.0, 0.0, 2.0, 0.0, 0.0]))
    np.testing.assert_array_equal(admitted, [0.0, 0.0, 0.0, 2.0, 0.0, 0.0])


# Both solvers for given slip bounds, against a conic solver.
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


# A slip bound with a given part and one that follows the normal force, Ψ = Ψ₀ + μ λ_N.
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
    return CoulombLaw(layout(), Proportional(coefficient), given)


def excess(law: CoulombLaw, points: np.ndarray) -> np.ndarray:
    """Return by how much points lie outside their cones."""
    bound = law.given + law.strength.coefficient * points[:, 0]
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
    expected = law.given + law.strength.coefficient * np.maximum(points[:, 0], 0.0)
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
    with pytest.raises(ValueError, match=r"slip_bound must be in \[0, ∞\)"):
        CoulombLaw(layout(), Proportional(np.zeros(COUNT)), given)
    assert not TrescaLaw(layout(), np.zeros(COUNT)).grows
