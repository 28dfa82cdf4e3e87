"""Checks of mesh arrays. Each returns the array in the package's type or says what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry.faces import boundary_faces, match_faces, start_at_smallest
from fenics_contact.geometry.quality import is_inverted, jacobian_ratio


def checked_points(points: ArrayLike, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Return finite coordinates, (n_nodes, 3) float64, as a read-only copy."""
    array = np.array(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or (shape is not None and array.shape != shape):
        needed = "(n_nodes, 3)" if shape is None else str(shape)
        raise InvalidInputError(
            f"points must have shape {needed}, got {array.shape}: give three coordinates for every node"
        )
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise InvalidInputError(
            f"points must be finite, {bad.size} of {array.shape[0]} are not, first node {bad[0]} at "
            f"{array[bad[0]].tolist()}: a NaN comes from whatever computed these coordinates"
        )
    array.setflags(write=False)
    return array


def _integers(values: ArrayLike, name: str) -> np.ndarray:
    array = np.asarray(values)
    if not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(
            f"{name} must be integers, got {array.dtype}: convert with .astype(numpy.int64)"
        )
    copied = np.array(array, dtype=np.int64)
    copied.setflags(write=False)
    return copied


def _check_range(nodes: np.ndarray, n_nodes: int, name: str) -> None:
    if nodes.size and (nodes.min() < 0 or nodes.max() >= n_nodes):
        raise InvalidInputError(
            f"{name} must number nodes 0 to {n_nodes - 1}, got {nodes.min()} to {nodes.max()}: "
            "node numbers count the rows of points from zero"
        )


def checked_cells(cells: ArrayLike, n_nodes: int) -> np.ndarray:
    """Return cells, (n_cells, 8 | 4) int64, that use every one of the ``n_nodes`` nodes."""
    array = _integers(cells, "cells")
    if array.ndim != 2 or array.shape[1] not in (4, 8) or array.shape[0] == 0:
        raise InvalidInputError(
            "cells must have shape (n_cells, 8) for hexahedra or (n_cells, 4) for tetrahedra with at least "
            f"one cell, got {array.shape}: give the vertices of every cell in VTK order"
        )
    _check_range(array, n_nodes, "cells")
    orphans = np.flatnonzero(np.bincount(array.ravel(), minlength=n_nodes) == 0)
    if orphans.size:
        raise InvalidInputError(
            f"every node must belong to a cell, {orphans.size} of {n_nodes} do not, first node {orphans[0]}: "
            "remove them and renumber (nothing would hold them)"
        )
    return array


def check_jacobians(points: np.ndarray, cells: np.ndarray, remedy: str) -> None:
    """Refuse a mesh with an inverted or degenerate cell.

    Args:
        points: Coordinates, (n_nodes, 3).
        cells: Node numbers, (n_cells, 8 | 4).
        remedy: What to do about it; ends the message.

    Raises:
        InvalidInputError: Naming how many cells, the worst one and its Jacobian ratio.
    """
    inverted = np.flatnonzero(is_inverted(points, cells))
    if inverted.size == 0:
        return
    ratios = jacobian_ratio(points, cells[inverted])
    worst = int(np.argmin(ratios))
    centre = points[cells[inverted[worst]]].mean(axis=0)
    raise InvalidInputError(
        f"every cell must have a positive Jacobian, {inverted.size} of {cells.shape[0]} are inverted or "
        f"flat; the worst is cell {inverted[worst]} at ({centre[0]:.6g}, {centre[1]:.6g}, {centre[2]:.6g}) "
        f"with a Jacobian ratio (smallest over largest) of {ratios[worst]:.3g}: {remedy}"
    )


def checked_surfaces(
    surfaces: Mapping[str, ArrayLike], cells: np.ndarray, n_nodes: int
) -> dict[str, np.ndarray]:
    """Return named facets, (n_facets, 4 | 3) int64 each, that are outward boundary faces of the cells."""
    checked: dict[str, np.ndarray] = {}
    boundary = boundary_faces(cells)[0] if surfaces else np.zeros((0, 4), dtype=np.int64)
    for name, facets in surfaces.items():
        array = _integers(facets, f"surface '{name}'")
        if array.ndim != 2 or array.shape[1] != boundary.shape[1] or array.shape[0] == 0:
            raise InvalidInputError(
                f"surface '{name}' must have shape (n_facets, {boundary.shape[1]}) with at least one facet, "
                f"got {array.shape}: leave out a surface that is empty"
            )
        _check_range(array, n_nodes, f"surface '{name}'")
        _check_facets(name, array, boundary)
        checked[name] = array
    return checked


def _check_facets(name: str, facets: np.ndarray, boundary: np.ndarray) -> None:
    found = match_faces(facets, boundary)
    lost = np.flatnonzero(found < 0)
    if lost.size:
        raise InvalidInputError(
            f"surface '{name}' must consist of boundary faces of the cells, {lost.size} of {facets.shape[0]} "
            f"are not, first facet {lost[0]} with nodes {facets[lost[0]].tolist()}: take them from "
            "`boundary_faces(cells)`"
        )
    same = (start_at_smallest(facets) == start_at_smallest(boundary[found])).all(axis=1)
    if not same.all():
        first = int(np.argmin(same))
        raise InvalidInputError(
            f"surface '{name}' must list nodes around each facet with the normal pointing out of the body, "
            f"{np.count_nonzero(~same)} of {facets.shape[0]} facets do not, first facet {first} with nodes "
            f"{facets[first].tolist()}: order them with `orient(cells, facets)`"
        )


def checked_grid(grid: ArrayLike | None, n_cells: int) -> np.ndarray | None:
    """Return the structured index of every cell, (n_cells, 3) int64 from zero, or None."""
    if grid is None:
        return None
    array = _integers(grid, "grid")
    if array.shape != (n_cells, 3) or array.min() < 0:
        raise InvalidInputError(
            f"grid must have shape ({n_cells}, 3) and no negative entry, got shape {array.shape}: give one "
            "index triple for every cell, or None for an unstructured mesh"
        )
    return array
