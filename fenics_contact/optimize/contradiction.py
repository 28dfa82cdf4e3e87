"""Which linear constraints contradict each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fenics_contact.optimize.quadratic_program import unit_rows

Array = NDArray[np.float64]


def contradicting(rows: Array, limits: Array, equal: NDArray[np.bool_]) -> list[int]:
    """Return the numbers of rows that leave no point together, though every part of them does.

    The rows with a multiplier in the least sum of violations cannot be met together; of these each one
    without which the others still contradict each other is dropped.

    Args:
        rows: C of C x ≤ c, shape (m, n).
        limits: c, shape (m,).
        equal: Marks of rows that hold as equations, shape (m,).

    Returns:
        Numbers in ascending order; empty where all can be met.

    References:
        J. W. Chinneck, Feasibility and infeasibility in optimization, Springer, 2008 (elastic and deletion
        filters, chapter 6).
    """
    unit, limit = unit_rows(rows, limits)
    left = _elastic(unit, limit, equal)
    for k in list(left):
        others = [one for one in left if one != k]
        if _elastic(unit[others], limit[others], equal[others]):
            left = others
    return left


def _elastic(rows: Array, limits: Array, equal: NDArray[np.bool_], *, rounding: float = 1e-8) -> list[int]:
    """Return the numbers of rows with a multiplier in min Σ s, C x - s ≤ c; empty where the sum is 0."""
    from scipy.optimize import linprog

    m, n = rows.shape
    if m == 0:
        return []
    doubled = np.vstack([rows, -rows[equal]])
    slacks = np.vstack([np.eye(m), np.eye(m)[equal]])
    found = linprog(
        np.append(np.zeros(n), np.ones(m)),
        A_ub=np.hstack([doubled, -slacks]),
        b_ub=np.concatenate([limits, -limits[equal]]),
        bounds=[(None, None)] * n + [(0.0, None)] * m,
    )
    if not found.success or found.fun <= rounding * (1.0 + np.abs(limits).max()):
        return []
    pushes = np.abs(slacks.T) @ np.abs(found.ineqlin.marginals)
    return [int(k) for k in np.flatnonzero(pushes > rounding)]
