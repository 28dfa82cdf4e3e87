"""Shells of a deck as one layer of solid cells, as CalculiX expands them.

At a node the normals of elements that differ by less than 20 degrees, and have equal thickness and offset,
have one mean: these elements share the nodes across the thickness. Others have nodes of their own there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.mesh.thin_bodies import CORNERS, facet_normals, layer_cells, raised
from fenics_contact.readers.deck_beams import with_beams
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_elements import Layer
from fenics_contact.readers.deck_mesh import Block, DeckMesh, read_mesh_cards
from fenics_contact.readers.deck_plies import plies_of
from fenics_contact.readers.deck_shell_nodes import ShellNodes, first_come


def read_solid_mesh(cards: Sequence[Card]) -> DeckMesh:
    """Return nodes, elements, sets and surfaces of a deck, with solid cells in place of shells and beams."""
    mesh = read_mesh_cards(cards)
    blocks = [k for k, block in enumerate(mesh.blocks) if block.element.kind == "shell"]
    return with_beams(_expanded(mesh, blocks, _Depths.of(mesh, cards, blocks)) if blocks else mesh, cards)


def _expanded(mesh: DeckMesh, places: Sequence[int], depths: _Depths) -> DeckMesh:
    """Return the mesh with the shells of some blocks as solid cells; their nodes stay as they are."""
    points, facets, sources = raised(mesh.points, [mesh.blocks[k].nodes for k in places])
    incidences = _Incidences.of(points, facets, [mesh.blocks[k] for k in places], depths, sources)
    group, sign = incidences.grouped()
    shells, added = incidences.ends(points, sources, group, sign)
    blocks, first = list(mesh.blocks), 0
    for place, own in zip(places, facets, strict=True):
        mine, turned = (each[first : first + own.size].reshape(own.shape) for each in (group, sign < 0))
        first += own.size
        low, middle, top = np.moveaxis(shells.ends[mine], 2, 0)
        lower, upper = np.where(turned, top, low), np.where(turned, low, top)
        cells = layer_cells(lower, upper, middle[:, : CORNERS[own.shape[1]]])
        blocks[place] = replace(blocks[place], element=Layer.of(blocks[place].element), nodes=cells)
    return mesh.expanded(np.vstack([points, added]), blocks, shells)


@dataclass(frozen=True, eq=False)
class _Depths:
    """Thickness and offset of elements, and the thickness of nodes, where it is theirs; NaN without one."""

    thickness: np.ndarray
    offset: np.ndarray
    by_node: np.ndarray
    varies: np.ndarray

    @classmethod
    def of(cls, mesh: DeckMesh, cards: Sequence[Card], places: Sequence[int]) -> _Depths:
        """Read those of the shells of some blocks."""
        shells = np.isin(mesh.block_of, places)
        thickness, offset = np.full((2, len(shells)), np.nan)
        by_node, varies = np.full(len(mesh.points), np.nan), np.zeros(len(shells), dtype=bool)
        for card in cards:
            if card.name == "NODALTHICKNESS":
                for row, entries in enumerate(card.rows):
                    nodes = mesh.nodes_named(entries[0], card, row)
                    by_node[nodes] = _positive(card, row, card.floats(row, 1))
            elif card.name == "SHELLSECTION":
                elements = mesh.of_section(card, shells, "shell")
                varies[elements] = "NODALTHICKNESS" in card.parameters
                plies = plies_of(card)
                given = [sum(p.thickness for p in plies)] if plies else card.floats(0) if card.lines else []
                thickness[elements] = 1.0 if varies[elements].any() else _positive(card, 0, given)
                sides = {"SPOS": 0.5, "SNEG": -0.5}
                name = card.name_of("OFFSET")
                offset[elements] = sides[name] if name in sides else card.number_of("OFFSET")
        found = cls(thickness, offset, by_node, varies)
        for place in places:
            found._check(mesh, mesh.blocks[place])
        return found

    def _check(self, mesh: DeckMesh, block: Block, least: float = 1e-7) -> None:
        """Refuse shells without a thickness, or with ``least`` of their size, whose bending is rounding."""
        mine = slice(block.first, block.first + len(block.nodes))
        lost = np.flatnonzero(np.isnan(self.thickness[mine]))
        if len(lost):
            number = block.card.label(block.numbers[lost[0]])
            raise block.card.error(f"element {number} has no *SHELL SECTION with a thickness: add it")
        bare = block.nodes[self.varies[mine]]
        bare = bare[np.isnan(self.by_node[bare])]
        if len(bare):
            number = block.card.label(mesh.numbers[bare[0]])
            raise block.card.error(f"node {number} has no *NODAL THICKNESS, which its section names: add it")
        size = np.ptp(mesh.points[block.nodes], axis=1).max(axis=1)
        thin = np.flatnonzero(self.thickness[mine] < least * size)
        if len(thin):
            number = block.card.label(block.numbers[thin[0]])
            words = f"element {number} is {size[thin[0]]:g} long and {self.thickness[mine][thin[0]]:g} thick"
            raise block.card.error(f"{words}: it bends within rounding; give more, or load the face below it")


def _positive(card: Card, row: int, given: Sequence[float]) -> float:
    if not given or not given[0] > 0:
        got = f"{given[0]:g}" if given else "none"
        raise card.error(f"the thickness must be above zero, got {got}: give it", row if card.lines else None)
    return given[0]


@dataclass(frozen=True, eq=False)
class _Incidences:
    """Nodes of elements one by one: the node, the normal of the element there, thickness, offset, corner."""

    node: np.ndarray
    normal: np.ndarray
    thickness: np.ndarray
    offset: np.ndarray
    corner: np.ndarray

    @classmethod
    def of(
        cls,
        points: np.ndarray,
        facets: Sequence[np.ndarray],
        blocks: Sequence[Block],
        depths: _Depths,
        sources: np.ndarray,
    ) -> _Incidences:
        """Return those of the facets of blocks."""
        rows = []
        by_node = depths.by_node[sources].mean(axis=1)
        for own, block in zip(facets, blocks, strict=True):
            mine = slice(block.first, block.first + len(own))
            normal = facet_normals(points, own)
            flat = np.flatnonzero(~normal.any(axis=2).all(axis=1))
            if len(flat):
                number = block.card.label(block.numbers[flat[0]])
                raise block.card.error(f"element {number} has no area at one of its nodes: correct the mesh")
            deep = np.where(depths.varies[mine][:, None], by_node[own], depths.thickness[mine][:, None])
            off = np.broadcast_to(depths.offset[mine][:, None], own.shape)
            corner = np.broadcast_to(np.arange(own.shape[1]) < CORNERS[own.shape[1]], own.shape)
            rows.append((own.ravel(), normal.reshape(-1, 3), deep.ravel(), off.ravel(), corner.ravel()))
        return cls(*(np.concatenate(each) for each in zip(*rows, strict=True)))

    def grouped(self, alike: float = np.cos(np.radians(20.0))) -> tuple[np.ndarray, np.ndarray]:
        """Return the number of the direction across the shells that each has, and its sense along it.

        `alike`: cosine of the largest angle between elements that have one direction. Shells that face
        opposite ways have the same direction.
        """

        def cosine(rest: np.ndarray, of: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("nd,nd->n", self.normal[rest], self.normal[of]))

        def fits(rest: np.ndarray, of: np.ndarray) -> np.ndarray:
            found = cosine(rest, of)
            same = (np.abs(found) > alike) & (self.thickness[rest] == self.thickness[of])
            return np.asarray(same & (self.offset[rest] * np.where(found > 0, 1, -1) == self.offset[of]))

        group = first_come(self.node, fits)
        _, first = np.unique(group, return_index=True)
        sign = np.where(cosine(np.arange(len(group)), first[group]) > 0, 1, -1)
        return group, sign

    def ends(
        self, points: np.ndarray, sources: np.ndarray, group: np.ndarray, sign: np.ndarray
    ) -> tuple[ShellNodes, np.ndarray]:
        """Return the nodes across the shells, which follow the points, and their coordinates."""
        start = len(points)
        count = int(group.max()) + 1
        _, first = np.unique(group, return_index=True)
        node, deep = self.node[first], self.thickness[first]
        across = np.zeros((count, 3))
        np.add.at(across, group, sign[:, None] * self.normal)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        corner = np.zeros(count, dtype=bool)
        corner[group[self.corner]] = True
        arm = deep[:, None] * across
        middle = points[node] - self.offset[first, None] * arm
        ends = start + np.arange(2 * count).reshape(2, count)
        inner = np.full(count, -1)
        inner[corner] = start + 2 * count + np.arange(np.count_nonzero(corner))
        added = np.vstack([middle - 0.5 * arm, middle + 0.5 * arm, middle[corner]])
        return ShellNodes(node, np.stack([ends[0], inner, ends[1]], axis=1), sources[node]), added
