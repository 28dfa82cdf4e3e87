"""A rubber disc pressed on a block of rubber, both thin sheets; writes forces and stresses as JSON."""

from __future__ import annotations

import json
import sys

from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, solve_scene
from fenics_contact.gallery import half_disc, rectangle
from fenics_contact.materials import HyperelasticPlaneStress, NeoHooke
from fenics_contact.mesh import bisection_partition


def disc_on_block(cells: int = 6) -> Scene:
    """A quarter of a disc of radius 1, pressed by a quarter of it."""
    soft, hard = (HyperelasticPlaneStress(NeoHooke(*each)) for each in ((1.0, 0.45), (2.0, 0.3)))
    disc = half_disc(1.0, cells, grading=0.5)
    block = rectangle((0.0, -1.0), (2.0, 0.0), (4 * cells, 2 * cells))
    return Scene(
        {"disc": Body(disc, soft), "block": Body(block, hard)},
        [
            Support("disc", "x0", (0.0, None)),
            Support("block", "x0", (0.0, None)),
            Support("block", "y0"),
            Support("disc", "top", (None, -0.25)),
        ],
        contacts=[ContactPair(Surface("disc", "contact"), Surface("block", "y1"), Coulomb(0.2))],
    )


def main() -> None:
    scene, comm = disc_on_block(), MPI.COMM_WORLD
    cut = {name: bisection_partition(body.mesh, 4) for name, body in scene.bodies.items()}
    state = solve_scene(scene, comm, partitions=cut, tolerance=1e-10)
    found = {
        "forces": state.contact.force.tolist(),
        "reaction": list(state.reactions()["block y0"].force),
        **{name: state.gather_stress(name).tolist() for name in scene.bodies},
    }
    if comm.rank == 0:
        sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
