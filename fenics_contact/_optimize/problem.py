"""The problem min J(x) over a feasible set: checked, scaled, and evaluated as accurately as needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact._base.display import displayed
from fenics_contact._optimize.constraints import Box, Constraints, FeasibleSet, feasible_set
from fenics_contact._optimize.nonlinear import (
    NonlinearConstraint,
    Scaled,
    is_nonlinear,
    named_constraints,
    scaled_constraints,
)
from fenics_contact._optimize.objective import (
    Accuracy,
    Evaluation,
    Fun,
    can_be_inexact,
    evaluate,
    with_gradient_near,
)
from fenics_contact.errors import InvalidInputError

Array = NDArray[np.float64]


#: Evaluations of some constraints at a point, by their numbers.
Known = Mapping[int, Evaluation]


def evaluate_constraint(
    constraint: NonlinearConstraint, x: Array, number: int, accuracy: Accuracy | None = None
) -> Evaluation:
    """Return value and subgradient of a constraint at x, as accurately as possible by default."""
    return evaluate(constraint.fun, x, number, accuracy, f"fun of {constraint.name}")


@displayed
@dataclass(frozen=True)
class CheckedProblem:
    """min J(x) over a feasible set, checked.

    `scale`: size of each variable: the method sees x/scale; `length`: length scale of the problem in scaled
    variables.
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

    def evaluate(
        self, x: Array, number: int, accuracy: Accuracy, penalties: Mapping[int, float], known: Known
    ) -> Evaluation:
        """Evaluate objective and nonlinear constraints at a point, the objective first.

        Constraints are evaluated inexactly only where the objective is, as only then the centre is evaluated
        again.
        """
        found = evaluate(self.fun, x, number, accuracy)
        own = []
        for k, constraint in enumerate(self.nonlinear):
            value = accuracy.value * constraint.size / ((1 + len(self.nonlinear)) * penalties.get(k, np.inf))
            inexact = k in penalties and can_be_inexact(self.fun)
            wanted = Accuracy(value, accuracy.subgradient) if inexact else None
            own.append(known[k] if k in known else evaluate_constraint(constraint, x, number, wanted))
        if not own:
            return found
        return replace(
            found,
            doubtful=found.doubtful or any(one.doubtful for one in own),
            constraints=np.array([one.value for one in own]),
            slopes=np.array([one.subgradient for one in own]),
            constraint_errors=np.array([one.error for one in own]),
        )

    def with_gradients_near(self, given: Evaluation, end: Array, number: int) -> Evaluation:
        """Return an evaluation with gradients near it, on the way to ``end``, in place of doubtful ones."""
        found, slopes = with_gradient_near(self.fun, given, end, number), given.slopes.copy()
        for k, one in enumerate(self.nonlinear):
            own = replace(given, value=float(given.constraints[k]), subgradient=slopes[k])
            near = with_gradient_near(one.fun, own, end, number, f"fun of {one.name}")
            slopes[k] = near.subgradient
        return replace(found, slopes=slopes, doubtful=False)


def pose(
    fun: Fun,
    x0: ArrayLike,
    bounds: Box | None = None,
    constraints: Constraints | None = None,
    scale: ArrayLike | None = None,
    *,
    restore: bool = False,
) -> CheckedProblem:
    """Check a problem and choose its scales; the arguments are those of `minimize`, arrays are copied."""
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
            f"x0 must be feasible, but {'; '.join(violations[:3])}{more}: use nearest_feasible(x0, ...)"
        )
    start = allowed.clip(start)
    size = _scale(start.size, allowed, scale)
    length = _length(start, allowed, size)
    return CheckedProblem(fun, start, allowed, size, length, named_constraints(curved, start), restore)


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


@dataclass(frozen=True)
class OracleAccuracy:
    """The errors that a decision tolerates.

    A trial is assessed by the difference of two values, a step of length ℓ by a subgradient. Errors of J must
    stay below share · w and those of the subgradient below part · w/ℓ, with w the predicted decrease or,
    where that is larger, the decrease that is not worth a step. No trial that raises J then becomes the
    centre, as long as twice the share is less than the ``descent`` of the method. `headroom`: factor on the
    sufficient accuracy that is requested: not every step re-evaluates the centre; `confirm`: an unconfirmed
    centre is evaluated with errors smaller by this factor.

    References:
        K. C. Kiwiel, A proximal bundle method with approximate subgradient linearizations, SIAM J. Optim. 16
        (2006) 1007-1023. W. de Oliveira, C. Sagastizábal, C. Lemaréchal, Convex proximal bundle methods in
        depth: a unified analysis for inexact oracles, Math. Program. 148 (2014) 241-277.
    """

    value: float
    subgradient: float
    headroom: float = 0.25
    confirm: float = 0.1

    @property
    def asked(self) -> Accuracy:
        """Accuracy to request from the function."""
        return Accuracy(self.headroom * self.value, self.headroom * self.subgradient)

    def missed_by(self, centre: Evaluation) -> bool:
        """Return whether the centre must be re-evaluated, if that was not tried already."""
        value = centre.error > self.value and centre.asked_value > self.asked.value
        return value or centre.asked_subgradient > self.subgradient

    def confirmed_by(self, centre: Evaluation) -> bool:
        """Return whether a second evaluation has shown that the centre's subgradient is accurate enough."""
        return centre.turned <= self.subgradient / self.confirm or centre.asked_subgradient == 0.0

    def sharper_than(self, centre: Evaluation) -> Accuracy:
        """Return the accuracy for a re-evaluation of the centre."""
        value = min(self.asked.value, self.confirm * centre.asked_value)
        return Accuracy(value, min(self.asked.subgradient, self.confirm * centre.asked_subgradient))


def demand(worth: float, reach: float, norm: float, shares: tuple[float, float]) -> OracleAccuracy:
    """Return the accuracy that a decision needs."""
    slope = norm * reach
    return OracleAccuracy(shares[0] * worth, min(shares[1] * worth / slope if slope > 0.0 else np.inf, 1.0))


def again(centre: Evaluation, evaluation: Evaluation) -> Evaluation:
    """Return the re-evaluated centre with the change of its subgradient since the first evaluation."""
    size = float(np.linalg.norm(evaluation.subgradient))
    change = float(np.linalg.norm(evaluation.subgradient - centre.subgradient))
    turned = change / size if size > 0.0 else (0.0 if change == 0.0 else np.inf)
    return replace(evaluation, turned=float(turned))
