"""Nodes and elements that *NGEN, *NFILL and *ELGEN make of others, and nodes by angles, as plain cards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_elements import element_of
from fenics_contact.readers.deck_mesh import DeckMesh, read_nodes


def with_generated(cards: Sequence[Card]) -> list[Card]:
    """Return cards of a deck, or of a part, with *NODE and *ELEMENT in place of what generates them."""
    found: list[Card] = []
    for card in cards:
        if card.name in _MADE:
            make, parameters = _MADE[card.name]
            for strange in sorted(set(card.parameters) - parameters):
                there = ", ".join(sorted(parameters))
                raise card.error(f"the parameter {strange} is not read: {there} can be")
            found += make(card, found)
        else:
            found.append(card)
    return found


def _whole(card: Card, row: int, count: int, *defaults: int) -> list[int]:
    """Return the whole numbers at the start of a data line, the last of which may be missing."""
    given = card.rows[row][:count]
    if len(given) < count - len(defaults) or not all(given[: count - len(defaults)]):
        raise card.error(f"needs {count} whole numbers, got {card.lines[row].strip()!r}: complete them", row)
    texts = [*given, *[""] * (count - len(given))]
    missing = [0] * (count - len(defaults)) + list(defaults)
    return [card.whole(text, row) if text else value for text, value in zip(texts, missing, strict=True)]


def _listed(card: Card, name: str, rows: Sequence[tuple[int, Sequence[float]]], **parameters: str) -> Card:
    """Return a card with rows of numbers, each behind the data line that makes it."""
    lines = [", ".join(map(repr, values)) for _, values in rows]
    numbers = [card.numbers[row] for row, _ in rows]
    files = [card.files[row] for row, _ in rows] if card.files else ()
    return replace(card, name=name, parameters=parameters, lines=lines, numbers=numbers, files=files)


def _nodes(card: Card, rows: Sequence[tuple[int, int, np.ndarray]]) -> list[Card]:
    given = {"NSET": card.name_of("NSET")} if card.name_of("NSET") else {}
    return [_listed(card, "NODE", [(row, (number, *at.tolist())) for row, number, at in rows], **given)]


def _from_cylinder(card: Card, before: Sequence[Card]) -> list[Card]:
    """Return nodes along x, y and z, those with SYSTEM=C of a radius, an angle in degrees and z."""
    if card.name_of("SYSTEM") != "C":
        return [card]
    number, radius, angle, z = card.table(4).T
    x, y = radius * np.cos(np.radians(angle)), radius * np.sin(np.radians(angle))
    rows = np.column_stack([x, y, z])
    return _nodes(card, [(k, int(n), at) for k, (n, at) in enumerate(zip(number, rows, strict=True))])


def _along_lines(card: Card, before: Sequence[Card]) -> list[Card]:
    """Return the nodes of *NGEN: evenly on lines, or on arcs of less than 180 degrees, with their ends."""
    mesh, kind, found = read_nodes(before), card.name_of("LINE"), []
    if kind not in ("", "C") or card.name_of("SYSTEM") not in ("", "RC"):
        raise card.error(f"nodes are made on lines and arcs (LINE=C) alone, got {card.given}: list them")
    for row, entries in enumerate(card.rows):
        first, last, by = _whole(card, row, 3, 1)
        count = (last - first) // by if by else 0
        if count < 1 or first + count * by != last:
            raise card.error(f"the increment {by} does not lead from {first} to {last}: correct it", row)
        start, end = _at(mesh, card, row, first), _at(mesh, card, row, last)
        part = np.linspace(0.0, 1.0, count + 1)[:, None]
        points = start + part * (end - start)
        if kind:
            third = entries[3] if len(entries) > 3 else ""
            centre = _at(mesh, card, row, card.whole(third, row)) if third else _three(card.floats(row, 4))
            points = centre + _arc(start - centre, end - centre, part, card, row)
        found += [(row, first + k * by, point) for k, point in enumerate(points)]
    return _nodes(card, found)


def _three(values: Sequence[float]) -> np.ndarray:
    return np.pad(np.array(values[:3], dtype=np.float64), (0, 3 - len(values[:3])))


def _arc(first: np.ndarray, last: np.ndarray, part: np.ndarray, card: Card, row: int) -> np.ndarray:
    """Return points between two of an arc about the origin, (n, 3)."""
    size = np.linalg.norm(first), np.linalg.norm(last)
    if not min(size) > 0.0 or abs(size[0] - size[1]) > 1e-3 * max(size):
        got = f"{size[0]:g}, {size[1]:g}"
        raise card.error(f"both ends of an arc need one distance to its centre, got {got}", row)
    angle = np.arccos(np.clip(first @ last / (size[0] * size[1]), -1.0, 1.0))
    if angle > np.pi * (1.0 - 1e-6):
        raise card.error("an arc must be less than 180 degrees: make two of it", row)
    radius = size[0] + part * (size[1] - size[0])
    turned = np.sin((1.0 - part) * angle) * first / size[0] + np.sin(part * angle) * last / size[1]
    return np.asarray(radius * turned / np.sin(angle))


def _at(mesh: DeckMesh, card: Card, row: int, number: int) -> np.ndarray:
    return np.asarray(mesh.points[mesh.nodes_named(str(number), card, row)[0]])


def _between_sets(card: Card, before: Sequence[Card]) -> list[Card]:
    """Return the nodes of *NFILL: on lines between two sets, which belong to its own."""
    mesh, found = read_nodes(before), []
    for row, entries in enumerate(card.rows):
        if len(entries) < 3:
            raise card.error(f"needs two node sets, intervals and an increment, got {card.lines[row]!r}", row)
        ends = [mesh.nodes_named(name, card, row) for name in entries[:2]]
        intervals = card.whole(entries[2], row)
        by = card.whole(entries[3], row) if len(entries) > 3 and entries[3] else 1
        if len(ends[0]) != len(ends[1]) or intervals < 1:
            raise card.error(
                f"both sets need as many nodes, and lines an interval, got {len(ends[0])} and {len(ends[1])} "
                f"nodes, {intervals} intervals: correct them", row,
            )  # fmt: skip
        first, last = (mesh.points[nodes] for nodes in ends)
        for k in range(intervals):
            numbers = mesh.numbers[ends[0]] + k * by
            points = first + k / intervals * (last - first)
            found += [(row, int(n), point) for n, point in zip(numbers, points, strict=True)]
        found += [(row, int(n), at) for n, at in zip(mesh.numbers[ends[1]], last, strict=True)]
    return _nodes(card, found)


def _in_rows(card: Card, before: Sequence[Card]) -> list[Card]:
    """Return the elements of *ELGEN, in rows and layers of copies of a first one, with it in its set."""
    found, kinds, first = list[tuple[int, list[int]]](), set[str](), list[tuple[int, list[int]]]()
    for row in range(len(card.rows)):
        number, *copies = _whole(card, row, 10, 1, 1, 1, 1, 1, 1, 1, 1, 1)
        master, kind = _element(before, card, row, number)
        counts, nodes, elements = (np.array(copies[k::3]) for k in range(3))
        if counts.min() < 1:
            raise card.error(f"needs one element in a row at least, got {counts.min()}: correct it", row)
        places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)[1:]
        found += [(row, [number + int(p @ elements), *(master + p @ nodes).tolist()]) for p in places]
        kinds.add(kind)
        first.append((row, [number]))
    if len(kinds) != 1:
        raise card.error(f"needs elements of one type, got {sorted(kinds) or 'none'}: make two cards")
    own = {"ELSET": card.name_of("ELSET")} if card.name_of("ELSET") else {}
    made = [_listed(card, "ELEMENT", found, TYPE=kinds.pop(), **own)] if found else []
    return [*made, _listed(card, "ELSET", first, **own)] if own else made


def _element(before: Sequence[Card], card: Card, row: int, number: int) -> tuple[np.ndarray, str]:
    """Return the nodes and the type of an element."""
    for each in reversed(before):
        if each.name == "ELEMENT":
            records = each.integers(1 + element_of(each).count)
            for record in records[records[:, 0] == number]:
                return record[1:], each.name_of("TYPE")
    raise card.error(f"element {number} is not there: correct the number, or add it", row)


#: What makes cards of another one and of those before it, and its parameters.
_MADE: Mapping[str, tuple[Callable[[Card, Sequence[Card]], list[Card]], set[str]]] = {
    "NODE": (_from_cylinder, {"NSET", "SYSTEM"}),
    "NGEN": (_along_lines, {"NSET", "LINE", "SYSTEM"}),
    "NFILL": (_between_sets, {"NSET"}),
    "ELGEN": (_in_rows, {"ELSET"}),
}
