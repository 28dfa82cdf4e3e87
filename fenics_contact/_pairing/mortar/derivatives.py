"""Derivatives of the mortar coupling, and their reverse mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import scaled_rows
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.by_master import NormalsPulledBack
from fenics_contact._pairing.mortar.cells import (
    CellDerivatives,
    Cells,
    Overlaps,
    candidate_pairs,
    cells_of,
    cells_pulled_back,
    overlaps_of,
)
from fenics_contact._pairing.mortar.coupling import (
    DualBasis,
    MortarCoupling,
    chunks,
    degree_on,
    inverted_pulled_back,
    measured,
    relief_of_cells,
)
from fenics_contact._pairing.mortar.jacobians import MomentSlopes, NumbersOver, SharedSlopes
from fenics_contact._pairing.mortar.planes import Planes, SumsBy, planes_of, planes_pulled_back
from fenics_contact._pairing.mortar.traces import (
    Traces,
)
from fenics_contact._surfaces.facets import FacetedSurface, heights
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact.errors import together
from fenics_contact.mesh.faces import computed_rounding


def integrals_pulled_back(
    basis: DualBasis, functions: np.ndarray, by_coverage: np.ndarray, by_integrals: np.ndarray
) -> tuple[CellDerivatives, np.ndarray]:
    """Vector-Jacobian product of `DualBasis.integrals` with respect to the cells and the functions.

    `functions`: values at the quadrature points, shape (n, q, f); `by_coverage`: derivative by D_e, shape
    (n_facets, corners); `by_integrals`: by the integrals, shape (n_pairs, corners, f).

    Derivatives by the cells, and by the functions, in their shape.
    """
    cells, facet = basis.cells, basis.facet
    moments = basis.moments(functions)
    over_facet, area = SumsBy(facet, len(basis.area)), basis.area
    by_coverage = by_coverage + over_facet((by_integrals * basis.values(moments)).sum(axis=2))
    by_values = basis.coverage[facet][:, :, None] * by_integrals
    by_mean, means = by_values.sum(axis=1), moments[:, 0] / area[facet][:, None]
    by_area = -over_facet((by_mean * means).sum(axis=1)) / area
    projector = basis.at_corners @ basis.inverse
    by_projector = over_facet(by_values @ moments[:, 1:].transpose(0, 2, 1))
    by_moments = np.concatenate(
        [(by_mean / area[facet][:, None])[:, None], projector[facet].transpose(0, 2, 1) @ by_values], axis=1
    )
    by_corners = by_projector @ basis.inverse
    by_second, more = _by_second_moments(basis, basis.at_corners.transpose(0, 2, 1) @ by_projector)
    # Each quadrature point is in the moments of its pair and in the second moments and areas of its facet.
    at_points = by_moments[cells.pair]
    pulled = functions @ at_points.transpose(0, 2, 1)
    twice = basis.modes @ (by_second + by_second.transpose(0, 2, 1))[cells.facet]
    by_modes = cells.weight[:, :, None] * (pulled[:, :, 1:] + twice)
    by_weight = pulled[:, :, 0] + np.einsum("nqa,nqa->nq", pulled[:, :, 1:] + twice / 2, basis.modes)
    by_weight += np.einsum("nqk,nk->nq", cells.slave, by_coverage[cells.facet])
    by_weight += (by_area + more)[cells.facet][:, None]
    by_local, by_centring = _modes_pulled_back(basis, by_modes, by_corners)
    weighted = np.concatenate([np.ones_like(basis.modes[:, :, :1]), basis.modes], axis=2)
    by_functions = (weighted * cells.weight[:, :, None]) @ at_points
    by = CellDerivatives(
        by_weight + by_centring, by_local, np.zeros_like(cells.opposite),
        cells.weight[:, :, None] * by_coverage[cells.facet][:, None], np.zeros_like(cells.master),
    )  # fmt: skip
    return by, by_functions


def _by_second_moments(basis: DualBasis, by_inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives by the second moments, shape (n_facets, m, m), and by the areas, (n_facets,)."""
    area = basis.area[:, None, None]
    by_covariance = inverted_pulled_back(basis.covariance, by_inverse / area)
    by_area = -(by_inverse * basis.inverse + by_covariance * basis.covariance).sum(axis=(1, 2)) / basis.area
    return by_covariance / area, by_area


def _modes_pulled_back(
    basis: DualBasis, by_modes: np.ndarray, by_corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives by local coordinates, shape (n, q, dim − 1), and by weights, shape (n, q)."""
    cells, plain = basis.cells, basis.cells.local.shape[2]

    def centring(which: slice, by: np.ndarray, at_corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # The mean is zero, its derivative is not.
        by_mean = -(basis.over_facet(by.sum(axis=1)) + at_corners.sum(axis=1)) / basis.area[:, None]
        by_mean = by_mean[cells.facet]
        by_weight = np.einsum("nqa,na->nq", basis.modes[:, :, which], by_mean)
        return by + cells.weight[:, :, None] * by_mean[:, None], by_weight

    by_local, corners = by_modes[:, :, :plain], by_corners[:, :, :plain]
    by_weight = np.zeros(cells.weight.shape)
    if basis.modes.shape[2] > plain:
        mixed = slice(plain, None)
        by_product, by_weight = centring(mixed, by_modes[:, :, mixed], by_corners[:, :, mixed])
        # The product of both coordinates is derived by one of them to the other.
        by_local = by_local + by_product * basis.modes[:, :, 1::-1]
        corners = corners + by_corners[:, :, mixed] * basis.at_corners[:, :, 1::-1]
    by_local, more = centring(slice(plain), by_local, corners)
    return by_local, by_weight + more


@dataclass(frozen=True)
class SurfaceDerivatives:
    """Derivatives of a scalar by what a faceted surface is made of.

    Attributes:
        points: By its nodes, shape (n, dim).
        normals: By its true unit normals, shape (n, dim).
        slopes: By the slopes of the true surface at the corners of facets, see `surfaces.slopes`, shape
            (n_facets, corners, 2).
    """

    points: np.ndarray
    normals: np.ndarray
    slopes: np.ndarray

    @classmethod
    def zero(cls, surface: FacetedSurface) -> SurfaceDerivatives:
        """Return derivatives to be summed up."""
        shape = surface.points.shape
        return cls(np.zeros(shape), np.zeros(shape), np.zeros((*surface.facets.shape, 2)))

    def summed(self, comm: MPI.Comm) -> SurfaceDerivatives:
        """Return the sums over all ranks. Collective."""
        return SurfaceDerivatives(
            *(np.asarray(comm.allreduce(getattr(self, each.name))) for each in fields(self))
        )


def relief_pulled_back(
    cells: Cells,
    surfaces: tuple[FacetedSurface, FacetedSurface],
    pairs: tuple[np.ndarray, np.ndarray],
    along: np.ndarray,
    by_relief: np.ndarray,
    into: tuple[SurfaceDerivatives, SurfaceDerivatives],
) -> tuple[CellDerivatives, np.ndarray]:
    """Vector-Jacobian product of `relief_of_cells` with respect to cells and directions.

    `pairs`: slave facet and master facet of each pair, shape (n_pairs,) each; `along`: direction of the
    heights at each cell, shape (n, dim); `by_relief`: derivative by the heights, shape (n, q).

    Derivatives by the cells, and by the direction at each, shape (n, dim).
    """
    at_slave, at_master = (facet[cells.pair] for facet in pairs)
    by_local, by_slave, by_along = _heights_pulled_back(
        surfaces[0], at_slave, (cells.local, cells.slave), along, by_relief, into[0]
    )
    by_opposite, by_master, more = _heights_pulled_back(
        surfaces[1], at_master, (cells.opposite, cells.master), along, -by_relief, into[1]
    )
    by = CellDerivatives(np.zeros_like(cells.weight), by_local, by_opposite, by_slave, by_master)
    return by, by_along + more


def _heights_pulled_back(
    surface: FacetedSurface,
    facet: np.ndarray,
    places: tuple[np.ndarray, np.ndarray],
    direction: np.ndarray,
    by_height: np.ndarray,
    into: SurfaceDerivatives,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives by local coordinates, shape functions and direction of each cell."""
    local, values = places
    if surface.relief is None:
        return np.zeros_like(local), np.zeros_like(values), np.zeros_like(direction)
    cells, points = by_height.shape
    facet, by_height = np.repeat(facet, points), by_height.ravel()
    direction, weights = np.repeat(direction, points, axis=0), values.reshape(len(facet), -1)
    nodes = surface.facets[facet]
    normals = surface.normals[nodes]
    normal, length = interpolated_normal(weights, normals)
    height = heights(surface, facet, local.reshape(len(facet), -1))
    cosine = np.einsum("nd,nd->n", normal, direction)
    by_value = by_height / cosine
    straight, more = _bulges_pulled_back(surface, facet, weights, direction, -by_height, into)
    by_cosine = (-by_value * height.value / cosine)[:, None]
    by_normal = by_cosine * direction
    by_mean = (by_normal - np.einsum("nd,nd->n", by_normal, normal)[:, None] * normal) / length[:, None]
    np.add.at(into.normals, nodes, weights[:, :, None] * by_mean[:, None])
    np.add.at(into.slopes, facet, by_value[:, None, None] * height.by_slopes)
    by_weights = np.einsum("nkd,nd->nk", normals, by_mean)
    by_local = by_value[:, None] * height.by_local
    by_weights = by_weights + straight
    by_direction = (by_cosine * normal + more).reshape(cells, points, -1).sum(axis=1)
    return by_local.reshape(local.shape), by_weights.reshape(values.shape), by_direction


def _bulges_pulled_back(
    surface: FacetedSurface,
    facet: np.ndarray,
    values: np.ndarray,
    direction: np.ndarray,
    by_bulge: np.ndarray,
    into: SurfaceDerivatives,
) -> tuple[np.ndarray, np.ndarray] | tuple[float, float]:
    """Return the derivatives of `bulges_along` at points by linear shape functions and directions."""
    if not surface.cut.is_cut:
        return 0.0, 0.0
    curved = surface.cut.functions(facet, values)
    nodes, corners = surface.cut.nodes(surface.facets, facet), surface.facets[facet]
    for number, shares in ((nodes, curved), (corners, -values)):
        np.add.at(into.points, number, (by_bulge[:, None] * shares)[..., None] * direction[:, None])
    along = np.einsum("nkd,nd->nk", surface.points[nodes], direction)
    by_values = surface.cut.pulled_back(facet, values, by_bulge[:, None] * along)
    by_values = by_values - by_bulge[:, None] * np.einsum("nkd,nd->nk", surface.points[corners], direction)
    raised = np.einsum("nk,nkd->nd", curved, surface.points[nodes])
    raised -= np.einsum("nk,nkd->nd", values, surface.points[corners])
    return by_values, by_bulge[:, None] * raised


def mortar_pulled_back(
    slave: FacetedSurface,
    master: FacetedSurface,
    coupling: MortarCoupling,
    by: CouplingDerivatives,
    comm: MPI.Comm | None = None,
) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
    """Vector-Jacobian product of a coupling with respect to both surfaces. Collective on ``comm``.

    Nodes and facets are fixed: which nodes face the master, and which facets face each other. Only slave
    facets next to nodes with a derivative are integrated again.

    While an edge of one surface passes over an edge of the other, the integrals change smoothly: what one
    pair of facets loses, the next one gains. For both to be counted, the derivative is that of the master
    moved aside a little. Kinks are left where the rim of the master passes over an edge between slave facets,
    whose dual functions differ on both sides, and jumps where one layer of the master hides another: there
    the derivative is that of one side.

    `comm`: communicator of the ranks that share the work; this one by default. All have the same arguments.

    Derivatives by slave and by master, the same on all ranks.
    """
    comm = comm or MPI.COMM_SELF
    into = SurfaceDerivatives.zero(slave), SurfaceDerivatives.zero(master)
    turned = NormalsPulledBack.of(slave, master, coupling, by)
    sums = _sums_pulled_back(slave, master, coupling, turned.with_weights(by, master))
    touched = np.flatnonzero(sums.felt[slave.facets].any(axis=1))
    part = touched[comm.rank :: comm.size]
    with together(comm):
        if len(part):
            _add_integrals(slave, moved_aside(master), part, sums, into)
    sides = into[0].summed(comm), into[1].summed(comm)
    add_normals(sides, turned, coupling, by)
    return sides


def add_normals(
    sides: tuple[SurfaceDerivatives, SurfaceDerivatives],
    turned: NormalsPulledBack,
    coupling: MortarCoupling,
    by: CouplingDerivatives,
) -> None:
    """Add those by the normals of points, and by gaps along them, to derivatives by slave and master."""
    by_slave, by_master = sides
    along = by.gap[:, None] * coupling.normal
    by_slave.normals[coupling.node] += turned.slave
    by_master.normals[:] += turned.master
    by_slave.points[:] += coupling.of_slave_pulled_back(along, len(by_slave.points))
    by_master.points[:] -= coupling.weight.T @ along


def moved_aside(master: FacetedSurface, beside: float = 1e-9) -> FacetedSurface:
    """Return the master beside its place, so that no edge lies exactly over one of the slave."""
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
        mean: Factors of the derivatives by the integrals with the slave's functions, shape (n, r).
        own: Factors at each slave node, shape (n, r), none where its means are its nodes.
    """

    area: np.ndarray
    left: np.ndarray
    right: np.ndarray
    relief: np.ndarray
    mean: np.ndarray
    own: np.ndarray

    @property
    def felt(self) -> np.ndarray:
        """Nodes with a derivative, shape (n,)."""
        moved = self.left.any(axis=1) | self.mean.any(axis=1) | self.relief.any(axis=1)
        return np.asarray((self.area != 0.0) | moved)

    def by_integrals(self, nodes: np.ndarray, traces: Traces) -> np.ndarray:
        """Return the derivatives by the integrals with the functions of traces, (n_pairs, corners, f)."""
        by_weights = self.left[nodes] @ self.right[traces.master].transpose(0, 2, 1)
        by_means = self.mean[nodes] @ self.own[traces.slave].transpose(0, 2, 1)
        return np.concatenate([by_weights, by_means], axis=2)


def _sums_pulled_back(
    slave: FacetedSurface, master: FacetedSurface, coupling: MortarCoupling, by: CouplingDerivatives
) -> _BySums:
    """Differentiate the weights M_ij / Σ_j M_ij and gaps."""
    middle = slave.points.mean(axis=0)
    along = by.gap[:, None] * coupling.normal
    left = np.concatenate([by.left, -along], axis=1)
    right = np.concatenate([by.right, master.points - middle], axis=1)
    of_slave, own = (np.zeros((len(some), 0)) for some in (coupling.node, slave.nodes))
    if coupling.own is not None and slave.cut.is_cut:
        given = np.zeros((len(slave.nodes), by.right.shape[1])) if by.own is None else by.own
        given = np.concatenate([given, slave.points - middle], axis=1)
        of_slave, own = _of_shares(-left, given, coupling.own, coupling.area)
    left, every = _of_shares(left, right, coupling.weight, coupling.area)
    by_relief = along if by.relief is None else along + by.relief
    by_area = by.area - np.einsum("nd,nd->n", by_relief, coupling.relief) / coupling.area

    def spread(values: np.ndarray) -> np.ndarray:
        everywhere = np.zeros((len(slave.nodes), *values.shape[1:]))
        everywhere[coupling.node] = values
        return everywhere

    raised = spread(by_relief / coupling.area[:, None])
    return _BySums(spread(by_area), spread(left), every, raised, spread(of_slave), own)


def _of_shares(
    left: np.ndarray, right: np.ndarray, weight: sp.csr_matrix, area: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate integrals over their row sums: return the factors for the integrals."""
    mean = np.einsum("nr,nr->n", left, weight @ right)
    left = np.concatenate([left, -mean[:, None]], axis=1) / area[:, None]
    return left, np.concatenate([right, np.ones((len(right), 1))], axis=1)


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
        overlaps = overlaps_of(planes, pair_slave, pair_master, master, degree_on(slave, master))
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

    `facets`: the slave's facets, shape (n_facets,); `normal`: their mean normals, shape (n_facets, dim).
    """
    slave, master = surfaces
    nodes, pairs = slave.facets[facets], (facets[overlaps.facet], overlaps.master)
    of_pair, along = nodes[overlaps.facet], normal[overlaps.facet]
    by_raised = np.einsum("pkd,pd->pk", sums.relief[of_pair], along)
    felt, field = by_raised.any(axis=1)[cells.pair], np.zeros(cells.weight.shape)
    plain, cells = cells, measured(cells, slave, pairs[0])
    basis, some, traces = DualBasis.on(cells), cells.part(felt), Traces.of(cells, surfaces, pairs)
    if felt.any():
        field[felt] = relief_of_cells(some, slave, master, pairs, along)
    by_integrals = np.concatenate([sums.by_integrals(of_pair, traces), by_raised[:, :, None]], axis=2)
    functions = np.concatenate([traces.functions, field[:, :, None]], axis=2)
    by, by_functions = integrals_pulled_back(basis, functions, sums.area[nodes], by_integrals)
    by = by.with_traces(traces.pulled_back(cells, surfaces, pairs, by_functions[:, :, :-1]))
    by_field = by_functions[:, :, -1]
    if not felt.any():
        return _from_measured(plain, slave, pairs[0], by, into[0].points), np.zeros(normal.shape)
    over_facets = SumsBy(overlaps.facet, len(facets))
    by_normal = over_facets((basis.integrals(field[:, :, None]) * sums.relief[of_pair]).sum(axis=1))
    more, by_along = relief_pulled_back(some, surfaces, pairs, along[some.pair], by_field[felt], into)
    by = _from_measured(plain, slave, pairs[0], by.grown(felt, more), into[0].points)
    return by, by_normal + SumsBy(some.facet, len(facets))(by_along)


def _from_measured(
    cells: Cells, slave: FacetedSurface, facet: np.ndarray, by: CellDerivatives, into: np.ndarray
) -> CellDerivatives:
    """Return the derivatives by plane cells; add those by radii to the slave's nodes, shape (n, dim)."""
    if not slave.measure.varies:
        return by
    by, by_radii = measured_pulled_back(cells, slave, facet, by)
    np.add.at(into[:, 0], slave.facets[facet], by_radii)
    return by


def measured_pulled_back(
    cells: Cells, slave: FacetedSurface, facet: np.ndarray, by: CellDerivatives
) -> tuple[CellDerivatives, np.ndarray]:
    """Vector-Jacobian product of `measured` with respect to the cells and the radii of the facets' corners.

    Derivatives by the cells, and by the radii of each pair's slave facet, shape (n_pairs, corners).
    """
    radii = slave.points[slave.facets[facet], 0]
    around = 2 * np.pi * by.weight
    at_points = np.einsum("nqk,nk->nq", cells.slave, radii[cells.pair])
    by_slave = by.slave + (around * cells.weight)[..., None] * radii[cells.pair][:, None]
    by_radii = SumsBy(cells.pair, len(facet))(np.einsum("nq,nqk->nk", around * cells.weight, cells.slave))
    return replace(by, weight=around * at_points, slave=by_slave), by_radii


@dataclass(frozen=True)
class WeightDerivatives:
    """Derivatives of the weights of a coupling.

    Attributes:
        point: Point of the coupling of each weight, ascending, shape (m,).
        node: Its node of the master, or, after these, of the slave in its mean, shape (m,).
        rows: Derivatives by the nodes of the slave and, after them, of the master, shape (m, dim · (n_slave +
            n_master)), [1 / length].
        area: Derivatives of the areas of all points, likewise, shape (n, dim · (n_slave + n_master)), zero of
            those that were not wanted.
    """

    point: np.ndarray
    node: np.ndarray
    rows: sp.csr_matrix
    area: sp.csr_matrix


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

    `wanted`: points whose weights are differentiated, a mask, shape (n,); `comm`: communicator of the ranks
    that share the work; this one by default. All have the same arguments.
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
    node, other = np.divmod(key, len(master.nodes) + len(slave.nodes))
    kept = np.flatnonzero(marked[node])
    point, other, count = np.searchsorted(coupling.node, node[kept]), other[kept], len(coupling.node)
    # Weights of the master and of the slave have sums of their own.
    sums = point + count * (other >= len(master.nodes))
    weights, by_area = _normalised(sums, integral[kept], rows[kept], 2 * count)
    return WeightDerivatives(point, other, weights, by_area[:count])


def _normalised(
    point: np.ndarray, integral: np.ndarray, rows: sp.csr_matrix, count: int
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Return the derivatives of M_ij / Σ_j M_ij and of Σ_j M_ij."""
    entries = np.ones(len(point)), (point, np.arange(len(point)))
    over = Csr(entries, shape=(count, len(point)))
    area, by_area = (over @ integral)[point], (over @ rows).tocsr()
    share = scaled_rows(by_area[point], integral / area)
    return scaled_rows((rows - share).tocsr(), 1.0 / area), by_area


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
    add = Csr((np.ones(len(place)), (place, np.arange(len(place)))), shape=(len(key), len(place)))
    return key, add @ np.concatenate(integrals), (add @ sp.vstack(rows, format="csr")).tocsr()


def _integrals(
    slave: FacetedSurface, master: FacetedSurface, chosen: np.ndarray, at_once: int = 512
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return numbers, integrals and their derivatives, of facets.

    The number of an integral is that of its multiplier times that of all nodes, plus that of the function:
    the nodes of the master, then those of the slave.

    `at_once`: pairs of facets at the same time, so that arrays stay in the cache.
    """
    width = slave.dim * (len(slave.nodes) + len(master.nodes))
    parts: list[tuple[np.ndarray, np.ndarray, sp.csr_matrix]] = []
    if len(chosen) and len(master.facets):
        planes = planes_of(slave, chosen)
        pair_slave, pair_master = candidate_pairs(planes, planes_of(master, np.arange(len(master.facets))))
        # Facets with about as many pairs together: all have room for as many functions.
        order = np.argsort(np.bincount(pair_slave, minlength=len(chosen)), kind="stable")
        planes, chosen, pair_slave = planes.part(order), chosen[order], np.argsort(order)[pair_slave]
        by_slave = np.argsort(pair_slave, kind="stable")
        for pairs in chunks(pair_slave[by_slave], pair_master[by_slave], at_once):
            overlaps = overlaps_of(planes, *pairs, master, degree_on(slave, master))
            if len(overlaps.pair) == 0:
                continue
            parts.append(_of_facets(overlaps, planes, slave, chosen, master))
    if not parts:
        return np.zeros(0, dtype=np.int64), np.zeros(0), Csr((0, width))
    return _summed(*(list(column) for column in zip(*parts, strict=True)))


def _of_facets(
    overlaps: Overlaps, planes: Planes, slave: FacetedSurface, chosen: np.ndarray, master: FacetedSurface
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return the same of some overlaps that have all pairs of their slave facets, with repeated numbers."""
    both = chosen[overlaps.slave], overlaps.master
    plain = cells_of(overlaps)
    cells = measured(plain, slave, both[0])
    traces, basis = Traces.of(cells, (slave, master), both), DualBasis.on(cells)
    n_slave, n_master = len(slave.nodes), len(master.nodes)
    functions = np.concatenate([traces.master, n_master + traces.slave], axis=1)
    met = np.concatenate([slave.facets[both[0]], n_slave + master.facets[both[1]]], axis=1)
    over, at = NumbersOver.of(overlaps.facet, functions), NumbersOver.of(overlaps.facet, met)
    moments = over.sums(basis.moments(traces.functions).transpose(0, 2, 1)).transpose(0, 2, 1)
    shared = SharedSlopes.of(basis, moments)
    slopes = MomentSlopes.of_pairs(overlaps, planes, plain, basis, traces, (slave, master), both)
    dense = shared.of_facets(slopes, over, at)
    # Rows by corner and function of a facet, of the coordinates of its nodes.
    nodes = slave.facets[chosen[overlaps.facets]]
    key = nodes[:, :, None] * (n_master + n_slave) + over.number[:, None]
    used = np.broadcast_to((over.number >= 0)[:, None], key.shape)
    column = slave.dim * at.number[:, :, None] + np.arange(slave.dim)
    here = np.broadcast_to((at.number >= 0)[:, :, None], column.shape).reshape(len(nodes), -1)
    facet = np.nonzero(used)[0]
    kept = here[facet]
    entries = dense[used][kept], column.reshape(len(nodes), -1)[facet][kept]
    ends = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    rows = Csr((*entries, ends), shape=(len(facet), slave.dim * (n_slave + n_master)))
    return key[used], (shared.functions @ moments)[used], rows
