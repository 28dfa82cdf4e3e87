"""Surfaces that give way under pressure: closed forms, the limit of exact contact, energies and bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ClosureLaw,
    ClosureTable,
    ContactPair,
    ContactProblem,
    Coulomb,
    ExponentialClosure,
    LinearClosure,
    LoadStep,
    NewtonSteps,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from tests.equilibrium.law_cases import CLOSURES, FLOOR, MODULUS, pressed_block, solved, tilted_block


@pytest.mark.parametrize("down", [0.0005, 0.01, 0.2])
@pytest.mark.parametrize("name", CLOSURES)
def test_a_column_is_in_series_with_its_surface(name: str, down: float) -> None:
    law = CLOSURES[name]
    contact = solved(pressed_block(law, down)).contact
    pressure = float(contact.pressure.mean())
    np.testing.assert_allclose(contact.pressure, pressure, rtol=1e-7)
    # What the column is pressed by, from the distance at which pressure begins.
    closure = float(law.closure(np.array([pressure]))[0])
    assert closure + pressure / MODULUS == pytest.approx(down + law.reach, rel=1e-7)
    np.testing.assert_allclose(contact.gap, law.reach - closure, atol=1e-9)


def test_without_force_the_distance_is_at_least_the_reach() -> None:
    law = ExponentialClosure(5.0, 0.01)
    contact = solved(pressed_block(law, -0.02)).contact
    assert contact.normal_force.max() == 0.0
    np.testing.assert_allclose(contact.gap, 0.02, rtol=1e-9)


def test_surfaces_that_supports_hold_on_both_sides_are_pressed_by_their_law() -> None:
    scene = pressed_block(LinearClosure(500.0), 0.1)
    held = replace(scene, supports=[*scene.supports, Support("block", "z0", (None, None, -0.1))])
    contact = solved(held).contact
    np.testing.assert_allclose(contact.pressure, 50.0, rtol=1e-9)
    exact = replace(held, contacts=[replace(held.contacts[0], closure=None)])
    with pytest.raises(InvalidInputError, match="supports must leave room"):
        solved(exact)


def bodies(closure: ClosureLaw | None, friction: Coulomb | None = None) -> Scene:
    """Two blocks of meshes that do not match, the upper one free, pressed obliquely."""
    steel = IsotropicElasticity(1000.0, 0.3)
    lower = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2))
    upper = block((0.0, 0.0, 1.0), (2.0, 1.0, 2.0), (5, 3, 2))
    pair = ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, closure=closure)
    guides = [Support("upper", "x1", (0.0, None, None)), Support("upper", "y1", (None, 0.0, None))]
    return Scene(
        {"lower": Body(lower, steel), "upper": Body(upper, steel)},
        [Support("lower", "z0"), *([] if friction else guides)],
        [Traction("upper", "z1", (0.3, 0.2, -6.0))],
        [pair],
    )


def test_a_uniform_pressure_is_found_exactly_between_meshes_that_do_not_match() -> None:
    scene = replace(bodies(LinearClosure(800.0)), loads=[Traction("upper", "z1", (0.0, 0.0, -6.0))])
    rubber = IsotropicElasticity(1000.0, 0.0)
    none = {name: Body(body.mesh, rubber) for name, body in scene.bodies.items()}
    contact = solve_scene(replace(scene, bodies=none), MPI.COMM_SELF, tolerance=1e-10).contact
    np.testing.assert_allclose(contact.pressure, 6.0, rtol=1e-7)
    np.testing.assert_allclose(contact.gap, -6.0 / 800.0, rtol=1e-7)


@pytest.mark.parametrize("name", CLOSURES)
def test_energies_balance_and_the_bound_holds(name: str) -> None:
    scene = bodies(CLOSURES[name], Coulomb(0.4))
    fine = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    energies = fine.energies
    assert energies.surface > 0.0
    assert energies.primal == pytest.approx(energies.dual, abs=1e-8 * energies.strain)
    exact = solve_scene(bodies(CLOSURES[name]), MPI.COMM_SELF, tolerance=1e-11)
    for tolerance in (1e-2, 1e-4):
        rough = solve_scene(bodies(CLOSURES[name]), MPI.COMM_SELF, tolerance=tolerance)
        bound = rough.estimate_errors(geometry=False).algebraic
        assert error(rough, exact) <= bound * (1.0 + 1e-6) + 1e-9
        assert bound < 100.0 * tolerance
    assert fine.estimate_errors(geometry=False).algebraic < 1e-8


def error(state: State, exact: State) -> float:
    """Return the distance in energy norm relative to the state's, by the stiffness of the bodies."""
    torn, way = exact.torn, state.torn_displacement - exact.torn_displacement
    parts = zip(torn.subdomains, torn.decomposition.parts, strict=True)
    return (
        float(np.sqrt(sum(way[part] @ (s.stiffness @ way[part]) for s, part in parts))) / exact.energies.norm
    )


def test_stiff_laws_tend_to_exact_contact_at_no_more_products() -> None:
    exact = solved(bodies(None, Coulomb(0.4)), tolerance=1e-8)
    for stiffness in (1e4, 1e6, 1e8):
        soft = solved(bodies(LinearClosure(stiffness), Coulomb(0.4)), tolerance=1e-8)
        change = np.abs(soft.contact.normal_force - exact.contact.normal_force).max()
        assert change < 2e3 / stiffness * exact.contact.normal_force.max()
        assert soft.solution.products <= exact.solution.products + 3


def test_load_steps_reuse_the_factors_and_follow_the_law() -> None:
    law = CLOSURES["table"]
    problem = ContactProblem(pressed_block(law, 0.01), MPI.COMM_SELF, tolerance=1e-9)
    for down in (0.01, 0.03, 0.002):
        step = LoadStep("down", supports=[Support("block", "z1", (0.0, 0.0, -down))])
        pressure = float(problem.solve(step.applied_to(problem.scene)).contact.pressure.mean())
        assert float(law.closure(np.array([pressure]))[0]) + pressure / MODULUS == pytest.approx(
            down + law.reach, rel=1e-7
        )


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import Coulomb, ExponentialClosure, solve_scene
from tests.equilibrium.law_cases import tilted_block

scene = tilted_block(ExponentialClosure(5.0, 0.01), Coulomb(0.3))
state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-10)
if MPI.COMM_WORLD.rank == 0:
    print(*state.contact.normal_force, *state.contact.gap, state.energies.dual)
"""


def test_the_answer_is_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:

    one = solved(tilted_block(ExponentialClosure(5.0, 0.01), Coulomb(0.3)), tolerance=1e-10)
    found = np.array(mpirun(ON_RANKS, 2).split(), dtype=float)
    expected = [*one.contact.normal_force, *one.contact.gap, one.energies.dual]
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)


def test_effects_name_the_law() -> None:
    names = [effect.name.value for effect in bodies(LinearClosure(1.0)).effects()]
    assert names[-1] == "surfaces that give way"
    assert bodies(LinearClosure(1.0)).plan().multipliers == bodies(None).plan().multipliers


def test_laws_that_fall_are_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"must rise for a unique answer, got 2 at 0.1 and 1 at 0.2: leave out"
    ):
        ClosureTable((0.0, 0.1, 0.2), (0.0, 2.0, 1.0))
    with pytest.raises(InvalidInputError, match=r"must rise for a unique answer, got 1 at 0.1 and 2 at 0.05"):
        ClosureTable((0.0, 0.1, 0.05), (0.0, 1.0, 2.0))
    with pytest.raises(InvalidInputError, match="two or more closures and a pressure for each"):
        ClosureTable((0.0, 0.1), (0.5, 1.0))
    with pytest.raises(
        InvalidInputError, match=r"LinearClosure.stiffness must be positive and finite, got 0.0"
    ):
        LinearClosure(0.0)
    with pytest.raises(
        InvalidInputError, match=r"ExponentialClosure.clearance must be positive and finite, got -0.1: give"
    ):
        ExponentialClosure(1.0, -0.1)

    class Falling(ClosureLaw):
        def closure(self, pressure: np.ndarray) -> np.ndarray:
            return pressure * np.exp(-pressure)

        def growth(self, pressure: np.ndarray) -> np.ndarray:
            return np.ones(len(pressure))

    pair = ContactPair(Surface("a", "z0"), FLOOR, closure=LinearClosure(1.0))
    with pytest.raises(
        InvalidInputError, match="closure of Falling must be zero without pressure and must not fall"
    ):
        replace(pair, closure=Falling())

    class Endless(Falling):
        def growth(self, pressure: np.ndarray) -> np.ndarray:
            return np.full(1, np.inf)

    with pytest.raises(InvalidInputError, match="closure and growth of Endless must return a finite number"):
        replace(pair, closure=Endless())


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_rubber_that_moves_far_follows_the_law_by_undeformed_areas(
    discretisation: str,
) -> None:
    lower = block((-0.5, -0.5, -1.0), (2.5, 1.5, 0.0), (4, 2, 2))
    upper = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 2, 2))
    law, rubber = ClosureTable((-0.02, 0.1, 0.2), (0.0, 2.0, 9.0)), NeoHooke(10.0, 0.3)
    sides = Surface("upper", "z0"), Surface("lower", "z1")
    state = solve_scene(
        Scene(
            {"upper": Body(upper, rubber), "lower": Body(lower, rubber)},
            [Support("lower", "z0"), Support("upper", "z1", (0.2, 0.0, -0.3))],
            contacts=[ContactPair(*sides, Coulomb(0.3), discretisation, closure=law)],
        ),
        MPI.COMM_SELF,
    )
    pressure = state.contact.normal_force / state.torn.points.area
    assert pressure.min() > 0.1
    np.testing.assert_allclose(state.contact.gap, law.reach - law.closure(pressure), atol=1e-7)
    assert NewtonSteps.of([state]).reduction.max() < 1e-2, "tangents are exact"
    assert state.energies.surface > 0.0
