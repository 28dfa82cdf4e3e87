"""The results that a deck prints, as tables."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.readers.deck_cards import Instances, Origin

if TYPE_CHECKING:
    from fenics_contact.results.state import State

_AXES = ("x", "y", "z")
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


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
    """

    step: int
    card: str
    where: str
    variables: tuple[str, ...]
    totals: str
    origin: Origin


class Printing(Protocol):
    """What tables need to know of a deck; its attributes are documented there."""

    @property
    def prints(self) -> Sequence[Print]:
        """What the deck asks for."""

    @property
    def thickness(self) -> float:
        """Thickness of plane bodies."""

    @property
    def node_numbers(self) -> Mapping[str, np.ndarray]:
        """Numbers of nodes by body."""

    @property
    def element_numbers(self) -> Mapping[str, np.ndarray]:
        """Numbers of cells by body."""

    @property
    def node_sets(self) -> Mapping[str, np.ndarray]:
        """Numbers of nodes by set."""

    @property
    def element_sets(self) -> Mapping[str, np.ndarray]:
        """Numbers of elements by set."""

    @property
    def instances(self) -> Instances | None:
        """Its instances of parts."""


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


def tables_of(deck: Printing, state: State, step: int) -> list[PrintTable]:
    """Return the tables that a deck prints of a step.

    Displacements (U) of the nodes of a set, forces of supports on them (RF), and stresses (S) of elements,
    which are means over each. Other variables are in the files for ParaView. With TOTALS a last row has the
    sums.

    Args:
        deck: The deck.
        state: The state at the end of the step.
        step: Number of the step, from 0.

    Note:
        Collective on the communicator of the state.
    """
    return [
        _own_numbers(table, deck.instances)
        for each in deck.prints
        if each.step == step and each.card in ("NODE PRINT", "EL PRINT")
        for table in _tables(deck, each, state)
    ]


def _own_numbers(table: PrintTable, instances: Instances | None) -> PrintTable:
    """Return a table with the numbers that nodes and elements have in their instances."""
    if instances is None:
        return table
    names, own = instances.own(table.rows[:, 0])
    return replace(table, rows=np.column_stack([own, table.rows[:, 1:]]), instances=tuple(names))


def _tables(deck: Printing, asked: Print, state: State) -> Iterator[PrintTable]:
    for variable in asked.variables:
        name = f"{asked.card} {variable} {asked.where}".strip()
        if asked.card == "NODE PRINT" and variable in ("U", "RF"):
            names, rows = _nodes(deck, asked.where, state, variable)
            if asked.totals:
                rows = np.vstack(
                    [rows[:0] if asked.totals == "ONLY" else rows, [0.0, *rows[:, 1:].sum(axis=0)]]
                )
            yield PrintTable(name, ("node", *names), rows)
        elif asked.card == "EL PRINT" and variable == "S":
            names = tuple(f"S{_AXES[a]}{_AXES[b]}" for a, b in _PAIRS)
            yield PrintTable(name, ("element", *names), _elements(deck, asked.where, state))


def _nodes(deck: Printing, where: str, state: State, variable: str) -> tuple[tuple[str, ...], np.ndarray]:
    """Return displacements or reactions of nodes by their numbers; row 0 is the place of a sum."""
    found = list[np.ndarray]()
    for body, nodes in deck.node_numbers.items():
        mine = np.flatnonzero(nodes > 0)
        if where:
            mine = mine[np.isin(nodes[mine], deck.node_sets[where])]
        if variable == "U":
            values = state.gather_displacement(body)[mine]
        else:
            values = state.nodal_reactions(body)[mine] * deck.thickness
        found.append(np.column_stack([nodes[mine], values]))
    rows = np.vstack(found)
    short = {"U": "u", "RF": "f"}[variable]
    names = tuple(f"{short}{axis}" for axis in _AXES[: rows.shape[1] - 1])
    nodes, first, number = np.unique(rows[:, 0], return_index=True, return_inverse=True)
    if variable == "U" or len(nodes) == len(rows):
        return names, rows[first]
    sums = [np.bincount(number.ravel(), column) for column in rows[:, 1:].T]  # of bodies that share nodes
    return names, np.column_stack([nodes, *sums])


def _elements(deck: Printing, where: str, state: State) -> np.ndarray:
    """Return the mean stresses of elements by their numbers."""
    found = []
    for body, elements in deck.element_numbers.items():
        mine = np.arange(len(elements))
        if where:
            mine = np.flatnonzero(np.isin(elements, deck.element_sets[where]))
        stress = state.gather_stress(body)[mine]
        found.append(np.column_stack([elements[mine], *(stress[:, a, b] for a, b in _PAIRS)]))
    rows = np.vstack(found)
    return rows[np.argsort(rows[:, 0], kind="stable")]


def write_tables(tables: Sequence[PrintTable], folder: Path) -> list[Path]:
    """Write tables as CSV files into a folder, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    return [table.write(folder) for table in tables]
