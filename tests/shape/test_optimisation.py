"""From a scene to a better shape: value, subgradient, bounds and volume in the hands of the bundle method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, ShapeProblem, minimize
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import BundleTrust, ContactForces, LinearConstraints, Result, TotalPotential
from fenics_contact.qp import FaceNewton
from tests.contact.gallery import partitions
from tests.shape.blocks import block_on_floor, designs_of
from tests.shape.chains import chain_problem
from tests.shape.objectives import normal_forces

METHOD = BundleTrust(max_evaluations=15)


def block() -> ShapeProblem:
    """A block whose contact forces are to be evened out."""
    scene = block_on_floor(Coulomb(0.3), load=(0.35, 0.1, -2.0))
    judge = ContactForces(normal_forces)
    solver = FaceNewton(tolerance=1e-9)
    return ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver),
        designs_of(scene),
        judge,
    )


def chain() -> ShapeProblem:
    """Two crowns whose total potential energy is to fall."""
    problem = chain_problem(Coulomb(0.3))
    problem.objective = TotalPotential()
    return problem


@dataclass(frozen=True)
class Case:
    build: Callable[[], ShapeProblem]
    bound: float
    #: Value at the end in terms of the size of the first, at most.
    reached: float


CASES = {"block": Case(block, 0.02, 0.87), "chain": Case(chain, 0.2, -1.2)}


@cache
def minimised(name: str) -> tuple[ShapeProblem, Result]:
    """Minimise within a box, with the volume kept to first order."""
    case = CASES[name]
    problem = case.build()
    start = np.zeros(problem.size)
    _, by_volume = problem.volume(start)
    result = minimize(
        problem,
        start,
        METHOD,
        bounds=(np.full(problem.size, -case.bound), np.full(problem.size, case.bound)),
        constraints=LinearConstraints(np.zeros((0, problem.size)), np.zeros(0), by_volume[None], np.zeros(1)),
    )
    return problem, result


@pytest.mark.parametrize("name", CASES)
def test_the_objective_falls(name: str) -> None:
    problem, result = minimised(name)
    first = result.history[0].value
    assert result.reason.success
    assert result.iterations > 1
    assert result.value < CASES[name].reached * abs(first)
    assert result.value < first
    assert problem.best is not None
    assert result.value == problem.best.value
    assert np.array_equal(result.x, problem.best.alpha)


@pytest.mark.parametrize("name", CASES)
def test_bounds_are_kept_and_some_are_met(name: str) -> None:
    _, result = minimised(name)
    assert np.abs(result.x).max() == pytest.approx(CASES[name].bound, rel=1e-6)
    assert np.abs(result.x).max() <= CASES[name].bound


@pytest.mark.parametrize("name", CASES)
def test_the_volume_is_kept_to_first_order(name: str) -> None:
    problem, result = minimised(name)
    before, by_volume = problem.volume(np.zeros(problem.size))
    after, _ = problem.volume(result.x)
    moved = np.abs(by_volume) @ np.abs(result.x)
    assert moved > 1e-3 * before
    assert abs(by_volume @ result.x) < 1e-8 * moved
    # What is left is of second order.
    assert abs(after - before) < 1e-2 * moved


def test_the_answer_is_that_of_a_cold_start() -> None:
    _, result = minimised("block")
    value, gradient = block()(result.x)
    assert value == pytest.approx(result.value, rel=1e-7)
    assert gradient == pytest.approx(result.subgradient, rel=1e-4, abs=1e-4 * np.abs(gradient).max())


def test_designs_that_invert_cells_are_stepped_back_from() -> None:
    problem = block()
    problem.objective = TotalPotential()
    start = np.zeros(problem.size)
    bounds = (start - 3.0, start + 3.0)
    method = BundleTrust(max_evaluations=8, raise_on_failure=False)
    result = minimize(problem, start, method, bounds=bounds)
    kinds = [record.kind for record in result.history]
    assert StepKind.REJECTED in kinds
    assert StepKind.SERIOUS in kinds
    assert result.value < result.history[0].value
    assert problem.scene_of(result.x).bodies["block"].mesh.volume > 0.0


@pytest.mark.parametrize("name", CASES)
def test_a_warm_start_costs_fewer_products_than_a_cold_one(name: str) -> None:
    rng = np.random.default_rng(1)
    warm, cold = CASES[name].build(), CASES[name].build()
    first = 0.05 * CASES[name].bound * rng.standard_normal(warm.size)
    second = first + 0.01 * CASES[name].bound * rng.standard_normal(warm.size)
    warm.state_of(first)
    cheap, dear = warm.state_of(second), cold.state_of(second)
    assert 0 < cheap.solution.products < dear.solution.products
    assert cheap.energies.total_potential == pytest.approx(dear.energies.total_potential, rel=1e-8)
    assert np.array_equal(cheap.contact.status, dear.contact.status)
