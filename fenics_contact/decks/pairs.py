"""Contact pairs and ties of a deck between its bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._scene.pairs import ContactPair, Surface, Tie
from fenics_contact._scene.sectors import AnyTie
from fenics_contact.decks.bodies import DeckBodies
from fenics_contact.decks.coincident import between_different
from fenics_contact.decks.contact import Sides, closure_of, friction_of, interaction_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.readers.deck_cards import Card


@dataclass(frozen=True, eq=False)
class Pairs:
    """Contact pairs, last those that some step leaves out, and ties, with their surfaces of the deck."""

    contacts: Sequence[tuple[Sides, ContactPair]]
    ties: Sequence[tuple[Sides, AnyTie]]


def pairs_of(built: DeckBodies) -> Pairs:
    """Return the contact pairs and ties of a deck."""
    deck, sides, meshes = built.deck, built.names.contact.sides, built.meshes
    given = {**_adjusted(built), **_clearances(deck.cards)}
    known = {(each.slave, each.master) for each in sides if not each.tied}
    for both, (card, _) in given.items():
        if both not in known:
            raise card.error(f"there is no contact pair of {both[0]} on {both[1]}: correct the names")
    contacts, ties = list[tuple[Sides, ContactPair]](), list[tuple[Sides, AnyTie]]()
    made = set[tuple[Surface, Surface]]()
    for each in sides:
        for one, other in _surfaces(built, each):
            if (other, one) in made:
                words = f"the pair {each.slave} on {each.master} is the one in the other sense, once"
                deck.note(each.card, words)
                continue
            made.add((one, other))
            try:
                if each.around is not None:
                    ties.append((each, each.around.tie(one, other, meshes)))
                elif each.tied:
                    ties.append((each, Tie(one, other)))
                else:
                    contacts.append((each, _pair(built, one, other, each, given)))
            except InvalidInputError as error:
                if getattr(error, "card", ""):
                    raise
                raise each.error(str(error)) from error
    for kind, pairs in (("contact", contacts), ("tie", ties)):
        deck.record.origins.update({(kind, pair.place): of.card.origin for of, pair in pairs})  # type: ignore[attr-defined]
    left_out = {pair for change in deck.changes if change for pair in change.removed}
    contacts.sort(key=lambda each: (each[0].slave, each[0].master) in left_out)
    return Pairs(contacts, ties)


def _surfaces(built: DeckBodies, of: Sides) -> list[tuple[Surface, Surface]]:
    """Return the surfaces of bodies that a pair is between, those near each other if there are several."""
    names, meshes = built.names.contact.surfaces, built.meshes
    slave, master = names[of.slave], names[of.master]
    pairs = [
        (Surface(a, slave), Surface(b, master))
        for a, one in meshes.items() if slave in one.surfaces
        for b, other in meshes.items() if master in other.surfaces
    ]  # fmt: skip
    if len(pairs) > 1:
        pairs = [(s, m) for s, m in pairs if _near(meshes[s.body], slave, meshes[m.body], master)]
    apart = between_different(pairs, meshes)
    if len(apart) < len(pairs):
        listed = ", ".join(f"{s.body} on {m.body}" for s, m in apart)
        words = f"{of.slave} and {of.master} both have faces of the same bodies, which coincide"
        built.deck.note(of.card, f"{words}: read as {listed}")
    return apart


def _near(one: BodyMesh, surface: str, other: BodyMesh, facing: str) -> bool:
    """Return whether the boxes around two surfaces, half as large again, overlap."""
    boxes = []
    for mesh, name in ((one, surface), (other, facing)):
        points = mesh.points[np.unique(mesh.surfaces[name])]
        size = 0.25 * float(np.linalg.norm(np.ptp(points, axis=0)))
        boxes.append((points.min(axis=0) - size, points.max(axis=0) + size))
    (low, high), (below, above) = boxes
    return bool((low <= above).all() and (below <= high).all())


#: Clearances by slave and master, and the cards that give them.
_Clearances = Mapping[tuple[str, str], tuple[Card, float]]


def _clearances(cards: Sequence[Card]) -> _Clearances:
    return {
        (card.required("SLAVE"), card.required("MASTER")): (card, card.number_of("VALUE"))
        for card in cards
        if card.name == "CLEARANCE"
    }


def _adjusted(built: DeckBodies) -> _Clearances:
    """Return no clearance of the pairs that ADJUST a set with all nodes of their slave."""
    names, mesh = built.names, built.deck.mesh
    found = {}
    for of in names.contact.sides:
        name = of.card.parameters.get("ADJUST", "0")
        if of.tied or _is_number(name):
            continue
        chosen = mesh.nodes_named(name, of.card)
        if of.slave in names.contact.alone:
            own = names.node_sets[names.contact.alone[of.slave]]
        else:
            own = mesh.nodes_of(names.surfaces[names.contact.surfaces[of.slave]])
        left = np.setdiff1d(own, chosen)
        if len(left):
            raise of.card.error(
                f"ADJUST={name} lacks {len(left)} of {len(own)} slave nodes: add them or give a distance"
            )
        found[of.slave, of.master] = of.card, 0.0
    return found


#: Types of contact pairs, without blanks; the other program overlooks what is behind them.
_TYPES = ("NODETOSURFACE", "SURFACETOSURFACE", "MORTAR", "LINMORTAR", "PGLINMORTAR")


def _pair(built: DeckBodies, slave: Surface, master: Surface, of: Sides, given: _Clearances) -> ContactPair:
    card, interaction = of.card, interaction_of(of.card, built.deck.interactions)
    kind = card.name_of("TYPE") or "NODE TO SURFACE"
    if not kind.replace(" ", "").startswith(_TYPES):
        raise card.error(f"TYPE={kind} is not read: NODE TO SURFACE, SURFACE TO SURFACE and MORTAR are")
    adjust = card.parameters.get("ADJUST", "")
    gaps: dict[str, Any] = {"adjust": float(adjust)} if _is_number(adjust) else {"interference": "measured"}
    if (of.slave, of.master) in given:
        _, clearance = given[of.slave, of.master]
        gaps.pop("interference", None)
        gaps["gap" if clearance >= 0 else "interference"] = abs(clearance)
    friction, closure = friction_of(interaction), closure_of(interaction, built.deck.note)
    nodes = built.names.contact.alone.get(of.slave)
    return ContactPair(slave, master, friction, closure=closure, nodes=nodes, **gaps)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
