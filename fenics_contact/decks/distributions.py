"""Orientations that a *DISTRIBUTION gives element by element, as sections with an orientation each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fenics_contact.readers.deck_bodies import Section
from fenics_contact.readers.deck_cards import Card, plain
from fenics_contact.readers.deck_mesh import DeckMesh


def by_distribution(
    cards: Sequence[Card],
    mesh: DeckMesh,
    sections: Sequence[Section],
    of_element: np.ndarray,
    orientations: Mapping[str, Card],
) -> tuple[DeckMesh, list[Section], np.ndarray, dict[str, Card]]:
    """Return mesh, sections, their numbers by element, and orientations, where each orientation has one axes.

    A section whose orientation names a distribution is cut into one for each of its directions.
    """
    tables = {card.required("NAME"): card for card in cards if card.name == "DISTRIBUTION"}
    found, of_element, axes = list(sections), of_element.copy(), dict(orientations)
    for number, section in enumerate(sections):
        card = orientations.get(section.orientation)
        name = plain(card.rows[0][0]) if card is not None and card.lines and len(card.rows[0]) == 1 else ""
        if card is None or not name:
            continue
        table = card.known("distribution", name, tables, 0)
        mine = np.flatnonzero(of_element == number)
        row_of = _rows(table, mesh)[mine]
        for place, row in enumerate(np.unique(row_of).tolist()):
            own = mine[row_of == row]
            label = f"{section.orientation} {row + 1}"
            axes[label] = replace(
                table, name=card.name, written=card.written, parameters=card.parameters,
                lines=[table.lines[row].partition(",")[2], *card.lines[1:]],
                numbers=[table.numbers[row], *card.numbers[1:]], files=(),
            )  # fmt: skip
            if place == 0:
                found[number] = replace(section, orientation=label)
                continue
            cut = f"{section.name}_{label}".replace(" ", "_")
            mesh = replace(mesh, element_sets={**mesh.element_sets, cut: own})
            of_element[own] = len(found)
            found.append(replace(section, name=cut, orientation=label))
    return mesh, found, of_element, axes


def _rows(table: Card, mesh: DeckMesh) -> np.ndarray:
    """Return the number of the first line with the axes of each element, (n_elements,)."""
    if table.name_of("LOCATION") not in ("", "ELEMENT"):
        raise table.error(f"LOCATION={table.name_of('LOCATION')} is not read: give axes of elements")
    if not table.lines or table.rows[0][0]:
        raise table.error("needs a first line without elements, of all that have no other one: add it")
    first: dict[tuple[float, ...], int] = {}
    row_of = np.zeros(len(mesh.element_numbers), dtype=np.int64)
    for row, entries in enumerate(table.rows):
        axes = tuple(table.floats(row, 1))
        if len(axes) != 6:
            raise table.error(f"needs two points of three coordinates each, got {len(axes)} numbers", row)
        alike = first.setdefault(axes, row)
        if row:
            row_of[mesh.elements_named(entries[0], table, row)] = alike
    return row_of
