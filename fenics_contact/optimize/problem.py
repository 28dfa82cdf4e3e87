"""The problem min J(x) over a feasible set: checked input and the scales of the method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.optimize.constraints import Bounds, Constraints, FeasibleSet, feasible_set
from fenics_contact.optimize.nonlinear import (
    NonlinearConstraint,
    Scaled,
    is_nonlinear,
    named_constraints,
    scaled_constraints,
)
from fenics_contact.optimize.objective import Evaluation, Fun

Array = NDArray[np.float64]


@displayed
@dataclass(frozen=True)
class PosedProblem:
    """min J(x) over a feasible set, checked.

    Attributes:
        fun: Value and subgradient at a point.
        start: Feasible starting point, shape (n,).
        allowed: The feasible set.
        scale: Size of each variable, shape (n,): the method sees x/scale.
        length: Length scale of the problem in scaled variables.
        nonlinear: Nonlinear constraints, every one with a name.
        restore: Whether the start may violate them.
    """

    fun: Fun
    start: Array
    allowed: FeasibleSet
    scale: Array
    length: float
    nonlinear: tuple[NonlinearConstraint, ...] = ()
    restore: bool = False

    @property
    def equalities(self) -> list[int]:
        """Numbers of the nonlinear constraints that are equalities."""
        return [k for k, one in enumerate(self.nonlinear) if one.equality]

    @property
    def inequalities(self) -> list[int]:
        """Numbers of the other nonlinear constraints."""
        return [k for k, one in enumerate(self.nonlinear) if not one.equality]

    def constraints_at(self, evaluation: Evaluation) -> Scaled:
        """Return the nonlinear constraints of an evaluation in units of their sizes."""
        return scaled_constraints(self.nonlinear, evaluation.constraints)


def pose(
    fun: Fun,
    x0: ArrayLike,
    bounds: Bounds | tuple[ArrayLike, ArrayLike] | None = None,
    constraints: Constraints | None = None,
    scale: ArrayLike | None = None,
    *,
    restore: bool = False,
) -> PosedProblem:
    """Check a problem and choose its scales; the arguments are those of `minimize`, arrays are copied.

    Raises:
        InvalidInputError: If a shape does not fit, x0 is not finite or not feasible.
    """
    start = np.array(x0, dtype=float)
    if start.ndim != 1 or start.size == 0:
        raise InvalidInputError(f"x0 must have shape (n,) with n ≥ 1, got {start.shape}")
    if not np.isfinite(start).all():
        k = np.flatnonzero(~np.isfinite(start))[0]
        raise InvalidInputError(f"x0 must be finite, got x0[{k}] = {start[k]}")
    given = () if constraints is None else constraints
    parts = list(given) if isinstance(given, Sequence) else [given]
    curved = [one for one in parts if is_nonlinear(one)]
    linear = [one for one in parts if all(one is not other for other in curved)]
    allowed = feasible_set(start.size, bounds, linear)
    violations = allowed.violations(start)
    if violations:
        more = f" and {len(violations) - 3} more" if len(violations) > 3 else ""
        raise InvalidInputError(
            f"x0 must be feasible, but {'; '.join(violations[:3])}{more}: start from "
            "nearest_feasible(x0, bounds, constraints)"
        )
    start = allowed.clip(start)
    size = _scale(start.size, allowed, scale)
    length = _length(start, allowed, size)
    return PosedProblem(fun, start, allowed, size, length, named_constraints(curved, start), restore)


def _scale(n: int, allowed: FeasibleSet, scale: ArrayLike | None) -> Array:
    if scale is None:
        width = allowed.upper - allowed.lower
        if not np.isfinite(width).all() or not width.any():
            return np.ones(n)
        # A fixed variable takes no step, but its derivative is part of norms: in units of the others.
        return np.where(width > 0.0, width, width[width > 0.0].min())
    size = np.array(scale, dtype=float)
    if size.shape not in ((), (n,)) or not (np.isfinite(size).all() and (size > 0.0).all()):
        raise InvalidInputError(f"scale must be positive, a number or of shape ({n},), got {size}")
    return np.broadcast_to(size, (n,)).copy()


def _length(start: Array, allowed: FeasibleSet, scale: Array) -> float:
    diagonal = float(np.linalg.norm((allowed.upper - allowed.lower) / scale))
    if np.isfinite(diagonal) and diagonal > 0.0:
        return 0.5 * diagonal
    return max(1.0, float(np.linalg.norm(start / scale)))
