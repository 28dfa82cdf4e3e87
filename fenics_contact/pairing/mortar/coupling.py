"""Mortar coupling of two surfaces by dual Lagrange multipliers, integrated segment by segment."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from scipy import sparse

from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.linalg import scaled_rows
from fenics_contact.pairing.mortar.candidates import candidate_pairs
from fenics_contact.pairing.mortar.cells import cells_of, overlaps_of
from fenics_contact.pairing.mortar.dual_basis import dual_integrals
from fenics_contact.pairing.mortar.planes import check_convex, planes_of
from fenics_contact.pairing.mortar.relief import relief_of_cells
from fenics_contact.surfaces import FacetedSurface

#: Fraction of a node's area that must face the master for the node to carry a multiplier.
LEAST_SHARE = 1e-8
#: Pairs of facets per chunk: its arrays stay below about 50 MB, and mostly in the cache.
CHUNK = 4096


@dataclass(frozen=True)
class MortarCoupling:
    """The slave nodes that carry a multiplier, and the weighted mean of the master for each.

    The dual functions ψ_i satisfy ∫ ψ_i N_j = δ_ij D_i with the shape functions N_j of the slave, so that the
    constraint of one multiplier contains only one slave node: n_i · (u_i − Σ_j (M_ij / D_i) u_j).

    Attributes:
        node: Positions in ``slave.nodes``, ascending, shape (n,).
        area: D_i = ∫ ψ_i = ∫ N_i over the part of the slave that faces the master, shape (n,), [length²] or
            in plane problems [length].
        weight: M_ij / D_i with M_ij = ∫ ψ_i N_j, N_j of the master, shape (n, len(master.nodes)); rows add up
            to one.
        normal: Unit normal from master to slave, the averaged slave normal reversed, shape (n, dim).
        relief: Weighted mean height of the true surfaces over their facets, slave less master, along the
            slave facets' normals, shape (n, dim), [length].
        gap: n_i · (x_i − Σ_j weight_ij x_j + relief_i), positive when open, shape (n,), [length].
    """

    node: np.ndarray
    area: np.ndarray
    weight: sparse.csr_matrix
    normal: np.ndarray
    relief: np.ndarray
    gap: np.ndarray

    def part(self, chosen: np.ndarray) -> MortarCoupling:
        """Return some of the nodes, by indices or a mask."""
        return MortarCoupling(**{each.name: getattr(self, each.name)[chosen] for each in fields(self)})


def mortar_coupling(
    slave: FacetedSurface, master: FacetedSurface, comm: MPI.Comm | None = None
) -> MortarCoupling:
    """Integrate the coupling of two surfaces. Collective on ``comm``.

    Every slave facet has an auxiliary plane (its centre and mean normal). Master facets that face it are
    projected into that plane along its normal and clipped, the pieces are cut into triangles, and a
    quadrature rule of degree 5 in the plane integrates the products of shape functions, which is exact for
    triangles and parallelograms. In plane problems the same happens with edges, lines and intervals. The
    measure is the plane's: that of the facet itself unless it is warped.

    Each rank integrates some of the slave facets, and all receive the whole coupling.

    Args:
        slave: Surface that carries the multipliers.
        master: The opposite surface.
        comm: Communicator of the ranks that share the work, all with the same surfaces; this one by default.

    Raises:
        InvalidInputError: If a slave facet is not convex or the surfaces are not of the same dimension.

    References:
        Puso, M. A., Laursen, T. A.: A mortar segment-to-segment contact method for large deformation solid
        mechanics. Computer Methods in Applied Mechanics and Engineering 193 (2004).
        Popp, A., Gitterle, M., Gee, M. W., Wall, W. A.: A dual mortar approach for 3D finite deformation
        contact with consistent linearization. International Journal for Numerical Methods in Engineering 83
        (2010).
    """
    comm = comm or MPI.COMM_SELF
    mine = np.arange(comm.rank, len(slave.facets), comm.size)
    part: tuple[np.ndarray, sparse.csr_matrix, np.ndarray] | None = None
    with together(comm):
        if slave.dim != master.dim:
            raise InvalidInputError(
                f"mortar coupling needs two surfaces of the same dimension, got a slave in {slave.dim} and a "
                f"master in {master.dim}: build both from plane or both from solid bodies"
            )
        part = _integrals(slave, master, mine)
    # All ranks sum in the same order, so that their sums are bitwise equal.
    parts = [each for each in comm.allgather(part) if each is not None]
    return _coupling(slave, master, *(sum(column) for column in zip(*parts, strict=True)))


def _coupling(
    slave: FacetedSurface,
    master: FacetedSurface,
    area: np.ndarray,
    integrals: sparse.csr_matrix,
    relief: np.ndarray,
) -> MortarCoupling:
    """Keep the nodes that face the master, and divide by their areas."""
    node = np.flatnonzero(area > LEAST_SHARE * slave.areas)
    chosen = integrals[node]
    # The row sums are the areas, and dividing by them cancels their rounding errors.
    weight = scaled_rows(chosen, 1 / np.asarray(chosen.sum(axis=1)).ravel())
    weight.sort_indices()
    normal = -slave.normals[node]
    raised = relief[node] / area[node, None]
    gap = np.einsum("nd,nd->n", normal, slave.points[node] - weight @ master.points + raised)
    return MortarCoupling(node, area[node], weight, normal, raised, gap)


def _integrals(
    slave: FacetedSurface, master: FacetedSurface, chosen: np.ndarray
) -> tuple[np.ndarray, sparse.csr_matrix, np.ndarray]:
    """Integrate over the chosen facets.

    Returns:
        D, shape (slave nodes,), M, shape (slave nodes, master nodes), and ∫ ψ_i times the height of the true
        surfaces over their facets, slave less master, shape (slave nodes, dim).
    """
    area, shape = np.zeros(len(slave.nodes)), (len(slave.nodes), len(master.nodes))
    total, relief = sparse.csr_matrix(shape), np.zeros_like(slave.points)
    if len(chosen) == 0 or len(master.facets) == 0:
        return area, total, relief
    planes = planes_of(slave, chosen)
    check_convex(planes, chosen)
    pairs = candidate_pairs(planes, planes_of(master, np.arange(len(master.facets))))
    rows, columns, values = [], [], []
    # Entries of M are collected and summed once: adding sparse matrices chunk by chunk would copy them all.
    for pair_slave, pair_master in chunks(*pairs):
        overlaps = overlaps_of(planes, pair_slave, pair_master, master)
        cells, at_slave, at_master = cells_of(overlaps), overlaps.slave, overlaps.master
        closer = relief_of_cells(cells, slave, master, (chosen[at_slave], at_master), planes.normal[at_slave])
        coverage, integrals, of_relief = dual_integrals(cells, closer)
        np.add.at(area, slave.facets[chosen[overlaps.facets]], coverage)
        along = planes.normal[at_slave][:, None]
        np.add.at(relief, slave.facets[chosen[at_slave]], of_relief[:, :, None] * along)
        row, column = slave.facets[chosen[at_slave]][:, :, None], master.facets[at_master][:, None]
        rows.append(np.broadcast_to(row, integrals.shape).ravel())
        columns.append(np.broadcast_to(column, integrals.shape).ravel())
        values.append(integrals.ravel())
    if values:
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        total = sparse.csr_matrix(entries, shape=shape)
    return area, total, relief


def chunks(pair_slave: np.ndarray, pair_master: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Split the list of pairs where the slave facet changes, after about `CHUNK` of them."""
    starts = np.flatnonzero(np.diff(pair_slave, prepend=-1))
    cuts = starts[np.flatnonzero(np.diff(starts // CHUNK, prepend=-1))]
    for begin, end in pairwise([*cuts, len(pair_slave)]):
        yield pair_slave[begin:end], pair_master[begin:end]
