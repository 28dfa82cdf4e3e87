"""Polynomials in the cells of a mesh, on which changes of volume are projected."""

from __future__ import annotations

from copy import copy

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact.fem.templates import quadrature_degree
from fenics_contact.mesh import CELL_TYPES, jacobians, quadrature, shape_values

#: Cells with a dilatation that is linear in each; it is constant in all others. Hexahedra and quadrilaterals
#: of 27 and 9 nodes are stable with it, and as accurate as they can be (Q2/P1 discontinuous). Quadratic
#: simplices are not: at their Gauss points it would be the dilatation itself.
LINEAR = ("quadrilateral9", "hexahedron27")
#: Cells in which deformations without change of shape have a dilatation of mean zero, which is not projected
#: away: u = 2 (b·x) x − |x|² b.
UNSEEN = ("tetrahedron10",)


def polynomial_size(cell_type: str) -> int:
    """Return the number of coefficients of a polynomial: one, or one more than the dimension."""
    return 1 + CELL_TYPES[cell_type].dim if cell_type in LINEAR else 1


class CellPolynomials:
    """The polynomials 1, or 1 and X − X_c, in cells c with centres X_c, and projections by the Gauss rule.

    References:
        D. Boffi, L. Gastaldi, On the quadrilateral Q2-P1 element for the Stokes problem, Int. J. Numer.
        Methods Fluids 39 (2002) 1001-1011: polynomials of the coordinates in space keep the order on
        distorted cells, those of reference coordinates do not.
    """

    def __init__(self, points: np.ndarray, cells: np.ndarray, cell_type: str) -> None:
        """Evaluate them at the Gauss points.

        Args:
            points: Coordinates, shape (n, dim), [length].
            cells: Nodes of the cells in VTK order, shape (n_cells, nodes of a cell).
            cell_type: Of the cells.
        """
        cell = CELL_TYPES[cell_type]
        positions, weights = quadrature(cell, quadrature_degree(cell_type))
        jacobian = jacobians(points, cells, positions)
        self.weights = np.broadcast_to(jacobian, (len(cells), len(weights))) * weights
        places = shape_values(cell, positions) @ points[cells]
        self.centres = np.einsum("cq,cqd->cd", self.weights, places) / self.weights.sum(axis=1)[:, None]
        linear = (places - self.centres[:, None])[..., : polynomial_size(cell_type) - 1]
        self.values = np.concatenate([np.ones((*self.weights.shape, 1)), linear], axis=2)
        #: Inverse of ∫ ψ_i ψ_j, shape (n_cells, n, n).
        self.inverse = np.linalg.inv(self.values.swapaxes(1, 2) @ (self.weights[..., None] * self.values))

    def of(self, cells: np.ndarray) -> CellPolynomials:
        """Return those of some cells."""
        part = copy(self)
        for name, array in vars(self).items():
            setattr(part, name, array[cells])
        return part

    def coefficients(self, given: np.ndarray) -> np.ndarray:
        """Return the coefficients of the projections of values at Gauss points.

        Args:
            given: Shape (n_cells, n_gauss, k).

        Returns:
            Shape (n_cells, n, k).
        """
        return np.asarray(self.inverse @ (self.values.swapaxes(1, 2) @ (self.weights[..., None] * given)))

    def projected(self, given: np.ndarray) -> np.ndarray:
        """Return the projections of values at Gauss points, shape (n_cells, n_gauss, k)."""
        return np.asarray(self.values @ self.coefficients(given))

    def at(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the values at Gauss points by coefficients (n_cells, n), shape (n_cells, n_gauss)."""
        return np.asarray((self.values @ coefficients[..., None])[..., 0])


def polynomial(coefficients: Expr, centre: Expr, cell_type: str) -> Expr:
    """Return a polynomial on the template.

    Args:
        coefficients: Constant in each cell: a scalar, or a vector of `polynomial_size`.
        centre: X_c of each cell.
        cell_type: Of the template.
    """
    if cell_type not in LINEAR:
        return coefficients
    x = ufl.SpatialCoordinate(_dolfinx.template(cell_type))
    slopes = (coefficients[1 + i] * (x[i] - centre[i]) for i in range(len(x)))
    return coefficients[0] + sum(slopes)


def coefficient_shape(cell_type: str) -> tuple[int, ...]:
    """Return the shape of a polynomial's coefficients in one cell."""
    return (polynomial_size(cell_type),) if cell_type in LINEAR else ()
