"""Linear constraints of scipy.optimize as rows A x ≤ b and E x = e."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fenics_contact.errors import InvalidInputError

Array = NDArray[np.float64]


class Rows(NamedTuple):
    """A x ≤ b and E x = e: A, shape (m, n), b, shape (m,), E, shape (r, n), e, shape (r,)."""

    matrix: Array
    limit: Array
    equality_matrix: Array
    equality_value: Array


def rows_of(given: Any, n: int) -> Rows:
    """Return the rows of SciPy's linear constraints: one for each finite limit, one where both are equal.

    Args:
        given: A `scipy.optimize.LinearConstraint`, or a list or tuple of them.
        n: Number of variables.

    Raises:
        InvalidInputError: If a constraint is not linear, or a shape does not fit.
    """
    sides = [_sides(one, n) for one in (given if isinstance(given, list | tuple) else [given])]
    matrix = np.vstack([np.zeros((0, n)), *(side[0] for side in sides)])
    low, high = (np.concatenate([np.zeros(0), *(side[k] for side in sides)]) for k in (1, 2))
    equal = low == high
    above, below = np.isfinite(high) & ~equal, np.isfinite(low) & ~equal
    return Rows(
        np.vstack([matrix[above], -matrix[below]]),
        np.concatenate([high[above], -low[below]]),
        matrix[equal],
        high[equal],
    )


def _sides(given: Any, n: int) -> tuple[Array, Array, Array]:
    """Return a constraint as low ≤ matrix x ≤ high."""
    from scipy.optimize import LinearConstraint

    if not isinstance(given, LinearConstraint):
        raise InvalidInputError(_what_to_give(given))
    dense = given.A.toarray() if sp.issparse(given.A) else given.A
    matrix = np.atleast_2d(np.asarray(dense, dtype=float))
    low, high = (np.broadcast_to(np.asarray(side, dtype=float), len(matrix)) for side in (given.lb, given.ub))
    if matrix.shape[1] != n:
        raise InvalidInputError(
            f"a LinearConstraint must have a matrix of {n} columns, one for each variable, got shape "
            f"{matrix.shape}"
        )
    if np.isnan(low).any() or np.isnan(high).any() or (low > high).any():
        raise InvalidInputError(
            f"a LinearConstraint must have lb <= ub in every row, got lb {low} and ub {high}: exchange them"
        )
    return matrix, low, high


def _what_to_give(given: Any) -> str:
    name = "a dict" if isinstance(given, dict) else f"a {type(given).__name__}"
    if isinstance(given, dict) or type(given).__name__ == "NonlinearConstraint":
        return (
            f"constraints must be linear, got {name}: give its linearisation at the start, c(x0) + "
            "J (x - x0), as LinearConstraints(J, ub - c(x0) + J @ x0), with bounds within which that is "
            "accurate, and minimise again from the result; or let a method of SciPy keep it "
            "(optimize.ForScipy)"
        )
    return (
        f"constraints must be LinearConstraints, or SciPy's LinearConstraint or a list of them, got {name}: "
        "write LinearConstraints(A, b) for A x <= b"
    )
