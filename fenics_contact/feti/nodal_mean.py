"""What a torn displacement is at the nodes of the bodies: the mean of their copies."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.sharing import Sharing


def nodal_mean(decomposition: Decomposition, displacement: np.ndarray) -> np.ndarray:
    """Return the mean over all copies of each node, each weighted by the stiffness it feels. Collective.

    Copies on all ranks count, so that the mean does not depend on which rank holds them.

    Args:
        decomposition: Meshes and numbering.
        displacement: This rank's torn displacement, shape (torn_size,), [length].

    Returns:
        Displacement of the nodes of all bodies, NaN on nodes that this rank does not hold, shape
        (n_nodes, dim), [length].
    """
    tearing = decomposition.tearing
    here = np.flatnonzero(decomposition.copy_block >= 0)
    nodes, place = np.unique(tearing.copy_node[here], return_inverse=True)
    columns = decomposition.copy_block[here]
    share = sp.csr_matrix((tearing.copy_share[here], (place.ravel(), columns)))
    mean = share @ displacement.reshape(-1, tearing.dim)
    sharing = Sharing(decomposition.comm, nodes, np.flatnonzero(tearing.on_several_ranks[nodes]))
    result = np.full((tearing.n_nodes, tearing.dim), np.nan)
    result[nodes] = sharing.add_up(mean)
    return result
