"""Soft contact as CalculiX has it: displacements of its own examples, on the same meshes.

The numbers are those that CalculiX 2.20 (Debian 12) prints for the decks contact1, contact3 and contact6 of
its tests (package calculix-ccx-test, GPL 2 or later; facts alone are used, no text). Its slave is a single
node there, with an area of 0.03 (three faces of the small cube meet in it); here the whole face, 0.04, is the
slave: pressures are in that ratio. The hysteresis is that of fricloop with its upper face driven as a whole
(in the deck, the set of its four nodes in place of one of them), in increments of 0.05 of time.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ClosureLaw,
    ClosureTable,
    ContactPair,
    ContactProblem,
    Coulomb,
    ExponentialClosure,
    LinearClosure,
    LoadStep,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    TotalForce,
    solve_scene,
    solve_steps,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, Material, StVenantKirchhoff

STEEL = IsotropicElasticity(210000.0, 0.3)
SHARE = 0.03 / 0.04


def linear(stiffness: float, tension: float, deepest: float) -> ClosureTable:
    """CalculiX's linear law, K d (1/2 + atan(d K / (π σ)) / π), which is smooth at d = 0."""
    closure = np.concatenate([[0.0], np.geomspace(1e-4 * deepest, deepest, 400)])
    bent = 0.5 + np.arctan(closure * stiffness / (np.pi * tension)) / np.pi
    return ClosureTable(tuple(closure), tuple(SHARE * stiffness * closure * bent))


def small_cube(bottom: float) -> BodyMesh:
    """A block 0.2 high whose square of side 0.2 is turned by 45 degrees about (0.5, 0.5)."""
    mesh = block((-0.1, -0.1, bottom), (0.1, 0.1, bottom + 0.2), (1, 1, 1))
    turn = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, np.sqrt(2.0)]]) / np.sqrt(2.0)
    return mesh.moved(mesh.points @ turn + (0.5, 0.5, 0.0))


def solved(law: ClosureLaw, bottom: float, *, held: bool) -> State:
    """Faces that meet move along z as a whole; the small cube is held above, or pressed there by 4."""
    bodies = {
        "lower": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL),
        "upper": Body(small_cube(bottom), STEEL),
    }
    flat = {"displacement": (0.0, 0.0, None), "rotation": (0.0, 0.0, 0.0)}
    supports = [
        Support("lower", "z0"),
        RigidSurface("lower", "z1", (0.5, 0.5, 1.0), **flat),
        Support("upper", "z0", (0.0, 0.0, None)),
        *([Support("upper", "z1")] if held else []),
    ]
    side, force = ("z0", -1.0) if held else ("z1", -4.0)
    loads = [TotalForce("upper", side, (0.0, 0.0, force))]
    pair = ContactPair(
        Surface("upper", "z0"), Surface("lower", "z1"), closure=law,
        interference="measured" if bottom < 1.0 else None,
    )  # fmt: skip
    return solve_scene(Scene(bodies, supports, loads, [pair]), MPI.COMM_SELF, tolerance=1e-10)


def down(state: State, body: str, height: float) -> float:
    """Return the vertical displacement at a height of a body, relative to where it would just touch."""
    points = state.scene.bodies[body].mesh.points
    at = np.isclose(points[:, 2], height)
    return float(state.gather_displacement(body)[at, 2].mean())


def test_exponential_closure_of_contact1() -> None:
    state = solved(ExponentialClosure(6.66666 * SHARE, 1.5351e-7), 1.0, held=True)
    lower, upper = down(state, "lower", 1.0), down(state, "upper", 1.0)
    assert lower == pytest.approx(-2.939934e-6, rel=2e-3)
    assert upper == pytest.approx(-2.987416e-6, rel=2e-3)
    assert lower - upper == pytest.approx(-2.939934e-6 + 2.987416e-6, rel=5e-3)


@pytest.mark.parametrize(
    ("stiffness", "bottom", "faces", "top"),
    [
        (1e7, 0.98, (-1.414996e-5, 1.997221e-2), 1.988549e-2),  # contact3
        (1e9, 0.9999, (-1.414996e-5, 8.571368e-5), -1.011036e-6),  # contact6
    ],
)
def test_linear_closure_of_contact3_and_contact6(
    stiffness: float, bottom: float, faces: tuple[float, float], top: float
) -> None:
    state = solved(linear(stiffness, 3.0, 200.0 / stiffness), bottom, held=False)
    lower, upper = down(state, "lower", 1.0), down(state, "upper", bottom)
    assert lower == pytest.approx(faces[0], rel=1e-3)
    closure, theirs = lower - upper + 1.0 - bottom, faces[0] - faces[1] + 1.0 - bottom
    # Displacements are printed with seven digits.
    assert closure == pytest.approx(theirs, rel=5e-3, abs=2e-9 if bottom > 0.99 else 1e-8)
    assert down(state, "upper", bottom + 0.2) - upper == pytest.approx(top - faces[1], rel=5e-3)


#: Displacement of the upper face and the mean friction traction, as CalculiX has it.
HYSTERESIS = (
    (0.005, 4.97585), (0.01, 9.95165), (0.02, 19.90328), (0.05, 19.9926), (0.1, 19.9926), (0.09, 10.0401),
    (0.06, -19.8171), (-0.1, -19.9926), (-0.08, -0.08772), (-0.05, 19.9926), (-0.02, 19.9926),
)  # fmt: skip


@pytest.mark.parametrize("material", [STEEL, StVenantKirchhoff(210000.0, 0.3)])
def test_elastic_slip_and_hysteresis_of_fricloop(material: Material) -> None:
    bodies = {
        "lower": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), material),
        "upper": Body(small_cube(1.0), material),
    }
    held = [  # a pressure of 100: faces are flat there, too
        Support("lower", "z0"),
        Support("lower", "z1", (None, None, -1.73387e-5)),
        Support("upper", "z0", (None, None, -2.73387e-5)),
    ]
    law, surfaces = Coulomb(0.2, stick_stiffness=1e3), (Surface("upper", "z0"), Surface("lower", "z1"))
    pair = ContactPair(*surfaces, law, "node", closure=LinearClosure(1e7))
    top = [Support("upper", "z1", (0.0, way, -1.22e-4)) for way, _ in HYSTERESIS]
    scene = Scene(bodies, [*held, top[0]], contacts=[pair])
    steps = [
        LoadStep(f"{way:g}", supports=[*held, last]) for (way, _), last in zip(HYSTERESIS, top, strict=True)
    ]
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9), steps)
    for (way, theirs), state in zip(HYSTERESIS, states, strict=True):
        contact = state.contact
        assert contact.pressure.mean() == pytest.approx(100.0, rel=1e-3)
        ours = -(contact.force[:, 1] / contact.area).mean()
        assert ours == pytest.approx(theirs, abs=5e-3 * 20.0), way
