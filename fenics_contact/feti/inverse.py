"""All factored subdomains of one rank: generalised inverse, interface operators and kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.explicit import ExplicitOperator
from fenics_contact.feti.implicit import ImplicitOperator
from fenics_contact.feti.local import LocalOperator, interface_dofs
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.linalg import prefers_explicit


class LocalKind(Enum):
    """How subdomains are stored."""

    #: Whichever of the two is expected to take less time in total.
    AUTOMATIC = "automatic"
    #: As sparse factors: little set-up and memory, slower products.
    IMPLICIT = "implicit"
    #: As dense matrices on the interface: more set-up and memory, faster products.
    EXPLICIT = "explicit"


class TornInverse:
    """K⁺ of this rank's subdomains and their operators on the interface, one after the other.

    Vectors on the interface hold the interface dofs of all subdomains in their order.

    Attributes:
        offset: First dof of each subdomain in the torn vector, and the total, shape (n + 1,).
        interface: Interface dofs in the torn vector, shape (n_interface,).
        operators: The factored subdomains.
        factored: Number of newly factored ones; the others are reused.
    """

    def __init__(
        self,
        subdomains: Sequence[Subdomain],
        B: sp.csr_matrix,
        condensations: Condensations,
        *,
        kind: LocalKind = LocalKind.AUTOMATIC,
        previous: TornInverse | None = None,
    ) -> None:
        """Factor the subdomains.

        Args:
            subdomains: This rank's subdomains.
            B: This rank's part of B, shape (n_local_rows, torn_size).
            condensations: Symbolic factorisations to reuse.
            kind: Sparse factors, dense matrices, or whichever the cost model expects to be faster.
            previous: Operators of another geometry; those of unchanged subdomains are reused.
        """
        self.offset = np.cumsum([0] + [subdomain.mesh.size for subdomain in subdomains])
        self._subdomains, self._kind = tuple(subdomains), kind
        touched = np.zeros(self.offset[-1], dtype=bool)
        touched[B.indices] = True
        self.operators: list[LocalOperator] = []
        self._local: list[np.ndarray] = []
        self.factored = 0
        for index, subdomain in enumerate(subdomains):
            marks = touched[self.offset[index] : self.offset[index + 1]]
            local = interface_dofs(marks, subdomain.kernel, subdomain.points)
            known = None if previous is None else previous._operator_of(index, subdomain, local, kind)
            self.factored += known is None
            self.operators.append(known or self._factor(subdomain, local, condensations))
            subdomain.matrix.forget()
            self._local.append(local)
        starts = np.cumsum([0] + [len(local) for local in self._local])
        self._parts = [slice(int(a), int(b)) for a, b in pairwise(starts)]
        shifted = [local + start for local, start in zip(self._local, self.offset[:-1], strict=True)]
        self.interface = np.concatenate(shifted) if shifted else np.zeros(0, dtype=np.int64)

    def __call__(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a torn vector, shape (torn_size,)."""
        solution = np.zeros_like(right)
        for operator, start, stop in zip(self.operators, self.offset[:-1], self.offset[1:], strict=True):
            if right[start:stop].any():  # most subdomains carry no load
                solution[start:stop] = operator.invert(right[start:stop])
        return solution

    def flex(self, force: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times an interface force, shape (n_interface,)."""
        return self._each(lambda operator: operator.flex, force)

    def stiffen(self, displacement: np.ndarray) -> np.ndarray:
        """Return S times an interface displacement, shape (n_interface,)."""
        return self._each(lambda operator: operator.stiffen, displacement)

    def energy(self, displacement: np.ndarray) -> tuple[float, np.ndarray]:
        """Return wᵀ S w of this rank and S w, shape (n_interface,), both in double precision.

        Rigid motions have no energy; they are subtracted first, to avoid cancellation.

        Args:
            displacement: w, shape (n_interface,).
        """
        energy, force = 0.0, np.zeros_like(displacement)
        each = zip(self._subdomains, self.operators, self._local, self._parts, strict=True)
        for subdomain, operator, local, part in each:
            moved = displacement[part]
            if not moved.any():
                continue
            modes, _ = np.linalg.qr(subdomain.kernel[local])
            bent = moved - modes @ (modes.T @ moved)
            _, force[part] = operator.extend(bent)
            energy += float(bent @ force[part])
        return max(energy, 0.0), force

    def extend(self, displacement: np.ndarray) -> np.ndarray:
        """Return the torn displacement of least energy for one of the interface, shape (torn_size,).

        Args:
            displacement: w, shape (n_interface,).
        """
        whole = np.zeros(self.offset[-1])
        each = zip(self.operators, self._parts, self.offset[:-1], self.offset[1:], strict=True)
        for operator, part, start, stop in each:
            if displacement[part].any():
                whole[start:stop], _ = operator.extend(displacement[part])
        return whole

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ K⁺ b for each row b of a matrix with interface columns, shape (n_rows,)."""
        flexibility = np.zeros(rows.shape[0])
        columns = rows.tocsc()
        for operator, part in zip(self.operators, self._parts, strict=True):
            block = columns[:, part].tocsr()
            touched = np.flatnonzero(np.diff(block.indptr))
            if len(touched):
                flexibility[touched] += operator.row_flexibility(block[touched])
        return flexibility

    def _factor(
        self, subdomain: Subdomain, interface: np.ndarray, condensations: Condensations
    ) -> LocalOperator:
        """Factor one subdomain."""
        return _factored(subdomain, interface, condensations, self._kind)

    def _each(
        self,
        method: Callable[[LocalOperator], Callable[[np.ndarray, np.ndarray], None]],
        given: np.ndarray,
    ) -> np.ndarray:
        result = np.empty_like(given)
        for operator, part in zip(self.operators, self._parts, strict=True):
            method(operator)(given[part], result[part])
        return result

    def _operator_of(
        self, index: int, subdomain: Subdomain, interface: np.ndarray, kind: LocalKind
    ) -> LocalOperator | None:
        """Return the operator of a subdomain if its matrix and interface are the same as here."""
        same = self._subdomains[index].matrix is subdomain.matrix and self._kind is kind
        return self.operators[index] if same and np.array_equal(self._local[index], interface) else None


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


def kernel_matrix(
    subdomains: Sequence[Subdomain], total_modes: int, mode_offset: np.ndarray
) -> sp.csr_matrix:
    """Return R of this rank, shape (torn_size, total_modes): only columns of its own subdomains are nonzero.

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
