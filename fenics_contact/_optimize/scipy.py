"""The problem in the form of scipy.optimize: scaled, guarded against invalid designs, with a record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact._base.display import displayed
from fenics_contact._optimize.bundle import unit_rows
from fenics_contact._optimize.constraints import Box, Constraints
from fenics_contact._optimize.nonlinear import NonlinearConstraint, scaled_constraints
from fenics_contact._optimize.objective import Evaluation, Fun, evaluate, require_finite
from fenics_contact._optimize.problem import evaluate_constraint, pose
from fenics_contact.errors import InvalidDesignError, InvalidInputError

if TYPE_CHECKING:
    import scipy.optimize


Array = NDArray[np.float64]

_WITHOUT_DERIVATIVE = ("cobyla", "cobyqa", "nelder-mead", "powell")
_WITHOUT_BOUNDS = ("cobyla",)  # before SciPy 1.11; as constraints, every version takes them
_CONSTRAINED = ("cobyla", "cobyqa", "slsqp", "trust-constr")
_SLOPE = 10.0  # of the wall around invalid designs, in scaled values over scaled variables


@displayed
@dataclass(frozen=True)
class Visit:
    """One evaluation.

    `violation`: distance by which x leaves bounds and linear constraints, in scaled variables, or violation
    of a nonlinear constraint over its size, whichever is larger; 0 inside.
    """

    x: Array
    value: float
    violation: float
    note: str = ""


@displayed
class ForScipy:
    r"""min J(x) over a box, linear and nonlinear constraints, for `scipy.optimize.minimize`.

    SciPy's methods see z = x / scale and J / (1 + \|J(x0)\|), so that their default tolerances are
    meaningful. SciPy has no notion of invalid designs: where J raises `InvalidDesignError` they see a wall
    that rises away from the best design so far, which turns line searches back.

    Replicated on the ranks of a communicator, with a ``fun`` that returns bitwise equal values on all of
    them, as `ShapeProblem` does, the iterates are equal, too.

    Attributes:
        visits: All evaluations, oldest first.

    Example:
        >>> import numpy as np
        >>> import scipy.optimize
        >>> def bowl(x):
        ...     return float(x @ x), 2.0 * x
        >>> task = ForScipy(bowl, [3.0, -1.0], bounds=([1.0, -4.0], [5.0, 4.0]))
        >>> found = scipy.optimize.minimize(**task.arguments("SLSQP"))
        >>> bool(found.success), (task.best.x.round(6) + 0.0).tolist(), round(task.best.value, 6)
        (True, [1.0, 0.0], 1.0)
    """

    def __init__(
        self,
        fun: Fun,
        x0: ArrayLike,
        *,
        bounds: Box | None = None,
        constraints: Constraints | None = None,
        scale: ArrayLike | None = None,
        value: Callable[[Array], float] | None = None,
        invalid: float | None = None,
    ) -> None:
        """Check the problem.

        Args:
            fun: Returns J(x) and one subgradient; raises `InvalidDesignError` where there is none.
            x0: Feasible starting point, shape (n,).
            bounds: Pair (lower, upper), numbers or shape (n,), or SciPy's Bounds; None for no box.
            constraints: As for `minimize`; nonlinear ones may be violated at the start and on the way.
            scale: Size of each variable, as for `minimize`.
            value: J(x) alone, where that is cheaper (`ShapeProblem.value_of`), for methods that take no
                derivative.
            invalid: Value that methods see where J does not exist, ``inf`` for instance; None for the wall.

        Raises:
            InvalidInputError: If a shape does not fit or x0 is not feasible.
        """
        self._problem = pose(fun, x0, bounds, constraints, scale, restore=True)
        self._nonlinear = [_Remembered(one) for one in self._problem.nonlinear]
        self._value, self._invalid = value, invalid
        self._unit = 1.0
        self.visits: list[Visit] = []

    visits: list[Visit]

    def _facts(self) -> dict[str, Any]:
        return {
            "variables": self._problem.start.size,
            "fun": self._problem.fun,
            "visits": f"{len(self.visits)}, {sum(bool(visit.note) for visit in self.visits)} of them invalid",
        }

    @property
    def best(self) -> Visit:
        """The feasible design with the smallest value so far; nonlinear constraints are met to 1e-6."""
        return self.best_within(1e-6 if self._nonlinear else 1e-9)

    def best_within(self, violation: float) -> Visit:
        """Return the design with the smallest value among those whose violation is within a limit.

        Args:
            violation: Largest violation, see `Visit`.

        Raises:
            InvalidInputError: If there is none.
        """
        candidates = [visit for visit in self.visits if not visit.note and visit.violation <= violation]
        if not candidates:
            raise InvalidInputError(
                f"no design of {len(self.visits)} is feasible within {violation:g}: use best_within"
            )
        return min(candidates, key=lambda visit: visit.value)

    @property
    def evaluations(self) -> int:
        """Number of designs that were evaluated, failed ones included."""
        return len(self.visits)

    def design(self, z: ArrayLike) -> Array:
        """Return x for SciPy's x."""
        return np.asarray(z, dtype=float) * self._problem.scale

    def objective_value(self, scaled: float) -> float:
        """Return J for SciPy's fun."""
        return float(scaled) * self._unit

    def arguments(self, method: str) -> dict[str, Any]:
        """Return the arguments of `scipy.optimize.minimize` for a method by its SciPy name.

        Raises:
            InvalidInputError: If the method cannot handle the constraints.
        """
        name, allowed = method.lower(), self._problem.allowed
        rows = len(allowed.matrix) + len(allowed.equality_matrix) + len(self._nonlinear)
        if rows and name not in _CONSTRAINED:
            raise InvalidInputError(f"constraints need SLSQP, trust-constr or COBYLA, got {method!r}")
        arguments: dict[str, Any] = {"x0": self._problem.start / self._problem.scale, "method": method}
        if name in _WITHOUT_DERIVATIVE:
            arguments["fun"] = self.value_alone
        else:
            arguments.update(fun=self, jac=True)
        box, given = self._box(keep_feasible=name == "trust-constr"), self._rows(name in _WITHOUT_BOUNDS)
        if box is not None and name not in _WITHOUT_BOUNDS:
            arguments["bounds"] = box
        given.extend(one.to_scipy(self._problem.scale) for one in self._nonlinear)
        if given:
            arguments["constraints"] = given
        return arguments

    def __call__(self, z: ArrayLike) -> tuple[float, Array]:
        """Return scaled value and subgradient at a point in SciPy's variables."""
        x = self.design(z)
        try:
            evaluation = evaluate(self._problem.fun, x, self.evaluations + 1)
        except InvalidDesignError as error:
            return self._refused(x, error)
        self._keep(x, evaluation.value)
        slope = np.asarray(self._problem.scale * evaluation.subgradient / self._unit, dtype=np.float64)
        return evaluation.value / self._unit, slope

    def value_alone(self, z: ArrayLike) -> float:
        """Return the scaled value at a point in SciPy's variables."""
        if self._value is None:
            return self(z)[0]
        x = self.design(z)
        try:
            value = float(self._value(x.copy()))
        except InvalidDesignError as error:
            return self._refused(x, error)[0]
        where = f"at evaluation {self.evaluations + 1}"
        require_finite("value must return a finite number", np.array([value]), where)
        self._keep(x, value)
        return value / self._unit

    def _keep(self, x: Array, value: float, note: str = "") -> None:
        if not self.visits:
            self._unit = 1.0 + abs(value)
        self.visits.append(Visit(x.copy(), value, self._violation(x), note))

    def _violation(self, x: Array) -> float:
        near = self._problem.allowed.around(x, self._problem.scale)
        values = np.array([one.at(x).value for one in self._nonlinear])
        curved = scaled_constraints(self._problem.nonlinear, values).violation
        return float(max(-near.room.min(initial=0.0), np.abs(near.miss).max(initial=0.0), curved))

    def _refused(self, x: Array, error: InvalidDesignError) -> tuple[float, Array]:
        """Record an invalid design, and return what methods see there."""
        valid = [visit for visit in self.visits if not visit.note]
        if not valid:
            raise error
        self._keep(x, np.nan, str(error) or "invalid design")
        if self._invalid is not None:
            return float(self._invalid), np.zeros(x.size)
        lowest = min(valid, key=lambda visit: visit.value)
        away = (x - lowest.x) / self._problem.scale
        distance = float(np.linalg.norm(away))
        top = max(visit.value for visit in valid) / self._unit
        # Curved, because quasi-Newton methods estimate the curvature.
        steep = _SLOPE * (1.0 + distance) / max(distance, float(np.finfo(float).tiny))
        wall = np.asarray(steep * away, dtype=np.float64)
        return top + _SLOPE * (1.0 + 0.5 * distance) * distance, wall

    def _box(self, *, keep_feasible: bool) -> scipy.optimize.Bounds | None:
        allowed, scale = self._problem.allowed, self._problem.scale
        if not (np.isfinite(allowed.lower).any() or np.isfinite(allowed.upper).any()):
            return None
        from scipy.optimize import Bounds as ScipyBounds

        return ScipyBounds(allowed.lower / scale, allowed.upper / scale, keep_feasible)

    def _rows(self, with_box: bool) -> list[Any]:
        """All rows in scaled variables, of length one; with those of the box no equalities."""
        from scipy.optimize import LinearConstraint

        allowed, scale = self._problem.allowed, self._problem.scale
        free = np.full(len(allowed.limit), -np.inf)
        rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = [
            (allowed.matrix, free, allowed.limit),
            (allowed.equality_matrix, allowed.equality_value, allowed.equality_value),
        ]
        if with_box:
            rows.append((np.eye(scale.size), allowed.lower, allowed.upper))
            rows = [half for row in rows for half in _from_both_sides(*row)]
        scaled = (unit_rows(matrix * scale, below, above) for matrix, below, above in rows if len(matrix))
        return [LinearConstraint(*row) for row in scaled]


class _Remembered:
    """A nonlinear constraint in SciPy's form, which asks for value and derivative apart, evaluated once."""

    def __init__(self, constraint: NonlinearConstraint) -> None:
        self._constraint, self._last, self._count = constraint, None, 0

    _last: Evaluation | None

    def at(self, x: Array) -> Evaluation:
        """Return the constraint at x; where it does not exist what was found last."""
        if self._last is not None and np.array_equal(self._last.x, x):
            return self._last
        self._count += 1
        try:
            self._last = evaluate_constraint(self._constraint, x, self._count)
        except InvalidDesignError:
            if self._last is None:
                raise
        return self._last

    def to_scipy(self, scale: Array) -> scipy.optimize.NonlinearConstraint:
        """Return the constraint over its size, as a function of scaled variables."""
        from scipy.optimize import NonlinearConstraint as ScipyConstraint

        size = self._constraint.size
        return ScipyConstraint(
            lambda z: np.array([self.at(scale * np.asarray(z)).value / size]),
            self._constraint.lower / size,
            self._constraint.upper / size,
            jac=lambda z: (scale * self.at(scale * np.asarray(z)).subgradient / size)[None],
        )


def _from_both_sides(matrix: Array, below: Array, above: Array) -> list[tuple[Array, Array, Array]]:
    """Return rows without equalities, which COBYLA does not take: these are bounded twice."""
    equal = below == above
    upper = np.full(int(equal.sum()), -np.inf), above[equal]
    return [(matrix, below, np.where(equal, np.inf, above)), (matrix[equal], *upper)]
