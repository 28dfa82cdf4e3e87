"""What is reported: one thing that happened to a piece of work, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from fenics_contact.progress.words import joined


class Kind(Enum):
    """What happened to a piece of work."""

    BEGIN = "begins"
    STEP = "step"
    END = "done"
    FAILED = "failed"
    STOPPED = "stopped"


@dataclass(frozen=True)
class Event:
    """One report. Numbers that are not known are None.

    Attributes:
        task: Tells pieces of work apart that are under way at the same time.
        what: The work: "factor", "load steps".
        kind: What happened.
        unit: What is counted: "products".
        number: How many are done.
        total: How many there are.
        most: How many there may be, where it is not known how many there are.
        measure: What must become small: the residual.
        target: How small.
        measured: What the measure is.
        value: Best value so far, of an optimisation.
        left: How long the work itself expects to take still, [s].
        words: What else there is to say, for readers.
        timed: Whether the time since the last step tells how long others take.
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
        """The numbers in words."""
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
