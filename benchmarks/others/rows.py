"""A line of the table: a quantity with its error bar, and how it is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import process_time
from typing import Any

from mpi4py import MPI

from fenics_contact import AccurateResult, Limits, Scene, solve_to
from fenics_contact.design import Objective


@dataclass(frozen=True)
class Row:
    """A quantity.

    Attributes:
        quantity: What it is, with its unit.
        value: Ours.
        error: Its error bar, half the width of the interval, in the same unit.
        reference: What it is held against, by theory or by others; not a number where there is none.
        source: Where the reference is from.
        margin: How far the reference itself may be off, relative to it.
        others: What other codes print, in words.
        unknowns: Of the last mesh.
        products: Products with F of the mesh that took most; else Newton's steps on the last.
        seconds: Processor time of all meshes.
        levels: Value of the state, without correction, and products on each mesh.
    """

    quantity: str
    value: float
    error: float
    reference: float = float("nan")
    source: str = ""
    margin: float = 0.0
    others: str = ""
    unknowns: int = 0
    products: int = 0
    seconds: float = 0.0
    levels: tuple[tuple[float, int], ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether the reference lies within the error bar and its own margin."""
        return abs(self.value - self.reference) <= self.error + self.margin * abs(self.reference)

    @property
    def record(self) -> dict[str, Any]:
        """The row as JSON holds it, which has no numbers that are none."""
        plain = asdict(self) | {"levels": [list(level) for level in self.levels]}
        return {name: value for name, value in plain.items() if value == value}


@dataclass(frozen=True)
class Problem:
    """A published problem.

    Attributes:
        title: Its name.
        rows: Solves it.
    """

    title: str
    rows: Callable[[], list[Row]]


def accurately(
    scene: Scene,
    objective: Objective | str,
    accuracy: float,
    *,
    scale: float = 1.0,
    unknowns: int = 100_000,
    **row: Any,
) -> Row:
    """Return the row of a quantity to an accuracy; `scale`: factor on it, for signs, halves and units."""
    began = process_time()
    found = solve_to(scene, objective, accuracy, MPI.COMM_SELF, limits=Limits(levels=18, unknowns=unknowns))
    return row_of_result(found, scale, seconds=process_time() - began, **row)


def row_of_result(found: AccurateResult[Any], scale: float = 1.0, **row: Any) -> Row:
    """Return the row of a result."""
    return Row(
        value=scale * found.value,
        error=abs(scale) * found.error,
        unknowns=found.levels[-1].unknowns,
        products=max(level.products for level in found.levels),
        levels=tuple((scale * level.state_value, level.products) for level in found.levels),
        **row,
    )
