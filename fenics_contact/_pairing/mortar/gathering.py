"""Slave nodes that hardly face the master, or cannot move, give their dual functions to their neighbours.

Where the rim of the master lies over a slave facet, the dual functions of the corners beyond it are
extrapolated from the covered part. However small this is, a multiplier there keeps a node beyond the rim
from moving, with a force that does not vanish with its area: its pressure has no bound. So such nodes carry
none, and the dual function of a neighbour becomes ψ_j + Σ_i T_ji ψ_i. All functions still add up to one:
constant pressures and linear displacements stay exact, forces and moments in balance. The constraint of a
neighbour is the mean, weighted by areas, of those that it gathers: it contains several nodes of the slave.

Nodes that supports hold carry no multiplier either. Where the surfaces end there, displacements next to them
would have first order alone without their functions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import scaled_rows
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.by_master import NormalsPulledBack
from fenics_contact._pairing.mortar.coupling import MortarCoupling
from fenics_contact._pairing.mortar.derivatives import SurfaceDerivatives, add_normals, mortar_pulled_back
from fenics_contact._pairing.mortar.normals import normals_at
from fenics_contact._surfaces.facets import FacetedSurface


@dataclass(frozen=True)
class OwnDualBasis:
    """Points that have no dual functions but their own, with the members of a `CondensedDualBasis`.

    Attributes:
        whole: The coupling of all nodes that face the master.
        count: Number of points.
    """

    whole: MortarCoupling
    count: int

    def chosen(self, points: np.ndarray) -> OwnDualBasis:
        """Return some of the points, by indices."""
        return replace(self, count=len(points))

    @property
    def gathers(self) -> np.ndarray:
        """Whether each point has more than its own dual function, shape (n,)."""
        return np.zeros(self.count, dtype=bool)

    def coupling(self, slave: FacetedSurface, master: FacetedSurface) -> MortarCoupling:
        """Return the coupling at the points."""
        return self.whole

    def by_surfaces(
        self,
        sides: tuple[FacetedSurface, FacetedSurface],
        coupling: MortarCoupling,
        by: CouplingDerivatives,
        comm: MPI.Comm | None,
    ) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
        """Vector-Jacobian product of the coupling at the points by slave and master. Collective."""
        return mortar_pulled_back(*sides, coupling, by, comm)


@dataclass(frozen=True)
class CondensedDualBasis:
    """Points that gather the dual functions of several nodes.

    Attributes:
        whole: The coupling of all nodes that face the master.
        point: Which of these nodes each point is, shape (n,).
        part: T, what each point has of the dual function of each of these nodes, shape (n, n_whole).
        own: Weights of these nodes in the slave's mean at each point, shape (n, n_whole); rows add up to one.
    """

    whole: MortarCoupling
    point: np.ndarray
    part: sp.csr_matrix
    own: sp.csr_matrix

    @classmethod
    def of(
        cls,
        whole: MortarCoupling,
        slave: FacetedSurface,
        bearing: np.ndarray | None = None,
        least_share: float = 0.05,
    ) -> CondensedDualBasis | OwnDualBasis:
        """Return which points gather what, nothing if all nodes face the master well and can move.

        A node without a neighbour that does keeps its multiplier, and so do all where the rest could not
        bear a body that tips.

        `bearing`: which nodes may carry a multiplier, shape (len(slave.nodes),), by default all;
        `least_share`: fraction of a node's area below which it hardly faces the master.
        """
        well = whole.area > least_share * slave.areas[whole.node]
        if bearing is not None:
            well &= bearing[whole.node]
        hardly = np.flatnonzero(~well)
        shared = _shared_facets(whole.node, slave)[np.flatnonzero(well)][:, hardly]
        facets = np.asarray(shared.sum(axis=0)).ravel()
        points = np.union1d(np.flatnonzero(well), hardly[facets == 0.0])
        if len(points) == len(well) or not _spans_rotations(slave, whole.node[points]):
            return OwnDualBasis(whole, len(whole.node))
        shares = (shared @ sp.diags(1.0 / np.maximum(facets, 1.0))).tocoo()
        count = len(points)
        place = np.searchsorted(points, np.flatnonzero(well)[shares.row])
        row, column = np.append(np.arange(count), place), np.append(points, hardly[shares.col])
        entries = np.append(np.ones(count), shares.data), (row, column)
        part = Csr(entries, shape=(count, len(well)))
        own = part @ sp.diags(whole.area)
        return cls(whole, points, part, scaled_rows(own, 1.0 / np.asarray(own.sum(axis=1)).ravel()))

    def chosen(self, points: np.ndarray) -> CondensedDualBasis:
        """Return some of the points, by indices."""
        return replace(self, point=self.point[points], part=self.part[points], own=self.own[points])

    @property
    def gathers(self) -> np.ndarray:
        """Whether each point has more than its own dual function, shape (n,)."""
        return np.diff(self.part.indptr) > 1

    def coupling(self, slave: FacetedSurface, master: FacetedSurface) -> MortarCoupling:
        """Return the coupling at the points."""
        whole = self.whole
        node = whole.node[self.point]
        weight, relief = (self.own @ whole.weight).tocsr(), self.own @ whole.relief
        weight.sort_indices()
        area, own = self.part @ whole.area, self._own_means(len(slave.nodes))
        normal = normals_at(slave, master, node, weight, area)
        gap = np.einsum("nd,nd->n", normal, own @ slave.points - weight @ master.points + relief)
        return MortarCoupling(node, area, weight, normal, relief, gap, own)

    def _own_means(self, n_nodes: int) -> sp.csr_matrix:
        """Return the weights of the slave's nodes in its means, shape (n, n_nodes)."""
        own, of_whole = self.own, self.whole.own
        if of_whole is not None:
            return (own @ of_whole).tocsr()
        return Csr((own.data, self.whole.node[own.indices], own.indptr), (own.shape[0], n_nodes))

    def by_surfaces(
        self,
        sides: tuple[FacetedSurface, FacetedSurface],
        coupling: MortarCoupling,
        by: CouplingDerivatives,
        comm: MPI.Comm | None,
    ) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
        """Vector-Jacobian product of the coupling at the points by slave and master. Collective."""
        slave, master = sides
        turned = NormalsPulledBack.of(slave, master, coupling, by)
        places = slave.points, master.points
        by_whole = self.pulled_back(coupling, turned.with_weights(by, master), places)
        found = mortar_pulled_back(slave, master, self.whole, by_whole, comm)
        add_normals(found, turned, coupling, by)
        return found

    def pulled_back(
        self, coupling: MortarCoupling, by: CouplingDerivatives, places: tuple[np.ndarray, np.ndarray]
    ) -> CouplingDerivatives:
        """Vector-Jacobian product of the points with respect to the whole coupling, places and normals fixed.

        `places`: coordinates of the nodes of slave and master, [length].
        """
        whole, middle = self.whole, places[0].mean(axis=0)
        along = by.gap[:, None] * coupling.normal
        left = np.concatenate([by.left, -along], axis=1)
        right = np.concatenate([by.right, places[1] - middle], axis=1)
        own = np.zeros((len(places[0]), by.right.shape[1])) if by.own is None else by.own
        own = np.concatenate([own, places[0] - middle], axis=1)
        means = whole.of_slave(own)
        # Of the weights T_ji D_i / Σ_k T_jk D_k, and through them of the areas.
        here, there = self.part.nonzero()
        share, weight = (np.asarray(each[here, there]).ravel() for each in (self.part, self.own))
        by_weight = np.einsum("nr,nr->n", left[here], (whole.weight @ right - means)[there])
        by_weight += np.einsum("nd,nd->n", along[here], whole.relief[there])
        mean = np.bincount(here, weight * by_weight, len(coupling.node))
        by_areas = share * ((by_weight - mean[here]) / coupling.area[here] + by.area[here])
        count, dim = whole.normal.shape
        return CouplingDerivatives(
            np.bincount(there, by_areas, count), self.own.T @ left, right, np.zeros((count, dim)),
            np.zeros(count), own, self.own.T @ along,
        )  # fmt: skip


def _shared_facets(node: np.ndarray, slave: FacetedSurface) -> sp.csr_matrix:
    """Return the number of facets that two of some nodes have in common, shape (n, n)."""
    number = np.full(len(slave.nodes), -1)
    number[node] = np.arange(len(node))
    facet, corner = np.nonzero(number[slave.facets] >= 0)
    entries = np.ones(len(facet)), (facet, number[slave.facets][facet, corner])
    of_facets = Csr(entries, shape=(len(slave.facets), len(node)))
    return (of_facets.T @ of_facets).tocsr()


def _spans_rotations(slave: FacetedSurface, nodes: np.ndarray) -> bool:
    """Return whether some nodes extend in all directions of their surface, as a row of them does not."""
    if len(nodes) < slave.dim:
        return False
    places = slave.points[nodes]
    extents = np.linalg.svd(places - places.mean(axis=0), compute_uv=False) / np.sqrt(len(nodes))
    width = np.median(slave.sizes[nodes])
    return bool(extents[slave.dim - 2] > 0.25 * width)
