"""Projection of some nodes of a surface onto another one, shared by the ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.surfaces import FacetedSurface, Projection, join, project


def shared_projection(
    slave: FacetedSurface, chosen: np.ndarray, master: FacetedSurface, comm: MPI.Comm
) -> Projection:
    """Project nodes of the slave, distributed round-robin over the ranks. Collective.

    Args:
        slave: Surface of the nodes.
        chosen: Positions in its nodes; the projection numbers these, shape (n,).
        master: The surface to project on.
        comm: Communicator of the ranks; all receive all projections.
    """
    mine = np.arange(comm.rank, len(chosen), comm.size)
    projection: Projection | None = None
    with together(comm):
        part = chosen[mine]
        hit = project(slave.points[part], slave.normals[part], master)
        projection = replace(hit, point=mine[hit.point], lost=mine[hit.lost])
    return join([part for part in comm.allgather(projection) if part is not None])
