"""Reverse mode through the mortar coupling: from areas, weights, normals and gaps back to the surfaces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.mesh import computed_rounding
from fenics_contact.pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact.pairing.mortar.candidates import candidate_pairs
from fenics_contact.pairing.mortar.cells import (
    CellDerivatives,
    Cells,
    Overlaps,
    cells_of,
    cells_pulled_back,
    overlaps_of,
)
from fenics_contact.pairing.mortar.coupling import MortarCoupling, chunks
from fenics_contact.pairing.mortar.dual_basis import DualBasis
from fenics_contact.pairing.mortar.dual_basis_derivative import integrals_pulled_back
from fenics_contact.pairing.mortar.planes import planes_of, planes_pulled_back
from fenics_contact.pairing.mortar.relief import relief_of_cells
from fenics_contact.pairing.mortar.relief_derivative import SurfaceDerivatives, relief_pulled_back
from fenics_contact.pairing.mortar.sums import SumsBy
from fenics_contact.surfaces import FacetedSurface


def mortar_pulled_back(
    slave: FacetedSurface,
    master: FacetedSurface,
    coupling: MortarCoupling,
    by: CouplingDerivatives,
    comm: MPI.Comm | None = None,
    *,
    beside: float = 1e-9,
) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
    """Vector-Jacobian product of a coupling with respect to both surfaces. Collective on ``comm``.

    Nodes and facets are fixed: which nodes face the master, and which facets face each other. Only slave
    facets next to nodes with a derivative are integrated again.

    While an edge of one surface passes over an edge of the other, the integrals change smoothly: what one
    pair of facets loses, the next one gains. For both to be counted, the derivative is that of the master
    ``beside`` its place. Kinks are left where the rim of the master passes over an edge between slave facets,
    whose dual functions differ on both sides, and jumps where one layer of the master hides another: there
    the derivative is that of one side.

    Args:
        slave: Surface that carries the multipliers.
        master: The opposite surface.
        coupling: The coupling of both.
        by: Derivatives by its results.
        comm: Communicator of the ranks that share the work; this one by default. All have the same arguments.
        beside: Distance beside the place, relative to the smallest radius of a master facet.

    Returns:
        By slave and by master, the same on all ranks.
    """
    comm = comm or MPI.COMM_SELF
    into = SurfaceDerivatives.zero(slave), SurfaceDerivatives.zero(master)
    sums = _sums_pulled_back(slave, master, coupling, by)
    touched = np.flatnonzero(sums.felt[slave.facets].any(axis=1))
    part = touched[comm.rank :: comm.size]
    with together(comm):
        if len(part):
            _add_integrals(slave, moved_aside(master, beside), part, sums, into)
    by_slave, by_master = (side.summed(comm) for side in into)
    along = by.gap[:, None] * coupling.normal
    apart = slave.points[coupling.node] - coupling.weight @ master.points + coupling.relief
    by_slave.normals[coupling.node] -= by.normal + by.gap[:, None] * apart
    by_slave.points[coupling.node] += along
    by_master.points[:] -= coupling.weight.T @ along
    return by_slave, by_master


def moved_aside(master: FacetedSurface, beside: float = 1e-9) -> FacetedSurface:
    """Return the master beside its place, so that no edge lies exactly over one of the slave.

    Args:
        master: The surface.
        beside: Distance relative to the smallest radius of a facet.
    """
    corners = master.points[master.facets]
    size = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1).min()
    step = beside * size + 100 * computed_rounding(master.points)
    aside = np.array([0.5351, 0.3889, 0.7499])[: master.dim]  # along no edges of usual meshes
    return replace(master, points=master.points + step * aside)


@dataclass(frozen=True)
class _BySums:
    """Derivatives by the sums over facets, at each slave node; zero where there is no multiplier.

    Attributes:
        area: By D, shape (n,).
        left: Factors of the derivatives by M, shape (n, r).
        right: Factors at each master node, shape (n_master, r).
        relief: By ∫ ψ_i times the heights, shape (n, dim).
    """

    area: np.ndarray
    left: np.ndarray
    right: np.ndarray
    relief: np.ndarray

    @property
    def felt(self) -> np.ndarray:
        """Nodes with a derivative, shape (n,)."""
        return (self.area != 0.0) | self.left.any(axis=1) | self.relief.any(axis=1)


def _sums_pulled_back(
    slave: FacetedSurface, master: FacetedSurface, coupling: MortarCoupling, by: CouplingDerivatives
) -> _BySums:
    """Differentiate the weights M_ij / Σ_j M_ij and gaps."""
    middle = slave.points.mean(axis=0)
    along = by.gap[:, None] * coupling.normal
    left = np.concatenate([by.left, -along], axis=1)
    right = np.concatenate([by.right, master.points - middle], axis=1)
    mean = np.einsum("nr,nr->n", left, coupling.weight @ right)
    left = np.concatenate([left, -mean[:, None]], axis=1) / coupling.area[:, None]
    right = np.concatenate([right, np.ones((len(right), 1))], axis=1)
    by_relief = along if by.relief is None else along + by.relief
    by_area = by.area - np.einsum("nd,nd->n", by_relief, coupling.relief) / coupling.area

    def spread(values: np.ndarray) -> np.ndarray:
        everywhere = np.zeros((len(slave.nodes), *values.shape[1:]))
        everywhere[coupling.node] = values
        return everywhere

    return _BySums(spread(by_area), spread(left), right, spread(by_relief / coupling.area[:, None]))


def _add_integrals(
    slave: FacetedSurface,
    master: FacetedSurface,
    chosen: np.ndarray,
    sums: _BySums,
    into: tuple[SurfaceDerivatives, SurfaceDerivatives],
) -> None:
    """Add the derivatives of the integrals over the chosen slave facets."""
    planes = planes_of(slave, chosen)
    pairs = candidate_pairs(planes, planes_of(master, np.arange(len(master.facets))))
    for pair_slave, pair_master in chunks(*pairs):
        overlaps = overlaps_of(planes, pair_slave, pair_master, master)
        if len(overlaps.pair) == 0:
            continue
        own, cells = planes.part(overlaps.facets), cells_of(overlaps)
        facets = chosen[overlaps.facets]
        by, by_normal = _cells_of_sums((slave, master), facets, own.normal, overlaps, cells, sums, into)
        by_subject, by_window = cells_pulled_back(overlaps, cells, by)
        by_flat = SumsBy(overlaps.facet, len(facets))(by_window)
        nodes, opposite = slave.facets[facets], master.facets[overlaps.master]
        by_corners, by_opposite = planes_pulled_back(
            own, slave.points[nodes], by_flat, by_normal,
            (master.points[opposite], overlaps.facet, by_subject),
        )  # fmt: skip
        np.add.at(into[0].points, nodes, by_corners)
        np.add.at(into[1].points, opposite, by_opposite)


def _cells_of_sums(
    surfaces: tuple[FacetedSurface, FacetedSurface],
    facets: np.ndarray,
    normal: np.ndarray,
    overlaps: Overlaps,
    cells: Cells,
    sums: _BySums,
    into: tuple[SurfaceDerivatives, SurfaceDerivatives],
) -> tuple[CellDerivatives, np.ndarray]:
    """Return the derivatives by cells and by the mean normals of the slave facets, shape (n_facets, dim).

    Args:
        surfaces: Slave and master.
        facets: The slave's facets, shape (n_facets,).
        normal: Their mean normals, shape (n_facets, dim).
        overlaps: Overlaps of these facets.
        cells: Their cells.
        sums: Derivatives by the sums of integrals.
        into: Derivatives by both surfaces, which grow by those through the heights of true surfaces.
    """
    slave, master = surfaces
    nodes, pairs = slave.facets[facets], (facets[overlaps.facet], overlaps.master)
    of_pair, along = nodes[overlaps.facet], normal[overlaps.facet]
    by_raised = np.einsum("pkd,pd->pk", sums.relief[of_pair], along)
    felt, field = by_raised.any(axis=1)[cells.pair], np.zeros(cells.weight.shape)
    basis, some = DualBasis.on(cells), cells.part(felt)
    if felt.any():
        field[felt] = relief_of_cells(some, slave, master, pairs, along)
    by_weights = sums.left[of_pair] @ sums.right[master.facets[overlaps.master]].transpose(0, 2, 1)
    by_integrals = np.concatenate([by_weights, by_raised[:, :, None]], axis=2)
    by, by_field = integrals_pulled_back(basis, field, sums.area[nodes], by_integrals)
    if not felt.any():
        return by, np.zeros(normal.shape)
    over_facets = SumsBy(overlaps.facet, len(facets))
    by_normal = over_facets((basis.integrals(field[:, :, None]) * sums.relief[of_pair]).sum(axis=1))
    more, by_along = relief_pulled_back(some, surfaces, pairs, along[some.pair], by_field[felt], into)
    return by.grown(felt, more), by_normal + SumsBy(some.facet, len(facets))(by_along)
