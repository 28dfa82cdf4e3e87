"""Warnings about the surfaces between which gaps are measured."""

from __future__ import annotations

import logging

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import safe_log
from fenics_contact.scene import Scene, Surface
from fenics_contact.surfaces import FacetedSurface, Geometry

#: Nodes count as on their shape if their distance is no more than this fraction of an edge.
ON_SHAPE = 1e-6

_LOG = logging.getLogger(__name__)


def warn_of_surface(
    scene: Scene, surface: Surface, geometry: Geometry, faceted: FacetedSurface, comm: MPI.Comm
) -> None:
    """Warn of nodes off their shape, and of reconstructed facets that stay flat.

    Args:
        scene: The scene.
        surface: Slave or master of a pair.
        geometry: Its representation in the pair.
        faceted: The resulting surface.
        comm: Communicator; rank 0 logs.
    """
    mesh = scene.bodies[surface.body].mesh.origin
    away = mesh.off_shapes.get(surface.name) if geometry == "best" else None
    name = f"surface {surface.name!r} of {surface.body!r}"
    if comm.rank > 0:
        return
    if away is not None and (off := np.count_nonzero(away > ON_SHAPE)):
        safe_log(
            _LOG.warning,
            "%d of %d nodes of %s lie off its shape, %s, by up to %.3g of an edge: gaps are measured "
            "from the nodes where they are; move them onto the shape, or correct it",
            off, len(away), name, type(mesh.shapes[surface.name]).__name__, away.max(),
        )  # fmt: skip
    flattened = 0 if faceted.relief is None else faceted.relief.flattened
    if flattened:
        safe_log(
            _LOG.warning,
            "%d of %d facets of %s stay flat, as the surface that their nodes suggest has cusps there or "
            "folds: refine the mesh there, give the surface its shape, or take geometry='faceted'",
            flattened, len(faceted.facets), name,
        )  # fmt: skip
