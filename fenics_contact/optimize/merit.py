"""The merit function J + Σ ρ_k max(c_k, 0), its planes, and the step that they predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact.errors import InvalidInputError
from fenics_contact.optimize.bundle import Bundle, Plane
from fenics_contact.optimize.constraints import Surroundings
from fenics_contact.optimize.nonlinear import Scaled
from fenics_contact.optimize.objective import Evaluation
from fenics_contact.optimize.problem import PosedProblem
from fenics_contact.optimize.quadratic_program import SubproblemError, shortest, unit_rows
from fenics_contact.optimize.soft_constraint import SoftConstraint
from fenics_contact.optimize.state import MethodState
from fenics_contact.optimize.subproblem import Step, solve_step

Array = NDArray[np.float64]


def surroundings(problem: PosedProblem, centre: Evaluation) -> Surroundings:
    """Return linear constraints and linearised equalities around a centre, in scaled variables."""
    near = problem.allowed.around(centre.x, problem.scale)
    if not problem.equalities:
        return near
    here, slopes = _slopes(problem, centre)
    (rows,) = unit_rows(slopes[here.equal])
    return Surroundings(
        near.rows,
        near.room,
        np.vstack([rows, near.equality_rows]),
        np.concatenate([np.zeros(len(rows)), near.miss]),
    )


def merit_planes(problem: PosedProblem, evaluation: Evaluation) -> list[Plane]:
    """Return the planes of J and of the inequalities, these in units of their sizes.

    A move along the tangents of equalities is followed by a correction to their surface. Of g·y and the
    correction's share Lagrange's gradient g + Σ λ_j ∇e_j remains, with the multipliers λ that make it
    shortest beside the normals of active constraints. It carries the curvature of the surface: without it
    planes of earlier trial points would promise a decrease along the tangents that the correction takes away.
    """
    gradient = evaluation.subgradient * problem.scale
    if not problem.nonlinear:
        length = float(np.linalg.norm(gradient))
        return [Plane(gradient, evaluation.value, evaluation.error, np.zeros(0), length, evaluation.doubtful)]
    here, slopes = _slopes(problem, evaluation)
    gradients, normals = np.vstack([gradient, slopes[~here.equal]]), slopes[here.equal]
    pushes: Array = np.zeros((len(gradients), len(normals)))
    if len(normals):
        near = problem.allowed.around(evaluation.x, problem.scale)
        every = np.vstack([normals, near.rows[near.room <= 1e-9], near.equality_rows])
        found = np.linalg.lstsq(every.T, -gradients.T, rcond=None)[0][: len(normals)].T
        pushes = np.asarray(found, dtype=np.float64)
    values = np.append(evaluation.value, here.excess[~here.equal])
    noises = np.append(evaluation.error, (np.abs(here.factors) * evaluation.constraint_errors)[~here.equal])
    steep, along = np.linalg.norm(gradients, axis=1), gradients + pushes @ normals
    return [
        Plane(along[k], float(values[k]), float(noises[k]), pushes[k], float(steep[k]), evaluation.doubtful)
        for k in range(len(values))
    ]


def with_pieces(
    bundle: Bundle, problem: PosedProblem, evaluation: Evaluation, centre: float, move: Array
) -> Bundle:
    """Return the bundle with the planes of other functions of which J is the largest, see `Pieced`.

    Args:
        move: The step from there to the trial point, shape (n,), scaled variables.
    """
    for value, slope in zip(map(float, evaluation.pieces), evaluation.piece_slopes, strict=True):
        plane = merit_planes(problem, replace(evaluation, value=value, subgradient=slope))[0]
        error, length = float(plane.gradient @ move) - (value - centre), float(np.linalg.norm(move))
        bundle = bundle.with_cut(plane, error, length)
    return bundle


def _slopes(problem: PosedProblem, evaluation: Evaluation) -> tuple[Scaled, Array]:
    """Return the constraints of an evaluation and their gradients in scaled variables, over their sizes."""
    here = problem.constraints_at(evaluation)
    return here, here.factors[:, None] * evaluation.slopes * problem.scale


def first_soft(
    planes: Sequence[Plane], locality: float, *, factor: float = 2.0
) -> tuple[SoftConstraint, ...]:
    """Return the inequalities at the start, their penalty a multiple of the ratio of the gradients.

    Args:
        locality: Locality of a plane in units of the length of its gradient.
    """
    size = factor * (planes[0].steepness or 1.0)
    return tuple(
        SoftConstraint(
            Bundle.of_centre(one, locality * one.length),
            one.value,
            *(2 * [size / (one.steepness or 1.0)]),
        )
        for one in planes[1:]
    )


def priced_step(
    bundle: Bundle,
    near: Surroundings,
    t: float,
    soft: Sequence[SoftConstraint],
    feasibility: float,
    *,
    share: float = 0.1,
    least: float = 0.01,
    factor: float = 10.0,
) -> tuple[Step, tuple[SoftConstraint, ...]]:
    """Return the step, with penalties large enough for it to reduce violations.

    The penalty of a constraint is raised while the planes predict less than ``share`` of the reduction that
    the largest penalties would bring. Where even that is less than ``least`` of all violations, the step is
    `stuck`.

    References:
        R. H. Byrd, J. Nocedal, R. A. Waltz, Steering exact penalty methods for nonlinear programming, Optim.
        Methods Softw. 23 (2008) 197-213.
    """
    step, rounding = solve_step(bundle, near, t, soft), 0.1 * feasibility
    if all(
        _reduced(one, left, 0.0, share, rounding) for one, left in zip(soft, step.violations, strict=True)
    ):
        return step, tuple(soft)
    possible = solve_step(bundle, near, t, [one.raised(np.inf) for one in soft]).violations
    violations = [one.violation for one in soft]
    stuck = max(violations) > feasibility and sum(possible) > (1.0 - least) * sum(violations)
    while True:
        enough = [
            _reduced(one, left, best, share, rounding) or one.dearest
            for one, left, best in zip(soft, step.violations, possible, strict=True)
        ]
        if all(enough):
            return replace(step, stuck=stuck), tuple(soft)
        soft = [one if done else one.raised(factor) for one, done in zip(soft, enough, strict=True)]
        step = solve_step(bundle, near, t, soft)


def correcting_step(bundle: Bundle, near: Surroundings, soft: Sequence[SoftConstraint], step: Step) -> Step:
    """Return the shortest step to where the planes of the inequalities predict no violation.

    Near a minimum what the last small violations cost is lost in the tolerance of the step's programme; this
    one has their size. The step itself is returned where there is no such point.
    """
    rows = np.vstack([near.rows, *(one.gradients for one in soft)])
    limits = np.concatenate([np.maximum(near.room, 0.0), *(one.depths for one in soft)])
    try:
        move = shortest(near.equality_rows, np.zeros(near.miss.size), rows, limits)
    except (InvalidInputError, SubproblemError):
        return step
    violations = tuple(one.predicted(move) for one in soft)
    gained = sum(one.penalty * (one.violation - left) for one, left in zip(soft, violations, strict=True))
    decrease = max(gained - bundle.model(move), 0.0)
    return replace(step, move=move, decrease=decrease, violations=violations)


def _reduced(one: SoftConstraint, left: float, best: float, share: float, rounding: float) -> bool:
    """Return whether a step reduces a violation by a share of what is possible."""
    return left <= max(one.violation - share * (one.violation - best), best) + rounding


def multipliers(problem: PosedProblem, state: MethodState, step: Step) -> Array:
    """Return the multipliers of all nonlinear constraints that a step predicts, units of J by those of c.

    Those that carry less than a millionth of the gradient of J are 0.
    """
    if not problem.nonlinear:
        return np.zeros(0)
    here, slopes = _slopes(problem, state.centre)
    lengths = np.linalg.norm(slopes, axis=1)
    found = np.zeros(len(problem.nonlinear))
    rows = step.equality_multipliers[: int(here.equal.sum())]
    found[here.equal] = rows / np.where(lengths > 0.0, lengths, 1.0)[here.equal]
    found[here.equal] += step.weights @ state.bundle.pushes
    shares = [one.penalty * share for one, share in zip(state.soft, step.soft_weights, strict=True)]
    found[~here.equal] = [share.sum() for share in shares]
    for one, share in zip(state.soft, shares, strict=True):
        found[here.equal] += share @ one.bundle.pushes
    least = 1e-6 * np.linalg.norm(state.centre.subgradient * problem.scale)
    return np.where(np.abs(found) * lengths > least, found * here.factors, 0.0)
