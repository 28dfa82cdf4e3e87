"""Records of the evaluations of a minimisation."""

from __future__ import annotations

import numpy as np

from fenics_contact.optimize.objective import Evaluation
from fenics_contact.optimize.problem import PosedProblem
from fenics_contact.optimize.result import Record, StepKind
from fenics_contact.optimize.state import MethodState
from fenics_contact.optimize.subproblem import Step


def recorded(
    problem: PosedProblem,
    state: MethodState,
    step: Step,
    kind: StepKind,
    evaluation: Evaluation | None,
    note: str = "",
) -> tuple[Record, ...]:
    """Return the history with one more evaluation, None for a trial point that does not exist."""
    value = np.nan if evaluation is None else evaluation.value
    record = Record(
        iteration=state.iterations + (kind is StepKind.SERIOUS),
        kind=kind,
        value=value,
        best=value if kind in (StepKind.SERIOUS, StepKind.REFINED) else state.centre.value,
        predicted_decrease=step.decrease,
        t=step.t,
        step_length=step.length,
        aggregate_norm=step.aggregate_norm,
        aggregate_error=step.aggregate_error,
        bundle_size=state.bundle.size,
        evaluations=state.evaluations + 1,
        error=0.0 if evaluation is None else evaluation.error,
        violation=np.nan if evaluation is None else problem.constraints_at(evaluation).violation,
        note=note,
    )
    return (*state.history, record)
