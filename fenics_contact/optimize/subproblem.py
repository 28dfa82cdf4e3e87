"""The step: minimise the cutting-plane model plus a proximal term within the constraints."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact.errors import tell
from fenics_contact.optimize.bundle import Bundle
from fenics_contact.optimize.constraints import Surroundings
from fenics_contact.optimize.quadratic_program import (
    QuadraticProgram,
    QuadraticSolution,
    SubproblemError,
    solve,
)

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)

_REFINEMENTS = 2
_BLURRED = 1e-2  # ‖z‖ in units of the programme below which a second solve sharpens it
_VANISHED = 1e-7  # ‖z‖ against the longest subgradient below which it is rounding and cannot be sharpened


@dataclass(frozen=True)
class Step:
    """Solution of the step's programme, in scaled variables.

    Attributes:
        move: y, shape (n,).
        decrease: Predicted decrease w = -max_i (g_i·y - β_i) of J, not negative.
        weights: Multipliers of the cutting planes, shape (m,), not negative, sum one.
        aggregate_norm: ‖z‖ = ‖y‖/t, length of the aggregate subgradient (with the constraints' normals).
        aggregate_error: σ = Σ λ_i β_i + Σ μ_k room_k; w = σ + t ‖z‖².
        t: Proximal parameter used.
    """

    move: Array
    decrease: float
    weights: Array
    aggregate_norm: float
    aggregate_error: float
    t: float

    @property
    def length(self) -> float:
        """Length of the move in scaled variables."""
        return float(np.linalg.norm(self.move))


def solve_step(bundle: Bundle, near: Surroundings, t: float) -> Step:
    r"""Minimise v + ‖y‖²/(2t) subject to g_i·y - β_i ≤ v, C y ≤ room and E y = 0.

    The programme is solved in units of its own solution, lengths in t γ and decreases in t γ², so
    that objective and variables may have any size. γ is the length of a subgradient at first. Near a minimum
    the aggregate z is much shorter than that and is lost in the solver's tolerance: then the programme is
    solved again with γ = ‖z‖, without the planes that lie too deep to affect the solution, and the sharper
    result is used if the solver reports success.

    Args:
        bundle: Cutting planes at the centre.
        near: Constraints around the centre, which satisfies them.
        t: Proximal parameter, positive: units of (scaled length)²/J.

    Returns:
        The step.

    Raises:
        SubproblemError: If Clarabel cannot solve the programme in any of the units.

    References:
        H. Schramm and J. Zowe, SIAM J. Optim. 2 (1992) 121-152, section 2.
    """
    lengths = np.sqrt((bundle.gradients**2).sum(axis=1))
    step, unit = _solved(bundle, near, t, lengths)
    for _ in range(_REFINEMENTS):
        if not _VANISHED * lengths.max() < step.aggregate_norm < _BLURRED * unit:
            break
        unit = step.aggregate_norm
        sharper = _refined(bundle, near, step, lengths)
        if sharper is None:
            break
        step = sharper
    return step


def _solved(bundle: Bundle, near: Surroundings, t: float, lengths: Array) -> tuple[Step, float]:
    """Solve in the units of the shortest subgradient or, where that fails, of a longer one."""
    units = [float(unit) for unit in (lengths.min(), lengths[0], lengths.max()) if unit > 0.0] or [1.0]
    for unit in units[:-1]:
        try:
            return _step(bundle, near, solve(_program(bundle, near, t, unit)), t, unit), unit
        except SubproblemError as error:
            tell(_LOG.debug, "step's programme not solved in units of %g: %s", unit, error)
    return _step(bundle, near, solve(_program(bundle, near, t, units[-1])), t, units[-1]), units[-1]


def _refined(bundle: Bundle, near: Surroundings, step: Step, lengths: Array) -> Step | None:
    # Plane i is active at a move y only if β_i ≤ g_i·y - g_0·y; the factor two is a margin.
    live = np.flatnonzero(bundle.measures <= 2.0 * (lengths + lengths[0]) * step.length)
    unit = step.aggregate_norm
    try:
        solution = solve(_program(bundle.chosen(live), near, step.t, unit))
    except SubproblemError:
        return None
    if not solution.exact:
        return None
    multipliers = np.zeros(bundle.size + near.room.size)
    multipliers[live] = solution.multipliers[: live.size]
    multipliers[bundle.size :] = solution.multipliers[live.size :]
    return _step(bundle, near, replace(solution, multipliers=multipliers), step.t, unit)


def _program(bundle: Bundle, near: Surroundings, t: float, unit: float) -> QuadraticProgram:
    n, m, k = bundle.gradients.shape[1], bundle.size, near.room.size
    cuts = np.hstack([bundle.gradients / unit, -np.ones((m, 1))])
    walls = np.hstack([near.rows, np.zeros((k, 1))])
    equalities = np.hstack([near.equality_rows, np.zeros((near.miss.size, 1))])
    slope = np.zeros(n + 1)
    slope[-1] = 1.0
    curvature = np.ones(n + 1)
    curvature[-1] = 0.0
    limits = np.concatenate([bundle.measures / (t * unit**2), np.maximum(near.room, 0.0) / (t * unit)])
    return QuadraticProgram(
        curvature, slope, equalities, np.zeros(near.miss.size), np.vstack([cuts, walls]), limits
    )


def _step(bundle: Bundle, near: Surroundings, solution: QuadraticSolution, t: float, unit: float) -> Step:
    move = t * unit * solution.point[:-1]
    weights = solution.multipliers[: bundle.size]
    weights = weights / weights.sum()
    pushes = unit * solution.multipliers[bundle.size :]
    return Step(
        move=move,
        decrease=max(-bundle.model(move), 0.0),
        weights=weights,
        aggregate_norm=float(np.linalg.norm(move)) / t,
        aggregate_error=float(weights @ bundle.measures + pushes @ np.maximum(near.room, 0.0)),
        t=t,
    )
