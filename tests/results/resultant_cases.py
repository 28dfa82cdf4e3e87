"""Scenes whose reactions and balances are tested, on the ranks of a communicator."""

from __future__ import annotations

import json
import sys

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    TotalForce,
    Traction,
    box_partition,
    gravity,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain

SOFT, STIFF = IsotropicElasticity(1000.0, 0.3), IsotropicElasticity(5000.0, 0.25, 1e-5)


def dragged() -> Scene:
    """Two blocks whose meshes do not match, across a gap, dragged over a rigid floor: mortar and friction."""
    lower = Body(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 3, 2)), SOFT)
    upper = Body(block((0.1, 0.1, 1.01), (1.9, 0.9, 2.0), (5, 4, 2)), STIFF)
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return Scene(
        {"lower": lower, "upper": upper},
        [Support("upper", "z1", (0.05, 0.02, -0.05))],
        [gravity("lower", 1.0, (0.0, 0.0, -2.0))],
        [
            ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.3), "mortar"),
            ContactPair(Surface("lower", "z0"), floor, Coulomb(0.5)),
        ],
    )


def tied() -> Scene:
    """Two tied blocks, warmed; their supports share an edge, and hold nodes of the tie."""
    lower = Body(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 3, 2)), SOFT)
    upper = Body(block((0.0, 0.0, 1.0), (2.0, 1.0, 2.0), (5, 4, 2)), STIFF)
    supports = [
        Support("lower", "z0"),
        Support("lower", "x0", (0.0, None, None)),
        Support("upper", "y0", (None, 0.0, None)),
    ]
    loads = [Traction("upper", "z1", (0.3, 0.1, -1.0)), ThermalStrain("upper", 20.0)]
    return Scene(
        {"lower": lower, "upper": upper},
        supports,
        loads,
        ties=[Tie(Surface("upper", "z0"), Surface("lower", "z1"))],
    )


def pinched() -> Scene:
    """Two plane plates far from the origin, one upon the other, pressed and pushed."""
    lower = Body(rectangle((50.0, 20.0), (53.0, 21.0), (6, 3)), PlaneStrain(100.0, 0.3))
    upper = Body(rectangle((50.5, 21.0), (52.5, 22.0), (5, 3)), PlaneStrain(100.0, 0.3))
    return Scene(
        {"lower": lower, "upper": upper},
        [Support("lower", "y0", (0.0, 0.0)), Support("upper", "x0", (0.01, None))],
        [Pressure("upper", "y1", 2.0)],
        [ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(0.4), discretisation="node")],
    )


def turned() -> Scene:
    """A block that a force beside it bends and turns."""
    body = Body(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), SOFT)
    return Scene({"bar": body}, [Support("bar", "x0")], [TotalForce("bar", "x1", GIVEN, MOMENT, BESIDE)])


#: Of the scene "turned".
GIVEN, MOMENT, BESIDE = (0.3, 0.1, -1.0), (0.5, -0.2, 0.1), (2.5, 3.0, 0.0)
SCENES = {"dragged": dragged, "tied": tied, "pinched": pinched, "turned": turned}


def solved(scene: Scene, comm: MPI.Comm, tolerance: float = 1e-10) -> State:
    """Return the state with two subdomains a body."""
    cut = {name: box_partition(body.mesh, (2, *[1] * (scene.dim - 1))) for name, body in scene.bodies.items()}
    return solve_scene(scene, comm, partitions=cut, tolerance=tolerance)


def numbers(state: State) -> dict[str, list[float]]:
    """Return all forces and moments of a state. Collective."""
    pairs, balance = state.resultants(), state.balance()
    groups = {
        "reactions": list(state.reactions()),
        "pairs": [*pairs.contacts, *pairs.ties],
        "balance": list(balance.parts.values()),
    }
    found = {
        name: [
            float(value)
            for each in group
            for value in (*each.force, *np.atleast_1d(each.moment), *each.about)
        ]
        for name, group in groups.items()
    }
    return {**found, "scales": [balance.force_scale, balance.moment_scale], "off": [balance.imbalance]}


def main(comm: MPI.Comm) -> None:
    everywhere = {name: comm.allgather(numbers(solved(SCENES[name](), comm))) for name in sys.argv[1:]}
    if comm.rank == 0:
        sys.stdout.write(json.dumps(everywhere))


if __name__ == "__main__":
    main(MPI.COMM_WORLD)
