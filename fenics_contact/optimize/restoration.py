"""Equalities: points are corrected until they meet them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.optimize.evaluation import Known, evaluate_constraint
from fenics_contact.optimize.nonlinear import Scaled, scaled_constraints
from fenics_contact.optimize.problem import PosedProblem
from fenics_contact.optimize.quadratic_program import SubproblemError, shortest

Array = NDArray[np.float64]


def restored(
    problem: PosedProblem, x: Array, number: int, feasibility: float, *, steps: int = 30
) -> tuple[Array, Known]:
    """Return the point near x that meets the equalities, bounds and linear constraints, by Newton's method.

    Every correction is the shortest one, in scaled variables, to the linearised equalities.

    Args:
        x: Point that satisfies bounds and linear constraints, shape (n,).

    Returns:
        The point and the equalities there.
    """
    equal = problem.equalities
    if not equal:
        return x, {}
    constraints = [problem.nonlinear[k] for k in equal]
    best = x, {k: evaluate_constraint(problem.nonlinear[k], x, number) for k in equal}
    least = scaled_constraints(constraints, _values(best[1]))
    for _ in range(steps):
        if least.violation <= 0.01 * feasibility:
            break
        try:
            x = _corrected(problem, *best, least)
        except (InvalidInputError, SubproblemError):
            break
        known = {k: evaluate_constraint(problem.nonlinear[k], x, number) for k in equal}
        now = scaled_constraints(constraints, _values(known))
        if not now.violation < 0.9 * least.violation:
            break
        best, least = (x, known), now
    if least.violation > feasibility:
        worst = int(np.argmax(least.violations))
        raise InvalidDesignError(
            f"no design near it meets {constraints[worst].name}: the nearest one found misses it by "
            f"{least.violation:.2g} of its size"
        )
    return best


def _values(known: Known) -> Array:
    return np.array([one.value for one in known.values()])


def _corrected(problem: PosedProblem, x: Array, known: Known, missed: Scaled) -> Array:
    """Return the nearest point, in scaled variables, that meets the linearised equalities."""
    near = problem.allowed.around(x, problem.scale)
    slopes = np.array([one.subgradient for one in known.values()])
    rows = missed.factors[:, None] * slopes * problem.scale
    step = shortest(
        np.vstack([near.equality_rows, rows]),
        np.concatenate([near.miss, -missed.excess]),
        near.rows,
        np.maximum(near.room, 0.0),
    )
    return problem.allowed.clip(x + problem.scale * step)
