"""Basis functions of smooth patches over facets, with derivatives, as polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from fenics_contact.pairing.sliding.turning_functions import turning_functions
from fenics_contact.surfaces import facet_shape_values, height_functions


@dataclass(frozen=True)
class PatchValues:
    """Basis functions at some points.

    Attributes:
        value: Of positions and of tangents at the corners, then of turns about edges, shape (n, n_functions).
        first: Derivatives, shape (n, n_functions, dim − 1).
        second: Second derivatives, shape (n, n_functions, dim − 1, dim − 1).
    """

    value: np.ndarray
    first: np.ndarray
    second: np.ndarray


def n_functions(corners: int) -> int:
    """Return the number of functions: for each corner, the edges that meet there, and turns about edges."""
    return 5 * corners if corners > 2 else 3 * corners


def patch_functions(local: np.ndarray, corners: int) -> PatchValues:
    """Evaluate the functions of patches with 4, 3 or 2 corners: `edge_functions`, `turning_functions`.

    Args:
        local: Local coordinates as for `fenics_contact.surfaces.shape_functions`, shape (n, dim − 1).
        corners: 4, 3 or 2.
    """
    edges = edge_functions(local, corners)
    if corners == 2:
        return edges
    before = edges.value, edges.first, edges.second
    turns = turning_functions(local, corners)
    return PatchValues(*(np.concatenate(parts, axis=1) for parts in zip(before, turns, strict=True)))


def edge_functions(local: np.ndarray, corners: int) -> PatchValues:
    """Evaluate the functions that make edges: of positions and of tangents at the corners.

    Along edges they are Hermite's cubics, over triangles cubic, over quadrilaterals blended bilinearly.

    Args:
        local: As for `patch_functions`.
        corners: As there.
    """
    powers, coefficients = _polynomials(corners)
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
    """Return 1, x, x², x³ and their first and second derivatives, shape (n, 4) each."""
    one, none = np.ones_like(x), np.zeros_like(x)
    return (
        np.stack([one, x, x**2, x**3], axis=1),
        np.stack([none, one, 2 * x, 3 * x**2], axis=1),
        np.stack([none, none, 2 * one, 6 * x], axis=1),
    )


@cache
def _polynomials(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Return powers of the local coordinates, (n, dim − 1), and coefficients of them, (n, n_functions)."""
    width = 1 if corners == 2 else 2
    powers = np.stack(np.meshgrid(*[np.arange(4)] * width, indexing="ij"), axis=-1).reshape(-1, width)
    ticks = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * width, indexing="ij"), axis=-1)
    local = ticks.reshape(-1, width)
    slopes = height_functions(local, corners)[0]
    wanted = np.hstack([facet_shape_values(local, corners), slopes.reshape(len(local), -1)])
    terms = np.prod(local[:, None] ** powers, axis=2)
    found = np.linalg.lstsq(terms, wanted, rcond=None)[0]
    return powers, np.where(np.abs(found) < 1e-13, 0.0, found)
