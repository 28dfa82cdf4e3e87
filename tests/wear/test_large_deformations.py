"""Wear where bodies deform much: balances, small strains, checkpoints, ranks, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    Scene,
    State,
    Support,
    Surface,
    Wear,
    solve_steps,
)
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import J2Plasticity, NeoHooke, PlaneStrain
from tests.wear.pressed import pressed

COEFFICIENT = 2e-4


def after(scene: Scene, steps: Sequence[LoadStep]) -> tuple[State, ...]:
    """Return the states after all steps."""
    return solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9), steps)


@pytest.mark.parametrize("friction", [None, 0.3])
@pytest.mark.parametrize("wear", [Wear(COEFFICIENT), Wear(COEFFICIENT, sliding=0.5)])
def test_what_is_lost_is_pressure_times_slip(wear: Wear, friction: float | None) -> None:
    lost = 0.0
    for state in after(*pressed(NeoHooke(2000.0, 0.3), wear, friction, 0.05, 0.3)):
        contact, (pair,) = state.contact, state.scene.contacts
        way = np.linalg.norm(contact.slip, axis=1) if wear.by_slip else np.full(contact.points.count, 0.5)
        expected = COEFFICIENT * pair.wear.cycles * float(contact.normal_force @ way)
        assert contact.nominal_area @ contact.worn == pytest.approx(expected, rel=1e-12)
        lost += expected
        assert contact.worn_volume() == pytest.approx(lost, rel=1e-12)
        assert np.abs(contact.gap[contact.normal_force > 0.0]).max() < 1e-9


def test_small_strains_wear_as_linear_materials_do() -> None:
    ends = [
        after(*pressed(material, Wear(COEFFICIENT), 0.3, 5e-4, 3e-3))[-1].contact
        for material in (PlaneStrain(2000.0, 0.3), NeoHooke(2000.0, 0.3))
    ]
    linear, large = ends
    np.testing.assert_allclose(large.worn_depth, linear.worn_depth, atol=2e-2 * linear.worn_depth.max())


def test_states_that_wear_come_back_from_their_arrays() -> None:
    scene, steps = pressed(NeoHooke(2000.0, 0.3), Wear(COEFFICIENT), 0.3, 0.05, 0.3)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)
    state = solve_steps(problem, steps[:3])[-1]
    again = problem.restore(stored_state(state), state.scene)
    np.testing.assert_allclose(again.contact.worn_depth, state.contact.worn_depth, rtol=1e-8)
    np.testing.assert_allclose(again.contact.gap, state.contact.gap, atol=1e-9)


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import ContactProblem, Wear, solve_steps
from fenics_contact.materials import NeoHooke
from tests.wear.pressed import pressed
scene, steps = pressed(NeoHooke(2000.0, 0.3), Wear(2e-4), 0.3, 0.05, 0.3)
problem = ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-9, partitions=scene.partition(4))
state = solve_steps(problem, steps[:3])[-1]
if MPI.COMM_WORLD.rank == 0:
    print(*state.contact.worn_depth)
"""


def test_wear_is_the_same_on_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(ON_RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    np.testing.assert_allclose(two, one, atol=1e-6 * one.max())


def test_what_would_forget_its_wear_is_refused() -> None:
    scene, steps = pressed(NeoHooke(2000.0, 0.3), Wear(COEFFICIENT), 0.3, 0.05, 0.3)
    for options in ({"finer_history": True}, {"snaps": True}):
        problem = ContactProblem(scene, MPI.COMM_SELF, steps=AutomaticSteps(**options))
        with pytest.raises(InvalidInputError, match="wear is that of whole load steps"):
            solve_steps(problem, steps)
    body = replace(scene.bodies["punch"], material=J2Plasticity(2000.0, 0.3, 5.0))
    with pytest.raises(InvalidInputError, match="wear needs linear materials or large deformations"):
        replace(scene, bodies={"punch": body})


def test_nodes_that_leave_the_master_keep_what_they_have_lost() -> None:
    soft = NeoHooke(1000.0, 0.3)
    bodies = {
        "upper": Body(rectangle((0.0, 0.0), (2.0, 1.0), (4, 2)), soft),
        "lower": Body(rectangle((0.0, -1.0), (3.0, 0.0), (5, 2)), soft),
    }

    def moved(x: float) -> list[Support]:
        return [Support("lower", "y0"), Support("upper", "y1", (x, -0.02))]

    sides = Surface("upper", "y0"), Surface("lower", "y1")
    pair = ContactPair(*sides, Coulomb(0.1), "node", wear=Wear(1e-4))
    scene = Scene(bodies, moved(0.0), contacts=[pair])
    on, off, back = after(scene, [LoadStep(f"to {x}", supports=moved(x)) for x in (0.6, 2.0, 1.9)])
    assert off.contact.points.count < on.contact.points.count
    lost = dict(zip(on.contact.points.slave, on.contact.worn_depth, strict=True))
    gone = np.setdiff1d(on.contact.points.slave, off.contact.points.slave)
    problem = ContactProblem.following(off, tolerance=1e-9)
    again = problem.restore(stored_state(off), off.scene)
    for state in (back, problem.solve(back.scene, before=again)):
        home = problem.solve(replace(scene, supports=moved(0.6)), before=state)
        contact = home.contact
        for node in gone:
            depth = contact.worn_depth[contact.points.slave == node]
            assert depth.min() >= lost[node] * (1.0 - 1e-6)
