"""Plies of the sections of composite shells."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_contact.readers.deck_cards import Card, plain


@dataclass(frozen=True, eq=False)
class Ply:
    """A ply: its thickness, and the names of its material and its axes."""

    thickness: float
    material: str
    orientation: str


def plies_of(card: Card) -> list[Ply]:
    """Return the plies of a section from the bottom, none where it is of one material."""
    return [_ply(card, row) for row in range(len(card.rows))] if "COMPOSITE" in card.parameters else []


def _ply(card: Card, row: int) -> Ply:
    first, _, material, orientation, *_ = [*card.rows[row], "", "", "", ""]
    if not first or not material:
        raise card.error(
            "needs thickness, points, material and orientation of a ply: add what is not there", row
        )
    thickness = card.number(first, row)
    if not thickness > 0.0:
        raise card.error(f"the thickness of a ply must be above zero, got {thickness:g}: correct it", row)
    return Ply(thickness, plain(material), plain(orientation) or card.name_of("ORIENTATION"))
