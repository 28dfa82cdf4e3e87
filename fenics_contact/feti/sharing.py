"""Sums of contributions that several ranks hold of the same items."""

from __future__ import annotations

import numpy as np

from fenics_contact._libraries import MPI


class Sharing:
    """Items of which more than one rank may hold a part, identified by global numbers."""

    def __init__(self, comm: MPI.Comm, keys: np.ndarray, mine: np.ndarray) -> None:
        """Determine which ranks share which items. Collective on ``comm``.

        Args:
            comm: Communicator.
            keys: Number of each item that this rank holds, ascending, shape (n,).
            mine: Positions in ``keys`` of those that other ranks may hold as well.
        """
        self.comm = comm
        every = comm.allgather(keys[mine]) if comm.size > 1 else [keys[mine]]
        self._with: list[np.ndarray] = []
        for rank, other in enumerate(every):
            common = mine[np.isin(keys[mine], other)] if rank != comm.rank else mine[:0]
            self._with.append(common)
        self.shared = np.unique(np.concatenate(self._with))

    def add_up(self, values: np.ndarray) -> np.ndarray:
        """Return values in which the rows of shared items are the sums over all ranks. Collective.

        The ranks that share an item obtain bitwise equal sums.

        Args:
            values: This rank's parts, shape (n, ...).
        """
        if self.comm.size == 1:
            return values
        received = self.comm.alltoall([values[rows] for rows in self._with])
        total = values.copy()
        total[self.shared] = 0.0
        for rank, (rows, part) in enumerate(zip(self._with, received, strict=True)):
            if rank == self.comm.rank:
                total[self.shared] += values[self.shared]
            else:
                total[rows] += part
        return total
