"""Results in forms of the user's own: a pressed block on a floor, run under mpirun; prints the integrals."""

from __future__ import annotations

import json

import ufl
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import quadratic

import dolfinx.fem  # isort: skip

PRESSURE, SHEAR = 2.0, 0.1
E, NU = 1000.0, 0.25


def integrals(comm: MPI.Comm, order: int = 1) -> dict[str, float]:
    """What a user integrates over the block: volume, stress by an own formula, work, contact force."""
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    parts = {"block": box_partition(mesh, (4, 1, 1))}
    scene = Scene(
        {"block": Body(mesh if order == 1 else quadratic(mesh), IsotropicElasticity(E, NU))},
        [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))],
        [Traction("block", "z1", (SHEAR, 0.0, -PRESSURE))],
        [ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))],
    )
    state = solve_scene(scene, comm, partitions=parts, tolerance=1e-9)
    fields = state.displacement, state.contact_pressure, state.von_mises
    u, pressure, von_mises = (field["block"] for field in fields)
    strain = ufl.sym(ufl.grad(u))
    stress = E / (1 + NU) * (strain + NU / (1 - 2 * NU) * ufl.tr(strain) * ufl.Identity(3))
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    dx, normal = ufl.dx(degree=4), ufl.FacetNormal(u.function_space.mesh)
    forms = {
        "vertical stress": stress[2, 2] * dx,
        "elastic energy": 0.5 * ufl.inner(stress, strain) * dx,
        "von Mises": von_mises * dx,
        "own von Mises": ufl.sqrt(1.5 * ufl.inner(deviator, deviator)) * dx,
        "contact force": ufl.conditional(normal[2] < -0.5, pressure, 0.0) * ufl.ds(degree=4),
    }
    found = {
        name: comm.allreduce(dolfinx.fem.assemble_scalar(dolfinx.fem.form(form)))
        for name, form in forms.items()
    }
    return {**found, "energy of the state": state.energies.strain}


if __name__ == "__main__":
    for order in (1, 2):
        answer = integrals(MPI.COMM_WORLD, order)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(answer))
