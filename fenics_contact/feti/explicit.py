"""A subdomain stored as two dense matrices on its interface: each application streams one of them once."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.factor import Factor
from fenics_contact.feti.subdomain import Subdomain

#: Entries of S below this fraction of those of K are rounding.
ROUNDED = 1e-12


class ExplicitOperator:
    """(K⁺)_bb and S as packed triangles; S, used only for preconditioning, in single precision.

    With the trace Q of the kernel on the interface, orthonormal, S + ρ Q Qᵀ is positive definite, and

        K⁺ = T diag(K_ii⁻¹, (S + ρ Q Qᵀ)⁻¹) Tᵀ,   T = [I, −K_ii⁻¹ K_ib; 0, I],

    is a symmetric generalised inverse of K. The application of a dense triangle is limited by memory
    bandwidth alone, and reads a half to a third of what substitutions with sparse factors read.
    """

    def __init__(self, subdomain: Subdomain, interface: np.ndarray, condensations: Condensations) -> None:
        """Condense a subdomain on its interface.

        Args:
            subdomain: Its stiffness and kernel.
            interface: Interface dofs b, shape (n_b,).
            condensations: Symbolic factorisations to reuse.

        Raises:
            InvalidInputError: If the stiffness is not positive semidefinite.
        """
        stiffness, self._interface = subdomain.stiffness, interface
        schur = condensations.schur_complement(stiffness, interface)
        self._unit = float(np.abs(schur).max(initial=0.0)) or 1.0
        self._stiff, _ = lapack.strttp((schur / self._unit).astype(np.float32, order="F"), uplo="L")
        self._flexible = _packed_inverse(schur, subdomain.kernel[interface], subdomain.typical_stiffness)
        self._size = len(interface)
        self._inside = np.setdiff1d(np.arange(subdomain.mesh.size), interface, assume_unique=True)
        rows = stiffness[self._inside]
        self._K_ib, self._K_bb = rows[:, interface].tocsr(), stiffness[interface][:, interface].tocsr()
        self._inner = Factor(rows[:, self._inside].tocsr()) if len(self._inside) else None

    def flex(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force into ``displacement``."""
        blas.dspmv(self._size, 1.0, self._flexible, force, y=displacement, overwrite_y=1, lower=1)

    def stiffen(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, rounded to single precision, times an interface displacement into ``force``.

        The range of single precision suffices neither for all units nor for diverging iterates: both factors
        are scaled.
        """
        size = float(np.abs(displacement).max(initial=0.0))
        if size == 0.0 or not np.isfinite(size):
            force[:] = size
            return
        scaled = (displacement / size).astype(np.float32)
        force[:] = blas.sspmv(self._size, 1.0, self._stiff, scaled, lower=1)
        force *= self._unit * size

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and S times the latter.

        By the sparse stiffness and the factor of the inside: S itself is stored in single precision only.
        """
        whole = np.empty(self._size + len(self._inside))
        whole[self._interface] = displacement
        whole[self._inside] = inner = -self._solve_inside(self._K_ib @ displacement)
        return whole, self._K_bb @ displacement + self._K_ib.T @ inner

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,)."""
        relaxed = self._solve_inside(right[self._inside])
        self.flex(right[self._interface] - self._K_ib.T @ relaxed, trace := np.empty(self._size))
        solution = np.empty_like(right)
        solution[self._interface] = trace
        solution[self._inside] = relaxed - self._solve_inside(self._K_ib @ trace)
        return solution

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,)."""
        counts = np.diff(rows.indptr)
        # All pairs of entries within each row: rows of B are short.
        pairs = np.repeat(counts, counts)
        first = np.repeat(np.arange(len(rows.indices)), pairs)
        starts = np.repeat(np.repeat(rows.indptr[:-1], counts), pairs)
        second = starts + np.arange(len(first)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
        i, j = rows.indices[first].astype(np.int64), rows.indices[second].astype(np.int64)
        low, high = np.minimum(i, j), np.maximum(i, j)
        entries = self._flexible[high + low * (2 * self._size - low - 1) // 2]
        row = np.repeat(np.arange(rows.shape[0]), counts)[first]
        return np.bincount(row, rows.data[first] * rows.data[second] * entries, minlength=rows.shape[0])

    def _solve_inside(self, right: np.ndarray) -> np.ndarray:
        """Return K_ii⁻¹ times a vector on the inside."""
        solution = np.zeros_like(right)
        if self._inner is not None and right.any():
            self._inner.solve(right, solution)
        return solution


def _packed_inverse(schur: np.ndarray, kernel: np.ndarray, typical: float) -> np.ndarray:
    """Return the packed lower triangle of (S + ρ Q Qᵀ)⁻¹, overwriting ``schur``.

    ρ is the largest diagonal entry of S. Where that is rounding compared with the typical stiffness, every
    displacement of the interface is a rigid motion, as in a statically determinate body.
    """
    modes, _ = np.linalg.qr(kernel)
    largest = schur.diagonal().max()
    rho = largest if largest > ROUNDED * typical else typical
    filled = blas.dsyrk(rho, modes, beta=1.0, c=schur, lower=1, overwrite_c=1)
    factor, failed = lapack.dpotrf(filled, lower=1, overwrite_a=1)
    if failed:
        raise InvalidInputError(
            "the stiffness of every subdomain must be positive definite up to its kernel, but its Schur "
            f"complement loses definiteness in row {failed}: check the material and the kernel of the model"
        )
    inverse, _ = lapack.dpotri(factor, lower=1, overwrite_c=1)
    packed, _ = lapack.dtrttp(inverse, uplo="L")
    return np.asarray(packed)
