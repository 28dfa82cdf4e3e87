"""What drives surfaces by a node: rigid bodies, couplings and bolts; equations; local axes of nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.supports import RigidSurface
from fenics_contact.decks.steps import DeckSteps, Instant
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import NO_NODES, DeckMesh, Faces


@dataclass(frozen=True, eq=False)
class Driven:
    """A surface that a node drives or loads.

    `surface`: name of the surface in the deck, or "" for nodes; `nodes`: its nodes, none for those of a
    surface or of elements; `node`: position of the node whose displacements, or whose forces, are those of
    its point; `turning`: position of the node whose displacements are its rotation, −1 if `node` has
    rotations; `spread`: whether the surface stays flexible, and only forces are given.
    """

    card: Card
    name: str
    surface: str
    nodes: np.ndarray
    node: int
    turning: int
    spread: bool

    def row(self, values: np.ndarray) -> np.ndarray:
        """Return displacements and rotations, or forces and moments, of the node from those of all, (6,)."""
        turned = values[self.node, 3:] if self.turning < 0 else values[self.turning, :3]
        return np.concatenate([values[self.node, :3], turned])


def read_driven(cards: Sequence[Card], mesh: DeckMesh) -> list[Driven]:
    """Return rigid bodies and couplings."""
    found = []
    for k, card in enumerate(cards):
        if card.name == "RIGIDBODY":
            found.append(_rigid_body(card, mesh))
        elif card.name == "COUPLING":
            if "ORIENTATION" in card.parameters:
                raise card.error("ORIENTATION is not read here: give displacements along x, y and z")
            kind = cards[k + 1] if k + 1 < len(cards) else card
            if kind.name not in ("KINEMATIC", "DISTRIBUTING"):
                raise card.error("must be followed by *KINEMATIC or *DISTRIBUTING: add one")
            held = {c for row in range(len(kind.lines)) for c in _range(kind, row)} or set(range(1, 7))
            if kind.name == "KINEMATIC" and not {1, 2, 3} <= held:
                raise kind.error("a surface moves as one piece where components 1 to 3 are coupled")
            node = mesh.nodes_named(card.required("REFNODE"), card)[0]
            surface = card.required("SURFACE")
            mesh.surface_named(surface, card)
            name = card.name_of("CONSTRAINTNAME") or surface
            found.append(Driven(card, name, surface, NO_NODES, int(node), -1, kind.name == "DISTRIBUTING"))
    return found


def by_node(driven: Sequence[Driven], mesh: DeckMesh) -> list[list[Driven]]:
    """Return what is driven by the same node, which moves as one rigid piece, in the order of the deck."""
    found: dict[int, list[Driven]] = {}
    turned: dict[int, Driven] = {}
    for each in driven:
        others = found.setdefault(each.node, [])
        if others and (each.spread or others[0].spread):
            node = mesh.numbers[each.node]
            raise each.card.error(f"node {node} of a distributing coupling is also of {others[0].name!r}")
        first = turned.setdefault(each.turning, each) if each.turning >= 0 else each
        for other in (*others[:1], first):
            if (other.node, other.turning) != (each.node, each.turning):
                raise each.card.error(
                    f"{each.name!r} must share REF NODE and ROT NODE with {other.name!r}, or neither"
                )
        others.append(each)
    return list(found.values())


def require_own_nodes(users: Sequence[tuple[Card, int]], mesh: DeckMesh) -> None:
    """Reject a node that draws several sections, or is the mean of several sets: what it has is for one."""
    seen = set[int]()
    for card, node in users:
        if node in seen:
            raise card.error(f"node {mesh.numbers[node]} is used by a card before: give each its own")
        seen.add(node)


def _range(card: Card, row: int) -> range:
    numbers = card.wholes(np.array(card.floats(row)), row).tolist()
    return range(numbers[0], (numbers[1] if len(numbers) > 1 and numbers[1] else numbers[0]) + 1)


def _rigid_body(card: Card, mesh: DeckMesh) -> Driven:
    if card.name_of("NSET"):
        nodes = mesh.nodes_named(card.name_of("NSET"), card)
        name = card.name_of("NSET")
    else:
        name = card.required("ELSET")
        nodes = NO_NODES
    node = int(mesh.nodes_named(card.required("REFNODE"), card)[0])
    turning = int(mesh.nodes_named(card.name_of("ROTNODE"), card)[0]) if card.name_of("ROTNODE") else -1
    return Driven(card, name, "", nodes, node, turning, False)


def rigid_surface(driven: Driven, body: str, surface: str, at: np.ndarray, instant: Instant) -> RigidSurface:
    """Return the rigid surface of a node at a time."""
    dim = len(at)
    turns = [3, 4, 5] if dim == 3 else [5]
    held, force = driven.row(instant.held), driven.row(instant.forces)
    free = np.isnan(held)
    motion = [None if loose else float(value) for value, loose in zip(held, free, strict=True)]
    load = np.where(free, force, 0.0).tolist()
    turned, moment = tuple(motion[k] for k in turns), tuple(load[k] for k in turns)
    return RigidSurface(
        body,
        surface,
        tuple(at.tolist()),
        tuple(motion[:dim]),
        turned if dim == 3 else turned[0],
        tuple(load[:dim]) if any(load[:dim]) else None,
        (moment if dim == 3 else moment[0]) if any(moment) else None,
    )


@dataclass(frozen=True, eq=False)
class Bolt:
    """A pre-tension section: faces through a body, and the node that draws them together.

    `sense`: −1 where its normal points into the elements of the faces: what the node has presses apart.
    """

    card: Card
    name: str
    faces: Faces
    node: int
    sense: float


def read_bolts(cards: Sequence[Card], mesh: DeckMesh) -> list[Bolt]:
    """Return the pre-tension sections of a deck."""
    found = []
    for card in cards:
        if card.name == "PRE-TENSIONSECTION":
            name = card.required("SURFACE")
            given = mesh.surface_named(name, card)
            if len(given.nodes):
                raise card.error(f"needs a surface of faces, {name!r} has nodes: give TYPE=ELEMENT")
            node = int(mesh.nodes_named(card.required("NODE"), card)[0])
            found.append(Bolt(card, name, given.faces, node, _sense(card, mesh, given.faces)))
    return found


def _sense(card: Card, mesh: DeckMesh, faces: Faces) -> float:
    """Return whether the normal of a section, if it is given, points out of the elements of its faces."""
    if not card.lines:
        return 1.0
    outward = np.zeros(3)
    for rows, element, side, _ in mesh.parts_of(faces):
        block = mesh.blocks[mesh.block_of[faces.elements[rows[0]]]]
        nodes = mesh.points[block.nodes[faces.elements[rows] - block.first]]
        outward += (nodes[:, list(element.faces[side])].mean(axis=1) - nodes.mean(axis=1)).sum(axis=0)
    return -1.0 if np.array([*card.floats(0), 0.0, 0.0, 0.0])[:3] @ outward < 0.0 else 1.0


def drawn(bolt: Bolt, held: Preload, instant: Instant, before: Instant) -> Iterator[Preload]:
    """Yield how a bolt is drawn at a time, nothing where it is held at its length."""
    shortening, force = instant.held[bolt.node, 0], instant.forces[bolt.node, 0]
    if np.isnan(shortening):
        yield replace(held, force=bolt.sense * float(force))
    elif before.held[bolt.node, 0] != shortening and not instant.fixed[bolt.node, 0]:
        yield replace(held, shortening=bolt.sense * float(shortening))


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
            along = (second - first) / np.linalg.norm(second - first)
            arms = mesh.points[nodes] - first
            out = arms - np.outer(arms @ along, along)
            size = np.linalg.norm(out, axis=1)
            # On the axis any direction serves as the radial one where both across it are held alike.
            near = size <= 1e-9 * np.abs(arms).max()
            on_axis.append((card, nodes[near]))
            out[near] = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
            out /= np.linalg.norm(out, axis=1)[:, None]
            axes = np.stack([out, np.cross(along, out), np.tile(along, (len(nodes), 1))], axis=1)
        found.update(zip(nodes.tolist(), axes, strict=True))
    return LocalAxes(mesh, found, on_axis)


def _frame(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return orthonormal axes: the first direction, and one in the plane of both."""
    x = first / np.linalg.norm(first)
    z = np.cross(first, second)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def in_global_axes(values: np.ndarray, axes: Mapping[int, np.ndarray]) -> np.ndarray:
    """Return forces of nodes, (n_nodes, 6), with those of nodes with local axes along x, y and z."""
    if not axes:
        return values
    result, nodes = values.copy(), np.fromiter(axes, dtype=np.int64)
    turn = np.stack([axes[node] for node in nodes.tolist()])
    result[nodes, :3] = np.einsum("nad,na->nd", turn, values[nodes, :3])
    return result
