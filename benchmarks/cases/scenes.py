"""The scenes that the cases share."""

from __future__ import annotations

from mpi4py import MPI

from benchmarks.cases.scene_data import (
    LOWER,
    PLANE_HEIGHT,
    POISSON_RATIO,
    TRACTION,
    UPPER,
    YOUNG_MODULUS,
    Counts,
)
from fenics_contact.geometry import BodyMesh, LinkShape, TwoLinks, block, two_links
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    IsotropicElasticity,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
)


def chain_links(cells: Counts, comm: MPI.Comm) -> TwoLinks:
    """Mesh the two links with gmsh, with that many cells around, through and across each."""
    around, through, across = cells
    return two_links(LinkShape(n_around=around, n_a=through, n_b=across), comm=comm)


def chain(links: TwoLinks, friction_coefficient: float) -> Scene:
    """Return the chain of the demo: link 1 is held, link 2 hangs in it and is pulled with 80 kN, [N, mm]."""
    steel = IsotropicElasticity(2.1e5, 0.3)
    pair = ContactPair(
        slave=Surface("link 2", "contact"),
        master=Surface("link 1", "contact"),
        friction=Coulomb(friction_coefficient),
    )
    return Scene(
        bodies={"link 1": Body(links.first.mesh, steel), "link 2": Body(links.second.mesh, steel)},
        supports=[Support("link 1", "grip")],
        loads=[TotalForce("link 2", "grip", (80e3, 0.0, 0.0))],
        contacts=[pair],
    )


def block_mesh(counts: Counts) -> BodyMesh:
    """Mesh the block [0, 2] x [0, 1] x [0, 1]."""
    return block(LOWER, UPPER, counts)


def block_on_plane(mesh: BodyMesh, friction_coefficient: float = 0.0) -> Scene:
    """Return a block that is clamped at one end and pressed and dragged over a rigid plane."""
    return Scene(
        bodies={"block": Body(mesh, IsotropicElasticity(YOUNG_MODULUS, POISSON_RATIO))},
        supports=[Support("block", "x0")],
        loads=[Traction("block", "z1", TRACTION)],
        contacts=[
            ContactPair(
                Surface("block", "z0"),
                RigidPlane((0.0, 0.0, PLANE_HEIGHT), (0.0, 0.0, 1.0)),
                Coulomb(friction_coefficient) if friction_coefficient else None,
            )
        ],
    )
