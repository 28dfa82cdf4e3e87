"""Sizes of subdomains."""

from __future__ import annotations

import numpy as np

from fenics_contact import BodyMesh


def torn_node_counts(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    """Count the nodes of every subdomain, a node once for each subdomain that it belongs to.

    `partition`: (n_cells,) subdomain numbers.

    Returns (S,) node counts; their sum times the dimension is the number of torn displacements.
    """
    owner = np.repeat(partition, mesh.cells.shape[1])
    pairs = np.unique(owner * mesh.n_nodes + mesh.cells.ravel())
    return np.bincount(pairs // mesh.n_nodes)
