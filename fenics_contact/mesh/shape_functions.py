"""Shape functions of all cells and the Gauss rules that integrate their Jacobians exactly."""

from __future__ import annotations

from functools import cache

import numpy as np

from fenics_contact.mesh.cell_types import CellType


def shape_values(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Evaluate the shape functions.

    Args:
        cell: The type of cells, or of facets.
        positions: Reference coordinates, (m, dim).

    Returns:
        (m, nodes of a cell).
    """
    if not cell.is_simplex:
        return np.asarray(np.prod(_lagrange(cell, positions)[0], axis=0), dtype=np.float64)
    L = _barycentric(positions)
    if cell.order == 1:
        return L
    i, j = _ends(cell).T
    return np.concatenate([L * (2.0 * L - 1.0), 4.0 * L[:, i] * L[:, j]], axis=1)


def shape_gradients(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Evaluate the gradients of the shape functions in reference coordinates.

    Args:
        cell: The type of cells, or of facets.
        positions: Reference coordinates, (m, dim).

    Returns:
        (m, nodes of a cell, dim).
    """
    return _of_simplex(cell, positions) if cell.is_simplex else _of_tensor_product(cell, positions)


def _of_tensor_product(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Products of one-dimensional polynomials, one of which is differentiated."""
    values, slopes = _lagrange(cell, positions)
    columns = []
    for direction in range(cell.dim):
        factors = [slopes[d] if d == direction else values[d] for d in range(cell.dim)]
        columns.append(np.prod(factors, axis=0))
    return np.stack(columns, axis=2)


def _lagrange(cell: CellType, positions: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Evaluate each node's polynomial and its derivative in each direction, (m, nodes of a cell) each."""
    ticks = np.linspace(0.0, 1.0, cell.order + 1)
    polynomials = [np.poly1d(ticks[ticks != tick], r=True) for tick in ticks]
    polynomials = [p / p(tick) for p, tick in zip(polynomials, ticks, strict=True)]
    number = np.rint(cell.order * cell.nodes).astype(int)
    values, slopes = [], []
    for x, which in zip(positions.T, number.T, strict=True):
        values.append(np.stack([p(x) for p in polynomials], axis=1)[:, which])
        slopes.append(np.stack([p.deriv()(x) for p in polynomials], axis=1)[:, which])
    return values, slopes


def _of_simplex(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Differentiate L_i, or L_i (2 L_i − 1) on vertices and 4 L_i L_j on edges, L barycentric coordinates."""
    slopes = np.concatenate([-np.ones((1, cell.dim)), np.eye(cell.dim)])
    if cell.order == 1:
        return np.broadcast_to(slopes, (len(positions), *slopes.shape))
    L = _barycentric(positions)
    i, j = _ends(cell).T
    on_vertices = (4.0 * L - 1.0)[:, :, None] * slopes
    on_edges = 4.0 * (L[:, i, None] * slopes[j] + L[:, j, None] * slopes[i])
    return np.concatenate([on_vertices, on_edges], axis=1)


def _barycentric(positions: np.ndarray) -> np.ndarray:
    return np.column_stack([1.0 - positions.sum(axis=1), positions])


def _ends(cell: CellType) -> np.ndarray:
    """Return the two vertices that each node on an edge of a simplex lies between, (n_edges, 2)."""
    return np.nonzero(_barycentric(cell.nodes)[len(cell.vertices) :])[1].reshape(-1, 2)


@cache
def quadrature(cell: CellType) -> tuple[np.ndarray, np.ndarray]:
    """Return a rule that integrates squares of shape functions, and the Jacobian of curved cells, exactly.

    Two Gauss points a direction on linear and three on quadratic edges, quadrilaterals and hexahedra; the
    midpoints of the edges of linear triangles, and Radon's seven points of degree five on quadratic ones.

    Returns:
        Reference coordinates, (m, dim), and weights that add up to the reference volume, (m,).

    References:
        Radon, J.: Zur mechanischen Kubatur. Monatshefte für Mathematik 52 (1948).
    """
    if cell.is_simplex:
        if cell.order == 2:
            return _radon()
        middles = 0.5 * (cell.vertices + np.roll(cell.vertices, -1, axis=0))
        return middles, np.full(len(middles), cell.reference_volume / len(middles))
    ticks, weights = np.polynomial.legendre.leggauss(cell.order + 1)
    lattice = np.stack(np.meshgrid(*cell.dim * [0.5 * (ticks + 1.0)], indexing="ij"), axis=-1)
    products = np.stack(np.meshgrid(*cell.dim * [0.5 * weights], indexing="ij"), axis=-1)
    return lattice.reshape(-1, cell.dim), products.prod(axis=-1).ravel()


def _radon() -> tuple[np.ndarray, np.ndarray]:
    root = np.sqrt(15.0)
    points: list[np.ndarray] = [np.full((1, 3), 1 / 3)]
    weights = [0.225]
    for sign in (-1, 1):
        near, share = (6 + sign * root) / 21, (155 + sign * root) / 1200
        points.append(np.where(np.eye(3, dtype=bool), 1 - 2 * near, near))
        weights += [share] * 3
    return np.concatenate(points)[:, 1:], 0.5 * np.array(weights)
