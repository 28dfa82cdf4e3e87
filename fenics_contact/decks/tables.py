"""The results that a deck prints, as tables."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.readers.deck_cards import Origin


@displayed
@dataclass(frozen=True)
class Print:
    """Results that a deck asks for.

    Attributes:
        step: Number of its load step, from 0.
        card: "NODE PRINT", "EL PRINT", "CONTACT PRINT", "NODE FILE", ...
        where: Set of nodes or elements, or surface; "" for all.
        variables: "U", "RF", "S", ...
        totals: Whether sums over the set are asked for: "", "YES" or "ONLY".
        output: "2D" for results on the nodes of shells, "3D" or "" for those across their thickness.
    """

    step: int
    card: str
    where: str
    variables: tuple[str, ...]
    totals: str
    output: str
    origin: Origin


@displayed
@dataclass(frozen=True, eq=False)
class PrintTable:
    """A table of results.

    Attributes:
        name: What it is of: "NODE PRINT U ROOT".
        columns: Names of the columns, the number of the node or element first.
        rows: One for each node or element, shape (n, columns).
        instances: In decks with instances of parts that of each row, in whose numbers nodes and elements are
            given; "" for what belongs to none.
    """

    name: str
    columns: tuple[str, ...]
    rows: np.ndarray
    instances: tuple[str, ...] = ()

    def write(self, folder: Path) -> Path:
        """Write it as CSV, under its name."""
        path = folder / f"{self.name.replace(' ', '_').replace('/', '_')}.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            of = [[name] for name in self.instances] or [[]] * len(self.rows)
            writer.writerow([*["instance"][: len(self.instances)], *self.columns])
            writer.writerows(
                [*own, int(number), *values]
                for own, (number, *values) in zip(of, self.rows.tolist(), strict=True)
            )
        return path


def write_tables(tables: Sequence[PrintTable], folder: Path) -> list[Path]:
    """Write tables as CSV files into a folder, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    return [table.write(folder) for table in tables]
