"""Mortar contact points: slave nodes with the means that they meet, and gaps that displacements can close.

Where the gap g closes, the slave moves by (1 − s) g and the master by s g, s its share of the compliance, up
to rigid motions. The constraint contains linear interpolants of that, I g on the slave and J g on the master:
it can close (1 − s) g(x_i) + s ∫ ψ_i J g. The mean of g itself includes its curvature between nodes. Nodes
that are partly beside the other surface keep that mean, and so do points with several nodes of the slave.

Dual functions are negative in places. Where a surface turns away from the other one in a crease, so that the
gap is no smooth function, such a mean may be below all gaps of the nodes in it, and bodies that only touch
would be pressed apart: there no point has less than the gap of its node. This holds for each point by itself,
so that gaps are continuous functions of a design.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.by_master import with_inclined
from fenics_contact._pairing.mortar.coupling import MortarCoupling, mortar_coupling
from fenics_contact._pairing.mortar.derivatives import SurfaceDerivatives
from fenics_contact._pairing.mortar.gathering import CondensedDualBasis, OwnDualBasis
from fenics_contact._pairing.projection import shared_projection
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import Projection
from fenics_contact._surfaces.true_surface import wedges_of


@dataclass(frozen=True)
class ClosableGaps:
    """Gaps of a coupling and what they consist of.

    Attributes:
        value: The gaps, shape (n,), [length].
        kept: Whether it is the coupling's own mean, shape (n,).
        share: Part of each that comes from the nodes of the master, s or zero, shape (n,).
        here: Projections of slave nodes onto the master, numbered as ``slave.nodes``.
        there: Projections of master nodes onto the slave, numbered as ``master.nodes``.
        own: Gaps of the slave nodes, zero where there is none, shape (len(slave.nodes),), [length].
        opposite: Their gaps, zero where there is none, shape (len(master.nodes),), [length].
        nodal: Whether it is the gap of the node alone, at creases, shape (n,).
    """

    value: np.ndarray
    kept: np.ndarray
    share: np.ndarray
    here: Projection
    there: Projection
    own: np.ndarray
    opposite: np.ndarray
    nodal: np.ndarray

    def by_nodes(self, coupling: MortarCoupling, by_own: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of the slave's part of the gaps with respect to `own`, in its shape.

        `by_own`: derivative by that part, shape (n,).
        """
        result = coupling.of_slave_pulled_back(np.where(self.nodal, 0.0, by_own), len(self.own))
        result[coupling.node[self.nodal]] += by_own[self.nodal]
        return result


def closable_gaps(
    slave: FacetedSurface,
    master: FacetedSurface,
    coupling: MortarCoupling,
    share: float,
    comm: MPI.Comm,
    alone: np.ndarray,
    creased: np.ndarray,
) -> ClosableGaps:
    """Return the gaps that linear displacements can close. Collective.

    `comm`: communicator of the ranks that share the work; `alone`: whether a point has no dual function but
    its own, shape (n,); others keep their mean; `creased`: which are at creases, shape (n,).
    """
    weight, mine = coupling.weight, coupling.node
    if coupling.own is not None:
        mine = np.flatnonzero(np.bincount(coupling.own.indices, minlength=len(slave.nodes)))
    nodes = np.flatnonzero(np.bincount(weight.indices, minlength=weight.shape[1]))
    if master.followed is not None:
        nodes = np.union1d(nodes, master.followed[nodes].indices)
    here = shared_projection(slave, mine, master, comm)
    there = shared_projection(master, nodes, slave, comm)
    here, there = (
        replace(hit, point=chosen[hit.point], lost=chosen[hit.lost])
        for hit, chosen in ((here, mine), (there, nodes))
    )
    gaps, opposite = np.full(len(slave.nodes), np.nan), np.full(weight.shape[1], np.nan)
    gaps[here.point], opposite[there.point] = here.gap, there.gap
    if slave.followed is not None:  # displacements can close the mean of their masters' gaps there
        gaps = slave.followed @ gaps
    own = coupling.of_slave(gaps)
    if master.followed is not None:
        opposite = master.followed @ opposite
    lost = abs(weight) @ np.isnan(opposite).astype(np.float64) > 0
    opposite = np.nan_to_num(opposite)
    across = np.where(lost, own, weight @ opposite)
    closable = (1.0 - share) * own + share * across
    kept = np.isnan(closable) | ~alone
    value = np.where(kept, coupling.gap, closable)
    at_node = gaps[coupling.node]
    nodal = creased & (value < at_node)
    value, kept = np.where(nodal, at_node, value), kept & ~nodal
    shares = np.where(lost | kept | nodal, 0.0, share)
    return ClosableGaps(value, kept, shares, here, there, np.nan_to_num(gaps), opposite, nodal)


def _at_creases(slave: FacetedSurface, master: FacetedSurface, coupling: MortarCoupling) -> np.ndarray:
    """Return which points have nodes at creases of either surface in their means, shape (n,)."""
    sharp = [
        (np.bincount(wedges_of(side).node, minlength=len(side.nodes)) > 1).astype(float)
        for side in (slave, master)
    ]
    found = abs(coupling.weight) @ sharp[1]
    own = sharp[0][coupling.node] if coupling.own is None else abs(coupling.own) @ sharp[0]
    return np.asarray(found + own > 0.0)


@displayed
@dataclass(frozen=True)
class MortarPoints:
    """Slave nodes with the mean of the master that each of them meets.

    Attributes:
        coupling: Their coupling, at some of its nodes.
        gathering: What the nodes gather of others that hardly face the master.
        closable: Gaps that linear displacements can close; None where both surfaces are their facets.
    """

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
    gathering: CondensedDualBasis | OwnDualBasis
    closable: ClosableGaps | None

    @classmethod
    def of(
        cls,
        slave: FacetedSurface,
        master: FacetedSurface,
        bearing: np.ndarray,
        share: float,
        comm: MPI.Comm | None = None,
        movable: np.ndarray | None = None,
    ) -> MortarPoints:
        """Couple two surfaces. Collective on ``comm``.

        `bearing`: which slave nodes may carry one, shape (n_nodes,); `comm`: communicator of the ranks that
        share the work; this one by default; `movable`: which of them supports leave free, by default those.
        """
        comm = comm or MPI.COMM_SELF
        slave, coupling = with_inclined(slave, master, mortar_coupling(slave, master, comm))
        gathering = CondensedDualBasis.of(coupling, slave, bearing if movable is None else movable)
        coupling = gathering.coupling(slave, master)
        chosen = np.flatnonzero(bearing[coupling.node])
        coupling = coupling.part(chosen)
        gathering = gathering.chosen(chosen)
        flat, closable = slave.relief is None and master.relief is None, None
        alone = np.zeros(len(chosen), dtype=bool) if flat else ~gathering.gathers
        creased = _at_creases(slave, master, coupling)
        if not flat or creased.any():
            closable = closable_gaps(slave, master, coupling, share, comm, alone, creased)
        return cls(slave, master, coupling, gathering, closable)

    @property
    def gap(self) -> np.ndarray:
        """The gaps, shape (n,), [length]."""
        return self.coupling.gap if self.closable is None else self.closable.value

    @property
    def weight(self) -> sp.csr_matrix:
        """Weights of the nodes of slave and, after them, of master in the point that a slave node meets.

        Nodes of the slave have such weights where several of them are in its mean, which takes the place of
        the node. Rows add up to one, shape (n, len(slave.nodes) + len(master.nodes)).
        """
        count, n_slave = len(self.coupling.node), len(self.slave.nodes)
        lacking, own = Csr((count, n_slave)), self.coupling.own
        if own is not None:
            entries = np.ones(count), self.coupling.node, np.arange(count + 1)
            lacking = Csr(entries, shape=lacking.shape) - own
            lacking.eliminate_zeros()
        return sp.hstack([lacking, self.coupling.weight], format="csr")

    def pulled_back(
        self, by: CouplingDerivatives, comm: MPI.Comm | None = None
    ) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
        """Vector-Jacobian product of the coupling by slave and master. Collective on ``comm``."""
        return self.gathering.by_surfaces((self.slave, self.master), self.coupling, by, comm)
