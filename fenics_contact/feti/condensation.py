"""Schur complements of subdomain matrices: one symbolic factorisation for all that share a pattern."""

from __future__ import annotations

import ctypes
from collections import OrderedDict

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import PETSc
from fenics_contact.feti.factor import Factor, symmetric_matrix
from fenics_contact.feti.petsc_calls import petsc_call
from fenics_contact.linalg import dispose_with

#: Number of cached symbolic factorisations. Each also holds the values of its last matrix: a few MB.
CACHED = 8
#: MUMPS control parameter and its value for nested dissection by METIS.
ORDERING, METIS = 7, 5


class Condensation:
    """S = K_bb − K_bi K_ii⁻¹ K_ib by MUMPS, which factors K_ii and forms S in one pass.

    The ordering and the symbolic factorisation are computed once; each call only refills the values.
    """

    def __init__(self, pattern: sp.csr_matrix, interface: np.ndarray) -> None:
        """Prepare for symmetric matrices with the sparsity of ``pattern``.

        Args:
            pattern: Any matrix with the pattern, shape (n, n).
            interface: The dofs b, shape (n_b,).
        """
        self._size, self._interface = len(interface), interface
        self._structure = (pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType))
        self._matrix = symmetric_matrix(pattern)
        self._pc = PETSc.PC().create(PETSc.COMM_SELF)
        self._pc.setOperators(self._matrix)
        self._pc.setType(PETSc.PC.Type.CHOLESKY)
        self._pc.setFactorSolverType("mumps")
        self._pc.setFactorSetUpSolverType()
        self._factor = self._pc.getFactorMatrix()
        self._factor.setMumpsIcntl(ORDERING, METIS)
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
        bent = Factor(stiffness[inside][:, inside].tocsr()).solve_many(between.toarray(order="F"))
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
    """Caches the most recent condensations, by pattern and interface.

    Subdomains of a regular partition share one pattern and a handful of interfaces, and a new geometry
    changes neither.

    Attributes:
        analysed: Symbolic factorisations made so far.
    """

    def __init__(self) -> None:
        """Start empty."""
        self._recent: OrderedDict[tuple[bytes, bytes, bytes], Condensation] = OrderedDict()
        self.analysed = 0

    def schur_complement(self, stiffness: sp.csr_matrix, interface: np.ndarray) -> np.ndarray:
        """Return the Schur complement of ``stiffness`` on the dofs ``interface``, shape (n_b, n_b)."""
        if len(interface) == stiffness.shape[0]:
            return stiffness[interface][:, interface].toarray(order="F")
        key = (stiffness.indptr.tobytes(), stiffness.indices.tobytes(), interface.tobytes())
        if key not in self._recent:
            self._recent[key] = Condensation(stiffness, interface)
            self.analysed += 1
        self._recent.move_to_end(key)
        if len(self._recent) > CACHED:
            self._recent.popitem(last=False)
        return self._recent[key](stiffness)
