"""Wear of all kinds: by nodes and mortar, with quadratic cells and torsion, turned, in other units."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    Wear,
    solve_steps,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic

COEFFICIENT = 1e-4


def solved(scene: Scene, steps: Any, tolerance: float = 1e-9) -> tuple[State, ...]:
    """Return the states after all steps."""
    return solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=tolerance), steps)


def check_balance(states: Any, coefficient: float = COEFFICIENT) -> None:
    """Check that the volume is k Σ λ |Δs| in each step, and that contacts close."""
    lost = 0.0
    for state in states:
        contact = state.contact
        expected = coefficient * float(contact.normal_force @ np.linalg.norm(contact.slip, axis=1))
        assert contact.area @ contact.worn == pytest.approx(expected, rel=1e-12, abs=1e-300)
        lost += expected
        assert contact.worn_volume() == pytest.approx(lost, rel=1e-12)
        pressed = contact.normal_force > 0.0
        assert np.abs(contact.gap[pressed]).max() < 1e-6 * contact.worn_depth.max() + 1e-9
    assert lost > 0.0


def stacked(discretisation: Any, order: int, turn: Rotation | None = None, unit: float = 1.0) -> Any:
    """Return a block that rubs on another one with other cells, and its load steps; `unit`: of length."""
    turned = Rotation.identity() if turn is None else turn
    meshes = {
        "lower": block((0.0, 0.0, 0.0), (3.0, 2.0, 1.0), (4, 3, 1)),
        "upper": block((0.5, 0.5, 1.0), (2.5, 1.5, 2.0), (3, 2, 1)),
    }
    if order == 2:
        meshes = {name: quadratic(mesh) for name, mesh in meshes.items()}
    iron = IsotropicElasticity(2e4 / unit**2, 0.3)
    bodies = {name: Body(mesh.moved(turned.apply(unit * mesh.points)), iron) for name, mesh in meshes.items()}

    def held(x: float) -> list[Any]:
        way = turned.apply((x * unit, 0.3 * x * unit, -0.01 * unit))
        top = RigidSurface(
            "upper", "z1", tuple(turned.apply((1.5 * unit, unit, 2.0 * unit))), tuple(way), (0,) * 3
        )
        return [Support("lower", "z0"), top]

    pair = ContactPair(
        Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.2), discretisation,
        wear=Wear(COEFFICIENT * unit**2),
    )  # fmt: skip
    scene = Scene(bodies, held(0.0), contacts=[pair])
    return scene, [LoadStep("press"), *(LoadStep(f"to {x}", supports=held(x)) for x in (0.02, -0.02))]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_bodies_wear_each_other_by_nodes_and_by_mortar(discretisation: Any, order: int) -> None:
    check_balance(solved(*stacked(discretisation, order)))


def test_wear_turns_with_the_scene_and_has_its_units() -> None:
    plain = solved(*stacked("mortar", 1))[-1].contact
    turned = solved(*stacked("mortar", 1, Rotation.from_rotvec((0.3, -0.7, 0.4))))[-1].contact
    scaled = solved(*stacked("mortar", 1, unit=1e-3))[-1].contact
    np.testing.assert_allclose(turned.worn_depth, plain.worn_depth, atol=1e-6 * plain.worn_depth.max())
    np.testing.assert_allclose(1e3 * scaled.worn_depth, plain.worn_depth, atol=1e-6 * plain.worn_depth.max())


def test_bodies_that_twist_wear_along_their_turn() -> None:
    mesh, iron = rectangle((2.0, 0.0), (5.0, 2.0), (6, 4)), IsotropicElasticity(2e4, 0.3)
    body = Body(mesh, iron, axisymmetric=True, torsion=True)
    pair = ContactPair(
        Surface("ring", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.2), wear=Wear(COEFFICIENT)
    )

    def turned(angle: float) -> list[Any]:
        return [RigidSurface("ring", "y1", (0.0, 2.0), (0.0, -0.005), angle)]

    steps = [LoadStep("press"), *(LoadStep(f"turn {x}", supports=turned(x)) for x in (0.02, -0.02))]
    states = solved(Scene({"ring": body}, turned(0.0), contacts=[pair]), steps)
    check_balance(states)
    around = states[-1].contact.slip
    assert np.abs(around).max() > 0.1, "what slides is the turn"


def test_several_pairs_of_a_body_lose_their_own_volumes() -> None:
    bar = Body(rectangle((0.0, 0.0), (4.0, 1.0), (8, 2)), PlaneStrain(2e4, 0.3))
    pairs = [
        ContactPair(
            Surface("bar", side), RigidPlane((0.0, height), (0.0, sign)),
            interference="measured", wear=Wear(k, sliding=1.0),
        )
        for side, height, sign, k in (("y0", 0.002, 1.0, 1e-5), ("y1", 0.998, -1.0, 3e-5))
    ]  # fmt: skip
    scene = Scene({"bar": bar}, [Support("bar", "x0", (0.0, None))], contacts=pairs)
    contact = solved(scene, [LoadStep("squeeze")])[-1].contact
    below, above = (float(contact.normal_force[contact.on_pair(k)].sum()) for k in (0, 1))
    assert below == pytest.approx(above, rel=1e-9)
    assert contact.worn_volume(0) == pytest.approx(1e-5 * below, rel=1e-12)
    assert contact.worn_volume(1) == pytest.approx(3e-5 * above, rel=1e-12)
