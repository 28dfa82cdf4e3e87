"""Linear equations between components of nodes of a deck."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class Equation:
    """A linear equation between components of nodes, Σ c u = 0.

    Attributes:
        nodes: Positions of the nodes of its terms.
        components: Their components, from zero.
        factors: Their factors.
    """

    card: Card
    row: int
    nodes: tuple[int, ...]
    components: tuple[int, ...]
    factors: tuple[float, ...]


def read_equations(cards: Sequence[Card], mesh: DeckMesh) -> list[Equation]:
    """Return the equations of a deck."""
    found = []
    for card in cards:
        if card.name != "EQUATION":
            continue
        if "REMOVE" in card.parameters:
            raise card.error("REMOVE is not read: leave the equation out")
        row = 0
        while row < len(card.rows):
            first, count = row, card.whole(card.rows[row][0], row)
            if count < 1:
                raise card.error(f"needs the number of its terms, got {card.rows[row][0]!r}: correct it", row)
            entries: list[str] = []
            while len(entries) < 3 * count:
                row += 1
                if row == len(card.rows):
                    raise card.error(
                        f"needs {count} terms of node, component and factor: complete them", first
                    )
                entries += [entry for entry in card.rows[row] if entry]
            nodes = [mesh.nodes_named(token, card, row) for token in entries[: 3 * count : 3]]
            if any(len(each) != 1 for each in nodes):
                raise card.error("needs single nodes, got a set of several: write an equation for each", row)
            numbers = [card.number(token, row) for token in entries[2 : 3 * count : 3]]
            parts = [card.whole(token, row) - 1 for token in entries[1 : 3 * count : 3]]
            if not all(0 <= part < 6 for part in parts):
                raise card.error(f"components must be from 1 to 6, got {1 + min(parts)}: correct them", row)
            found.append(Equation(card, first, tuple(int(n[0]) for n in nodes), tuple(parts), tuple(numbers)))
            row += 1
    return found
