"""Nodal values of torn fields: means of displacements, sums of forces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.decomposition import Decomposition, Sharing


def nodal_mean(decomposition: Decomposition, displacement: np.ndarray) -> np.ndarray:
    """Return the mean over all copies of each node, each weighted by its stiffness. Collective.

    Copies on all ranks count, so that the mean does not depend on the distribution.

    `displacement`: this rank's torn displacement, shape (torn_size,), [length].

    Returns displacement of the nodes of all bodies, NaN on nodes that this rank does not hold, shape
    (n_nodes, dim), [length].
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
    """Return the same mean of a torn field at some nodes, on all ranks. Collective.

    `field`: this rank's part of the field, shape (torn_size,); `nodes`: nodes among those of all bodies,
    shape (n,).

    The result has shape (n, dim), replicated.
    """
    tearing = decomposition.tearing
    place, copy, block = decomposition.copies_here(nodes)
    total = np.zeros((len(nodes), tearing.components))
    np.add.at(total, place, tearing.copy_share[copy, None] * field.reshape(-1, tearing.components)[block])
    return np.asarray(decomposition.comm.allreduce(total))


def nodal_mean_transposed(decomposition: Decomposition, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the torn field that does the same work on a torn field as values at nodes do on its means.

    `nodes`: different nodes among those of all bodies, shape (n,); `values`: values at these nodes, shape (n,
    dim).

    Returns this rank's part of the field, shape (torn_size,).
    """
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
    """Return the sum of a torn force over all copies of each node, on all ranks. Collective.

    `force`: this rank's torn force, shape (torn_size,), [force].

    Returns forces on the nodes of all bodies, shape (n_nodes, dim), replicated, [force].
    """
    tearing = decomposition.tearing
    here, block = decomposition.held
    total = np.zeros((tearing.n_nodes, tearing.components))
    np.add.at(total, tearing.copy_node[here], force.reshape(-1, tearing.components)[block])
    return np.asarray(decomposition.comm.allreduce(total))
