"""Local axes of nodes, and those of orientations at points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.decks.steps import DeckSteps
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class LocalAxes:
    """Axes of some nodes along which components are counted.

    `rows`: position of a node -> its axes as rows; `on_axis`: cards of cylinders, and nodes on the axis,
    where no direction is the radial one.
    """

    mesh: DeckMesh
    rows: Mapping[int, np.ndarray]
    on_axis: Sequence[tuple[Card, np.ndarray]]

    def turned(self, nodes: np.ndarray) -> np.ndarray:
        """Return which nodes have axes of their own, (n,)."""
        return np.isin(nodes, np.fromiter(self.rows, dtype=np.int64))

    def of(self, node: int) -> np.ndarray:
        """Return the axes of a node as rows."""
        return self.rows.get(node, np.eye(3))

    def check(self, steps: DeckSteps) -> None:
        """Reject nodes on the axis of a cylinder that are held or loaded along one direction across it."""
        for card, nodes in self.on_axis:
            for instant in steps.instants:
                held, force = instant.held[nodes, :2], instant.forces[nodes, :2]
                wrong = np.isnan(held[:, 0]) != np.isnan(held[:, 1])
                wrong |= np.nan_to_num(held).any(axis=1) | force.any(axis=1)
                if wrong.any():
                    node = self.mesh.numbers[nodes[wrong][0]]
                    raise card.error(f"node {node} is on the axis of the cylinder: hold 1 and 2 at zero")


def read_axes(cards: Sequence[Card], mesh: DeckMesh) -> LocalAxes:
    """Return the local axes of nodes."""
    found: dict[int, np.ndarray] = {}
    on_axis = []
    for card in cards:
        if card.name != "TRANSFORM":
            continue
        nodes = mesh.nodes_named(card.required("NSET"), card)
        kind = card.name_of("TYPE") or "R"
        numbers = card.floats(0) if card.lines else []
        if kind not in ("R", "C") or len(numbers) < 6:
            raise card.error("needs TYPE=R or C and a line with two points: complete it")
        first, second = np.array(numbers[:3]), np.array(numbers[3:6])
        if kind == "R":
            axes = np.tile(_frame(first, second), (len(nodes), 1, 1))
        else:
            axes, near = _around(mesh.points[nodes], first, second)
            on_axis.append((card, nodes[near]))
        found.update(zip(nodes.tolist(), axes, strict=True))
    return LocalAxes(mesh, found, on_axis)


def _frame(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return orthonormal axes: the first direction, and one in the plane of both."""
    x = first / np.linalg.norm(first)
    z = np.cross(first, second)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def _around(points: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axes of points around the line through two others, (n, 3, 3), and which points are on it."""
    along = (second - first) / np.linalg.norm(second - first)
    arms = points - first
    out = arms - np.outer(arms @ along, along)
    size = np.linalg.norm(out, axis=1)
    # On the axis any direction serves as the radial one where both across it are held alike.
    near = size <= 1e-9 * np.abs(arms).max()
    out[near] = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    out /= np.linalg.norm(out, axis=1)[:, None]
    return np.stack([out, np.cross(along, out), np.tile(along, (len(points), 1))], axis=1), near


def oriented(by: Card, orientations: Mapping[str, Card], points: np.ndarray) -> np.ndarray:
    """Return the axes of the ORIENTATION of a card at points as rows, (n, 3, 3).

    Raises:
        DeckError: If it is not there or has no two points.
    """
    card = by.known("orientation", by.name_of("ORIENTATION"), orientations)
    numbers = card.floats(0) if card.lines else []
    kind = (card.name_of("SYSTEM") or "RECTANGULAR")[:1]
    if len(numbers) < 6 or len(card.lines) > 1 or kind not in ("R", "C"):
        raise card.error("needs one line with two points here, and SYSTEM=RECTANGULAR or CYLINDRICAL", 0)
    first, second = np.array(numbers[:3]), np.array(numbers[3:6])
    if not np.cross(first, second).any() if kind == "R" else np.array_equal(first, second):
        raise card.error("needs two points in different directions, or on an axis: correct them", 0)
    if kind == "R":
        return np.tile(_frame(first, second), (len(points), 1, 1))
    return _around(points, first, second)[0]


def in_global_axes(values: np.ndarray, axes: Mapping[int, np.ndarray]) -> np.ndarray:
    """Return forces of nodes, (n_nodes, 6), with those of nodes with local axes along x, y and z."""
    if not axes:
        return values
    result, nodes = values.copy(), np.fromiter(axes, dtype=np.int64)
    turn = np.stack([axes[node] for node in nodes.tolist()])
    result[nodes, :3] = np.einsum("nad,na->nd", turn, values[nodes, :3])
    return result
