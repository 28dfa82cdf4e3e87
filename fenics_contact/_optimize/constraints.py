"""The feasible set of designs: a box and linear constraints, also relative to a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact._optimize.bundle import shortest, unit_rows
from fenics_contact._optimize.nonlinear import NonlinearConstraint, is_nonlinear
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    import scipy.optimize


Array = NDArray[np.float64]


def contradicting(rows: Array, limits: Array, equal: NDArray[np.bool_]) -> list[int]:
    """Return the numbers of rows that leave no point together, though every part of them does.

    The rows with a multiplier in the least sum of violations cannot be met together; of these each one
    without which the others still contradict each other is dropped. Returns numbers in ascending order; empty
    where all can be met.

    References:
        J. W. Chinneck, Feasibility and infeasibility in optimization, Springer, 2008 (elastic and deletion
        filters, chapter 6).
    """
    unit, limit = unit_rows(rows, limits)
    limit = limit / (np.abs(limit).max(initial=0.0) or 1.0)
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
    if not found.success or found.fun <= rounding:
        return []
    pushes = np.abs(slacks.T) @ np.abs(found.ineqlin.marginals)
    return [int(k) for k in np.flatnonzero(pushes > rounding)]


#: A box lower ≤ x ≤ upper: a pair, numbers or shape (n,), ±inf where there is no bound; or SciPy's Bounds.
Box: TypeAlias = "tuple[ArrayLike, ArrayLike] | scipy.optimize.Bounds"
#: A constraint, as this package or as SciPy writes it.
Constraint: TypeAlias = (
    "LinearConstraints | NonlinearConstraint | scipy.optimize.LinearConstraint |"
    "scipy.optimize.NonlinearConstraint"
)
#: One or several of them.
Constraints: TypeAlias = "Constraint | Sequence[Constraint]"

# A row counts as satisfied within this fraction of the size of its terms, which is rounding.
_FEASIBILITY = 1e-9


def _frozen(values: ArrayLike, name: str, dimensions: int) -> Array:
    array = np.array(values, dtype=float)
    if array.ndim != dimensions:
        raise InvalidInputError(f"{name} must have {dimensions} dimension(s), got shape {array.shape}")
    if np.isnan(array).any():
        raise InvalidInputError(f"{name} must hold numbers, got nan at {np.argwhere(np.isnan(array))[0]}")
    array.setflags(write=False)
    return array


@displayed
@dataclass(frozen=True)
class LinearConstraints:
    """Rows A x ≤ b and, optionally, E x = e.

    Attributes:
        matrix: A, shape (m, n).
        limit: b, shape (m,), finite.
        equality_matrix: E, shape (r, n), or None.
        equality_value: e, shape (r,), or None.

    Example:
        Three variables whose sum is at most 1 and the first two of which are equal:

        >>> constraints = LinearConstraints([[1, 1, 1]], [1.0], [[1, -1, 0]], [0.0])
        >>> nearest_feasible([2.0, 0.0, 0.0], (0.0, 5.0), constraints).round(3).tolist()
        [0.5, 0.5, 0.0]
    """

    matrix: ArrayLike
    limit: ArrayLike
    equality_matrix: ArrayLike | None = None
    equality_value: ArrayLike | None = None

    @property
    def equalities(self) -> list[tuple[ArrayLike, ArrayLike]]:
        """E and e, none without equalities."""
        given = [side for side in (self.equality_matrix, self.equality_value) if side is not None]
        if len(given) == 1:
            raise InvalidInputError("an equality needs both equality_matrix and equality_value, got only one")
        return [(given[0], given[1])] if given else []


@dataclass(frozen=True)
class LocalFeasibleSet:
    """The feasible set seen from a point x, for a step y in scaled variables (x + scale·y).

    `rows`: C of C y ≤ room, every row of length one; `room`: distance to each row; negative where x violates
    it; `equality_rows`: E of E y = miss, every row of length one; `miss`: signed distance to each equality.
    """

    rows: Array
    room: Array
    equality_rows: Array
    miss: Array


@displayed
@dataclass(frozen=True)
class FeasibleSet:
    """{x : lower ≤ x ≤ upper, A x ≤ b, E x = e}, checked and complete (empty where unconstrained)."""

    lower: Array
    upper: Array
    matrix: Array
    limit: Array
    equality_matrix: Array
    equality_value: Array

    def violations(self, x: Array) -> list[str]:
        """Name every bound and row that x violates, with the amount."""
        messages = []
        given = [np.where(np.isfinite(each), np.abs(each), 0.0) for each in (x, self.lower, self.upper)]
        size = np.max(given, axis=0, initial=0.0)
        margin = _FEASIBILITY * size + 10.0 * np.finfo(float).eps * size.max(initial=0.0)
        for k in np.flatnonzero(x < self.lower - margin):
            messages.append(f"x[{k}] = {x[k]:.6g} is below its lower bound {self.lower[k]:.6g}")
        for k in np.flatnonzero(x > self.upper + margin):
            messages.append(f"x[{k}] = {x[k]:.6g} is above its upper bound {self.upper[k]:.6g}")
        excess, margin = _residual(self.matrix, self.limit, x)
        for k in np.flatnonzero(excess > margin):
            messages.append(f"row {k} of A x ≤ b is exceeded by {excess[k]:.3g}")
        excess, margin = _residual(self.equality_matrix, self.equality_value, x)
        for k in np.flatnonzero(np.abs(excess) > margin):
            messages.append(f"row {k} of E x = e is missed by {excess[k]:.3g}")
        return messages

    def clip(self, x: Array) -> Array:
        """Return x moved into the box (rounding only, for a point that is feasible to tolerance)."""
        return np.minimum(np.maximum(x, self.lower), self.upper)

    def project(self, x: Array) -> Array:
        """Return the feasible point nearest to x, shape (n,); x clipped to the box where it is feasible."""
        # The first programme is solved to a fraction of the distance; the second removes the remainder, a
        # third its rounding.
        for _ in range(3):
            if not self.violations(x):
                break
            near = self.around(x, np.ones(x.size))
            try:
                x = x + shortest(near.equality_rows, near.miss, near.rows, near.room)
            except InvalidInputError as error:
                raise InvalidInputError(f"{error}{self._contradiction()}") from error
        return self.clip(x)

    def _contradiction(self) -> str:
        """Name rows and bounds that cannot be met together, if they are found."""
        n = self.lower.size
        sides = [
            (self.matrix, self.limit, [f"row {k} of A x ≤ b" for k in range(len(self.limit))]),
            (self.equality_matrix, self.equality_value,
             [f"row {k} of E x = e" for k in range(len(self.equality_value))]),
            (-np.eye(n), -self.lower, [f"the lower bound of x[{k}]" for k in range(n)]),
            (np.eye(n), self.upper, [f"the upper bound of x[{k}]" for k in range(n)]),
        ]  # fmt: skip
        rows, limits = np.vstack([side[0] for side in sides]), np.concatenate([side[1] for side in sides])
        names = [name for side in sides for name in side[2]]
        given = np.flatnonzero(np.isfinite(limits))
        start, count = len(self.limit), len(self.equality_value)
        equal = (given >= start) & (given < start + count)
        found = [names[given[k]] for k in contradicting(rows[given], limits[given], equal)]
        return f": {', '.join(found)}" if found else ""

    def around(self, x: Array, scale: Array) -> LocalFeasibleSet:
        """Return the constraints on a step y from x in scaled variables."""
        unit = np.eye(x.size)
        below, above = (x - self.lower) / scale, (self.upper - x) / scale
        fixed = self.lower == self.upper
        low, high = np.isfinite(below) & ~fixed, np.isfinite(above) & ~fixed
        rows, room = unit_rows(self.matrix * scale, self.limit - self.matrix @ x)
        gap = self.equality_value - self.equality_matrix @ x
        equality, miss = unit_rows(self.equality_matrix * scale, gap)
        return LocalFeasibleSet(
            rows=np.vstack([rows, -unit[low], unit[high]]),
            room=np.concatenate([room, below[low], above[high]]),
            equality_rows=np.vstack([equality, unit[fixed]]),
            miss=np.concatenate([miss, above[fixed]]),
        )


def _residual(matrix: Array, limit: Array, x: Array) -> tuple[Array, Array]:
    size = np.abs(matrix) @ np.abs(x) + np.abs(limit)
    # A variable that is to be 0 is met to the rounding of the others.
    rounding = np.finfo(float).eps * np.abs(matrix).sum(axis=1) * np.abs(x).max(initial=0.0)
    return matrix @ x - limit, _FEASIBILITY * np.where(size > 0.0, size, 1.0) + 10.0 * rounding


def feasible_set(
    n: int,
    bounds: Box | None = None,
    constraints: Constraints | None = None,
) -> FeasibleSet:
    """Check the caller's constraints and fill in the defaults."""
    lower, upper = _box(n, bounds)
    given = [] if constraints is None else constraints
    parts = [_checked_rows(n, one) for one in (given if isinstance(given, list | tuple) else [given])]
    nothing = (np.zeros((0, n)), np.zeros(0), np.zeros((0, n)), np.zeros(0))
    rows = (_frozen(np.concatenate(side), "rows", side[0].ndim) for side in zip(nothing, *parts, strict=True))
    return FeasibleSet(lower, upper, *rows)


def _checked_rows(n: int, given: Any) -> tuple[Array, Array, Array, Array]:
    """Return A, b, E, e of linear constraints in either form."""
    rows = given if isinstance(given, LinearConstraints) else _of_scipy(given, n)
    matrix, limit = _rows(n, rows.matrix, rows.limit, "A", "b")
    for equality, value in rows.equalities:
        return matrix, limit, *_rows(n, equality, value, "E", "e")
    return matrix, limit, np.zeros((0, n)), np.zeros(0)


def _of_scipy(given: Any, n: int) -> LinearConstraints:
    """Return a `scipy.optimize.LinearConstraint`: a row for each finite limit, one where both are equal."""
    from scipy.optimize import LinearConstraint

    if not isinstance(given, LinearConstraint):
        raise InvalidInputError(_what_to_give(given))
    dense = given.A.toarray() if sp.issparse(given.A) else given.A
    matrix = np.atleast_2d(np.asarray(dense, dtype=float))
    low, high = (np.broadcast_to(np.asarray(side, dtype=float), len(matrix)) for side in (given.lb, given.ub))
    if matrix.shape[1] != n:
        raise InvalidInputError(f"a LinearConstraint needs a matrix of {n} columns, got shape {matrix.shape}")
    if np.isnan(low).any() or np.isnan(high).any() or (low > high).any():
        raise InvalidInputError(f"a LinearConstraint must have lb <= ub, got lb {low} and ub {high}")
    equal = low == high
    above, below = np.isfinite(high) & ~equal, np.isfinite(low) & ~equal
    rows, limits = np.vstack([matrix[above], -matrix[below]]), np.concatenate([high[above], -low[below]])
    return LinearConstraints(rows, limits, matrix[equal], high[equal])


def _what_to_give(given: Any) -> str:
    if is_nonlinear(given):
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


def _box(n: int, bounds: Box | None) -> tuple[Array, Array]:
    pair: Any = (-np.inf, np.inf) if bounds is None else bounds
    if hasattr(pair, "lb"):  # SciPy's, whose numbers for all variables have shape (1,)
        pair = tuple(np.squeeze(side) if np.size(side) == 1 else side for side in (pair.lb, pair.ub))
    if len(pair) != 2:
        raise InvalidInputError(f"bounds must be a pair (lower, upper), got {len(pair)} entries")
    for name, side in zip(("lower", "upper"), pair, strict=True):
        if np.shape(side) not in ((), (n,)):
            raise InvalidInputError(f"{name} bound must have shape ({n},) like x0, got {np.shape(side)}")
    lower, upper = (
        _frozen(np.broadcast_to(np.asarray(side, dtype=float), (n,)), f"{name} bound", 1)
        for name, side in zip(("lower", "upper"), pair, strict=True)
    )
    crossed = np.flatnonzero(lower > upper)
    if crossed.size:
        k = crossed[0]
        raise InvalidInputError(f"lower must be <= upper, got {lower[k]:.6g} > {upper[k]:.6g} for x[{k}]")
    return lower, upper


def _rows(n: int, matrix: ArrayLike, limit: ArrayLike, name: str, right: str) -> tuple[Array, Array]:
    a, b = _frozen(matrix, name, 2), _frozen(limit, right, 1)
    if a.shape != (b.size, n):
        raise InvalidInputError(f"{name} must have shape ({b.size}, {n}) to match {right}, got {a.shape}")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InvalidInputError(f"{name} and {right} must be finite: leave out the rows that bind nothing")
    return a, b


@naming_arguments
def nearest_feasible(
    x: ArrayLike,
    bounds: Box | None = None,
    constraints: Constraints | None = None,
) -> Array:
    """Return the feasible point nearest to x in the Euclidean norm.

    Args:
        x: Any point, shape (n,).
        bounds: Pair (lower, upper), SciPy's Bounds, or None.
        constraints: Rows, or None.

    Returns:
        The projection, shape (n,), feasible to rounding.

    Raises:
        InvalidInputError: If the constraints contradict each other or their shapes do not fit.
    """
    point = _frozen(x, "x", 1)
    allowed = feasible_set(point.size, bounds, constraints)
    return allowed.project(point)
