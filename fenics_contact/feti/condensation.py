"""Schur complements of subdomains on their interface, and their Cholesky factors."""

from __future__ import annotations

import ctypes
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from fenics_contact._base.libraries import PETSc
from fenics_contact._base.sparse import dispose_with
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.factor import ONE_LAYER, Factor, petsc_call, symmetric_matrix


class Condensation:
    """S = K_bb − K_bi K_ii⁻¹ K_ib by MUMPS, which factors K_ii and forms S in one pass.

    The ordering and the symbolic factorisation are computed once; each call only refills the values.
    """

    def __init__(self, pattern: sp.csr_matrix, interface: np.ndarray) -> None:
        """Prepare for symmetric matrices with the sparsity of ``pattern``."""
        self._size, self._interface = len(interface), interface
        self._structure = (pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType))
        self._matrix = symmetric_matrix(pattern)
        self._pc = PETSc.PC().create(PETSc.COMM_SELF)
        self._pc.setOperators(self._matrix)
        self._pc.setType(PETSc.PC.Type.CHOLESKY)
        self._pc.setFactorSolverType("mumps")
        self._pc.setFactorSetUpSolverType()
        self._factor = self._pc.getFactorMatrix()
        self._factor.setMumpsIcntl(7, 5)  # ICNTL(7) = 5: nested dissection by METIS
        self._rows = PETSc.IS().createGeneral(interface.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        petsc_call("MatFactorSetSchurIS", self._factor.handle, self._rows.handle)
        dispose_with(self, self._rows, self._factor, self._pc, self._matrix)

    def __call__(self, stiffness: sp.csr_matrix) -> np.ndarray:
        """Return S of a matrix with the pattern, shape (n_b, n_b), Fortran order."""
        # MUMPS treats pivots below about 1e-16 as zero here: results would depend on the units of length and
        # force. Scaling by a power of two is exact.
        unit = 2.0 ** np.round(np.log2(stiffness.diagonal().max()))
        self._matrix.setValuesCSR(*self._structure, stiffness.data / unit)
        self._matrix.assemble()
        self._pc.setUp()
        if self._factor.getMumpsInfog(1) < 0:
            return self._by_factor(stiffness)
        return unit * self._schur_complement()

    def _by_factor(self, stiffness: sp.csr_matrix) -> np.ndarray:
        """Return S by factors of K_ii: MUMPS may take too little memory where hardly a dof lies inside."""
        inside = np.ones(stiffness.shape[0], dtype=bool)
        inside[self._interface] = False
        between = stiffness[inside][:, self._interface]
        inner = Factor.of_stiffness(stiffness[inside][:, inside].tocsr())
        bent = inner.solve_many(between.toarray(order="F"))
        own = stiffness[self._interface][:, self._interface].toarray(order="F")
        return np.asfortranarray(own - between.T @ bent)

    def _schur_complement(self) -> np.ndarray:
        # petsc4py does not wrap this yet, so PETSc's own library is called.
        matrix, status = ctypes.c_void_p(), ctypes.c_int()
        values = ctypes.POINTER(ctypes.c_double)()
        factor = self._factor.handle
        petsc_call("MatFactorGetSchurComplement", factor, ctypes.byref(matrix), ctypes.byref(status))
        petsc_call("MatDenseGetArrayRead", matrix, ctypes.byref(values))
        schur = np.array(np.ctypeslib.as_array(values, shape=(self._size, self._size))).T
        petsc_call("MatDenseRestoreArrayRead", matrix, ctypes.byref(values))
        petsc_call("MatFactorRestoreSchurComplement", factor, ctypes.byref(matrix), status)
        return schur


class Condensations:
    """Keeps the last condensation for matrices with the same pattern and interface.

    Subdomains of a regular partition share one pattern and a handful of interfaces: those that share both
    should come one after the other. A workspace takes 15 to 50 MB, so no other is kept.
    """

    def __init__(self) -> None:
        """Start empty."""
        self._last: tuple[tuple[bytes, bytes, bytes], Condensation] | None = None
        self.analysed = 0

    def schur_complement(self, stiffness: sp.csr_matrix, interface: np.ndarray) -> np.ndarray:
        """Return the Schur complement of ``stiffness`` on the dofs ``interface``, shape (n_b, n_b)."""
        if len(interface) == stiffness.shape[0]:
            return stiffness[interface][:, interface].toarray(order="F")
        key = (stiffness.indptr.tobytes(), stiffness.indices.tobytes(), interface.tobytes())
        if self._last is None or self._last[0] != key:
            self._last = None  # before the next one is made
            self._last = key, Condensation(stiffness, interface)
            self.analysed += 1
        return self._last[1](stiffness)


class RegularFactor(NamedTuple):
    """The lower Cholesky factor of S + ρ Q Qᵀ.

    `modes`: Q, orthonormal; `rho`: ρ; `least`: about the least eigenvalue of the matrix scaled to a diagonal
    of ones.
    """

    lower: np.ndarray
    modes: np.ndarray
    rho: float
    least: float


def regular_factor(
    schur: np.ndarray, kernel: np.ndarray, typical: float, rounded: float = 2e-15
) -> RegularFactor:
    """Return the Cholesky factor of S + ρ Q Qᵀ, overwriting ``schur``.

    Q is the trace of the kernel on the interface, orthonormal, shape (n_b, n_modes). ρ is the largest
    diagonal entry of S. Where that is rounding compared with the typical stiffness, every displacement of the
    interface is a rigid motion, as in a statically determinate body. `rounded`: least eigenvalue of the
    scaled matrix that is rounding. A motion without energy has 1e-17 to 2e-15, whatever the nodes that it
    moves; cells of aspect 1000 have 1e-14.
    """
    modes, _ = np.linalg.qr(kernel)
    largest = schur.diagonal().max()
    rho = largest if largest > 1e-12 * typical else typical
    filled = blas.dsyrk(rho, modes, beta=1.0, c=schur, lower=1, overwrite_c=1)
    diagonal = filled.diagonal().copy()
    factor, failed = lapack.dpotrf(filled, lower=1, overwrite_a=1)
    # Where a motion has no energy its pivot is rounding, which may be positive.
    least = 0.0 if failed else _least_eigenvalue(factor, diagonal)
    if least <= rounded:
        row = failed or int((factor.diagonal() ** 2 / diagonal).argmin()) + 1
        raise InvalidInputError(
            "the stiffness of every subdomain must be positive definite up to its kernel, but loses it in "
            f"row {row}: check the material and kernel of the model; {ONE_LAYER}"
        )
    return RegularFactor(factor, modes, float(rho), least)


def _least_eigenvalue(factor: np.ndarray, diagonal: np.ndarray, sweeps: int = 2) -> float:
    """Return about the least eigenvalue of a matrix scaled to a diagonal of ones, by its Cholesky factor."""
    scale, vector = np.sqrt(diagonal), np.random.default_rng(0).standard_normal(len(diagonal))
    for _ in range(sweeps):
        vector = scale * lapack.dpotrs(factor, scale * vector / np.linalg.norm(vector), lower=1)[0]
    return float(1.0 / np.linalg.norm(vector))


def pieces(work: np.ndarray, most: int) -> list[slice]:
    """Return consecutive slices of items whose work sums up to about ``most`` each; integers, shape (n,)."""
    piece = (np.cumsum(work) - work) // most
    starts = np.flatnonzero(np.diff(piece, prepend=-1)).tolist()
    return [slice(start, end) for start, end in pairwise([*starts, len(work)])]
