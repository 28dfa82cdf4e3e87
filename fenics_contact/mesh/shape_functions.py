"""Shape functions of all cells and rules that integrate their Jacobians exactly, from basix."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from fenics_contact.mesh.cell_types import CellType

#: basix's names of the shapes of simplices and of other cells, by their dimension from 1 on.
_SIMPLICES = ("interval", "triangle", "tetrahedron")
_OTHERS = ("interval", "quadrilateral", "hexahedron")


def shape_values(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Evaluate the shape functions.

    Args:
        cell: The type of cells, or of facets.
        positions: Reference coordinates, (m, dim).

    Returns:
        (m, nodes of a cell).
    """
    return _tabulated(cell, positions, 0)[0]


def shape_gradients(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Evaluate the gradients of the shape functions in reference coordinates.

    Args:
        cell: The type of cells, or of facets.
        positions: Reference coordinates, (m, dim).

    Returns:
        (m, nodes of a cell, dim).
    """
    return np.moveaxis(_tabulated(cell, positions, 1)[1:], 0, 2)


@cache
def quadrature(cell: CellType, degree: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return a rule that integrates squares of shape functions, and the Jacobian of curved cells, exactly.

    Two Gauss points per direction on linear and three on quadratic edges, quadrilaterals and hexahedra; rules
    of degree two on linear and of degree five on quadratic simplices.

    Args:
        cell: The type of cells, or of facets.
        degree: Degree of polynomials that another rule integrates exactly.

    Returns:
        Reference coordinates, (m, dim), and weights that add up to the reference volume, (m,).
    """
    import basix

    own = 2 if cell.is_simplex and cell.order == 1 else 2 * cell.order + 1
    positions, weights = basix.make_quadrature(_shape(cell), degree or own)
    return np.asarray(positions), np.asarray(weights)


def _tabulated(cell: CellType, positions: np.ndarray, derivatives: int) -> np.ndarray:
    """Return the shape functions and their derivatives in each direction, (1 + ..., m, nodes of a cell)."""
    element, number = _element(cell)
    if len(positions) == 0:  # of which some versions of basix end the process
        return np.zeros((1 + derivatives * cell.dim, 0, len(number)))
    values = element.tabulate(derivatives, np.ascontiguousarray(positions, dtype=np.float64))
    return np.asarray(values[..., number, 0])


@cache
def _element(cell: CellType) -> tuple[Any, np.ndarray]:
    """Return basix's element and the number of its function for each node of the cell."""
    import basix

    equispaced = basix.LagrangeVariant.equispaced
    element = basix.create_element(basix.ElementFamily.P, _shape(cell), cell.order, equispaced)
    distance = np.abs(cell.nodes[:, None] - element.points).sum(axis=2)
    return element, distance.argmin(axis=1)


def _shape(cell: CellType) -> Any:
    import basix  # takes a tenth of a second

    return getattr(basix.CellType, (_SIMPLICES if cell.is_simplex else _OTHERS)[cell.dim - 1])
