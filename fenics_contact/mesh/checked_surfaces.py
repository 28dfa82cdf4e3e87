"""Named surfaces of a mesh: outward boundary faces, each listed once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._base.checks import check_each
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import (
    check_on_boundary,
    corners_of,
    is_triangle,
    match_faces,
    narrowed,
    start_at_smallest,
    widened,
)


def integers(values: ArrayLike, name: str) -> np.ndarray:
    """Return integers as a read-only copy, int64."""
    array = np.asarray(values)
    if not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(f"{name} must be integers, got {array.dtype}: use .astype(numpy.int64)")
    copied = np.array(array, dtype=np.int64)
    copied.setflags(write=False)
    return copied


def check_range(nodes: np.ndarray, n_nodes: int, name: str) -> None:
    """Reject numbers that are not those of nodes."""
    if nodes.size and (nodes.min() < 0 or nodes.max() >= n_nodes):
        raise InvalidInputError(
            f"{name} must number nodes 0 to {n_nodes - 1}, got {nodes.min()} to {nodes.max()}"
        )


def checked_surfaces(
    surfaces: Mapping[str, ArrayLike], boundary: np.ndarray, n_nodes: int, dim: int
) -> dict[str, np.ndarray]:
    """Return named facets, (n_facets, nodes of a facet) int64, which are faces of the boundary, outward."""
    checked: dict[str, np.ndarray] = {}
    triangles = is_triangle(boundary)
    for name, facets in surfaces.items():
        array = integers(facets, f"surface '{name}'")
        if triangles.any() and array.ndim == 2:
            array = widened(array, boundary.shape[1])
        if array.ndim != 2 or array.shape[1] != boundary.shape[1] or array.shape[0] == 0:
            raise InvalidInputError(
                f"surface '{name}' must have shape (n ≥ 1, {boundary.shape[1]}), a row per facet, got "
                f"{array.shape}"
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
    check_on_boundary(numbers, f"surface '{name}'", facets, dim)
    _check_once(name, facets, numbers)
    there = boundary[numbers]
    check_each(
        (np.sort(facets, axis=1) == np.sort(there, axis=1)).all(axis=1),
        f"surface '{name}' must list the corners of each facet, then the midpoints of its edges, its centre",
        f"take them from `boundary_faces(cells, dim={dim})`",
        lambda k: f"facet {k} with nodes {facets[k].tolist()} instead of {there[k].tolist()}",
    )
    given, known = (start_at_smallest(corners_of(faces, dim)) for faces in (facets, there))
    check_each(
        (given == known).all(axis=1),
        f"surface '{name}' must list nodes around each facet with the normal pointing out of the body",
        f"order them with `orient(cells, facets, dim={dim})`",
        lambda k: f"facet {k} with nodes {facets[k].tolist()}",
    )
    return numbers


def _check_once(name: str, facets: np.ndarray, numbers: np.ndarray) -> None:
    """Reject a facet that is listed twice, also in another order: its area would count twice."""
    _, first, counts = np.unique(numbers, return_index=True, return_counts=True)
    twice = np.flatnonzero(counts > 1)
    if twice.size:
        raise InvalidInputError(
            f"surface '{name}' must list every facet once, {twice.size} of {first.size} are listed more "
            f"often, such as that with nodes {facets[first[twice[0]]].tolist()}: keep one of each"
        )
