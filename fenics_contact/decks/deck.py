"""Decks of CalculiX and Abaqus as scenes with load steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.checks import require_file
from fenics_contact._base.display import displayed
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact._scene.body import Body
from fenics_contact._scene.loads import (
    BodyForce,
    Load,
    PointForce,
    Pressure,
    ThermalStrain,
    centrifugal,
    gravity,
)
from fenics_contact._scene.pairs import ContactPair, Tie
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene.supports import AnySupport, Support
from fenics_contact.decks.bodies import (
    Component,
    Exterior,
    Parts,
    Section,
    build_bodies,
    components,
    read_sections,
    regions_of,
)
from fenics_contact.decks.cards import Card, Origin, read_cards
from fenics_contact.decks.contact import (
    Sides,
    build_pairs,
    clearances,
    read_interactions,
    read_sides,
)
from fenics_contact.decks.history import History, Moment, Pressed, Weight, read_history
from fenics_contact.decks.materials import Conditions, build_material, read_materials
from fenics_contact.decks.mesh import DeckMesh, Faces, Named, read_mesh_cards
from fenics_contact.decks.vocabulary import KNOWN, NOT_YET, PROCEDURES, WITHOUT_EFFECT
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import made_once

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.results.state import State


@displayed
@dataclass(frozen=True, eq=False)
class NodeValues:
    """Values at nodes of a body, as a function of position: that of the nearest node.

    Attributes:
        points: Coordinates of the nodes, shape (n, dim), [length].
        values: Shape (n,), or (n, k).
    """

    points: np.ndarray
    values: np.ndarray

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the values at points, shape (n, dim)."""
        return np.asarray(self.values[self._tree.query(points)[1]])

    def __getstate__(self) -> dict[str, np.ndarray]:
        """Pickle the values alone."""
        return {"points": self.points, "values": self.values}


@displayed
@dataclass(frozen=True)
class Print:
    """Results that a deck asks for.

    Attributes:
        step: Number of its load step, from 0.
        card: "NODE PRINT", "EL PRINT", "CONTACT PRINT", "NODE FILE", ...
        where: Set of nodes or elements, or surface; "" for all.
        variables: "U", "RF", "S", ...
        totals: Whether sums over the set are asked for: "", "YES" or "ONLY".
    """

    step: int
    card: str
    where: str
    variables: tuple[str, ...]
    totals: str
    origin: Origin


@displayed
@dataclass(frozen=True, eq=False)
class Deck:
    """A deck of CalculiX or Abaqus that was read and checked.

    Attributes:
        name: Name of its file.
        scene: Bodies, supports and contact before the first load step.
        steps: The load steps; those of the deck, and one more wherever an amplitude changes its slope.
        step_of: Number of the deck's step, from 0, of each of these.
        prints: What results it asks for.
        notes: What is done otherwise than the deck says, and known cards without effect, in words.
        thickness: Thickness of plane bodies, by which forces of the deck are divided, [length]; 1 for others.
        node_numbers: Body -> numbers in the deck of the nodes of its mesh, 0 for nodes that it has not.
        element_numbers: Body -> numbers in the deck of the cells of its mesh.
        node_sets: Name -> numbers of nodes in the deck, ascending.
        element_sets: Name -> numbers of elements in the deck, ascending.
    """

    name: str
    scene: Scene
    steps: Sequence[LoadStep]
    step_of: Sequence[int]
    prints: Sequence[Print]
    notes: Sequence[str]
    thickness: float
    node_numbers: Mapping[str, np.ndarray]
    element_numbers: Mapping[str, np.ndarray]
    node_sets: Mapping[str, np.ndarray]
    element_sets: Mapping[str, np.ndarray]
    _origins: Mapping[tuple[str, str], Origin] = field(default_factory=dict, repr=False)

    def _facts(self) -> dict[str, Any]:
        return {
            "bodies": {name: body.in_words for name, body in self.scene.bodies.items()},
            "steps": len(self.steps),
            "prints": [f"{each.card} {each.where}".rstrip() for each in self.prints],
            "notes": list(self.notes),
        }

    def source(self, part: str, name: str = "") -> Origin:
        """Return where in the deck a part is said.

        Args:
            part: "body", "material", "surface", "nodes", "support", "contact", "tie", "step", ...
            name: Its name in the scene; of contact pairs and ties their `place`.

        Raises:
            InvalidInputError: If there is no such part.
        """
        if (part, name) not in self._origins:
            known = ", ".join(repr(key) for kind, key in self._origins if kind == part) or "none"
            raise InvalidInputError(
                f"the deck {self.name} says of {part!r}: {known}; got {name!r}: name one of them"
            )
        return self._origins[part, name]

    @property
    def sources(self) -> Mapping[tuple[str, str], Origin]:
        """All parts with where they are said."""
        return self._origins

    def problem(self, comm: MPI.Comm, **settings: Any) -> ContactProblem:
        """Return the problem before the first step, unsolved; settings are those of `ContactProblem`."""
        return ContactProblem(self.scene, comm, **settings)

    def solve(self, comm: MPI.Comm, **settings: Any) -> list[State]:
        """Compute the state at the end of each step of the deck. Collective.

        Args:
            comm: Communicator.
            settings: Those of `ContactProblem`, such as ``tolerance``.
        """
        sequence = LoadSequence(self.problem(comm, **settings), count=len(self.steps))
        states = [sequence.advance(step) for step in self.steps]
        sequence.finish()
        last = [k for k, number in enumerate(self.step_of) if number not in self.step_of[k + 1 :]]
        return [states[k] for k in last]


def read_deck(path: str | Path, comm: MPI.Comm | None = None) -> Deck:
    """Read a deck of CalculiX or Abaqus: its mesh, materials, supports, contact, loads and steps.

    Every card is read or is known to have no effect on what is solved; all else is refused with its line.
    Bodies are elements that share nodes, named by their element sets; their regions are the sections. Names
    are in capitals, as both programs read them. A set of nodes that are all nodes of some faces is a surface,
    another one a set of nodes of the mesh.

    Args:
        path: The file, mostly ``.inp``; files that it includes are looked for in its folder.
        comm: If given, rank 0 reads the file and all ranks receive the deck.

    Raises:
        DeckError: With card and line, if a card, an element, a set or a parameter is not known or does not
            fit.
        InvalidInputError: If there is no such file.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> deck = read_deck("bracket.inp")  # doctest: +SKIP
        >>> states = deck.solve(MPI.COMM_WORLD)  # doctest: +SKIP
    """
    return made_once(comm, lambda: _read(Path(path)))


def _read(path: Path) -> Deck:
    require_file(path, "a deck")
    cards = read_cards(path)
    for card in cards:
        if card.name not in KNOWN and card.name not in PROCEDURES:
            raise card.error(
                "this card is not known: the guide lists those that are; leave it out if it has no effect"
            )
        if card.name in NOT_YET:
            raise card.error("this card is known, but not read yet: leave it out, or describe it in Python")
    return _Builder(path.name, cards).deck()


class _Builder:
    """Builds the parts of a scene from the cards of a deck."""

    def __init__(self, name: str, cards: Sequence[Card]) -> None:
        self.name, self.cards = name, cards
        self.notes: list[str] = []
        self.origins: dict[tuple[str, str], Origin] = {}
        self.mesh: DeckMesh = read_mesh_cards(cards)
        self.kind = self.mesh.blocks[0].element.kind
        self.dim = self.mesh.blocks[0].element.dim
        self.sections, self.of_element = read_sections(cards, self.mesh)
        self.materials, self.axes = read_materials(cards)
        self.parts_of_mesh = components(self.mesh, self.sections, self.of_element)
        self.exterior = Exterior.of(self.mesh)
        self.thickness = self._thickness()
        self.history: History = read_history(cards, self.mesh, self.dim, self.note)
        self.surfaces: dict[str, Faces] = {}
        self.node_sets: dict[str, np.ndarray] = {}

    def note(self, card: Card, words: str) -> None:
        """Keep what is worth knowing of a card."""
        text = f"{card.origin}: {words}"
        if text not in self.notes:
            self.notes.append(text)

    def _thickness(self) -> float:
        if self.kind not in ("plane stress", "plane strain"):
            return 1.0
        found = sorted({section.thickness for section in self.sections})
        if len(found) > 1:
            card = next(s.card for s in self.sections if s.thickness != self.sections[0].thickness)
            raise card.error(
                f"plane bodies must have one thickness, got {found[0]:g} and {found[-1]:g}: give one"
            )
        return found[0]

    def deck(self) -> Deck:
        """Return the deck."""
        for card in self.cards:
            if card.name in WITHOUT_EFFECT and card.name != "HEADING":
                self.note(card, f"has no effect here ({WITHOUT_EFFECT[card.name]})")
        supported = self._supported()
        sides = self._contact_surfaces()
        self._pressed_surfaces()
        self._named_surfaces()
        self._named_nodes()
        loaded = self._loaded()
        parts = build_bodies(
            self.mesh, self.parts_of_mesh, self.of_element, self.sections, self.surfaces, self.node_sets,
            f"deck '{self.name}'",
        )  # fmt: skip
        self.parts = parts
        bodies = self._bodies(parts)
        contacts, ties = self._pairs(sides)
        scene = self._scene(bodies, self._supports(supported, None), contacts, ties)
        steps, step_of = [], []
        for number, step in enumerate(self.history.steps):
            self.origins["step", step.name] = step.card.origin
            for moment in step.moments:
                part = "" if moment is step.moments[-1] else f", time {moment.time:g}"
                loads = self._loads(moment, loaded[id(moment)], bodies)
                supports = self._supports(supported, moment)
                steps.append(LoadStep(f"{step.name}{part}", loads, supports, moment.time))
                step_of.append(number)
        return Deck(
            self.name, scene, tuple(steps), tuple(step_of), self._prints(), tuple(self.notes), self.thickness,
            {name: np.where(at < 0, 0, self.mesh.numbers[at]) for name, at in parts.nodes.items()},
            self._element_numbers(), self._numbered(self.mesh.node_sets, self.mesh.numbers),
            self._numbered(self.mesh.element_sets, self.mesh.element_numbers), self.origins,
        )  # fmt: skip

    def _contact_surfaces(self) -> list[Sides]:
        """Name the surfaces of contact pairs and ties."""
        self.interactions = read_interactions(self.cards)
        sides = read_sides(self.cards, self.interactions)
        self.sides_by_name: dict[str, str] = {}
        for each in sides:
            for name in (each.slave, each.master):
                self._contact_surface(name, each)
        return sides

    def _contact_surface(self, name: str, of: Sides) -> None:
        """Take the faces of a surface, of one of nodes, or of a node set, those that have all of them."""
        if name not in self.mesh.surfaces and name in self.mesh.node_sets:
            nodes: np.ndarray | None = self.mesh.node_sets[name]
            faces, known = self.exterior.covering(self.mesh.node_sets[name]), False
        else:
            given = self.mesh.surface_named(name, of.card, of.row)
            faces, nodes, known = self._faces_of(given), given.nodes, True
        if faces is None:
            raise of.card.error(
                f"contact is between faces, but the {0 if nodes is None else len(nodes)} nodes of "
                f"{name!r} are not all nodes of some faces: give the faces, as *SURFACE with TYPE=ELEMENT",
                of.row,
            )  # fmt: skip
        outer = self.exterior.holds(faces)
        if not outer.all():
            number = self.mesh.element_numbers[faces.elements[~outer][0]]
            raise of.card.error(
                f"surface {name!r} must lie on the boundary of a body, a face of element {number} lies "
                "between two elements: correct it", of.row,
            )  # fmt: skip
        label = name if known or name not in self.mesh.surfaces else f"{name} faces"
        self.surfaces[label] = faces
        self.sides_by_name[name] = label

    def _pairs(self, sides: Sequence[Sides]) -> tuple[list[ContactPair], list[Tie]]:
        found = build_pairs(
            sides, self.sides_by_name, self.parts.meshes, self.interactions, clearances(self.cards), self.note
        )
        for each, pair in found:
            kind = "tie" if isinstance(pair, Tie) else "contact"
            self.origins[kind, pair.place] = each.card.origin
        return [p for _, p in found if isinstance(p, ContactPair)], [
            p for _, p in found if isinstance(p, Tie)
        ]

    def _scene(
        self,
        bodies: Mapping[str, Body],
        supports: Sequence[AnySupport],
        contacts: Sequence[ContactPair],
        ties: Sequence[Tie],
    ) -> Scene:
        """Return the scene before the first step; what does not suit the bodies is told with its card."""
        for kind, parts in (("contact", contacts), ("tie", ties)):
            for part in parts:
                try:
                    Scene(bodies, **{f"{kind}s" if kind == "tie" else "contacts": (part,)})  # type: ignore[arg-type]
                except InvalidInputError as error:
                    raise self.origins[kind, part.place].error(str(error)) from error
        return Scene(bodies, supports, (), contacts, ties)

    def _numbered(self, sets: Mapping[str, np.ndarray], numbers: np.ndarray) -> dict[str, np.ndarray]:
        return {name: np.sort(numbers[members]) for name, members in sets.items()}

    def _element_numbers(self) -> dict[str, np.ndarray]:
        """Return the numbers of the elements of each body in the order of its cells: by their cards."""
        return {part.name: self.mesh.element_numbers[part.elements] for part in self.parts_of_mesh}

    def _bodies(self, parts: Parts) -> dict[str, Body]:
        large = any(step.large for step in self.history.steps)
        if large and not all(step.large for step in self.history.steps):
            step = next(step for step in self.history.steps if not step.large)
            raise step.card.error("all steps must have NLGEOM, or none, got both: give it to this one, too")
        bodies = {}
        for part in self.parts_of_mesh:
            mesh = parts.meshes[part.name]
            of = Conditions(
                self.kind, large, self._temperature(), mesh.cell_type in ("hexahedron", "quadrilateral")
            )
            given = {}
            for region, section in regions_of(self.sections, part).items():
                given[region] = self._material(section, of)
            material = given if len(given) > 1 else next(iter(given.values()))
            bodies[part.name] = Body(mesh, material, axisymmetric=self.kind == "axisymmetric")
            self.origins["body", part.name] = self.sections[part.sections[0]].card.origin
        return bodies

    def _material(self, section: Section, of: Conditions) -> Any:
        if section.material not in self.materials:
            there = ", ".join(self.materials) or "none"
            raise section.card.error(f"material {section.material!r} is not there; the deck has {there}")
        if section.orientation and section.orientation not in self.axes:
            there = ", ".join(self.axes) or "none"
            raise section.card.error(
                f"orientation {section.orientation!r} is not there; the deck has {there}"
            )
        cards = self.materials[section.material]
        self.origins["material", section.material] = cards.card.origin
        return build_material(cards, self.axes.get(section.orientation), of)

    def _temperature(self) -> float | None:
        """Return the temperature if it is the same everywhere and always."""
        found = {float(t) for t in np.unique(self.history.initial)}
        for step in self.history.steps:
            for moment in step.moments:
                if moment.temperatures is not None:
                    found |= {float(t) for t in np.unique(moment.temperatures)}
        return found.pop() if len(found) == 1 else None

    def _nodes_of_bodies(self) -> np.ndarray:
        """Return which nodes belong to elements, (n_nodes,)."""
        mark = np.zeros(len(self.mesh.points), dtype=bool)
        for block in self.mesh.blocks:
            mark[block.nodes] = True
        return mark

    def _supported(self) -> dict[str, tuple[np.ndarray, tuple[int, ...]]]:
        """Return what is held by name: nodes and components. Single nodes are put together."""
        inside = self._nodes_of_bodies()
        found: dict[str, tuple[np.ndarray, set[int]]] = {}
        single: dict[int, set[int]] = {}
        for target in self.history.targets:
            nodes = target.nodes[inside[target.nodes]]
            if not len(nodes):
                self.note(target.card, f"nodes {target.label} belong to no element")
            elif target.label.isdecimal():
                single.setdefault(int(nodes[0]), set()).update(target.components)
            else:
                found.setdefault(target.label, (nodes, set()))[1].update(target.components)
                self.origins.setdefault(("support", target.label), target.card.origin)
        together: dict[tuple[int, ...], list[int]] = {}
        for node, held in single.items():
            together.setdefault(tuple(sorted(held)), []).append(node)
        for alike, several in together.items():
            name = "BOUNDARY " + " ".join(str(k + 1) for k in alike)
            found[name] = np.array(several), set(alike)
        result = {}
        for name, (nodes, held) in found.items():
            result[self._place(name, nodes)] = np.unique(nodes), tuple(sorted(held))
        self._require_same(inside)
        return result

    def _require_same(self, inside: np.ndarray) -> None:
        """Reject steps that hold other components than the first."""
        moments = [(step, moment) for step in self.history.steps for moment in step.moments]
        for step, moment in moments[1:]:
            held, first = (~np.isnan(each.held[inside, : self.dim]) for each in (moment, moments[0][1]))
            if (held != first).any():
                node = self.mesh.numbers[inside][(held != first).any(axis=1)][0]
                raise step.card.error(
                    f"the same components must be held in all steps, here others than in the first, at "
                    f"node {node}: hold them in all steps with OP=MOD, or make two decks"
                )

    def _place(self, name: str, nodes: np.ndarray) -> str:
        """Name nodes as a surface if they are all nodes of some faces, else as a set of nodes."""
        faces = self.exterior.covering(nodes)
        if faces is not None:
            name = f"{name} faces" if name in self.mesh.surfaces else name
            self.surfaces[name] = faces
        else:
            name = f"{name} nodes" if name in self.mesh.surfaces else name
            self.node_sets[name] = np.unique(nodes)
        return name

    def _named_surfaces(self) -> None:
        """Take all surfaces of the deck that lie on the boundary of bodies."""
        for name, given in self.mesh.surfaces.items():
            faces = self._faces_of(given)
            if faces is not None and len(faces) and self.exterior.holds(faces).all():
                self.surfaces.setdefault(name, faces)
                self.origins["surface", name] = given.card.origin

    def _faces_of(self, surface: Named) -> Faces | None:
        """Return the faces of a surface, of one of nodes those that have all of them, or None."""
        return surface.faces if surface.nodes is None else self.exterior.covering(surface.nodes)

    def _named_nodes(self) -> None:
        inside = self._nodes_of_bodies()
        for name, nodes in self.mesh.node_sets.items():
            mine = nodes[inside[nodes]]
            if name not in self.surfaces and name not in self.node_sets and len(mine):
                self._place(name, mine)
            self.origins["nodes", name] = self.mesh.origins[name].origin

    def _pressed_surfaces(self) -> None:
        """Name the faces that pressures act on."""
        acting = [
            pressed for step in self.history.steps for moment in step.moments for pressed in moment.pressures
        ]
        sides: dict[str, Pressed] = {}
        taken: dict[tuple[int, int], str] = {}
        for pressed in acting:
            name = " ".join(pressed.where)
            if name in sides:
                continue
            sides[name] = pressed
            faces = self._faces(pressed)
            outer = self.exterior.holds(faces)
            if not outer.all():
                number = self.mesh.element_numbers[faces.elements[~outer][0]]
                raise pressed.card.error(
                    f"a pressure must act on the boundary of a body, a face of element {number} lies "
                    "between two elements: correct the set or the label", pressed.row,
                )  # fmt: skip
            for key in zip(faces.elements.tolist(), faces.sides.tolist(), strict=True):
                other = taken.setdefault(key, name)
                if other != name:
                    number = self.mesh.element_numbers[key[0]]
                    raise pressed.card.error(
                        f"the same face of element {number} is loaded by {other!r} and {name!r}: load it "
                        "once",
                        pressed.row,
                    )
            self.surfaces[name] = faces
            self.origins["load", name] = pressed.card.origin

    def _faces(self, pressed: Pressed) -> Faces:
        card, row = pressed.card, pressed.row
        if len(pressed.where) == 1:
            given = self.mesh.surface_named(pressed.where[0], card, row)
            if given.faces is None:
                raise card.error(
                    "a pressure needs a surface of faces, this one has nodes: give TYPE=ELEMENT", row
                )
            return given.faces
        elements = self.mesh.elements_named(pressed.where[0], card, row)
        return self.mesh.faces_of(elements, pressed.where[1], card, row)

    def _loaded(self) -> dict[int, list[tuple[str, np.ndarray | None]]]:
        """Name the nodes that forces act on; return for each moment its names, with None for many forces."""
        result: dict[int, list[tuple[str, np.ndarray | None]]] = {}
        inside = self._nodes_of_bodies()
        for step in self.history.steps:
            for moment in step.moments:
                force = np.where(inside[:, None], moment.forces, 0.0)[:, : self.dim]
                nodes = np.flatnonzero(force.any(axis=1))
                result[id(moment)] = self._groups(nodes, force) if len(nodes) else []
        return result

    def _groups(
        self, nodes: np.ndarray, force: np.ndarray, most: int = 6
    ) -> list[tuple[str, np.ndarray | None]]:
        """Return sets of nodes with the same force each, one set for all where there are many forces."""
        values, number = np.unique(force[nodes], axis=0, return_inverse=True)
        if len(values) > most:
            return [(self._set_of(nodes), None)]
        return [(self._set_of(nodes[number.ravel() == k]), value) for k, value in enumerate(values)]

    def _set_of(self, nodes: np.ndarray) -> str:
        """Return the name of exactly these nodes, a new one if there is none."""
        for known in (self.node_sets, self.mesh.node_sets):
            for name, inside in known.items():
                if np.array_equal(inside, nodes) and (known is self.node_sets or name not in self.surfaces):
                    self.node_sets.setdefault(name, nodes)
                    return name
        name = next(
            f"CLOAD {k}" for k in range(1, len(self.node_sets) + 2) if f"CLOAD {k}" not in self.node_sets
        )
        self.node_sets[name] = nodes
        return name

    def _in_body(self, name: str, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which nodes of the deck a body has, and their numbers in it."""
        mine = self.parts.nodes[name]
        mine = mine[mine >= 0]  # ascending; centres of cells are behind
        place = np.minimum(np.searchsorted(mine, nodes), len(mine) - 1)
        there = mine[place] == nodes
        return nodes[there], place[there]

    def _supports(
        self, supported: Mapping[str, tuple[np.ndarray, tuple[int, ...]]], moment: Moment | None
    ) -> tuple[AnySupport, ...]:
        """Return the supports at a time, at zero before all."""
        found = []
        for name, (nodes, held) in supported.items():
            for body, mesh in self.parts.meshes.items():
                mine, inner = self._in_body(body, nodes)
                if not len(mine):
                    continue
                value: list[Any] = [None] * self.dim
                for k in held:
                    given = np.zeros(len(mine)) if moment is None else moment.held[mine, k]
                    same = np.ptp(given) == 0.0
                    value[k] = float(given[0]) if same else NodeValues(mesh.points[inner], given)
                found.append(Support(body, name, tuple(value)))
        return tuple(found)

    def _loads(
        self, moment: Moment, loaded: Sequence[tuple[str, np.ndarray | None]], bodies: Mapping[str, Body]
    ) -> tuple[Load, ...]:
        """Return the loads at a time."""
        found: list[Load] = []
        for name, force in loaded:
            for body, mesh in self.parts.meshes.items():
                mine, inner = self._in_body(body, self.node_sets[name])
                if len(mine):
                    each = moment.forces[mine, : self.dim] / self.thickness
                    value: Any = (
                        tuple((force / self.thickness).tolist())
                        if force is not None
                        else NodeValues(mesh.points[inner], each)
                    )
                    found.append(PointForce(body, name, value))
        for pressed in moment.pressures:
            name = " ".join(pressed.where)
            if pressed.value:
                found += [
                    Pressure(b, name, pressed.value)
                    for b, m in self.parts.meshes.items()
                    if name in m.surfaces
                ]
        for weight in moment.weights:
            found += self._weights(weight)
        if moment.temperatures is not None:
            found += self._heat(moment.temperatures, bodies)
        return tuple(found)

    def _weights(self, weight: Weight) -> list[Load]:
        """Return gravity or centrifugal force on whole bodies."""
        elements = self.mesh.elements_named(weight.where, weight.card, weight.row)
        found: list[Load] = []
        for part in self.parts_of_mesh:
            mine = np.isin(part.elements, elements)
            if not mine.any() or not weight.value:
                continue
            densities = {
                self.materials[self.sections[k].material].density
                for k in np.unique(self.of_element[part.elements])
            }
            if not mine.all() or len(densities) > 1:
                raise weight.card.error(
                    f"{weight.kind} must act on whole bodies of one density, on body {part.name} it does "
                    "not: give all of its elements, and one density", weight.row,
                )  # fmt: skip
            density = densities.pop()
            if not density:
                name = self.sections[part.sections[0]].material
                raise weight.card.error(
                    f"{weight.kind} needs a *DENSITY of material {name}: add it", weight.row
                )
            found.append(self._weight(weight, part, density))
        return found

    def _weight(self, weight: Weight, part: Component, density: float) -> BodyForce:
        numbers = np.array(weight.numbers)
        if weight.kind == "GRAV":
            return gravity(part.name, density, (weight.value * numbers)[: self.dim].tolist())
        speed = float(np.sqrt(weight.value))
        if self.dim == 3:
            return centrifugal(part.name, density, speed, tuple(numbers[:3]), tuple(numbers[3:]))
        if self.kind == "axisymmetric":
            return centrifugal(part.name, density, speed, (0.0, 0.0), (0.0, 1.0))
        return centrifugal(part.name, density, speed, tuple(numbers[:2]))

    def _heat(self, temperatures: np.ndarray, bodies: Mapping[str, Body]) -> list[Load]:
        """Return the changes of temperature of bodies that expand."""
        found: list[Load] = []
        for name, mesh in self.parts.meshes.items():
            nodes = self.parts.nodes[name]
            change = (temperatures - self.history.initial)[nodes]
            if mesh.centres is not None:
                change[mesh.centres.nodes] = (mesh.centres.given * change[mesh.centres.masters]).sum(axis=1)
            materials = bodies[name].materials
            if not change.any() or not all(getattr(m, "expands", False) for m in materials):
                continue
            value: Any = float(change[0]) if np.ptp(change) == 0.0 else NodeValues(mesh.points, change)
            found.append(ThermalStrain(name, value))
        return found

    def _prints(self) -> tuple[Print, ...]:
        found = []
        for step, card in self.history.prints:
            where = card.name_of("NSET") or card.name_of("ELSET") or card.name_of("SURFACE")
            variables = tuple(entry.upper() for row in card.rows for entry in row if entry)
            found.append(Print(step, card.written, where, variables, card.name_of("TOTALS"), card.origin))
        return tuple(found)
