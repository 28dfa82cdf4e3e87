"""Beams of a deck as rows of solid cells, as CalculiX expands them.

At a node two elements, one after the other, whose tangents and directions 2 differ by less than 20 degrees,
and which have the same section, share the nodes around it. Others have nodes of their own there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.mesh.thin_bodies import raised
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_elements import Row
from fenics_contact.readers.deck_mesh import Block, DeckMesh
from fenics_contact.readers.deck_shell_nodes import ShellNodes, first_come

#: Places of the nodes around a section, in halves of its size along directions 1 and 2: corners and between.
_AROUND = np.array([[-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0], [1, 1], [0, 1]], dtype=float)
#: Nodes of hexahedra of 20: which node of the element, and which around the section.
_OF_CELL = np.array([
    [0, 0], [2, 0], [2, 2], [0, 2], [0, 6], [2, 6], [2, 4], [0, 4], [1, 0], [2, 1], [1, 2], [0, 1],
    [1, 6], [2, 5], [1, 4], [0, 5], [0, 7], [2, 7], [2, 3], [0, 3],
])  # fmt: skip
#: Derivatives of the functions of three nodes at these.
_SLOPES = np.array([[-1.5, 2.0, -0.5], [-0.5, 0.0, 0.5], [0.5, -2.0, 1.5]])


def with_beams(mesh: DeckMesh, cards: Sequence[Card]) -> DeckMesh:
    """Return a mesh with the beams as solid cells; their nodes stay as they are."""
    places = [k for k, block in enumerate(mesh.blocks) if block.element.kind == "beam"]
    return _expanded(mesh, places, _Sections.of(mesh, cards, places)) if places else mesh


@dataclass(frozen=True, eq=False)
class _Sections:
    """Sections of elements: size and offset along directions 1 and 2, direction 1, whether it is round.

    Sizes are NaN of elements without a section.
    """

    size: np.ndarray
    offset: np.ndarray
    direction: np.ndarray
    is_round: np.ndarray

    @classmethod
    def of(cls, mesh: DeckMesh, cards: Sequence[Card], places: Sequence[int]) -> _Sections:
        """Read those of the beams of some blocks."""
        beams = np.isin(mesh.block_of, places)
        count = len(beams)
        found = cls(
            np.full((count, 2), np.nan),
            np.zeros((count, 2)),
            np.zeros((count, 3)),
            np.zeros(count, dtype=bool),
        )
        for card in cards:
            if card.name == "BEAMSECTION":
                found._read(card, mesh.of_section(card, beams, "beam"))
        for place in places:
            block = mesh.blocks[place]
            lost = np.flatnonzero(np.isnan(found.size[block.first : block.first + len(block.nodes), 0]))
            if len(lost):
                number = block.card.label(block.numbers[lost[0]])
                raise block.card.error(f"element {number} has no *BEAM SECTION with its size: add it")
        return found

    def _read(self, card: Card, elements: np.ndarray) -> None:
        """Keep what a card says of some elements."""
        kind = card.required("SECTION")[:4]
        if kind not in ("RECT", "CIRC"):
            got = card.name_of("SECTION")
            raise card.error(f"SECTION must be RECT or CIRC, got {got}: mesh the part with solid elements")
        given = card.floats(0)[:2] if card.lines else []
        if not given or not min(given) > 0:
            got = " and ".join(f"{each:g}" for each in given) or "none"
            words = f"the size along directions 1 and 2 must be above zero, got {got}: give it"
            raise card.error(words, 0 if card.lines else None)
        along = card.floats(1) if len(card.lines) > 1 else [0.0, 0.0, -1.0]
        if len(along) != 3 or not any(along):
            raise card.error(f"direction 1 must be a vector, got {card.lines[1].strip()!r}: correct it", 1)
        self.size[elements] = given[0], given[-1]
        self.offset[elements] = card.number_of("OFFSET1"), card.number_of("OFFSET2")
        self.direction[elements] = np.array(along) / np.linalg.norm(along)
        self.is_round[elements] = kind == "CIRC"


def _expanded(mesh: DeckMesh, places: Sequence[int], sections: _Sections) -> DeckMesh:
    """Return the mesh with the beams of some blocks as solid cells."""
    blocks = [mesh.blocks[k] for k in places]
    pairs = [block.nodes[:, [0, -1]] for block in blocks if block.element.count == 2]
    points, between, sources = raised(mesh.points, pairs)
    middles = iter(between)
    lines = [block.nodes if block.element.count == 3 else next(middles)[:, [0, 2, 1]] for block in blocks]
    incidences = _Incidences.of(points, lines, blocks, sections)
    group = incidences.grouped()
    ends, added = incidences.around(points, group)
    beams = ShellNodes(ends[0], ends[1], sources[ends[0]])
    found, first = list(mesh.blocks), 0
    for place, own in zip(places, lines, strict=True):
        mine = group[first : first + own.size].reshape(own.shape)
        first += own.size
        cells = ends[1][mine[:, _OF_CELL[:, 0]], _OF_CELL[:, 1]]
        found[place] = replace(found[place], element=Row.of(found[place].element), nodes=cells)
    return mesh.expanded(np.vstack([points, added]), found, beams)


@dataclass(frozen=True, eq=False)
class _Incidences:
    """Nodes of elements one by one: node, tangent and direction 2 there, element, place in this."""

    node: np.ndarray
    tangent: np.ndarray
    second: np.ndarray
    element: np.ndarray
    place: np.ndarray
    sections: _Sections

    @classmethod
    def of(
        cls, points: np.ndarray, lines: Sequence[np.ndarray], blocks: Sequence[Block], sections: _Sections
    ) -> _Incidences:
        """Return those of the lines of blocks, in which the node in the middle is the second one."""
        rows = []
        for own, block in zip(lines, blocks, strict=True):
            element = np.repeat(block.first + np.arange(len(own)), 3)
            tangent = np.einsum("pi,eix->epx", _SLOPES, points[own]).reshape(-1, 3)
            size = np.linalg.norm(tangent, axis=1, keepdims=True)
            tangent = np.divide(tangent, size, out=np.zeros_like(tangent), where=size > 0)
            second = np.cross(tangent, sections.direction[element])
            size = np.linalg.norm(second, axis=1, keepdims=True)
            bad = np.flatnonzero(size[:, 0] < 1e-6)
            if len(bad):
                number = block.card.label(block.numbers[bad[0] // 3])
                raise block.card.error(
                    f"element {number} has no length, or lies along direction 1 of its section, which is "
                    "(0, 0, -1) by default: give another one in the second line of *BEAM SECTION"
                )
            rows.append((own.ravel(), tangent, second / size, element, np.arange(own.size) % 3))
        node, tangent, second, element, place = (np.concatenate(each) for each in zip(*rows, strict=True))
        return cls(node, tangent, second, element, place, sections)

    def grouped(self, alike: float = np.cos(np.radians(20.0))) -> np.ndarray:
        """Return the number of the section that each has; `alike`: as for shells.

        CalculiX lets any number of elements share a section, here a face has two cells at most.
        """
        of, all_of = self.element, self.sections
        kind = np.column_stack([all_of.size[of], all_of.offset[of], all_of.is_round[of]])

        def fits(rest: np.ndarray, first: np.ndarray) -> np.ndarray:
            same = (kind[rest] == kind[first]).all(axis=1) & (
                np.abs(self.place[rest] - self.place[first]) == 2
            )
            for each in (self.tangent, self.second):
                same &= np.einsum("nd,nd->n", each[rest], each[first]) > alike
            next_one = np.flatnonzero(same)[np.unique(self.node[rest[same]], return_index=True)[1]]
            found = rest == first
            found[next_one] = True
            return np.asarray(found)

        return first_come(self.node, fits)

    def around(
        self, points: np.ndarray, group: np.ndarray
    ) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Return the node of each section and the nodes around it, which follow the points, and these."""
        count = int(group.max()) + 1
        _, first = np.unique(group, return_index=True)
        along, across = np.zeros((2, count, 3))
        np.add.at(along, group, self.tangent)
        np.add.at(across, group, self.second)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        across -= np.einsum("nd,nd->n", across, along)[:, None] * along
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        end = np.zeros(count, dtype=bool)
        end[group[self.place != 1]] = True
        node, of = self.node[first], self.element[first]
        sections = self.sections
        size, is_corner = sections.size[of], np.arange(8) % 2 == 0
        half = np.where(sections.is_round[of][:, None] & is_corner, np.sqrt(0.125), 0.5)
        place = half[..., None] * _AROUND - sections.offset[of][:, None]
        axes = np.stack([np.cross(across, along), across], axis=1) * size[..., None]
        there = is_corner | end[:, None]
        ends = np.full((count, 8), -1)
        ends[there] = len(points) + np.arange(np.count_nonzero(there))
        return (node, ends), (points[node][:, None] + place @ axes)[there]
