"""Objective and nonlinear constraints of a problem, evaluated at one point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact.optimize.nonlinear import NonlinearConstraint
from fenics_contact.optimize.objective import (
    Accuracy,
    Evaluation,
    can_be_inexact,
    evaluate,
    with_gradient_near,
)
from fenics_contact.optimize.problem import PosedProblem

Array = NDArray[np.float64]
#: Evaluations of some constraints at a point, by their numbers.
Known = Mapping[int, Evaluation]


def evaluate_constraint(
    constraint: NonlinearConstraint, x: Array, number: int, accuracy: Accuracy | None = None
) -> Evaluation:
    """Return value and subgradient of a constraint at x, as accurately as possible by default."""
    return evaluate(constraint.fun, x, number, accuracy, f"fun of {constraint.name}")


def evaluate_problem(
    problem: PosedProblem,
    x: Array,
    number: int,
    accuracy: Accuracy,
    penalties: Mapping[int, float],
    known: Known,
) -> Evaluation:
    """Evaluate objective and nonlinear constraints at a point, the objective first.

    Constraints are evaluated inexactly only where the objective is, as only then the centre is evaluated
    again.

    Args:
        x: Point, shape (n,).
        penalties: Weights of inequalities in the merit function by their numbers, units of J.
    """
    found = evaluate(problem.fun, x, number, accuracy)
    own = []
    for k, constraint in enumerate(problem.nonlinear):
        value = accuracy.value * constraint.size / ((1 + len(problem.nonlinear)) * penalties.get(k, np.inf))
        inexact = k in penalties and can_be_inexact(problem.fun)
        wanted = Accuracy(value, accuracy.subgradient) if inexact else None
        own.append(known[k] if k in known else evaluate_constraint(constraint, x, number, wanted))
    return with_constraints(found, own)


def with_constraints(found: Evaluation, own: list[Evaluation]) -> Evaluation:
    """Return the evaluation of an objective with those of all constraints at the same point."""
    if not own:
        return found
    return replace(
        found,
        doubtful=found.doubtful or any(one.doubtful for one in own),
        constraints=np.array([one.value for one in own]),
        slopes=np.array([one.subgradient for one in own]),
        constraint_errors=np.array([one.error for one in own]),
    )


def with_gradients_near(problem: PosedProblem, given: Evaluation, end: Array, number: int) -> Evaluation:
    """Return an evaluation with nearby gradients in place of those that may not be subgradients.

    Args:
        end: A feasible point near it, in a generic direction, shape (n,).
    """
    found, slopes = with_gradient_near(problem.fun, given, end, number), given.slopes.copy()
    for k, constraint in enumerate(problem.nonlinear):
        own = replace(given, value=float(given.constraints[k]), subgradient=slopes[k])
        slopes[k] = with_gradient_near(
            constraint.fun, own, end, number, f"fun of {constraint.name}"
        ).subgradient
    return replace(found, slopes=slopes, doubtful=False)
