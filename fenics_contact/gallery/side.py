"""Sides of structured meshes as surfaces that a design may move."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.link import DesignSurface
from fenics_contact.mesh import BodyMesh, vector_areas

#: Smallest cosine of the angle between a facet's normal and the axis along which the side is seen as a grid.
STEEP = 0.5


def side_of(mesh: BodyMesh, surface: str) -> DesignSurface:
    """Return a side of a structured mesh as a design surface: flat, or curved gently.

    Seen along one of the axes x, y, z its nodes form a rectangular grid, as those of every side of a `block`,
    also of one whose nodes were moved along that axis. The parameters are the places in this grid; a node
    moves along the mean of the normals of its facets, weighted by their areas.

    Args:
        mesh: A mesh in space, of linear cells.
        surface: Name of the side.

    Raises:
        InvalidInputError: If there is no such surface, or it is no grid.

    Example:
        >>> from fenics_contact.gallery import block
        >>> side_of(block((0, 0, 0), (4, 2, 1), (8, 4, 2)), "z1").counts
        (9, 5)
    """
    facets = mesh.surfaces.get(surface)
    found = None if facets is None or mesh.dim != 3 or mesh.order > 1 else _grid(mesh, facets)
    if found is None:
        raise InvalidInputError(
            "a design by the name of a surface needs one whose nodes form a rectangular grid seen along x, y "
            f"or z, such as a side of a block of linear cells, got {surface!r} of a mesh with "
            f"{sorted(mesh.surfaces)}: name another one, take the crown of a chain link ('contact' in scene "
            "files), or make a DesignSurface of its nodes, their parameters and directions"
        )
    return found


def _grid(mesh: BodyMesh, facets: np.ndarray) -> DesignSurface | None:
    """Return the grid of nodes; None if they form none."""
    areas = vector_areas(mesh.points, facets)
    axis = int(np.argmax(np.abs(areas.sum(axis=0))))
    along = areas[:, axis] / np.linalg.norm(areas, axis=1)
    if np.min(along * np.sign(along.sum())) < STEEP:
        return None
    nodes = np.unique(facets)
    places = np.delete(mesh.points[nodes], axis, axis=1)
    parameters = (places - places.min(axis=0)) / np.ptp(places, axis=0)
    rounded = parameters.round(9)
    counts = tuple(len(np.unique(column)) for column in rounded.T)
    order = np.lexsort((rounded[:, 1], rounded[:, 0]))
    if counts[0] * counts[1] != len(nodes) or len(np.unique(rounded, axis=0)) != len(nodes):
        return None
    normals = np.zeros_like(mesh.points)
    np.add.at(normals, facets, areas[:, None])
    directions = normals[nodes] / np.linalg.norm(normals[nodes], axis=1)[:, None]
    return DesignSurface(nodes[order], parameters[order], directions[order], (counts[0], counts[1]))
