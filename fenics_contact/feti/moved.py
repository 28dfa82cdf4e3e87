"""The operators of the first subdomain of a kind, applied to others of it and to all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.subdomain import LocalOperator


class SharedOperator(LocalOperator, Protocol):
    """One that also serves several subdomains at once."""

    pays_from: int

    def share(self) -> None:
        """Prepare for several subdomains."""

    def apply_flexibility_to_all(self, forces: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times the interface forces of several subdomains, the rows, shape (k, n_b)."""

    def apply_stiffness_to_all(self, displacements: np.ndarray) -> np.ndarray:
        """Return S, or a close approximation, times interface displacements, the rows, shape (k, n_b)."""


class Placement:
    """How the dofs of a subdomain lie on those of the first of its kind: the same dof by dof."""

    def operator(self, first: LocalOperator, interface: np.ndarray, of_first: np.ndarray) -> LocalOperator:
        """Return the operator of the subdomain by that of the first one; interfaces are ascending."""
        return first

    def on(self, interface: np.ndarray, of_first: np.ndarray) -> Motion:
        """Return how the interface of the subdomain lies on that of the first one."""
        return Motion(np.arange(len(of_first)), np.ones(len(of_first)))

    def rows_there(self, rows: sp.csr_matrix, interface: np.ndarray, of_first: np.ndarray) -> sp.csr_matrix:
        """Return rows with interface columns as they lie on the interface of the first one."""
        return rows


SAME = Placement()


@dataclass(frozen=True, eq=False)
class Motion(Placement):
    """How the dofs of a subdomain lie on those of the first of its kind, u_first = P u.

    `place`: dof of the subdomain on each of the first one's; `sign`: factor of each, 1 or −1.
    """

    place: np.ndarray
    sign: np.ndarray

    width: ClassVar[int] = 0

    @classmethod
    def of(cls, nodes: np.ndarray, Q: np.ndarray, components: int) -> Motion:
        """Return that by an orthogonal Q, shape (dim, dim), where ``nodes`` lie on the first one's, (n,)."""
        along, sign = np.arange(components), np.ones(components)
        whole = components == 1 or np.array_equal(Q, np.round(Q))
        if whole and components == len(Q):
            along = np.abs(Q).argmax(axis=1)
            sign = Q[np.arange(components), along]
        place, signs = (components * nodes[:, None] + along).ravel(), np.tile(sign, len(nodes))
        return cls(place, signs) if whole else _Turn(place, signs, Q)

    def operator(self, first: LocalOperator, interface: np.ndarray, of_first: np.ndarray) -> LocalOperator:
        """Return the operator of the subdomain by that of the first one; interfaces are ascending."""
        return CongruentOperator(first, self, self.on(interface, of_first))

    def on(self, interface: np.ndarray, of_first: np.ndarray) -> Motion:
        """Return how the interface of the subdomain lies on that of the first one."""
        place = np.searchsorted(interface, self.place[of_first])
        return replace(self, place=place, sign=self.sign[of_first])

    def rows_there(self, rows: sp.csr_matrix, interface: np.ndarray, of_first: np.ndarray) -> sp.csr_matrix:
        """Return rows with interface columns as they lie on the interface of the first one."""
        return (rows @ self.on(interface, of_first).matrix.T).tocsr()

    def maps(self, interface: np.ndarray, first: np.ndarray) -> bool:
        """Return whether an interface lies on that of the first subdomain; both ascending."""
        return np.array_equal(np.sort(self.place[first]), interface)

    @property
    def matrix(self) -> sp.csr_matrix:
        """P, orthogonal."""
        count = len(self.place)
        return sp.csr_matrix((self.sign, (np.arange(count), self.place)), shape=(count, count))

    def rotation(self, width: int) -> np.ndarray:
        """Return Q where others turn the components of each node, shape (width, width)."""
        return np.eye(width)

    def there(self, vector: np.ndarray) -> np.ndarray:
        """Return P u."""
        return np.asarray(self.sign * vector[self.place])

    def back(self, moved: np.ndarray) -> np.ndarray:
        """Return u for P u."""
        vector = np.empty_like(moved)
        vector[self.place] = self.sign * moved
        return vector


@dataclass(frozen=True, eq=False)
class _Turn(Motion):
    """A motion that also turns the components of each node.

    `turn`: Q.
    """

    turn: np.ndarray

    @property
    def width(self) -> int:  # type: ignore[override]
        return len(self.turn)

    def maps(self, interface: np.ndarray, first: np.ndarray) -> bool:
        # As components mix, nodes are on the interface as a whole or not at all.
        starts = first[:: self.width, None] // self.width * self.width
        whole = len(first) % self.width == 0
        if not whole or np.any(first.reshape(-1, self.width) != starts + np.arange(self.width)):
            return False
        return super().maps(interface, first)

    @property
    def matrix(self) -> sp.csr_matrix:
        return (sp.kron(sp.identity(len(self.place) // self.width), self.turn) @ super().matrix).tocsr()

    def rotation(self, width: int) -> np.ndarray:
        return self.turn

    def there(self, vector: np.ndarray) -> np.ndarray:
        return (super().there(vector).reshape(-1, self.width) @ self.turn.T).ravel()

    def back(self, moved: np.ndarray) -> np.ndarray:
        return super().back((moved.reshape(-1, self.width) @ self.turn).ravel())


class CongruentOperator:
    """The operator of the first subdomain of a kind for another one of it, P⁻¹ (...) P."""

    def __init__(self, first: LocalOperator, motion: Motion, interface: Motion) -> None:
        """Keep the motion, and how the interface moves."""
        self.first, self._motion, self._interface = first, motion, interface

    @property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of `apply_flexibility` and of `apply_stiffness`."""
        return self.first.flops

    @property
    def interface_stiffness(self) -> sp.csr_matrix:
        """K_bb, shape (n_b, n_b)."""
        moved = self._interface.matrix
        return (moved.T @ self.first.interface_stiffness @ moved).tocsr()

    def apply_flexibility(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force, shape (n_b,), into ``displacement``."""
        self.first.apply_flexibility(self._interface.there(force), moved := np.empty_like(force))
        displacement[:] = self._interface.back(moved)

    def apply_flexibility_exactly(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write the same in double precision, however the first one is stored."""
        self.first.apply_flexibility_exactly(self._interface.there(force), moved := np.empty_like(force))
        displacement[:] = self._interface.back(moved)

    def apply_stiffness(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, or a close approximation, times an interface displacement into ``force``."""
        self.first.apply_stiffness(self._interface.there(displacement), moved := np.empty_like(force))
        force[:] = self._interface.back(moved)

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and the force for it there."""
        whole, force = self.first.extend(self._interface.there(displacement))
        return self._motion.back(whole), self._interface.back(force)

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,)."""
        return self._motion.back(self.first.invert(self._motion.there(right)))

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,)."""
        return self.first.row_flexibility((rows @ self._interface.matrix.T).tocsr())


class Batch:
    """All subdomains of one kind: their vectors on the interface as the rows of a matrix."""

    def __init__(self, place: np.ndarray) -> None:
        """Take the place of each member's dofs in this rank's interface vectors, (n_members, n_b)."""
        self.place = place

    @staticmethod
    def of(members: Sequence[tuple[int, Motion]]) -> Batch:
        """Return the batch of members.

        `members`: first entry of each in this rank's interface vectors, and how its interface lies on that of
        the first one.
        """
        starts, motions = zip(*members, strict=True)
        place = np.asarray(starts)[:, None] + np.array([each.place for each in motions])
        sign, width = np.array([each.sign for each in motions]), max(each.width for each in motions)
        if width:
            return _Turned(place, sign, np.array([each.rotation(width) for each in motions]))
        return Batch(place) if np.all(sign == 1.0) else _Signed(place, sign)

    def gather(self, vector: np.ndarray) -> np.ndarray:
        """Return a rank's interface vector as the first one sees its members' parts, (n_members, n_b)."""
        return np.asarray(vector[self.place])

    def scatter(self, rows: np.ndarray, vector: np.ndarray) -> None:
        """Write what `gather` returns to the members' parts of a vector."""
        vector[self.place] = rows


class _Signed(Batch):
    """A batch some of whose members are mirrored."""

    def __init__(self, place: np.ndarray, sign: np.ndarray) -> None:
        super().__init__(place)
        self._sign = sign

    def gather(self, vector: np.ndarray) -> np.ndarray:
        return super().gather(vector) * self._sign

    def scatter(self, rows: np.ndarray, vector: np.ndarray) -> None:
        super().scatter(rows * self._sign, vector)


class _Turned(_Signed):
    """A batch some of whose members are turned."""

    def __init__(self, place: np.ndarray, sign: np.ndarray, turn: np.ndarray) -> None:
        super().__init__(place, sign)
        self._turn, self._shape = turn, (len(place), -1, turn.shape[1])

    def gather(self, vector: np.ndarray) -> np.ndarray:
        rows = super().gather(vector)
        turned = rows.reshape(self._shape) @ self._turn.transpose(0, 2, 1)
        return np.asarray(turned.reshape(len(rows), -1))

    def scatter(self, rows: np.ndarray, vector: np.ndarray) -> None:
        super().scatter((rows.reshape(self._shape) @ self._turn).reshape(len(rows), -1), vector)
