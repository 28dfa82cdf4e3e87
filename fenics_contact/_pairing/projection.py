"""Projection of some nodes of a surface onto another one, shared by the ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import Projection, join, project
from fenics_contact.errors import together


def shared_projection(
    slave: FacetedSurface, chosen: np.ndarray, master: FacetedSurface, comm: MPI.Comm
) -> Projection:
    """Project nodes of the slave, distributed round-robin over the ranks. Collective.

    `chosen`: positions in its nodes; the projection numbers these, shape (n,); `comm`: communicator of the
    ranks; all receive all projections.
    """
    mine = np.arange(comm.rank, len(chosen), comm.size)
    projection: Projection | None = None
    with together(comm):
        part = chosen[mine]
        hit = project(slave.points[part], slave.normals[part], master)
        projection = replace(hit, point=mine[hit.point], lost=mine[hit.lost])
    return join([part for part in comm.allgather(projection) if part is not None])
