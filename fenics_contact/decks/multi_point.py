"""Equations between components of nodes of a deck, with its multi-point constraints and means."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact.readers.deck_cards import AtLine, Card
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class Equation(AtLine):
    """A linear equation between components, from zero, of nodes: Σ c u = 0."""

    card: Card
    row: int
    nodes: tuple[int, ...]
    components: tuple[int, ...]
    factors: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Rows:
    """Many equations Σ c u = 0: the number of the equation, node, component and factor of each term."""

    number: np.ndarray
    node: np.ndarray
    component: np.ndarray
    factor: np.ndarray

    @property
    def columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Number, node, component and factor."""
        return self.number, self.node, self.component, self.factor

    @classmethod
    def of(cls, matrix: sp.csr_matrix, given: sp.csr_matrix) -> Rows:
        """Return A u = B v of displacements u of all nodes, and v with rotations, a row each."""
        left, right = matrix.tocoo(), given.tocoo()
        return cls(
            np.append(left.row, right.row).astype(np.int64),
            np.append(left.col // 3, right.col // 6).astype(np.int64),
            np.append(left.col % 3, right.col % 6).astype(np.int64),
            np.append(left.data, -right.data),
        )

    @classmethod
    def joined(cls, parts: Iterable[Rows]) -> Rows:
        """Return all of several, which are numbered anew."""
        parts = [each for each in parts if len(each.number)]
        ends = np.cumsum([0, *(each.number.max() + 1 for each in parts)])
        number = [each.number + start for each, start in zip(parts, ends, strict=False)]
        names = ("node", "component", "factor")
        rest = ([getattr(NO_ROWS, n), *(getattr(each, n) for each in parts)] for n in names)
        return cls(np.concatenate([NO_ROWS.number, *number]), *map(np.concatenate, rest))

    @classmethod
    def of_equations(cls, equations: Sequence[Equation]) -> Rows:
        """Return equations as rows."""
        number = np.repeat(np.arange(len(equations)), [len(each.nodes) for each in equations])
        node, component, factor = (
            np.array([entry for each in equations for entry in getattr(each, name)], dtype=kind)
            for name, kind in (("nodes", np.int64), ("components", np.int64), ("factors", np.float64))
        )
        return cls(number, node, component, factor)


_NONE = np.zeros(0, dtype=np.int64)
NO_ROWS = Rows(_NONE, _NONE, _NONE, np.zeros(0))


def read_equations(cards: Sequence[Card], mesh: DeckMesh) -> list[Equation]:
    """Return the equations of a deck."""
    found = []
    for card in cards:
        if card.name != "EQUATION":
            continue
        if "REMOVE" in card.parameters:
            raise card.error("REMOVE is not read: leave the equation out")
        row = 0
        while row < len(card.rows):
            first, count = row, card.whole(card.rows[row][0], row)
            if count < 1:
                raise card.error(f"needs the number of its terms, got {card.rows[row][0]!r}: correct it", row)
            entries: list[str] = []
            while len(entries) < 3 * count:
                row += 1
                if row == len(card.rows):
                    raise card.error(f"needs {count} terms of node, component and factor", first)
                entries += [entry for entry in card.rows[row] if entry]
            nodes = [mesh.nodes_named(token, card, row) for token in entries[: 3 * count : 3]]
            several = {len(each) for each in nodes} - {1}
            if len(several) > 1 or 0 in several:
                raise card.error(
                    f"its sets must have as many nodes, some, got {sorted(several)}: correct them", row
                )
            numbers = [card.number(token, row) for token in entries[2 : 3 * count : 3]]
            parts = [card.whole(token, row) - 1 for token in entries[1 : 3 * count : 3]]
            if not all(0 <= part < 6 for part in parts):
                raise card.error(f"components must be from 1 to 6, got {1 + min(parts)}: correct them", row)
            columns = np.broadcast_arrays(*nodes)
            found += [
                Equation(card, first, own, tuple(parts), tuple(numbers))
                for own in zip(*(each.tolist() for each in columns), strict=True)
                if any(np.bincount(parts, numbers)) or len(set(own)) > 1  # a node of a set with itself
            ]
            row += 1
    return found


@dataclass(frozen=True, eq=False)
class Mean:
    """A node that moves as the weighted mean of others, weights of sum one; these share its forces."""

    card: Card
    node: int
    nodes: np.ndarray
    weights: np.ndarray


def read_means(cards: Sequence[Card], mesh: DeckMesh) -> list[Mean]:
    """Return the distributing couplings by elements."""
    found = []
    for card in cards:
        if card.name != "DISTRIBUTINGCOUPLING":
            continue
        name = card.required("ELSET")
        means = [link for link in mesh.link_sets.get(name, []) if link.kind == "DCOUP3D"]
        if not means:
            raise card.error(f"needs ELSET= a set with an element of type DCOUP3D, got {name!r}: add one")
        sums = np.zeros(len(mesh.points))
        for row, entries in enumerate(card.rows):
            sums[mesh.nodes_named(entries[0], card, row)] += (card.floats(row, 1) or [1.0])[0]
        nodes = np.flatnonzero(sums)
        if not len(nodes) or (sums < 0.0).any():
            raise card.error("needs nodes or sets with weights above zero: add them")
        for link in means:
            node = int(mesh.positions(np.array(link.nodes), "node", link.card, link.row)[0])
            found.append(Mean(card, node, nodes, sums[nodes] / sums.sum()))
    return found


def mean_equations(means: Sequence[Mean], held: np.ndarray) -> list[Equation]:
    """Return the equations of means whose nodes are held; `held`: marks of components, (n_nodes, 6)."""
    return [
        Equation(
            each.card, 0, (*each.nodes.tolist(), each.node), (k,) * (len(each.nodes) + 1),
            (*each.weights.tolist(), -1.0),
        )
        for each in means
        for k in np.flatnonzero(held[each.node, :3]).tolist()
    ]  # fmt: skip


def shared_out(values: np.ndarray, means: Sequence[Mean]) -> np.ndarray:
    """Return forces of nodes, (n_nodes, 6), with those of means on their nodes."""
    if not means:
        return values
    result = values.copy()
    for each in means:
        if values[each.node, 3:].any():
            raise each.card.error("the node of a distributing coupling takes no moments: give forces")
        result[each.nodes, :3] += np.outer(each.weights, values[each.node, :3])
        result[each.node] = 0.0
    return result


def read_points(cards: Sequence[Card], mesh: DeckMesh, large: bool) -> list[Equation]:
    """Return the multi-point constraints of a deck as equations for small displacements."""
    found = []
    for card in cards:
        for row, entries in _points_of(card) if card.name == "MPC" else ():
            kind = entries[0].upper()
            if kind not in _KINDS:
                raise card.error(
                    f"a multi-point constraint {kind} is not read: give {', '.join(_KINDS)}", row
                )
            if large and kind not in ("PIN", "TIE"):
                raise card.error(f"{kind} is not supported with NLGEOM: use *RIGID BODY", row)
            nodes = np.concatenate([mesh.nodes_named(token, card, row) for token in entries[1:]])
            least, rows_of = _KINDS[kind]
            if len(nodes) < least:
                raise card.error(f"{kind} needs {least} nodes, got {len(nodes)}: complete it", row)
            for own, vectors in rows_of(nodes, mesh.points, (card, row)):
                node, part = np.nonzero(vectors)
                entry = (tuple(own[node].tolist()), tuple(part.tolist()), tuple(vectors[node, part].tolist()))
                found.append(Equation(card, row, *entry))
    return found


#: Nodes of an equation and the vectors that their displacements are multiplied by.
_Row: TypeAlias = tuple[np.ndarray, np.ndarray]


def _points_of(card: Card) -> Iterator[tuple[int, list[str]]]:
    """Yield the constraints of a card, whose lines go on where the next ones begin with a number."""
    entries: list[str] = []
    first = 0
    for row, line in enumerate(card.rows):
        own = [entry for entry in line if entry]
        if entries and own and not own[0].isdecimal():
            yield first, entries
            entries = []
        if not entries:
            first = row
        entries = entries + own
    if entries:
        yield first, entries


def _mean_rotation(nodes: np.ndarray, points: np.ndarray, at: tuple[Card, int]) -> list[_Row]:
    """Return the mean of the rotations of points about their centre, less that of the last node.

    Each is about the axis that the coordinates of the last node give: (a × r)·(u − ū) / |r|² with the arm r
    across the axis.
    """
    turned, axis = np.unique(nodes[:-1]), points[nodes[-1]]
    if not axis.any():
        raise at[0].error("MEANROT needs a last node whose coordinates are the axis, got zeros", at[1])
    axis = axis / np.linalg.norm(axis)
    arms = points[turned] - points[turned].mean(axis=0)
    arms = arms - np.outer(arms @ axis, axis)
    size = np.einsum("nd,nd->n", arms, arms)
    if (size <= 1e-12 * size.max()).any():
        raise at[0].error("MEANROT needs nodes away from the axis through their centre: leave it out", at[1])
    vectors = np.cross(axis, arms) / size[:, None] / len(turned)
    vectors -= vectors.mean(axis=0)
    return [(np.append(turned, nodes[-1]), np.vstack([vectors, [-1.0, 0.0, 0.0]]))]


def _plane(nodes: np.ndarray, points: np.ndarray, at: tuple[Card, int]) -> list[_Row]:
    """Return that nodes stay in the plane of three that are far apart."""
    away = np.linalg.norm(points[nodes] - points[nodes[0]], axis=1)
    second = int(np.argmax(away))
    along = (points[nodes[second]] - points[nodes[0]]) / max(away[second], 1e-300)
    off = np.linalg.norm(np.cross(points[nodes] - points[nodes[0]], along), axis=1)
    first = [0, second, int(np.argmax(off))]
    nodes = np.concatenate([nodes[first], np.delete(nodes, first)])
    base = points[nodes[:3]]
    normal = np.cross(base[1] - base[0], base[2] - base[0])
    size = np.linalg.norm(normal)
    if size <= 1e-9 * np.ptp(base, axis=0).max() ** 2:
        raise at[0].error("PLANE needs three nodes that are not in a line: correct the set", at[1])
    normal /= size
    off = np.abs((points[nodes] - base[0]) @ normal)
    if off.max() > 1e-4 * away[second]:
        raise at[0].error(f"PLANE needs nodes in a plane, one is {off.max():.3g} off: correct the set", at[1])
    others = points[nodes[3:]] - base[0]
    share = np.linalg.lstsq((base[1:] - base[0]).T, others.T, rcond=None)[0].T
    weights = np.column_stack([1.0 - share.sum(axis=1), share])
    return [
        (np.append(nodes[:3], node), np.outer(np.append(-own, 1.0), normal))
        for node, own in zip(nodes[3:], weights, strict=True)
    ]


def _straight(nodes: np.ndarray, points: np.ndarray, at: tuple[Card, int]) -> list[_Row]:
    """Return that nodes stay in the line through the first two."""
    along = points[nodes[1]] - points[nodes[0]]
    length = np.linalg.norm(along)
    if not length:
        raise at[0].error("STRAIGHT needs two first nodes in different places: order them", at[1])
    place = (points[nodes[2:]] - points[nodes[0]]) @ along / length**2
    off = points[nodes[2:]] - points[nodes[0]] - np.outer(place, along)
    if np.abs(off).max() > 1e-4 * length:
        raise at[0].error(f"STRAIGHT needs nodes in a line, one is {np.abs(off).max():.3g} off", at[1])
    across = np.linalg.svd(along[None] / length)[2][1:]
    return [
        (np.append(nodes[:2], node), np.outer([share - 1.0, -share, 1.0], direction))
        for node, share in zip(nodes[2:], place, strict=True)
        for direction in across
    ]


def _distance(nodes: np.ndarray, points: np.ndarray, at: tuple[Card, int]) -> list[_Row]:
    """Return that the distance of two nodes stays."""
    along = points[nodes[1]] - points[nodes[0]]
    if not along.any():
        raise at[0].error("needs two nodes in different places: take PIN", at[1])
    return [(nodes[:2], np.outer([-1.0, 1.0], along / np.linalg.norm(along)))]


def _alike(nodes: np.ndarray, points: np.ndarray, at: tuple[Card, int]) -> list[_Row]:
    """Return that two nodes move alike."""
    return [(nodes[:2], np.outer([1.0, -1.0], axis)) for axis in np.eye(3)]


#: Kinds of multi-point constraints: the least nodes of each, and its equations.
_KINDS = {
    "MEANROT": (4, _mean_rotation), "PLANE": (4, _plane), "STRAIGHT": (3, _straight),
    "BEAM": (2, _distance), "LINK": (2, _distance), "PIN": (2, _alike), "TIE": (2, _alike),
}  # fmt: skip
