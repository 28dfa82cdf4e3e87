"""State of the bundle trust method between two evaluations, also as arrays for a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fenics_contact.optimize.bundle import Bundle
from fenics_contact.optimize.objective import Evaluation
from fenics_contact.optimize.result import Record, StepKind
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
    """

    centre: Evaluation
    bundle: Bundle
    trust: Trust
    first_t: float
    history: tuple[Record, ...]
    careful: bool = False

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
        stored: dict[str, Any] = {
            f"{part}.{field.name}": np.asarray(getattr(value, field.name))
            for part, value in parts.items()
            for field in fields(value)
        }
        stored["first_t"], stored["careful"] = np.asarray(self.first_t), np.asarray(self.careful)
        for field in fields(Record):
            column = [getattr(record, field.name) for record in self.history]
            stored[f"history.{field.name}"] = np.array(
                [entry.name if isinstance(entry, StepKind) else entry for entry in column]
            )
        return stored

    @staticmethod
    def from_arrays(stored: Mapping[str, NDArray[Any]]) -> MethodState:
        """Return the state that `arrays` was called on."""

        def part(kind: type[Any], name: str) -> Any:
            values = (stored[f"{name}.{field.name}"] for field in fields(kind))
            return kind(*(value if value.ndim else value.item() for value in values))

        columns = [stored[f"history.{field.name}"].tolist() for field in fields(Record)]
        kinds = [field.name for field in fields(Record)].index("kind")
        columns[kinds] = [StepKind[str(name)] for name in columns[kinds]]
        return MethodState(
            centre=part(Evaluation, "centre"),
            bundle=part(Bundle, "bundle"),
            trust=part(Trust, "trust"),
            first_t=float(stored["first_t"]),
            history=tuple(Record(*row) for row in zip(*columns, strict=True)),
            careful=bool(stored["careful"]),
        )
