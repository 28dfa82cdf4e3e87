"""Displacements of nodes from those of their copies."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti.decomposition import Decomposition


def nodal_means(decomposition: Decomposition, field: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the mean over all copies of a torn field at some nodes. Collective.

    Copies weigh as in the contact rows.

    Args:
        decomposition: Numbering.
        field: This rank's part of the field, shape (torn_size,).
        nodes: Nodes among those of all bodies, shape (n,).

    Returns:
        Shape (n, dim), replicated.
    """
    tearing = decomposition.tearing
    copies = tearing.multiplicity[nodes]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    copy = np.repeat(tearing.first_copy[nodes], copies) + within
    block = decomposition.copy_block[copy]
    here = np.flatnonzero(block >= 0)
    total = np.zeros((len(nodes), tearing.dim))
    shares = tearing.copy_share[copy[here], None] * field.reshape(-1, tearing.dim)[block[here]]
    np.add.at(total, np.repeat(np.arange(len(nodes)), copies)[here], shares)
    return np.asarray(decomposition.comm.allreduce(total))
