"""Plane meshes with three coordinates, and cells with reversed vertices."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.faces import (
    NOTHING,
    cell_faces,
    coordinate_rounding,
    corners_of,
    number_faces,
    start_at_smallest,
)
from fenics_contact.mesh.quality import jacobians

_MIRRORED = {
    "triangle": [0, 2, 1],
    "quadrilateral": [0, 3, 2, 1],
    "tetrahedron": [0, 2, 1, 3],
    "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3],
    "triangle6": [0, 2, 1, 5, 4, 3],
    "quadrilateral9": [0, 3, 2, 1, 7, 6, 5, 4, 8],
    "tetrahedron10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8],
    "hexahedron27": [
        *(4, 5, 6, 7, 0, 1, 2, 3),
        *(12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19),
        *(20, 21, 22, 23, 25, 24, 26),
    ],
}
"""The cell with the opposite sign of its Jacobian."""


def flattened(points: np.ndarray, used: np.ndarray, source: str) -> np.ndarray:
    """Drop the constant third coordinate of a plane mesh.

    `points`: coordinates, (n_nodes, 3 | 2).

    Returns coordinates, (n_nodes, 2).
    """
    if points.shape[1] == 2:
        return points
    extent = np.ptp(points[used], axis=0)
    if extent[2] > NOTHING * np.linalg.norm(extent) + coordinate_rounding(points[used]):
        raise InvalidInputError(
            f"plane cells must lie in a plane of constant z, those of {source} reach over {extent[2]:.6g} in "
            "z: put a plane body into the x-y plane; of a solid save the volume cells too (gmsh -3)"
        )
    return np.ascontiguousarray(points[:, :2])


def turned_counter_clockwise(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Reverse the cells of one plane surface if all of them run clockwise: its normal was chosen as -z.

    `points`: coordinates, (n_nodes, 2); `cells`: node numbers, (n_cells, nodes of a cell).

    Returns the cells; unchanged if only some run clockwise, which is a mistake in the mesh.
    """
    if np.all(jacobians(points, cells).max(axis=1) < 0.0):
        return cells[:, _MIRRORED[cell_type_of(cells, 2).name]]
    return cells


def turned_right_handed(points: np.ndarray, cells: np.ndarray, source: str) -> np.ndarray:
    """Reverse every cell with negative Jacobian, in meshes without a prescribed order of vertices.

    `points`: coordinates, (n_nodes, 3 | 2); `cells`: node numbers, (n_cells, nodes of a cell).
    """
    dim = points.shape[1]
    negative = jacobians(points, cells).max(axis=1) < 0.0
    turned = np.where(negative[:, None], cells[:, _MIRRORED[cell_type_of(cells, dim).name]], cells)
    faces = cell_faces(turned, dim)
    flat = corners_of(faces.reshape(-1, faces.shape[2]), dim)
    numbers = number_faces(flat)
    order = np.argsort(numbers, kind="stable")
    one, other = order[:-1], order[1:]
    first = start_at_smallest(flat)
    same = (numbers[one] == numbers[other]) & (first[one] == first[other]).all(axis=1)
    if same.any():
        face = flat[one[np.argmax(same)]]
        place = ", ".join(f"{x:.6g}" for x in points[face].mean(axis=0))
        raise InvalidInputError(
            f"cells that share a face must lie on its two sides, {np.count_nonzero(same)} faces of {source} "
            f"have both on one side, first at ({place}): a cell there is flipped over or there twice; mesh "
            "again"
        )
    return turned
