"""Sectors of cyclic symmetry and their wholes, on the ranks of a communicator."""

from __future__ import annotations

import json
import sys

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    CyclicSymmetry,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.press_fits import BORE, NU, RIM, SEAT, YOUNG, ring

SOFT = IsotropicElasticity(1000.0, 0.3)
STEEL = PlaneStrain(YOUNG, NU, thermal_expansion=1e-3)
TOLERANCE = 1e-10
SECTORS = 12


def bent(mesh: BodyMesh, skew: float = 0.0) -> BodyMesh:
    """A ring whose seat is no circle, but repeats; with ``skew`` its sides have other nodes."""
    r, angle = np.linalg.norm(mesh.points, axis=1), np.arctan2(mesh.points[:, 1], mesh.points[:, 0])
    low, high = r.min(), r.max()
    inside = (r - low) / (high - low)
    r = low + (high - low) * inside ** (1.0 + skew * SECTORS * angle / (2 * np.pi))
    r, angle = r + 0.1 * np.sin(SECTORS * angle + 0.5), angle + 0.01 * np.sin(SECTORS * angle)
    return mesh.moved(np.column_stack([r * np.cos(angle), r * np.sin(angle)]))


def around(points: np.ndarray) -> np.ndarray:
    """A traction that repeats, is not the same in both directions, and turns."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    outwards = points / np.linalg.norm(points, axis=1)[:, None]
    across = np.column_stack([-outwards[:, 1], outwards[:, 0]])
    out = 300.0 * np.cos(SECTORS * angle) + 100.0 * np.sin(2 * SECTORS * angle + 1.0)
    return out[:, None] * outwards + (20.0 * np.sin(SECTORS * angle + 0.3) + 0.5)[:, None] * across


def rotor(part: float = 1 / SECTORS, *, skew: float = 0.0, fine: int = 1) -> Scene:
    """A hub that is pressed on a shaft, twisted and pulled; friction slips at some points."""
    meshes = {
        "shaft": bent(ring(BORE, SEAT, 96 * fine, 2 * fine, part=part, shapes=False), skew),
        "hub": bent(ring(SEAT, RIM, 96 * fine, 3 * fine, part=part, shapes=False), skew),
    }
    pair = ContactPair(
        Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(0.02), "node", interference=0.05
    )
    ties = [CyclicSymmetry(Surface(n, "end"), Surface(n, "start"), (0.0, 0.0)) for n in meshes if part < 1.0]
    bodies = {name: Body(mesh, STEEL) for name, mesh in meshes.items()}
    return Scene(bodies, [Support("shaft", "inner")], [Traction("hub", "outer", around)], [pair], ties)


def column(*, whole: bool) -> Scene:
    """A square column on another one, with friction; of a quarter both sides meet at the axis."""
    low = -1.0 if whole else 0.0
    cells = (4, 4, 2) if whole else (2, 2, 2)
    meshes = {
        "lower": block((low, low, -1.0), (1.0, 1.0, 0.0), cells),
        "upper": block((low, low, 0.0), (1.0, 1.0, 0.5), cells),
    }
    pair = ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.3))

    def push(points: np.ndarray) -> np.ndarray:
        x, y, _ = points.T
        swirl = 1.0 + x**2 * y**2
        return np.column_stack([-swirl * y, swirl * x, -5.0 - (x**2 + y**2)])

    ties = [
        CyclicSymmetry(Surface(name, "x0"), Surface(name, "y0"), (0.0, 0.0, 3.0), (0.0, 0.0, 2.0))
        for name in meshes
        if not whole
    ]
    bodies = {name: Body(mesh, SOFT) for name, mesh in meshes.items()}
    return Scene(bodies, [Support("lower", "z0")], [Traction("upper", "z1", push)], [pair], ties)


def in_two(*, two: bool) -> Scene:
    """A ring's sector of one body, or of two that are tied together in its middle."""
    whole = ring(BORE, RIM, 96, 4, part=1 / SECTORS, shapes=False)
    load = [Traction("a", "outer", around)]
    if not two:
        tie = CyclicSymmetry(Surface("a", "end"), Surface("a", "start"), (0.0, 0.0))
        return Scene({"a": Body(whole, STEEL)}, [Support("a", "inner")], load, [], [tie])
    half = ring(BORE, RIM, 96, 4, part=0.5 / SECTORS, shapes=False)
    c, s = np.cos(np.pi / SECTORS), np.sin(np.pi / SECTORS)
    meshes = {"a": half, "b": half.moved(half.points @ np.array([[c, s], [-s, c]]))}
    ties = [
        CyclicSymmetry(Surface("b", "end"), Surface("a", "start"), (0.0, 0.0)),
        Tie(Surface("b", "start"), Surface("a", "end")),
    ]
    held = [Support(name, "inner") for name in meshes]
    bodies = {name: Body(mesh, STEEL) for name, mesh in meshes.items()}
    return Scene(bodies, held, [*load, Traction("b", "outer", around)], [], ties)


SCENES = {"rotor": rotor, "column": lambda: column(whole=False), "skewed": lambda: rotor(skew=0.3)}


def solved(scene: Scene, cut: int = 2, comm: MPI.Comm = MPI.COMM_SELF) -> AnyState:
    """The state with so many subdomains in every body."""
    cuts = {name: bisection_partition(body.mesh, cut) for name, body in scene.bodies.items()}
    return solve_scene(scene, comm, partitions=cuts, solver=FaceNewton(tolerance=TOLERANCE))


def found(name: str, cut: int, comm: MPI.Comm) -> dict[str, list[float]]:
    """What must not depend on ranks and cuts."""
    state = solved(SCENES[name](), cut, comm)
    fields = [state.gather_displacement(body) for body in state.scene.bodies]
    reactions = [float(part) for each in state.reactions() for part in each.force]
    return {"u": np.concatenate(fields).ravel().tolist(), "reactions": reactions}


def main(names: list[str]) -> None:
    """Print what each scene gives, cut into four subdomains a body."""
    everywhere = MPI.COMM_WORLD.gather({name: found(name, 4, MPI.COMM_WORLD) for name in names})
    if everywhere is not None:
        print(json.dumps(everywhere))


if __name__ == "__main__":
    main(sys.argv[1:])
