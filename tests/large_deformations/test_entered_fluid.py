"""Fluid that enters contacts of bodies that deform much: pressures, fronts, both sides, ranks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    FluidPressure,
    LoadSequence,
    LoadStep,
    Pressure,
    RigidTool,
    Scene,
    ShapeProblem,
    State,
    Support,
    Surface,
    SurfaceDesign,
    TangentNewton,
    ToolMotion,
    solve_scene,
    solve_steps,
)
from fenics_contact.design import Movement, Objective, PressureNorm
from fenics_contact.errors import InvalidInputError, LoadStepError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import J2Plasticity, NeoHooke, PlaneStrain
from tests.large_deformations.wetted import FLOOR, RUBBER, groove, lip


def after(scene: Scene, pressures: Sequence[float], **more: Any) -> tuple[State, ...]:
    """Return the states at pressures of the fluid, one after the other."""
    steps = [LoadStep(f"{p}", fluids={"fluid": p}) for p in pressures]
    return solve_steps(ContactProblem(scene, MPI.COMM_SELF, **more), steps)


@pytest.mark.parametrize("axisymmetric", [False, True])
def test_a_lifted_beam_carries_the_pressure_that_follows_its_side(axisymmetric: bool) -> None:
    beam = rectangle((1.0, 0.0), (11.0, 1.0), (13, 3))
    body = {"beam": Body(beam, NeoHooke(10.0, 0.4), axisymmetric=axisymmetric)}
    held = [Support("beam", "x0"), Support("beam", "x1")]
    fluid = FluidPressure(0.4, lambda x: x[:, 0] < 2.0)
    pair = ContactPair(Surface("beam", "y0"), FLOOR, fluid=fluid)
    wet = solve_scene(Scene(body, held, contacts=[pair]), MPI.COMM_SELF)
    dry = solve_scene(Scene(body, held, [Pressure("beam", "y0", 0.4)]), MPI.COMM_SELF)
    assert wet.contact.wet is not None
    assert wet.contact.wet.all()
    found, expected = wet.gather_displacement("beam"), dry.gather_displacement("beam")
    assert np.abs(expected).max() > (0.3 if axisymmetric else 2.0)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    assert np.isnan(wet.energies.load), "the work of fluid depends on the way"


def test_small_strains_are_wet_as_linear_materials_are() -> None:
    scene = lip(top=-0.0012, fluid=FluidPressure(0.003, "x0", critical="pressure"))
    flat = scene.bodies["lip"].mesh.points * (1.0, 1.0)
    flat[:, 1] -= 0.97 * 0.03 * (flat[:, 0] - 1.9) ** 2 * (1.0 - flat[:, 1])
    mesh = scene.bodies["lip"].mesh.moved(flat)
    large, linear = (
        solve_scene(replace(scene, bodies={"lip": Body(mesh, material)}), MPI.COMM_SELF, tolerance=1e-9)
        for material in (RUBBER, PlaneStrain(5.0, 0.4))
    )
    assert large.contact.wet is not None
    assert 0 < np.count_nonzero(large.contact.wet) < large.contact.points.count
    np.testing.assert_array_equal(large.contact.wet, linear.contact.wet)
    size, wet = linear.contact.normal_force.max(), large.contact.wet
    # Between the last wet node and the first dry one the pressure is linear there, and has a step here.
    inside = np.ones(len(wet), dtype=bool)
    inside[np.flatnonzero(wet[:-1] != wet[1:])[:, None] + [0, 1]] = False
    found, expected = (each.contact.normal_force for each in (large, linear))
    np.testing.assert_allclose(found[inside], expected[inside], atol=5e-3 * size)
    assert found.sum() == pytest.approx(expected.sum(), rel=5e-3)


def test_a_front_moves_forth_and_back_with_the_pressure_and_forces_balance() -> None:
    pressures = (0.6, 1.0, 0.1)
    states = after(lip(), pressures)
    counts = [int(np.count_nonzero(state.contact.wet)) for state in states]
    assert counts[2] < counts[0] < counts[1]
    for state, pressure in zip(states, pressures, strict=True):
        assert state.balance().imbalance < 1e-7
        contact = state.contact
        assert contact.wet is not None
        assert (contact.pressure[contact.wet] <= pressure * (1.0 + 1e-6)).all()
        beside = contact.wet[:-1] != contact.wet[1:]
        assert np.count_nonzero(beside) == 1, "the front is one place, as fluid enters from one side"
    (alone,) = after(lip(), pressures[:1])
    np.testing.assert_array_equal(alone.contact.wet, states[0].contact.wet)


def test_two_lips_are_each_as_on_a_floor() -> None:
    # By symmetry the middle is a plane: what fluid exerts on the master is what it exerts on the slave.
    scene = lip()
    upper = scene.bodies["lip"].mesh
    lower = rectangle((0.0, -1.0), (4.0, 0.0), (17, 5))
    points = lower.points.copy()
    points[:, 1] -= 0.03 * (points[:, 0] - 1.9) ** 2 * (1.0 + points[:, 1])
    bodies = {"lip": Body(upper, RUBBER), "mate": Body(lower.moved(points), RUBBER)}
    held = [Support("lip", "y1", (0.0, -0.12)), Support("mate", "y0", (0.0, 0.12))]
    pair = ContactPair(
        Surface("lip", "y0"), Surface("mate", "y1"), fluid=FluidPressure(0.8, "x0", critical="pressure")
    )
    both = solve_scene(Scene(bodies, held, contacts=[pair]), MPI.COMM_SELF)
    (single,) = after(lip(), (0.8,))
    np.testing.assert_array_equal(both.contact.wet, single.contact.wet)
    assert 3 < np.count_nonzero(single.contact.wet) < 15
    size = single.contact.normal_force.max()
    np.testing.assert_allclose(both.contact.normal_force, single.contact.normal_force, atol=2e-2 * size)
    assert both.balance().imbalance < 1e-7
    found, expected = (state.gather_displacement("lip") for state in (both, single))
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert np.abs(expected).max() > 0.1


@pytest.mark.parametrize("goal", [PressureNorm(p=6.0), Movement("lip", "x1", (1.0, 0.0))])
def test_derivatives_by_the_shape_include_the_fluid(goal: Objective) -> None:
    steps = AutomaticSteps(newton=TangentNewton(tolerance=1e-11))
    problem = ContactProblem(
        lip(fluid=FluidPressure(0.8, "x0", critical="pressure")), MPI.COMM_SELF, steps=steps
    )
    shape = ShapeProblem(problem, SurfaceDesign("lip", "y0", (5,)), goal)
    way, width = np.random.default_rng(1).standard_normal(shape.size), 1e-4
    found = shape.evaluate(np.zeros(shape.size)).gradient @ way
    ends = [shape.evaluate(sign * width * way) for sign in (1.0, -1.0)]
    assert [np.count_nonzero(end.state.contact.wet) for end in ends] == [5, 5]
    assert found == pytest.approx((ends[0].value - ends[1].value) / (2.0 * width), rel=1e-6)


def test_fluid_presses_a_tool_that_a_force_drives() -> None:
    scene = lip(top=0.0)
    tool = RigidTool("floor", FLOOR, at=(2.0, 0.0))
    driven = ToolMotion("floor", (0.0, None), 0.0, force=(0.0, 1.6))
    pair = replace(scene.contacts[0], master=tool, fluid=FluidPressure(0.5, "x0", critical="pressure"))
    state = solve_scene(replace(scene, supports=[*scene.supports, driven], contacts=[pair]), MPI.COMM_SELF)
    contact = state.contact
    assert contact.wet is not None
    assert contact.wet.any()
    fluid = 1.6 - contact.normal_force.sum()
    # Areas of wet nodes, whose normals turn little.
    assert fluid == pytest.approx(0.5 * contact.area[contact.wet].sum(), rel=2e-2)
    assert fluid > 0.2


def pressures_in_groove(wall: float) -> tuple[State, ...]:
    steps = [LoadStep("close"), *(LoadStep(f"{p}", fluids={"fluid": p}) for p in (0.4, 0.8))]
    return solve_steps(ContactProblem(groove(wall), MPI.COMM_SELF), steps)


def test_fluid_in_a_groove_stops_where_any_pair_is_closed_and_drives_the_ring() -> None:
    for state, pressure in zip(pressures_in_groove(1.08), (0.0, 0.4, 0.8), strict=True):
        contact = state.contact
        floor, lid, wall = (contact.on_pair(k) for k in range(3))
        assert not contact.wet[wall].any(), "no fluid behind floor and lid"
        pressed = [float(contact.normal_force[part].sum()) for part in (floor, lid, wall)]
        assert pressed[0] == pytest.approx(pressed[1], rel=1e-6)
        # Fluid presses from the left on the height that is left of the groove.
        held = -sum(each.force[0] for each in state.resultants().contacts)
        assert held == pytest.approx(1.6 * pressure, rel=1e-2, abs=1e-6)
        assert state.balance().imbalance < 1e-7


def test_a_ring_that_nothing_holds_is_not_in_balance_far_away() -> None:
    with pytest.raises(LoadStepError, match="can be followed up to"):
        pressures_in_groove(3.0)


def test_histories_with_fluid_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    steps = [LoadStep(f"{p}", fluids={"fluid": p}) for p in (0.4, 0.8)]
    file = tmp_path / "seal.npz"
    whole = LoadSequence(ContactProblem(lip(), MPI.COMM_SELF), checkpoint=Checkpoint(file))
    expected = [whole.advance(step) for step in steps]
    resumed = LoadSequence(ContactProblem(lip(), MPI.COMM_SELF), checkpoint=Checkpoint(file))
    again = [resumed.advance(step) for step in steps]
    for one, other in zip(again, expected, strict=True):
        assert one.solution.reason == "read from a checkpoint"
        np.testing.assert_array_equal(one.contact.wet, other.contact.wet)
        np.testing.assert_allclose(one.contact.force, other.contact.force, atol=1e-12)
        assert one.balance().imbalance < 1e-7


RANKS = """
from mpi4py import MPI
import numpy as np
from fenics_contact import ContactProblem, LoadStep, solve_steps
from tests.large_deformations.wetted import lip
step = LoadStep("leak", fluids={"fluid": 0.8})
(state,) = solve_steps(ContactProblem(lip(), MPI.COMM_WORLD), [step])
if MPI.COMM_WORLD.rank == 0:
    print(*state.contact.normal_force, *state.contact.wet.astype(float))
"""


def test_all_ranks_have_the_answer_of_one(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    np.testing.assert_allclose(two, one, atol=1e-8)
    assert np.count_nonzero(one) > 9


def test_what_fluid_cannot_enter_is_refused() -> None:
    scene = lip()
    small = Body(scene.bodies["lip"].mesh, J2Plasticity(5.0, 0.3, 0.1, 0.1))
    with pytest.raises(
        InvalidInputError, match=r"a slave of a material for large deformations, got body 'lip'"
    ):
        replace(scene, bodies={"lip": small})
    metal = Body(rectangle((0.0, -1.0), (4.0, 0.0), (17, 5)), PlaneStrain(5.0, 0.3))
    mated = replace(scene.contacts[0], master=Surface("mate", "y1"), fluid=FluidPressure(0.4, "x0"))
    held = [*scene.supports, Support("mate", "y0")]
    both = Scene({**scene.bodies, "mate": metal}, held, contacts=[mated])
    shape = ShapeProblem(
        ContactProblem(both, MPI.COMM_SELF), SurfaceDesign("lip", "y0", (3,)), PressureNorm(p=6.0)
    )
    with pytest.raises(InvalidInputError, match="derivatives with fluid need masters of materials for large"):
        shape.evaluate(np.zeros(shape.size))
    problem = ContactProblem(scene, MPI.COMM_SELF, steps=AutomaticSteps(snaps=True))
    with pytest.raises(InvalidInputError, match=r"from equilibrium to equilibrium, got .* snaps: leave"):
        problem.solve()
