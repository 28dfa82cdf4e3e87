"""A subdomain stored as sparse factors: each application is a forward and a backward substitution."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.factor import Factor, regularised
from fenics_contact.feti.subdomain import Subdomain


class Inverse(Protocol):
    """The inverse of a matrix of order n by its factors."""

    def solve(self, right: np.ndarray, out: np.ndarray) -> None:
        """Write the solution for one right side, shape (n,), into ``out``."""

    def solve_many(self, right: np.ndarray) -> np.ndarray:
        """Return the solutions for the columns of ``right``, shape (n, k)."""


class FactoredOperator:
    """The inverse of a stiffness by its factors, and its Schur complement by those of the inside.

    Cheap to set up, and small where the interface is large.
    """

    def __init__(
        self, stiffness: sp.csr_matrix, interface: np.ndarray, whole: Inverse, inside: Inverse | None
    ) -> None:
        """Keep the factors and the blocks that couple the interface.

        Args:
            stiffness: Of the subdomain, shape (n, n).
            interface: Interface dofs b, shape (n_b,).
            whole: Inverse of the stiffness, or of one that is held.
            inside: Inverse on all other dofs; None without any.
        """
        self._interface, self._factor, self._inside = interface, whole, inside
        self._rest = dofs_inside(stiffness, interface)
        rows = stiffness[interface]
        self._K_bb, self._K_bi = rows[:, interface].tocsr(), rows[:, self._rest].tocsr()
        self._K_ib = self._K_bi.T  # shares its memory
        self._right, self._left = np.zeros(stiffness.shape[0]), np.zeros(stiffness.shape[0])
        self._inner = np.zeros(len(self._rest))

    def flex(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write the inverse on the interface times a force there into ``displacement``."""
        self._right[self._interface] = force
        self._factor.solve(self._right, self._left)
        displacement[:] = self._left[self._interface]

    def stiffen(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write the Schur complement times an interface displacement into ``force``."""
        force[:], pulled = self._forces(displacement)
        if self._inside is not None:
            self._inside.solve(pulled, self._inner)
            force -= self._forces_from_inside(self._inner)

    def _forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces of an interface displacement, on the interface and inside."""
        return self._K_bb @ displacement, self._K_ib @ displacement

    def _forces_from_inside(self, displacement: np.ndarray) -> np.ndarray:
        """Return the forces on the interface of a displacement inside."""
        return np.asarray(self._K_bi @ displacement)

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement in equilibrium inside for one of the interface, and its force there."""
        self.stiffen(displacement, force := np.empty_like(displacement))
        whole = np.empty(len(self._right))
        whole[self._interface] = displacement
        whole[self._rest] = -self._inner
        return whole, force

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return the inverse times a vector, shape (n,)."""
        solution = np.empty_like(right)
        self._factor.solve(right, solution)
        return solution

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ K⁻¹ b for each row b of a matrix with interface columns, shape (n_rows,)."""
        right = np.zeros((len(self._right), rows.shape[0]))
        right[self._interface] = rows.toarray().T
        return np.asarray(np.einsum("nk,nk->k", right, self._factor.solve_many(right)))


class ImplicitOperator(FactoredOperator):
    """K⁺ by a sparse Cholesky factor of the regularised stiffness, S by one of the inside."""

    def __init__(self, subdomain: Subdomain, interface: np.ndarray) -> None:
        """Factor a subdomain.

        Args:
            subdomain: Its stiffness and kernel.
            interface: Interface dofs b, shape (n_b,).
        """
        stiffness = subdomain.stiffness
        inside = dofs_inside(stiffness, interface)
        super().__init__(
            stiffness,
            interface,
            Factor(regularised(stiffness, subdomain.kernel, subdomain.points)),
            Factor(stiffness[inside][:, inside].tocsr()) if len(inside) else None,
        )


def dofs_inside(stiffness: sp.csr_matrix, interface: np.ndarray) -> np.ndarray:
    """Return the dofs that are not on the interface, ascending."""
    return np.setdiff1d(np.arange(stiffness.shape[0]), interface, assume_unique=True)
