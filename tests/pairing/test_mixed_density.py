"""Hard cases of cells of different sizes: each is solved, balanced, and the same however it is cut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticContact,
    Body,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    RigidPlane,
    RigidSurface,
    Roller,
    Scene,
    Spring,
    State,
    Support,
    Surface,
    Tie,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition, refined
from fenics_contact.mesh.body_mesh import BodyMesh

STEEL = IsotropicElasticity(200.0, 0.3)
PAIR = ContactPair(Surface("high", "z0"), Surface("low", "z1"), Coulomb(0.4))
HELD = (Support("low", "z0"),)
LID = RigidSurface("high", "z1", (1.5, 1.5, 2.0), (0.0, 0.0, None), (0, 0, 0), force=(0.0, 0.0, -1.0))
BED = ElasticFoundation("low", "z0", (9.0, 9.0, 50.0))
PUSH = (Traction("high", "z1", (0.1, 0.05, -1.0)),)

Where = Callable[[np.ndarray], np.ndarray]


def halved(mesh: BodyMesh, *parts: Where) -> BodyMesh:
    """Halve the cells with centres in a part, then those in the next one."""
    for part in parts:
        mesh = refined(mesh, part(mesh.points[mesh.cells].mean(axis=1))).mesh
    return mesh


def near_z(level: float, reach: float, low: float = -9.0, high: float = 9.0) -> Where:
    """Return whether places are near a height, and x in a range."""
    return lambda x: (np.abs(x[:, 2] - level) < reach) & (x[:, 0] > low) & (x[:, 0] < high)


def left(x: np.ndarray) -> np.ndarray:
    return np.asarray(x[:, 0] < 1.5)


def low(*parts: Where) -> BodyMesh:
    return halved(block((0.0, 0.0, 0.0), (3.0, 3.0, 1.0), (6, 6, 2)), *parts)


def high(*parts: Where) -> BodyMesh:
    return halved(block((1.0, 1.0, 1.0), (2.0, 2.0, 2.0), (3, 3, 3)), *parts)


def scene(one: BodyMesh, other: BodyMesh, material: IsotropicElasticity = STEEL, **more: object) -> Scene:
    given: dict[str, object] = {"supports": HELD, "loads": PUSH, "contacts": (PAIR,), **more}
    return Scene({"low": Body(one, material), "high": Body(other, material)}, **given)  # type: ignore[arg-type]


def soft_beside_stiff(refined_side: Where) -> Scene:
    mesh = low(refined_side)
    soft = left(mesh.points[mesh.cells].mean(axis=1))
    mesh = replace(mesh, regions={"soft": np.flatnonzero(soft), "stiff": np.flatnonzero(~soft)})
    materials = {"soft": IsotropicElasticity(2.0, 0.3), "stiff": IsotropicElasticity(2e4, 0.3)}
    bodies = {"low": Body(mesh, materials), "high": Body(high(), STEEL)}
    return Scene(bodies, HELD, [Traction("high", "z1", (0.0, 0.0, -0.01))], [PAIR])


def slid(by: str) -> Scene:
    pushed = (*HELD, Support("high", "z1", (0.05, 0.02, -0.02)))
    pair = replace(PAIR, discretisation=by)
    return scene(
        low(near_z(1.0, 0.4, high=1.5)),
        high(near_z(1.0, 0.4, high=1.5)),
        supports=pushed,
        loads=(),
        contacts=(pair,),
    )


def flat(material: object, axisymmetric: bool) -> Scene:
    one = halved(
        rectangle((0.0, 0.0), (3.0, 1.0), (9, 3)),
        lambda x: (x[:, 0] < 1.2) & (x[:, 1] > 0.5),
        lambda x: (x[:, 0] < 0.8) & (x[:, 1] > 0.8),
    )
    start = 0.0 if axisymmetric else 0.5
    other = halved(
        rectangle((start, 1.0), (start + 1.0, 2.0), (3, 3)), lambda x: (x[:, 1] < 1.4) & (x[:, 0] > 0.7)
    )
    bodies = {
        name: Body(mesh, material, axisymmetric=axisymmetric)
        for name, mesh in (("low", one), ("high", other))
    }
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), Coulomb(0.3))
    push = Traction("high", "y1", (0.0 if axisymmetric else 0.1, -1.0))
    return Scene(bodies, [Support("low", "y0")], [push], [pair])


def tied(by: str) -> Scene:
    tie = Tie(PAIR.slave, PAIR.master, discretisation=by)
    return scene(low(left), high(left), contacts=(), ties=(tie,))


def sprung() -> Scene:
    other = high(left)
    other = other.moved(other.points + np.array([0.0, 0.0, 0.5]))
    sides = (Support("high", "x0", (0.0, None, None)), Support("high", "y0", (None, 0.0, None)))
    spring = Spring(PAIR.slave, PAIR.master, 5.0)
    return scene(low(left), other, supports=(*HELD, *sides), contacts=(), springs=(spring,))


def rolled() -> Scene:
    sides = [Roller(name, side) for name in ("low", "high") for side in ("x0", "y0")]
    return scene(low(left), high(left), supports=(Roller("low", "z0"), *sides))


FINE = near_z(1.0, 0.4)
CASES: dict[str, Callable[[], Scene]] = {
    "fine slave on a coarse master": lambda: scene(low(), high(FINE)),
    "coarse slave on a fine master": lambda: scene(low(near_z(1.0, 0.4, 0.6, 2.4)), high()),
    "jump of size at the edge of contact": lambda: scene(
        low(near_z(1.0, 0.4, high=1.0)), high(near_z(1.0, 0.4, high=1.3))
    ),
    "fine and soft beside stiff": lambda: soft_beside_stiff(left),
    "fine and stiff beside soft": lambda: soft_beside_stiff(lambda x: ~left(x)),
    "under a support": lambda: scene(low(near_z(0.0, 0.4, high=1.5)), high()),
    "under rollers": rolled,
    "on a tie by nodes": lambda: tied("node"),
    "on a tie by mortar": lambda: tied("mortar"),
    "sliding by nodes": lambda: slid("node"),
    "sliding by mortar": lambda: slid("mortar"),
    "body of revolution": lambda: flat(STEEL, True),
    "plane strain, nearly incompressible": lambda: flat(PlaneStrain(200.0, 0.4999), False),
    "solid, nearly incompressible": lambda: scene(low(left), high(left), IsotropicElasticity(200.0, 0.499)),
    "rigid surface": lambda: scene(
        low(left), high(left), loads=(), supports=(*HELD, LID)
    ),
    "foundation": lambda: scene(low(left), high(left), supports=(), foundations=(BED,)),
    "spring between surfaces": sprung,
    "rigid plane": lambda: Scene(
        {"high": Body(high(near_z(1.0, 0.4, high=1.5)), STEEL)}, [], PUSH,
        [ContactPair(Surface("high", "z0"), RigidPlane((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), Coulomb(0.4))],
    ),
    "found contact": lambda: scene(low(left), high(left), contacts=AutomaticContact(friction=Coulomb(0.4))),
}  # fmt: skip


def solved(given: Scene, parts: int) -> State:
    partitions = {name: bisection_partition(body.mesh, parts) for name, body in given.bodies.items()}
    return solve_scene(given, MPI.COMM_SELF, partitions=partitions, tolerance=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_cells_of_different_sizes_are_no_obstacle(case: str) -> None:
    given = CASES[case]()
    assert given.has_hanging_nodes
    states = [solved(given, parts) for parts in (1, 5)]
    for name, body in given.bodies.items():
        one, other = (state.gather_displacement(name) for state in states)
        np.testing.assert_allclose(other, one, atol=3e-8 * np.abs(one).max())
        if (hanging := body.mesh.hanging) is not None:
            np.testing.assert_allclose(other, hanging.placed(other), atol=1e-9 * np.abs(one).max())
    assert states[1].balance().imbalance < 1e-9
    assert states[1].energies.strain == pytest.approx(states[0].energies.strain, rel=1e-6)
