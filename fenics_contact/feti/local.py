"""The operators of one subdomain in the dual method: flexibility and stiffness on its interface."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.factor import fixing_nodes

#: Singular values of the kernel's trace on an interface below this count as zero: the modes have length one.
RANK_TOLERANCE = 1e-6


class LocalOperator(Protocol):
    """A factored subdomain. Its *interface* are the dofs that B touches.

    With K⁺ a symmetric generalised inverse of the stiffness K and S the Schur complement of K on the
    interface b.
    """

    def flex(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force, shape (n_b,), into ``displacement``."""

    def stiffen(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, or a close approximation, times an interface displacement into ``force``."""

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and the interface force for it.

        Both in double precision.

        Args:
            displacement: w of the interface, shape (n_b,).

        Returns:
            The displacement, w itself on the interface and −K_ii⁻¹ K_ib w inside, shape (n,), and S w, shape
            (n_b,).
        """

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,)."""

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,)."""


def interface_dofs(touched: np.ndarray, kernel: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the dofs that B touches, and a few more if fixing these does not prevent rigid motions.

    With the interface fixed the inside must have no rigid motion, or K_ii would be singular.

    Args:
        touched: Marks of the dofs, shape (n,).
        kernel: Columns that span the kernel of K, shape (n, n_modes).
        points: Coordinates by block of dim dofs, shape (n / dim, dim).
    """
    modes, _ = np.linalg.qr(kernel)
    trace = np.linalg.svd(modes[touched], compute_uv=False)
    # A body on an elastic bed may have no contact at all, but the interface must not be empty.
    if not touched.any() or np.count_nonzero(trace > RANK_TOLERANCE) < kernel.shape[1]:
        touched = touched.copy()
        touched.reshape(points.shape)[fixing_nodes(points)] = True
    return np.flatnonzero(touched)
