"""Nodes, elements, sets and surfaces of a deck."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact.readers.deck_cards import Card, DeckError, plain
from fenics_contact.readers.deck_elements import Element, element_of, without_repeated
from fenics_contact.readers.deck_links import Link, is_of_links, read_links, sets_of_links
from fenics_contact.readers.deck_shell_nodes import NO_SHELLS, ShellNodes


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one card.

    `first`: position of the first of them among all elements; `records`: which of the elements of the card
    they are.
    """

    element: Element
    card: Card
    numbers: np.ndarray
    nodes: np.ndarray
    first: int
    records: np.ndarray


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces of elements: the element of each, and which of its faces, from zero, both (n,)."""

    elements: np.ndarray
    sides: np.ndarray

    def __len__(self) -> int:
        """Return the number of faces."""
        return len(self.elements)


NO_NODES = np.zeros(0, dtype=np.int64)
NO_FACES = Faces(NO_NODES, NO_NODES)


@dataclass(frozen=True, eq=False)
class Named:
    """A surface by its card: faces of elements, or nodes; none of both where its card has no lines."""

    card: Card
    faces: Faces
    nodes: np.ndarray


@dataclass(eq=False)
class DeckMesh:
    """What a deck says of its mesh; nodes and elements are known by their positions in it.

    `numbers`: numbers of the nodes in the deck, ascending; `origins`: name of a set -> its first card;
    `links`: elements that are no cells; `link_sets`: name of a set of elements -> such elements of it;
    `shells`: nodes across the thickness of shells.
    """

    numbers: np.ndarray
    points: np.ndarray
    blocks: list[Block]
    element_numbers: np.ndarray
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    element_sets: dict[str, np.ndarray] = field(default_factory=dict)
    surfaces: dict[str, Named] = field(default_factory=dict)
    origins: dict[str, Card] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    link_sets: dict[str, list[Link]] = field(default_factory=dict)
    shells: ShellNodes = NO_SHELLS

    @property
    def block_of(self) -> np.ndarray:
        """Number of the block of each element, (n_elements,)."""
        return np.repeat(np.arange(len(self.blocks)), [len(block.numbers) for block in self.blocks])

    @property
    def _element_order(self) -> np.ndarray:
        return np.argsort(self.element_numbers, kind="stable")

    def nodes_named(self, token: str, card: Card, row: int | None = None) -> np.ndarray:
        """Return the positions of the nodes of a set, or of one node by its number."""
        if token.isdecimal():
            number = _written(token)
            place = int(np.searchsorted(self.numbers, number))
            if place < len(self.numbers) and self.numbers[place] == number:
                return np.array([place])
            return self.positions(np.array([number]), "node", card, row)
        return card.known("node set", plain(token), self.node_sets, row)

    def elements_named(self, token: str, card: Card, row: int | None = None) -> np.ndarray:
        """Return the positions of the elements of a set, or of one element by its number."""
        if token.isdecimal():
            return self.positions(np.array([_written(token)]), "element", card, row)
        return card.known("element set", plain(token), self.element_sets, row)

    def of_section(self, card: Card, allowed: np.ndarray, kind: str) -> np.ndarray:
        """Return the positions of the elements of a section, which are of a kind, a "shell" or a "beam"."""
        elements = self.elements_named(card.required("ELSET"), card)
        if not allowed[elements].all():
            number = card.label(self.element_numbers[elements[~allowed[elements]][0]])
            raise card.error(f"element {number} is no {kind}: give it a *SOLID SECTION")
        return elements

    def expanded(self, points: np.ndarray, blocks: list[Block], nodes: ShellNodes) -> DeckMesh:
        """Return the mesh with solid cells in place of shells or beams.

        `points`: all, its own first; `blocks`: all; `nodes`: which of the new ones belong to its own.
        """
        more = self.numbers[-1] + 1 + np.arange(len(points) - len(self.points))
        return replace(
            self,
            numbers=np.append(self.numbers, more),
            points=points,
            blocks=blocks,
            surfaces={n: replace(each, nodes=nodes.across(each.nodes)) for n, each in self.surfaces.items()},
            shells=self.shells.joined(nodes),
        )

    def weighed(self, token: str, card: Card, row: int | None = None) -> np.ndarray:
        """Return the positions of the cells that a load on volumes acts on, none of a set of masses."""
        alone = plain(token) in self.link_sets and plain(token) not in self.element_sets
        return NO_NODES if alone else self.elements_named(token, card, row)

    def surface_named(self, token: str, card: Card, row: int | None = None) -> Named:
        """Return a surface, which has faces or nodes."""
        found = card.known("surface", plain(token), self.surfaces, row)
        if not len(found.faces) and not len(found.nodes):
            raise card.error(f"surface {plain(token)!r} has no lines: add its faces or nodes", row)
        return found

    def positions(
        self, numbers: np.ndarray, what: str, card: Card, row: int | None = None, by_row: bool = False
    ) -> np.ndarray:
        """Return the positions of nodes or elements by their numbers.

        `by_row`: whether each number is of a data line, for errors.
        """
        known, order = self.numbers, np.arange(len(self.numbers))  # ascending
        if what == "element":
            known, order = self.element_numbers, self._element_order
        place = np.minimum(np.searchsorted(known[order], numbers), max(len(known) - 1, 0))
        found = order[place] if len(known) else place
        lost = np.flatnonzero(known[found] != numbers) if len(known) else np.arange(len(numbers))
        if len(lost):
            line = int(lost[0]) if by_row else row
            lacking = f"{what} {card.label(numbers[lost[0]])}"
            raise card.error(f"{lacking} is not there: correct the number, or add it", line)
        return np.asarray(found)

    def corners(self, faces: Faces) -> list[np.ndarray]:
        """Return the corners of faces, arrays of (n, 4 | 3 | 2) positions of nodes."""
        return [nodes[:, : len(element.faces[side])] for _, element, side, nodes in self.parts_of(faces)]

    def nodes_of(self, faces: Faces) -> np.ndarray:
        """Return the ascending positions of the nodes of faces."""
        return np.unique(np.concatenate([NO_NODES, *(n.ravel() for _, _, _, n in self.parts_of(faces))]))

    def in_cell_order(self, elements: np.ndarray) -> np.ndarray:
        """Return the elements of a body in the order of its cells: type by type, by their names."""
        kinds = np.array([block.element.cell for block in self.blocks])[self.block_of]
        return elements[np.argsort(kinds[elements], kind="stable")]

    def middles(self, elements: np.ndarray) -> np.ndarray:
        """Return the mean of the nodes of elements, (n, 3)."""
        block_of, found = self.block_of, np.zeros((len(elements), 3))
        for number in np.unique(block_of[elements]):
            block, mine = self.blocks[number], block_of[elements] == number
            found[mine] = self.points[block.nodes[elements[mine] - block.first]].mean(axis=1)
        return found

    def parts_of(self, faces: Faces) -> Iterator[tuple[np.ndarray, Element, int, np.ndarray]]:
        """Yield faces of one type and side: their positions, the type, the side and their nodes."""
        block_of = self.block_of[faces.elements]
        for number in np.unique(block_of):
            block = self.blocks[number]
            for side in np.unique(faces.sides[block_of == number]):
                mine = np.flatnonzero((block_of == number) & (faces.sides == side))
                local = np.array(block.element.face_nodes[side])
                yield (
                    mine,
                    block.element,
                    int(side),
                    block.nodes[faces.elements[mine] - block.first][:, local],
                )

    def faces_of(self, elements: np.ndarray, label: str, card: Card, row: int | None) -> Faces:
        """Return one face of each of some elements, by its label: "S3", "P3"."""
        block_of, sides = self.block_of[elements], np.zeros(len(elements), dtype=np.int64)
        for number in np.unique(block_of):
            element = self.blocks[number].element
            side = element.side(label)
            if side < 0:
                raise card.error(f"{element.name} has {len(element.faces)} faces, got {label!r}", row)
            if not element.faces[side]:
                first = card.label(self.element_numbers[elements[block_of == number][0]])
                raise card.error(f"face {label!r} of element {first} is only an edge: leave it out", row)
            sides[block_of == number] = side
        return Faces(elements, sides)


def _written(token: str) -> int:
    """Return a number as it is written, one that is too large for any node as the largest of all."""
    return min(int(token[:20]), np.iinfo(np.int64).max)


def read_nodes(cards: Sequence[Card]) -> DeckMesh:
    """Return the nodes of cards and the sets of these alone."""
    mesh = _with_nodes(cards)
    for card in cards:
        if card.name == "NSET" and not card.name_of("ELSET"):
            _add(mesh, mesh.node_sets, card, card.required("NSET"), _members(mesh, card, "node"))
    return mesh


def read_mesh_cards(cards: Sequence[Card]) -> DeckMesh:
    """Return nodes, elements, sets and surfaces of a deck."""
    mesh = _with_nodes(cards)
    mesh.links += read_links(cards)
    mesh.link_sets |= sets_of_links(cards, mesh.links)
    cards = [card for card in cards if not is_of_links(card)]
    _elements(mesh, [card for card in cards if card.name == "ELEMENT"])
    for card in cards:
        if card.name == "ELEMENT" and card.name_of("ELSET"):
            blocks = [block for block in mesh.blocks if block.card is card]
            first, last = blocks[0].first, blocks[-1].first + len(blocks[-1].numbers)
            _add(mesh, mesh.element_sets, card, card.name_of("ELSET"), np.arange(first, last))
    for card in cards:
        if card.name == "NSET":
            _add(mesh, mesh.node_sets, card, card.required("NSET"), _members(mesh, card, "node"))
        elif card.name == "ELSET":
            _add(mesh, mesh.element_sets, card, card.required("ELSET"), _members(mesh, card, "element"))
        elif card.name == "SURFACE":
            mesh.surfaces[card.required("NAME")] = _surface(mesh, card)
    return mesh


def _with_nodes(cards: Sequence[Card]) -> DeckMesh:
    """Return the nodes of cards and the sets that *NODE names."""
    with_nodes = [card for card in cards if card.name == "NODE"]
    numbers, points, numbers_of = _nodes(with_nodes)
    mesh = DeckMesh(numbers, points, [], np.zeros(0, dtype=np.int64))
    for card, own in zip(with_nodes, numbers_of, strict=True):
        if card.name_of("NSET"):
            _add(mesh, mesh.node_sets, card, card.name_of("NSET"), mesh.positions(own, "node", card))
    return mesh


def _nodes(cards: Sequence[Card]) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return numbers and coordinates of all nodes, and the numbers of each card."""
    if not cards:
        raise DeckError("a deck must have nodes, under *NODE; it has none")
    tables = []
    for card in cards:
        if card.name_of("SYSTEM") not in ("", "R"):
            raise card.error(f"SYSTEM={card.name_of('SYSTEM')} is not read: give coordinates x, y and z")
        if not card.lines:
            raise card.error("needs nodes, it has no data lines: add them, or leave the card out")
        tables.append(card.table(4))
    own = [card.wholes(table[:, 0]) for card, table in zip(cards, tables, strict=True)]
    # The last definition of a node counts.
    numbers, last = np.unique(np.concatenate(own)[::-1], return_index=True)
    return numbers, np.concatenate(tables)[::-1][last, 1:], own


def _elements(mesh: DeckMesh, cards: Sequence[Card]) -> None:
    first = 0
    for card in cards:
        element = element_of(card)
        if not card.lines:
            raise card.error("needs elements, it has no data lines: add them, or leave the card out")
        width = 1 + element.count
        lengths = {len(row) for row in card.rows}
        # Preprocessors add nodes inside, of bubbles, which the other program overlooks.
        if card.name_of("TYPE") == "C3D8I" and len(lengths) == 1 and width < max(lengths) <= width + 3:
            records = card.integers(max(lengths))[:, :width]
        else:
            records = card.integers(width)
        nodes = mesh.positions(records[:, 1:].ravel(), "node", card).reshape(-1, element.count)
        for kind, mine, own in without_repeated(element, nodes, records[:, 0], card):
            mesh.blocks.append(Block(kind, card, records[mine, 0], own, first, mine))
            first += len(mine)
    if not first:
        others = ", ".join(sorted({link.kind for link in mesh.links}))
        raise DeckError(
            "a deck must have elements, solid, plane or axisymmetric ones, under *ELEMENT; it has "
            + (others or "none")
        )
    mesh.element_numbers = np.concatenate([block.numbers for block in mesh.blocks])
    again = np.flatnonzero(np.diff(np.sort(mesh.element_numbers)) == 0)
    if len(again):
        number = np.sort(mesh.element_numbers)[again[0]]
        card = [block.card for block in mesh.blocks if number in block.numbers][-1]
        which = f"element {card.label(number)}"
        raise card.error(f"{which} is there already: give each element a number of its own")


def _add(mesh: DeckMesh, sets: dict[str, np.ndarray], card: Card, name: str, members: np.ndarray) -> None:
    """Add members to a set: one name may be given several times."""
    sets[name] = np.union1d(sets.get(name, members), members)
    mesh.origins.setdefault(name, card)


def _members(mesh: DeckMesh, card: Card, what: str) -> np.ndarray:
    known = mesh.numbers if what == "node" else mesh.element_numbers
    if "GENERATE" in card.parameters:
        return _generated(mesh, card, what, known)
    if what == "node" and card.name_of("ELSET"):
        return nodes_of(mesh, mesh.elements_named(card.name_of("ELSET"), card))
    found, single = [np.zeros(0, dtype=np.int64)], list[int]()
    for row, entries in enumerate(card.rows):
        for entry in entries:
            if entry.isdecimal():
                single.append(_written(entry))
            elif entry:
                if (
                    what == "element"
                    and plain(entry) in mesh.link_sets
                    and plain(entry) not in mesh.element_sets
                ):
                    continue
                named = mesh.nodes_named if what == "node" else mesh.elements_named
                found.append(named(entry, card, row))
    if what == "element":
        links = {link.number for link in mesh.links}
        single = [number for number in single if number not in links]
    return np.concatenate([*found, mesh.positions(np.array(single, dtype=np.int64), what, card)])


def _generated(mesh: DeckMesh, card: Card, what: str, known: np.ndarray) -> np.ndarray:
    """Return what is there of the numbers from, to, by; as in the other programs gaps are allowed."""
    wanted = np.zeros(len(known), dtype=bool)
    for row in range(len(card.rows)):
        first, last, *step = card.floats(row)[:3] if len(card.rows[row]) > 1 else (*card.floats(row), 0)
        by = int(step[0]) if step and step[0] else 1
        if last < first or by < 1:
            raise card.error(
                f"GENERATE needs first ≤ last and an increment > 0, got {card.lines[row].strip()!r}", row
            )
        wanted |= (known >= int(first)) & (known <= int(last)) & ((known - int(first)) % by == 0)
    return np.flatnonzero(wanted)


def nodes_of(mesh: DeckMesh, elements: np.ndarray) -> np.ndarray:
    """Return the ascending positions of the nodes of elements."""
    inside = [
        block.nodes[
            elements[(elements >= block.first) & (elements < block.first + len(block.numbers))] - block.first
        ]
        for block in mesh.blocks
    ]
    return np.unique(np.concatenate([nodes.ravel() for nodes in inside]))


def _surface(mesh: DeckMesh, card: Card) -> Named:
    kind = card.name_of("TYPE") or "ELEMENT"
    if kind == "NODE":
        found = [mesh.nodes_named(row[0], card, k) for k, row in enumerate(card.rows)]
        return Named(card, NO_FACES, np.unique(np.concatenate([NO_NODES, *found])))
    if kind != "ELEMENT":
        raise card.error(f"TYPE must be ELEMENT or NODE, got {kind}: give faces of elements, or nodes")
    parts = []
    for k, row in enumerate(card.rows):
        elements = mesh.elements_named(row[0], card, k)
        label = row[1].upper() if len(row) > 1 else ""
        if not label and all(mesh.blocks[n].element.outer for n in mesh.block_of[elements]):
            parts.append(_outer(mesh, elements))
            continue
        if label[:1] not in ("S", "E"):
            raise card.error(f"needs a face S1, S2, ... behind the elements, got {label or 'nothing'!r}", k)
        parts.append(mesh.faces_of(elements, label, card, k))
    return Named(card, joined(parts), NO_NODES)


def _outer(mesh: DeckMesh, elements: np.ndarray) -> Faces:
    """Return the faces of elements that no other element of the deck shares, as in Abaqus."""
    sides = np.array([block.element.outer for block in mesh.blocks])[mesh.block_of]
    every = np.repeat(np.arange(len(sides)), sides)
    faces = Faces(every, np.arange(len(every)) - np.repeat(np.cumsum(sides) - sides, sides))
    corners = np.full((len(faces), 4), -1)
    for at, element, side, nodes in mesh.parts_of(faces):
        own = nodes[:, : len(element.faces[side])]
        corners[at, : own.shape[1]] = np.sort(own, axis=1)
    _, group, count = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
    mine = np.isin(every, elements) & (count[group.ravel()] == 1) & (corners[:, 0] >= 0)
    return Faces(faces.elements[mine], faces.sides[mine])


def joined(parts: Iterable[Faces]) -> Faces:
    """Return faces of several parts, each once."""
    parts = [NO_FACES, *parts]
    rows = np.column_stack(
        [np.concatenate([each.elements for each in parts]), np.concatenate([each.sides for each in parts])]
    )
    once = np.unique(rows, axis=0)
    return Faces(once[:, 0], once[:, 1])


@dataclass(frozen=True, eq=False)
class MeshCards:
    """The mesh of a deck with other sets, surfaces and sections.

    `elements` and `sets`: positions of elements and of nodes by name.
    """

    mesh: DeckMesh
    elements: Mapping[str, np.ndarray]
    surfaces: Mapping[str, Faces]
    sets: Mapping[str, np.ndarray]
    sections: Sequence[str]

    def text(self) -> str:
        """Return the cards of the mesh."""
        used = np.unique(np.concatenate([block.nodes.ravel() for block in self.mesh.blocks]))
        lines = ["*NODE"]
        lines += [
            f"{number}, {x!r}, {y!r}, {z!r}"
            for number, (x, y, z) in zip(
                self.mesh.numbers[used].tolist(), self.mesh.points[used].tolist(), strict=True
            )
        ]
        for block in self.mesh.blocks:
            lines.append(f"*ELEMENT, TYPE={block.element.name}")
            nodes = block.nodes[:, block.element.written]
            rows = np.column_stack([block.numbers, self.mesh.numbers[nodes]])
            lines += [line for row in rows.tolist() for line in _wrapped(row)]
        for name, members in self.elements.items():
            lines += [f"*ELSET, ELSET={name}", *_wrapped(self.mesh.element_numbers[members].tolist())]
        for name, faces in self.surfaces.items():
            lines.append(f"*SURFACE, NAME={name}, TYPE=ELEMENT")
            numbers = self.mesh.element_numbers[faces.elements].tolist()
            lines += [
                f"{number}, S{side + 1}" for number, side in zip(numbers, faces.sides.tolist(), strict=True)
            ]
        for name, nodes in self.sets.items():
            lines += [f"*NSET, NSET={name}", *_wrapped(self.mesh.numbers[nodes].tolist())]
        return "\n".join([*lines, *self.sections, ""])


def _wrapped(numbers: Sequence[int], most: int = 12) -> list[str]:
    """Return numbers on lines, each but the last with a comma at its end."""
    lines = [", ".join(map(str, numbers[k : k + most])) for k in range(0, len(numbers), most)]
    return [*(f"{line}," for line in lines[:-1]), lines[-1]]
