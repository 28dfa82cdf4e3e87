"""The merit function J + Σ ρ_k max(c_k, 0), its planes, and the step that they predict.

Doubtful subgradients are replaced by gradients nearby; points are corrected to satisfy the equalities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact._optimize.bundle import Bundle, Plane, SubproblemError, shortest, unit_rows
from fenics_contact._optimize.constraints import LocalFeasibleSet
from fenics_contact._optimize.nonlinear import Scaled, SoftConstraint, scaled_constraints
from fenics_contact._optimize.objective import Evaluation
from fenics_contact._optimize.problem import CheckedProblem, Known, evaluate_constraint
from fenics_contact._optimize.result import MethodState
from fenics_contact._optimize.subproblem import Step, solve_step
from fenics_contact.errors import InvalidDesignError, InvalidInputError

Array = NDArray[np.float64]


def surroundings(problem: CheckedProblem, centre: Evaluation) -> LocalFeasibleSet:
    """Return linear constraints and linearised equalities around a centre, in scaled variables."""
    near = problem.allowed.around(centre.x, problem.scale)
    if not problem.equalities:
        return near
    here, slopes = _slopes(problem, centre)
    (rows,) = unit_rows(slopes[here.equal])
    return LocalFeasibleSet(
        near.rows,
        near.room,
        np.vstack([rows, near.equality_rows]),
        np.concatenate([np.zeros(len(rows)), near.miss]),
    )


def merit_planes(problem: CheckedProblem, evaluation: Evaluation) -> list[Plane]:
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
    bundle: Bundle, problem: CheckedProblem, evaluation: Evaluation, centre: float, move: Array
) -> Bundle:
    """Return the bundle with the planes of other functions of which J is the largest, see `MaxFunction`."""
    for value, slope in zip(map(float, evaluation.pieces), evaluation.piece_slopes, strict=True):
        plane = merit_planes(problem, replace(evaluation, value=value, subgradient=slope))[0]
        error, length = float(plane.gradient @ move) - (value - centre), float(np.linalg.norm(move))
        bundle = bundle.with_cut(plane, error, length)
    return bundle


def _slopes(problem: CheckedProblem, evaluation: Evaluation) -> tuple[Scaled, Array]:
    """Return the constraints of an evaluation and their gradients in scaled variables, over their sizes."""
    here = problem.constraints_at(evaluation)
    return here, here.factors[:, None] * evaluation.slopes * problem.scale


def first_soft(
    planes: Sequence[Plane], locality: float, *, factor: float = 2.0
) -> tuple[SoftConstraint, ...]:
    """Return the inequalities at the start, their penalty a multiple of the ratio of the gradients."""
    size = factor * (planes[0].steepness or 1.0)
    return tuple(
        SoftConstraint(
            Bundle.of_centre(one, locality * one.length),
            one.value,
            *(2 * [size / (one.steepness or 1.0)]),
        )
        for one in planes[1:]
    )


def penalised_step(
    bundle: Bundle,
    near: LocalFeasibleSet,
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
            _reduced(one, left, best, share, rounding) or one.has_largest_penalty
            for one, left, best in zip(soft, step.violations, possible, strict=True)
        ]
        if all(enough):
            return replace(step, stuck=stuck), tuple(soft)
        soft = [one if done else one.raised(factor) for one, done in zip(soft, enough, strict=True)]
        step = solve_step(bundle, near, t, soft)


def correcting_step(
    bundle: Bundle, near: LocalFeasibleSet, soft: Sequence[SoftConstraint], step: Step
) -> Step:
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


def multipliers(problem: CheckedProblem, state: MethodState, step: Step) -> Array:
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


def verified(problem: CheckedProblem, given: Evaluation, number: int) -> Evaluation:
    """Return an evaluation whose subgradient is valid, as far as the function knows.

    At almost every point a locally Lipschitz function has a gradient, and limits of such gradients at points
    that tend to x are Clarke subgradients at x: the gradient near x in a generic direction approximates one
    of them.

    References:
        J. V. Burke, A. S. Lewis, M. L. Overton, A robust gradient sampling algorithm for nonsmooth, nonconvex
        optimization, SIAM J. Optim. 15 (2005) 751-779.
    """
    return (
        problem.with_gradients_near(given, neighbour(problem, given.x), number) if given.doubtful else given
    )


def with_verified_centre(problem: CheckedProblem, state: MethodState) -> MethodState:
    """Return the state with a verified centre, without doubtful planes, careful from now on.

    A proximal parameter that wrong predictions have reduced is reset.
    """
    centre = verified(problem, state.centre, state.evaluations + 1)
    planes = merit_planes(problem, centre)
    bundle = state.bundle.refined(planes[0], 0.0)
    soft = [
        one.refined(plane).without_doubtful_planes()
        for one, plane in zip(state.soft, planes[1:], strict=True)
    ]
    trust = replace(state.trust, t=state.first_t) if state.trust.exhausted else state.trust
    remaining = bundle.chosen(np.flatnonzero(~bundle.doubtful))
    return replace(state, centre=centre, bundle=remaining, trust=trust, careful=True, soft=tuple(soft))


def neighbour(problem: CheckedProblem, x: Array, *, distance: float = 1e-2, attempts: int = 8) -> Array:
    """Return a feasible point near x in a random direction, the same one for the same x.

    Steps that leave the box are reflected into it; of several points the one furthest from x is taken, x
    itself where no other is feasible. `distance`: length of the steps, in lengths of the problem.
    """
    allowed, scale = problem.allowed, problem.scale
    below, above = (allowed.lower - x) / scale, (allowed.upper - x) / scale
    length, best = distance * problem.length, x
    random = np.random.default_rng(np.frombuffer(x.tobytes(), dtype=np.uint32))
    for _ in range(attempts):
        way = random.standard_normal(x.size)
        way *= length / np.linalg.norm(way)
        way = np.where((way < below) | (way > above), -way, way)
        point = allowed.project(x + scale * way)
        if _distance(point, x, scale) > _distance(best, x, scale):
            best = point
        if _distance(best, x, scale) > 0.5 * length:
            break
    return best


def _distance(point: Array, x: Array, scale: Array) -> float:
    return float(np.linalg.norm((point - x) / scale))


def restored(
    problem: CheckedProblem, x: Array, number: int, feasibility: float, *, steps: int = 30
) -> tuple[Array, Known]:
    """Return the point near x that meets the equalities, bounds and linear constraints, by Newton's method.

    Every correction is the shortest one, in scaled variables, to the linearised equalities.
    """
    equal = problem.equalities
    if not equal:
        return x, {}
    constraints = [problem.nonlinear[k] for k in equal]
    best = x, {k: evaluate_constraint(problem.nonlinear[k], x, number) for k in equal}
    least = scaled_constraints(constraints, _values(best[1]))
    for _ in range(steps):
        if least.violation <= 0.01 * feasibility:
            break
        try:
            x = _corrected(problem, *best, least)
        except (InvalidInputError, SubproblemError):
            break
        known = {k: evaluate_constraint(problem.nonlinear[k], x, number) for k in equal}
        now = scaled_constraints(constraints, _values(known))
        if not now.violation < 0.9 * least.violation:
            break
        best, least = (x, known), now
    if least.violation > feasibility:
        worst = int(np.argmax(least.violations))
        raise InvalidDesignError(
            f"no design near it meets {constraints[worst].name}, the best misses it by {least.violation:.2g}"
        )
    return best


def _values(known: Known) -> Array:
    return np.array([one.value for one in known.values()])


def _corrected(problem: CheckedProblem, x: Array, known: Known, missed: Scaled) -> Array:
    """Return the nearest point, in scaled variables, that meets the linearised equalities."""
    near = problem.allowed.around(x, problem.scale)
    slopes = np.array([one.subgradient for one in known.values()])
    rows = missed.factors[:, None] * slopes * problem.scale
    step = shortest(
        np.vstack([near.equality_rows, rows]),
        np.concatenate([near.miss, -missed.excess]),
        near.rows,
        np.maximum(near.room, 0.0),
    )
    return problem.allowed.clip(x + problem.scale * step)
