"""State of the bundle trust method between two evaluations, also as arrays for a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fenics_contact.optimize.bundle import Bundle
from fenics_contact.optimize.objective import Evaluation
from fenics_contact.optimize.result import Record, StepKind
from fenics_contact.optimize.soft_constraint import SoftConstraint
from fenics_contact.optimize.trust import Trust

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MethodState:
    """Everything that the next step of the method depends on.

    Attributes:
        centre: Best point with value and subgradient.
        bundle: Cutting planes seen from it.
        trust: Proximal parameter and trust region.
        first_t: Initial proximal parameter.
        history: One record for each evaluation, oldest first.
        careful: Whether doubtful subgradients are replaced at once, see `fenics_contact.optimize.care`.
        soft: Nonlinear inequalities with their cutting planes and penalties.
        multipliers: Multipliers of all nonlinear constraints that the last step predicted, shape (k,).
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
