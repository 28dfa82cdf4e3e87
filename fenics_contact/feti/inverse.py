"""All factored subdomains of one rank: generalised inverse, interface operators and kernel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import Protocol, cast

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from fenics_contact._base.memory import return_memory
from fenics_contact._base.sparse import prefers_explicit
from fenics_contact._scene.memory import Rates
from fenics_contact.feti.alike import Kind, Kinds
from fenics_contact.feti.compact import CompactOperator, Insides
from fenics_contact.feti.condensation import Condensations, pieces, regular_factor
from fenics_contact.feti.factor import Factor, regularised
from fenics_contact.feti.moved import SAME, Batch, Motion, Placement, SharedOperator
from fenics_contact.feti.subdomain import LocalOperator, Subdomain, interface_dofs


class ExplicitOperator:
    """(K⁺)_bb and S as packed triangles; S, used only for preconditioning, in single precision.

    In double precision, too, where some motion has so little energy that S loses definiteness in single
    precision: that of a stiff body on a soft bed, or of a slender bar that bends.

    Where many subdomains are alike, as whole matrices: one product then reads them once for all.

    With the trace Q of the kernel on the interface, orthonormal, S + ρ Q Qᵀ is positive definite, and

        K⁺ = T diag(K_ii⁻¹, (S + ρ Q Qᵀ)⁻¹) Tᵀ,   T = [I, −K_ii⁻¹ K_ib; 0, I],

    is a symmetric generalised inverse of K. The application of a dense triangle is limited by memory
    bandwidth alone, and reads a half to a third of what substitutions with sparse factors read. `pays_from`:
    number of subdomains from which one product of matrices is faster than one with a triangle for each,
    measured with interfaces of 300 to 1000 dofs.
    """

    pays_from = Rates.whole  # what the plan counts with

    def __init__(
        self,
        subdomain: Subdomain,
        interface: np.ndarray,
        condensations: Condensations,
        single: float = 1e-6,
    ) -> None:
        """Condense a subdomain on its interface.

        `single`: least eigenvalue of S, scaled, in single precision.
        """
        stiffness, self._interface = subdomain.stiffness, interface
        schur = condensations.schur_complement(stiffness, interface)
        self._unit = float(np.abs(schur).max(initial=0.0)) or 1.0
        self._stiff = _packed((schur / self._unit).astype(np.float32, order="F"))
        factor = regular_factor(schur, subdomain.kernel[interface], subdomain.typical_stiffness)
        self._flexible = _packed(lapack.dpotri(factor.lower, lower=1, overwrite_c=1)[0])
        if factor.least < single:
            schur = condensations.schur_complement(stiffness, interface)
            self._stiff = _packed(np.asfortranarray(schur / self._unit))
        self._size = len(interface)
        self._inside = np.setdiff1d(np.arange(subdomain.mesh.size), interface, assume_unique=True)
        rows = stiffness[self._inside]
        self._K_ib, self._K_bb = rows[:, interface].tocsr(), stiffness[interface][:, interface].tocsr()
        self._inner = Factor.of_stiffness(rows[:, self._inside].tocsr())

    @property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of `apply_flexibility` and of `apply_stiffness`."""
        return 2 * self._size**2, 2 * self._size**2

    @property
    def interface_stiffness(self) -> sp.csr_matrix:
        """K_bb, shape (n_b, n_b)."""
        return self._K_bb

    def apply_flexibility(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force into ``displacement``."""
        if self._flexible.ndim == 2:
            displacement[:] = self.apply_flexibility_to_all(force[None])[0]
        else:
            blas.dspmv(self._size, 1.0, self._flexible, force, y=displacement, overwrite_y=1, lower=1)

    #: Nothing is rounded.
    apply_flexibility_exactly = apply_flexibility

    def share(self) -> None:
        """Store whole matrices from now on."""
        if self._flexible.ndim == 1:
            self._flexible, self._stiff = (_whole(self._size, each) for each in (self._flexible, self._stiff))

    def apply_flexibility_to_all(self, forces: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times interface forces of several subdomains alike, the rows, shape (k, n_b)."""
        return np.asarray(forces @ self._flexible)

    def apply_stiffness_to_all(self, displacements: np.ndarray) -> np.ndarray:
        """Return S, in its precision, times interface displacements, the rows, shape (k, n_b)."""
        size = np.abs(displacements).max(axis=1, initial=0.0)
        usual = (size > 0.0) & np.isfinite(size)
        scale = np.where(usual, size, 1.0)[:, None]
        scaled = np.where(usual[:, None], displacements / scale, 0.0).astype(self._stiff.dtype)
        forces = (scaled @ self._stiff) * (self._unit * scale)
        forces[~usual] = size[~usual, None]
        return np.asarray(forces)

    def apply_stiffness(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, in its precision, times an interface displacement into ``force``.

        The range of single precision suffices neither for all units nor for diverging iterates: both factors
        are scaled.
        """
        if self._stiff.ndim == 2:
            force[:] = self.apply_stiffness_to_all(displacement[None])[0]
            return
        size = float(np.abs(displacement).max(initial=0.0))
        if size == 0.0 or not np.isfinite(size):
            force[:] = size
            return
        scaled = (displacement / size).astype(self._stiff.dtype)
        (product,) = blas.get_blas_funcs(("spmv",), (self._stiff,))
        force[:] = product(self._size, 1.0, self._stiff, scaled, lower=1)
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
        self.apply_flexibility(right[self._interface] - self._K_ib.T @ relaxed, trace := np.empty(self._size))
        solution = np.empty_like(right)
        solution[self._interface] = trace
        solution[self._inside] = relaxed - self._solve_inside(self._K_ib @ trace)
        return solution

    def row_flexibility(self, rows: sp.csr_matrix, pairs: int = 100_000) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,).

        `pairs`: pairs of entries of rows that are looked up at once: long rows of mortar contact have many.
        """
        parts = pieces(np.diff(rows.indptr).astype(np.int64) ** 2, pairs)
        return np.concatenate([np.zeros(0), *(self._flexibility_of(rows[part]) for part in parts)])

    def _flexibility_of(self, rows: sp.csr_matrix) -> np.ndarray:
        counts = np.diff(rows.indptr)
        # All pairs of entries within each row.
        pairs = np.repeat(counts, counts)
        first = np.repeat(np.arange(len(rows.indices)), pairs)
        starts = np.repeat(np.repeat(rows.indptr[:-1], counts), pairs)
        second = starts + np.arange(len(first)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
        i, j = rows.indices[first].astype(np.int64), rows.indices[second].astype(np.int64)
        if self._flexible.ndim == 2:
            entries = self._flexible[i, j]
        else:
            low, high = np.minimum(i, j), np.maximum(i, j)
            entries = self._flexible[high + low * (2 * self._size - low - 1) // 2]
        row = np.repeat(np.arange(rows.shape[0]), counts)[first]
        return np.bincount(row, rows.data[first] * rows.data[second] * entries, minlength=rows.shape[0])

    def _solve_inside(self, right: np.ndarray) -> np.ndarray:
        """Return K_ii⁻¹ times a vector on the inside."""
        solution = np.zeros_like(right)
        if right.any():
            self._inner.solve(right, solution)
        return solution


def _packed(matrix: np.ndarray) -> np.ndarray:
    """Return the packed lower triangle of a matrix, in its precision."""
    (pack,) = lapack.get_lapack_funcs(("trttp",), (matrix,))
    return np.asarray(pack(matrix, uplo="L")[0])


def _whole(size: int, packed: np.ndarray) -> np.ndarray:
    """Return the symmetric matrix of a packed lower triangle."""
    (unpack,) = lapack.get_lapack_funcs(("tpttr",), (packed,))
    lower = unpack(size, packed, uplo="L")[0]
    whole = lower + lower.T
    np.fill_diagonal(whole, lower.diagonal())
    return np.asarray(whole)


class Inverse(Protocol):
    """The inverse of a matrix of order n by its factors."""

    @property
    def entries(self) -> int:
        """Number of entries of the factors, one triangle of each."""

    def solve(self, right: np.ndarray, out: np.ndarray) -> None:
        """Write the solution for one right side, shape (n,), into ``out``."""

    def solve_many(self, right: np.ndarray) -> np.ndarray:
        """Return the solutions for the columns of ``right``, shape (n, k)."""


class FactoredOperator:
    """The inverse of a stiffness by its factors, and its Schur complement by those of the inside.

    Cheap to set up, and small where the interface is large. `pays_from`: number of subdomains from which
    substitutions at once are faster than one after the other, measured with 2000 to 15 000 dofs.
    """

    pays_from = 4

    def __init__(
        self, stiffness: sp.csr_matrix, interface: np.ndarray, whole: Inverse, inside: Inverse
    ) -> None:
        """Keep the factors and the blocks that couple the interface."""
        self._interface, self._factor, self._inside = interface, whole, inside
        self._rest = dofs_inside(stiffness, interface)
        rows = stiffness[interface]
        self._K_bb, self._K_bi = rows[:, interface].tocsr(), rows[:, self._rest].tocsr()
        self._K_ib = self._K_bi.T  # shares its memory
        self._right, self._left = np.zeros(stiffness.shape[0]), np.zeros(stiffness.shape[0])
        self._inner = np.zeros(len(self._rest))

    @property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of both operators: two for each entry and substitution."""
        return 4 * self._factor.entries, 4 * self._inside.entries + 2 * self._K_bb.nnz + 4 * self._K_bi.nnz

    @property
    def interface_stiffness(self) -> sp.csr_matrix:
        """K_bb, shape (n_b, n_b)."""
        return self._K_bb

    def apply_flexibility(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write the inverse on the interface times a force there into ``displacement``."""
        self._right[self._interface] = force
        self._factor.solve(self._right, self._left)
        displacement[:] = self._left[self._interface]

    #: Nothing is rounded.
    apply_flexibility_exactly = apply_flexibility

    def apply_stiffness(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write the Schur complement times an interface displacement into ``force``."""
        force[:], pulled = self._forces(displacement)
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
        self.apply_stiffness(displacement, force := np.empty_like(displacement))
        whole = np.empty(len(self._right))
        whole[self._interface] = displacement
        whole[self._rest] = -self._inner
        return whole, force

    def share(self) -> None:
        """Factors are stored the same way for any number of subdomains."""

    def apply_flexibility_to_all(self, forces: np.ndarray) -> np.ndarray:
        """Return the inverse times interface forces of several subdomains alike, the rows, shape (k, n_b)."""
        right = np.zeros((len(self._right), len(forces)), order="F")
        right[self._interface] = forces.T
        return np.asarray(self._factor.solve_many(right)[self._interface].T)

    def apply_stiffness_to_all(self, displacements: np.ndarray) -> np.ndarray:
        """Return the Schur complement times several interface displacements, the rows, shape (k, n_b)."""
        force, pulled = self._forces(displacements.T)
        force -= self._forces_from_inside(self._inside.solve_many(pulled))
        return np.asarray(force.T)

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return the inverse times a vector, shape (n,)."""
        solution = np.empty_like(right)
        self._factor.solve(right, solution)
        return solution

    def row_flexibility(self, rows: sp.csr_matrix, at_once: int = 32) -> np.ndarray:
        """Return bᵀ K⁻¹ b for each row b of a matrix with interface columns, shape (n_rows,).

        `at_once`: rows that are solved for together: a vector of the size of the subdomain for each.
        """
        flexibility = np.empty(rows.shape[0])
        for part in pieces(np.ones(rows.shape[0], dtype=np.int64), at_once):
            block = rows[part].toarray().T
            right = np.zeros((len(self._right), block.shape[1]), order="F")
            right[self._interface] = block
            solved = self._factor.solve_many(right)[self._interface]
            flexibility[part] = np.einsum("nk,nk->k", block, solved)
        return flexibility


class ImplicitOperator(FactoredOperator):
    """K⁺ by a sparse Cholesky factor of the regularised stiffness, S by one of the inside."""

    def __init__(self, subdomain: Subdomain, interface: np.ndarray) -> None:
        """Factor a subdomain."""
        stiffness = subdomain.stiffness
        inside = dofs_inside(stiffness, interface)
        super().__init__(
            stiffness,
            interface,
            Factor.of_stiffness(regularised(stiffness, subdomain.kernel, subdomain.points)),
            Factor.of_stiffness(stiffness[inside][:, inside].tocsr()),
        )


def dofs_inside(stiffness: sp.csr_matrix, interface: np.ndarray) -> np.ndarray:
    """Return the dofs that are not on the interface, ascending."""
    return np.setdiff1d(np.arange(stiffness.shape[0]), interface, assume_unique=True)


class LocalKind(Enum):
    """How subdomains are stored."""

    #: Whichever of the two is expected to take less time in total.
    AUTOMATIC = "automatic"
    #: As sparse factors: little set-up and memory, slower products.
    IMPLICIT = "implicit"
    #: As dense matrices on the interface: more set-up and memory, faster products.
    EXPLICIT = "explicit"
    #: As one dense triangle in single precision: least memory; what is done once or twice is slower.
    COMPACT = "compact"


class TornInverse:
    """K⁺ of this rank's subdomains and their operators on the interface, one after the other.

    Vectors on the interface hold the interface dofs of all subdomains in their order. Subdomains that are
    alike have one operator, that of the first of their kind. `interface`: interface dofs in the torn vector;
    `changed`: whether any subdomain has another matrix or interface than in the previous one; `kinds`: of its
    subdomains, in the order of their first ones.
    """

    def __init__(
        self,
        subdomains: Sequence[Subdomain],
        B: sp.csr_matrix,
        condensations: Condensations,
        *,
        kind: LocalKind = LocalKind.AUTOMATIC,
        previous: TornInverse | None = None,
        shared: bool = True,
    ) -> None:
        """Factor the subdomains."""
        self.offset = np.cumsum([0] + [subdomain.mesh.size for subdomain in subdomains])
        self._subdomains, self._kind, self._insides = tuple(subdomains), kind, Insides()
        touched = np.zeros(self.offset[-1], dtype=bool)
        touched[B.indices] = True
        self._local = [
            interface_dofs(touched[start:stop], subdomain.kernel, subdomain.points)
            for subdomain, (start, stop) in zip(subdomains, pairwise(self.offset), strict=True)
        ]
        starts = np.cumsum([0] + [len(local) for local in self._local])
        self._parts = [slice(int(a), int(b)) for a, b in pairwise(starts)]
        shifted = [local + start for local, start in zip(self._local, self.offset[:-1], strict=True)]
        self.interface = np.concatenate(shifted) if shifted else np.zeros(0, dtype=np.int64)
        known = [None if previous is None else previous._known(i, self) for i in range(len(self._local))]
        self.changed = None in known
        self._sort(known, shared)
        new = [kind for kind in self.kinds if kind.operator is None]
        uses = Counter(id(kind.subdomain.matrix) for kind in new)
        held = len(new)
        for each in _by_pattern(new):
            each.operator = self._factor(each.subdomain, each.interface, condensations)
            uses[id(each.subdomain.matrix)] -= 1
            if not uses[id(each.subdomain.matrix)]:
                each.subdomain.matrix.forget()
            if held % 8 == 1:
                return_memory()
            held -= 1
        self.factored = len(new)
        self._operate()

    def _known(self, index: int, other: TornInverse) -> tuple[Kind, Placement] | None:
        """Return kind and motion of a subdomain with the same matrix and interface in another inverse."""
        same = self._subdomains[index].matrix is other._subdomains[index].matrix and self._kind is other._kind
        same = same and np.array_equal(self._local[index], other._local[index])
        return self._members[index] if same else None

    def _sort(self, known: Sequence[tuple[Kind, Placement] | None], shared: bool) -> None:
        """Find the kind of each subdomain, and how it lies on the first one of its kind."""
        kinds = Kinds()
        for kind in dict.fromkeys(each[0] for each in known if each is not None):
            kinds.add(kind)  # whatever others change to, these stay
        self._members: list[tuple[Kind, Placement]] = []
        uses = Counter(id(subdomain.matrix) for subdomain in self._subdomains)
        for member, subdomain, local in zip(known, self._subdomains, self._local, strict=True):
            if member is None:
                given = Kind(subdomain, local)
                member = kinds.place(given) if shared else (kinds.add(given), SAME)
            self._members.append(member)
            uses[id(subdomain.matrix)] -= 1
            if not (uses[id(subdomain.matrix)] or kinds.compares_with(subdomain)):
                subdomain.matrix.forget()
        kinds.forget()
        self.kinds = kinds.all
        needed = {id(each.subdomain.matrix) for each in self.kinds if each.operator is None}
        for subdomain in (*self._subdomains, *(each.subdomain for each in self.kinds)):
            if id(subdomain.matrix) not in needed:
                subdomain.matrix.forget()

    def _operate(self) -> None:
        """Make the operators of the subdomains, and the batches of those that are applied at once."""
        self.operators: list[LocalOperator] = []
        groups: dict[Kind, list[tuple[LocalOperator, slice, Motion]]] = {}
        for (kind, motion), local, part in zip(self._members, self._local, self._parts, strict=True):
            operator = motion.operator(factored(kind), local, kind.interface)
            self.operators.append(operator)
            groups.setdefault(kind, []).append((operator, part, motion.on(local, kind.interface)))
        self._alone: list[tuple[LocalOperator, slice]] = []
        self._batches: list[tuple[SharedOperator, Batch]] = []
        for kind, members in groups.items():
            shared = cast(SharedOperator, kind.operator)
            if len(members) < shared.pays_from:
                self._alone += [(operator, part) for operator, part, _ in members]
                continue
            shared.share()
            places = [(part.start, moved) for _, part, moved in members]
            self._batches.append((shared, Batch.of(places)))

    @cached_property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of `apply_flexibility` and of `apply_stiffness`."""
        every = np.array([operator.flops for operator in self.operators], dtype=np.int64).reshape(-1, 2)
        flexed, stiffened = every.sum(axis=0).tolist()
        return flexed, stiffened

    def __call__(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a torn vector, shape (torn_size,)."""
        solution = np.zeros_like(right)
        for index in self._by_kind:
            own = slice(*self.offset[index : index + 2])
            if right[own].any():  # most subdomains carry no load
                solution[own] = self.operators[index].invert(right[own])
        return solution

    def apply_flexibility(self, force: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times an interface force, shape (n_interface,)."""
        return self._each(
            lambda one: one.apply_flexibility, lambda all_: all_.apply_flexibility_to_all, force
        )

    @property
    def is_rounded(self) -> bool:
        """Whether `apply_flexibility` is in single precision."""
        return self._kind is LocalKind.COMPACT

    def apply_flexibility_exactly(self, force: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times an interface force, in double precision however it is stored."""
        if not self.is_rounded:
            return self.apply_flexibility(force)
        return_memory()  # where directions of a Krylov method were
        result = np.empty_like(force)
        for index in self._by_kind:
            part = self._parts[index]
            self.operators[index].apply_flexibility_exactly(force[part], result[part])
        return result

    @cached_property
    def _by_kind(self) -> list[int]:
        """The subdomains, those of each kind one after the other."""
        first = {id(kind): number for number, kind in enumerate(self.kinds)}
        return sorted(range(len(self._members)), key=lambda index: first[id(self._members[index][0])])

    def apply_stiffness(self, displacement: np.ndarray) -> np.ndarray:
        """Return S times an interface displacement, shape (n_interface,)."""
        return self._each(
            lambda one: one.apply_stiffness, lambda all_: all_.apply_stiffness_to_all, displacement
        )

    def interface_stiffness(self) -> sp.csr_matrix:
        """Return K on the interface, the inside held, shape (n_interface, n_interface)."""
        blocks = [operator.interface_stiffness for operator in self.operators]
        return sp.csr_matrix(sp.block_diag([sp.csr_matrix((0, 0)), *blocks]))

    def strongest_coupling(self, components: int) -> float:
        """Return the largest |K_ij| / √(K_ii K_jj) between two nodes of the interface of a subdomain."""
        largest = 0.0
        for operator in filter(None, (kind.operator for kind in self.kinds)):
            stiffness = operator.interface_stiffness.tocoo()
            scale = 1.0 / np.sqrt(stiffness.diagonal())
            apart = stiffness.row // components != stiffness.col // components
            coupled = np.abs(stiffness.data) * scale[stiffness.row] * scale[stiffness.col]
            largest = max(largest, float(coupled[apart].max(initial=0.0)))
        return largest

    def energy(self, displacement: np.ndarray) -> tuple[float, np.ndarray]:
        """Return wᵀ S w of this rank and S w, shape (n_interface,), both in double precision.

        Rigid motions have no energy; they are subtracted first, to avoid cancellation. `displacement`: w.
        """
        energy, force = 0.0, np.zeros_like(displacement)
        for index in self._by_kind:
            part = self._parts[index]
            moved = displacement[part]
            if not moved.any():
                continue
            modes, _ = np.linalg.qr(self._subdomains[index].kernel[self._local[index]])
            bent = moved - modes @ (modes.T @ moved)
            _, force[part] = self.operators[index].extend(bent)
            energy += float(bent @ force[part])
        return max(energy, 0.0), force

    def extend(self, displacement: np.ndarray) -> np.ndarray:
        """Return the torn displacement of least energy for one of the interface, shape (torn_size,)."""
        whole = np.zeros(self.offset[-1])
        for index in self._by_kind:
            if (moved := displacement[self._parts[index]]).any():
                whole[slice(*self.offset[index : index + 2])], _ = self.operators[index].extend(moved)
        return whole

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ K⁺ b for each row b of a matrix with interface columns, shape (n_rows,)."""
        flexibility = np.zeros(rows.shape[0])
        columns = rows.tocsc()
        found: dict[Kind, list[tuple[np.ndarray, sp.csr_matrix]]] = {}
        for (kind, motion), local, part in zip(self._members, self._local, self._parts, strict=True):
            block = columns[:, part].tocsr()
            touched = np.flatnonzero(np.diff(block.indptr))
            if len(touched):
                block = motion.rows_there(block[touched], local, kind.interface)
                found.setdefault(kind, []).append((touched, block))
        for kind, blocks in found.items():
            touched, every = np.concatenate([each for each, _ in blocks]), sp.vstack([b for _, b in blocks])
            every = every.tocsr()
            first, same = _distinct_rows(every)  # subdomains alike mostly have the same rows
            np.add.at(flexibility, touched, factored(kind).row_flexibility(every[first])[same])
        return flexibility

    def _factor(
        self, subdomain: Subdomain, interface: np.ndarray, condensations: Condensations
    ) -> LocalOperator:
        """Factor one subdomain."""
        if self._kind is LocalKind.COMPACT:
            schur = condensations.schur_complement(subdomain.stiffness, interface)
            compact = CompactOperator(subdomain, interface, schur, self._insides)
            if compact.contracts:
                return compact
            return ExplicitOperator(subdomain, interface, condensations)
        return _factored(subdomain, interface, condensations, self._kind)

    def _each(
        self,
        method: Callable[[LocalOperator], Callable[[np.ndarray, np.ndarray], None]],
        at_once: Callable[[SharedOperator], Callable[[np.ndarray], np.ndarray]],
        given: np.ndarray,
    ) -> np.ndarray:
        result = np.empty_like(given)
        for operator, part in self._alone:
            method(operator)(given[part], result[part])
        for shared, batch in self._batches:
            batch.scatter(at_once(shared)(batch.gather(given)), result)
        return result


def _distinct_rows(rows: sp.csr_matrix) -> tuple[np.ndarray, np.ndarray]:
    """Return the first of the rows that are equal up to their sign, and which of these each one equals."""
    rows.sort_indices()
    counts = np.diff(rows.indptr)
    signed = rows.data * np.repeat(np.where(rows.data[rows.indptr[:-1]] < 0.0, -1.0, 1.0), counts)
    firsts: list[np.ndarray] = []
    same = np.empty(len(counts), dtype=np.int64)
    for count in np.unique(counts):
        here = np.flatnonzero(counts == count)
        entries = rows.indptr[here][:, None] + np.arange(count)
        table = np.hstack([rows.indices[entries], signed[entries]])
        _, first, which = np.unique(table, axis=0, return_index=True, return_inverse=True)
        same[here] = which.ravel() + sum(len(each) for each in firsts)
        firsts.append(here[first])
    return np.concatenate(firsts), same


def _by_pattern(kinds: Sequence[Kind]) -> list[Kind]:
    """Return kinds in an order in which those with the same pattern and interface follow each other."""
    groups: dict[tuple[int, bytes], list[Kind]] = {}
    for kind in kinds:  # subdomains with cells connected alike share a space
        groups.setdefault((id(kind.subdomain.mesh.space), kind.interface.tobytes()), []).append(kind)
    return [kind for group in groups.values() for kind in group]


def factored(kind: Kind) -> LocalOperator:
    """Return the operator of a kind that has one."""
    assert kind.operator is not None
    return kind.operator


def _factored(
    subdomain: Subdomain, interface: np.ndarray, condensations: Condensations, kind: LocalKind
) -> LocalOperator:
    if kind is LocalKind.AUTOMATIC:
        explicit = prefers_explicit(subdomain.mesh.size, len(interface))
    else:
        explicit = kind is LocalKind.EXPLICIT
    if explicit:
        return ExplicitOperator(subdomain, interface, condensations)
    return ImplicitOperator(subdomain, interface)
