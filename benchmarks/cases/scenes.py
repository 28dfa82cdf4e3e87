"""The block that several cases share."""

from __future__ import annotations

from benchmarks.cases.scene_data import (
    LOWER,
    PLANE_HEIGHT,
    POISSON_RATIO,
    TRACTION,
    UPPER,
    YOUNG_MODULUS,
    Counts,
)
from fenics_contact import Body, BodyMesh, ContactPair, Coulomb, RigidPlane, Scene, Support, Surface, Traction
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity


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
