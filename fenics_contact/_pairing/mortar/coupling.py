"""Mortar coupling of two surfaces by dual Lagrange multipliers, integrated segment by segment.

On the covered part of a slave facet the dual functions are ψ = D M⁻¹ N with M = ∫ N Nᵀ and D = diag ∫ N,
so that ∫ ψ_i N_j = δ_ij ∫ N_j and Σ ψ_i = 1. Integrals of ψ_i with master functions are then D_ii times the
value at corner i of the master function's L² projection onto the slave functions. That projection is computed
in the basis {1, u, v, u v} of the same space, centred on the covered part and scaled to its extent, which
stays well conditioned where the part is small.

Directions in which the part is a sliver (see `SLIVER`) are omitted: the projection is constant along them
instead of extrapolated. Biorthogonality is lost there, but not Σ ψ_i = 1 and ∫ ψ_i = ∫ N_i, hence the
transfer of forces.

References:
    Wohlmuth, B.: A mortar finite element method using dual spaces for the Lagrange multiplier. SIAM Journal
    on Numerical Analysis 38 (2000).
    Popp, A., Gitterle, M., Gee, M. W., Wall, W. A.: A dual mortar approach for 3D finite deformation contact
    with consistent linearization. International Journal for Numerical Methods in Engineering 83 (2010).
    Cichosz, T., Bischoff, M.: Consistent treatment of boundaries with mortar contact formulations using dual
    Lagrange multipliers. Computer Methods in Applied Mechanics and Engineering 200 (2011).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from scipy import sparse

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import scaled_rows
from fenics_contact._pairing.mortar.cells import Cells, candidate_pairs, cells_of, overlaps_of
from fenics_contact._pairing.mortar.normals import normals_at
from fenics_contact._pairing.mortar.planes import SumsBy, check_convex, planes_of
from fenics_contact._pairing.mortar.traces import Traces
from fenics_contact._surfaces.facets import FacetedSurface, heights
from fenics_contact._surfaces.projection import interpolated_normal
from fenics_contact.errors import InvalidInputError, together

#: Extent of a covered part, as root mean square in local coordinates, below which it is a sliver.
SLIVER = 1e-4
#: Extents below this are not scaled up, so that those of slivers fall below `SLIVER` relative to it.
FLOOR = 1e-2

#: Local coordinates of the corners, by their number.
CORNERS = {
    2: np.array([[-1.0], [1.0]]),
    3: np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    4: np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
}


@dataclass(frozen=True)
class DualBasis:
    """The dual functions on the covered parts of slave facets.

    Attributes:
        over_facet: Sums over the cells of each facet.
        over_pair: Sums over the cells of each pair.
        facet: Facet of each pair, shape (n_pairs,).
        area: Covered area of each facet, shape (n_facets,), [length²] or [length].
        coverage: D_e, shape (n_facets, corners), in the same unit.
        modes: The functions beside 1 at the quadrature points, see `_modes`, shape (n, q, m).
        at_corners: The same at the corners, shape (n_facets, corners, m).
        covariance: Means of the products of two of them over the covered part, shape (n_facets, m, m).
        inverse: Its pseudo-inverse over the area, shape (n_facets, m, m).
    """

    cells: Cells
    over_facet: SumsBy
    over_pair: SumsBy
    facet: np.ndarray
    area: np.ndarray
    coverage: np.ndarray
    modes: np.ndarray
    at_corners: np.ndarray
    covariance: np.ndarray
    inverse: np.ndarray

    @classmethod
    def on(cls, cells: Cells) -> DualBasis:
        """Build the basis of some cells."""
        over_facet, over_pair = SumsBy(cells.facet), SumsBy(cells.pair)
        facet = np.zeros(over_pair.groups, dtype=np.int64)
        facet[cells.pair] = cells.facet
        area = over_facet(cells.weight.sum(axis=1))
        coverage = over_facet(np.einsum("nq,nqk->nk", cells.weight, cells.slave))
        modes, at_corners = _modes(cells, over_facet, area)
        second = over_facet(np.einsum("nqa,nqb->nab", modes * cells.weight[:, :, None], modes))
        covariance = second / area[:, None, None]
        inverse = _pseudo_inverse(covariance) / area[:, None, None]
        return cls(
            cells, over_facet, over_pair, facet, area, coverage, modes, at_corners, covariance, inverse
        )

    def moments(self, functions: np.ndarray) -> np.ndarray:
        """Integrate functions, shape (n, q, f), times 1 and the modes over each pair, (n_pairs, 1 + m, f)."""
        weight = self.cells.weight[:, :, None]
        weighted = np.concatenate([weight, weight * self.modes], axis=2)
        return self.over_pair(weighted.transpose(0, 2, 1) @ functions)

    def values(self, moments: np.ndarray) -> np.ndarray:
        """Return the projections of functions at the corners, each pair's share, (n_pairs, corners, f)."""
        mean = moments[:, :1] / self.area[self.facet][:, None, None]
        return np.asarray(mean + (self.at_corners @ self.inverse)[self.facet] @ moments[:, 1:])

    def integrals(self, functions: np.ndarray) -> np.ndarray:
        """Integrate the dual functions times functions, shape (n, q, f), shape (n_pairs, corners, f)."""
        return np.asarray(self.coverage[self.facet][:, :, None] * self.values(self.moments(functions)))


def _modes(cells: Cells, over_facet: SumsBy, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the non-constant functions, of mean zero, that span the shape functions together with 1.

    Returns:
        At the quadrature points, shape (n, q, m), and at the corners of each facet, (n_facets, corners, m).
    """
    corners = cells.slave.shape[2]

    def centred(modes: np.ndarray, at_corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Twice: if the covered part is small, the first subtraction leaves a mean of its rounding errors.
        for _ in range(2):
            mean = over_facet(np.einsum("nq,nqa->na", cells.weight, modes)) / area[:, None]
            modes, at_corners = modes - mean[cells.facet][:, None], at_corners - mean[:, None]
        return modes, at_corners

    modes, at_corners = centred(cells.local, CORNERS[corners][None])
    if corners == 4:
        mixed = centred(modes.prod(axis=2, keepdims=True), at_corners.prod(axis=2, keepdims=True))
        modes, at_corners = (np.concatenate(p, axis=2) for p in zip((modes, at_corners), mixed, strict=True))
    return modes, at_corners


def _pseudo_inverse(covariance: np.ndarray) -> np.ndarray:
    """Invert symmetric matrices (n, m, m) except in directions of slivers, where the inverse is zero."""
    scale, _ = _scales(covariance)
    scaled = covariance / (scale[:, :, None] * scale[:, None])
    values, vectors = np.linalg.eigh(scaled)
    inverse = (vectors * _inverted(values)[:, None]) @ vectors.transpose(0, 2, 1)
    return np.asarray(inverse / (scale[:, :, None] * scale[:, None]), dtype=np.float64)


def _scales(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the extents (n, m) by which covariances are scaled, and which of them are their own."""
    floor = np.array([FLOOR, FLOOR, FLOOR**2])[: covariance.shape[1]]
    squares = np.diagonal(covariance, axis1=1, axis2=2)
    return np.sqrt(np.maximum(squares, floor**2)), squares > floor**2


def _inverted(values: np.ndarray) -> np.ndarray:
    """Return the inverses of eigenvalues, zero for those of slivers."""
    large = values > (SLIVER / FLOOR) ** 2
    return np.where(large, 1 / np.where(large, values, 1.0), 0.0)


def inverted_pulled_back(covariance: np.ndarray, by_inverse: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the pseudo-inverses of covariances, shape (n, m, m).

    With the eigenvectors V of X and a function f of its eigenvalues λ, δf(X) = V (Γ ∘ Vᵀ δX V) Vᵀ with the
    quotients Γ_ij = (f(λ_i) − f(λ_j)) / (λ_i − λ_j) (Daleckii and Krein): of 1/λ they are −1/(λ_i λ_j), and
    between λ and a sliver's, where f is zero, f(λ) / (λ − λ').
    """
    scale, own = _scales(covariance)
    both = scale[:, :, None] * scale[:, None]
    scaled = covariance / both
    values, vectors = np.linalg.eigh(scaled)
    inverted = _inverted(values)
    one, other = inverted[:, :, None], inverted[:, None]
    apart = values[:, :, None] - values[:, None]
    alone = (one == 0.0) != (other == 0.0)
    quotients = np.where(alone, (one - other) / np.where(alone, apart, 1.0), -one * other)
    inverse = (vectors * inverted[:, None]) @ vectors.transpose(0, 2, 1)
    by_scaled_inverse = by_inverse / both
    turned = vectors.transpose(0, 2, 1) @ by_scaled_inverse @ vectors
    by_scaled = vectors @ (quotients * turned) @ vectors.transpose(0, 2, 1)
    # Each entry is divided by the scales of its row and of its column.
    products = by_scaled_inverse * inverse + by_scaled * scaled
    by_scale = -(products.sum(axis=1) + products.sum(axis=2)) / scale
    result = by_scaled / both
    diagonal = np.arange(scale.shape[1])
    result[:, diagonal, diagonal] += np.where(own, by_scale / (2 * scale), 0.0)
    return np.asarray(result)


def relief_of_cells(
    cells: Cells,
    slave: FacetedSurface,
    master: FacetedSurface,
    pairs: tuple[np.ndarray, np.ndarray],
    along: np.ndarray,
) -> np.ndarray:
    """Return the height of the true slave over its facets less that of the master, shape (n, q), [length].

    `pairs`: slave facet and master facet of each pair, shape (n_pairs,) each; `along`: direction of the
    heights for each pair, out of the slave facet, shape (n_pairs, dim).
    """
    at_slave, at_master = (facet[cells.pair] for facet in pairs)
    direction = along[cells.pair]
    own = _heights_along(slave, at_slave, cells.local, cells.slave, direction)
    return own - _heights_along(master, at_master, cells.opposite, cells.master, direction)


def _heights_along(
    surface: FacetedSurface, facet: np.ndarray, local: np.ndarray, values: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Return heights along a direction whose angle to the normal is less than a facet's turn."""
    if surface.relief is None:
        return np.zeros(local.shape[:2])
    bulge = bulges_along(surface, facet, values, direction) if surface.cut.is_cut else 0.0
    points = local.shape[1]
    facet, direction = np.repeat(facet, points), np.repeat(direction, points, axis=0)
    values = values.reshape(len(facet), values.shape[-1])
    normal, _ = interpolated_normal(values, surface.normals[surface.facets[facet]])
    height = heights(surface, facet, local.reshape(len(facet), local.shape[-1])).value
    raised = np.asarray(height / np.einsum("nd,nd->n", normal, direction)).reshape(local.shape[:2])
    return np.asarray(raised - bulge)


def bulges_along(
    surface: FacetedSurface, facet: np.ndarray, values: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Return heights of quadratic facets over their linear pieces along directions, shape (n, q), [length].

    `facet`: piece of each group of points, shape (n,); `values`: its shape functions, shape (n, q, corners);
    `direction`: shape (n, dim).
    """
    curved = surface.cut.functions(facet, values)
    along, straight = (
        np.einsum("nkd,nd->nk", surface.points[nodes], direction)
        for nodes in (surface.cut.nodes(surface.facets, facet), surface.facets[facet])
    )
    return np.asarray(np.einsum("nqk,nk->nq", curved, along) - np.einsum("nqk,nk->nq", values, straight))


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
        normal: Unit normal from master to slave, the averaged slave normal reversed, at corners of the slave
            that of the master, see `normals`, shape (n, dim).
        relief: Weighted mean height of the true surfaces over their facets, slave less master, along the
            slave facets' normals, shape (n, dim), [length].
        gap: n_i · (x_i − Σ_j weight_ij x_j + relief_i), positive when open, shape (n,), [length].
        own: Weights of the slave's nodes in its mean that takes the place of x_i, shape (n,
            len(slave.nodes)); rows add up to one. None where the mean is the node. On quadratic facets these
            are ∫ ψ_i N_j / D_i with the quadratic functions. Where facets face the master entirely they are
            close to the identity: the spectrum of the symmetric part, in terms of D, lies between 0.69 and
            1.37 on all of them. Where the rim of the master covers facets in part, functions are extrapolated
            and it is wider, with negative values; once nodes that hardly face the master are gathered, see
            `gathering`, it was positive wherever the rim lay, between 0.36 and 2.14.
    """

    node: np.ndarray
    area: np.ndarray
    weight: sparse.csr_matrix
    normal: np.ndarray
    relief: np.ndarray
    gap: np.ndarray
    own: sparse.csr_matrix | None = None

    def part(self, chosen: np.ndarray) -> MortarCoupling:
        """Return some of the nodes, by indices or a mask."""
        names = [each.name for each in fields(self) if getattr(self, each.name) is not None]
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def of_slave(self, values: np.ndarray) -> np.ndarray:
        """Return the slave's means of values at its nodes, shape (len(slave.nodes), ...), shape (n, ...)."""
        return np.asarray(values[self.node] if self.own is None else self.own @ values)

    def of_slave_pulled_back(self, by: np.ndarray, n_nodes: int) -> np.ndarray:
        """Vector-Jacobian product of `of_slave` with respect to the values, shape (n_nodes, ...)."""
        if self.own is not None:
            return np.asarray(self.own.T @ by)
        result = np.zeros((n_nodes, *by.shape[1:]))
        result[self.node] = by
        return result


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

    `comm`: communicator of the ranks that share the work, all with the same surfaces; this one by default.

    References:
        Puso, M. A., Laursen, T. A.: A mortar segment-to-segment contact method for large deformation solid
        mechanics. Computer Methods in Applied Mechanics and Engineering 193 (2004).
        Popp, A., Gitterle, M., Gee, M. W., Wall, W. A.: A dual mortar approach for 3D finite deformation
        contact with consistent linearization. International Journal for Numerical Methods in Engineering 83
        (2010).
    """
    comm = comm or MPI.COMM_SELF
    mine = np.arange(comm.rank, len(slave.facets), comm.size)
    part: tuple[np.ndarray, sparse.csr_matrix, np.ndarray, sparse.csr_matrix] | None = None
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
    means: sparse.csr_matrix,
    least_share: float = 1e-8,
) -> MortarCoupling:
    """Keep the nodes that face the master, and divide by their areas.

    `least_share`: fraction of a node's area that must face the master for the node to carry a multiplier.
    """
    node = np.flatnonzero(area > least_share * slave.areas)
    weight, own = _scaled(integrals[node]), _scaled(means[node]) if slave.cut.is_cut else None
    normal = normals_at(slave, master, node, weight, area[node])
    raised = relief[node] / area[node, None]
    coupling = MortarCoupling(node, area[node], weight, normal, raised, np.zeros(len(node)), own)
    apart = coupling.of_slave(slave.points) - weight @ master.points + raised
    return replace(coupling, gap=np.einsum("nd,nd->n", normal, apart))


def _scaled(integrals: sparse.csr_matrix) -> sparse.csr_matrix:
    """Divide by the row sums: they are the areas, and this cancels their rounding errors."""
    weight = scaled_rows(integrals, 1 / np.asarray(integrals.sum(axis=1)).ravel())
    weight.sort_indices()
    return weight


def degree_on(slave: FacetedSurface, master: FacetedSurface) -> int:
    """Return the degree of quadrature: 8 with quadratic quadrilaterals or halves of any, else 5.

    On parallelograms 6 is enough, for bilinear dual functions and biquadratic shape functions. On other
    quadrilaterals they are no polynomials in the plane: a uniform pressure misses the nodal forces by up to
    9e-8 with degree 5, 2e-10 with 6 and 5e-13 with 8.
    """
    return max(slave.cut.degree, master.cut.degree)


def _integrals(
    slave: FacetedSurface, master: FacetedSurface, chosen: np.ndarray
) -> tuple[np.ndarray, sparse.csr_matrix, np.ndarray, sparse.csr_matrix]:
    """Integrate over the chosen facets.

    Returns D, shape (slave nodes,), M, shape (slave nodes, master nodes), ∫ ψ_i times the height of the
    true surfaces over their facets, slave less master, shape (slave nodes, dim), and of quadratic slaves
    ∫ ψ_i N_j with their own functions, shape (slave nodes, slave nodes), else zero.
    """
    count, area, relief = len(slave.nodes), np.zeros(len(slave.nodes)), np.zeros_like(slave.points)
    total, means = Entries((count, len(master.nodes))), Entries((count, count))
    if len(chosen) == 0 or len(master.facets) == 0:
        return area, total.matrix(), relief, means.matrix()
    planes = planes_of(slave, chosen)
    check_convex(planes, chosen)
    pairs = candidate_pairs(planes, planes_of(master, np.arange(len(master.facets))))
    degree = degree_on(slave, master)
    for pair_slave, pair_master in chunks(*pairs):
        overlaps = overlaps_of(planes, pair_slave, pair_master, master, degree)
        at_slave, both = overlaps.slave, (chosen[overlaps.slave], overlaps.master)
        cells = measured(cells_of(overlaps), slave, both[0])
        closer = relief_of_cells(cells, slave, master, both, planes.normal[at_slave])
        traces, basis = Traces.of(cells, (slave, master), both), DualBasis.on(cells)
        integrals = basis.integrals(np.concatenate([traces.functions, closer[:, :, None]], axis=2))
        np.add.at(area, slave.facets[chosen[overlaps.facets]], basis.coverage)
        row, width = slave.facets[both[0]], traces.master.shape[1]
        np.add.at(relief, row, integrals[:, :, -1:] * planes.normal[at_slave][:, None])
        total.add(row, traces.master, integrals[:, :, :width])
        means.add(row, traces.slave, integrals[:, :, width:-1])
    return area, total.matrix(), relief, means.matrix()


class Entries:
    """Entries of a sparse matrix, summed once: adding matrices chunk by chunk would copy them all."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape, self._parts = shape, list[tuple[np.ndarray, np.ndarray, np.ndarray]]()

    def add(self, row: np.ndarray, column: np.ndarray, values: np.ndarray) -> None:
        """Add blocks, shape (n, k, m), in rows (n, k) and columns (n, m)."""
        rows, columns = np.broadcast_arrays(row[:, :, None], column[:, None])
        self._parts.append((values.ravel(), rows.ravel(), columns.ravel()))

    def matrix(self) -> sparse.csr_matrix:
        """Return the sum."""
        if not self._parts:
            return Csr(self.shape)
        values, row, column = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        return Csr((values, (row, column)), shape=self.shape)


def measured(cells: Cells, slave: FacetedSurface, facet: np.ndarray) -> Cells:
    """Return cells whose weights are those of the slave's measure.

    `facet`: slave facet of each pair, shape (n_pairs,).
    """
    first = slave.points[slave.facets[facet[cells.pair]], 0]
    return replace(cells, weight=slave.measure.weights(cells.weight, cells.slave, first))


def chunks(
    pair_slave: np.ndarray, pair_master: np.ndarray, size: int = CHUNK
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Split the list of pairs where the slave facet changes, after about ``size`` of them."""
    starts = np.flatnonzero(np.diff(pair_slave, prepend=-1))
    cuts = starts[np.flatnonzero(np.diff(starts // size, prepend=-1))]
    for begin, end in pairwise([*cuts, len(pair_slave)]):
        yield pair_slave[begin:end], pair_master[begin:end]
