"""The equilibrium constraint G lambda = e of the floating subdomains and the projector it defines."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.gram import GramInverse, SparseGramInverse
from fenics_contact.qp.reductions import Vector, global_sum

#: Up to this number of rigid motions the coarse matrices are dense and factored on every rank.
DENSE_LIMIT = 600

#: A matrix of size m: dense and summed over the ranks, or beyond the limit sparse, only this rank's share.
Gram: TypeAlias = Vector | sp.csr_matrix


class CoarseSpace:
    """Equilibrium of all rigid motions, G lambda = e, with P = I - G^T (G G^T)^-1 G.

    Column j of G holds the resultants of the j-th multiplier on every rigid motion. Columns are
    distributed like the multipliers; everything of length m (right side, coefficients) is replicated. The
    matrix G G^T is dense and factored on every rank while it is small; beyond `DENSE_LIMIT` it is sparse and
    factored on a few ranks, and every solution is broadcast. With m = 0 all methods are cheap and do nothing.

    Attributes:
        comm: Communicator over which the multipliers are distributed.
        matrix: This rank's columns of G, shape (m, n_owned), CSR.
        load: Right side e, shape (m,), replicated.
    """

    def __init__(
        self, comm: MPI.Comm, G: sp.spmatrix | sp.sparray, e: Vector, *, gram: Gram | None = None
    ) -> None:
        """Store this rank's columns.

        Args:
            comm: Communicator over which the multipliers are distributed.
            G: This rank's columns, sparse, shape (m, n_owned).
            e: Right side, shape (m,), the same on every rank.
            gram: The matrix G G^T as `gram_matrix` returns it, if known already.

        Raises:
            InvalidInputError: The shapes of G and e disagree.
        """
        self.comm = comm
        self.matrix = sp.csr_matrix(G, dtype=np.float64)
        self.load = np.asarray(e, dtype=np.float64)
        if self.load.shape != (self.matrix.shape[0],):
            raise InvalidInputError(
                f"e must have shape ({self.matrix.shape[0]},) like the rows of G, got {self.load.shape}: "
                "assemble both from the same list of floating subdomains"
            )
        self._transposed = self.matrix.T.tocsr()
        self._gram_matrix = gram

    @cached_property
    def gram(self) -> GramInverse | SparseGramInverse:
        """Generalised inverse of G G^T, factored on first access. Collective then."""
        gram = gram_matrix(self.comm, self.matrix) if self._gram_matrix is None else self._gram_matrix
        return GramInverse(gram) if isinstance(gram, np.ndarray) else SparseGramInverse(self.comm, gram)

    def with_load(self, load: Vector) -> CoarseSpace:
        """Return the coarse space of another load e, shape (m,), replicated; factors are shared."""
        other = copy(self)
        other.load = np.asarray(load, dtype=np.float64)
        return other

    @property
    def m(self) -> int:
        """Number of rigid motions, the rows of G."""
        return self.matrix.shape[0]

    def apply(self, x: Vector) -> Vector:
        """Return G x, shape (m,), replicated, for x owned. Collective."""
        return global_sum(self.comm, self.local(x)) if self.m else np.zeros(0)

    def local(self, x: Vector) -> Vector:
        """Return this rank's share of G x, shape (m,), to be summed over the ranks by the caller."""
        return self.matrix @ x

    def transpose(self, alpha: Vector) -> Vector:
        """Return G^T alpha, owned, for alpha of shape (m,) replicated."""
        return self._transposed @ alpha

    def solve(self, right_side: Vector) -> Vector:
        """Return (G G^T)^-1 times an array of shape (m,), replicated. Collective."""
        return self.gram.solve(right_side)

    def coefficients(self, x: Vector) -> Vector:
        """Return (G G^T)^-1 G x, shape (m,), replicated. Collective."""
        return self.solve(self.apply(x))

    def project(self, x: Vector) -> Vector:
        """Return P x = x - G^T (G G^T)^-1 G x, owned. Collective."""
        return x - self.transpose(self.coefficients(x))

    def particular(self) -> Vector:
        """Return the shortest multiplier in equilibrium, G^T (G G^T)^-1 e, owned."""
        return self.transpose(self.solve(self.load))

    def residual(self, x: Vector) -> Vector:
        """Return G x - e, shape (m,), replicated. Collective."""
        return self.apply(x) - self.load

    def norm(self, y: Vector) -> float:
        """Return the length of G^T (G G^T)^-1 y: a resultant measured in multipliers."""
        return float(np.sqrt(max(float(y @ self.solve(y)), 0.0)))

    def unresisted(self) -> Vector:
        """Return the part of e that no multiplier can balance, shape (m,), zero where G has full rank.

        Each null vector z of G G^T is a rigid motion that no row resists; z^T e is the work of the load on
        it.
        """
        null = self.gram.null_space
        if null.shape[1] == 0:
            return np.zeros(self.m)
        basis, _ = np.linalg.qr(null)
        return basis @ (basis.T @ self.load)

    def restricted(
        self, Z: sp.spmatrix | sp.sparray, load: Vector | None = None, *, gram: Gram | None = None
    ) -> CoarseSpace:
        """Return the coarse space G Z of a face with dofs y, multiplier = fixed + Z y.

        Args:
            Z: This rank's restriction, sparse, shape (n_owned, n_face).
            load: Right side for the face, e - G fixed, shape (m,), replicated; e itself by default.
            gram: The matrix G Z Z^T G^T as `gram_matrix` returns it, where known.
        """
        return CoarseSpace(self.comm, self.matrix @ Z, self.load if load is None else load, gram=gram)


def gram_matrix(comm: MPI.Comm, columns: sp.csr_matrix) -> Gram:
    """Return C C^T for owned columns C: the sum over the ranks, or beyond `DENSE_LIMIT` this rank's share.

    Matrices of the same size can be added in either form. Collective.
    """
    return summed_if_small(comm, (columns @ columns.T).tocsr())


def summed_if_small(comm: MPI.Comm, share: sp.csr_matrix) -> Gram:
    """Return the sum over the ranks, dense, up to `DENSE_LIMIT`; beyond it the share. Collective."""
    m = share.shape[0]
    return global_sum(comm, share.toarray()).reshape(m, m) if m <= DENSE_LIMIT else share
