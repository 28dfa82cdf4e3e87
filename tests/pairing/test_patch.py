"""The contact patch test: two bodies pressed together on meshes that do not match bear constant stress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, PlaneStress
from fenics_contact.qp import FaceNewton, ProjectedCG
from tests.scenes import Friction

PRESSURE = 10.0
SOFT, STIFF = IsotropicElasticity(1000.0, 0.3), IsotropicElasticity(3000.0, 0.2)
FACES = Surface("upper", "low"), Surface("lower", "high")


def renamed(mesh: BodyMesh) -> BodyMesh:
    """Name the sides by what they are in the plane and in space."""
    last = "xyz"[mesh.dim - 1]
    names = {f"{last}0": "low", f"{last}1": "high", "x0": "left"} | ({"y0": "front"} if mesh.dim == 3 else {})
    return replace(mesh, surfaces={names[side]: mesh.surfaces[side] for side in names})


def bodies(slave: str, master: str) -> dict[str, Body]:
    """Two bodies of unit cross-section upon each other; no two nodes of their meshes meet inside."""
    if slave in ("triangle", "quadrilateral"):
        lower, upper = rectangle((0, 0), (1, 1), (4, 3), master), rectangle((0, 1), (1, 2), (7, 3), slave)
        law = PlaneStrain(1000.0, 0.3)
        return {"lower": Body(renamed(lower), law), "upper": Body(renamed(upper), law)}
    lower, upper = (
        block((0, 0, 0), (1, 1, 1), (3, 4, 2), master),
        block((0, 0, 1), (1, 1, 2), (5, 3, 2), slave),
    )
    return {"lower": Body(renamed(lower), SOFT), "upper": Body(renamed(upper), SOFT)}


def pressed(
    parts: dict[str, Body], discretisation: str, *, tied: bool = False, friction: Friction = None
) -> Scene:
    """Press on top; rollers on three sides let the bodies widen freely."""
    dim = parts["lower"].mesh.dim
    supports = []
    for direction, side in enumerate(["left", "front", "low"][: dim - 1]):
        value = tuple(0.0 if d == direction else None for d in range(dim))
        supports += [Support(name, side, value) for name in parts]
    supports.append(Support("lower", "low", (None,) * (dim - 1) + (0.0,)))
    load = Traction("upper", "high", (0.0,) * (dim - 1) + (-PRESSURE,))
    if tied:
        return Scene(parts, supports, [load], ties=[Tie(*FACES, discretisation=discretisation)])
    return Scene(parts, supports, [load], [ContactPair(*FACES, friction, discretisation)])


def worst_stress(scene: Scene, state: State) -> float:
    """Return the largest error of the stress, relative to the pressure."""
    error = 0.0
    for name, body in scene.bodies.items():
        # Plane strain keeps σ_z = ν σ_y.
        expected = PRESSURE * (1.0 if body.mesh.dim == 3 else np.sqrt(1 - 0.3 + 0.3**2))
        error = max(error, float(np.abs(state.gather_von_mises(name) - expected).max() / PRESSURE))
    return error


def solved(scene: Scene) -> State:
    whole = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in scene.bodies.items()}
    solver = FaceNewton(tolerance=1e-12) if scene.contacts else ProjectedCG(tolerance=1e-12)
    return solve_scene(scene, MPI.COMM_SELF, partitions=whole, solver=solver)


CELLS = [
    ("hexahedron", "hexahedron"), ("tetrahedron", "tetrahedron"), ("tetrahedron", "hexahedron"),
    ("hexahedron", "tetrahedron"), ("quadrilateral", "quadrilateral"), ("triangle", "triangle"),
    ("triangle", "quadrilateral"),
]  # fmt: skip


@pytest.mark.parametrize(("slave", "master"), CELLS)
@pytest.mark.parametrize("tied", [False, True], ids=["contact", "tie"])
def test_mortar_transmits_constant_stress(slave: str, master: str, tied: bool) -> None:
    scene = pressed(bodies(slave, master), "mortar", tied=tied)
    state = solved(scene)
    assert worst_stress(scene, state) < 1e-10
    if not tied:
        np.testing.assert_allclose(state.contact.pressure, PRESSURE, rtol=1e-9)


@pytest.mark.parametrize(("slave", "master"), CELLS)
def test_node_to_surface_does_not(
    slave: str, master: str, record_property: Callable[[str, object], None]
) -> None:
    scene = pressed(bodies(slave, master), "node")
    error = worst_stress(scene, solved(scene))
    record_property("largest error of the stress", float(error))
    assert 0.01 < error < 0.5


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron", "quadrilateral"])
def test_friction_does_not_disturb_the_patch(cell: str) -> None:
    """Both bodies widen alike: nothing slips, and the shear is zero."""
    scene = pressed(bodies(cell, cell), "mortar", friction=Coulomb(0.4))
    state = solved(scene)
    assert worst_stress(scene, state) < 1e-9
    # Where rollers hold slave and master alike, friction and reactions share a force that nobody sees.
    free = ~state.torn.decomposition.fixed[state.contact.points.slave].any(axis=1)
    assert 5 < free.sum() < state.contact.points.count
    assert np.abs(state.contact.friction_force[free]).max() < 1e-8 * state.contact.normal_force.max()


def test_a_slave_that_reaches_beyond_its_master_bears_the_right_force() -> None:
    """The upper body overhangs: only what faces the master carries force, and it carries all of it."""
    lower, upper = block((0, 0, 0), (1, 1, 1), (3, 4, 2)), block((-0.3, 0, 1), (1.2, 1, 2), (5, 3, 2))
    parts = {"lower": Body(renamed(lower), STIFF), "upper": Body(renamed(upper), STIFF)}
    state = solved(pressed(parts, "mortar"))
    assert state.contact.normal_force.sum() == pytest.approx(1.5 * PRESSURE, rel=1e-9)
    assert state.contact.points.area.sum() == pytest.approx(1.0, rel=1e-9)


def test_plane_stress_leaves_the_third_stress_zero() -> None:
    parts = {
        name: Body(body.mesh, PlaneStress(1000.0, 0.3))
        for name, body in bodies("quadrilateral", "triangle").items()
    }
    state = solved(pressed(parts, "mortar"))
    for name in parts:
        np.testing.assert_allclose(state.gather_von_mises(name), PRESSURE, rtol=1e-9)
    top = np.unique(parts["upper"].mesh.surfaces["high"])
    sunk = state.gather_displacement("upper")[top, 1]
    np.testing.assert_allclose(sunk, -2.0 * PRESSURE / 1000.0, rtol=1e-9)
