"""Couplings as equations for small rotations: of some components, along local axes, or of nodes in others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.decks.couplings import Driven, coupled
from fenics_contact.decks.local_axes import LocalAxes, oriented
from fenics_contact.decks.multi_point import Equation
from fenics_contact.decks.rigid_links import by_small_turns, spread_out
from fenics_contact.decks.steps import Instant, is_large
from fenics_contact.readers.deck_cards import AtLine, Card
from fenics_contact.readers.deck_mesh import DeckMesh
from fenics_contact.readers.deck_mesh import nodes_of as nodes_of_elements


@dataclass(frozen=True, eq=False)
class Nodes:
    """The mesh of a deck, which of its nodes belong to elements, and their local axes."""

    mesh: DeckMesh
    inside: np.ndarray
    axes: LocalAxes


@dataclass(frozen=True, eq=False)
class LinearCoupling(AtLine):
    """Nodes that follow the rigid motion of a node in some directions.

    `node`, `turning`: see `Driven`; `directions`: of each node, (n, k, 3).
    """

    card: Card
    row: int
    nodes: np.ndarray
    node: int
    turning: int
    directions: np.ndarray

    def equations(self, deck: Nodes) -> list[Equation]:
        """Return a·(u − U − θ × r) = 0 for each node of an element and each of its directions a."""
        nodes, dim = self.nodes[deck.inside[self.nodes]], deck.mesh.blocks[0].element.dim
        along = self.directions[deck.inside[self.nodes]]
        arms = deck.mesh.points[nodes] - deck.mesh.points[self.node]
        own = np.stack([deck.axes.of(node) for node in nodes.tolist()]) if len(nodes) else along
        parts = [
            np.einsum("nad,nkd->nka", own, along),
            -np.einsum("ad,nkd->nka", deck.axes.of(self.node), along),
            -np.cross(arms[:, None], along),
        ]
        factors = np.concatenate(parts, axis=2)
        used = np.abs(factors) > 1e-14 * (1.0 + np.linalg.norm(arms, axis=1))[:, None, None]
        flat = (np.abs(along[:, :, dim:]) <= 1e-9).all(axis=2)  # others are out of the plane
        turner = (self.node, 3) if self.turning < 0 else (self.turning, 0)
        components = np.concatenate([np.arange(6) % 3, turner[1] + np.arange(3)])
        found = []
        for place, k in np.argwhere(flat).tolist():
            at = np.flatnonzero(used[place, k])
            members = np.repeat([nodes[place], self.node, turner[0]], 3)
            entries = (tuple(each[at].tolist()) for each in (members, components, factors[place, k]))
            found.append(Equation(self.card, self.row, *entries))
        return found


def nodes_of(driven: Driven, mesh: DeckMesh) -> np.ndarray:
    """Return the nodes that a card drives."""
    if driven.surface:
        given = mesh.surface_named(driven.surface, driven.card)
        return given.nodes if len(given.nodes) else mesh.nodes_of(given.faces)
    if driven.card.name_of("NSET"):
        return driven.nodes
    return nodes_of_elements(mesh, mesh.elements_named(driven.name, driven.card))


def read_linear(
    cards: Sequence[Card], mesh: DeckMesh, orientations: Mapping[str, Card]
) -> list[LinearCoupling]:
    """Return the couplings of some components, along x, y and z or the axes of an orientation."""
    found = []
    for place, card in enumerate(cards):
        kind, held = coupled(cards, place) if card.name == "COUPLING" else (card, {1, 2, 3})
        if kind.name != "KINEMATIC" or {1, 2, 3} <= held:
            continue
        if any(each.name == "STEP" and is_large(each) for each in cards):
            raise kind.error("some of components 1 to 3 alone are not supported with NLGEOM: couple all")
        surface = mesh.surface_named(card.required("SURFACE"), card)
        nodes = surface.nodes if len(surface.nodes) else mesh.nodes_of(surface.faces)
        node = int(mesh.nodes_named(card.required("REFNODE"), card)[0])
        axes = np.tile(np.eye(3), (len(nodes), 1, 1))
        if card.name_of("ORIENTATION"):
            axes = oriented(card, orientations, mesh.points[nodes])
        chosen = axes[:, sorted(k - 1 for k in held if k < 4)]
        found.append(LinearCoupling(card, 0, nodes, node, -1, chosen))
    return found


def led(
    driven: Sequence[Driven], equations: Sequence[Equation], deck: Nodes, large: bool
) -> tuple[list[Driven], list[Equation]]:
    """Return rigid surfaces that move by themselves, and equations with those of others.

    Surfaces of nodes in equations are linear couplings; a node of an element moves with its surface.

    Args:
        driven: Rigid surfaces, and couplings that only load theirs.
        equations: Equations of the deck.
        deck: Its nodes.
        large: Whether the deck has NLGEOM.
    """
    used = {node for each in equations for node in each.nodes}
    surfaces, found = list[Driven](), list(equations)
    for each in driven:
        driving, nodes = {each.node, each.turning}, nodes_of(each, deck.mesh)
        within = bool(deck.inside[each.node]) and each.node not in nodes
        if each.spread or not (within or driving & used):
            surfaces.append(each)
            continue
        if large:
            raise each.card.error(
                f"node {deck.mesh.numbers[each.node]} is also of an element or equation, which is not "
                "supported with NLGEOM: give the coupling a node of its own"
            )
        if driving & used:
            every = np.tile(np.eye(3), (len(nodes), 1, 1))
            coupling = LinearCoupling(each.card, 0, nodes, each.node, each.turning, every)
            found += coupling.equations(deck)
        else:
            found += _joints(each, nodes[deck.inside[nodes]], deck)
            surfaces.append(Follower(**vars(each)))
    return surfaces, found


@dataclass(frozen=True, eq=False)
class Follower(Driven):
    """A rigid surface whose node is one of an element, which loads and holds it."""

    @property
    def reserved(self) -> list[int]:
        """The node of its rotations; −1 is none."""
        return [self.turning]

    def motion(self, instant: Instant) -> np.ndarray:
        """Return displacements, which are free, and rotations of the node at a time, (6,)."""
        return np.concatenate([np.full(3, np.nan), super().motion(instant)[3:]])

    def load(self, instant: Instant) -> np.ndarray:
        """Return no forces, and moments on the node at a time, (6,)."""
        return np.concatenate([np.zeros(3), super().load(instant)[3:]])


def _joints(driven: Driven, nodes: np.ndarray, deck: Nodes) -> list[Equation]:
    """Return that a node moves with a few nodes of the rigid surface that it drives, along x, y and z."""
    dim = deck.mesh.blocks[0].element.dim
    chosen = nodes[spread_out(deck.mesh.points[nodes, :dim])]
    moved = by_small_turns(deck.mesh.points[[driven.node], :dim], deck.mesh.points[chosen, :dim])
    if moved is None:
        raise driven.card.error(f"nodes of {driven.name!r} do not show how it turns: take more than a line")
    found = []
    for component in range(dim):
        vectors = np.zeros((1 + len(chosen), 3))
        vectors[0, component] = 1.0
        vectors[1:, :dim] = -moved[0, component]
        members = [driven.node, *chosen.tolist()]
        local = np.stack([deck.axes.of(n) @ v for n, v in zip(members, vectors, strict=True)])
        place, part = np.nonzero(np.abs(local) > 1e-12 * np.abs(local).max())
        entries = (tuple(np.array(members)[place].tolist()), tuple(part.tolist()), tuple(local[place, part]))
        found.append(Equation(driven.card, 0, *entries))
    return found
