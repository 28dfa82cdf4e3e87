"""What load steps of a deck change of contact pairs: friction, closure, and pairs that do not act."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from fenics_contact._scene.pairs import ContactPair
from fenics_contact.decks.contact import Interaction, Note, Sides, closure_of, friction_of, interaction_of
from fenics_contact.readers.deck_cards import Card

#: Cards that say whose cards follow.
_CHANGES = {"CHANGEFRICTION": "FRICTION", "CHANGESURFACEBEHAVIOR": "SURFACEBEHAVIOR"}


@dataclass(frozen=True)
class PairChange:
    """What contact is from a step on.

    `known`: slave and master of all pairs; `removed`: those of the pairs that do not act.
    """

    interactions: Mapping[str, Interaction]
    known: frozenset[tuple[str, str]]
    removed: frozenset[tuple[str, str]] = frozenset()

    def applied(self, of: Sides, pair: ContactPair, note: Note) -> Iterator[ContactPair]:
        """Yield a pair as it is in the step, nothing where it does not act."""
        # A pair that is there in both senses is one here.
        if not {(of.slave, of.master), (of.master, of.slave)} & self.known <= self.removed:
            interaction = self.interactions[of.card.name_of("INTERACTION")]
            yield replace(pair, friction=friction_of(interaction), closure=closure_of(interaction, note))


def read_changes(
    cards: Sequence[Card], interactions: Mapping[str, Interaction], sides: Sequence[Sides]
) -> list[PairChange | None]:
    """Return for each step what it changes, None where it changes nothing."""
    found: list[PairChange | None] = []
    now = PairChange(interactions, frozenset((each.slave, each.master) for each in sides if not each.tied))
    at: tuple[Card, Interaction] | None = None
    for card in cards:
        if card.name == "STEP":
            found.append(None)
        if card.name not in (*_CHANGES, *_CHANGES.values(), "MODELCHANGE"):
            continue
        if not found:
            if card.name in (*_CHANGES, "MODELCHANGE"):
                raise card.error("must be between *STEP and *END STEP: move it there")
            continue
        if card.name in _CHANGES:
            at = card, interaction_of(card, now.interactions)
            continue
        if card.name == "MODELCHANGE":
            now = replace(now, removed=_switched(card, now))
        else:
            now = replace(now, interactions=_changed(card, at, now.interactions))
        found[-1] = now
    return found


def _changed(
    card: Card, at: tuple[Card, Interaction] | None, interactions: Mapping[str, Interaction]
) -> dict[str, Interaction]:
    """Return the interactions with the card behind one of `_CHANGES`."""
    if at is None or _CHANGES[at[0].name] != card.name:
        needed = next(text for text, follows in _CHANGES.items() if follows == card.name)
        words = {"CHANGEFRICTION": "*CHANGE FRICTION", "CHANGESURFACEBEHAVIOR": "*CHANGE SURFACE BEHAVIOR"}
        raise card.error(f"must follow {words[needed]} within a step: add it with INTERACTION=")
    change, old = at
    name = change.name_of("INTERACTION")
    if card.name == "FRICTION":
        new = replace(old, friction=card)
    else:
        new = replace(old, behavior=card)
        if old.tied or new.tied:
            raise card.error("a step cannot change TIED: give another behaviour, or make two decks")
    return {**interactions, name: new}


def _switched(card: Card, now: PairChange) -> frozenset[tuple[str, str]]:
    """Return the pairs that do not act after *MODEL CHANGE."""
    of_pairs = card.name_of("TYPE").replace(" ", "") == "CONTACTPAIR"
    if not of_pairs or ("REMOVE" in card.parameters) == ("ADD" in card.parameters):
        raise card.error(f"needs TYPE=CONTACT PAIR and REMOVE or ADD, got {card.given}")
    pairs = set()
    for row, entries in enumerate(card.rows):
        pair = tuple(entry.upper().strip('"') for entry in entries if entry)
        if pair not in now.known:
            there = "; ".join(f"{slave}, {master}" for slave, master in sorted(now.known)) or "none"
            raise card.error(f"there is no contact pair of these surfaces; the deck has {there}", row)
        pairs.add((pair[0], pair[1]))
    return now.removed | pairs if "REMOVE" in card.parameters else now.removed - pairs
