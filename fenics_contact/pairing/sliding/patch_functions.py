"""Basis functions of smooth patches over facets, with derivatives, as polynomials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp

from fenics_contact.mesh import FACET_TYPES, CellType, quadrature, shape_values
from fenics_contact.pairing.sliding.turning_functions import turning_functions
from fenics_contact.surfaces import corner_places, facet_shape_values, height_functions


@dataclass(frozen=True)
class PatchValues:
    """Basis functions at some points.

    Attributes:
        value: Of positions, of tangents at the corners, and of turns about edges, shape (n, n_functions).
        first: Derivatives, shape (n, n_functions, dim − 1).
        second: Second derivatives, shape (n, n_functions, dim − 1, dim − 1).
    """

    value: np.ndarray
    first: np.ndarray
    second: np.ndarray


def n_values(corners: int, order: int) -> int:
    """Return the number of functions of positions: the corners, or the nodes of a quadratic facet."""
    return corners if order == 1 else {2: 3, 3: 6, 4: 9}[corners]


def n_functions(corners: int, order: int) -> int:
    """Return the number of functions: of positions, of edges that meet at corners, of turns about edges."""
    return n_values(corners, order) + (4 * corners if corners > 2 else 2 * corners)


def patch_functions(local: np.ndarray, corners: int, order: int) -> PatchValues:
    """Evaluate the functions of patches with 4, 3 or 2 corners: `edge_functions`, `turning_functions`.

    Args:
        local: Local coordinates as for `fenics_contact.surfaces.shape_functions`, shape (n, dim − 1).
        corners: 4, 3 or 2.
        order: 1, or 2 for patches that are pieces of quadratic facets.
    """
    edges = edge_functions(local, corners, order)
    if corners == 2:
        return edges
    turns = turning_functions(local, corners)
    if order > 1:
        means, bubble = _turned_means(corners), _evaluated(local, *_bubble(corners))
        turns = tuple(
            turn - np.expand_dims(means, tuple(range(1, turn.ndim - 1))) * one
            for turn, one in zip(turns, (bubble.value, bubble.first, bubble.second), strict=True)
        )
    before = edges.value, edges.first, edges.second
    return PatchValues(*(np.concatenate(parts, axis=1) for parts in zip(before, turns, strict=True)))


def edge_functions(local: np.ndarray, corners: int, order: int) -> PatchValues:
    """Evaluate the functions that make edges: of positions and of tangents at the corners.

    Along edges those of tangents are Hermite's cubics, over triangles cubic, over quadrilaterals blended
    bilinearly. On pieces of quadratic facets positions are quadratic, and all functions of tangents and of
    turns have the mean zero, by bubbles that leave the rim of a piece as it is: forces of a uniform pressure
    are then those of the quadratic shape functions, 0 and a third of a triangle at its corners and midpoints
    and not the eighth and eighth more of the pieces around each node.

    Args:
        local: As for `patch_functions`.
        corners: As there.
        order: As there.
    """
    return _evaluated(local, *_polynomials(corners, order))


def edge_derivatives(control: sp.csr_matrix, corners: int, order: int, t: float, way: int) -> sp.csr_matrix:
    """Return weights of the nodes in derivatives at t of all edges, towards their next or last corner.

    Args:
        control: Weights of the nodes in `edge_functions`, shape (n_facets · functions, n_nodes).
        corners: As for `patch_functions`.
        order: As there.
        t: Place on each edge, from 0 to 1.
        way: 1 or −1.
    """
    place = corner_places(corners)
    after, step = np.roll(place, -1, axis=0), np.roll(place, -way, axis=0) - place
    values = np.einsum("eba,ea->eb", edge_functions((1 - t) * place + t * after, corners, order).first, step)
    facets = sp.identity(control.shape[0] // values.shape[1])
    return (sp.kron(facets, sp.csr_matrix(values)) @ control).tocsr()


def _evaluated(local: np.ndarray, powers: np.ndarray, coefficients: np.ndarray) -> PatchValues:
    """Evaluate polynomials with their derivatives."""
    width = local.shape[1]
    tables = [_powers_of(local[:, axis]) for axis in range(width)]

    def derived(*orders: int) -> np.ndarray:
        terms = np.ones((len(local), len(powers)))
        for axis, order in enumerate(orders):
            terms *= tables[axis][order][:, powers[:, axis]]
        return np.asarray(terms @ coefficients)

    unit = np.eye(width, dtype=np.int64)
    first = np.stack([derived(*unit[a]) for a in range(width)], axis=2)
    second = np.stack(
        [np.stack([derived(*(unit[a] + unit[b])) for b in range(width)], axis=2) for a in range(width)],
        axis=2,
    )
    return PatchValues(derived(*np.zeros(width, dtype=np.int64)), first, second)


def _powers_of(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return 1, x, ..., x⁴ and their first and second derivatives, shape (n, 5) each."""
    one, none = np.ones_like(x), np.zeros_like(x)
    return (
        np.stack([one, x, x**2, x**3, x**4], axis=1),
        np.stack([none, one, 2 * x, 3 * x**2, 4 * x**3], axis=1),
        np.stack([none, none, 2 * one, 6 * x, 12 * x**2], axis=1),
    )


@cache
def _polynomials(corners: int, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return powers of the local coordinates, (n, dim − 1), and coefficients of them, (n, n_functions)."""

    def wanted(local: np.ndarray) -> np.ndarray:
        slopes = height_functions(local, corners)[0].reshape(len(local), -1)
        values = facet_shape_values(local, corners)
        if order == 1:
            return np.hstack([values, slopes])
        means = _means(lambda at: height_functions(at, corners)[0], corners)
        slopes = slopes - _bubbles(local, corners) * means
        return np.hstack([shape_values(_kind(corners, 2), values @ _kind(corners, 1).nodes), slopes])

    return _fitted(wanted, corners, 2 + order)


@cache
def _bubble(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Return powers and coefficients of a function that vanishes on all edges, with its derivatives."""
    return _fitted(lambda local: _bubbles(local, corners), corners, 4)


@cache
def _turned_means(corners: int) -> np.ndarray:
    return _means(lambda local: turning_functions(local, corners)[0], corners)


def _fitted(
    wanted: Callable[[np.ndarray], np.ndarray], corners: int, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return powers of the local coordinates and the coefficients of polynomials, see `_polynomials`."""
    width = 1 if corners == 2 else 2
    powers, local = (
        np.stack(np.meshgrid(*[ticks] * width, indexing="ij"), axis=-1).reshape(-1, width)
        for ticks in (np.arange(degree + 1), np.linspace(-1.0, 1.0, degree + 2))
    )
    terms = np.prod(local[:, None] ** powers, axis=2)
    found = np.linalg.lstsq(terms, wanted(local), rcond=None)[0]
    return powers, np.where(np.abs(found) < 1e-13, 0.0, found)


def _bubbles(local: np.ndarray, corners: int) -> np.ndarray:
    """Return the squared product of the distances from all edges, shape (n, 1)."""
    if corners == 3:
        return np.asarray(facet_shape_values(local, 3).prod(axis=1, keepdims=True) ** 2)
    return np.asarray(((1 - local**2) ** 2).prod(axis=1, keepdims=True))


def _means(functions: Callable[[np.ndarray], np.ndarray], corners: int, degree: int = 20) -> np.ndarray:
    """Return the means of functions over a facet, over that of the bubble, shape (n_functions,)."""
    places, weights = quadrature(_kind(corners, 1), degree)
    local = places if corners == 3 else 2 * places - 1
    values = functions(local).reshape(len(local), -1)
    return np.asarray(weights @ values / (weights @ _bubbles(local, corners)))


def _kind(corners: int, order: int) -> CellType:
    return FACET_TYPES[n_values(corners, order), 2 if corners == 2 else 3]
