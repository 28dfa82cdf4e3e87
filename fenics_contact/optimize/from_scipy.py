"""Constraints of scipy.optimize: linear ones as rows A x ≤ b and E x = e, nonlinear ones one by one."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fenics_contact.errors import InvalidInputError
from fenics_contact.optimize.nonlinear import NonlinearConstraint

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


def is_nonlinear(given: Any) -> bool:
    """Return whether a constraint is SciPy's NonlinearConstraint; without importing SciPy's optimisers."""
    return type(given).__name__ == "NonlinearConstraint" and hasattr(given, "jac")


def components_of(given: Any, start: Array) -> list[NonlinearConstraint]:
    """Return SciPy's nonlinear constraint, which may have several components, one by one.

    Args:
        given: A `scipy.optimize.NonlinearConstraint` whose ``jac`` is a function.
        start: A point, shape (n,), at which the function exists.

    Raises:
        InvalidInputError: If it has no derivative, or its limits do not fit.
    """
    if not callable(given.jac):
        raise InvalidInputError(
            f"a NonlinearConstraint must have its derivative as the function jac, got {given.jac!r}: give "
            "it, or fenics_contact.optimize.NonlinearConstraint with a function x -> (value, subgradient)"
        )
    values = np.atleast_1d(np.asarray(given.fun(start.copy()), dtype=float))
    if np.size(given.lb) not in (1, values.size) or np.size(given.ub) not in (1, values.size):
        raise InvalidInputError(
            f"a NonlinearConstraint with {values.size} components must have as many limits, or one for all, "
            f"got lb {given.lb} and ub {given.ub}"
        )
    low, high = (
        np.broadcast_to(np.asarray(side, dtype=float), values.shape) for side in (given.lb, given.ub)
    )
    return [
        NonlinearConstraint(partial(_component, given, k), float(high[k]), float(low[k]))
        for k in range(values.size)
    ]


def _component(given: Any, k: int, x: Array) -> tuple[float, Array]:
    derivative = given.jac(x)
    rows = np.atleast_2d(derivative.toarray() if sp.issparse(derivative) else np.asarray(derivative))
    return float(np.atleast_1d(given.fun(x))[k]), rows[k]


def _what_to_give(given: Any) -> str:
    if isinstance(given, NonlinearConstraint) or is_nonlinear(given):
        return (
            "points are projected onto linear constraints only, got a NonlinearConstraint: leave it out, and "
            "let minimize restore it with restore=True"
        )
    if isinstance(given, dict):
        return (
            "constraints must be objects, got a dict: write NonlinearConstraint(fun, lower=0.0) for fun(x) "
            ">= 0, where fun returns value and gradient, or let a method of SciPy keep it (optimize.ForScipy)"
        )
    return (
        "constraints must be LinearConstraints or NonlinearConstraint, or SciPy's, or a list of them, got "
        f"a {type(given).__name__}: write LinearConstraints(A, b) for A x <= b"
    )
