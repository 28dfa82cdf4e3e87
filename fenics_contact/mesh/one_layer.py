"""Hexahedra that no neighbours keep from deforming without energy by reduced integration."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import neighbours

#: Columns of the centres of opposite faces of hexahedra of 27 nodes.
_OPPOSITE = np.array([[20, 21], [22, 23], [24, 25]])
_KNOWN: WeakKeyDictionary[BodyMesh, bool] = WeakKeyDictionary()
"""Meshes that were looked at."""


def touches_in_one_layer(mesh: BodyMesh) -> bool:
    """Return whether centres of faces are unknowns where the body is one hexahedron thick.

    These are the faces in contact or tied of a mesh of `serendipity`.
    """
    if mesh.dim == 2 or not mesh.centres:
        return False
    if mesh not in _KNOWN:
        centre = mesh.cells[:, _OPPOSITE]
        follows = np.zeros(mesh.n_nodes, dtype=bool)
        follows[mesh.centres.nodes] = True
        layer = _on_boundary(mesh, np.zeros(mesh.n_cells, dtype=np.int64)).all(axis=2)
        _KNOWN[mesh] = bool((layer & ~follows[centre].all(axis=2)).any())
    return _KNOWN[mesh]


def one_wide(mesh: BodyMesh) -> np.ndarray:
    """Return which hexahedra of 27 nodes have neighbours along one direction at most, shape (n_cells,).

    Rows of such cells deform without energy by reduced integration; in blocks of two by two cells, one layer
    thick, they do not.
    """
    return np.asarray(_on_boundary(mesh, np.zeros(mesh.n_cells, dtype=np.int64)).all(axis=2).sum(axis=1) > 1)


def two_wide(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    """Return a partition in which no cut makes rows of single hexahedra, where the mesh has none.

    Subdomains with such rows go to the neighbour with which they share most faces.
    """
    if mesh.dim == 2 or not mesh.centres:
        return partition
    alone, pairs = one_wide(mesh), neighbours(mesh.cells, mesh.dim)
    while True:
        outer = _on_boundary(mesh, partition)
        thin = (outer.all(axis=2).sum(axis=1) > 1) & ~alone
        sides = partition[pairs]
        sides = sides[sides[:, 0] != sides[:, 1]]
        if not thin.any() or not len(sides):
            return partition
        number = int(partition[np.argmax(thin)])
        beside = sides[(sides == number).any(axis=1)].sum(axis=1) - number
        joined = np.where(partition == number, np.bincount(beside).argmax(), partition)
        partition = np.unique(joined, return_inverse=True)[1].ravel()


def _on_boundary(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    """Return which of opposite faces belong to one cell alone, or one subdomain, shape (n_cells, 3, 2)."""
    centre = mesh.cells[:, _OPPOSITE]
    single = np.bincount(centre.ravel(), minlength=mesh.n_nodes) == 1
    of = np.repeat(partition, centre[0].size)
    least, most = np.full(mesh.n_nodes, len(partition)), np.full(mesh.n_nodes, -1)
    np.minimum.at(least, centre.ravel(), of)
    np.maximum.at(most, centre.ravel(), of)
    single |= least != most
    return np.asarray(single[centre])
