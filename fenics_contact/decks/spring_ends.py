"""Springs of a scene between nodes of elements of a deck, means of such nodes, and nodes that are held."""

from __future__ import annotations

import numpy as np

from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.springs import Spring
from fenics_contact.decks.bodies import DeckBodies
from fenics_contact.decks.springs import NodeSpring, name_of


def springs_of(built: DeckBodies) -> list[Spring]:
    """Return the springs and trusses of a deck."""
    return [_spring(each, built) for each in built.deck.springs]


def _spring(of: NodeSpring, built: DeckBodies) -> Spring:
    deck = built.deck
    members = [deck.ends_at(node) for node in of.nodes]
    ends = [(place, nodes) for place, nodes in enumerate(members) if len(nodes)]
    if not ends:
        raise of.error("joins nodes without elements, which is not solved here: mesh these as solids")
    stiffness: float | tuple[float, ...] = of.stiffness / deck.thickness
    if of.component >= 0:
        stiffness = tuple((stiffness * np.eye(deck.dim)[of.component]).tolist())
    surfaces = [_surface(of, of.nodes[place], nodes, built) for place, nodes in ends]
    points = deck.mesh.points[list(of.nodes), : deck.dim]
    moved = np.array([deck.mesh.points[nodes, : deck.dim].mean(axis=0) for _, nodes in ends])
    if len(ends) == 2:
        off = np.ptp(moved - points, axis=0)
        if of.component < 0 and (off > 1e-6 * np.abs(points).max()).any():
            raise of.error("must end at the mean of the nodes of its DCOUP3D: move that node there")
        return Spring(surfaces[0], surfaces[1], stiffness, name=f"ELEMENT {of.link.number}")
    place = ends[0][0]
    for other in of.nodes[:place] + of.nodes[place + 1 :]:
        _require_held(of, other, built)
    # The line is that between the nodes of the deck, also where the end is the mean of others.
    fixed = moved[0] + points[len(points) - 1 - place] - points[place]
    return Spring(surfaces[0], tuple(fixed.tolist()), stiffness, name=f"ELEMENT {of.link.number}")


def _surface(of: NodeSpring, node: int, nodes: np.ndarray, built: DeckBodies) -> Surface:
    deck, number = built.deck, built.deck.mesh.numbers[node]
    bodies = [name for name in built.meshes if len(built.parts.within(name, nodes)[0]) == len(nodes)]
    if not bodies or (of.component >= 0 and deck.axes.turned(nodes).any()):
        raise of.error(f"is at node {number}, which is of several bodies or has a *TRANSFORM: move it")
    return Surface(bodies[0], name_of(number))


def _require_held(of: NodeSpring, node: int, built: DeckBodies) -> None:
    components = [of.component] if of.component >= 0 else list(range(built.deck.dim))
    if not all((instant.held[node, components] == 0.0).all() for instant in built.steps.instants):
        raise of.error(
            f"ends at node {built.deck.mesh.numbers[node]}, which no element has: hold it at zero by "
            "*BOUNDARY, or take a node of an element"
        )
