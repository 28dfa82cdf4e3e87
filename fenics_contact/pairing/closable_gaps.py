"""Gaps between true surfaces that linear displacements can close, at the points of a mortar coupling.

Where the gap g closes, the slave moves by (1 − s) g and the master by s g, s its share of the compliance, up
to rigid motions. The constraint contains linear interpolants of that, I g on the slave and J g on the master:
it can close (1 − s) g(x_i) + s ∫ ψ_i J g. The mean of g itself includes its curvature between nodes. Nodes
that are partly beside the other surface keep that mean, and so do points with several nodes of the slave.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.pairing.shared_projection import shared_projection
from fenics_contact.surfaces import FacetedSurface, Projection

if TYPE_CHECKING:
    from fenics_contact.pairing.mortar import MortarCoupling


@dataclass(frozen=True)
class ClosableGaps:
    """Gaps of a coupling and what they consist of.

    Attributes:
        value: The gaps, shape (n,), [length].
        kept: Whether it is the coupling's own mean, shape (n,).
        share: Part of each that comes from the nodes of the master, s or zero, shape (n,).
        here: Projections of the slave nodes onto the master, numbered as the coupling's nodes.
        there: Projections of master nodes onto the slave, numbered as ``master.nodes``.
        opposite: Their gaps, zero where there is none, shape (len(master.nodes),), [length].
    """

    value: np.ndarray
    kept: np.ndarray
    share: np.ndarray
    here: Projection
    there: Projection
    opposite: np.ndarray


def closable_gaps(
    slave: FacetedSurface,
    master: FacetedSurface,
    coupling: MortarCoupling,
    share: float,
    comm: MPI.Comm,
    alone: np.ndarray,
) -> ClosableGaps:
    """Return the gaps that linear displacements can close. Collective.

    Args:
        slave: The slave surface.
        master: The master surface.
        coupling: Coupling of both, or some of its nodes.
        share: s, the master's share of the motion that closes the gap.
        comm: Communicator of the ranks that share the work.
        alone: Whether a point has no node of the slave but its own, shape (n,); others keep their mean.
    """
    weight = coupling.weight
    nodes = np.flatnonzero(np.bincount(weight.indices, minlength=weight.shape[1]))
    here = shared_projection(slave, coupling.node, master, comm)
    there = shared_projection(master, nodes, slave, comm)
    there = replace(there, point=nodes[there.point], lost=nodes[there.lost])
    own, opposite = np.full(len(coupling.node), np.nan), np.full(weight.shape[1], np.nan)
    own[here.point], opposite[there.point] = here.gap, there.gap
    lost = abs(weight) @ np.isnan(opposite).astype(np.float64) > 0
    opposite = np.nan_to_num(opposite)
    across = np.where(lost, own, weight @ opposite)
    closable = (1.0 - share) * own + share * across
    kept = np.isnan(closable) | ~alone
    value = np.where(kept, coupling.gap, closable)
    return ClosableGaps(value, kept, np.where(lost | kept, 0.0, share), here, there, opposite)
