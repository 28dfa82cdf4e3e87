"""Progress reports: one event of a piece of work, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from fenics_contact.progress.words import joined


class Kind(Enum):
    """Kinds of events of a piece of work."""

    BEGIN = "begins"
    STEP = "step"
    END = "done"
    FAILED = "failed"
    STOPPED = "stopped"


@dataclass(frozen=True)
class Event:
    """One report. Unknown numbers are None.

    Attributes:
        task: Identifies a piece of work among those under way.
        what: The work: "factor", "load steps".
        kind: Kind of the event.
        unit: Unit of the count: "products".
        number: Number done.
        total: Total number.
        most: Largest number, if the total is unknown.
        measure: Quantity that must become small: the residual.
        target: Its target.
        measured: Its name.
        value: Best value so far, of an optimisation.
        left: Remaining time as estimated by the work itself, [s].
        words: Further text for readers.
        timed: Whether the time since the last step is representative of others.
    """

    task: int
    what: str
    kind: Kind
    unit: str = "steps"
    number: int | None = None
    total: int | None = None
    most: int | None = None
    measure: float | None = None
    target: float | None = None
    measured: str = "residual"
    value: float | None = None
    left: float | None = None
    words: str = ""
    timed: bool = True

    def __str__(self) -> str:
        """Return one line for readers."""
        if self.kind is Kind.STEP:
            return f"{self.what}: {self.details}"
        return joined(f"{self.what}: {self.kind.value}", self.details)

    @property
    def details(self) -> str:
        """The numbers as text."""
        count = value = measure = ""
        if self.number is not None:
            unit = self.unit.removesuffix("s") if self.number == 1 else self.unit
            count = f"{self.number} {unit}" if self.total is None else f"{self.number} of {self.total}"
        if self.value is not None:
            value = f"best {self.value:.6g}"
        if self.measure is not None:
            measure = f"{self.measured} {self.measure:.1e}"
            if self.target is not None:
                sign = "≤" if self.measure <= self.target else ">"
                measure += f" {sign} {self.target:.1e}".replace(".0e", "e")
        return joined(count, value, measure, self.words)
