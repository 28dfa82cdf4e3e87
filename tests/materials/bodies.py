"""Small bodies of every cell type: bent blocks and plates, some in two regions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, Material, PlaneStrain
from tests.materials.elements import PLANE


def box(cell: str, counts: tuple[int, int, int] = (4, 2, 2)) -> BodyMesh:
    """A block of 2 x 1 x 1, in the plane a rectangle of 2 x 1."""
    if cell in PLANE:
        return rectangle((0, 0), (2, 1), counts[:2], cell)
    return block((0, 0, 0), (2, 1, 1), counts, cell)


def bent(mesh: BodyMesh, size: float = 0.1) -> BodyMesh:
    """The same with nodes moved smoothly, so that no cell and no face is like another."""
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    shift = np.stack([np.sin(2 * y) * x, np.cos(x) * y, x * y], axis=1)[:, : mesh.dim]
    return mesh.moved(mesh.points + size * shift)


def in_halves(mesh: BodyMesh, at: float = 1.0) -> BodyMesh:
    """The same in the regions "left" and "right" of x = ``at``."""
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < at
    return replace(mesh, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})


def steel(dim: int, young: float = 100.0, expansion: float | None = None) -> Material:
    """An isotropic material for the dimension."""
    return (PlaneStrain if dim == 2 else IsotropicElasticity)(young, 0.3, expansion)
