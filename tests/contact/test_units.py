"""No answer depends on the units of length and force, however small or large the numbers become."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Pressure,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
    Tresca,
    solve_scene,
)
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain, PlaneStress
from fenics_contact.results.deformed_state import AnyState
from tests.contact.gallery import block_on_plane, partitions, pressed_block, stack, two_blocks
from tests.hard.transform import in_units

#: Units of length and force in which stiffness and moduli become as small and as large as can be.
UNITS = [(1e12, 1e-12), (1e-12, 1e12), (1e-12, 1e-12)]


def plates() -> Scene:
    """Two plane bodies, mortar contact."""
    lower, upper = rectangle((0.0, 0.0), (2.1, 0.7), (5, 3)), rectangle((0.2, 0.7), (1.8, 1.3), (7, 3))
    return Scene(
        {"lower": Body(lower, PlaneStrain(100.0, 0.3)), "upper": Body(upper, PlaneStress(200.0, 0.2))},
        [Support("lower", "y0", (0.0, 0.0))],
        [Traction("upper", "y1", (0.1, -1.0))],
        [ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(0.3), "mortar")],
    )


def tied() -> Scene:
    blocks = two_blocks(None)
    pair = blocks.contacts[0]
    assert isinstance(pair.master, Surface)
    return replace(blocks, contacts=[], ties=[Tie(pair.slave, pair.master)])


def alone() -> Scene:
    """One body that supports hold: found directly."""
    held = pressed_block(None)
    return Scene(held.bodies, held.supports, [Pressure("block", "x1", 1.0)])


SCENES = {
    "two blocks": two_blocks(Coulomb(0.38)),
    "tetrahedra": two_blocks(Coulomb(0.38), "tetrahedron"),
    "a floor": block_on_plane(Tresca(1.2)),
    "a stack": stack(Coulomb(0.4), Coulomb(0.5)),
    "plates": plates(),
    "tied": tied(),
    "alone": alone(),
}


def solved(scene: Scene) -> AnyState:
    return solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize("name", SCENES)
def test_forces_displacements_and_errors_are_the_same_in_all_units(name: str) -> None:
    scene = SCENES[name]
    known, last = solved(scene), list(scene.bodies)[-1]
    displacement, expected = known.gather_displacement(last), known.estimate_errors()
    for length, force in UNITS:
        found = solved(in_units(scene, length, force))
        np.testing.assert_array_equal(found.contact.status, known.contact.status)
        for mine, others, unit in (
            (found.gather_displacement(last), displacement, length),
            (found.contact.force, known.contact.force, force),
            (found.gather_von_mises(last), known.gather_von_mises(last), force / length ** (scene.dim - 1)),
        ):
            assert np.abs(mine / unit - others).max(initial=0.0) < 1e-8 * np.abs(others).max(initial=1e-300)
        assert found.solution.products == known.solution.products
        errors = found.estimate_errors()
        assert errors.discretisation == pytest.approx(expected.discretisation, rel=1e-6)
        assert errors.algebraic == pytest.approx(expected.algebraic, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("kind", [LocalKind.IMPLICIT, LocalKind.EXPLICIT])
def test_subdomains_are_factored_alike_in_all_units(kind: LocalKind) -> None:
    def system(length: float, force: float) -> DualSystem:
        scene = in_units(SCENES["two blocks"], length, force)
        torn = build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF))
        return DualSystem(torn, kind=kind)

    known = system(1.0, 1.0)
    balanced = known.problem.coarse.project(
        np.random.default_rng(0).standard_normal(len(known.torn.numbering.owned))
    )
    expected = known.problem.coarse.project(known.apply(balanced))
    for length, force in UNITS:
        other = system(length, force)
        found = known.problem.coarse.project(other.apply(balanced))
        np.testing.assert_allclose(found * force / length, expected, atol=1e-12 * np.abs(expected).max())
