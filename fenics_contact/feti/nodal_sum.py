"""Nodal values of torn forces: the sum over the copies of each node."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti.decomposition import Decomposition


def nodal_sum(decomposition: Decomposition, force: np.ndarray) -> np.ndarray:
    """Return the sum of a torn force over all copies of each node, on all ranks. Collective.

    Args:
        decomposition: Meshes and numbering.
        force: This rank's torn force, shape (torn_size,), [force].

    Returns:
        Forces on the nodes of all bodies, shape (n_nodes, dim), replicated, [force].
    """
    tearing = decomposition.tearing
    here, block = decomposition.held
    total = np.zeros((tearing.n_nodes, tearing.dim))
    np.add.at(total, tearing.copy_node[here], force.reshape(-1, tearing.dim)[block])
    return np.asarray(decomposition.comm.allreduce(total))
