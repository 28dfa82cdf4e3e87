"""Small convex quadratic programmes, solved by Clarabel: min ½ yᵀ diag(h) y + qᵀy, E y = e, C y ≤ c."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fenics_contact.errors import ConvergenceError, InvalidInputError

Array = NDArray[np.float64]

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
    """The data of min ½ yᵀ diag(h) y + qᵀy subject to E y = e and C y ≤ c.

    Attributes:
        curvature: h, shape (n,), not negative.
        slope: q, shape (n,).
        equality_rows: E, shape (r, n).
        equality_values: e, shape (r,).
        rows: C, shape (m, n).
        limits: c, shape (m,).
    """

    curvature: Array
    slope: Array
    equality_rows: Array
    equality_values: Array
    rows: Array
    limits: Array


@dataclass(frozen=True)
class QuadraticSolution:
    """Minimiser of a `QuadraticProgram` and the multipliers of its rows.

    Attributes:
        point: y, shape (n,).
        multipliers: Multipliers of C y ≤ c, shape (m,), not negative.
        equality_multipliers: Multipliers of E y = e, shape (r,).
        status: Clarabel's status.
        exact: False where only Clarabel's reduced tolerances were met.
    """

    point: Array
    multipliers: Array
    equality_multipliers: Array
    status: str
    exact: bool


def solve(program: QuadraticProgram) -> QuadraticSolution:
    """Solve a small convex quadratic programme; the same input gives bitwise equal results.

    The tolerances are loosened, then the scaling and the regularisation changed, until Clarabel
    reports "Solved"; an "AlmostSolved" is accepted only if no attempt does better.

    Args:
        program: The data, in units in which the solution is of order one.

    Returns:
        The minimiser, its multipliers and the status.

    References:
        P. J. Goulart and Y. Chen, Clarabel: an interior-point solver for conic programs with
        quadratic objectives, 2024.
    """
    statuses = []
    almost = None
    for changes in _ATTEMPTS:
        answer = _run_clarabel(program, changes)
        statuses.append(str(answer.status))
        if answer.status in _INFEASIBLE:
            raise InvalidInputError(
                "the bounds and linear constraints must leave at least one point, but Clarabel reports "
                f"{answer.status}: remove or relax the rows that contradict each other"
            )
        if answer.status == clarabel.SolverStatus.Solved:
            return _solution(program, answer, exact=True)
        if almost is None and answer.status == clarabel.SolverStatus.AlmostSolved:
            almost = answer
    if almost is None:
        raise SubproblemError(
            f"Clarabel must solve the quadratic programme of a step, but reported {', '.join(statuses)}: "
            "rescale the variables with `scale`, or look for subgradients of very different size"
        )
    return _solution(program, almost, exact=False)


def _solution(
    program: QuadraticProgram, answer: clarabel.DefaultSolution, *, exact: bool
) -> QuadraticSolution:
    first = program.equality_values.size
    pushes = np.array(answer.z, dtype=float)
    multipliers = np.maximum(pushes[first:], 0.0)
    point = np.array(answer.x, dtype=float)
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
    """Return the shortest y with E y = e and C y ≤ c, shape (n,).

    Args:
        equality_rows: E, shape (r, n).
        equality_values: e, shape (r,).
        rows: C, shape (m, n).
        limits: c, shape (m,).
        far: Distance in units of the largest violation at y = 0 beyond which a limit is moved there, as it
            cannot matter: violations may be a rounding of the distances to other limits.
    """
    rows, limits = unit_rows(rows, limits)
    equality_rows, equality_values = unit_rows(equality_rows, equality_values)
    reach = max(-limits.min(initial=0.0), np.abs(equality_values).max(initial=0.0))
    n = rows.shape[1]
    if reach == 0.0:
        return np.zeros(n)
    near = np.minimum(limits / reach, far)
    program = QuadraticProgram(np.ones(n), np.zeros(n), equality_rows, equality_values / reach, rows, near)
    return np.asarray(reach * solve(program).point)
