"""What a minimisation returns, records, raises and stores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fenics_contact._base.display import displayed
from fenics_contact._optimize.bundle import Bundle
from fenics_contact._optimize.nonlinear import ConstraintValue, SoftConstraint
from fenics_contact._optimize.objective import Evaluation
from fenics_contact._optimize.subproblem import Trust
from fenics_contact.errors import ConvergenceError

Array = NDArray[np.float64]


class Reason(Enum):
    """Why a minimisation stopped; the value states what happened and, after a failure, what to try."""

    CONVERGED = "the model predicts no decrease above the tolerance"
    STATIONARY = "the aggregate subgradient and its error vanish within the tolerance"
    ITERATION_LIMIT = (
        "max_iterations serious steps were taken before the tolerance was met: raise max_iterations, "
        "loosen tolerance, or start again from the best point"
    )
    EVALUATION_LIMIT = (
        "max_evaluations evaluations were spent before the tolerance was met: raise max_evaluations, "
        "loosen tolerance, or start again from the best point"
    )
    NO_DESCENT = (
        "even the shortest step along the aggregate subgradient does not lower the objective as predicted: "
        "compare the subgradient with a difference quotient (a wrong sign, a missing term or a wrong "
        "scale shows there), or solve the state more accurately"
    )
    INVALID_DESIGNS = (
        "every trial design was invalid, down to the shortest step: bound the design away from the "
        "invalid region by bounds or linear constraints"
    )
    INFEASIBLE = (
        "no step reduces the violation of the nonlinear constraints: relax those that contradict each other, "
        "the bounds or linear constraints, start elsewhere, or loosen feasibility"
    )
    STEP_FAILED = (
        "the quadratic programme of a step could not be solved: rescale the variables with scale, and look "
        "for subgradients of very different size"
    )

    @property
    def success(self) -> bool:
        """Whether a stopping test was met."""
        return self in (Reason.CONVERGED, Reason.STATIONARY)


class StepKind(Enum):
    """Outcome of a trial point."""

    #: The first point.
    START = "start"
    #: It lowered the objective enough and became the centre.
    SERIOUS = "serious"
    #: It did not: its plane was added to the bundle.
    NULL = "null"
    #: The objective does not exist there.
    REJECTED = "rejected"
    #: The centre, re-evaluated with a smaller error, or given a nearby gradient as it lies on a kink.
    REFINED = "refined"


@dataclass(frozen=True)
class Record:
    """One evaluation and the step that led to it.

    Attributes:
        iteration: Serious steps up to and with this one.
        value: J at the trial point; nan where it was rejected as invalid.
        best: J at the centre after this evaluation.
        predicted_decrease: Decrease of J that the model predicted.
        step_length: Length of the step in scaled variables.
        aggregate_norm: Length of the aggregate subgradient in scaled variables.
        bundle_size: Cutting planes in the model that made the step.
        evaluations: Evaluations up to and with this one.
        error: Estimated error of `value`; 0 for a function that is exact or does not report it.
        violation: Largest violation of a nonlinear constraint, relative to its size; nan where rejected.
        note: Why a trial point was rejected, or that a nearby gradient was used; else empty.
    """

    iteration: int
    kind: StepKind
    value: float
    best: float
    predicted_decrease: float
    t: float
    step_length: float
    aggregate_norm: float
    aggregate_error: float
    bundle_size: int
    evaluations: int
    error: float = 0.0
    violation: float = 0.0
    note: str = ""


@displayed
@dataclass(frozen=True)
class Result:
    """The best point and how it was reached.

    Attributes:
        x: Point, shape (n,).
        value: J there.
        subgradient: One subgradient there, shape (n,).
        reason: Why the method stopped.
        iterations: Serious steps.
        evaluations: Evaluations of the objective, failed ones included.
        history: One record for each evaluation, oldest first.
        error: Estimated error of the value; 0 for a function that is exact or does not report it.
        constraints: The nonlinear constraints there.
    """

    x: Array
    value: float
    subgradient: Array
    reason: Reason
    iterations: int
    evaluations: int
    history: tuple[Record, ...]
    error: float = 0.0
    constraints: tuple[ConstraintValue, ...] = ()

    @property
    def violation(self) -> float:
        """Largest violation of a nonlinear constraint, relative to its size; 0 without any."""
        return max((one.violation for one in self.constraints), default=0.0)

    def _facts(self) -> dict[str, Any]:
        facts = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        if not self.constraints:
            return {name: value for name, value in facts.items() if name != "constraints"}
        active = ", ".join(one.name for one in self.constraints if one.active) or "none"
        facts["constraints"] = f"active {active}; largest violation {self.violation:.1e}"
        return facts


class NotConvergedError(ConvergenceError):
    """The minimisation stopped before its tolerance was met.

    Attributes:
        history: One record for each evaluation, oldest first.
        best: The result so far, with the reason; None on a rank that was only notified of the error.
    """

    def __init__(self, message: str, history: Sequence[Record] = (), best: Result | None = None) -> None:
        """Store the history and the best point with the message."""
        super().__init__(message, history)
        self.best = best


@dataclass(frozen=True)
class MethodState:
    """Everything that the next step of the method depends on.

    `careful`: whether doubtful subgradients are replaced at once, see `fenics_contact._optimize.merit`;
    `multipliers`: multipliers of all nonlinear constraints that the last step predicted.
    """

    centre: Evaluation
    bundle: Bundle
    trust: Trust
    first_t: float
    history: tuple[Record, ...]
    careful: bool = False
    soft: tuple[SoftConstraint, ...] = ()
    multipliers: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def doubtful(self) -> bool:
        """Whether a plane may not belong to a subgradient."""
        bundles = (self.bundle, *(one.bundle for one in self.soft))
        return any(bool(bundle.doubtful.any()) for bundle in bundles)

    @property
    def iterations(self) -> int:
        """Serious steps so far."""
        return self.history[-1].iteration

    @property
    def evaluations(self) -> int:
        """Evaluations so far."""
        return self.history[-1].evaluations

    def arrays(self) -> dict[str, Any]:
        """Return the state as arrays by name; `from_arrays` restores it bitwise."""
        parts: dict[str, Any] = {"centre": self.centre, "bundle": self.bundle, "trust": self.trust}
        parts.update({f"soft{k}": one.bundle for k, one in enumerate(self.soft)})
        stored: dict[str, Any] = {
            f"{part}.{entry.name}": np.asarray(getattr(value, entry.name))
            for part, value in parts.items()
            for entry in fields(value)
        }
        stored["first_t"], stored["careful"] = np.asarray(self.first_t), np.asarray(self.careful)
        numbers = [(one.value, one.penalty, one.first_penalty) for one in self.soft]
        stored["soft"], stored["multipliers"] = np.array(numbers).reshape(-1, 3), self.multipliers
        for entry in fields(Record):
            column = [getattr(record, entry.name) for record in self.history]
            stored[f"history.{entry.name}"] = np.array(
                [one.name if isinstance(one, StepKind) else one for one in column]
            )
        return stored

    @staticmethod
    def from_arrays(stored: Mapping[str, NDArray[Any]]) -> MethodState:
        """Return the state that `arrays` was called on."""

        def part(kind: type[Any], name: str) -> Any:
            values = (stored[f"{name}.{entry.name}"] for entry in fields(kind))
            return kind(*(value if value.ndim else value.item() for value in values))

        columns = [stored[f"history.{entry.name}"].tolist() for entry in fields(Record)]
        kinds = [entry.name for entry in fields(Record)].index("kind")
        columns[kinds] = [StepKind[str(name)] for name in columns[kinds]]
        return MethodState(
            centre=part(Evaluation, "centre"),
            bundle=part(Bundle, "bundle"),
            trust=part(Trust, "trust"),
            first_t=float(stored["first_t"]),
            history=tuple(Record(*row) for row in zip(*columns, strict=True)),
            careful=bool(stored["careful"]),
            soft=tuple(
                SoftConstraint(part(Bundle, f"soft{k}"), *row)
                for k, row in enumerate(stored["soft"].tolist())
            ),
            multipliers=stored["multipliers"],
        )
