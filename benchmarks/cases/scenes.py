"""The block that several cases share."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.cases.scene_data import (
    BORE,
    BORES,
    LOWER,
    PLANE_HEIGHT,
    POISSON_RATIO,
    TRACTION,
    UPPER,
    YOUNG_MODULUS,
    Counts,
)
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    read_cad,
    readers,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity


def block_mesh(counts: Counts) -> BodyMesh:
    """Mesh the block [0, 2] x [0, 1] x [0, 1]."""
    return block(LOWER, UPPER, counts)


def drilled_block(size: float) -> BodyMesh:
    """Mesh the block with two bores by tetrahedra, as a part of a CAD file.

    Args:
        size: Largest edge of a tetrahedron.
    """
    with tempfile.TemporaryDirectory() as folder, readers.gmsh_model("part") as gmsh:
        cad, path = gmsh.model.occ, Path(folder) / "part.brep"
        solid = (3, cad.addBox(*LOWER, *(b - a for a, b in zip(LOWER, UPPER, strict=True))))
        bores = [(3, cad.addCylinder(*start, *axis, BORE / 2)) for start, axis in BORES]
        cad.cut([solid], bores)
        cad.synchronize()
        gmsh.write(str(path))
        corners = (("x0", LOWER, 0), ("z0", LOWER, 2), ("z1", UPPER, 2))
        faces = {name: readers.OnPlane(corner, np.eye(3)[axis]) for name, corner, axis in corners}
        (mesh,) = read_cad(path, size, surfaces=faces).values()
    return mesh


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
