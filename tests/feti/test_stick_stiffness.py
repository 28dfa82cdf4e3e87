"""Points that stick on springs: elastic slip, its hysteresis over load steps, energies and derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LinearClosure,
    LinearState,
    LoadStep,
    NewtonSteps,
    RigidSurface,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Tresca,
    solve_scene,
    solve_steps,
)
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke
from tests.equilibrium.law_cases import FLOOR, dragged_block, pressed_and_sheared, solved, tilted_block

STIFFNESS, PRESSURE, AREA = 50.0, 10.0, 2.0
#: Positions of a rigid block; it slips beyond 0.06 from where its springs are at rest.
WAY = (0.02, 0.05, 0.2, 0.15, 0.05, -0.1, -0.06, 0.0)


def springs(way: tuple[float, ...], most: float) -> list[float]:
    """Traction of an elastic, perfectly plastic spring."""
    force, last, path = 0.0, 0.0, []
    for now in way:
        force = float(np.clip(force + STIFFNESS * (now - last), -most, most))
        last = now
        path.append(force)
    return path


def path(law: Coulomb | Tresca, material: Material = IsotropicElasticity(1e9, 0.0)) -> tuple[State, ...]:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 1, 1))
    # Pressed by a law of closure, the same everywhere.
    pair = ContactPair(Surface("block", "z0"), FLOOR, law, closure=LinearClosure(1e6))
    down = -PRESSURE / 1e6
    flat = Support("block", "z0", (None, None, down))
    scene = Scene({"block": Body(mesh, material)}, contacts=[pair])
    tops = [Support("block", "z1", (0.6 * x, 0.8 * x, down)) for x in WAY]
    steps = [LoadStep(f"{support.value}", supports=[flat, support]) for support in tops]
    return solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9), steps)


@pytest.mark.parametrize("law", [Coulomb(0.3, stick_stiffness=STIFFNESS), Tresca(3.0, STIFFNESS)])
def test_a_rigid_block_follows_the_loop_of_a_spring_that_slips(law: Coulomb | Tresca) -> None:
    states, slipped = path(law), 0.0
    for x, expected, state in zip(WAY, springs(WAY, 3.0), states, strict=True):
        contact = state.contact
        force = -contact.force.sum(axis=0) / AREA
        np.testing.assert_allclose(force[:2], (0.6 * expected, 0.8 * expected), atol=2e-5)
        sticks = abs(expected) < 3.0 - 1e-9
        assert contact.count(Status.STICK if sticks else Status.SLIP) == contact.points.count
        # Slip is what springs do not give back.
        total = np.einsum("na,nad->nd", contact.total_slip, contact.points.tangents) @ (0.6, 0.8, 0.0)
        np.testing.assert_allclose(total, x - expected / STIFFNESS, atol=1e-6)
        assert state.energies.friction == pytest.approx(AREA * 3.0 * abs(total[0] - slipped), abs=1e-5)
        pressed = 0.5 * AREA * PRESSURE**2 / 1e6
        springs_hold = 0.5 * AREA * expected**2 / STIFFNESS
        assert state.energies.surface == pytest.approx(pressed + springs_hold, rel=1e-4)
        slipped = total[0]


def test_energies_balance_with_elastic_slip() -> None:
    state = solved(
        dragged_block(Tresca(lambda x: 0.3 + 0.3 * x[:, 0], 300.0), 6.0, shift=0.003), tolerance=1e-11
    )
    assert 0 < state.contact.count(Status.SLIP) < state.contact.points.count
    energies = state.energies
    assert energies.primal == pytest.approx(energies.dual, abs=1e-7 * energies.strain)
    assert isinstance(state, LinearState)
    assert state.estimate_errors(geometry=False).algebraic < 1e-6


def test_stiff_springs_tend_to_points_that_stick_at_no_more_products() -> None:
    exact = solved(tilted_block(None, Coulomb(0.3)), tolerance=1e-9)
    last = np.inf
    for stiffness in (1e4, 1e6, 1e10):
        soft = solved(tilted_block(None, Coulomb(0.3, stick_stiffness=stiffness)), tolerance=1e-9)
        change = float(np.abs(soft.contact.friction_force - exact.contact.friction_force).max())
        assert change < 0.1 * last
        assert soft.solution.products <= exact.solution.products + 3
        last = change
    assert last < 1e-6


@pytest.mark.parametrize("law", [Coulomb(0.3, stick_stiffness=STIFFNESS), Tresca(3.0, STIFFNESS)])
def test_a_block_that_moves_far_follows_the_same_loop(law: Coulomb | Tresca) -> None:
    states = path(law, NeoHooke(1e6, 0.0))
    for x, expected, state in zip(WAY, springs(WAY, 3.0), states, strict=True):
        contact = state.contact
        force = -contact.force.sum(axis=0) / AREA
        np.testing.assert_allclose(force[:2], (0.6 * expected, 0.8 * expected), atol=2e-3)
        total = np.einsum("na,nad->nd", contact.total_slip, contact.points.tangents) @ (0.6, 0.8, 0.0)
        np.testing.assert_allclose(total, x - expected / STIFFNESS, atol=2e-5)
        springs_hold = 0.5 * AREA * expected**2 / STIFFNESS
        assert state.energies.surface == pytest.approx(1e-4 + springs_hold, rel=1e-3)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_under_small_loads_large_deformations_are_the_linear_ones(discretisation: str) -> None:
    size = 1e-4
    plain, far = (
        solve_scene(pressed_and_sheared(material, discretisation, size, cells=1), MPI.COMM_SELF).contact
        for material in (IsotropicElasticity(100.0, 0.3), NeoHooke(100.0, 0.3))
    )
    assert plain.count(Status.STICK) == plain.points.count
    assert np.abs(plain.force[:, 0].sum()) > 0.01 * size
    np.testing.assert_allclose(far.force, plain.force, atol=10.0 * size * np.abs(plain.force).max())


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_springs_turn_with_the_bodies(discretisation: str) -> None:
    scene, states = pressed_and_sheared(NeoHooke(100.0, 0.3), discretisation, 0.05), []
    held = {"low": ("z0", (0.0, 0.0, 0.0)), "high": ("z1", (0.02, 0.0, -0.05))}
    axis = (0.0, 0.0, 1.0)
    for angle in (0.0, 0.7):
        cosine, sine = np.cos(angle), np.sin(angle)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        supports = [
            RigidSurface(body, side, (0.0, 0.0, 0.0), tuple(turn @ way), tuple(angle * np.array(axis)))
            for body, (side, way) in held.items()
        ]
        states.append((turn, LoadStep(f"{angle:g}", supports=supports)))
    scene = replace(scene, supports=states[0][1].supports)
    found = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), [step for _, step in states])
    first = found[0].contact.force
    assert np.abs(first[:, 0].sum()) > 0.2
    # By mortar slips of corners turn with the slave, normals with the master: second order in the angle.
    near = 1e-6 if discretisation == "node" else 3e-6
    for (turn, _), state in zip(states, found, strict=True):
        np.testing.assert_allclose(state.contact.force @ turn, first, atol=near * np.abs(first).max())
    assert NewtonSteps.of(found).reduction.max() < 1e-2, "tangents are exact"


def test_a_stored_state_of_large_deformations_goes_on_from_its_springs() -> None:
    scene = pressed_and_sheared(NeoHooke(100.0, 0.3), "node", 0.05)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10)
    problem.solve()
    back = replace(scene, supports=[Support("low", "z0"), Support("high", "z1", (0.0, 0.0, -0.05))])
    half = problem.solve(back, before=problem.state)
    stored = stored_state(half)
    ahead = problem.solve(scene, before=half).contact.force
    other = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10)
    again = other.restore(stored, back)
    np.testing.assert_allclose(again.contact.force, half.contact.force, atol=1e-8)
    np.testing.assert_allclose(other.solve(scene, before=again).contact.force, ahead, atol=1e-8)


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import Coulomb, LoadStep, ContactProblem, Support, solve_steps
from fenics_contact.materials import NeoHooke
from tests.equilibrium.law_cases import dragged_block, pressed_and_sheared

scene = dragged_block(Coulomb(0.3, stick_stiffness=300.0), 6.0)
problem = ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-9)
steps = [LoadStep(f"{x}", supports=[Support("block", "z1", (x, 0.0, -0.006))]) for x in (0.006, 0.001)]
last = solve_steps(problem, steps)[-1]
far = pressed_and_sheared(NeoHooke(100.0, 0.3), "mortar", 0.05)
tops = [Support("high", "z1", (x, 0.0, -0.05)) for x in (0.2, 0.1)]
steps = [LoadStep("far", supports=[far.supports[0], top]) for top in tops]
end = solve_steps(ContactProblem(far, MPI.COMM_WORLD, tolerance=1e-9), steps)[-1]
if MPI.COMM_WORLD.rank == 0:
    print(*last.contact.friction_force.ravel(), *end.contact.friction_force.ravel())
"""


def test_steps_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    one, two = (np.array(mpirun(ON_RANKS, ranks).split(), dtype=float) for ranks in (1, 2))
    assert np.abs(one).max() > 0.04
    np.testing.assert_allclose(two, one, atol=1e-7)


def test_bad_stiffness_is_refused() -> None:
    for law in (lambda k: Coulomb(0.3, stick_stiffness=k), lambda k: Tresca(1.0, k)):
        with pytest.raises(InvalidInputError, match=r"stick_stiffness must be positive and finite, got -1"):
            law(-1.0)


def test_effects_name_the_springs() -> None:
    names = [effect.name.value for effect in dragged_block(Coulomb(0.3, stick_stiffness=1.0), 1.0).effects()]
    assert "elastic slip" in names
