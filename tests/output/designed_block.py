"""A block whose lid two nets of control points can move, and a plane one; nothing is solved."""

from __future__ import annotations

from functools import cache

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, Scene, ShapeProblem, Support, SurfaceDesign, Traction
from fenics_contact.design import StrainEnergy
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain


@cache
def lid(dim: int = 3, cell: str = "hexahedron", *, on_all_ranks: bool = False) -> ShapeProblem:
    """The upper side of a block of 4 × 2 × 1, or of 4 × 1, moves by 4 × 3 control points, or by 4."""
    if dim == 3:
        mesh, material = block((0, 0, 0), (4, 2, 1), (8, 4, 2), cell), IsotropicElasticity(100.0, 0.3)
    else:
        mesh, material = rectangle((0, 0), (4, 1), (8, 2)), PlaneStrain(100.0, 0.3)
    comm = MPI.COMM_WORLD if on_all_ranks else MPI.COMM_SELF
    low, top = ("z0", "z1") if dim == 3 else ("y0", "y1")
    load = [0.0] * (dim - 1) + [-1.0]
    scene = Scene({"pad": Body(mesh, material)}, [Support("pad", low)], [Traction("pad", top, tuple(load))])
    design = SurfaceDesign("pad", top, net=(4, 3) if dim == 3 else 4)
    return ShapeProblem(ContactProblem(scene, comm), design, StrainEnergy())


def variables(dim: int = 3) -> np.ndarray:
    return 0.1 * np.random.default_rng(3).uniform(-1.0, 1.0, 12 if dim == 3 else 4)
