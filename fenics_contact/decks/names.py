"""Names of surfaces and sets of nodes in the meshes: those of a deck, and where it holds and loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import TypeAlias

import numpy as np

from fenics_contact.decks.cards import DeckCards
from fenics_contact.decks.contact import Sides
from fenics_contact.decks.couplings import Driven, by_node
from fenics_contact.decks.multi_point import Equation
from fenics_contact.decks.springs import name_of
from fenics_contact.decks.steps import DeckSteps, DistributedLoad, Held
from fenics_contact.decks.ties import reach_of
from fenics_contact.readers.deck_cards import Card
from fenics_contact.readers.deck_mesh import NO_FACES, Faces, joined

#: Nodes that are held, and the components from zero.
Supported: TypeAlias = tuple[np.ndarray, tuple[int, ...]]
#: Names of nodes with the force on each of them; none where there are many forces.
Forced: TypeAlias = Sequence[tuple[str, tuple[float, ...]]]


@dataclass(frozen=True, eq=False)
class ContactNames:
    """Surfaces of contact pairs and ties.

    `sides`: the pairs and ties, as far as these reach; `alone`: name of a slave whose nodes touch one by one
    -> that of the node set in the meshes.
    """

    sides: Sequence[Sides]
    surfaces: Mapping[str, str]
    alone: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Names:
    """What surfaces and sets of nodes are called.

    `supported`: name -> what is held there in any step; `pressed`: where pressures act -> the name of the
    surface; `forced`: for each instant of the steps where forces act on nodes.
    """

    surfaces: Mapping[str, Faces]
    node_sets: Mapping[str, np.ndarray]
    supported: Mapping[str, Supported]
    contact: ContactNames
    driven: Sequence[tuple[Driven, str]]
    pressed: Mapping[tuple[str, ...], str]
    forced: Sequence[Forced]


def names_of(deck: DeckCards, steps: DeckSteps) -> Names:
    """Return the names of everything that the meshes must know."""
    names = _Naming(deck, steps)
    supported = names.supported()
    contact = names.contact()
    driven = names.driven()
    names.equations()
    pressed = names.pressed()
    names.surfaces_of_deck()
    names.sets_of_deck()
    forced = names.forced()
    return Names(names.surfaces, names.node_sets, supported, contact, driven, pressed, forced)


class _Naming:
    """Collects names, each step with regard to those before it."""

    def __init__(self, deck: DeckCards, steps: DeckSteps) -> None:
        self.deck, self.steps, self.mesh = deck, steps, deck.mesh
        self.surfaces: dict[str, Faces] = {}
        self.node_sets: dict[str, np.ndarray] = {}

    def _place(self, name: str, nodes: np.ndarray) -> str:
        """Name nodes as a surface if they are all nodes of some faces, else as a set of nodes."""
        faces = self.deck.exterior.covering(nodes)
        if len(faces):
            name = f"{name} FACES" if name in self.mesh.surfaces else name
            self.surfaces[name] = faces
        else:
            name = f"{name} NODES" if name in self.mesh.surfaces else name
            self.node_sets[name] = np.unique(nodes)
        return name

    def _set_of(self, nodes: np.ndarray) -> str:
        """Return the name of exactly these nodes, a new one if there is none."""
        for known in (self.node_sets, self.mesh.node_sets):
            for name, inside in known.items():
                if np.array_equal(inside, nodes) and (known is self.node_sets or name not in self.surfaces):
                    self.node_sets.setdefault(name, nodes)
                    return name
        new = next(n for n in map("CLOAD {}".format, count(1)) if n not in self.node_sets)
        self.node_sets[new] = nodes
        return new

    def supported(self) -> dict[str, Supported]:
        """Name what is held in any step. Single nodes are put together."""
        deck = self.deck
        found: dict[str, tuple[np.ndarray, set[int]]] = {}
        single = np.zeros((len(deck.inside), 3), dtype=bool)
        for target in self.steps.targets:
            nodes = target.nodes[deck.inside[target.nodes]]
            inner = [k for k in target.components if k < deck.dim]
            _check_target(deck, self.steps, target, nodes)
            if not len(nodes):
                ends = [node for each in deck.springs for node in each.nodes]
                if not (deck.references[target.nodes].any() or np.isin(target.nodes, ends).any()):
                    deck.note(target.card, f"nodes {target.label} belong to no element")
            elif not target.label or target.label.isdecimal():
                single[np.ix_(nodes, inner)] = True
            elif inner:
                found.setdefault(target.label, (nodes, set()))[1].update(inner)
                deck.record.origins.setdefault(("support", target.label), target.card.origin)
        # Nodes that are held alike in all steps are one set.
        course = np.concatenate([single, *(single & marks for marks in self._marks())], axis=1)
        for alike in np.unique(course[single.any(axis=1)], axis=0):
            components = np.flatnonzero(alike[:3])
            name = "BOUNDARY " + " ".join(str(k + 1) for k in components)
            name = next(n for n in (name, *(f"{name} {chr(65 + k)}" for k in range(26))) if n not in found)
            found[name] = np.flatnonzero((course == alike).all(axis=1)), set(components.tolist())
        return {
            self._place(name, nodes): (np.unique(nodes), tuple(sorted(held)))
            for name, (nodes, held) in found.items()
        }

    def _marks(self) -> list[np.ndarray]:
        """Return what is held in the steps, (n_nodes, 3), each time that it changes."""
        found: list[np.ndarray] = []
        for step in self.steps.steps:
            now = ~np.isnan(step.instants[-1].held[:, :3])
            if not found or (now != found[-1]).any():
                found.append(now)
        return found

    def contact(self) -> ContactNames:
        """Name the surfaces of contact pairs and ties."""
        surfaces: dict[str, str] = {}
        alone: dict[str, str] = {}
        for each in self.deck.sides:
            if each.tied or not self._touches_alone(each, surfaces, alone):
                surfaces[each.slave] = self._side(each.slave, each)
            surfaces[each.master] = self._side(each.master, each)
        reached = [part for each in self.deck.sides for part in self._reached(each, surfaces)]
        return ContactNames(reached, surfaces, alone)

    def _given(self, name: str, of: Sides) -> tuple[Faces, np.ndarray]:
        """Return the faces of a surface, or those that have all of its nodes or of a node set, and these."""
        if name not in self.mesh.surfaces and name in self.mesh.node_sets:
            nodes = self.mesh.node_sets[name]
            return self.deck.exterior.covering(nodes), nodes
        given = self.mesh.surface_named(name, of.card, of.row)
        return self.deck.exterior.faces_of(given), given.nodes

    def _side(self, name: str, of: Sides) -> str:
        """Name the faces of one side."""
        faces, nodes = self._given(name, of)
        if not len(faces):
            raise of.error(
                f"the {len(nodes)} nodes of {name!r} are not all nodes of some faces: give TYPE=ELEMENT"
            )
        self.deck.exterior.require(faces, of.card, of.row, f"surface {name!r} must lie", "correct it")
        self.surfaces[name] = faces
        return name

    def _touches_alone(self, of: Sides, surfaces: dict[str, str], alone: dict[str, str]) -> bool:
        """Let nodes that are not all nodes of some faces touch one by one, on the faces around them."""
        name = of.slave
        faces, nodes = self._given(name, of)
        if len(faces) or not len(nodes):
            return False
        if name not in alone:
            alone[name] = name if name not in self.mesh.surfaces else f"{name} NODES"
            surfaces[name] = f"{name} AROUND"
            self.node_sets[alone[name]] = np.unique(nodes)
            self.surfaces[surfaces[name]] = self.deck.exterior.around(nodes)
        self.deck.note(
            of.card,
            f"the {len(nodes)} nodes of {name} are not all nodes of some faces and touch one by one, each "
            "with its share of the faces around it as its area",
        )
        return True

    def _reached(self, of: Sides, surfaces: dict[str, str]) -> list[Sides]:
        """Return a pair, or a tie of the faces within its tolerance, if there are any."""
        if of.card.name != "TIE" or of.around is not None:
            return [of]
        slave, master = (self.surfaces[surfaces[name]] for name in (of.slave, of.master))
        reach = reach_of(of.card, self.mesh, slave, master)
        for words in reach.in_words(of.slave, of.master, self.mesh):
            self.deck.note(of.card, words)
        if not reach.tied.any():
            return []
        if reach.tied.all():
            return [of]
        name = f"{of.slave} TIED TO {of.master}"
        self.surfaces[name], surfaces[name] = reach.kept, name
        return [replace(of, slave=name)]

    def driven(self) -> list[tuple[Driven, str]]:
        """Name the surfaces that nodes drive or load."""
        found = []
        for several in by_node(self.deck.driven, self.mesh):
            for each in several:
                if self.deck.axes.turned(np.array([each.node, each.turning])).any():
                    raise each.card.error(
                        "the node of a rigid surface must not have a *TRANSFORM: leave it out"
                    )
            parts = [self._part(each) for each in several]
            name = " AND ".join(dict.fromkeys(name for name, _, _ in parts))
            if any(len(nodes) for _, _, nodes in parts):
                every = [nodes for _, _, nodes in parts] + [
                    self.mesh.nodes_of(faces) for _, faces, _ in parts
                ]
                name = self._place(name, np.unique(np.concatenate(every)))
            else:
                self.surfaces[name] = parts[0][1] if len(parts) == 1 else joined(f for _, f, _ in parts)
            found.append((several[0], name))
            if len(several) > 1 and several[0].turning < 0:
                self.deck.note(
                    several[0].card,
                    f"{' and '.join(each.name for each in several)} have one reference node: they move and "
                    "turn as one piece, where CalculiX lets each turn by itself about the node",
                )
        return found

    def _part(self, driven: Driven) -> tuple[str, Faces, np.ndarray]:
        """Return the name of what a card drives, and its faces, or nodes that are not all nodes of faces."""
        exterior, none = self.deck.exterior, driven.nodes[:0]
        name = driven.surface or f"{driven.name} RIGID"
        if driven.surface:
            faces = exterior.faces_of(self.mesh.surface_named(name, driven.card))
        elif driven.card.name_of("NSET"):
            inside = driven.nodes[self.deck.inside[driven.nodes]]
            if len(inside) and not driven.spread and not len(exterior.covering(inside)):
                return name, NO_FACES, inside
            faces = exterior.covering(driven.nodes)
        else:
            faces = self._whole(driven)
        if not len(faces) or not exterior.holds(faces).all():
            raise driven.card.error(
                f"{driven.name!r} must be faces on the boundary of a body, or all nodes of some"
            )
        return name, faces, none

    def _whole(self, driven: Driven) -> Faces:
        """Return the boundary of the bodies whose elements are those of a set."""
        elements = self.mesh.elements_named(driven.name, driven.card)
        if not any(np.array_equal(part.elements, elements) for part in self.deck.components):
            return NO_FACES
        faces = self.deck.exterior.faces
        mine = np.isin(faces.elements, elements)
        return Faces(faces.elements[mine], faces.sides[mine])

    def equations(self) -> None:
        """Name the nodes that an equation holds alone, ends of springs, and nodes with masses."""
        for each in self.steps.equations:
            _check_equation(self.deck, self.steps, each)
            if len(set(each.nodes)) == 1:
                node = each.nodes[0]
                self.node_sets[name_of(self.mesh.numbers[node])] = np.array([node])
        ends = [node for each in self.deck.springs for node in each.nodes]
        for node in [*ends, *(each.node for each in self.deck.masses)]:
            if len(nodes := self.deck.ends_at(node)):
                self.node_sets[name_of(self.mesh.numbers[node])] = np.unique(nodes)

    def pressed(self) -> dict[tuple[str, ...], str]:
        """Name the faces that pressures act on."""
        taken: dict[tuple[int, int], str] = {}
        found: dict[tuple[str, ...], str] = {}
        for several in self._pressed_alike():
            first = several[0]
            name = " ".join(first.where)
            if len(several) > 1:
                name = next(n for n in map("DLOAD {}".format, count(1)) if n not in self.surfaces)
            faces = self._faces(first) if len(several) == 1 else self._single_faces(several)
            what, remedy = "a pressure must act", "correct the set or the label"
            self.deck.exterior.require(faces, first.card, first.row, what, remedy)
            for key in zip(faces.elements.tolist(), faces.sides.tolist(), strict=True):
                other = taken.setdefault(key, name)
                if other != name:
                    number = self.mesh.element_numbers[key[0]]
                    raise first.error(f"a face of element {number} is loaded by {other!r} and {name!r}")
            self.surfaces[name] = faces
            self.deck.record.origins["load", name] = first.card.origin
            found.update((each.where, name) for each in several)
        return found

    def _pressed_alike(self) -> list[list[DistributedLoad]]:
        """Return the pressures of all instants; those on single elements together that are always equal."""
        instants = self.steps.instants
        first: dict[tuple[str, ...], DistributedLoad] = {}
        values: dict[tuple[str, ...], list[float]] = {}
        for number, instant in enumerate(instants):
            for each in instant.pressures:
                first.setdefault(each.where, each)
                values.setdefault(each.where, [0.0] * len(instants))[number] = each.value
        found: dict[tuple[object, ...], list[DistributedLoad]] = {}
        for where, each in first.items():
            single = len(where) == 2 and where[0].isdecimal()
            found.setdefault(tuple(values[where]) if single else where, []).append(each)
        return list(found.values())

    def _single_faces(self, several: Sequence[DistributedLoad]) -> Faces:
        """Return the faces of single elements."""
        numbers = np.array([int(each.where[0]) for each in several])
        sides = np.array([int(each.where[1][1:] or 1) - 1 for each in several])
        return Faces(self.mesh.positions(numbers, "element", several[0].card), sides)

    def _faces(self, pressed: DistributedLoad) -> Faces:
        card, row = pressed.card, pressed.row
        if card.name == "DLOAD":
            elements = self.mesh.elements_named(pressed.where[0], card, row)
            return self.mesh.faces_of(elements, pressed.where[1], card, row)
        given = self.mesh.surface_named(pressed.where[0], card, row)
        if len(given.nodes):
            raise card.error("a pressure needs a surface of faces, this has nodes: give TYPE=ELEMENT", row)
        return given.faces

    def surfaces_of_deck(self) -> None:
        """Take all surfaces of the deck that lie on the boundary of bodies."""
        for name, given in self.mesh.surfaces.items():
            faces = self.deck.exterior.faces_of(given)
            if len(faces) and self.deck.exterior.holds(faces).all():
                self.surfaces.setdefault(name, faces)
                self.deck.record.origins["surface", name] = given.card.origin

    def sets_of_deck(self) -> None:
        """Take all sets of nodes of bodies."""
        for name, nodes in self.mesh.node_sets.items():
            mine = nodes[self.deck.inside[nodes]]
            if name not in self.surfaces and name not in self.node_sets and len(mine):
                self._place(name, mine)
            self.deck.record.origins["nodes", name] = self.mesh.origins[name].origin

    def forced(self) -> list[Forced]:
        """Name the nodes that forces act on, for each instant."""
        deck, found = self.deck, []
        for step in self.steps.steps:
            for instant in step.instants:
                turned = np.flatnonzero(instant.forces[:, 3:].any(axis=1) & ~deck.references)
                if len(turned):
                    raise step.card.error(
                        f"node {self.mesh.numbers[turned[0]]} of a solid takes no moment: use *COUPLING"
                    )
                _check_plane_forces(deck, step.card, instant.forces)
                loose = deck.inside & ~deck.references
                force = np.where(loose[:, None], instant.forces, 0.0)[:, : deck.dim]
                found.append(self._groups(np.flatnonzero(force.any(axis=1)), force))
        return found

    def _groups(self, nodes: np.ndarray, force: np.ndarray, most: int = 6) -> Forced:
        """Return sets of nodes with the same force each, one set for all where there are many forces."""
        if not len(nodes):
            return []
        values, number = np.unique(force[nodes], axis=0, return_inverse=True)
        if len(values) > most:
            return [(self._set_of(nodes), ())]
        groups = [nodes[number.ravel() == k] for k in range(len(values))]
        return [(self._set_of(own), tuple(v)) for own, v in zip(groups, values.tolist(), strict=True)]


def _check_target(deck: DeckCards, steps: DeckSteps, target: Held, nodes: np.ndarray) -> None:
    """Reject what cannot be held; `nodes`: those of the target that belong to elements."""
    _check_turns(deck, steps, target, nodes)
    _check_plane(deck, steps, target, nodes)
    driving = {node for driven in deck.driven for node in driven.reserved}
    here = [node for node in target.nodes.tolist() if node in driving]
    if any(at.kept[node, list(target.components)].any() for at in steps.instants for node in here):
        raise target.error(
            f"node {deck.mesh.numbers[here[0]]} drives a surface and was free before FIXED: give a value"
        )


def _check_turns(deck: DeckCards, steps: DeckSteps, target: Held, nodes: np.ndarray) -> None:
    """Reject rotations of nodes of elements, which have none, unless they are held at zero."""
    turned = [k for k in target.components if k > 2]
    free = nodes[~deck.references[nodes]]
    if turned and any(np.nan_to_num(at.held[free][:, turned]).any() for at in steps.instants):
        name = target.label or deck.mesh.numbers[free[0]]
        raise target.error(f"{name} has no rotation that can be prescribed: use *RIGID BODY")


def _check_plane(deck: DeckCards, steps: DeckSteps, target: Held, nodes: np.ndarray) -> None:
    """Reject axes of nodes of plane elements out of the plane, unless nodes are held wholly at zero."""
    turned = nodes[deck.axes.turned(nodes)]
    inner = [k for k in target.components if k < 3]
    if deck.dim == 3 or not len(turned) or not inner:
        return
    across = np.array([abs(deck.axes.of(int(node))[inner, 2]) for node in turned])
    wrong = (abs(across - np.equal(inner, 2)) > 1e-9).any(axis=1)
    for instant in steps.instants:
        wrong &= (instant.held[turned, :3] != 0.0).any(axis=1)
    if wrong.any():
        node = int(turned[wrong][0])
        k = inner[int(abs(across[wrong][0] - np.equal(inner, 2)).argmax())]
        axis = ", ".join(f"{value:.4g}" for value in deck.axes.of(node)[k] + 0.0)
        number = deck.mesh.numbers[node]
        raise target.error(
            f"*TRANSFORM axis {k + 1} of node {number}, ({axis}), must be in the plane or along z"
        )


def _check_equation(deck: DeckCards, steps: DeckSteps, equation: Equation) -> None:
    """Reject equations of what has no displacement, or no value."""
    at, components = np.array(equation.nodes), np.array(equation.components)
    inside = deck.inside[at] & (components < 3)
    turned = (components >= deck.dim) & inside
    if turned.any():
        raise equation.error(
            f"component {int(components[turned][0]) + 1} of a node of elements is no displacement"
        )
    across = np.array([deck.axes.of(node)[k % 3, 2] for node, k in zip(at.tolist(), components, strict=True)])
    across = (abs(across) > 1e-9) & (components < 2) & (deck.dim == 2)
    if across.any():
        node, k = at[across][0], components[across][0]
        raise equation.error(f"*TRANSFORM axis {k + 1} of node {deck.mesh.numbers[node]} is out of the plane")
    if not inside.any():
        raise equation.error("needs a node of an element, this equation has none: add one")
    for node, component in zip(at[~inside], components[~inside], strict=True):
        if any(np.isnan(instant.held[node, component]) for instant in steps.instants):
            raise equation.error(
                f"component {component + 1} of node {deck.mesh.numbers[node]}, which no element has, is held "
                "in some steps alone: hold it by *BOUNDARY in all, or in none"
            )


def _check_plane_forces(deck: DeckCards, card: Card, forces: np.ndarray) -> None:
    """Reject forces and moments out of the plane on plane bodies and on nodes that drive them."""
    wrong = abs(forces[:, 2]) > 1e-9 * np.linalg.norm(forces[:, :3], axis=1)
    wrong &= deck.references | deck.inside
    wrong |= deck.references & forces[:, 3:5].any(axis=1)
    if deck.dim == 2 and wrong.any():
        raise card.error(f"node {deck.mesh.numbers[np.flatnonzero(wrong)[0]]} has a *CLOAD out of the plane")
