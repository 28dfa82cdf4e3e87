"""What the meshes of a contact leave uncertain about its largest pressure."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.results.resolution import CoarsePeak, UnmatchedNodes
from fenics_contact.results.state import State


def coarse_peak(
    state: State, number: int, pressed_in: np.ndarray, curved: float = 0.1, most: int = 2, few: int = 2
) -> CoarsePeak | None:
    """Return the doubt about a pair whose largest pressure lies next to its edge, if there is one.

    So it is of round bodies, and of flat ones that bend away from each other. Contact that ends where a
    surface ends has no peak that more points would resolve. Where facets of the master are wider than the
    slave's, the pressure follows them, and they count. `curved`: gaps of the deformed bodies that grow by
    this share of how far the point of the largest pressure is pressed in show that contact ends there;
    `most`: cells from the largest pressure to the edge that leave it uncertain; `few`: so many points that
    press resolve no pressure, wherever the others are.
    """
    contact, scene, pair = state.contact, state.scene, state.scene.contacts[number]
    mine = contact.on_pair(number)
    pressing = contact.normal_force[mine] > 0.0
    if not pressing.any() or pressing.all():
        return None
    slave = surface_of(scene, pair.slave, "faceted")
    numbers = NodeNumbers.of(scene)
    node = np.searchsorted(slave.nodes, contact.points.slave[mine] - numbers.first_of(pair.slave.body))
    first = int(np.argmax(contact.pressure[mine]))
    top = int(node[first])
    joined, rim = _joined(slave)
    if rim[top] and not slave.mirrored[top].any():
        return None
    count = int(pressing.sum())
    if count <= few:
        return CoarsePeak(pair.place, count, 1)
    around, wide = slave.facets[(slave.facets == top).any(axis=1)], np.zeros((0, 1, scene.dim))
    if pair.between_bodies:
        wide = _facets_of_master(state, pair.master_surface, int(mine[first]))
    limit = most * max(1.0, _longest(wide) / _longest(slave.points[around]))
    grown = np.full(len(slave.nodes), np.nan)
    grown[node[~pressing]] = contact.gap[mine[~pressing]] - contact.gap[mine[first]]
    # Next to its edge a contact is hardly open: the nodes behind it count, too.
    edges = dijkstra(joined, unweighted=True, indices=top, limit=limit + 1.0)
    edges[np.isnan(grown)] = np.inf
    steps = edges.min()
    if steps > limit or grown[edges <= steps + 1.0].max() <= curved * pressed_in[mine[first]]:
        return None
    way = slave.points[np.argmin(edges)] - slave.points[top]
    wider = max(1.0, _mean_width(wide, way) / _mean_width(slave.points[around], way))
    cells = int(np.ceil(steps / wider))
    return CoarsePeak(pair.place, count, cells) if cells <= most else None


def unmatched_nodes(state: State, number: int, alone: float = 0.99) -> UnmatchedNodes | None:
    """Return the doubt about a pair by nodes on meshes that do not match, if it is one.

    `alone`: weight of a node of the master above which a point lies on it.
    """
    contact, pair = state.contact, state.scene.contacts[number]
    if pair.by_mortar or pair.is_self_contact or not pair.between_bodies:
        return None
    mine = contact.on_pair(number)
    weights = contact.points.master[mine[contact.normal_force[mine] > 0.0]]
    between = weights.max(axis=1).toarray() < alone
    return UnmatchedNodes(pair.place) if between.any() else None


def _facets_of_master(state: State, master: Surface, point: int) -> np.ndarray:
    """Return the facets of a master around the node next to a contact point, shape (n, corners, dim)."""
    surface = surface_of(state.scene, master, "faceted")
    row = state.contact.points.master[[point]].tocoo()
    nearest = row.col[np.argmax(row.data)] - NodeNumbers.of(state.scene).first_of(master.body)
    place = np.searchsorted(surface.nodes, nearest)
    return np.asarray(surface.points[surface.facets[(surface.facets == place).any(axis=1)]])


def _longest(facets: np.ndarray) -> float:
    return float(np.linalg.norm(np.ptp(facets, axis=1), axis=1).max(initial=0.0))


def _mean_width(facets: np.ndarray, way: np.ndarray) -> float:
    """Return how wide facets, (n, corners, dim), are along a vector, on average; 0 without any."""
    return float(np.ptp(facets @ way, axis=1).mean()) if len(facets) else 0.0


def _joined(surface: FacetedSurface) -> tuple[sp.csr_matrix, np.ndarray]:
    """Return which nodes an edge of a facet joins, (n, n), and which lie on the rim, (n,)."""
    ends = surface.facets.ravel(), np.roll(surface.facets, -1, axis=1).ravel()
    one, other = np.concatenate(ends), np.concatenate(ends[::-1])
    count = np.bincount(surface.facets.ravel())
    joined = sp.csr_matrix((np.ones(len(one)), (one, other)), shape=(len(count), len(count)))
    return joined, (joined.getnnz(axis=1) != count) | (count == 1)
