"""Fluid that enters a contact from its edge: superposition with a uniform pressure, equilibrium, fronts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import cKDTree

from fenics_contact import (
    ContactProblem,
    Coulomb,
    FluidPressure,
    LinearState,
    LoadStep,
    RigidSphere,
    RigidTool,
    ShapeProblem,
    SlipTable,
    Status,
    Support,
    SurfaceDesign,
    ToolMotion,
    solve_scene,
    solve_steps,
)
from fenics_contact._equilibrium import penetration
from fenics_contact._equilibrium.passes import Passes
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.design import LoadPath, StrainEnergy, TotalPotential
from fenics_contact.errors import ConvergenceError, InvalidInputError
from tests.design import moved_blocks
from tests.design.blocks import problem
from tests.design.quotients import check_adjoint
from tests.equilibrium.fluid_case import FLUID, both_ends, seal
from tests.equilibrium.law_cases import FLOOR, solved

SPHERE = RigidSphere((2.0, 0.5, -3.0), 3.0)


def test_a_seal_in_fluid_is_the_dry_one_in_uniform_pressure() -> None:
    # The sides do not contract, so a uniform pressure above and below moves nothing at the lower side, where
    # it
    # adds to the pressures: the fluid is at all points that open, and enters where contact presses less than
    # it.
    dry = solved(seal(None)).contact
    state = solved(seal(FluidPressure(FLUID, both_ends, critical=FLUID), extra=FLUID))
    wet = state.contact
    assert wet.wet is not None
    assert 0 < np.count_nonzero(dry.status == Status.OPEN) < dry.points.count
    total = wet.normal_force + FLUID * wet.area * wet.wet
    # The crowned side is not quite flat: forces act along the normals of the floor, areas are those of the
    # slave.
    np.testing.assert_allclose(total, dry.normal_force + FLUID * wet.area, rtol=2e-3)
    np.testing.assert_allclose(wet.gap, dry.gap, atol=4e-3 * dry.gap.max())
    assert wet.wet[dry.status == Status.OPEN].all()
    notes = [step.note for step in state.solution.history if "fluid pass" in step.note]
    assert len(notes) >= 3
    assert notes[0].endswith("fluid pass 1: 0 points wet")


def test_fluid_from_one_side_stops_at_the_contact_and_carries_its_part_of_the_load() -> None:
    state = solved(seal(FluidPressure(FLUID, "x0"), extra=0.5, poisson=0.3))
    contact = state.contact
    place = state.scene.points[contact.points.slave, 0]
    assert contact.wet is not None
    closed = contact.normal_force > 0.0
    assert not (contact.wet & closed).any()
    assert contact.wet[place < place[closed].min()].all()
    assert not contact.wet[place > place[closed].min()].any()
    assert (~closed & (place > place[closed].max())).any(), "the other side stays dry"
    load = -state.torn.load_work(np.tile((0.0, 0.0, 1.0), len(state.torn_displacement) // 3))
    assert contact.normal_force.sum() == pytest.approx(load, rel=1e-6)
    without = solved(seal(None, extra=0.5, poisson=0.3)).contact
    pressed = without.normal_force.sum() - contact.normal_force.sum()
    assert pressed == pytest.approx(FLUID * contact.area[contact.wet].sum(), rel=1e-6)


def test_a_higher_pressure_moves_the_front_and_no_pressure_changes_nothing() -> None:
    counts = []
    for pressure in (0.0, 1.0, 2.5):
        contact = solved(seal(FluidPressure(pressure, "x0"), extra=1.0)).contact
        counts.append(np.count_nonzero(contact.wet))
        if pressure == 0.0:
            dry = solved(seal(None, extra=1.0)).contact
            np.testing.assert_allclose(contact.normal_force, dry.normal_force, atol=1e-7)
    assert counts[0] <= counts[1] < counts[2]


def test_load_steps_go_on_from_the_front_that_there_was() -> None:
    fluid = FluidPressure(2.0, "x0", critical=2.0)
    problem = ContactProblem(seal(fluid), MPI.COMM_SELF, tolerance=1e-9)
    first = problem.solve()
    again = problem.solve(before=first)
    assert isinstance(again, LinearState)
    np.testing.assert_array_equal(again.contact.wet, first.contact.wet)
    assert sum("fluid pass" in step.note for step in again.solution.history) == 1
    assert again.solution.products < 0.5 * first.solution.products


def test_load_steps_change_the_pressure_and_the_front_follows_forth_and_back() -> None:
    fluid, pressures = FluidPressure(0.0, "x0", critical="pressure"), (1.5, 2.5, 1.0)
    problem = ContactProblem(seal(fluid, extra=1.0), MPI.COMM_SELF, tolerance=1e-9)
    steps = [LoadStep(f"{p}", fluids={"fluid": p}) for p in pressures]
    states = solve_steps(problem, steps)
    counts = [np.count_nonzero(state.contact.wet) for state in states]
    assert counts[2] < counts[0] < counts[1]
    for pressure, state in zip(pressures, states, strict=True):
        alone = solved(seal(FluidPressure(pressure, "x0", critical=pressure), extra=1.0)).contact
        np.testing.assert_array_equal(state.contact.wet, alone.wet)
        np.testing.assert_allclose(state.contact.normal_force, alone.normal_force, atol=1e-8)
    assert states[0].torn.B is states[2].torn.B, "contact is not searched again"


def test_fluid_and_friction_by_slip_agree_with_the_friction_of_each_place() -> None:
    table = SlipTable((0.0, 0.004), (0.4, 0.2))
    state = solved(seal(FluidPressure(1.5, "x0"), 1.0, 0.3, friction=Coulomb(table)))
    contact = state.contact
    coefficient = table.at(np.linalg.norm(contact.total_slip, axis=1))
    np.testing.assert_allclose(contact.slip_bound, coefficient * contact.normal_force, atol=1e-8)
    assert np.ptp(coefficient) > 0.02
    nodes = cKDTree(state.scene.points[contact.points.slave])
    by_place = Coulomb(lambda x: coefficient[nodes.query(x)[1]])
    given = solved(seal(FluidPressure(1.5, "x0"), 1.0, 0.3, friction=by_place)).contact
    np.testing.assert_array_equal(contact.wet, given.wet)
    np.testing.assert_allclose(contact.force, given.force, atol=1e-6)
    assert np.count_nonzero(contact.wet) > 9
    notes = [step.note for step in state.solution.history if "slip pass" in step.note]
    assert sum("fluid pass 1: 14 points wet" in note for note in notes) == len(notes) - 1
    assert [step.iteration for step in state.solution.history] == [*range(state.solution.iterations)]


def test_fluid_presses_a_tool_that_a_force_drives() -> None:
    # The tool lies below the seal, whose upper side is held: both fluid and contact balance the force.
    scene, force = seal(FluidPressure(2.0, "x0"), extra=0.0), 12.0
    tool = RigidTool("floor", FLOOR, at=(1.5, 0.5, 0.0))
    driven = ToolMotion("floor", (0.0, 0.0, None), (0.0, 0.0, 0.0), force=(0.0, 0.0, force))
    held = [Support("seal", "z1"), driven]
    pair = replace(scene.contacts[0], master=tool)
    state = solve_scene(
        replace(scene, supports=held, loads=[], contacts=[pair]), MPI.COMM_SELF, tolerance=1e-9
    )
    contact = state.contact
    assert contact.wet is not None
    wet = 2.0 * contact.area[contact.wet].sum()
    assert wet > 0.5
    assert contact.normal_force.sum() + wet == pytest.approx(force, rel=1e-6)


def test_a_stored_state_keeps_its_fluid() -> None:
    scene = seal(FluidPressure(2.0, "x0"), extra=0.5)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)
    state = problem.solve()
    found = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9).restore(stored_state(state))
    np.testing.assert_array_equal(found.contact.wet, state.contact.wet)
    np.testing.assert_allclose(found.contact.normal_force, state.contact.normal_force, atol=1e-9)
    assert found.solution.residuals.within(1e-8)  # type: ignore[union-attr]


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import ContactProblem, Coulomb, FluidPressure, LoadStep, SlipTable, solve_steps
from tests.equilibrium.fluid_case import seal

friction = Coulomb(SlipTable((0.0, 0.004), (0.4, 0.2)))
scene = seal(FluidPressure(1.0, "x0"), extra=0.5, friction=friction)
problem = ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-8)
state = solve_steps(problem, [LoadStep("low"), LoadStep("high", fluids={"fluid": 2.0})])[-1]
if MPI.COMM_WORLD.rank == 0:
    print(*state.contact.wet.astype(int), *state.contact.normal_force)
"""


def test_the_front_is_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(ON_RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    np.testing.assert_allclose(two, one, atol=1e-6 * one.max())


def test_a_front_that_moves_forth_and_back_is_an_error_with_its_history() -> None:
    scene = seal(FluidPressure(1.0, "x0"))
    state = solved(scene)
    closed = replace(state.contact, normal_force=np.ones(state.contact.points.count))
    opened = replace(state.contact, normal_force=np.zeros(state.contact.points.count))

    def solve(torn: Any, last: Any, tolerance: Any) -> Any:
        contact = closed if torn.fluid.wet.any() else opened
        return replace(state, contact=contact)

    with pytest.raises(
        ConvergenceError, match=r"after 2 passes it returns to 0 wet points .* smaller load steps"
    ) as error:
        penetration.FluidFront(scene).solve(Passes(solve, None), state.torn, None, 1e-6)
    assert len(error.value.history) >= 2


@pytest.mark.parametrize("name", ["floor, fluid", "blocks, fluid"])
def test_derivatives_by_the_shape_include_the_fluid(name: str) -> None:
    way = moved_blocks.line(name)
    assert way.is_smooth(), "the front stays where it is"
    contact = way.state().contact
    assert contact.wet is not None
    assert 0 < np.count_nonzero(contact.wet) < contact.points.count
    check_adjoint(way, StrainEnergy())


def test_derivatives_over_load_steps_follow_the_pressure() -> None:
    blocks = problem(moved_blocks.SCENES["floor, fluid"]())
    blocks.objective = StrainEnergy()
    path = LoadPath(blocks, [LoadStep(f"{p}", fluids={"fluid": p}) for p in (0.2, 0.35)])
    alpha, way = 0.01 * np.random.default_rng(1).standard_normal((2, path.size))
    quotient = (path(alpha + 1e-3 * way)[0] - path(alpha - 1e-3 * way)[0]) / 2e-3
    assert path(alpha)[1] @ way == pytest.approx(quotient, rel=1e-5)
    assert abs(quotient) > 1e-4


def test_bad_fluids_are_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"FluidPressure.pressure must be zero or positive and finite, got -1"
    ):
        FluidPressure(-1.0, "x0")
    with pytest.raises(InvalidInputError, match=r"FluidPressure.pressure must be zero or positive"):
        LoadStep("leak", fluids={"fluid": -1.0}).applied_to(seal(FluidPressure(1.0, "x0")))
    with pytest.raises(
        InvalidInputError, match=r"names 'oil', the contact pairs of the scene have \['fluid'\]: use"
    ):
        LoadStep("leak", fluids={"oil": 1.0}).applied_to(seal(FluidPressure(1.0, "x0")))
    with pytest.raises(InvalidInputError, match=r"names 'fluid', the contact pairs of the scene have none"):
        LoadStep("leak", fluids={"fluid": 1.0}).applied_to(seal(None))
    two = seal(FluidPressure(1.0, "x0"))
    other = replace(two.contacts[0], master=SPHERE, fluid=FluidPressure(2.0, "x0"))
    with pytest.raises(InvalidInputError, match=r"'fluid' must have one pressure .*, got 1 and 2: give"):
        replace(two, contacts=[*two.contacts, other])
    with pytest.raises(InvalidInputError, match=r"FluidPressure.enters.*'side'"):
        seal(FluidPressure(1.0, "side"))
    with pytest.raises(InvalidInputError, match="got none of its nodes: give a surface of the slave's body"):
        solved(seal(FluidPressure(1.0, "z1")))
    with pytest.raises(InvalidInputError, match="must return True or False for each point"):
        solved(seal(FluidPressure(1.0, lambda x: x[:, 0])))
    scene = seal(FluidPressure(1.0, "x0"))
    problem = ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF), SurfaceDesign("seal", "z0", (3, 2)), TotalPotential()
    )
    with pytest.raises(
        InvalidInputError, match=r"TotalPotential needs contacts without fluid, .* take StrainEnergy"
    ):
        problem.evaluate(np.zeros(problem.size))
    tool = RigidTool("floor", FLOOR, at=(1.5, 0.5, 0.0))
    driven = ToolMotion("floor", (0.0, 0.0, None), (0.0, 0.0, 0.0), force=(0.0, 0.0, 12.0))
    held = [Support("seal", "z1"), driven]
    pair = replace(scene.contacts[0], master=tool)
    pushed = ContactProblem(replace(scene, supports=held, loads=[], contacts=[pair]), MPI.COMM_SELF)
    moved = ShapeProblem(pushed, SurfaceDesign("seal", "z0", (3, 2)), StrainEnergy())
    with pytest.raises(InvalidInputError, match="need known motions where fluid enters a contact"):
        moved.evaluate(np.zeros(moved.size))


def test_the_effects_name_the_fluid() -> None:
    names = [effect.name.value for effect in seal(FluidPressure(1.0, "x0"), friction=Coulomb(0.2)).effects()]
    assert "fluid that enters where contact opens" in names
