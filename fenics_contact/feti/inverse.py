"""The generalised inverse of the torn stiffness and its kernel, subdomain by subdomain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.factor import Factor, regularised
from fenics_contact.feti.subdomain import Subdomain


class GeneralizedInverse:
    """K⁺ of this rank's subdomains: a Cholesky factor each, applied one after the other.

    Attributes:
        offset: First dof of each subdomain in the torn vector, and the total, shape (n + 1,).
    """

    def __init__(self, subdomains: Sequence[Subdomain]) -> None:
        """Factor every regularised K_s."""
        self.offset = np.cumsum([0] + [subdomain.mesh.size for subdomain in subdomains])
        self._factors = [Factor(regularised(s.stiffness, s.kernel, s.points)) for s in subdomains]

    def __call__(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a torn vector, shape (torn_size,)."""
        result = np.empty_like(right)
        for factor, start, stop in zip(self._factors, self.offset[:-1], self.offset[1:], strict=True):
            factor.solve(right[start:stop], result[start:stop])
        return result

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ K⁺ b for each row b of a matrix with torn columns, shape (n_rows,)."""
        flexibility = np.zeros(rows.shape[0])
        columns = rows.tocsc()
        for factor, start, stop in zip(self._factors, self.offset[:-1], self.offset[1:], strict=True):
            block = columns[:, start:stop].tocsr()
            touched = np.flatnonzero(np.diff(block.indptr))
            dense = block[touched].toarray().T
            flexibility[touched] += np.einsum("nk,nk->k", dense, factor.solve_many(dense))
        return flexibility


def kernel_matrix(
    subdomains: Sequence[Subdomain], total_modes: int, mode_offset: np.ndarray
) -> sp.csr_matrix:
    """Return R of this rank, shape (torn_size, total_modes): only columns of its own subdomains are filled.

    Args:
        subdomains: This rank's subdomains.
        total_modes: Number of kernel vectors of all subdomains of all ranks.
        mode_offset: First kernel vector of each of this rank's subdomains.
    """
    blocks = sp.block_diag([subdomain.kernel for subdomain in subdomains], format="coo")
    own = np.concatenate(
        [start + np.arange(s.kernel.shape[1]) for s, start in zip(subdomains, mode_offset, strict=True)]
    )
    shape = (blocks.shape[0], total_modes)
    return sp.csr_matrix((blocks.data, (blocks.row, own[blocks.col])), shape=shape)
