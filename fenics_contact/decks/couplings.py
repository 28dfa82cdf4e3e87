"""What drives surfaces by a node: rigid bodies, couplings and bolts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.supports import RigidSurface
from fenics_contact.decks.local_axes import oriented
from fenics_contact.decks.steps import Instant
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import NO_NODES, DeckMesh, Faces


@dataclass(frozen=True, eq=False)
class Driven:
    """A surface that a node drives or loads.

    `surface`: name of the surface in the deck, or "" for nodes; `nodes`: its nodes, none for those of a
    surface or of elements; `node`: position of the node whose displacements, or whose forces, are those of
    its point; `turning`: position of the node whose displacements are its rotation, −1 if `node` has
    rotations; `spread`: whether the surface stays flexible, and only forces are given; `axes`: rows, along
    which forces and moments are given.
    """

    card: Card
    name: str
    surface: str
    nodes: np.ndarray
    node: int
    turning: int
    spread: bool

    axes: Sequence[Sequence[float]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    @property
    def reserved(self) -> list[int]:
        """The nodes whose displacements and forces are those of the surface; −1 is none."""
        return [self.node, self.turning]

    def motion(self, instant: Instant) -> np.ndarray:
        """Return displacements and rotations of the node at a time, NaN where it is free, (6,)."""
        return self._row(instant.held)

    def load(self, instant: Instant) -> np.ndarray:
        """Return forces and moments on the node at a time along x, y and z, (6,)."""
        local = self._row(instant.forces).reshape(2, 3)
        return np.asarray((local @ np.array(self.axes)).ravel())

    def _row(self, values: np.ndarray) -> np.ndarray:
        turned = values[self.node, 3:] if self.turning < 0 else values[self.turning, :3]
        return np.concatenate([values[self.node, :3], turned])

    def place(self, mesh: DeckMesh) -> tuple[float, ...] | None:
        """Return where its force acts, None for the centroid of the surface."""
        return tuple(mesh.points[self.node, : mesh.blocks[0].element.dim].tolist())


@dataclass(frozen=True, eq=False)
class OnSector(Driven):
    """A flexible surface of a sector whose node is on the axis: forces along this turn no sector."""

    def place(self, mesh: DeckMesh) -> tuple[float, ...] | None:
        """Return that its force acts at the centroid."""
        return None


@dataclass(frozen=True, eq=False)
class TurnedAlone(Driven):
    """A rigid surface that only a node of rotations drives: it moves as it likes."""

    def motion(self, instant: Instant) -> np.ndarray:
        """Return displacements, which are free, and rotations of the node at a time, (6,)."""
        return np.concatenate([np.full(3, np.nan), instant.held[self.turning, :3]])

    def load(self, instant: Instant) -> np.ndarray:
        """Return no forces, and moments on the node at a time, (6,)."""
        return np.concatenate([np.zeros(3), instant.forces[self.turning, :3]])


def read_driven(cards: Sequence[Card], mesh: DeckMesh, orientations: Mapping[str, Card]) -> list[Driven]:
    """Return rigid bodies and couplings of whole surfaces; others are linear ones."""
    found = []
    for k, card in enumerate(cards):
        if card.name == "RIGIDBODY":
            found.append(_rigid_body(card, mesh))
        elif card.name == "COUPLING":
            kind, held = coupled(cards, k)
            if kind.name == "KINEMATIC" and not {1, 2, 3} <= held:
                continue
            node = mesh.nodes_named(card.required("REFNODE"), card)[0]
            surface = card.required("SURFACE")
            mesh.surface_named(surface, card)
            name = card.name_of("CONSTRAINTNAME") or surface
            spread = kind.name == "DISTRIBUTING"
            of = OnSector if "CYCLICSYMMETRY" in kind.parameters else Driven
            given = of(card, name, surface, NO_NODES, int(node), -1, spread)
            if card.name_of("ORIENTATION") and spread:
                rows = oriented(card, orientations, mesh.points[[int(node)]])[0]
                given = replace(given, axes=rows.tolist())
            found.append(given)
    return found


def coupled(cards: Sequence[Card], place: int) -> tuple[Card, set[int]]:
    """Return the card behind a *COUPLING, which must be its kind, and the components it couples, from one."""
    kind = cards[place + 1] if place + 1 < len(cards) else cards[place]
    if kind.name not in ("KINEMATIC", "DISTRIBUTING"):
        raise cards[place].error("must be followed by *KINEMATIC or *DISTRIBUTING: add one")
    return kind, {c for row in range(len(kind.lines)) for c in _range(kind, row)} or set(range(1, 7))


def by_node(driven: Sequence[Driven], mesh: DeckMesh) -> list[list[Driven]]:
    """Return what is driven by the same node, which moves as one rigid piece, in the order of the deck."""
    found: dict[int, list[Driven]] = {}
    turned: dict[int, Driven] = {}
    for each in driven:
        others = found.setdefault(each.node, [])
        if others and (each.spread or others[0].spread):
            node = mesh.numbers[each.node]
            raise each.card.error(f"node {node} of a distributing coupling is also of {others[0].name!r}")
        if others and isinstance(each, TurnedAlone):
            raise each.card.error(
                f"its ROT NODE is also of {others[0].name!r}: give each its own, or REF NODE"
            )
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
        nodes = mesh.shells.across(mesh.nodes_named(card.name_of("NSET"), card))
        name = card.name_of("NSET")
    else:
        name = card.required("ELSET")
        nodes = NO_NODES
    turning = int(mesh.nodes_named(card.name_of("ROTNODE"), card)[0]) if card.name_of("ROTNODE") else -1
    if turning >= 0 and not card.name_of("REFNODE"):
        return TurnedAlone(card, name, "", nodes, turning, turning, False)
    node = int(mesh.nodes_named(card.required("REFNODE"), card)[0])
    return Driven(card, name, "", nodes, node, turning, False)


def rigid_surface(driven: Driven, body: str, surface: str, at: np.ndarray, instant: Instant) -> RigidSurface:
    """Return the rigid surface of a node at a time."""
    dim = len(at)
    turns = [3, 4, 5] if dim == 3 else [5]
    held, force = driven.motion(instant), driven.load(instant)
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
