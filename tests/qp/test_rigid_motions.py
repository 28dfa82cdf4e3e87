"""Floating bodies come to rest between two Newton steps, without a product."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Pressure,
    Scene,
    Spring,
    Support,
    Surface,
    TotalForce,
    Tresca,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import DualProblem, FaceNewton, Smalse, solve
from fenics_contact.qp.cones import CoulombLaw, Proportional, TrescaLaw
from fenics_contact.qp.problem import NO_COMPLIANT_ROWS
from fenics_contact.qp.rigid_motions import RigidMotionCorrection, _Springs
from fenics_contact.qp.solution import contact_step
from tests.qp.torn_bricks import Bricks, torn_problem
from tests.qp.violations import coulomb_violations


def settled(problem: DualProblem, law, multiplier, residual):
    """Return δα, and the trial force after it."""
    step = contact_step(problem.layout, problem.diagonal)
    motion = RigidMotionCorrection.build(problem.with_law(law))(multiplier, residual, step)
    trial = multiplier - step * (residual - problem.coarse.transpose(motion))
    return motion, law.feasible(trial).project(trial)


def gallery(**parameters) -> tuple[DualProblem, np.ndarray, np.ndarray]:
    """Two bricks, a multiplier far from their solution and its residual."""
    dual, _ = torn_problem(Bricks(n=3, crown=0.1, tilt=0.5, **parameters))
    rng = np.random.default_rng(1)
    multiplier = dual.coarse.particular() + 1e-3 * rng.standard_normal(dual.layout.size)
    return dual, multiplier, dual.operator(multiplier) - dual.rhs


@pytest.mark.parametrize("kind", ["TrescaLaw", "CoulombLaw"])
def test_trial_forces_balance_the_load_of_the_floating_brick(kind: str):
    dual, multiplier, residual = gallery()
    ones = np.ones(dual.layout.n_friction)
    coulomb = CoulombLaw(dual.layout, Proportional(0.4 * ones))
    law = TrescaLaw(dual.layout, 1e-3 * ones) if kind == "TrescaLaw" else coulomb
    motions = RigidMotionCorrection.build(dual).motions
    assert motions.shape[1] == 6
    missing = []
    for given in (residual, residual + 1.0 * dual.coarse.transpose(motions.sum(axis=1))):
        motion, force = settled(dual, law, multiplier, given)
        assert np.linalg.norm(motion) > 1e-4
        missing.append(motions.T @ (dual.coarse.matrix @ force - dual.coarse.load))
    unsettled = law.feasible(multiplier).project(multiplier)
    before = motions.T @ (dual.coarse.matrix @ unsettled - dual.coarse.load)
    assert np.abs(missing).max() < 1e-6 * np.abs(before).max()


def test_the_motion_strains_no_glue_and_costs_no_product():
    dual, multiplier, residual = gallery()
    law = CoulombLaw(dual.layout, Proportional(np.full(dual.layout.n_friction, 0.4)))

    def no_product(x):
        raise AssertionError("rigid motions need no product")

    motion, _ = settled(replace(dual, operator=no_product), law, multiplier, residual)
    moved = dual.coarse.transpose(motion)
    assert np.abs(moved[dual.layout.equality]).max() < 1e-10 * np.abs(moved).max()


def test_without_a_floating_body_nothing_moves():
    dual, _ = torn_problem(Bricks(n=3, contact=False))
    law = TrescaLaw(dual.layout, np.zeros(0))
    assert RigidMotionCorrection.build(dual).motions.shape[1] == 0
    motion, _ = settled(dual, law, dual.coarse.particular(), -dual.rhs)
    assert not motion.any()


def test_a_load_that_the_bounds_cannot_hold_moves_the_brick_along_it(monkeypatch: pytest.MonkeyPatch):
    """That it goes on for ever is seen after half of the search for a balance."""
    tried = []
    at = _Springs.at
    monkeypatch.setattr(_Springs, "at", lambda *arguments: tried.append(1) or at(*arguments))
    dual, multiplier, residual = gallery(shear=0.05)
    law = TrescaLaw(dual.layout, np.full(dual.layout.n_friction, 1e-6))
    motion, _ = settled(dual, law, multiplier, residual)
    assert np.isfinite(motion).all()
    assert dual.coarse.load @ motion > 0.0
    assert 3 < len(tried) < 90


@pytest.mark.parametrize("friction_coefficient", [0.01, 0.005, 0.001])
def test_a_tilted_brick_on_a_round_one_that_hardly_anything_holds(friction_coefficient: float):
    dual, _ = torn_problem(Bricks(n=4, cubes=(3, 2), crown=2.0, shear=0.0, tilt=0.5))
    mu_f = np.full(dual.layout.n_friction, friction_coefficient)
    found = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    assert found.history[-1].stick == 0 < found.history[-1].slip
    assert max(coulomb_violations(dual.layout, found.multiplier, found.residual, mu_f).values()) < 1e-5
    assert all(step.method == "face Newton" for step in found.history)
    assert found.products < 100  # 6000 to more than 20 000 without the correction


SOLVERS = {"face Newton": FaceNewton(), "SMALSE": Smalse()}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("apart", [0.0, 0.5])
def test_a_start_from_a_loaded_state_finds_the_state_without_force(solver: str, apart: float):
    loaded, _ = torn_problem(Bricks(n=3, crown=0.1, tilt=0.5))
    unloaded, torn = torn_problem(Bricks(n=3, crown=0.1, press=0.0, shear=0.0))
    gap = np.zeros(len(torn.c))
    gap[unloaded.layout.normal] = apart
    unloaded = replace(unloaded, rhs=unloaded.rhs - gap)
    bound = np.full(loaded.layout.n_friction, 1e-3)
    before = solve(loaded, bound, SOLVERS[solver])
    assert before.multiplier[loaded.layout.normal].max() > 1e-4
    for start in (before, None):
        found = solve(unloaded, bound, SOLVERS[solver], start)
        assert not found.multiplier.any()
        assert found.products < 15


def test_bodies_that_were_moved_apart_come_together_again():
    dual, torn = torn_problem(Bricks(n=3, crown=0.1, tilt=0.5))
    gap = np.zeros(len(torn.c))
    gap[dual.layout.normal] = 0.5
    apart = replace(dual, rhs=dual.rhs - gap)
    mu_f = np.full(dual.layout.n_friction, 0.3)
    before = solve(dual, None, FaceNewton(), friction_coefficient=mu_f)
    found = solve(apart, None, FaceNewton(), before, friction_coefficient=mu_f)
    assert np.abs(found.multiplier - before.multiplier).max() < 1e-5 * np.abs(before.multiplier).max()
    assert found.products < 10


def test_springs_let_a_body_come_to_rest_as_they_are():
    """A body on springs and a face floats: its motion balances the load with their linear forces."""
    lower, upper = block((0, 0, 0), (2, 2, 1), (4, 4, 2)), block((0, 0, 1), (1.5, 2, 2), (3, 4, 2))
    steel = IsotropicElasticity(2.1e5, 0.3)
    springs = [
        Spring(Surface("upper", "x0"), (-1, 1, 1.5), (400.0, 100.0, 0.1)),
        Spring(Surface("upper", "y1"), (0.7, 4, 1.5), (10.0, 200.0, 0.0)),
    ]
    scene = Scene(
        {"lower": Body(lower, steel), "upper": Body(upper, steel)},
        [Support("lower", "z0")],
        [TotalForce("upper", "z1", (80.0, 20.0, -1000.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Tresca(30.0))],
        springs=springs,
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    assert state.solution.products < 80  # 300 where springs counted as rows that hold
    problem = state.dual.problem
    sprung = problem.compliant.rows
    correction = RigidMotionCorrection.build(problem)
    assert len(sprung) == 5
    assert correction.motions.shape[1] == 6
    assert RigidMotionCorrection.build(replace(problem, compliant=NO_COMPLIANT_ROWS)).motions.shape[1] < 6
    rng, law = np.random.default_rng(1), state.torn.law
    multiplier = problem.coarse.particular() + 10.0 * rng.standard_normal(problem.layout.size)
    residual = problem.operator(multiplier) - problem.rhs
    step = contact_step(problem.layout, problem.diagonal)
    motion = RigidMotionCorrection.build(problem.with_law(law))(multiplier, residual, step)
    step[sprung] = 1.0 / problem.compliant.compliance
    trial = multiplier - step * (residual - problem.coarse.transpose(motion))
    force = law.feasible(trial).project(trial)
    missing = correction.motions.T @ (problem.coarse.matrix @ force - problem.coarse.load)
    assert np.abs(missing).max() < 1e-6 * np.abs(problem.coarse.load).max()


@pytest.mark.parametrize("discretisation", ["mortar", "node"])
def test_a_flat_punch_is_not_lifted_from_what_it_presses(discretisation: str):
    punch = rectangle((0.0, 0.0), (50.0, 100.0), (41, 41), grading=(-2.0, 0.0))
    below = rectangle((0.0, -200.0), (100.0, 0.0), (41, 41))
    scene = Scene(
        {"punch": Body(punch, PlaneStrain(2.1e5, 0.3)), "below": Body(below, PlaneStrain(7e4, 0.3))},
        [
            Support("below", "y0", (0.0, 0.0)),
            *(Support(body, "x0", (0.0, None)) for body in ("punch", "below")),
        ],
        [Pressure("punch", "y1", 100.0)],
        [ContactPair(Surface("punch", "y0"), Surface("below", "y1"), discretisation=discretisation)],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    assert state.solution.products < 25  # 37 and 45 where springs lift it in every step
