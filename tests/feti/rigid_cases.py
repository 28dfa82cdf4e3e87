"""Scenes with rigid surfaces, on the ranks of a communicator."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    Tie,
    box_partition,
    gravity,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.results.deformed_state import AnyState
from tests.scenes import AnySupport, Load

SOFT = IsotropicElasticity(1000.0, 0.3)
#: A point beside the end of the bar, and what acts there.
POINT, FORCE, MOMENT = (4.5, 0.2, 0.3), (0.3, 0.1, -1.0), (0.5, 0.2, -0.3)


def bar(end: Sequence[AnySupport], loads: Sequence[Load] = ()) -> Scene:
    """A bar held at its left end."""
    mesh = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (8, 3, 3))
    return Scene({"bar": Body(mesh, SOFT)}, [Support("bar", "x0"), *end], loads)


def loaded() -> Scene:
    """The bar loaded at a point beside its rigid end."""
    return bar([RigidSurface("bar", "x1", POINT, force=FORCE, moment=MOMENT)])


def pressed() -> Scene:
    """A block whose rigid top is pushed on a floor: friction and what the top may not do hold it."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 4))
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    top = RigidSurface(
        "block", "z1", (1.2, 0.5, 2.0), (None, None, -0.02), None, (2.0, 0.5, 0.0), (0.0, 0.0, 0.6)
    )
    contact = ContactPair(Surface("block", "z0"), floor, Coulomb(0.4))
    return Scene({"block": Body(mesh, SOFT)}, [top], [gravity("block", 0.1, (0, 0, -1.0))], [contact])


def tied() -> Scene:
    """Two tied plates in the plane; the upper one hangs at a point about which its rigid top turns."""
    lower = Body(rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), PlaneStrain(100.0, 0.3))
    upper = Body(rectangle((0.0, 1.0), (3.0, 2.0), (5, 3)), PlaneStrain(300.0, 0.3))
    hinge = RigidSurface("upper", "y1", (1.0, 2.5), (0.0, 0.01), None, moment=0.3)
    return Scene(
        {"lower": lower, "upper": upper},
        [Support("lower", "y0"), hinge],
        ties=[Tie(Surface("lower", "y1"), Surface("upper", "y0"))],
    )


def punched() -> Scene:
    """A pad under a punch whose rigid lower side is the master, pushed at a point free to tilt and slide."""
    pad = Body(block((0.0, 0.0, 0.0), (3.0, 2.0, 1.0), (6, 4, 2)), SOFT)
    punch = Body(block((0.9, 0.6, 1.0), (2.0, 1.5, 1.6), (4, 2, 2)), SOFT)
    face = RigidSurface("punch", "z0", (1.4, 1.0, 1.6), force=(1.0, 0.3, -20.0))
    pair = ContactPair(Surface("pad", "z1"), Surface("punch", "z0"), Coulomb(0.3), discretisation="node")
    return Scene({"pad": pad, "punch": punch}, [Support("pad", "z0"), face], contacts=[pair])


def bridged() -> Scene:
    """The same by mortar, without friction."""
    scene = punched()
    pair = ContactPair(Surface("pad", "z1"), Surface("punch", "z0"), None, "mortar")
    face = RigidSurface("punch", "z0", (1.4, 1.0, 1.6), (0.0, 0.0, None), None, (0.0, 0.0, -20.0))
    return replace(scene, supports=[scene.supports[0], face], contacts=[pair])


SCENES = {"loaded": loaded, "pressed": pressed, "tied": tied, "punched": punched, "bridged": bridged}


def solved(scene: Scene, comm: MPI.Comm, tolerance: float | None = 1e-10, parts: int = 4) -> AnyState:
    """Return the state with some subdomains a body."""
    cut = {
        name: box_partition(body.mesh, (parts, *[1] * (scene.dim - 1))) for name, body in scene.bodies.items()
    }
    return solve_scene(scene, comm, partitions=cut, tolerance=tolerance)


def numbers(state: AnyState) -> dict[str, list[float]]:
    """Return motions, reactions, displacements and balance. Collective."""
    motions = [np.append(each.displacement, each.rotation) for each in state.rigid_motions()]
    reactions = [np.append(each.force, each.moment) for each in state.reactions()]
    moved = [state.gather_displacement(name).ravel() for name in state.scene.bodies]
    balance = state.balance()
    return {
        "motions": np.concatenate(motions).tolist(),
        "reactions": np.concatenate(reactions).tolist(),
        "moved": np.concatenate(moved).tolist(),
        "loads": [*balance.loads.force.tolist(), *np.atleast_1d(balance.loads.moment).tolist()],
        "imbalance": [balance.imbalance],
        "potential": [state.energies.total_potential],
    }


def shaft(cells: int, *, order: int = 1) -> BodyMesh:
    """A round shaft of radius one and length six, its axis that of z."""
    square = block((-1.0, -1.0, 0.0), (1.0, 1.0, 6.0), (2 * cells, 2 * cells, 3 * cells))
    square = quadratic(square) if order == 2 else square
    x, y, z = square.points.T
    return square.moved(np.stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), z], axis=1))


def main(comm: MPI.Comm) -> None:
    everywhere = {name: comm.allgather(numbers(solved(SCENES[name](), comm))) for name in sys.argv[1:]}
    if comm.rank == 0:
        sys.stdout.write(json.dumps(everywhere))


if __name__ == "__main__":
    main(MPI.COMM_WORLD)
