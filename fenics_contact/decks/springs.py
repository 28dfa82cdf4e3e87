"""Springs, trusses and masses of a deck."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.decks.materials import MaterialCards, row_at
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_links import Link
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class NodeSpring:
    """A spring between nodes; `component`: along which it acts, from zero, −1 for the line between them."""

    link: Link
    nodes: tuple[int, ...]
    stiffness: float
    component: int

    def error(self, words: str) -> Exception:
        """Return an error at its line."""
        return self.link.card.error(f"element {self.link.number} {words}", self.link.row)


def name_of(number: int) -> str:
    """Return the name of the set of a node."""
    return f"NODE {number}"


@dataclass(frozen=True, eq=False)
class NodeMass:
    """A mass at a node of an element; `sets`: sets of elements that it is of."""

    card: Card
    node: int
    mass: float
    sets: frozenset[str]


def read_springs(
    cards: Sequence[Card], mesh: DeckMesh, materials: Mapping[str, MaterialCards]
) -> list[NodeSpring]:
    """Return the springs and trusses of a deck."""
    given = {link.number: (k, c) for card in cards for link, k, c in _given(card, mesh, materials)}
    result = []
    for link in mesh.links:
        if link.kind in ("DCOUP3D", "MASS"):
            continue
        if link.number not in given:
            raise link.card.error(f"element {link.number} has no *SPRING or *SOLID SECTION: add it", link.row)
        at = mesh.positions(np.array(link.nodes), "node", link.card, link.row)[
            : 2 if link.kind != "SPRING1" else 1
        ]
        if link.kind == "T3D3":
            at = mesh.positions(np.array(link.nodes)[[0, 2]], "node", link.card, link.row)
        stiffness, component = given[link.number]
        if link.kind.startswith("T"):
            stiffness /= float(np.linalg.norm(np.diff(mesh.points[at], axis=0))) or np.inf
        result.append(NodeSpring(link, tuple(at.tolist()), stiffness, component))
    return result


def _given(
    card: Card, mesh: DeckMesh, materials: Mapping[str, MaterialCards]
) -> Iterator[tuple[Link, float, int]]:
    """Yield the elements of a card with their stiffness, of trusses times their length, and component."""
    if card.name not in ("SPRING", "SOLIDSECTION"):
        return
    for link in mesh.link_sets.get(card.required("ELSET"), []):
        if card.name == "SPRING" and link.kind.startswith("SPRING"):
            yield link, _constant(card), -1 if link.kind == "SPRINGA" else _component(card)
        elif card.name == "SOLIDSECTION" and link.kind.startswith("T"):
            material = card.known("material", card.required("MATERIAL"), materials)
            if set(material.parts) - {"ELASTIC", "DENSITY", "EXPANSION"} or "ELASTIC" not in material.parts:
                raise card.error("a truss needs a material of *ELASTIC alone: give one")
            yield link, _area(card) * row_at(material.parts["ELASTIC"], 2, 0.0, "a Young's modulus")[0], -1


def _area(card: Card) -> float:
    """Return that of the section of a truss."""
    return card.floats(0)[0] if card.lines and card.rows[0][0] else 1.0


def _constant(card: Card) -> float:
    """Return the stiffness of a *SPRING, whose table, if it has one, must be a line through zero."""
    rows = [card.floats(row) for row in range(len(card.lines))]
    if "NONLINEAR" not in card.parameters:
        stiffness = rows[-1][0] if rows else 0.0
    else:
        table = np.array([row[:2] for row in rows if len(row) > 1])
        slopes = np.array([force / way for force, way in table if way])
        if not len(slopes) or np.ptp(slopes) > 1e-6 * abs(slopes).max() or table[table[:, 1] == 0.0, 0].any():
            raise card.error("a table of a spring must be a line through zero: give its stiffness")
        stiffness = float(slopes[0])
    if not stiffness > 0.0:
        raise card.error(f"the stiffness of a spring must be above zero, got {stiffness:g}: correct it")
    return stiffness


def _component(card: Card) -> int:
    """Return the component of SPRING1 and SPRING2, from zero."""
    parts = {int(number) for number in card.floats(0) if number} if len(card.lines) > 1 else set[int]()
    if len(parts) != 1 or not parts <= {1, 2, 3}:
        raise card.error(f"needs one component from 1 to 3, the same at both nodes, got {sorted(parts)}", 0)
    return parts.pop() - 1


def read_masses(
    cards: Sequence[Card], mesh: DeckMesh, materials: Mapping[str, MaterialCards]
) -> list[NodeMass]:
    """Return the masses at nodes of a deck; those of trusses are at their ends."""
    found = []
    for card in cards:
        for link in mesh.link_sets.get(card.name_of("ELSET"), []):
            ends = mesh.positions(np.array(link.nodes)[[0, -1]], "node", link.card, link.row)
            if card.name == "MASS" and link.kind == "MASS":
                ends, mass = ends[:1], card.floats(0)[0]
            elif card.name == "SOLIDSECTION" and link.kind.startswith("T"):
                density = card.known("material", card.required("MATERIAL"), materials).density
                length = float(np.linalg.norm(np.diff(mesh.points[ends], axis=0)))
                mass = 0.5 * _area(card) * length * density
            else:
                continue
            sets = frozenset(name for name, links in mesh.link_sets.items() if link in links)
            found += [NodeMass(link.card, node, mass, sets) for node in ends.tolist()]
    return found
