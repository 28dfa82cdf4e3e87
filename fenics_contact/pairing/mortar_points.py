"""Points of mortar contact and the reverse mode through them; the coupling is loaded where there are any."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.display import displayed
from fenics_contact.pairing.closable_gaps import ClosableGaps, closable_gaps
from fenics_contact.pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact.surfaces import FacetedSurface

if TYPE_CHECKING:
    from fenics_contact.pairing.mortar import MortarCoupling, SurfaceDerivatives


@displayed
@dataclass(frozen=True)
class MortarPoints:
    """Slave nodes with the mean of the master that each of them meets.

    Attributes:
        slave: Surface that carries the multipliers.
        master: The opposite surface.
        coupling: Their coupling, at some of its nodes.
        closable: Gaps that linear displacements can close; None where both surfaces are their facets.
    """

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
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
        from fenics_contact.pairing.mortar import mortar_coupling

        comm = comm or MPI.COMM_SELF
        whole = mortar_coupling(slave, master, comm)
        coupling = whole.part(np.flatnonzero(bearing[whole.node]))
        flat = slave.relief is None and master.relief is None
        closable = None if flat else closable_gaps(slave, master, coupling, share, comm)
        return cls(slave, master, coupling, closable)

    @property
    def gap(self) -> np.ndarray:
        """The gaps, shape (n,), [length]."""
        return self.coupling.gap if self.closable is None else self.closable.value

    def pulled_back(
        self, by: CouplingDerivatives, comm: MPI.Comm | None = None
    ) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
        """Return the derivatives by slave and master from those by the coupling. Collective on ``comm``."""
        from fenics_contact.pairing.mortar import mortar_pulled_back

        return mortar_pulled_back(self.slave, self.master, self.coupling, by, comm)
