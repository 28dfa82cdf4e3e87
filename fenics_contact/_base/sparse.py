"""Sparse matrices: what they cost, factors that several ranks use, rounding.

The choice depends only on sizes, not on timings, so that a run is reproducible. `python -m benchmarks.prices`
repeats the measurements and compares them with the predictions.

petsc4py frees nothing when a Python reference goes away: PETSc objects must be destroyed explicitly, those
shared by several ranks on all of them in the same order.
"""

from __future__ import annotations

import weakref
import zlib
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI, PETSc, check_not_forked, start
from fenics_contact.errors.ranks import at_common_end

#: Products that a factored subdomain is expected to serve: a state with friction, and its adjoint.
PRODUCTS = 100


@dataclass(frozen=True)
class Rates:
    """Rates of one core with OpenBLAS, other cores idle, caches cold.

    `factor`: seconds to factor a sparse matrix of n dofs of a solid, divided by n^1.37; `substitution`:
    seconds for forward and backward substitution, divided by n^1.3; `condensation`: time to form a Schur
    complement relative to that of factoring the whole matrix; `stream`: bytes per second that the product
    with a packed triangle reads.
    """

    factor: float = 0.75e-6
    substitution: float = 2.8e-8
    condensation: float = 1.0
    dense: float = 30e9
    stream: float = 15e9


#: Bytes of a sparse factor of n dofs of a solid, divided by n^1.5.
FACTOR_BYTES = 29.0
#: Rates measured as `Rates` describes.
MEASURED = Rates()


@dataclass(frozen=True)
class LocalCost:
    """Cost of one subdomain.

    `product`: seconds to apply K⁺ and S once each on the interface.
    """

    setup: float
    product: float

    def total(self, products: int) -> float:
        """Return the seconds of the set-up and of a number of products."""
        return self.setup + products * self.product


def implicit_cost(size: int, interface: int, rates: Rates = MEASURED) -> LocalCost:
    """Predict the cost of sparse factors of a subdomain with ``size`` dofs, ``interface`` of them shared."""
    blocks = (size, size - interface)
    return LocalCost(
        rates.factor * sum(n**1.37 for n in blocks), rates.substitution * sum(n**1.3 for n in blocks)
    )


def explicit_cost(size: int, interface: int, rates: Rates = MEASURED) -> LocalCost:
    """Predict the cost of dense interface matrices of a subdomain."""
    sparse = rates.condensation * size**1.37 + (size - interface) ** 1.37
    # K⁺ in double precision and S in single, each a triangle.
    triangles = (4 + 2) * interface**2
    return LocalCost(rates.factor * sparse + interface**3 / rates.dense, triangles / rates.stream)


def prefers_explicit(size: int, interface: int, *, products: int = PRODUCTS, rates: Rates = MEASURED) -> bool:
    """Return whether dense interface matrices are expected to be faster than sparse factors.

    Example:
        >>> prefers_explicit(2079, 729), prefers_explicit(10125, 3534)
        (True, False)
    """
    explicit, implicit = _totals(size, interface, products, rates)
    return explicit < implicit


def expected_cost(size: int, interface: int) -> LocalCost:
    """Return the cost of a subdomain stored in the cheaper way; arguments as for `prefers_explicit`."""
    cost = explicit_cost if prefers_explicit(size, interface) else implicit_cost
    return cost(size, interface)


def factor_bytes(size: int, dim: int) -> float:
    """Return the memory of a sparse Cholesky factor of a body in some dimensions, by nested dissection."""
    return FACTOR_BYTES * size**1.5 if dim == 3 else 11.0 * size * np.log2(size + 2.0)


def _totals(size: int, interface: int, products: int, rates: Rates) -> tuple[float, float]:
    """Return the seconds of the explicit and of the implicit way."""
    explicit, implicit = (cost(size, interface, rates) for cost in (explicit_cost, implicit_cost))
    return explicit.total(products), implicit.total(products)


#: Place in `_groups` of the ranks that share objects, and index in the order of registration by these.
Key = tuple[int, int]

#: Groups of ranks that share objects, in an order of this rank's own.
_groups: list[MPI.Group] = []
#: Objects of several ranks whose owner is gone on this rank.
_waiting: dict[Key, tuple[tuple[PETSc.Object, ...], object]] = {}
#: What would retire those whose owner is in use on this rank.
_owned: dict[Key, Any] = {}
_registered: Counter[int] = Counter()


def dispose_with(
    owner: object, *objects: PETSc.Object, comm: MPI.Comm | None = None, keep: object = None
) -> None:
    """Destroy PETSc objects when their owner is no longer used.

    Objects of one rank, without `comm`, are destroyed at once, others by `sweep`; they must be registered by
    all ranks in the same order.
    """
    finalizer: Any
    if comm is None or comm.size == 1:
        finalizer = weakref.finalize(owner, _destroy, objects, keep)
    else:
        place = _place_of(comm)
        _registered[place] += 1
        key = (place, _registered[place])
        finalizer = _owned[key] = weakref.finalize(owner, _retire, key, objects, keep)
    finalizer.atexit = False


def sweep(comm: MPI.Comm) -> None:
    """Destroy what only ranks of this communicator share and none of them uses any more. Collective."""
    if comm.size == 1:
        return
    sharing: dict[Key, tuple[Key, list[int]]] = {}
    for key in list(_waiting):  # garbage that is collected meanwhile adds to it
        ranks = _ranks_in(comm, _groups[key[0]])
        if MPI.UNDEFINED not in ranks:
            sharing[zlib.crc32(repr(ranks).encode()), key[1]] = key, ranks
    waiting = [set(labels) for labels in comm.allgather(list(sharing))]
    for label, (key, ranks) in sorted(sharing.items()):
        if all(label in waiting[rank] for rank in ranks):
            _destroy(*_waiting.pop(key))


def _place_of(comm: MPI.Comm) -> int:
    """Return the place of a communicator's ranks in `_groups`."""
    group = comm.group
    for place, known in enumerate(_groups):
        if MPI.Group.Compare(group, known) == MPI.IDENT:
            group.Free()
            return place
    _groups.append(group)
    return len(_groups) - 1


def _ranks_in(comm: MPI.Comm, group: MPI.Group) -> list[int]:
    """Return the numbers that the ranks of a group have in a communicator, undefined where they have none."""
    whole = comm.group
    ranks = list(MPI.Group.Translate_ranks(group, range(group.size), whole))
    whole.Free()
    return ranks


def _retire(key: Key, objects: tuple[PETSc.Object, ...], keep: object) -> None:
    del _owned[key]
    _waiting[key] = objects, keep


def _destroy_all(comm: MPI.Comm) -> None:
    """Destroy the shared objects, in use or not, at the end of the program. Collective on ``comm``.

    PETSc keeps data with a communicator as long as it has objects there, and cannot free them after its own
    end: MPI_Finalize would stop halfway, and MPICH take the rank for one that crashed and kill the others.
    """
    for finalizer in list(_owned.values()):
        finalizer()
    sweep(comm)


at_common_end(_destroy_all)


def _destroy(objects: tuple[PETSc.Object, ...], keep: object) -> None:
    for part in objects:
        part.destroy()


#: What is left of terms that cancel counts as rounding below this part of them: sums over a body leave some
#: hundred units in the last place.
ROUNDING = 1e-13
#: The same where few operations lie between: numbers that differ by less, relatively, are the same.
LAST_PLACES = 1e-14


def scaled_rows(matrix: sp.csr_matrix, factors: np.ndarray) -> sp.csr_matrix:
    """Return diag(factors) @ matrix, which stores no zeros; factors have shape (n_rows,)."""
    return _with_values(matrix, matrix.data * np.repeat(factors, np.diff(matrix.indptr)))


def scaled_columns(matrix: sp.csr_matrix, factors: np.ndarray) -> sp.csr_matrix:
    """Return matrix @ diag(factors), which stores no zeros; factors have shape (n_columns,)."""
    return _with_values(matrix, matrix.data * factors[matrix.indices])


def _with_values(matrix: sp.csr_matrix, values: np.ndarray) -> sp.csr_matrix:
    if np.count_nonzero(values) == len(values):
        return Csr((values, matrix.indices, matrix.indptr), shape=matrix.shape)
    # Zeros are taken out in place: the pattern must not be that of the given matrix.
    result = Csr((values, matrix.indices.copy(), matrix.indptr.copy()), shape=matrix.shape)
    result.eliminate_zeros()
    return result


def sent(comm: MPI.Comm, receiver: np.ndarray, *columns: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the rows of columns that all ranks send to this one, in their order. Collective on ``comm``."""
    if comm.size == 1:
        return columns
    order, counts = np.argsort(receiver, kind="stable"), np.bincount(receiver, minlength=comm.size)
    comm.Alltoall(counts, coming := np.empty_like(counts))
    received = tuple(np.empty(coming.sum(), dtype=column.dtype) for column in columns)
    for column, into in zip(columns, received, strict=True):
        comm.Alltoallv((column[order], counts), (into, coming))
    return received


Vector = npt.NDArray[np.float64]

#: Number of rows per rank that takes part in the factorisation.
ROWS_PER_RANK = 20_000
#: Added to the diagonal of the scaled matrix, so that a singular one can be factored, too; one step of
#: refinement removes its effect from the solutions.
SHIFT = 1e-13

_subsets: dict[tuple[int, int], MPI.Comm] = {}


class SharedFactor:
    """LU factors of Σ A_rank by MUMPS on some ranks of a communicator, spread over its machines.

    `holders`: number of ranks that hold the factors; `own`: rows of A on this one; `entries`: of the factors
    on it; `flops`: floating point operations of one solution on it, refined once.
    """

    kind: ClassVar[str] = "lu"
    package: ClassVar[str] = "mumps"

    def __init__(
        self, comm: MPI.Comm, share: sp.csr_matrix, scale: Vector, *, holders: int | None = None
    ) -> None:
        """Sum the shares and factor. Collective on ``comm``, the ranks that use the factors.

        `scale`: positive factors for rows and columns that bring the entries to order one, replicated;
        `holders`: one for every `ROWS_PER_RANK` rows by default.
        """
        start(comm)
        self._comm, self.size, self._scale = comm, share.shape[0], scale
        wanted = -(-self.size // ROWS_PER_RANK) if holders is None else holders
        self.holders = max(1, min(comm.size, wanted))
        # Blocks of equal size, the last smaller, as ScaLAPACK has them.
        self._bounds = np.minimum(np.arange(self.holders + 1) * -(-self.size // self.holders), self.size)
        self._ranks, self._subset = spread(comm, self.holders)
        self._holds, self.own = comm.rank in self._ranks, slice(0)
        if self._holds:
            self.own = slice(*self._bounds[self._subset.rank : self._subset.rank + 2].tolist())
        rows = self.own_rows(share)
        self.flops = self.entries = 0
        if self._holds:
            self._factor(rows)

    def solve(self, right: Vector, *, refine: bool = True) -> Vector:
        """Return A⁻¹ times a replicated vector, replicated. Collective.

        `refine`: correct for the shift.
        """
        solution = np.empty(self.size)
        if self._holds:
            own = self.solve_own(right[self.own])
            solution = self.gathered(self._refined() if refine else own)
        if self._comm.size > 1:
            self._comm.Bcast(solution)
        return solution

    def solve_own(self, right: Vector) -> Vector:
        """Return rows `own` of A⁻¹ times a vector with such rows, not refined. Collective on the holders."""
        check_not_forked()
        self._right.array_w[:] = self._scale[self.own] * right
        self._ksp.solve(self._right, self._left)
        return np.asarray(self._scale[self.own] * self._left.array_r)

    def _refined(self) -> Vector:
        """Return the last solution, corrected for the shift. Collective on the holders."""
        self._matrix.mult(self._left, self._residual)
        self._residual.aypx(-1.0, self._right)
        self._ksp.solve(self._residual, self._correction)
        self._left.axpy(1.0, self._correction)
        return np.asarray(self._scale[self.own] * self._left.array_r)

    def gathered(self, own: Vector) -> Vector:
        """Return a vector of which holders have rows `own`; zero but on the first. Collective on these."""
        whole, counts = np.zeros(self.size), np.diff(self._bounds)
        self._subset.Gatherv(own, (whole, counts, self._bounds[:-1], MPI.DOUBLE))
        return whole

    @cached_property
    def condition(self) -> float:
        """About the reciprocal condition of the scaled matrix, or more, by inverse iteration. Collective."""
        largest = 0.0
        for probe in np.random.default_rng(0).standard_normal((4, self.size)):
            x = probe / np.linalg.norm(probe)
            for _ in range(2):
                x = self.solve(x / self._scale, refine=False) / self._scale
                growth = float(np.linalg.norm(x))
                x /= growth
            largest = max(largest, growth)
        return 1.0 / largest

    def own_rows(self, share: sp.csr_matrix) -> sp.csr_matrix:
        """Return rows `own` of a sum of shares with as many rows as A, scaled. Collective."""
        entries = share.tocoo()
        holder = self._ranks[np.searchsorted(self._bounds, entries.row, side="right") - 1]
        values = entries.data * self._scale[entries.row] * self._scale[entries.col]
        row, column, value = sent(self._comm, holder, entries.row, entries.col, values)
        first = self.own.start or 0
        return Csr((value, (row - first, column)), shape=(self.own.stop - first, share.shape[1]))

    def _factor(self, rows: sp.csr_matrix) -> None:
        sweep(self._subset)  # factors of earlier faces are large
        start, height = self.own.start, rows.shape[0]
        # Every diagonal entry must exist for the shift, also zeros, which sums of sparse matrices drop.
        entries, own = rows.tocoo(), np.arange(height)
        value = np.concatenate([entries.data, np.zeros(height)])
        place = np.concatenate([entries.row, own]), np.concatenate([entries.col, start + own])
        rows = Csr((value, place), shape=rows.shape)
        csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
        shape = ((height, self.size), (height, self.size))
        self._matrix = PETSc.Mat().createAIJ(shape, csr=csr, comm=self._subset)
        given = self._given(self._matrix)
        self._ksp = PETSc.KSP().create(self._subset)
        self._ksp.setOperators(given)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(self.kind)
        pc.setFactorSolverType(self.package)
        self._ksp.setUp()
        self._right, self._left = self._matrix.createVecs()
        self._residual, self._correction = self._matrix.createVecs()
        self.entries = self._entries_of(pc.getFactorMatrix())
        self.flops = 4 * self.entries + 2 * rows.nnz  # L and U, twice
        vectors = (self._right, self._left, self._residual, self._correction)
        dispose_with(self, pc, self._ksp, given, self._matrix, *vectors, comm=self._subset)

    def _given(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return what is factored, also where the matrix is singular."""
        shifted = matrix.copy()
        shifted.shift(SHIFT)
        return shifted

    def _entries_of(self, factor: PETSc.Mat) -> int:
        """Return the number of entries on this rank, which MUMPS counts in millions if it is large."""
        count = int(factor.getMumpsInfo(27))
        return count if count >= 0 else -1_000_000 * count


def spread(comm: MPI.Comm, count: int) -> tuple[np.ndarray, MPI.Comm]:
    """Return ranks at equal distances, the first included, and their communicator. Collective.

    It is made once for each communicator and count, and is not to be used by other ranks.
    """
    ranks = np.arange(count) * comm.size // count
    if count == 1:
        return ranks, MPI.COMM_SELF
    if count == comm.size:
        return ranks, comm
    key = (comm.py2f(), count)
    if key not in _subsets:
        _subsets[key] = comm.Split(0 if comm.rank in ranks else MPI.UNDEFINED)
    return ranks, _subsets[key]


def rounded(values: Any, scale: float) -> np.ndarray:
    """Return numbers, shape (n,), with what is rounding of a scale set to zero."""
    numbers = np.atleast_1d(np.asarray(values, dtype=float))
    return np.where(np.abs(numbers) > ROUNDING * scale, numbers, 0.0)
