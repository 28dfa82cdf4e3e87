"""Scenes with rollers in directions other than those of the axes, on the ranks of a communicator."""

from __future__ import annotations

import json
import sys

import numpy as np
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    Roller,
    Scene,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.press_fits import BORE, NU, RIM, SEAT, YOUNG, ring

SOFT = IsotropicElasticity(1000.0, 0.3)
TURN = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()
TOLERANCE = 1e-10


def turned(mesh: BodyMesh) -> BodyMesh:
    """A mesh turned by a rotation about no axis."""
    return mesh.moved(mesh.points @ TURN.T)


def stack(
    *,
    turn: bool,
    discretisation: str = "node",
    push: tuple[float, float, float] = (3.0, 0.0, -10.0),
    cells: tuple[int, int, int] = (4, 3, 2),
    slope: float = 0.0,
) -> Scene:
    """Half of a block pushed along a wider one, cut at a plane of symmetry, straight or turned as a whole."""
    lower = block((0, 0, 0), (2, 1, 1), (cells[0] + 1, *cells[1:]))
    lower = lower.moved(lower.points - slope * np.prod(lower.points[:, 1:], axis=1)[:, None] * np.eye(3)[2])
    upper = block((0.1, 0, 1), (1.9, 1, 2), cells)
    load = Traction("upper", "z1", tuple((TURN @ push).tolist()) if turn else push)
    meshes = {"lower": lower, "upper": upper}
    if turn:
        meshes = {name: turned(mesh) for name, mesh in meshes.items()}
    cuts = [
        Roller(name, "y0") if turn else Support(name, "y0", (None, 0.0, None)) for name in ("lower", "upper")
    ]
    pair = ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.35), discretisation)
    bodies = {name: Body(mesh, SOFT) for name, mesh in meshes.items()}
    return Scene(bodies, [Support("lower", "z0"), *cuts], [load], [pair])


def fit(around: int, part: float, *, turn: float = 0.0) -> Scene:
    """A hub pressed on a shaft with friction, and by a pressure that varies around; a sector or all of it."""
    meshes = {
        "shaft": ring(BORE, SEAT, around, 2, part=part),
        "hub": ring(SEAT, RIM, around, 3, part=part),
    }
    c, s = np.cos(turn), np.sin(turn)
    meshes = {name: mesh.moved(mesh.points @ np.array([[c, s], [-s, c]])) for name, mesh in meshes.items()}
    pair = ContactPair(
        Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(0.02), "node", interference=0.05
    )

    def pressure(points: np.ndarray) -> np.ndarray:
        angle = np.arctan2(points[:, 1], points[:, 0]) - turn
        return 300.0 * np.cos(12.0 * angle)

    cuts = [Roller(name, side) for name in meshes for side in ("start", "end")] if part < 1.0 else []
    bodies = {name: Body(mesh, PlaneStrain(YOUNG, NU)) for name, mesh in meshes.items()}
    return Scene(bodies, cuts, [Pressure("hub", "outer", pressure)], [pair])


def wedge(angle: float, count: int) -> BodyMesh:
    """A sector of triangles with a node on the axis; surfaces "start", "end" and "out", which is straight."""
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (np.cos(angle), np.sin(angle))])
    number, points = {}, []
    for i in range(count + 1):
        for j in range(i + 1):
            number[i, j] = len(points)
            points.append((i * corners[1] + j * (corners[2] - corners[1])) / count)
    right = [(i, j) for i in range(count) for j in range(i + 1)]
    cells = [(number[i, j], number[i + 1, j], number[i + 1, j + 1]) for i, j in right]
    cells += [(number[i, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in right if j < i]
    surfaces = {
        "start": np.array([(number[i, 0], number[i + 1, 0]) for i in range(count)]),
        "end": np.array([(number[i + 1, i + 1], number[i, i]) for i in range(count)]),
        "out": np.array([(number[count, j], number[count, j + 1]) for j in range(count)]),
    }
    return BodyMesh(np.array(points), np.array(cells), surfaces)


def on_floor() -> Scene:
    """A turned block between rollers on three sides, pressed and pulled along a turned floor."""
    mesh = turned(block((0, 0, 0), (2, 1, 1), (5, 3, 3)))
    floor = RigidPlane((0, 0, 0), tuple(TURN[:, 2].tolist()))
    load = Traction("block", "z1", tuple((TURN @ (2.0, 1.0, -9.0)).tolist()))
    contact = ContactPair(Surface("block", "z0"), floor, Coulomb(0.3))
    sides = [Roller("block", "x0", lambda x: 0.001 * (x @ TURN[:, 2])), Roller("block", "y0")]
    return Scene({"block": Body(mesh, SOFT)}, sides, [load], [contact])


SCENES = {
    "stack": lambda: stack(turn=True),
    "mortar": lambda: stack(turn=True, discretisation="mortar"),
    "sector": lambda: fit(96, 1 / 24, turn=0.4),
    "floor": on_floor,
}


def solved(scene: Scene, cut: int = 2, comm: MPI.Comm = MPI.COMM_SELF) -> AnyState:
    """The state; `cut`: boxes along x, or, from 3 on, subdomains by bisection of every body."""
    sizes = {2: (2, 1, 1), 1: (1, 1, 1)}
    cuts = {
        name: box_partition(body.mesh, sizes[cut][: scene.dim])
        if cut in sizes
        else bisection_partition(body.mesh, cut)
        for name, body in scene.bodies.items()
    }
    return solve_scene(scene, comm, partitions=cuts, solver=FaceNewton(tolerance=TOLERANCE))


def found(name: str, cut: int, comm: MPI.Comm) -> dict[str, list[float]]:
    """What must not depend on ranks and cuts."""
    state = solved(SCENES[name](), cut, comm)
    fields = [state.gather_displacement(body) for body in state.scene.bodies]
    reactions = [float(part) for each in state.reactions() for part in each.force]
    return {"u": np.concatenate(fields).ravel().tolist(), "reactions": reactions}


def main(names: list[str]) -> None:
    """Print what each scene gives, cut into four subdomains a body."""
    results = {name: found(name, 4, MPI.COMM_WORLD) for name in names}
    everywhere = MPI.COMM_WORLD.gather(results)
    if everywhere is not None:
        print(json.dumps(everywhere))


if __name__ == "__main__":
    main(sys.argv[1:])
