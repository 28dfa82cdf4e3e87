"""Distributed dual vectors: ownership of multipliers, and the exchange of shared ones."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI, PETSc
from fenics_contact.linalg import dispose_with


class DualNumbering:
    """Numbering of multipliers over ranks: each is owned by one rank and shared by those that touch it.

    Rows of B are first numbered in an order that does not depend on the number of ranks (*row numbers*).
    A rank owns some of them, in ascending order; *local* vectors hold the owned entries followed by the
    ghosts, the touched entries that other ranks own.

    Attributes:
        comm: Communicator.
        owned: Row numbers that this rank owns, ascending, shape (n_owned,).
        ghosts: Row numbers that it touches but does not own, ascending, shape (n_ghosts,).
        offset: Position of the first owned entry in the concatenation of all ranks' owned parts.
        total: Number of rows of all ranks.
    """

    def __init__(self, comm: MPI.Comm, owner: np.ndarray, touched: np.ndarray) -> None:
        """Build numbering and exchange. Collective on ``comm``.

        Args:
            comm: Communicator.
            owner: Owning rank of every row, shape (n_rows,), replicated.
            touched: Row numbers that this rank's subdomains enter, ascending.
        """
        self.comm = comm
        self.total = len(owner)
        self._owner, self._touched = owner, touched
        order = np.argsort(owner, kind="stable")
        self._position = np.empty(self.total, dtype=np.int64)
        self._position[order] = np.arange(self.total)
        starts = np.searchsorted(owner[order], np.arange(comm.size + 1))
        self.offset = int(starts[comm.rank])
        self.owned = order[starts[comm.rank] : starts[comm.rank + 1]]
        self.ghosts = touched[owner[touched] != comm.rank]
        self._vector = PETSc.Vec().createGhost(
            self._position[self.ghosts].astype(PETSc.IntType), (len(self.owned), self.total), comm=comm
        )
        dispose_with(self, self._vector, comm=comm)

    def serves(self, owner: np.ndarray, touched: np.ndarray) -> bool:
        """Return whether this rank's part is that of rows with these owners, touched as given."""
        return np.array_equal(self._owner, owner) and np.array_equal(self._touched, touched)

    @property
    def local_rows(self) -> np.ndarray:
        """Row numbers of a local vector, owned ones first."""
        return np.concatenate([self.owned, self.ghosts])

    def local_index(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of touched or owned rows in a local vector."""
        lookup = np.full(self.total, -1, dtype=np.int64)
        lookup[self.local_rows] = np.arange(len(self.owned) + len(self.ghosts))
        return lookup[rows]

    def position(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of rows in the concatenation of all ranks' owned parts."""
        return self._position[rows]

    def owned_index(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of rows in this rank's owned vector, −1 for rows of other ranks."""
        if len(self.owned) == 0:
            return np.full(rows.shape, -1)
        index = np.minimum(np.searchsorted(self.owned, rows), len(self.owned) - 1)
        return np.where(self.owned[index] == rows, index, -1)

    def to_local(self, owned: np.ndarray) -> np.ndarray:
        """Return the local vector (owned, then ghosts) of an owned one. Collective."""
        self._vector.array_w[:] = owned
        self._vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)
        with self._vector.localForm() as local:
            return np.array(local.array_r)

    def to_owned(self, local: np.ndarray) -> np.ndarray:
        """Add up the shares of all ranks and return the owned part. Collective."""
        with self._vector.localForm() as form:
            form.array_w[:] = local
        self._vector.ghostUpdate(PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
        return np.array(self._vector.array_r)

    def gather(self, owned: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return entries of an owned vector for any rows, on every rank. Collective.

        Meant for contact rows, which are few; ``rows`` must be the same on every rank.
        """
        mine = np.zeros(len(rows))
        index = np.full(self.total, -1, dtype=np.int64)
        index[self.owned] = np.arange(len(self.owned))
        here = index[rows] >= 0
        mine[here] = owned[index[rows[here]]]
        return np.asarray(self.comm.allreduce(mine))

    def sum_rows(self, local: sp.csr_matrix) -> sp.csr_matrix:
        """Add up the ranks' shares of a sparse matrix with one row for each multiplier. Collective.

        Args:
            local: This rank's share, shape (n_local, n_columns), rows as in local vectors.

        Returns:
            The owned rows, shape (n_owned, n_columns).
        """
        shares = local.tocoo()
        rank = self._owner[self.local_rows][shares.row]
        order = np.argsort(rank, kind="stable")
        cuts = np.searchsorted(rank[order], np.arange(1, self.comm.size))
        columns = (self.local_rows[shares.row], shares.col, shares.data)
        outgoing = zip(*(np.split(column[order], cuts) for column in columns), strict=True)
        incoming = self.comm.alltoall(list(outgoing))
        row, column, value = (np.concatenate([part[i] for part in incoming]) for i in range(3))
        shape = (len(self.owned), local.shape[1])
        return sp.csr_matrix((value, (np.searchsorted(self.owned, row), column)), shape=shape)
