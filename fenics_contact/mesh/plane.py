"""Plane meshes with three coordinates, and cells with reversed vertices."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.collapsed import joined_cells, shape_of
from fenics_contact.mesh.faces import (
    NOTHING,
    cell_faces,
    coordinate_rounding,
    flat_faces,
    number_faces,
    start_at_smallest,
)
from fenics_contact.mesh.quality import jacobians


def flattened(points: np.ndarray, used: np.ndarray, source: str) -> np.ndarray:
    """Drop the constant third coordinate of a plane mesh."""
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

    If only some do, it is a mistake in the mesh, and they stay.
    """
    shape = shape_of(cells.shape[1], 2)
    if np.all(jacobians(points, cells[:, : shape.corners]).max(axis=1) < 0.0):
        return cells[:, shape.mirror(cells.shape[1])]
    return cells


def turned_right_handed(points: np.ndarray, cells: np.ndarray, source: str) -> np.ndarray:
    """Reverse every cell with negative Jacobian, in meshes without a prescribed order of vertices."""
    dim = points.shape[1]
    shape = shape_of(cells.shape[1], dim)

    def linear(rows: np.ndarray) -> np.ndarray:
        corners = rows[:, : shape.corners]
        known = shape.is_whole or shape.is_simplex
        return corners if known else joined_cells({shape.name: corners}, dim)

    negative = jacobians(points, linear(cells)).max(axis=1) < 0.0
    turned = np.where(negative[:, None], cells[:, shape.mirror(cells.shape[1])], cells)
    faces = cell_faces(linear(turned), dim)
    flat = faces.reshape(-1, faces.shape[2])
    flat = np.delete(flat, flat_faces(linear(turned), dim), axis=0)
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
            f"have both on one side, first at ({place}), where a cell is flipped or twice: mesh again"
        )
    return turned
