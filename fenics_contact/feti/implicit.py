"""A subdomain stored as sparse factors: each application is a forward and a backward substitution."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.factor import Factor, regularised
from fenics_contact.feti.subdomain import Subdomain


class ImplicitOperator:
    """K⁺ by a sparse Cholesky factor of the regularised stiffness, S by one of the inside.

    Cheap to set up, and small where the interface is large.
    """

    def __init__(self, subdomain: Subdomain, interface: np.ndarray) -> None:
        """Factor a subdomain.

        Args:
            subdomain: Its stiffness and kernel.
            interface: Interface dofs b, shape (n_b,).
        """
        stiffness, size = subdomain.stiffness, subdomain.mesh.size
        self._interface = interface
        self._factor = Factor(regularised(stiffness, subdomain.kernel, subdomain.points))
        self._right, self._left = np.zeros(size), np.zeros(size)
        self._rest = inside = np.setdiff1d(np.arange(size), interface, assume_unique=True)
        rows = stiffness[interface]
        self._K_bb, self._K_bi = rows[:, interface].tocsr(), rows[:, inside].tocsr()
        self._K_ib = self._K_bi.T  # shares its memory
        self._inside = Factor(stiffness[inside][:, inside].tocsr()) if len(inside) else None
        self._inner = np.zeros(len(inside))

    def flex(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force into ``displacement``."""
        self._right[self._interface] = force
        self._factor.solve(self._right, self._left)
        displacement[:] = self._left[self._interface]

    def stiffen(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S times an interface displacement into ``force``."""
        force[:] = self._K_bb @ displacement
        if self._inside is not None:
            self._inside.solve(self._K_ib @ displacement, self._inner)
            force -= self._K_bi @ self._inner

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and S times the latter."""
        self.stiffen(displacement, force := np.empty_like(displacement))
        whole = np.empty(len(self._right))
        whole[self._interface] = displacement
        whole[self._rest] = -self._inner
        return whole, force

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,)."""
        solution = np.empty_like(right)
        self._factor.solve(right, solution)
        return solution

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,)."""
        right = np.zeros((len(self._right), rows.shape[0]))
        right[self._interface] = rows.toarray().T
        return np.asarray(np.einsum("nk,nk->k", right, self._factor.solve_many(right)))
