"""Nodal values of torn fields: means of displacements, sums of forces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact.feti.decomposition import Decomposition


def nodal_mean(decomposition: Decomposition, displacement: np.ndarray) -> np.ndarray:
    """Return the mean over all copies of each node, each weighted by its stiffness. Collective.

    Copies on all ranks count, so that the mean does not depend on the distribution. Returns displacement of
    the nodes of all bodies, NaN on nodes that this rank does not hold, shape (n_nodes, dim), [length].
    """
    tearing = decomposition.tearing
    here, columns = decomposition.held
    nodes, place = np.unique(tearing.copy_node[here], return_inverse=True)
    share = sp.csr_matrix((tearing.copy_share[here], (place.ravel(), columns)))
    mean = share @ displacement.reshape(-1, tearing.components)
    sharing = Sharing(decomposition.comm, nodes, np.flatnonzero(tearing.on_several_ranks[nodes]))
    result = np.full((tearing.n_nodes, tearing.components), np.nan)
    result[nodes] = sharing.add_up(mean)
    return result


def nodal_mean_at(decomposition: Decomposition, field: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the same mean of a torn field at some nodes, on all ranks. Collective."""
    tearing = decomposition.tearing
    place, copy, block = decomposition.copies_here(nodes)
    parts = tearing.copy_share[copy] * field.reshape(-1, tearing.components)[block].T
    total = np.stack([np.bincount(place, each, len(nodes)) for each in parts], axis=1)
    return np.asarray(decomposition.comm.allreduce(total))


def nodal_mean_transposed(decomposition: Decomposition, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the torn field that does the same work on a torn field as values at nodes do on its means."""
    tearing = decomposition.tearing
    place, copy, block = decomposition.copies_here(nodes)
    result = np.zeros((decomposition.torn_size // tearing.components, tearing.components))
    result[block] = tearing.copy_share[copy, None] * values[place]
    return result.ravel()


def at_copies(decomposition: Decomposition, values: np.ndarray) -> np.ndarray:
    """Return a field of all nodes, (n_nodes, dim), at their copies on this rank, shape (torn_size,)."""
    here, block = decomposition.held
    result = np.zeros((decomposition.torn_size // values.shape[1], values.shape[1]))
    result[block] = values[decomposition.tearing.copy_node[here]]
    return result.ravel()


def nodal_sum(decomposition: Decomposition, force: np.ndarray) -> np.ndarray:
    """Return the sum of a torn force over all copies of each node, on all ranks. Collective."""
    tearing = decomposition.tearing
    here, block = decomposition.held
    total = np.zeros((tearing.n_nodes, tearing.components))
    np.add.at(total, tearing.copy_node[here], force.reshape(-1, tearing.components)[block])
    return np.asarray(decomposition.comm.allreduce(total))


class Sharing:
    """Items of which more than one rank may hold a part, identified by global numbers."""

    def __init__(self, comm: MPI.Comm, keys: np.ndarray, mine: np.ndarray) -> None:
        """Determine which ranks share which items. Collective on ``comm``."""
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
