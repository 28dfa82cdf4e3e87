"""Sides of structured meshes, and curves of plane meshes, as surfaces that a design may move."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.links import DesignSurface
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas

#: Smallest cosine of the angle between a facet's normal and the axis along which the side is seen as a grid.
STEEP = 0.5


def side_of(mesh: BodyMesh, surface: str) -> DesignSurface:
    """Return a side of a structured mesh, flat or curved gently, or a curve, as a design surface.

    In space, seen along one of the axes x, y, z its nodes form a rectangular grid, as those of every side of
    a `block`, also of one whose nodes were moved along that axis. The parameters are the places in this grid.
    In the plane any curve with two ends will do, of any mesh; the parameter is the length along it, with the
    body on the left. A node moves along the mean of the normals of its facets, weighted by their areas.

    Args:
        mesh: A mesh.
        surface: Name of the side.

    Raises:
        InvalidInputError: If there is no such surface, or it is neither a grid nor a curve with two ends.

    Example:
        >>> from fenics_contact.gallery import block, half_disc
        >>> side_of(block((0, 0, 0), (4, 2, 1), (8, 4, 2)), "z1").counts
        (9, 5)
        >>> side_of(half_disc(1.0, 4, symmetry=""), "contact").counts
        (9,)
    """
    facets = mesh.linear.surfaces.get(surface)
    found = None if facets is None else (_grid if mesh.dim == 3 else _curve)(mesh, facets)
    if found is not None:
        return found
    if mesh.dim == 2:
        raise InvalidInputError(
            f"a design needs a curve in one piece with two ends, got {surface!r} of {sorted(mesh.surfaces)}: "
            "name another one, or a part of it"
        )
    raise InvalidInputError(
        f"a design needs a surface whose nodes form a rectangular grid along x, y or z, got {surface!r} of "
        f"{sorted(mesh.surfaces)}: name another, such as a side of a block, or make a DesignSurface"
    )


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
    nodes = nodes[order]
    return DesignSurface(nodes, parameters[order], _normals(mesh, facets, areas)[nodes], counts)


def _curve(mesh: BodyMesh, facets: np.ndarray) -> DesignSurface | None:
    """Return the nodes of edges in the order of a line; None if they are not one line with two ends."""
    after = {int(start): int(end) for start, end in facets}
    starts = set(after) - set(after.values())
    if len(after) != len(facets) or len(starts) != 1:
        return None
    line = [starts.pop()]
    while line[-1] in after:
        line.append(after[line[-1]])
    if len(line) != len(facets) + 1:
        return None
    nodes = np.array(line)
    length = np.linalg.norm(np.diff(mesh.points[nodes], axis=0), axis=1).cumsum()
    parameters = np.append(0.0, length / length[-1])[:, None]
    directions = _normals(mesh, facets, vector_areas(mesh.points, facets))[nodes]
    return DesignSurface(nodes, parameters, directions, (len(nodes),))


def _normals(mesh: BodyMesh, facets: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Return the mean normal at every node of facets, weighted by their areas, (n_nodes, dim)."""
    normals = np.zeros_like(mesh.points)
    np.add.at(normals, facets, areas[:, None])
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None])
