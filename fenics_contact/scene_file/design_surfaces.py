"""Surfaces that a design may move: crowns of chain links, sides of boxes."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface
from fenics_contact.mesh import BodyMesh, vector_areas
from fenics_contact.scene_file.placing import Shaped


def design_surface(shape: Shaped, surface: str, body: str) -> DesignSurface:
    """Return a surface with its smooth coordinates.

    Args:
        shape: The body's mesh with its shape.
        surface: "contact" of a chain link, or a flat side of a structured box.
        body: Name of the body, for messages.

    Raises:
        InvalidInputError: If the surface is neither.
    """
    if shape.crown is not None and surface == "contact":
        return shape.crown
    facets = shape.mesh.surfaces.get(surface)
    lattice = None if facets is None or shape.mesh.dim != 3 else _flat(shape.mesh, facets)
    if lattice is None:
        raise InvalidInputError(
            f"a design needs the surface 'contact' of a chain link or a flat side of a block, got "
            f"{surface!r} of {body!r}, which has {sorted(shape.mesh.surfaces)}: for other surfaces write a "
            "DesignSurface in Python"
        )
    return lattice


def _flat(mesh: BodyMesh, facets: np.ndarray) -> DesignSurface | None:
    """Return the lattice of nodes of a flat side; None for other surfaces."""
    areas = vector_areas(mesh.points, facets)
    normal = areas.sum(axis=0) / np.linalg.norm(areas, axis=1).sum()
    if np.linalg.norm(normal) < 1 - 1e-9 or np.abs(normal).max() < 1 - 1e-9:
        return None  # curved, or not parallel to the axes
    nodes = np.unique(facets)
    axes = [axis for axis in range(3) if axis != int(np.argmax(np.abs(normal)))]
    places = mesh.points[nodes][:, axes]
    size = np.ptp(places, axis=0)
    parameters = (places - places.min(axis=0)) / size
    ticks = [np.unique(column.round(9)) for column in parameters.T]
    if len(ticks[0]) * len(ticks[1]) != len(nodes):
        return None
    order = np.lexsort((parameters[:, 1].round(9), parameters[:, 0].round(9)))
    directions = np.tile(normal, (len(nodes), 1))
    return DesignSurface(nodes[order], parameters[order], directions, (len(ticks[0]), len(ticks[1])))
