"""The derivative of each mortar weight by the nodes of both surfaces, for tangents of moving bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.linalg import scaled_rows
from fenics_contact.pairing.mortar.candidates import candidate_pairs
from fenics_contact.pairing.mortar.cells import Overlaps, cells_of, cells_pulled_back, overlaps_of
from fenics_contact.pairing.mortar.coupling import MortarCoupling, chunks
from fenics_contact.pairing.mortar.coupling_derivative import moved_aside
from fenics_contact.pairing.mortar.dual_basis import DualBasis
from fenics_contact.pairing.mortar.dual_basis_derivative import integrals_pulled_back
from fenics_contact.pairing.mortar.planes import Planes, planes_of, planes_pulled_back
from fenics_contact.surfaces import FacetedSurface

#: Pairs of facets up to which reverse mode runs for several corners and nodes at once.
AT_ONCE = 2000


@dataclass(frozen=True)
class WeightDerivatives:
    """Derivatives of the weights of a coupling.

    Attributes:
        point: Point of the coupling of each weight, ascending, shape (m,).
        node: Its node of the master, shape (m,).
        rows: Derivatives by the nodes of the slave and, after them, of the master, shape (m, dim · (n_slave +
            n_master)), [1 / length].
    """

    point: np.ndarray
    node: np.ndarray
    rows: sp.csr_matrix


def weight_derivatives(
    slave: FacetedSurface,
    master: FacetedSurface,
    coupling: MortarCoupling,
    wanted: np.ndarray,
    comm: MPI.Comm | None = None,
) -> WeightDerivatives:
    """Differentiate the weights of some points of a coupling. Collective on ``comm``.

    As in `mortar_pulled_back` nodes and facets are fixed, and the derivative is that of the master beside its
    place.

    Args:
        slave: Surface that carries the multipliers.
        master: The opposite surface.
        coupling: The coupling of both.
        wanted: Points whose weights are differentiated, a mask, shape (n,).
        comm: Communicator of the ranks that share the work; this one by default. All have the same arguments.
    """
    comm = comm or MPI.COMM_SELF
    marked = np.zeros(len(slave.nodes), dtype=bool)
    marked[coupling.node[wanted]] = True
    mine = np.flatnonzero(marked[slave.facets].any(axis=1))[comm.rank :: comm.size]
    part: tuple[np.ndarray, np.ndarray, sp.csr_matrix] | None = None
    with together(comm):
        part = _integrals(slave, moved_aside(master), mine)
    parts = [each for each in comm.allgather(part) if each is not None]
    key, integral, rows = _joined(parts)
    node, opposite = np.divmod(key, len(master.nodes))
    kept = np.flatnonzero(marked[node])
    point, opposite = np.searchsorted(coupling.node, node[kept]), opposite[kept]
    return WeightDerivatives(
        point, opposite, _normalised(point, integral[kept], rows[kept], len(coupling.node))
    )


def _normalised(point: np.ndarray, integral: np.ndarray, rows: sp.csr_matrix, count: int) -> sp.csr_matrix:
    """Return the derivative of M_ij / Σ_j M_ij."""
    entries = np.ones(len(point)), (point, np.arange(len(point)))
    over = sp.csr_matrix(entries, shape=(count, len(point)))
    area = (over @ integral)[point]
    share = scaled_rows((over @ rows)[point], integral / area)
    return scaled_rows((rows - share).tocsr(), 1.0 / area)


def _joined(
    parts: Sequence[tuple[np.ndarray, np.ndarray, sp.csr_matrix]],
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return parts of which each has every number once as one."""
    return parts[0] if len(parts) == 1 else _summed(*(list(column) for column in zip(*parts, strict=True)))


def _summed(
    keys: list[np.ndarray], integrals: list[np.ndarray], rows: list[sp.csr_matrix]
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Add entries with the same number."""
    key, place = np.unique(np.concatenate(keys), return_inverse=True)
    place = place.ravel()
    add = sp.csr_matrix((np.ones(len(place)), (place, np.arange(len(place)))), shape=(len(key), len(place)))
    return key, add @ np.concatenate(integrals), (add @ sp.vstack(rows, format="csr")).tocsr()


def _integrals(
    slave: FacetedSurface, master: FacetedSurface, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return numbers (slave node · n_master + master node), integrals M and their derivatives, of facets."""
    width = slave.dim * (len(slave.nodes) + len(master.nodes))
    parts = []
    if len(chosen) and len(master.facets):
        planes = planes_of(slave, chosen)
        pairs = candidate_pairs(planes, planes_of(master, np.arange(len(master.facets))))
        for pair_slave, pair_master in chunks(*pairs):
            overlaps = overlaps_of(planes, pair_slave, pair_master, master)
            if len(overlaps.pair) == 0:
                continue
            parts.append(_of_facets(overlaps, planes, slave, chosen, master))
    if not parts:
        return np.zeros(0, dtype=np.int64), np.zeros(0), sp.csr_matrix((0, width))
    return _joined(parts)


def _of_facets(
    overlaps: Overlaps, planes: Planes, slave: FacetedSurface, chosen: np.ndarray, master: FacetedSurface
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return the same of some overlaps that have all pairs of their slave facets.

    The dual functions of a facet depend on all that covers it. So reverse mode runs once for each corner and
    each node of the master over a facet, in all facets at the same time; where these are few, several times
    at once.
    """
    over, count = _over_facets(overlaps.facet, master.facets[overlaps.master]), len(overlaps.master)
    corner, number = (part.ravel() for part in np.indices((slave.facets.shape[1], over.shape[1])))
    parts, width = [], max(1, AT_ONCE // count)
    for begin in range(0, len(corner), width):
        some = slice(begin, begin + width)
        repeated = overlaps.repeated(len(corner[some]))
        node = over[overlaps.facet][:, number[some]].T.ravel()
        parts.append(_of_nodes(repeated, planes, slave, chosen, master, np.repeat(corner[some], count), node))
    return _summed(*(list(column) for column in zip(*parts, strict=True)))


def _of_nodes(
    overlaps: Overlaps,
    planes: Planes,
    slave: FacetedSurface,
    chosen: np.ndarray,
    master: FacetedSurface,
    corner: np.ndarray,
    node: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return the same for one corner and one node of the master of each pair's slave facet, −1 for none."""
    dim, n_slave, n_master = slave.dim, len(slave.nodes), len(master.nodes)
    nodes, opposite = slave.facets[chosen[overlaps.slave]], master.facets[overlaps.master]
    cells, each = cells_of(overlaps), np.arange(len(nodes))
    basis, own = DualBasis.on(cells), planes.part(overlaps.slave)
    integrals, meant = basis.integrals(cells.master), opposite == node[:, None]
    seed = np.zeros((*integrals.shape[:2], integrals.shape[2] + 1))
    seed[each, corner, :-1] = meant
    by, _ = integrals_pulled_back(basis, np.zeros_like(cells.weight), np.zeros_like(basis.coverage), seed)
    by_subject, by_window = cells_pulled_back(overlaps, cells, by)
    places = master.points[opposite], each, by_subject
    both = planes_pulled_back(own, slave.points[nodes], by_window, np.zeros_like(own.normal), places)
    slopes = np.concatenate(both, axis=1).reshape(len(nodes), -1)
    felt = np.flatnonzero(slopes.any(axis=1))
    met = np.concatenate([nodes, n_slave + opposite], axis=1)[felt]
    column = (dim * met[:, :, None] + np.arange(dim)).reshape(len(felt), slopes.shape[1])
    entries = slopes[felt].ravel(), column.ravel(), slopes.shape[1] * np.arange(len(felt) + 1)
    rows = sp.csr_matrix(entries, shape=(len(felt), dim * (n_slave + n_master)))
    corner, node = corner[felt], node[felt]
    return nodes[felt, corner] * n_master + node, (integrals[felt, corner] * meant[felt]).sum(axis=1), rows


def _over_facets(facet: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the nodes of the master over each slave facet, −1 beyond their number, (n_facets, most).

    Args:
        facet: Slave facet of each pair, shape (n_pairs,).
        nodes: Nodes of the master's facet, shape (n_pairs, master corners).
    """
    count = int(nodes.max()) + 1
    which, node = np.divmod(np.unique(facet[:, None] * count + nodes), count)
    number = np.arange(len(which)) - np.searchsorted(which, which)
    over = np.full((int(facet.max()) + 1, int(number.max()) + 1), -1)
    over[which, number] = node
    return over
