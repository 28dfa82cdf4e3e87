"""Entry point of the package: min J(x) over a box, linear and nonlinear constraints."""

from __future__ import annotations

from numpy.typing import ArrayLike

from fenics_contact.checkpoint import Checkpoint
from fenics_contact.optimize.bundle_trust import BundleTrust
from fenics_contact.optimize.constraints import Bounds, Constraints
from fenics_contact.optimize.objective import Fun
from fenics_contact.optimize.problem import pose
from fenics_contact.optimize.progress import Callback
from fenics_contact.optimize.result import Result


def minimize(
    fun: Fun,
    x0: ArrayLike,
    method: BundleTrust | None = None,
    *,
    bounds: Bounds | tuple[ArrayLike, ArrayLike] | None = None,
    constraints: Constraints | None = None,
    scale: ArrayLike | None = None,
    restore: bool = False,
    callback: Callback | None = None,
    checkpoint: Checkpoint | None = None,
) -> Result:
    """Minimise a locally Lipschitz function, convex or not, over a box, linear and nonlinear constraints.

    The iterates depend only on the arguments: replicated on the ranks of a communicator, with a ``fun`` that
    returns bitwise equal values on all of them, they are bitwise equal, too.

    Args:
        fun: Takes x of shape (n,), returns J(x) and one (Clarke) subgradient of shape (n,). It is only called
            at points within the box, and within the other constraints to rounding. Where J does not exist it
            raises `InvalidDesignError`, and a shorter step is tried.
        x0: Feasible starting point, shape (n,).
        method: Parameters; None for the default ones.
        bounds: Box, or a pair (lower, upper), or None.
        constraints: `LinearConstraints`, `NonlinearConstraint`, SciPy's of either kind, or a list of them.
            All are met at the stop, linear ones and, after corrections, equalities at every point tried.
        scale: Size of each variable, shape (n,) or a number. None takes the widths of the box where it is
            bounded on all sides, of the narrowest for fixed variables, so choose meaningful bounds; else 1.
        restore: Whether x0 may violate nonlinear constraints; the method then restores them.
        callback: Called after every evaluation with its record and the best point so far, and before the
            checkpoint is written: a run that died in between reports the record again when it continues.
        checkpoint: File that is written after evaluations and from which an interrupted run continues with
            the same iterates; None writes nothing. Limits and tolerance may be changed between.

    Returns:
        The best point, its value and subgradient, the reason for the stop and the history.

    Raises:
        InvalidInputError: If a shape does not fit, x0 is infeasible, a function returns nan or inf, or the
            checkpoint is unreadable or belongs to another problem.
        CheckpointError: If the checkpoint cannot be written; the previous one is unchanged.
        InvalidDesignError: If J does not exist at x0.
        NotConvergedError: If the method stops before its tolerance is met, with the history and the best
            result so far; not if ``method.raise_on_failure`` is False.

    Example:
        >>> import numpy as np
        >>> def largest_component(x):
        ...     k = int(np.argmax(np.abs(x)))
        ...     return abs(x[k]), np.sign(x[k]) * np.eye(x.size)[k]
        >>> result = minimize(largest_component, [3.0, -1.0], bounds=([1.0, -4.0], [5.0, 4.0]))
        >>> round(result.value, 3), result.reason.name
        (1.0, 'STATIONARY')
    """
    problem = pose(fun, x0, bounds, constraints, scale, restore=restore)
    return (method or BundleTrust()).minimize(problem, callback, checkpoint)
