"""Loads of exactly zero after others: what friction cannot hold without a load comes to rest at no cost."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    LoadSequence,
    LoadStep,
    Scene,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact._equilibrium import followed_loads
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton, Smalse
from fenics_contact.qp.solve import may_grip
from tests.contact.wedges import driven, follow, wedge

MATERIAL = PlaneStrain(1000.0, 0.3)
#: Inclination of the sides of the wedge in degrees; friction holds it where it is more than its tangent.
SIDE = 5.0
SOLVERS = {
    "face Newton": FaceNewton(1e-8),
    "fixed point of face Newton": FixedPoint(FaceNewton(1e-8)),
    "fixed point of SMALSE": FixedPoint(Smalse(1e-8)),
}
NAMES = [*list(SOLVERS)[:2], pytest.param(list(SOLVERS)[2], marks=pytest.mark.slow)]


@pytest.mark.parametrize("solver", NAMES)
def test_a_wedge_that_friction_cannot_hold_comes_out_without_any_force(solver: str) -> None:
    loose = wedge(SIDE, 0.5 * np.tan(np.radians(SIDE)))
    pressed, released = follow(loose, (50.0, 0.0), solver=SOLVERS[solver])

    assert pressed.contact.normal_force.min() > 0.0
    assert not released.contact.normal_force.any()
    assert not released.gather_displacement("wedge").any()
    assert released.solution.products <= 1


def test_whether_friction_can_grip_is_asked_once_and_the_solution_says_what_came_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def counted(*given: object) -> bool:
        asked.append(given)
        return may_grip(*given)

    for module in (sys.modules["fenics_contact.qp.solve"], followed_loads):
        monkeypatch.setattr(module, "may_grip", counted)
    _, released = follow(wedge(SIDE, 0.5 * np.tan(np.radians(SIDE))), (50.0, 0.0))

    assert len(asked) == 1
    assert released.solution.released
    assert "released: no load, and no friction that grips" in str(released.solution.history[-1])


def test_a_step_without_another_start_begins_at_the_step_before() -> None:
    problem = ContactProblem(replace(wedge(SIDE), loads=driven(50.0)), MPI.COMM_SELF, tolerance=1e-8)
    pressed = problem.solve()
    scene = replace(problem.scene, loads=driven(0.0))

    again, anew = (problem.solve(scene, start=None, before=each) for each in (pressed, None))

    assert again.contact.normal_force.sum() > 0.5 * pressed.contact.normal_force.sum()
    assert not anew.contact.normal_force.any()


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_block_that_was_released_has_no_force_and_can_be_pushed_again(solver: str) -> None:
    floor, block = rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), rectangle((0.5, 1.0), (2.5, 2.0), (5, 3))
    pair = ContactPair(Surface("block", "y0"), Surface("floor", "y1"), Coulomb(0.3), "node")
    bodies = {"floor": Body(floor, MATERIAL), "block": Body(block, MATERIAL)}
    scene = Scene(bodies, [Support("floor", "y0")], [], [pair])
    steps = LoadSequence(ContactProblem(scene, MPI.COMM_SELF, solver=SOLVERS[solver]))
    pushes = [[TotalForce("block", "y1", (0.2 * force, -force))] for force in (50.0, 0.0, 10.0)]

    pressed, released, again = (steps.advance(LoadStep("push", loads=push)) for push in pushes)

    assert not released.contact.normal_force.any()
    assert not released.gather_displacement("block").any()
    assert released.solution.products <= 1
    sums = [state.contact.normal_force.sum() for state in (pressed, again)]
    np.testing.assert_allclose(sums, [50.0, 10.0], rtol=1e-6)


@pytest.mark.parametrize("parts", [1, 2, 3, 5])
def test_a_body_that_a_support_lifts_off_leaves_the_one_below_at_rest(parts: int) -> None:
    """Nothing acts; jumps of bodies that touch are rounding of how far the support moves."""
    made = (
        ("lower", 0.0, 1.14, 2.72, (5, 7)),
        ("middle", 2.72, 2.2, 1.83, (3, 5)),
        ("upper", 4.55, 2.3, 2.4, (7, 3)),
    )
    bodies = {
        name: Body(rectangle((0.0, low), (width, low + height), cells), MATERIAL)
        for name, low, width, height, cells in made
    }
    supports = [
        Support("lower", "y0"), Support("middle", "x0", (None, 0.0)), Support("upper", "y1", (0.0, 0.0747)),
    ]  # fmt: skip
    contacts = [
        ContactPair(Surface("middle", "y0"), Surface("lower", "y1"), discretisation="node"),
        ContactPair(Surface("middle", "y1"), Surface("upper", "y0"), discretisation="node"),
    ]
    scene = Scene(bodies, supports, contacts=contacts)
    partitions = {name: bisection_partition(body.mesh, parts) for name, body in bodies.items()}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions)
    assert state.solution.products <= 1
    assert np.abs(state.contact.normal_force).max() == 0.0
