"""The operators of the first subdomain of a kind, applied to others of it and to all of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.alike import Motion
from fenics_contact.feti.subdomain import LocalOperator


class SharedOperator(LocalOperator, Protocol):
    """One that also serves several subdomains at once."""

    pays_from: int

    def share(self) -> None:
        """Prepare for several subdomains."""

    def flex_all(self, forces: np.ndarray) -> np.ndarray:
        """Return (K⁺)_bb times the interface forces of several subdomains, the rows, shape (k, n_b)."""

    def stiffen_all(self, displacements: np.ndarray) -> np.ndarray:
        """Return S, or a close approximation, times interface displacements, the rows, shape (k, n_b)."""


class MovedInterface:
    """How the interface of a subdomain lies on that of the first one, w_first = T w."""

    def __init__(self, motion: Motion, interface: np.ndarray, first: np.ndarray) -> None:
        """Find the interface dofs of a subdomain on those of the first one, both ascending, (n_b,)."""
        self.place = np.searchsorted(interface, motion.place[first])
        self.sign, self.turn = motion.sign[first], motion.turn

    @property
    def matrix(self) -> sp.csr_matrix:
        """T, orthogonal, shape (n_b, n_b)."""
        count = len(self.place)
        T = sp.csr_matrix((self.sign, (np.arange(count), self.place)), shape=(count, count))
        if self.turn is None:
            return T
        return (sp.kron(sp.identity(count // len(self.turn)), self.turn) @ T).tocsr()


class CongruentOperator:
    """The operator of the first subdomain of a kind for another one of it, P⁻¹ (...) P."""

    def __init__(
        self, first: LocalOperator, motion: Motion, interface: np.ndarray, of_first: np.ndarray
    ) -> None:
        """Keep the motion."""
        self.first, self._motion = first, motion
        self.interface = MovedInterface(motion, interface, of_first)

    @property
    def flops(self) -> tuple[int, int]:
        """Floating point operations of `flex` and of `stiffen`."""
        return self.first.flops

    def flex(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write (K⁺)_bb times an interface force, shape (n_b,), into ``displacement``."""
        self.first.flex(_there(force, self.interface), moved := np.empty_like(force))
        displacement[:] = _back(moved, self.interface)

    def flex_exactly(self, force: np.ndarray, displacement: np.ndarray) -> None:
        """Write the same in double precision, however the first one is stored."""
        self.first.flex_exactly(_there(force, self.interface), moved := np.empty_like(force))
        displacement[:] = _back(moved, self.interface)

    def stiffen(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """Write S, or a close approximation, times an interface displacement into ``force``."""
        self.first.stiffen(_there(displacement, self.interface), moved := np.empty_like(force))
        force[:] = _back(moved, self.interface)

    def extend(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the displacement of least energy for one of the interface, and the force for it there."""
        whole, force = self.first.extend(_there(displacement, self.interface))
        return _back(whole, self._motion), _back(force, self.interface)

    def invert(self, right: np.ndarray) -> np.ndarray:
        """Return K⁺ times a vector, shape (n,)."""
        return _back(self.first.invert(_there(right, self._motion)), self._motion)

    def row_flexibility(self, rows: sp.csr_matrix) -> np.ndarray:
        """Return bᵀ (K⁺)_bb b for each row b of a matrix with interface columns, shape (n_rows,)."""
        return self.first.row_flexibility(self.rows_there(rows))

    def rows_there(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return rows with interface columns as they lie on the interface of the first one."""
        return (rows @ self.interface.matrix.T).tocsr()


def _there(vector: np.ndarray, motion: Motion | MovedInterface) -> np.ndarray:
    """Return P u."""
    moved = motion.sign * vector[motion.place]
    return moved if motion.turn is None else (moved.reshape(-1, len(motion.turn)) @ motion.turn.T).ravel()


def _back(moved: np.ndarray, motion: Motion | MovedInterface) -> np.ndarray:
    """Return u for P u."""
    if motion.turn is not None:
        moved = (moved.reshape(-1, len(motion.turn)) @ motion.turn).ravel()
    vector = np.empty_like(moved)
    vector[motion.place] = motion.sign * moved
    return vector


class Batch:
    """All subdomains of one kind: their vectors on the interface as the rows of a matrix."""

    def __init__(self, members: Sequence[tuple[int, MovedInterface | None]], size: int) -> None:
        """Keep where the members are.

        `members`: first entry of each in this rank's interface vectors, and how its interface lies on that of
        the first one, None where it is the same dof by dof.
        """
        starts, interfaces = zip(*members, strict=True)
        own, one = np.arange(size), np.ones(size)
        places = [own if each is None else each.place for each in interfaces]
        self.place = np.asarray(starts)[:, None] + np.array(places)
        signs = np.array([one if each is None else each.sign for each in interfaces])
        self._sign = None if np.all(signs == 1.0) else signs
        turns = [None if each is None else each.turn for each in interfaces]
        width = next((len(turn) for turn in turns if turn is not None), 0)
        none = np.eye(width)
        self._turn = np.array([none if turn is None else turn for turn in turns]) if width else None

    def gather(self, vector: np.ndarray) -> np.ndarray:
        """Return a rank's interface vector as the first one sees its members' parts, (n_members, n_b)."""
        rows = vector[self.place]
        if self._sign is not None:
            rows *= self._sign
        if self._turn is None:
            return np.asarray(rows)
        shape = len(rows), -1, self._turn.shape[1]
        return np.asarray((rows.reshape(shape) @ self._turn.transpose(0, 2, 1)).reshape(len(rows), -1))

    def scatter(self, rows: np.ndarray, vector: np.ndarray) -> None:
        """Write what `gather` returns to the members' parts of a vector."""
        if self._turn is not None:
            turned = rows.reshape(len(rows), -1, self._turn.shape[1]) @ self._turn
            rows = turned.reshape(len(rows), -1)
        vector[self.place] = rows if self._sign is None else rows * self._sign
