"""The block on one distributed dolfinx mesh: stiffness, load and the nodes over the plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dolfinx.fem
import dolfinx.fem.petsc
import dolfinx.mesh
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from benchmarks.cases.scene_data import (
    LOWER,
    PLANE_HEIGHT,
    POISSON_RATIO,
    TRACTION,
    UPPER,
    YOUNG_MODULUS,
    Counts,
)
from fenics_contact import BodyMesh
from fenics_contact._dolfinx import rank_mesh
from fenics_contact.mesh import bisection_partition

#: Exact for trilinear hexahedra whose edges are parallel to the axes.
QUADRATURE = {"quadrature_degree": 2}


@dataclass(frozen=True, eq=False)
class PressedBlock:
    """K u = f + contact forces, with clamped rows and columns replaced by those of the identity.

    Attributes:
        stiffness: K, distributed by rows.
        load: f, zero on clamped rows.
        nodes: Owned nodes that may touch the plane, as blocks of three local rows, shape (n,).
        points: Where they are, shape (n, 3).
        gap: How far above the plane, shape (n,).
        space: Space of displacements; its mesh owns the communicator of the matrix, which must not be freed
            before.
    """

    stiffness: PETSc.Mat
    load: PETSc.Vec
    nodes: np.ndarray
    points: np.ndarray
    gap: np.ndarray
    space: Any


def assemble_block(comm: MPI.Comm, counts: Counts) -> PressedBlock:
    """Assemble the block with dolfinx. Collective.

    Args:
        comm: Communicator.
        counts: Cells along x, y and z.
    """
    return _assembled(dolfinx.mesh.create_box(comm, [LOWER, UPPER], counts, dolfinx.mesh.CellType.hexahedron))


def assemble_part(comm: MPI.Comm, mesh: BodyMesh) -> PressedBlock:
    """Assemble a block of any cells, its nodes and cells the same on every rank. Collective."""
    rank = bisection_partition(mesh, comm.size)
    return _assembled(rank_mesh(comm, mesh.points, mesh.cells, rank, mesh.cell_type))


def _assembled(mesh: Any) -> PressedBlock:
    V = _vector_space(mesh)
    a, L = _forms(mesh, V)
    clamped = dolfinx.fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[0], LOWER[0]))
    zero = dolfinx.fem.dirichletbc(np.zeros(3), clamped, V)
    K = dolfinx.fem.petsc.assemble_matrix(a, bcs=[zero])
    K.assemble()
    f = dolfinx.fem.petsc.assemble_vector(L)
    f.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    dolfinx.fem.petsc.set_bc(f, [zero])
    below = dolfinx.fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[2], LOWER[2]))
    nodes = np.setdiff1d(below, clamped)
    nodes = nodes[nodes < V.dofmap.index_map.size_local]
    points = V.tabulate_dof_coordinates()[nodes]
    return PressedBlock(K, f, nodes, points, points[:, 2] - PLANE_HEIGHT, V)


def _vector_space(mesh: Any) -> Any:
    if hasattr(dolfinx.fem, "functionspace"):
        return dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    return dolfinx.fem.VectorFunctionSpace(mesh, ("Lagrange", 1))


def _forms(mesh: Any, V: Any) -> tuple[Any, Any]:
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    lame = YOUNG_MODULUS * POISSON_RATIO / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO))
    shear = YOUNG_MODULUS / (2 * (1 + POISSON_RATIO))
    strain = ufl.sym(ufl.grad(u))
    stress = lame * ufl.tr(strain) * ufl.Identity(3) + 2 * shear * strain
    a = ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx(metadata=QUADRATURE)
    top = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], UPPER[2]))
    tags = dolfinx.mesh.meshtags(mesh, 2, np.sort(top), np.ones(len(top), dtype=np.int32))
    ds = ufl.Measure("ds", mesh, subdomain_data=tags, metadata=QUADRATURE)
    L = ufl.inner(dolfinx.fem.Constant(mesh, TRACTION), v) * ds(1)
    return dolfinx.fem.form(a), dolfinx.fem.form(L)
