"""Named surfaces of a mesh: outward boundary faces, each listed once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import (
    boundary_faces,
    corners_of,
    is_triangle,
    match_faces,
    narrowed,
    start_at_smallest,
    widened,
)
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes


def integers(values: ArrayLike, name: str) -> np.ndarray:
    """Return integers as a read-only copy, int64."""
    array = np.asarray(values)
    if not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(
            f"{name} must be integers, got {array.dtype}: convert with .astype(numpy.int64)"
        )
    copied = np.array(array, dtype=np.int64)
    copied.setflags(write=False)
    return copied


def check_range(nodes: np.ndarray, n_nodes: int, name: str) -> None:
    """Reject numbers that are not those of nodes."""
    if nodes.size and (nodes.min() < 0 or nodes.max() >= n_nodes):
        raise InvalidInputError(
            f"{name} must number nodes 0 to {n_nodes - 1}, got {nodes.min()} to {nodes.max()}: "
            "node numbers count the rows of points from zero"
        )


def checked_surfaces(
    surfaces: Mapping[str, ArrayLike],
    cells: np.ndarray,
    n_nodes: int,
    dim: int,
    *,
    hanging: HangingNodes = NO_HANGING,
) -> dict[str, np.ndarray]:
    """Return named facets, (n_facets, nodes of a facet) int64, outward boundary faces of the cells."""
    checked: dict[str, np.ndarray] = {}
    if not surfaces:
        return checked
    boundary = boundary_faces(cells, dim, hanging)[0]
    triangles = is_triangle(boundary)
    for name, facets in surfaces.items():
        array = integers(facets, f"surface '{name}'")
        if triangles.any() and array.ndim == 2:
            array = widened(array, boundary.shape[1])
        if array.ndim != 2 or array.shape[1] != boundary.shape[1] or array.shape[0] == 0:
            raise InvalidInputError(
                f"surface '{name}' must have shape (n_facets, {boundary.shape[1]}) with at least one facet, "
                f"got {array.shape}: leave out a surface that is empty"
            )
        check_range(array, n_nodes, f"surface '{name}'")
        if triangles.any():
            checked[name] = _checked_parts(name, array, boundary, triangles)
            checked[name].setflags(write=False)
            continue
        numbers = _face_numbers(name, array, boundary, dim)
        # Midpoints follow from the corners; from here on they are in the order of `boundary_faces`.
        checked[name] = (
            array if boundary.shape[1] == corners_of(boundary, dim).shape[1] else boundary[numbers]
        )
        checked[name].setflags(write=False)
    return checked


def _checked_parts(name: str, facets: np.ndarray, boundary: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return checked facets, given by nodes, of a body with both triangles and others."""
    mine, result = is_triangle(facets), np.empty_like(facets)
    for some, there in ((mine, triangles), (~mine, ~triangles)):
        if some.any():
            own, known = narrowed(facets[some]), boundary[there]
            result[some] = known[_face_numbers(name, own, narrowed(known), 3)]
    return narrowed(result)


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
