"""Nonlinear constraints, their cutting planes, and what a result says about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fenics_contact._base.display import displayed
from fenics_contact._optimize.bundle import Bundle, Plane
from fenics_contact._optimize.objective import Fun
from fenics_contact.errors import InvalidInputError

Array = NDArray[np.float64]


@displayed
@dataclass(frozen=True)
class NonlinearConstraint:
    """The constraint lower ≤ c(x) ≤ upper; an equality where both are the same number.

    An inequality may be nonsmooth, such as a largest stress. An equality must be smooth: every trial point is
    corrected by Newton's method until it meets the equality, which calls ``fun`` a few times per step.

    Attributes:
        fun: Takes x of shape (n,), returns c(x) and one subgradient of shape (n,), as the objective does.
        upper: Upper limit, inf for none.
        lower: Lower limit, -inf for none.
        name: Name in results and messages; "constraint 0" and so on where it is empty.
        scale: Size of c by which violations are divided; None for the larger finite limit, 1 where that is 0.

    Raises:
        InvalidInputError: If ``fun`` cannot be called, there is no limit, or lower exceeds upper.

    Example:
        >>> import numpy as np
        >>> def squares(x):
        ...     return float(x @ x), 2.0 * x
        >>> NonlinearConstraint(squares, upper=2.0, name="disc").size
        2.0
    """

    fun: Fun = field(repr=False)
    upper: float = np.inf
    lower: float = -np.inf
    name: str = ""
    scale: float | None = None

    def __post_init__(self) -> None:
        """Reject limits that leave nothing, or everything."""
        if not callable(self.fun):
            raise InvalidInputError(
                f"a NonlinearConstraint needs x -> (value, subgradient), got {type(self.fun).__name__}"
            )
        if np.isnan(self.lower) or np.isnan(self.upper) or self.lower > self.upper:
            raise InvalidInputError(f"lower must not exceed upper, got {self.lower} and {self.upper}")
        if not np.isfinite([self.lower, self.upper]).any():
            raise InvalidInputError(f"a finite upper or lower is needed, got {self.lower} and {self.upper}")
        if self.scale is not None and not 0.0 < self.scale < np.inf:
            raise InvalidInputError(f"scale of a constraint must be positive and finite, got {self.scale}")

    @property
    def equality(self) -> bool:
        """Whether both limits are the same number."""
        return self.lower == self.upper

    @property
    def size(self) -> float:
        """Size of c by which violations are divided."""
        if self.scale is not None:
            return self.scale
        return (
            max((abs(limit) for limit in (self.lower, self.upper) if np.isfinite(limit)), default=0.0) or 1.0
        )

    def excess(self, value: float) -> tuple[float, float]:
        """Return (c - limit)/size, positive where violated, and its derivative by c.

        That of an equality has the sign of c - limit.
        """
        above, below = (value - self.upper) / self.size, (self.lower - value) / self.size
        return (above, 1.0 / self.size) if self.equality or above >= below else (below, -1.0 / self.size)


def is_nonlinear(given: Any) -> bool:
    """Return whether a constraint is nonlinear, this package's or SciPy's; without importing SciPy's."""
    return isinstance(given, NonlinearConstraint) or (
        type(given).__name__ == "NonlinearConstraint" and hasattr(given, "jac")
    )


def named_constraints(given: Sequence[Any], start: Array) -> tuple[NonlinearConstraint, ...]:
    """Return nonlinear constraints, SciPy's component by component, with a name for each."""
    groups = ([one] if isinstance(one, NonlinearConstraint) else _components(one, start) for one in given)
    found = [one for group in groups for one in group]
    return tuple(replace(one, name=one.name or f"constraint {k}") for k, one in enumerate(found))


def _components(given: Any, start: Array) -> list[NonlinearConstraint]:
    """Return the components of a `scipy.optimize.NonlinearConstraint`, whose function exists at ``start``."""
    if not callable(given.jac):
        raise InvalidInputError(
            f"jac must be a function (the derivative), got {given.jac!r}: or use design.NonlinearConstraint"
        )
    values = np.atleast_1d(np.asarray(given.fun(start.copy()), dtype=float))
    if np.size(given.lb) not in (1, values.size) or np.size(given.ub) not in (1, values.size):
        raise InvalidInputError(f"{values.size} components need as many limits, got {given.lb}, {given.ub}")
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


@displayed
@dataclass(frozen=True)
class ConstraintValue:
    """A nonlinear constraint at the best point.

    `violation`: how far c lies outside its limits, divided by its size; 0 inside; `multiplier`: m of the
    stationarity ∇J + Σ m ∇c = 0, positive at an upper limit, negative at a lower one: a small change δ of
    that limit changes the least J by about -m δ. 0 where it is inactive.
    """

    name: str
    value: float
    lower: float
    upper: float
    violation: float
    multiplier: float

    @property
    def active(self) -> bool:
        """Whether a limit restrains J at the best point."""
        return self.multiplier != 0.0

    def __str__(self) -> str:
        """Describe value, limits and multiplier in one line."""
        limits = (
            f"= {self.upper:.9g}"
            if self.lower == self.upper
            else " and ".join(
                f"{sign} {limit:.9g}"
                for sign, limit in (("≥", self.lower), ("≤", self.upper))
                if np.isfinite(limit)
            )
        )
        state = f"active, multiplier {self.multiplier:.4g}" if self.active else "inactive"
        broken = f", violated by {self.violation:.1e} of its size" if self.violation > 0.0 else ""
        return f"{self.name}: {self.value:.9g} ({limits}), {state}{broken}"


@dataclass(frozen=True)
class Scaled:
    """Nonlinear constraints at a point, divided by their sizes.

    `excess`: (c - limit)/size, positive where an inequality is violated; `factors`: its derivatives by c.
    """

    excess: Array
    factors: Array
    equal: NDArray[np.bool_]

    @property
    def violations(self) -> Array:
        """How far each constraint is violated, shape (k,), not negative."""
        return np.where(self.equal, np.abs(self.excess), np.maximum(self.excess, 0.0))

    @property
    def violation(self) -> float:
        """The largest violation, 0 without constraints."""
        return float(self.violations.max(initial=0.0))


def scaled_constraints(constraints: Sequence[NonlinearConstraint], values: Array) -> Scaled:
    """Return constraints in units of their sizes."""
    pairs = [constraint.excess(float(value)) for constraint, value in zip(constraints, values, strict=True)]
    excess, factors = np.array(pairs, dtype=float).reshape(-1, 2).T
    return Scaled(excess, factors, np.array([one.equality for one in constraints], dtype=bool))


@dataclass(frozen=True)
class Rise:
    """What a trial point says of a penalty ρ max(c, 0), units of J.

    `change`: its change from the centre to the trial point; `slope`: ρ a·y where c > 0 at the trial point,
    else 0, with the subgradient a there; `predicted`: its change at the trial point as the new plane predicts
    it.
    """

    change: float = 0.0
    slope: float = 0.0
    predicted: float = 0.0


@dataclass(frozen=True)
class SoftConstraint:
    """c(x) ≤ 0 as ρ max(c(x), 0) in the merit function, and as rows with a slack in the step's programme.

    `bundle`: cutting planes of c at the centre, with their own linearisation errors; `value`: c at the
    centre, divided by the size of the constraint.
    """

    bundle: Bundle
    value: float
    penalty: float
    first_penalty: float

    @property
    def violation(self) -> float:
        """max(c, 0) at the centre."""
        return max(self.value, 0.0)

    @property
    def gradients(self) -> Array:
        """ρ a_i, shape (m, n)."""
        return self.penalty * self.bundle.gradients

    @property
    def depths(self) -> Array:
        """ρ (β_i - c), by which the planes lie below the limit at the centre, shape (m,)."""
        return self.penalty * (self.bundle.measures - self.value)

    @property
    def has_largest_penalty(self) -> bool:
        """Whether the penalty is as large as it may be."""
        return self.penalty >= 0.999 * self._most

    @property
    def _most(self) -> float:
        return 1e6 * self.first_penalty

    def predicted(self, move: Array) -> float:
        """Return the violation that the planes predict for a move of shape (n,)."""
        return max(self.value + self.bundle.model(move), 0.0)

    def raised(self, factor: float) -> SoftConstraint:
        """Return the constraint with a larger penalty."""
        return replace(self, penalty=min(factor * self.penalty, self._most))

    def with_cut(self, plane: Plane, move: Array) -> tuple[SoftConstraint, Rise]:
        """Return the constraint with the plane of a trial point at the end, and what the point says."""
        value, slope = plane.value, float(plane.gradient @ move)
        error, length = slope - (value - self.value), float(np.linalg.norm(move))
        bundle = self.bundle.with_cut(plane, error, length)
        seen = max(self.value + slope - float(bundle.measures[-1]), 0.0)
        return replace(self, bundle=bundle), Rise(
            self.penalty * (max(value, 0.0) - self.violation),
            self.penalty * slope if value > 0.0 else 0.0,
            self.penalty * (seen - self.violation),
        )

    def reduced(self, weights: Array, room: int) -> SoftConstraint:
        """Return the constraint with at most ``room`` planes, see `Bundle.reduced`."""
        total = float(weights.sum())
        shares = np.asarray(weights / (total if total > 0.0 else 1.0), dtype=np.float64)
        return replace(self, bundle=self.bundle.reduced(shares, room))

    def refined(self, plane: Plane) -> SoftConstraint:
        """Return the constraint after its centre was re-evaluated."""
        return replace(self, bundle=self.bundle.refined(plane, plane.value - self.value), value=plane.value)

    def moved(self, plane: Plane, move: Array, locality: float) -> SoftConstraint:
        """Return the constraint seen from a new centre, whose plane is the last one."""
        bundle = self.bundle.moved(move, plane.value - self.value, locality * plane.length)
        return replace(self, bundle=bundle, value=plane.value)

    def without_doubtful_planes(self) -> SoftConstraint:
        """Return the constraint without doubtful planes."""
        return replace(self, bundle=self.bundle.chosen(np.flatnonzero(~self.bundle.doubtful)))
