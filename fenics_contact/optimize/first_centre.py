"""The starting point, evaluated, and checked against the nonlinear constraints."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.optimize.evaluation import evaluate_constraint, evaluate_problem
from fenics_contact.optimize.nonlinear import NonlinearConstraint, scaled_constraints
from fenics_contact.optimize.objective import Accuracy, Evaluation
from fenics_contact.optimize.problem import PosedProblem
from fenics_contact.optimize.restoration import restored


def first_centre(problem: PosedProblem, subgradient: float, feasibility: float) -> Evaluation:
    """Evaluate the starting point, corrected to meet the equalities where it need not be feasible."""
    equal, accuracy = problem.equalities, Accuracy(np.inf, subgradient)
    penalties = dict.fromkeys(problem.inequalities, 1.0)
    try:
        if equal and problem.restore:
            x, known = restored(problem, problem.start, 1, feasibility)
        else:
            x = problem.start
            known = {k: evaluate_constraint(problem.nonlinear[k], x, 1) for k in equal}
            constraints = tuple(problem.nonlinear[k] for k in known)
            _refuse(constraints, [one.value for one in known.values()], feasibility)
        centre = evaluate_problem(problem, x, 1, accuracy, penalties, known)
    except InvalidDesignError as error:
        raise InvalidDesignError(f"the starting design must be valid: {error}") from error
    here = problem.constraints_at(centre)
    if not problem.restore and here.violation > feasibility:
        _refuse(problem.nonlinear, [float(value) for value in centre.constraints], feasibility)
    return centre


def _refuse(constraints: tuple[NonlinearConstraint, ...], values: list[float], feasibility: float) -> None:
    """Raise an error that names the violated constraints, if any."""
    violations = scaled_constraints(constraints, np.array(values)).violations
    words = [
        f"{one.name} is {value:.6g}, to lie in [{one.lower:.6g}, {one.upper:.6g}]"
        for one, value, violation in zip(constraints, values, violations, strict=True)
        if violation > feasibility
    ]
    if words:
        raise InvalidInputError(
            f"x0 must meet the nonlinear constraints, but {'; '.join(words)}: start from a feasible point, "
            "or let the method restore it with restore=True"
        )
