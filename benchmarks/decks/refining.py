"""Decks with each hexahedron cut into eight: where both programs go as cells shrink.

Cells of 8 and 20 nodes are cut, with the faces of surfaces and pressures on them, and sets of nodes get the
new nodes between their members. Forces on single nodes stay where they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    dtype=np.float64,
)
_EDGES = np.array(
    [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
)
_NODES = np.vstack([_CORNERS, _CORNERS[_EDGES].mean(axis=1)])
#: Axis and side of faces 1 to 6.
_FACES = ((2, -1), (2, 1), (1, -1), (0, 1), (1, 1), (0, -1))
#: Weights of corners are multiples of one over this.
_PARTS = 64


@dataclass(frozen=True)
class _Block:
    """The data lines of an element card.

    Attributes:
        nodes: Node numbers, shape (n, 8 | 20).
        first: Number of the first of its cells of half the size; those of an element follow each other.
    """

    numbers: np.ndarray
    nodes: np.ndarray
    first: int


def refined(text: str) -> str:
    """Return the deck with each of its hexahedra cut into eight.

    Raises:
        ValueError: If it has other elements.
    """
    cards = list(_cards(text))
    places = {
        int(number): [float(value) for value in values[:3]]
        for head, rows in cards if _name(head) == "*NODE"
        for number, *values in rows
    }  # fmt: skip
    blocks, number = {}, 1
    for k, (head, rows) in enumerate(cards):
        if _name(head) == "*ELEMENT":
            kind = _parameters(head)["TYPE"]
            if not re.match(r"C3D(8|20)R?$", kind):
                raise ValueError(f"only hexahedra are cut into eight, the deck has {kind}")
            width = 21 if "20" in kind else 9
            table = np.array([int(v) for row in rows for v in row if v]).reshape(-1, width)
            blocks[k] = _Block(table[:, 0], table[:, 1:], number)
            number += 8 * len(table)
    return _Refinement(places, blocks).text(cards, _element_sets(cards, blocks))


class _Refinement:
    """The new nodes and cells of a deck."""

    def __init__(self, places: dict[int, list[float]], blocks: dict[int, _Block]) -> None:
        keys, points, shapes = [], [], []
        known, numbers = np.array(sorted(places)), []
        coordinates = np.array([places[number] for number in known])
        for block in blocks.values():
            quadratic = block.nodes.shape[1] == 20
            at = _children(_NODES if quadratic else _CORNERS).reshape(-1, 3)
            here = coordinates[np.searchsorted(known, block.nodes)]
            keys += [_keys(block.nodes, at), _keys(block.nodes, _NODES[: block.nodes.shape[1]])]
            points += [np.einsum("pk,nkd->npd", _functions(at, quadratic), here).reshape(-1, 3)]
            points += [here.reshape(-1, 3)]
            numbers += [np.full(len(keys[-2]), -1), block.nodes.ravel()]
            shapes += [(len(block.nodes), 8, block.nodes.shape[1]), (0,)]
        free = ~np.isin(known, np.concatenate([block.nodes.ravel() for block in blocks.values()]))
        alone = np.zeros((np.count_nonzero(free), 8), dtype=np.int64)  # nodes of no element stay
        alone[:, -1] = known[free] * (_PARTS + 1) + _PARTS
        keys, points, numbers = [*keys, alone], [*points, coordinates[free]], [*numbers, known[free]]
        self.key, first, inverse = np.unique(
            np.concatenate(keys), axis=0, return_index=True, return_inverse=True
        )
        self.points = np.concatenate(points)[first]
        self.number = np.full(len(self.key), -1)
        of = np.concatenate(numbers)
        self.number[inverse.ravel()[of >= 0]] = of[of >= 0]
        new = self.number < 0
        self.largest = int(known.max())
        self.number[new] = self.largest + 1 + np.arange(np.count_nonzero(new))
        cells = np.split(self.number[inverse.ravel()], np.cumsum([len(key) for key in keys])[:-1])
        self.blocks = blocks
        self.cells = {k: cells[2 * i].reshape(shapes[2 * i]) for i, k in enumerate(blocks)}
        self.first = {
            int(number): block.first + 8 * k
            for block in blocks.values()
            for k, number in enumerate(block.numbers)
        }

    def text(self, cards: list[tuple[str, list[list[str]]]], sets: dict[str, list[int]]) -> str:
        """Return the deck; its first card of nodes has all new ones."""
        lines, first = [], next(k for k, (head, _) in enumerate(cards) if _name(head) == "*NODE")
        for k, (head, rows) in enumerate(cards):
            name, nodes = _name(head), rows
            if name == "*NODE":
                old = {int(row[0]) for row in rows}
                new = self.number > self.largest if k == first else np.zeros(len(self.number), dtype=bool)
                chosen = np.flatnonzero(new | np.isin(self.number, list(old)))
                places = zip(self.number[chosen], self.points[chosen], strict=True)
                nodes = [[str(number), *(f"{x:.12g}" for x in point)] for number, point in places]
            elif name == "*ELEMENT":
                block = self.blocks[k]
                numbers = block.first + np.arange(8 * len(block.numbers))
                table = np.column_stack([numbers, self.cells[k].reshape(len(numbers), -1)])
                nodes = [part for row in table for part in _broken([str(v) for v in row])]
            elif name == "*NSET":
                nodes = [[f"{number}", ""] for number in self._between(_members(head, rows))]
                head = re.sub(r", *GENERATE", "", head, flags=re.IGNORECASE)
            elif name == "*ELSET" and all(v.isdigit() for row in rows for v in row if v):
                nodes = [[f"{n}", ""] for e in _members(head, rows) for n in self._eighths(e)]
                head = re.sub(r", *GENERATE", "", head, flags=re.IGNORECASE)
            elif name in ("*SURFACE", "*DLOAD"):
                nodes = [each for row in rows for each in self._on_faces(row, sets)]
            lines += [head, *(", ".join(row) for row in nodes)]
        return "\n".join(lines) + "\n"

    def _between(self, members: list[int]) -> np.ndarray:
        """Return the nodes between members alone; of a single one itself."""
        corner = self.key // (_PARTS + 1)
        inside = (np.isin(corner, members) | (self.key == 0)).all(axis=1)
        return np.sort(self.number[inside | np.isin(self.number, members)])

    def _eighths(self, element: int, face: int | None = None) -> np.ndarray:
        own = self.first[element] + np.arange(8)
        if face is None:
            return own
        axis, side = _FACES[face]
        return own[_CORNERS[:, axis] == side]

    def _on_faces(self, row: list[str], sets: dict[str, list[int]]) -> list[list[str]]:
        """Return the lines of the parts of a face, of those of all elements of a set."""
        found = re.match(r"[SP]([1-6])$", row[1].upper()) if len(row) > 1 else None
        if not found:
            return [row]
        members = [int(row[0])] if row[0].isdigit() else sets[row[0].upper()]
        return [[str(n), *row[1:]] for e in members for n in self._eighths(e, int(found[1]) - 1)]


def _element_sets(
    cards: list[tuple[str, list[list[str]]]], blocks: dict[int, _Block]
) -> dict[str, list[int]]:
    """Return the elements of all sets, also of sets of sets."""
    sets: dict[str, list[int]] = {}
    for k, (head, rows) in enumerate(cards):
        name = _parameters(head).get("ELSET", "")
        if k in blocks and name:
            sets.setdefault(name, []).extend(blocks[k].numbers.tolist())
        elif _name(head) == "*ELSET":
            named = [n for row in rows for v in row if v and not v.isdigit() for n in sets[v.upper()]]
            plain = [[v for v in row if v.isdigit()] for row in rows]
            sets.setdefault(name, []).extend(named or _members(head, plain))
    return sets


def _cards(text: str) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield the cards with their data lines, without comments."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("**")]
    starts = [k for k, line in enumerate(lines) if line.startswith("*")]
    for begin, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        yield lines[begin], [[v.strip() for v in line.split(",")] for line in lines[begin + 1 : end]]


def _name(head: str) -> str:
    return head.split(",")[0].strip().upper()


def _parameters(head: str) -> dict[str, str]:
    pairs = (part.partition("=") for part in head.split(",")[1:])
    return {key.strip().upper(): value.strip().upper() for key, _, value in pairs}


def _members(head: str, rows: list[list[str]]) -> list[int]:
    numbers = [[int(v) for v in row if v] for row in rows]
    if "GENERATE" in _parameters(head):
        return [n for row in numbers for n in range(row[0], row[1] + 1, *row[2:])]
    return [n for row in numbers for n in row]


def _broken(row: list[str]) -> list[list[str]]:
    """Return the lines of an element."""
    return [row] if len(row) <= 11 else [[*row[:11], ""], row[11:]]


def _children(nodes: np.ndarray) -> np.ndarray:
    """Return the places of the nodes of the eight cells in the one that is cut, shape (8, nodes, 3)."""
    return (nodes + _CORNERS[:, None]) / 2.0


def _keys(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return corners and their weights at places of cells, sorted, (n_cells · places, 8)."""
    weight = np.rint(_PARTS * np.prod(1.0 + _CORNERS * at[:, None], axis=2) / 8.0).astype(np.int64)
    both = nodes[:, None, :8] * (_PARTS + 1) + weight
    return np.sort(np.where(weight > 0, both, 0), axis=2).reshape(-1, 8)


def _functions(at: np.ndarray, quadratic: bool) -> np.ndarray:
    """Return the shape functions of cells of 8 or 20 nodes, shape (places, nodes)."""
    linear = np.prod(1.0 + _CORNERS * at[:, None], axis=2) / 8.0
    if not quadratic:
        return np.asarray(linear)
    corner = linear * ((_CORNERS * at[:, None]).sum(axis=2) - 2.0)
    middle = _NODES[8:]
    along = np.where(middle == 0.0, 1.0 - at[:, None] ** 2, 1.0 + middle * at[:, None])
    return np.concatenate([corner, np.prod(along, axis=2) / 4.0], axis=1)
