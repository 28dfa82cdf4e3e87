"""A plate on a roller whose edge is designed."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    RigidSphere,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    gallery,
    minimize_to,
)
from fenics_contact.design import StrainEnergy
from fenics_contact.materials import PlaneStrain

#: Bounds of the design variables.
BOX = (-0.02, 0.02)


def shaped(cell: str = "triangle", n: int = 5) -> ShapeProblem:
    """Half of a block on a roller, whose lower edge is designed to make it stiff."""
    mesh = gallery.rectangle((0, 0), (10, 10), (n, n), cell)
    scene = Scene(
        bodies={"block": Body(mesh, PlaneStrain(2.1e5, 0.3))},
        supports=[Support("block", "x0", (0.0, None))],
        loads=[TotalForce("block", "y1", (0.0, -2000.0))],
        contacts=[ContactPair(Surface("block", "y0"), RigidSphere((0, -40.0), 40.0))],
    )
    contact = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)
    return ShapeProblem(contact, SurfaceDesign("block", "y0", net=4), StrainEnergy())


def of_ranks(comm: MPI.Comm) -> str:
    """Return meshes and design in words, on the first rank."""
    problem = shaped()
    contact = ContactProblem(problem.scene, comm, tolerance=1e-8)
    given = ShapeProblem(contact, problem.designs, problem.objective)
    found = minimize_to(given, np.zeros(4), 0.1, bounds=BOX)
    words = f"{[level.cells for level in found.levels]} {found.value:.5g} {found.x.round(5).tolist()}"
    return words if comm.rank == 0 else ""
