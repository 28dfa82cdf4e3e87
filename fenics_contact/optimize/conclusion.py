"""The result of a minimisation, or the error that ends it."""

from __future__ import annotations

import logging

from fenics_contact.errors import safe_log
from fenics_contact.optimize.nonlinear import ConstraintValue
from fenics_contact.optimize.objective import Remarked
from fenics_contact.optimize.problem import PosedProblem
from fenics_contact.optimize.result import NotConvergedError, Reason, Result, StepKind
from fenics_contact.optimize.state import MethodState

_LOG = logging.getLogger(__name__)


def conclude(problem: PosedProblem, state: MethodState, reason: Reason, *, raises: bool) -> Result:
    """Return the result at the centre."""
    centre = state.centre
    result = Result(
        x=centre.x,
        value=centre.value,
        subgradient=centre.subgradient,
        reason=reason,
        iterations=state.iterations,
        evaluations=state.evaluations,
        history=state.history,
        error=centre.error,
        constraints=_constraints(problem, state),
    )
    if isinstance(problem.fun, Remarked):
        for words in dict.fromkeys(problem.fun.remarks(centre.x.copy())):
            safe_log(_LOG.warning, "at the end of the minimisation: %s", words)
    if reason.success or not raises:
        return result
    refusals = [record.note for record in state.history if record.kind is StepKind.REJECTED]
    last = f"; the last trial: {refusals[-1]}" if reason is Reason.INVALID_DESIGNS else ""
    broken = [str(one) for one in result.constraints if one.violation > 0.0]
    violated = f"; violated: {'; '.join(broken)}" if reason is Reason.INFEASIBLE else ""
    raise NotConvergedError(
        f"{reason.value} (after {result.iterations} serious steps and {result.evaluations} evaluations, "
        f"best value {result.value:.9g}{last}{violated})",
        result.history,
        result,
    )


def _constraints(problem: PosedProblem, state: MethodState) -> tuple[ConstraintValue, ...]:
    violations = problem.constraints_at(state.centre).violations
    values, multipliers = state.centre.constraints, state.multipliers
    return tuple(
        ConstraintValue(
            one.name, float(values[k]), one.lower, one.upper, float(violations[k]), float(multipliers[k])
        )
        for k, one in enumerate(problem.nonlinear)
    )
