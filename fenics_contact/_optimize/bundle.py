"""Cutting planes of a function seen from a centre, and the quadratic programmes in which they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fenics_contact.errors import ConvergenceError, InvalidInputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """A subgradient of one function at a point, in scaled variables, with what is known of it.

    `pushes`: multiples of gradients of equalities that the subgradient contains; `steepness`: length of the
    subgradient without them; `doubtful`: whether it may not be a subgradient, see `Kinked`.
    """

    gradient: Array
    value: float = 0.0
    noise: float = 0.0
    pushes: Array = field(default_factory=lambda: np.zeros(0))
    steepness: float = 0.0
    doubtful: bool = False

    @property
    def length(self) -> float:
        """Length of the subgradient."""
        return float(np.linalg.norm(self.gradient))


@dataclass(frozen=True)
class Bundle:
    r"""Cutting planes of the objective, all expressed at the centre x of the model.

    A subgradient g_i found at y_i gives the plane J(y_i) + g_i·(z - y_i). At the centre it lies below J(x) by
    the linearisation error α_i = J(x) - J(y_i) - g_i·(x - y_i), which is not negative for a convex J. For a
    nonconvex one a plane far away can lie above J(x); the subgradient locality measure β_i = max(\|α_i\|, c
    s_i²), with the distance s_i travelled since y_i, pushes it below again, the further the older it is. The
    model at x + y is J(x) + max_i (g_i·y - β_i). Row 0 belongs to the centre itself: α_0 = s_0 = 0, which
    makes the model exact there. `gradients`: g_i in scaled variables; `errors`: α_i, units of J; `distances`:
    s_i in scaled variables; `locality`: c, units of J; 0 for a convex objective; `noise`: error e_i of the
    value of plane i, units of J. A plane may lie too high by e_i, seen from a centre whose value is too low
    by e_0, and is lowered by both: an inexact plane predicts no less decrease than possible; `pushes`:
    multiples of the gradients of r equality constraints that g_i contains.

    References:
        K. C. Kiwiel, Methods of Descent for Nondifferentiable Optimization, Lecture Notes in
        Mathematics 1133, Springer, 1985 (aggregation and locality measures, chapter 3).
        H. Schramm and J. Zowe, SIAM J. Optim. 2 (1992) 121-152.
    """

    gradients: Array
    errors: Array
    distances: Array
    locality: float
    noise: Array
    doubtful: NDArray[np.bool_]
    pushes: Array

    @classmethod
    def of_centre(cls, plane: Plane, locality: float) -> Bundle:
        """Return the bundle that holds only the centre's own plane."""
        zero = np.zeros(1)
        marks, noise = np.array([plane.doubtful]), np.array([plane.noise])
        return cls(plane.gradient[None], zero, zero, locality, noise, marks, plane.pushes[None])

    @property
    def size(self) -> int:
        """Number of cutting planes."""
        return int(self.errors.size)

    @property
    def measures(self) -> Array:
        """Subgradient locality measures β_i, shape (m,), not negative."""
        away = self.noise + self.noise[0]
        away[0] = 0.0
        return np.maximum(np.abs(self.errors), self.locality * self.distances**2) + away

    def model(self, step: Array) -> float:
        """Return the predicted change of J, max_i (g_i·y - β_i), for a step y of shape (n,)."""
        return float(np.max(self.gradients @ step - self.measures))

    def with_cut(self, plane: Plane, error: float, distance: float) -> Bundle:
        """Return the bundle with one more plane at the end."""
        return Bundle(
            np.vstack([self.gradients, plane.gradient]),
            np.append(self.errors, error),
            np.append(self.distances, distance),
            self.locality,
            np.append(self.noise, plane.noise),
            np.append(self.doubtful, plane.doubtful),
            np.vstack([self.pushes, plane.pushes]),
        )

    def refined(self, plane: Plane, change: float) -> Bundle:
        """Return the bundle after its centre was re-evaluated: its plane, and the change of its value."""
        gradients, errors, noises = self.gradients.copy(), self.errors + change, self.noise.copy()
        doubts, pushes = self.doubtful.copy(), self.pushes.copy()
        errors[0], noises[0], doubts[0] = 0.0, plane.noise, plane.doubtful
        gradients[0], pushes[0] = plane.gradient, plane.pushes
        return Bundle(gradients, errors, self.distances, self.locality, noises, doubts, pushes)

    def moved(self, step: Array, change: float, locality: float, own: int = 1) -> Bundle:
        """Return the bundle seen from a new centre, whose own plane is the last one."""
        errors = self.errors + change - self.gradients @ step
        distances = self.distances + np.linalg.norm(step)
        errors[-1] = distances[-own:] = 0.0
        order = np.roll(np.arange(self.size), 1)
        return replace(
            self.chosen(order), errors=errors[order], distances=distances[order], locality=locality
        )

    def reduced(self, weights: Array, room: int) -> Bundle:
        """Return a bundle with at most ``room`` planes that has the same solution of the step's programme.

        Planes without weight are dropped first, those with the largest locality measure before the others.
        Where even the weighted ones are too many, their convex combination with ``weights``, the aggregate
        plane, replaces the lightest of them: it alone preserves the predicted decrease, so that the method
        converges with any ``room`` of at least two.
        """
        if self.size <= room:
            return self
        carrying = weights > 1e-8
        order = 1 + np.lexsort((self.measures[1:], -weights[1:]))
        if np.count_nonzero(carrying[1:]) < room:
            return self.chosen(np.concatenate([[0], np.sort(order[: room - 1])]))
        remaining = self.chosen(np.concatenate([[0], np.sort(order[: room - 2])]))
        share = weights / weights.sum()
        aggregate = Plane(
            share @ self.gradients,
            noise=float(share @ self.noise),
            pushes=share @ self.pushes,
            doubtful=bool(np.any(self.doubtful & carrying)),
        )
        return remaining.with_cut(aggregate, float(share @ self.errors), float(share @ self.distances))

    def chosen(self, rows: NDArray[np.intp]) -> Bundle:
        """Return the bundle of some planes, given by their numbers."""
        return Bundle(
            self.gradients[rows],
            self.errors[rows],
            self.distances[rows],
            self.locality,
            self.noise[rows],
            self.doubtful[rows],
            self.pushes[rows],
        )


# Tried in this order until one reports "Solved". One thread and one factorisation method, because replicated
# ranks must obtain bitwise equal results.
_ATTEMPTS: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}),
    MappingProxyType({"tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9, "tol_feas": 1e-9}),
    MappingProxyType({"equilibrate_enable": False}),
    MappingProxyType({"static_regularization_constant": 1e-10, "max_step_fraction": 0.9}),
)
_INFEASIBLE = (clarabel.SolverStatus.PrimalInfeasible, clarabel.SolverStatus.AlmostPrimalInfeasible)


class SubproblemError(ConvergenceError):
    """The quadratic programme of a step could not be solved with any of the settings tried."""


def unit_rows(rows: Array, *sides: Array) -> tuple[Array, ...]:
    """Return rows divided by their lengths, shape (m, n), and so their sides, shape (m,) each; 0 stays 0."""
    length = np.sqrt((rows**2).sum(axis=1))
    length = np.where(length > 0.0, length, 1.0)
    return rows / length[:, None], *(side / length for side in sides)


@dataclass(frozen=True)
class QuadraticProgram:
    """The data of min ½ yᵀ diag(h) y + qᵀy subject to E y = e and C y ≤ c."""

    curvature: Array
    slope: Array
    equality_rows: Array
    equality_values: Array
    rows: Array
    limits: Array


@dataclass(frozen=True)
class QuadraticSolution:
    """Minimiser of a `QuadraticProgram` and the multipliers of its rows.

    `exact`: False where only Clarabel's reduced tolerances were met.
    """

    point: Array
    multipliers: Array
    equality_multipliers: Array
    status: str
    exact: bool


def solve(program: QuadraticProgram) -> QuadraticSolution:
    """Solve a small convex quadratic programme; the same input gives bitwise equal results.

    The tolerances are loosened, then the scaling and the regularisation changed, until Clarabel reports
    "Solved"; an "AlmostSolved" is accepted only if no attempt does better.

    References:
        P. J. Goulart and Y. Chen, Clarabel: an interior-point solver for conic programs with
        quadratic objectives, 2024.
    """
    statuses, almost = [], []
    for changes in _ATTEMPTS:
        answer = _run_clarabel(program, changes)
        statuses.append(str(answer.status))
        if answer.status in _INFEASIBLE:
            raise InvalidInputError(
                f"no point meets all constraints ({answer.status}): relax those that contradict each other"
            )
        if answer.status == clarabel.SolverStatus.Solved:
            return _solution(program, answer)
        if answer.status == clarabel.SolverStatus.AlmostSolved:
            almost.append(answer)
    if not almost:
        raise SubproblemError(
            f"Clarabel reported {', '.join(statuses)} for a quadratic programme: rescale by `scale`"
        )
    return _solution(program, almost[0])


def _solution(program: QuadraticProgram, answer: clarabel.DefaultSolution) -> QuadraticSolution:
    first = program.equality_values.size
    pushes = np.array(answer.z, dtype=float)
    multipliers = np.maximum(pushes[first:], 0.0)
    point = np.array(answer.x, dtype=float)
    exact = answer.status == clarabel.SolverStatus.Solved
    return QuadraticSolution(point, multipliers, pushes[:first], str(answer.status), exact)


def _run_clarabel(program: QuadraticProgram, changes: Mapping[str, Any]) -> clarabel.DefaultSolution:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.direct_solve_method = "qdldl"
    settings.presolve_enable = False
    for name, value in changes.items():
        setattr(settings, name, value)
    equal, unequal = program.equality_values.size, program.limits.size
    kinds = [(clarabel.ZeroConeT, equal), (clarabel.NonnegativeConeT, unequal)]
    rows = sparse.csc_matrix(np.vstack([program.equality_rows, program.rows]))
    limits = np.concatenate([program.equality_values, program.limits])
    hessian = sparse.csc_matrix(sparse.diags(program.curvature))
    cones = [kind(size) for kind, size in kinds if size]
    return clarabel.DefaultSolver(hessian, program.slope, rows, limits, cones, settings).solve()


def shortest(
    equality_rows: Array, equality_values: Array, rows: Array, limits: Array, *, far: float = 1e6
) -> Array:
    """Return the shortest y with E y = e and C y ≤ c, shape (n,)."""
    rows, limits = unit_rows(rows, limits)
    equality_rows, equality_values = unit_rows(equality_rows, equality_values)
    reach = max(-limits.min(initial=0.0), np.abs(equality_values).max(initial=0.0))
    n = rows.shape[1]
    if reach == 0.0:
        return np.zeros(n)
    near = np.minimum(limits / reach, far)
    program = QuadraticProgram(np.ones(n), np.zeros(n), equality_rows, equality_values / reach, rows, near)
    return np.asarray(reach * solve(program).point)
