"""Warnings about ties by nodes that reach beyond the master's edge."""

from __future__ import annotations

import logging

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import safe_log
from fenics_contact.pairing.shared_projection import shared_projection
from fenics_contact.scene import Tie
from fenics_contact.surfaces import FacetedSurface, shape_functions

#: Weights of nodes that are not tied below this are rounding.
LEAST = 1e-6

_LOG = logging.getLogger(__name__)


def warn_of_edge(
    tie: Tie, slave: FacetedSurface, held: np.ndarray, master: FacetedSurface, comm: MPI.Comm
) -> None:
    """Warn where nodes beyond the master's edge leave a part of the master to the others. Collective.

    Slave facets that the edge crosses are tied at some of their nodes alone; what the master transmits to
    them between these nodes and its edge is missing.

    Args:
        tie: A tie by nodes.
        slave: Its slave.
        held: Which nodes of the slave are tied or held by supports, shape (n_nodes,).
        master: Its master.
        comm: Communicator of the ranks that share the work; rank 0 logs.
    """
    whole, some = (each(held[slave.facets], axis=1) for each in (np.all, np.any))
    if not np.any(some & ~whole):
        return
    hit = shared_projection(master, np.arange(len(master.nodes)), slave, comm)
    weights, _ = shape_functions(hit.local, slave.corners)
    nodes = slave.facets[hit.facet]
    off = (np.abs(weights) * ~held[nodes]).sum(axis=1) > LEAST
    crossed = off & some[hit.facet]
    share = master.areas[hit.point[crossed]].sum() / max(master.areas[hit.point].sum(), np.finfo(float).tiny)
    if share > 0.0 and comm.rank == 0:
        safe_log(
            _LOG.warning,
            "the tie of %s is by nodes, and the master ends within %d of %d facets of the slave that meet "
            "it: only some of their nodes are tied, %.2g %% of the master's surface lies under them, and "
            "about as much of the force may be lost; take discretisation='mortar', or let the smaller "
            "surface be the slave",
            tie.place, np.count_nonzero(some & ~whole), np.count_nonzero(some), 100.0 * share,
        )  # fmt: skip
