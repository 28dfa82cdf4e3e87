"""Starting from a neighbouring state costs less and changes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, FixedPoint, Scene, State, Traction, Tresca
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from tests.contact.checks import assert_solved
from tests.contact.gallery import block_on_plane, crowned, partitions, two_blocks

TOLERANCE = 1e-8
SOLVERS: dict[str, DualSolver] = {
    "face Newton": FaceNewton(tolerance=TOLERANCE),
    "SMALSE": Smalse(tolerance=TOLERANCE),
    "fixed point": FixedPoint(Smalse(tolerance=TOLERANCE)),
}


def posed(scene: Scene, solver: str) -> ContactProblem:
    return ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=SOLVERS[solver])


def assert_same(one: State, two: State) -> None:
    size = np.abs(two.contact.force).max()
    assert size > 0.01
    assert np.abs(one.contact.force - two.contact.force).max() < 1e-6 * size
    assert one.energies.total_potential == pytest.approx(two.energies.total_potential, rel=1e-8)


#: SMALSE needs some twelve products more for its estimate of ‖PFP‖.
FEW = {"face Newton": 5, "SMALSE": 22, "fixed point": 22}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("friction", [Coulomb(0.38), Tresca(1.0)])
def test_solving_again_costs_at_most_a_few_products(friction: Coulomb | Tresca, solver: str) -> None:
    scene = two_blocks(friction)
    problem = posed(scene, solver)
    first, again = problem.solve(), problem.solve()
    assert_solved(again, TOLERANCE)
    assert_same(again, first)
    assert first.counts["f_products"] > 20
    assert again.counts["f_products"] <= FEW[solver]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("friction", [Coulomb(0.38), Tresca(1.0)])
def test_a_moved_scene_has_the_same_answer_from_a_warm_and_a_cold_start(
    friction: Coulomb | Tresca, solver: str
) -> None:
    scene = two_blocks(friction)
    problem = posed(scene, solver)
    before = problem.solve()
    moved = scene.moved({"upper": crowned(scene.bodies["upper"].mesh, 0.002).points})
    warm, cold = problem.solve(moved), problem.solve(moved, start=None)
    assert_solved(cold, TOLERANCE)
    assert_solved(warm, TOLERANCE)
    assert_same(warm, cold)
    change = np.abs(cold.contact.force - before.contact.force).max()
    assert change > 1e-3 * np.abs(cold.contact.force).max()
    assert warm.counts["f_products"] < cold.counts["f_products"]


def test_another_load_has_the_same_answer_from_a_warm_and_a_cold_start() -> None:
    scene = block_on_plane(Coulomb(0.6))
    problem = posed(scene, "face Newton")
    problem.solve()
    heavier = replace(scene, loads=[Traction("block", "z1", (1.05, 0.3, -2.1))])
    warm, cold = problem.solve(heavier), problem.solve(heavier, start=None)
    assert_same(warm, cold)
    assert warm.contact.force.sum(axis=0) == pytest.approx([-2.1, -0.6, 4.2], rel=1e-6)
