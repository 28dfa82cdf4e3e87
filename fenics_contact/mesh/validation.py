"""Checks of mesh arrays. Each returns the array in the package's type or raises."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact.checks import LARGEST, brief
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import cell_type_of
from fenics_contact.mesh.faces import boundary_faces, corners_of, match_faces, start_at_smallest
from fenics_contact.mesh.quality import jacobian_ratio, thickness
from fenics_contact.mesh.rounding import coordinate_rounding

RESOLVED = 1e3
"""Smallest ratio of a cell's thickness to the rounding of its coordinates."""


def checked_points(points: ArrayLike, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Return finite coordinates, (n_nodes, 3 | 2) float64, as a read-only copy."""
    try:
        array = np.array(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(
            f"points must be numbers, got {brief(points)} ({error}): give an array of coordinates"
        ) from error
    if array.ndim != 2 or array.shape[1] not in (2, 3) or (shape is not None and array.shape != shape):
        needed = "(n_nodes, 3) or (n_nodes, 2)" if shape is None else str(shape)
        raise InvalidInputError(
            f"points must have shape {needed}, got {array.shape}: give all coordinates of every node, three "
            "for a solid, two for a plane body"
        )
    bad = np.flatnonzero(~(np.abs(array) < LARGEST).all(axis=1))
    if bad.size:
        raise InvalidInputError(
            f"points must be finite and below {LARGEST:g}, {bad.size} of {array.shape[0]} are not, first "
            f"node {bad[0]} at {array[bad[0]].tolist()}: a NaN comes from whatever computed these coordinates"
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


def checked_cells(cells: ArrayLike, n_nodes: int, dim: int) -> np.ndarray:
    """Return cells, (n_cells, nodes of a cell) int64, that use every one of the ``n_nodes`` nodes."""
    array = _integers(cells, "cells")
    cell_type_of(array, dim)
    if array.shape[0] == 0:
        raise InvalidInputError("a mesh must have at least one cell, got none: give the cells of the body")
    _check_range(array, n_nodes, "cells")
    orphans = np.flatnonzero(np.bincount(array.ravel(), minlength=n_nodes) == 0)
    if orphans.size:
        raise InvalidInputError(
            f"every node must belong to a cell, {orphans.size} of {n_nodes} do not, first node {orphans[0]}: "
            "remove them and renumber (nothing would hold them)"
        )
    return array


def check_jacobians(points: np.ndarray, cells: np.ndarray, remedy: str) -> None:
    """Reject a mesh with an inverted or degenerate cell, or so far from the origin that rounding bends cells.

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
        cells: Node numbers, (n_cells, nodes of a cell).
        remedy: Remedy; ends the message.

    Raises:
        InvalidInputError: States the number of cells, the worst one and its Jacobian ratio or its position.
    """
    thick = thickness(points, cells)
    inverted = np.flatnonzero(thick <= 0.0)
    if inverted.size == 0:
        _check_resolved(points, thick)
        return
    ratios = jacobian_ratio(points, cells[inverted])
    worst = int(np.argmin(ratios))
    centre = ", ".join(f"{x:.6g}" for x in points[cells[inverted[worst]]].mean(axis=0))
    raise InvalidInputError(
        f"every cell must have a positive Jacobian, {inverted.size} of {cells.shape[0]} are inverted or "
        f"flat; the worst is cell {inverted[worst]} at ({centre}) with a "
        f"Jacobian ratio (smallest over largest) of {ratios[worst]:.3g}: {remedy}"
    )


def _check_resolved(points: np.ndarray, thick: np.ndarray) -> None:
    rounding = coordinate_rounding(points)
    coarse = np.count_nonzero(thick < RESOLVED * rounding)
    if coarse:
        raise InvalidInputError(
            f"coordinates must resolve the cells, but up to {np.abs(points).max():.3g} from the origin they "
            f"are rounded by {rounding:.1e}, and {coarse} of {len(thick)} cells are as thin as "
            f"{thick.min():.1e}: move all bodies nearer to the origin"
        )


def checked_surfaces(
    surfaces: Mapping[str, ArrayLike], cells: np.ndarray, n_nodes: int, dim: int
) -> dict[str, np.ndarray]:
    """Return named facets, (n_facets, nodes of a facet) int64, outward boundary faces of the cells."""
    checked: dict[str, np.ndarray] = {}
    if not surfaces:
        return checked
    boundary = boundary_faces(cells, dim)[0]
    for name, facets in surfaces.items():
        array = _integers(facets, f"surface '{name}'")
        if array.ndim != 2 or array.shape[1] != boundary.shape[1] or array.shape[0] == 0:
            raise InvalidInputError(
                f"surface '{name}' must have shape (n_facets, {boundary.shape[1]}) with at least one facet, "
                f"got {array.shape}: leave out a surface that is empty"
            )
        _check_range(array, n_nodes, f"surface '{name}'")
        numbers = _face_numbers(name, array, boundary, dim)
        # Midpoints follow from the corners; from here on they are in the order of `boundary_faces`.
        checked[name] = (
            array if boundary.shape[1] == corners_of(boundary, dim).shape[1] else boundary[numbers]
        )
        checked[name].setflags(write=False)
    return checked


def _face_numbers(name: str, facets: np.ndarray, boundary: np.ndarray, dim: int) -> np.ndarray:
    """Return the numbers of the boundary faces that the facets are, (n_facets,)."""
    numbers = match_faces(corners_of(facets, dim), corners_of(boundary, dim))
    lost = np.flatnonzero(numbers < 0)
    if lost.size:
        raise InvalidInputError(
            f"surface '{name}' must consist of boundary faces of the cells, {lost.size} of {facets.shape[0]} "
            f"are not, first facet {lost[0]} with nodes {facets[lost[0]].tolist()}: take them from "
            f"`boundary_faces(cells, dim={dim})`"
        )
    _check_once(name, facets, numbers)
    there = boundary[numbers]
    wrong = np.flatnonzero((np.sort(facets, axis=1) != np.sort(there, axis=1)).any(axis=1))
    if wrong.size:
        raise InvalidInputError(
            f"surface '{name}' must list the corners of each facet, then the midpoints of its edges, then "
            f"its centre, {wrong.size} of {facets.shape[0]} facets have other nodes, first facet {wrong[0]} "
            f"with nodes {facets[wrong[0]].tolist()} instead of {there[wrong[0]].tolist()}: take them from "
            f"`boundary_faces(cells, dim={dim})`"
        )
    given, known = (start_at_smallest(corners_of(faces, dim)) for faces in (facets, there))
    same = (given == known).all(axis=1)
    if not same.all():
        first = int(np.argmin(same))
        raise InvalidInputError(
            f"surface '{name}' must list nodes around each facet with the normal pointing out of the body, "
            f"{np.count_nonzero(~same)} of {facets.shape[0]} facets do not, first facet {first} with nodes "
            f"{facets[first].tolist()}: order them with `orient(cells, facets, dim={dim})`"
        )
    return numbers


def _check_once(name: str, facets: np.ndarray, numbers: np.ndarray) -> None:
    """Reject a facet that is listed twice, also in another order: its area would count twice."""
    _, first, counts = np.unique(numbers, return_index=True, return_counts=True)
    twice = np.flatnonzero(counts > 1)
    if twice.size:
        raise InvalidInputError(
            f"surface '{name}' must list every facet once, {twice.size} of {first.size} are listed more "
            f"often, among them the one with nodes {facets[first[twice[0]]].tolist()}: keep one of each "
            "(numpy.unique(numpy.sort(facets, axis=1), axis=0, return_index=True))"
        )


def checked_grid(grid: ArrayLike | None, n_cells: int, dim: int) -> np.ndarray | None:
    """Return the structured index of every cell, (n_cells, dim) int64 from zero, or None."""
    if grid is None:
        return None
    array = _integers(grid, "grid")
    if array.shape != (n_cells, dim) or array.min() < 0:
        raise InvalidInputError(
            f"grid must have shape ({n_cells}, {dim}) and no negative entry, got shape {array.shape}: give "
            f"{dim} indices for every cell, or None for an unstructured mesh"
        )
    return array


def checked_regions(regions: Mapping[str, ArrayLike], n_cells: int) -> dict[str, np.ndarray]:
    """Return named ascending cell numbers, int64 each; every cell is in exactly one if there are any."""
    checked: dict[str, np.ndarray] = {}
    owner = np.full(n_cells, -1, dtype=np.int64)
    for number, (name, cells) in enumerate(regions.items()):
        array = np.sort(_integers(cells, f"region '{name}'"), axis=None)
        if array.size == 0 or array[0] < 0 or array[-1] >= n_cells:
            raise InvalidInputError(
                f"region '{name}' must hold cell numbers from 0 to {n_cells - 1}, got "
                f"{f'{array[0]} to {array[-1]}' if array.size else 'none'}: cell numbers count the rows of "
                "cells from zero; leave out a region that is empty"
            )
        taken = np.union1d(array[owner[array] >= 0], array[1:][np.diff(array) == 0])
        if taken.size:
            raise InvalidInputError(
                f"every cell must belong to one region, {taken.size} of region '{name}' are in it twice or "
                f"in another too, first cell {taken[0]}: give each cell to one region"
            )
        owner[array] = number
        array.setflags(write=False)
        checked[name] = array
    left = np.flatnonzero(owner < 0)
    if checked and left.size:
        raise InvalidInputError(
            f"every cell must belong to a region where there are any, {left.size} of {n_cells} do not, first "
            f"cell {left[0]}: give the rest a region of its own"
        )
    return checked
