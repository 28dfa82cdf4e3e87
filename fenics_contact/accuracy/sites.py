"""Sites: the nodes of the bodies, each once for every material around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.feti import Sharing, TornSystem


@displayed
@dataclass(frozen=True)
class Sites:
    """The nodes of this rank's cells of one order, one site for every material that meets there.

    Attributes:
        order: Order of the cells.
        node: Node of each site among those of all bodies, shape (n_sites,).
        points: Coordinates, shape (n_sites, dim), [length].
        sharing: Sites that other ranks hold as well.
        neighbours: Number of this rank's cells of their material that two sites share, shape (n_sites,
            n_sites), without diagonal.
        of_cells: Number of a subdomain -> site of each node of its cells, as dolfinx orders the cells of its
            mesh, nodes in the order of the body's mesh; shape (n_cells, nodes of a cell).
        cells: Number of this rank's cells around each site, shape (n_sites,).
    """

    order: int
    node: np.ndarray
    points: np.ndarray
    sharing: Sharing
    neighbours: sp.csr_matrix
    of_cells: dict[int, np.ndarray]
    cells: np.ndarray

    @property
    def count(self) -> int:
        """Number of sites."""
        return len(self.node)


def find_sites(torn: TornSystem, order: int = 1) -> Sites:
    """Number the sites of this rank's subdomains whose cells have a given order. Collective."""
    scene, tearing = torn.scene, torn.decomposition.tearing
    kinds = max(len(body.materials) for body in scene.bodies.values())
    keys: dict[int, np.ndarray] = {}
    for mesh in torn.decomposition.meshes:
        body = scene.bodies[mesh.body]
        if body.mesh.order == order:
            nodes = tearing.global_nodes(mesh.body, body.mesh.cells[mesh.cells])
            keys[mesh.number] = nodes * kinds + body.material_of_cells[mesh.cells][:, None]
    nothing = np.zeros(0, dtype=np.int64)
    every = np.concatenate([nothing, *(part.ravel() for part in keys.values())])
    key, place = np.unique(every, return_inverse=True)
    parts = np.split(place.ravel(), np.cumsum([part.size for part in keys.values()])[:-1])
    of_cells = {
        number: part.reshape(known.shape) for (number, known), part in zip(keys.items(), parts, strict=False)
    }
    node = key // kinds
    points = scene.points[node]
    several = np.flatnonzero(tearing.on_several_ranks[node])
    sharing = Sharing(torn.decomposition.comm, key, several)
    neighbours, cells = _neighbours(list(of_cells.values()), len(key))
    return Sites(order, node, points, sharing, neighbours, of_cells, cells)


def _neighbours(of_cells: list[np.ndarray], count: int) -> tuple[sp.csr_matrix, np.ndarray]:
    nothing = np.zeros(0, dtype=np.int64)
    widths = np.concatenate([nothing, *(np.full(len(cells), cells.shape[1]) for cells in of_cells)])
    start = np.concatenate([[0], np.cumsum(widths)])
    sites = np.concatenate([nothing, *(cells.ravel() for cells in of_cells)])
    incidence = sp.csr_matrix((np.ones(len(sites)), sites, start), shape=(len(widths), count))
    common = sp.csr_matrix(incidence.T @ incidence)
    cells = common.diagonal()
    common.setdiag(0)
    common.eliminate_zeros()
    return common, cells
