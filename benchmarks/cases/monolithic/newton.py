"""Semismooth Newton on the whole block, each step by a sparse LU factorisation of MUMPS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from benchmarks.cases.monolithic.contact_law import ContactEquations, contact_equations
from benchmarks.cases.monolithic.elasticity import PressedBlock

MAX_STEPS = 60
#: c of the contact equations relative to the diagonal of K. From 0.2 on the active set cycles; at 92 thousand
#: unknowns 0.1 takes 13 steps and 0.05 takes 9.
AUGMENTATION = 0.05


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The solved block.

    Attributes:
        displacement: u.
        force: What the plane exerts on this rank's contact nodes, shape (n, 3).
        contact: Status of these nodes.
        steps: Newton steps, one factorisation each.
        residual: Largest of the contact residual relative to the normal forces and the equilibrium residual
            relative to the load.
    """

    displacement: PETSc.Vec
    force: np.ndarray
    contact: ContactEquations
    steps: int
    residual: float


def solve_newton(block: PressedBlock, friction_coefficient: float, tolerance: float = 1e-6) -> Equilibrium:
    """Solve K u = f + p with p = 0 off the contact nodes and C(p, u) = 0 on them. Collective.

    The forces are eliminated, p = K u − f, so that the matrix has the size of K: rows of contact nodes become
    ∂C/∂p K + ∂C/∂u. Its pattern never changes, hence one symbolic analysis for all steps.

    Args:
        block: The assembled block.
        friction_coefficient: μ.
        tolerance: Of both relative residuals.

    Raises:
        RuntimeError: If the steps are used up.

    References:
        S. Hüeber, G. Stadler, B. Wohlmuth, A primal-dual active set algorithm for three-dimensional contact
        problems with Coulomb friction, SIAM J. Sci. Comput. 30 (2008).
    """
    K, rows = block.stiffness, _ContactRows(block)
    u, r, step = (K.createVecRight() for _ in range(3))
    stiffness = AUGMENTATION * K.getDiagonal().array_r.reshape(-1, 3)[block.nodes].mean(axis=1)
    load = block.load.norm()
    lu: PETSc.KSP | None = None
    for count in range(MAX_STEPS + 1):
        K.mult(u, r)
        r.axpy(-1.0, block.load)
        force = r.array_r.reshape(-1, 3)[block.nodes]
        moved = u.array_r.reshape(-1, 3)[block.nodes]
        contact = contact_equations(force, moved, block.gap, friction_coefficient, stiffness)
        r.array_w.reshape(-1, 3)[block.nodes] = contact.value
        residual = _residual(r, block.nodes, force, load)
        if residual <= tolerance:
            return Equilibrium(u, force, contact, count, residual)
        jacobian = rows.jacobian(contact)
        lu = lu or _factorisation(jacobian)
        lu.solve(r, step)
        u.axpy(-1.0, step)
    raise RuntimeError(
        f"Newton needs residuals below {tolerance:.1e}, got {residual:.1e} after {MAX_STEPS} steps: "
        "refine the mesh less or lower the friction"
    )


class _ContactRows:
    """Replaces the rows of K that belong to contact nodes, with matrices that are allocated once."""

    def __init__(self, block: PressedBlock) -> None:
        self._K, self._nodes = block.stiffness, block.nodes
        n = self._K.getLocalSize()[0] // 3
        width = np.ones((n, 3), dtype=PETSc.IntType)
        width[self._nodes] = 3
        self._indptr = np.concatenate([[0], np.cumsum(width.ravel())]).astype(PETSc.IntType)
        row = self._K.getOwnershipRange()[0] + np.arange(3 * n).reshape(n, 3)
        columns = np.repeat(row.ravel(), width.ravel())
        self._entries = self._indptr[3 * self._nodes][:, None] + np.arange(9)
        columns[self._entries] = np.tile(row[self._nodes], 3)
        self._columns = columns.astype(PETSc.IntType)
        self._jacobian: PETSc.Mat | None = None

    def jacobian(self, contact: ContactEquations) -> PETSc.Mat:
        """Return ∂C/∂p K + ∂C/∂u, other rows as in K; the same matrix at each call. Collective."""
        by_force = self._blocks(contact.by_force, 1.0)
        by_displacement = self._blocks(contact.by_displacement, 0.0)
        self._jacobian = by_force.matMult(self._K, result=self._jacobian)
        self._jacobian.axpy(1.0, by_displacement, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        return self._jacobian

    def _blocks(self, values: np.ndarray, elsewhere: float) -> PETSc.Mat:
        """Return a block-diagonal matrix with ``elsewhere`` on the rows of other nodes."""
        data = np.full(len(self._columns), elsewhere)
        data[self._entries] = values.reshape(-1, 9)
        sizes = self._K.getSizes()
        return PETSc.Mat().createAIJ(sizes, csr=(self._indptr, self._columns, data), comm=self._K.comm)


def _factorisation(matrix: PETSc.Mat) -> PETSc.KSP:
    """Return a direct solver that refactors whenever the numbers of the matrix have changed."""
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(7, 5)  # METIS
    factor.setMumpsIcntl(6, 0)  # no column permutation: it would depend on the numbers of the first step
    factor.setMumpsIcntl(14, 50)  # room for pivoting, per cent
    return ksp


def _residual(r: PETSc.Vec, nodes: np.ndarray, force: np.ndarray, load: float) -> float:
    comm = r.comm.tompi4py()
    contact = r.array_r.reshape(-1, 3)[nodes]
    parts = (contact, r.array_r, force[:, 2])
    squares = np.array([np.sum(part**2) for part in parts])
    squares[1] -= squares[0]
    distance, unbalanced, normal = np.sqrt(np.maximum(comm.allreduce(squares), 0.0))
    return max(distance / max(normal, 1e-10 * load), unbalanced / load)
