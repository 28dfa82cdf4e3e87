"""Points of mortar contact and the reverse mode through them; the coupling is loaded where there are any."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.display import displayed
from fenics_contact.pairing.closable_gaps import ClosableGaps, closable_gaps
from fenics_contact.pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact.surfaces import FacetedSurface

if TYPE_CHECKING:
    from fenics_contact.pairing.mortar import Gathering, MortarCoupling, SurfaceDerivatives


@displayed
@dataclass(frozen=True)
class MortarPoints:
    """Slave nodes with the mean of the master that each of them meets.

    Attributes:
        slave: Surface that carries the multipliers.
        master: The opposite surface.
        coupling: Their coupling, at some of its nodes.
        gathering: What the nodes gather of others that hardly face the master; None if there are none.
        closable: Gaps that linear displacements can close; None where both surfaces are their facets.
    """

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
    gathering: Gathering | None
    closable: ClosableGaps | None

    @classmethod
    def of(
        cls,
        slave: FacetedSurface,
        master: FacetedSurface,
        bearing: np.ndarray,
        share: float,
        comm: MPI.Comm | None = None,
    ) -> MortarPoints:
        """Couple two surfaces. Collective on ``comm``.

        Args:
            slave: Surface that carries the multipliers.
            master: The opposite surface.
            bearing: Which slave nodes may carry one, shape (n_nodes,).
            share: The master's share of the motion that closes the gap.
            comm: Communicator of the ranks that share the work; this one by default.
        """
        from fenics_contact.pairing.mortar import Gathering, mortar_coupling

        comm = comm or MPI.COMM_SELF
        coupling = mortar_coupling(slave, master, comm)
        gathering = Gathering.of(coupling, slave)
        if gathering is not None:
            coupling = gathering.coupling(slave, master)
        chosen = np.flatnonzero(bearing[coupling.node])
        coupling = coupling.part(chosen)
        gathering = None if gathering is None else gathering.chosen(chosen)
        flat, closable = slave.relief is None and master.relief is None, None
        if not flat:
            alone = np.ones(len(chosen), dtype=bool) if gathering is None else ~gathering.gathers
            closable = closable_gaps(slave, master, coupling, share, comm, alone)
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
        lacking = sp.csr_matrix((count, n_slave))
        if self.gathering is not None:
            entries = np.ones(count), self.coupling.node, np.arange(count + 1)
            lacking = sp.csr_matrix(entries, shape=lacking.shape) - self.gathering.weights(n_slave)
            lacking.eliminate_zeros()
        return sp.hstack([lacking, self.coupling.weight], format="csr")

    def pulled_back(
        self, by: CouplingDerivatives, comm: MPI.Comm | None = None
    ) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
        """Vector-Jacobian product of the coupling by slave and master. Collective on ``comm``."""
        from fenics_contact.pairing.mortar import mortar_pulled_back

        slave, master, coupling, gathering = self.slave, self.master, self.coupling, self.gathering
        if gathering is None:
            return mortar_pulled_back(slave, master, coupling, by, comm)
        whole, places = gathering.whole, (slave.points, master.points)
        by_whole = gathering.pulled_back(coupling, by, places)
        by_slave, by_master = mortar_pulled_back(slave, master, whole, by_whole, comm)
        along = by.gap[:, None] * coupling.normal
        apart = gathering.own @ slave.points[whole.node] - coupling.weight @ master.points + coupling.relief
        by_slave.normals[coupling.node] -= by.normal + by.gap[:, None] * apart
        by_slave.points[whole.node] += gathering.own.T @ along
        by_master.points[:] -= coupling.weight.T @ along
        return by_slave, by_master
