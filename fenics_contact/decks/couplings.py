"""What drives surfaces by a node: rigid bodies, couplings and bolts; equations; local axes of nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.supports import RigidSurface
from fenics_contact.decks.steps import DeckSteps, Instant
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import DeckMesh, Faces


@dataclass(frozen=True, eq=False)
class Driven:
    """A surface that a node drives or loads.

    Attributes:
        surface: Name of the surface in the deck, or "" for nodes.
        nodes: Its nodes, or None for those of a surface.
        node: Position of the node whose displacements, or whose forces, are those of its point.
        turning: Position of the node whose displacements are its rotation, −1 if `node` has rotations.
        spread: Whether the surface stays flexible, and only forces are given.
    """

    card: Card
    name: str
    surface: str
    nodes: np.ndarray | None
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
                raise kind.error(
                    "a surface moves as one piece where components 1 to 3 are coupled, got others"
                )
            node = mesh.nodes_named(card.required("REFNODE"), card)[0]
            surface = card.required("SURFACE")
            mesh.surface_named(surface, card)
            name = card.name_of("CONSTRAINTNAME") or surface
            found.append(Driven(card, name, surface, None, int(node), -1, kind.name == "DISTRIBUTING"))
    return found


def by_node(driven: Sequence[Driven], mesh: DeckMesh) -> list[list[Driven]]:
    """Return what is driven by the same node, which moves as one rigid piece, in the order of the deck."""
    found: dict[int, list[Driven]] = {}
    turned: dict[int, Driven] = {}
    for each in driven:
        others = found.setdefault(each.node, [])
        if others and (each.spread or others[0].spread):
            raise each.card.error(
                f"node {mesh.numbers[each.node]} is the reference node of {others[0].name!r}, too, and a "
                "distributing coupling shares its force: give each surface a node of its own, or one surface "
                "of all faces"
            )
        first = turned.setdefault(each.turning, each) if each.turning >= 0 else each
        for other in (*others[:1], first):
            if (other.node, other.turning) != (each.node, each.turning):
                raise each.card.error(
                    f"{each.name!r} shares one of its nodes with {other.name!r}, but not both: surfaces that "
                    "move as one piece need the same REF NODE and the same ROT NODE, others their own"
                )
        others.append(each)
    return list(found.values())


def require_own_nodes(users: Sequence[tuple[Card, int]], mesh: DeckMesh) -> None:
    """Reject a node that draws several sections, or is the mean of several sets: what it has is for one."""
    seen = set[int]()
    for card, node in users:
        if node in seen:
            raise card.error(
                f"node {mesh.numbers[node]} is that of a card before, too, and its force would act twice: "
                "give each a node of its own"
            )
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
        nodes = None
    node = int(mesh.nodes_named(card.required("REFNODE"), card)[0])
    turning = int(mesh.nodes_named(card.name_of("ROTNODE"), card)[0]) if card.name_of("ROTNODE") else -1
    return Driven(card, name, "", nodes, node, turning, False)


def rigid_surface(
    driven: Driven, body: str, surface: str, at: np.ndarray, instant: Instant | None
) -> RigidSurface:
    """Return the rigid surface of a node at a time, at zero before all."""
    dim = len(at)
    turns = [3, 4, 5] if dim == 3 else [5]
    held, force = np.full(6, np.nan), np.zeros(6)
    if instant is not None:
        held, force = driven.row(instant.held), driven.row(instant.forces)
    motion = [None if np.isnan(value) else float(value) for value in held]
    free = np.isnan(held)
    load = np.where(free, force, 0.0)
    turned = tuple(motion[k] for k in turns)
    moments = tuple(float(load[k]) for k in turns)
    return RigidSurface(
        body,
        surface,
        tuple(at.tolist()),
        tuple(motion[:dim]),
        turned if dim == 3 else turned[0],
        tuple(load[:dim].tolist()) if load[:dim].any() else None,
        (moments if dim == 3 else moments[0]) if any(moments) else None,
    )


@dataclass(frozen=True, eq=False)
class Bolt:
    """A pre-tension section: faces through a body, and the node that draws them together.

    Attributes:
        sense: −1 where its normal points into the elements of the faces: what the node has presses apart.
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
            if given.faces is None:
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


def drawn(bolt: Bolt, held: Preload, instant: Instant, before: Instant | None) -> Preload | None:
    """Return how a bolt is drawn in a step, None where it is held at its length."""
    shortening, force = instant.held[bolt.node, 0], instant.forces[bolt.node, 0]
    if not np.isnan(shortening):
        same = before is not None and before.held[bolt.node, 0] == shortening
        if same or instant.fixed[bolt.node, 0]:
            return None
        drawn = bolt.sense * float(shortening)
        return Preload(held.body, held.section, shortening=drawn, name=held.name)
    return Preload(held.body, held.section, force=bolt.sense * float(force), name=held.name)


@dataclass(frozen=True, eq=False)
class Equation:
    """A linear equation between components of nodes, Σ c u = 0.

    Attributes:
        nodes: Positions of the nodes of its terms.
        components: Their components, from zero.
        factors: Their factors.
    """

    card: Card
    row: int
    nodes: tuple[int, ...]
    components: tuple[int, ...]
    factors: tuple[float, ...]


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
                    raise card.error(
                        f"needs {count} terms of node, component and factor: complete them", first
                    )
                entries += [entry for entry in card.rows[row] if entry]
            nodes = [mesh.nodes_named(token, card, row) for token in entries[: 3 * count : 3]]
            if any(len(each) != 1 for each in nodes):
                raise card.error("needs single nodes, got a set of several: write an equation for each", row)
            numbers = [card.number(token, row) for token in entries[2 : 3 * count : 3]]
            parts = [card.whole(token, row) - 1 for token in entries[1 : 3 * count : 3]]
            if not all(0 <= part < 6 for part in parts):
                raise card.error(f"components must be from 1 to 6, got {1 + min(parts)}: correct them", row)
            found.append(Equation(card, first, tuple(int(n[0]) for n in nodes), tuple(parts), tuple(numbers)))
            row += 1
    return found


@dataclass(frozen=True, eq=False)
class LocalAxes:
    """Axes of some nodes along which components are counted.

    Attributes:
        nodes: Positions of the nodes.
        axes: Their axes as rows, (n, 3, 3).
        card: The card, and a constant part of the axes: 0 to 2 for all nodes alike, else only the third.
    """

    nodes: np.ndarray
    axes: np.ndarray
    card: Card


def read_axes(cards: Sequence[Card], mesh: DeckMesh, steps: DeckSteps) -> dict[int, np.ndarray]:
    """Return the local axes of nodes by their positions, as rows."""
    found: dict[int, np.ndarray] = {}
    for card in cards:
        if card.name != "TRANSFORM":
            continue
        nodes = mesh.nodes_named(card.required("NSET"), card)
        kind = card.name_of("TYPE") or "R"
        numbers = card.floats(0) if card.lines else []
        if kind not in ("R", "C") or len(numbers) < 6:
            raise card.error("needs TYPE=R or C and a line with two points: complete it")
        first, second = np.array(numbers[:3]), np.array(numbers[3:6])
        points = mesh.points[nodes]
        if kind == "R":
            axes = np.tile(_frame(first, second), (len(nodes), 1, 1))
        else:
            along = (second - first) / np.linalg.norm(second - first)
            arms = points - first
            out = arms - np.outer(arms @ along, along)
            size = np.linalg.norm(out, axis=1)
            # On the axis no direction is the radial one: any serves where both across it are held alike.
            on_axis = size <= 1e-9 * np.abs(arms).max()
            _check_on_axis(nodes[on_axis], card, mesh, steps)
            out[on_axis] = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
            out /= np.linalg.norm(out, axis=1)[:, None]
            axes = np.stack([out, np.cross(along, out), np.tile(along, (len(nodes), 1))], axis=1)
        found.update(zip(nodes.tolist(), axes, strict=True))
    return found


def _check_on_axis(nodes: np.ndarray, card: Card, mesh: DeckMesh, steps: DeckSteps) -> None:
    """Reject nodes on the axis of a cylinder that are held or loaded along one direction across it."""
    for step in steps.steps:
        for instant in step.instants:
            held, force = instant.held[nodes, :2], instant.forces[nodes, :2]
            wrong = np.isnan(held[:, 0]) != np.isnan(held[:, 1])
            wrong |= np.nan_to_num(held).any(axis=1) | force.any(axis=1)
            if wrong.any():
                raise card.error(
                    f"node {mesh.numbers[nodes[wrong][0]]} is on the axis of the cylinder, where no "
                    "direction is the radial one, but it is held or loaded along component 1 or 2: hold "
                    "both at zero there, or leave it out of the set"
                )


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
