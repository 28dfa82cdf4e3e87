"""The equilibrium constraint G λ = e of floating subdomains, the projector it defines, and its inverses."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse as sp
from scipy.linalg import lapack

from fenics_contact._base.costs import count_flops
from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import SHIFT, SharedFactor
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.reductions import Vector, global_sum

#: Null vectors have eigenvalues below this fraction of the largest, in a matrix scaled to a unit diagonal.
RANK_TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class _Cholesky:
    """The inverse of a regular matrix by its lower Cholesky factor."""

    factor: Vector

    @property
    def flops(self) -> int:
        return 2 * len(self.factor) ** 2

    def solve(self, right_side: Vector) -> Vector:
        return scipy.linalg.cho_solve((self.factor, True), right_side, check_finite=False)


@dataclass(frozen=True, eq=False)
class _Root:
    """The generalised inverse R Rᵀ of a singular matrix."""

    root: Vector

    @property
    def flops(self) -> int:
        return 4 * self.root.size

    def solve(self, right_side: Vector) -> Vector:
        return self.root @ (self.root.T @ right_side)


class GramInverse:
    """Generalised inverse of S = G G^T, which may be rank deficient.

    S is scaled to unit diagonal first, because its rows mix translations and rotations. A well conditioned S
    is factored by Cholesky; otherwise its eigenvectors separate the null space, and the inverse acts on the
    complement. For any generalised inverse G^T S^- G is the same projector. `null_space`: columns z with S z
    = 0: motions that no multiplier resists.
    """

    def __init__(self, matrix: Vector) -> None:
        """Factor ``matrix`` of shape (m, m); only its values on this rank are used, no communication."""
        diagonal = np.diagonal(matrix)
        floor = RANK_TOLERANCE**2 * max(diagonal.max(initial=0.0), np.finfo(float).tiny)
        self._scale = 1.0 / np.sqrt(np.where(diagonal > floor, diagonal, 1.0))
        self.rank = len(matrix)
        self.null_space = np.zeros((len(matrix), 0))
        self._inner = self._factored(matrix)

    def _factored(self, matrix: Vector) -> _Cholesky | _Root:
        cholesky = _trusted_cholesky(_scaled(matrix, self._scale))
        if cholesky is not None:
            return _Cholesky(cholesky)
        if len(matrix) > DENSE_LIMIT:
            return self._filled(_scaled(matrix, self._scale))
        values, vectors = scipy.linalg.eigh(_scaled(matrix, self._scale))
        keep = values > RANK_TOLERANCE * values.max(initial=0.0)
        self.rank = int(keep.sum())
        self.null_space = self._scale[:, None] * vectors[:, ~keep]
        return _Root(vectors[:, keep] / np.sqrt(values[keep]))

    def _filled(self, scaled: Vector) -> _Cholesky:
        """Factor a large singular matrix with its null vectors filled, S + Z Zᵀ, which is regular."""
        shifted = scipy.linalg.lu_factor(scaled + SHIFT * np.eye(len(scaled)))
        null = _null_vectors(len(scaled), lambda columns: np.asarray(scipy.linalg.lu_solve(shifted, columns)))
        self.rank -= null.shape[1]
        self.null_space = self._scale[:, None] * null
        return _Cholesky(np.linalg.cholesky(scaled + null @ null.T))

    @property
    def flops(self) -> int:
        """Floating point operations of one solution on this rank."""
        return self._inner.flops

    def solve(self, right_side: Vector) -> Vector:
        """Apply the generalised inverse to an array of shape (m,) or (m, k)."""
        if right_side.size == 0:
            return np.zeros_like(right_side)
        scale = self._scale if right_side.ndim == 1 else self._scale[:, None]
        return scale * self._inner.solve(scale * right_side)


def _scaled(matrix: Vector, scale: Vector) -> Vector:
    """Return a matrix with scaled rows and columns, stored by columns as LAPACK overwrites it by factors."""
    scaled = np.multiply(scale[:, None], matrix, order="F")
    scaled *= scale
    return scaled


def _trusted_cholesky(matrix: Vector) -> Vector | None:
    """Overwrite a matrix by its lower Cholesky factor; None if it is singular or close to it."""
    if len(matrix) == 0:
        return np.zeros((0, 0))
    norm = lapack.dlange("1", matrix)
    factor, info = lapack.dpotrf(matrix, lower=1, overwrite_a=1)
    if info != 0:
        return None
    reciprocal_condition, _ = lapack.dpocon(factor, norm, uplo="L")
    return factor if reciprocal_condition > RANK_TOLERANCE else None


class SparseGramInverse:
    """Generalised inverse of S = Σ S_rank, which may be rank deficient; see `GramInverse`.

    Null vectors are computed by inverse iteration with a few vectors, which converges at once for a matrix
    that is singular to rounding.
    """

    def __init__(
        self, comm: MPI.Comm, share: sp.csr_matrix, factor_of: type[SharedFactor] = SharedFactor
    ) -> None:
        """Factor the sum of the ranks' shares, each of shape (m, m). Collective on ``comm``."""
        diagonal = global_sum(comm, share.diagonal())
        floor = RANK_TOLERANCE**2 * max(diagonal.max(initial=0.0), np.finfo(float).tiny)
        scale = 1.0 / np.sqrt(np.where(diagonal > floor, diagonal, 1.0))
        self._factor = factor_of(comm, share, scale)
        self._scale = scale
        self._null = _null_vectors(len(diagonal), self._invert_scaled)
        self.rank = len(diagonal) - self._null.shape[1]
        self.null_space = scale[:, None] * self._null

    @property
    def flops(self) -> int:
        """Floating point operations of one solution on this rank."""
        return self._factor.flops + 8 * self._null.size

    def solve(self, right_side: Vector) -> Vector:
        """Apply the generalised inverse to a replicated array of shape (m,). Collective."""
        if self._null.shape[1] == 0:
            return self._factor.solve(right_side)
        scaled = self._scale * right_side
        scaled = scaled - self._null @ (self._null.T @ scaled)
        solved = self._factor.solve(scaled / self._scale) / self._scale
        return self._scale * (solved - self._null @ (self._null.T @ solved))

    def _invert_scaled(self, columns: Vector) -> Vector:
        solved = [self._factor.solve(column / self._scale, refine=False) for column in columns.T]
        return np.column_stack(solved) / self._scale[:, None]


def _null_vectors(m: int, invert: Callable[[Vector], Vector]) -> Vector:
    """Return orthonormal null vectors of a scaled matrix of size m, whose shifted inverse is given."""
    count = min(8, m)  # a floating body has six null vectors
    while True:
        start = np.random.default_rng(0).standard_normal((m, count))
        basis, _ = np.linalg.qr(invert(start))
        inverse = basis.T @ invert(basis)
        largest, turn = np.linalg.eigh(0.5 * (inverse + inverse.T))
        null = largest > 1.0 / RANK_TOLERANCE
        if not null.all() or count == m:
            return np.asarray(basis @ turn[:, null])
        count = min(2 * count, m)


#: Up to this number of rigid motions the coarse matrices are dense and factored on every rank.
DENSE_LIMIT = 600

#: A matrix of size m: dense and summed over the ranks, or beyond the limit sparse, only this rank's share.
Gram: TypeAlias = Vector | sp.csr_matrix


@dataclass(frozen=True, eq=False)
class Composed:
    """A product of sparse matrices that is applied factor by factor: G Z of a face is as large as G."""

    factors: tuple[sp.spmatrix, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        return self.factors[0].shape[0], self.factors[-1].shape[1]

    def __matmul__(self, vector: Vector) -> Vector:
        """Apply it."""
        for factor in reversed(self.factors):
            vector = factor @ vector
        return vector

    @property
    def T(self) -> Composed:
        """The transposed one, which shares the memory."""
        return Composed(tuple(factor.T for factor in reversed(self.factors)))

    def from_column(self, first: int) -> sp.csr_matrix:
        """Return the columns from one on as a matrix."""
        left, right = self.factors
        return Csr(left @ right[:, first:])


class NoElimination:
    """Coarse matrices of faces stay as large as they are."""

    equality: npt.NDArray[np.int64] = np.zeros(0, dtype=np.int64)

    def __call__(self, comm: MPI.Comm, columns: sp.csr_matrix) -> None:
        """Return none."""


NO_ELIMINATION = NoElimination()


class CoarseSpace:
    """Equilibrium of all rigid motions, G lambda = e, with P = I - G^T (G G^T)^-1 G.

    Column j of G holds the resultants of the j-th multiplier on every rigid motion. Columns are distributed
    like the multipliers; everything of length m (right side, coefficients) is replicated. The matrix G G^T is
    dense and factored on every rank while it is small; beyond `DENSE_LIMIT` it is sparse and factored on a
    few ranks, and every solution is broadcast. With m = 0 all methods are cheap and do nothing. `matrix`:
    this rank's columns of G, CSR; `load`: right side e, replicated.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        G: sp.spmatrix | sp.sparray | Composed,
        e: Vector,
        *,
        gram: Gram | Callable[[], CoarseInverse] | None = None,
        eliminate: Elimination = NO_ELIMINATION,
    ) -> None:
        """Store this rank's columns.

        `gram`: G G^T where it is known, or what makes its inverse, collective; `eliminate`: reduces the
        matrices of faces beyond `DENSE_LIMIT`.
        """
        self.comm = comm
        self.matrix: Any = G if isinstance(G, Composed) else Csr(G, dtype=np.float64)
        self.load = np.asarray(e, dtype=np.float64)
        if self.load.shape != (self.matrix.shape[0],):
            raise InvalidInputError(f"e must have {self.matrix.shape[0]} entries as G, got {self.load.shape}")
        self._transposed = self.matrix.T  # shares its memory
        self._gram, self.eliminate = gram, eliminate
        self._reduced: list[FaceGrams | None] = []  # one at most, shared by all loads

    @cached_property
    def gram(self) -> CoarseInverse:
        """Generalised inverse of G G^T, factored on first access. Collective then."""
        if callable(self._gram):
            return self._gram()
        if self._gram is None and self.faces is not None:
            contact = np.setdiff1d(np.arange(self.matrix.shape[1]), self.eliminate.equality)
            return self.faces.inverse(self.matrix[:, contact])
        gram = gram_matrix(self.comm, self.matrix) if self._gram is None else self._gram
        self._gram = None  # of no use beside its factors
        return factored_gram(self.comm, gram)

    @property
    def faces(self) -> FaceGrams | None:
        """Reduced matrices of faces, None where these are not worth it. Collective on first use."""
        if self.m <= DENSE_LIMIT:
            return None
        if not self._reduced:
            self._reduced.append(self.eliminate(self.comm, self.matrix))
        return self._reduced[0]

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
        count_flops(self.comm, self.gram.flops)
        return self.gram.solve(right_side)

    def coefficients(self, x: Vector) -> Vector:
        """Return (G G^T)^-1 G x, shape (m,), replicated. Collective."""
        return self.solve(self.apply(x))

    def fitted(self, x: Vector) -> Vector:
        """Return `coefficients`, refined once. Collective.

        Otherwise rounding of large motions would move other, unloaded bodies.
        """
        alpha = self.coefficients(x)
        return alpha + self.coefficients(x - self.transpose(alpha))

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
        self,
        Z: sp.spmatrix | sp.sparray,
        load: Vector | None = None,
        *,
        gram: Gram | None = None,
        whole: bool = False,
    ) -> CoarseSpace:
        """Return the coarse space G Z of a face with dofs y, multiplier = fixed + Z y. Collective.

        `load`: right side for the face, e - G fixed, replicated; e itself by default; `whole`: whether the
        face has all equality rows and begins with them, Z = [I_E, Z_C].
        """
        columns, load = self.columns(Z, whole=whole), self.load if load is None else load
        if not isinstance(columns, Composed) or (faces := self.faces) is None:
            return CoarseSpace(self.comm, columns, load, gram=gram)
        contact = columns.from_column(len(self.eliminate.equality))
        return CoarseSpace(self.comm, columns, load, gram=lambda: faces.inverse(contact))

    def columns(self, Z: sp.spmatrix | sp.sparray, *, whole: bool = False) -> sp.csr_matrix | Composed:
        """Return G Z of a face, as a matrix where it is not reduced; see `restricted`. Collective."""
        if not whole or self.faces is None:
            return Csr(self.matrix @ Z)
        return Composed((self.matrix, Csr(Z)))


def gram_matrix(comm: MPI.Comm, columns: sp.csr_matrix) -> Gram:
    """Return C C^T for owned columns C: the sum over the ranks, or beyond `DENSE_LIMIT` this rank's share.

    Collective.
    """
    return summed_if_small(comm, (columns @ columns.T).tocsr())


def summed_if_small(comm: MPI.Comm, share: sp.csr_matrix) -> Gram:
    """Return the sum over the ranks, dense, up to `DENSE_LIMIT`; beyond it the share. Collective."""
    if share.shape[0] > DENSE_LIMIT:
        return share
    matrix = share.toarray()
    if comm.size > 1:  # a quarter of the entries or less is sent: those that some rank has
        mine = np.packbits(matrix != 0.0)
        comm.Allreduce(mine, used := np.empty_like(mine), op=MPI.BOR)
        filled = np.flatnonzero(np.unpackbits(used).view(bool))
        matrix.ravel()[filled] = global_sum(comm, matrix.ravel()[filled])
    return matrix


def factored_gram(
    comm: MPI.Comm, gram: Gram, factor_of: type[SharedFactor] = SharedFactor
) -> GramInverse | SparseGramInverse:
    """Factor a dense matrix, or the sum of shares. Collective."""
    return GramInverse(gram) if isinstance(gram, np.ndarray) else SparseGramInverse(comm, gram, factor_of)


def plus(gram: Gram, sparse: sp.csr_matrix) -> Gram:
    """Return the sum of both, in place where the first is dense."""
    if not isinstance(gram, np.ndarray):
        return gram + sparse
    gram[np.repeat(np.arange(len(gram)), np.diff(sparse.indptr)), sparse.indices] += sparse.data
    return gram


class CoarseInverse(Protocol):
    """Generalised inverse of G Gᵀ."""

    rank: int
    null_space: Vector

    @property
    def flops(self) -> int:
        """Floating point operations of one solution on this rank."""

    def solve(self, right_side: Vector) -> Vector:
        """Return the inverse times a replicated array of shape (m,). Collective."""


class SquareInverse(Protocol):
    """The inverse of a square matrix."""

    @property
    def flops(self) -> int:
        """Floating point operations of one solution on this rank."""

    def solve(self, right_side: Vector) -> Vector:
        """Return the inverse times a replicated array of shape (m,). Collective."""


class FaceGrams(Protocol):
    """Inverses of the coarse matrices of faces that share their equality rows, A = G_E G_Eᵀ."""

    def inverse(self, contact: sp.csr_matrix) -> CoarseInverse:
        """Return that of A + C Cᵀ for this rank's columns C, shape (m, n). Collective."""

    def square(self, moving: sp.csr_matrix, tested: sp.csr_matrix) -> SquareInverse | None:
        """Return that of A + C_u C_sᵀ, shape (m, n) each; None if it is singular. Collective."""


class Elimination(Protocol):
    """Makes the coarse matrices of faces small."""

    @property
    def equality(self) -> npt.NDArray[np.int64]:
        """See above."""

    def __call__(self, comm: MPI.Comm, columns: sp.csr_matrix) -> FaceGrams | None:
        """Return them for this rank's columns of G, shape (m, n_owned); None: not worth it. Collective."""


def invert_square(
    comm: MPI.Comm, share: sp.csr_matrix, scale: Vector, singular: float = 1e-10
) -> SquareInverse | None:
    """Factor the sum of shares, scaled to order one; None if it is singular. Collective.

    It counts as singular if its reciprocal condition number is below ``singular``.
    """
    factor = factored_square(comm, summed_if_small(comm, share), scale)
    return factor if factor.condition > singular else None


def factored_square(
    comm: MPI.Comm, matrix: Gram, scale: Vector, factor_of: type[SharedFactor] = SharedFactor
) -> DenseSquareInverse | SharedFactor:
    """Factor a dense matrix, or the sum of shares, scaled to order one. Collective."""
    if isinstance(matrix, np.ndarray):
        return DenseSquareInverse(matrix, scale)
    return factor_of(comm, matrix, scale)


class DenseSquareInverse:
    """LU factors of a small matrix, scaled."""

    def __init__(self, matrix: Vector, scale: Vector) -> None:
        """Factor a replicated matrix, shape (m, m)."""
        self._scale, self.condition = scale, 1.0
        if len(matrix) == 0:
            return
        scaled = _scaled(matrix, scale)
        norm = lapack.dlange("1", scaled)
        lu, pivots, failed = lapack.dgetrf(scaled, overwrite_a=1)
        self.condition = 0.0 if failed or norm == 0.0 else float(lapack.dgecon(lu, norm)[0])
        self._factor = (lu, pivots)

    @property
    def flops(self) -> int:
        """Floating point operations of one solution."""
        return 2 * len(self._scale) ** 2

    def solve(self, right_side: Vector) -> Vector:
        """Return the inverse times a replicated array of shape (m,)."""
        if right_side.size == 0:
            return right_side
        solved = scipy.linalg.lu_solve(self._factor, self._scale * right_side, check_finite=False)
        return np.asarray(self._scale * solved)
