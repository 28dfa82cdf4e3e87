"""One row of the results table: a figure, its target, and how it is computed from runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Record = Mapping[str, Any]


class NoValue(Exception):
    """A row has no value: a run that it needs was not measured or was refused."""


class Summaries(dict[str, Record]):
    """Summaries of runs by name; asking for one that is not there raises `NoValue`."""

    def __missing__(self, name: str) -> Record:
        raise NoValue(name)


@dataclass(frozen=True)
class Row:
    """One figure with its target.

    Attributes:
        name: Short name.
        quantity: What it is, in words.
        unit: Of value and target.
        target: What the value should reach.
        better: ``"lower"`` or ``"higher"``.
        value: Computes it from the summaries of runs.
        of: Run that tells ranks and unknowns.
    """

    name: str
    quantity: str
    unit: str
    target: float
    better: str
    value: Callable[[Summaries], float]
    of: str = "chain"

    def met(self, value: float) -> bool:
        """Tell whether a value reaches the target."""
        return value <= self.target if self.better == "lower" else value >= self.target

    def record(self, summaries: Summaries) -> dict[str, Any]:
        """Return the row as `results.json` has it.

        Raises:
            NoValue: If a run that it needs is missing or was refused.
        """
        run = summaries[self.of]
        return {
            "name": self.name,
            "quantity": self.quantity,
            "value": self.value(summaries),
            "unit": self.unit,
            "target": self.target,
            "better": self.better,
            "ranks": run["ranks"],
            "unknowns": unknowns(run) if "counts" in run else unknowns(summaries["chain"]),
        }


def unknowns(run: Record) -> int:
    """Return the unknowns of a run: of the untorn problem where other solvers solve it too."""
    counts = run["counts"]
    return int(counts.get("unknowns") or counts["torn_unknowns"])
