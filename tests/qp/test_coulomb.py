"""Coulomb's law in one loop of the face Newton method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.qp import FaceNewton, Smalse, solve
from fenics_contact.qp.cones import CoulombLaw, TrescaLaw
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.solve import find_equilibrium
from tests.qp.random_problems import random_problem
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
    law = CoulombLaw(dual.layout, mu_f)
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
    with pytest.raises(InvalidInputError, match="SMALSE needs a given slip bound, got CoulombLaw: iterate"):
        solve(problem.dual, None, Smalse(), friction_coefficient=np.full(12, 0.4))


@pytest.mark.parametrize(
    ("friction_coefficient", "message"),
    [
        (np.full(11, 0.3), r"friction_coefficient must have shape \(12,\), got \(11,\)"),
        (np.full(12, -0.1), "friction_coefficient must be finite and not negative, got -0.1"),
        (np.full(12, np.inf), "friction_coefficient must be finite"),
    ],
)
def test_bad_friction_coefficient_is_refused(friction_coefficient, message):
    with pytest.raises(InvalidInputError, match=message):
        solve(random_problem(2).dual, None, FaceNewton(), friction_coefficient=friction_coefficient)


def test_friction_cone_projection_is_the_nearest_point():
    problem = random_problem(3, n_contact=9, n_friction=7)
    law = CoulombLaw(problem.layout, np.array([0.0, 0.1, 0.3, 1.0, 2.0, 0.5, 0.7]))
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
    law = CoulombLaw(layout, np.array([0.3, 0.3]), 0.0)
    admitted = law.admit(np.array([-1.0, 0.0, 0.0, 2.0, 0.0, 0.0]))
    np.testing.assert_array_equal(admitted, [0.0, 0.0, 0.0, 2.0, 0.0, 0.0])
