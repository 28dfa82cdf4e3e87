"""Quadratic cells of mesh files: their midpoints in the order of VTK, missing centres added.

Programs agree on the order of the corners, not on that of the other nodes, so these are identified by
position. Serendipity cells, 20, 15, 13 or 8 nodes, are completed by the centres of their faces and of the
cell, placed by their shape functions: the geometry is unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.collapsed import Shape, by_shape, shape_of
from fenics_contact.mesh.faces import number_faces

_PLANE = (6, 8, 9)
"""Numbers of nodes of quadratic cells in the plane, which may have three coordinates."""
_ENOUGH = 1000
"""Number of cells from which the order of nodes is determined."""


def in_vtk_order(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order the nodes of quadratic cells as VTK does, and add the centres that are missing.

    Args:
        points: Coordinates, (n_nodes, 3 | 2) [length].
        cells: Node numbers, corners first, (n_cells, 6 | 8 | 9 | 10 | 13 | 14 | 15 | 18 | 20 | 27).

    Returns:
        Coordinates, new nodes at the end, and cells, (n_cells, 6 | 9 | 10 | 14 | 18 | 27).
    """
    dim = 2 if cells.shape[1] in _PLANE else 3
    shape = shape_of(cells.shape[1], dim)
    points, whole = with_centres(points, {shape.name: ordered(points, cells, shape)}, dim)
    return points, whole[shape.name]


def with_centres(
    points: np.ndarray, cells: Mapping[str, np.ndarray], dim: int
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Add the centres of faces and cells that serendipity cells lack, once for all that share them.

    New nodes are at the end; cells that were complete stay as they were.
    """
    result, pending = dict(cells), {}
    for name, rows in cells.items():
        shape = shape_of(rows.shape[1], dim)
        _, lacking, complete = shape.counts
        if rows.shape[1] == lacking < complete:
            result[name] = np.column_stack([rows, np.full((len(rows), complete - lacking), -1)])
            pending[name] = shape
    faces = [result[name][:, shape.square_columns[:, :8]].reshape(-1, 8) for name, shape in pending.items()]
    if not faces:
        return points, result
    every = np.concatenate(faces)
    numbers = number_faces(every[:, :4])
    _, first = np.unique(numbers, return_index=True)
    some, count = every[first], len(points) + len(first)
    added = [points, 0.5 * points[some[:, 4:]].sum(axis=1) - 0.25 * points[some[:, :4]].sum(axis=1)]
    ends = np.cumsum([len(each) for each in faces])[:-1]
    for (name, shape), own in zip(pending.items(), np.split(numbers, ends), strict=True):
        rows, columns = result[name], shape.square_columns[:, 8]
        rows[:, columns] = len(points) + own.reshape(len(rows), -1)
        if shape.dim == 3 and shape.centre:
            rows[:, 26] = count + np.arange(len(rows))
            count += len(rows)
            added.append(0.25 * (points[rows[:, 8:20]].sum(axis=1) - points[rows[:, :8]].sum(axis=1)))
    return np.concatenate(added), result


def check_node_order(points: np.ndarray, cells: np.ndarray) -> None:
    """Reject quadratic cells whose nodes are in another order than that of VTK."""
    dim = points.shape[1]
    several = len(by_shape(cells, dim)) > 1
    for _, own in by_shape(cells, dim).values():
        shape = shape_of(own.shape[1], dim)
        right = ordered(points, own, shape)
        if (right == own).all():
            continue
        sets = shape.sets(own.shape[1])[shape.corners :]
        expected = ", ".join("-".join(map(str, sorted(each))) for each in sets)
        places = [int(np.flatnonzero(right[0] == node)[0]) for node in own[0]]
        kind = shape.plural if several else cell_type_of(cells, dim).plural.removeprefix("quadratic ")
        raise InvalidInputError(
            f"the nodes of quadratic {kind} must be in the order of VTK, the {shape.corners} corners and "
            f"then those between the corners {expected}, got the order {places}: use in_vtk_order"
        )


def ordered(points: np.ndarray, cells: np.ndarray, shape: Shape) -> np.ndarray:
    """Return the order in which the nodes of all cells are nearest to the positions that VTK expects."""
    from scipy.optimize import linear_sum_assignment  # needed by few runs only

    corners, count = shape.corners, cells.shape[1]
    if count == corners:
        return cells
    sample = cells[:: max(1, len(cells) // _ENOUGH)]
    sets = shape.sets(count)[corners:]
    expected = np.stack([points[sample[:, sorted(each)]].mean(axis=1) for each in sets], axis=1)
    given = points[sample[:, corners:]]
    size = np.ptp(points[sample], axis=1).max(axis=1)
    apart = np.linalg.norm(expected[:, :, None] - given[:, None], axis=3) / size[:, None, None]
    _, order = linear_sum_assignment(np.square(apart).sum(axis=0))
    return np.asarray(cells[:, [*range(corners), *(corners + order)]])
