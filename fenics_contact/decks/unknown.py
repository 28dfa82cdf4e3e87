"""What of a deck is not known: all of it is named at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fenics_contact.decks.vocabulary import KNOWN, NOT_YET, PARAMETERS, PROCEDURES
from fenics_contact.readers.deck_cards import Card, DeckError
from fenics_contact.readers.deck_elements import element_of

#: Cards that change what is solved, by what they are of.
STRUCTURES = {
    "SHELLSECTION": "shells are not solved here: mesh the part with solid elements",
    "SHELLGENERALSECTION": "shells are not solved here: mesh the part with solid elements",
    "MEMBRANESECTION": "membranes are not solved here: mesh the part with solid elements",
    "BEAMSECTION": "beams are not solved here: mesh the part with solid elements",
    "BEAMGENERALSECTION": "beams are not solved here: mesh the part with solid elements",
    "SPRING": "springs are not read: describe them in Python, by Spring between node sets",
    "DASHPOT": "dashpots are not solved here, where nothing moves in time: leave them out",
    "MASS": "masses are not read: under GRAV they are forces, give these by *CLOAD",
    "GAP": "gaps between nodes are not read: give a *CONTACT PAIR",
    "USERMATERIAL": "materials of user routines are not read: take one of the guide, or write it in Python",
    "DEPVAR": "it belongs to materials of user routines, which are not read",
    "SUBMODEL": "submodels are not read: give displacements by *BOUNDARY",
    "CREEP": "creep is not solved here: it goes on in time",
    "FILM": "heat is not conducted here: give temperatures by *TEMPERATURE",
    "RADIATE": "heat is not conducted here: give temperatures by *TEMPERATURE",
    "DFLUX": "heat is not conducted here: give temperatures by *TEMPERATURE",
    "CFLUX": "heat is not conducted here: give temperatures by *TEMPERATURE",
}


def refuse_unknown(cards: Sequence[Card]) -> None:
    """Refuse cards, types of elements and parameters that are not known, at the first one.

    Raises:
        DeckError: With the others behind it, each with its line.
    """
    found = list(_unknown(cards))
    if not found:
        return
    (card, words), *others = found
    if others:
        listed = [f"*{each.written} (line {each.line} of {each.file}): {what}" for each, what in others]
        words += "; not known either are\n  " + "\n  ".join(listed)
    raise card.error(words)


def _unknown(cards: Sequence[Card]) -> Iterator[tuple[Card, str]]:
    """Yield each card, type of elements and parameter that is not known, once."""
    seen = set[str]()
    for card in cards:
        for words in _of_card(card):
            key = f"{card.name} {words}"
            if key not in seen:
                seen.add(key)
                yield card, words


def _of_card(card: Card) -> Iterator[str]:
    if card.name not in KNOWN and card.name not in PROCEDURES:
        unknown = "this card is not known: the guide lists those that are; leave it out if it has no effect"
        yield STRUCTURES.get(card.name, unknown)
        return
    if card.name == "RESTART" and "READ" in card.parameters:
        yield "restart files are not supported: supply all steps"
    for strange in sorted(set(card.parameters) - PARAMETERS.get(card.name, set(card.parameters))):
        there = ", ".join(sorted(PARAMETERS[card.name])) or "none"
        yield f"the parameter {strange} is not read: {there} can be"
    if card.name in NOT_YET:
        yield "this card is known, but not read yet: leave it out, or describe it in Python"
    if card.name == "ELEMENT" and card.name_of("TYPE") not in ("", "DCOUP3D"):
        try:
            element_of(card)
        except DeckError as error:
            yield str(error).partition(f"*{card.written}: ")[2]
