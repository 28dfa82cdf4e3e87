"""Decks of CalculiX and Abaqus as scenes with load steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checks import naming_arguments, require_file
from fenics_contact._base.display import displayed
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact._scene.body import Body
from fenics_contact._scene.constraints import LinearConstraint
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._scene.supports import AnySupport, Roller
from fenics_contact.decks.contact import (
    Sides,
    adjusted,
    build_pairs,
    clearances,
    read_interactions,
    read_sides,
)
from fenics_contact.decks.couplings import drawn
from fenics_contact.decks.loads import LoadBuilder
from fenics_contact.decks.model import Model
from fenics_contact.decks.pair_changes import read_changes
from fenics_contact.decks.steps import Instant
from fenics_contact.decks.supports import SupportBuilder
from fenics_contact.decks.tables import Print, PrintTable, tables_of
from fenics_contact.decks.ties import reach_of
from fenics_contact.decks.unknown import refuse_unknown
from fenics_contact.decks.vocabulary import PROCEDURES, WITHOUT_EFFECT
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import made_once
from fenics_contact.readers.deck_assembly import read_cards
from fenics_contact.readers.deck_cards import Card, DeckError, Instances, Origin
from fenics_contact.readers.deck_mesh import MeshCards

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.results.state import State


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
        mesh: Its mesh with sets and surfaces named as in the scene.
        instances: How the numbers above are those of instances of parts, whose nodes and elements have other
            numbers there; None without any.
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
    mesh: MeshCards = field(repr=False)
    instances: Instances | None = field(default=None, repr=False)
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

    def tables(self, state: State, step: int = 0) -> list[PrintTable]:
        """Return the tables that the deck prints of a step. Collective.

        Displacements (U) of nodes, forces of supports on them (RF), and mean stresses (S) of elements; with
        TOTALS a last row, of number 0, has the sums.

        Args:
            state: The state at the end of the step.
            step: Number of the deck's step, from 0.
        """
        return tables_of(self, state, step)


@naming_arguments
def read_deck(path: str | Path, comm: MPI.Comm | None = None, *, statics_only: bool = False) -> Deck:
    """Read a deck of CalculiX or Abaqus: its mesh, materials, supports, contact, loads and steps.

    Every card is read or is known to have no effect on what is solved; all else is refused with its line.
    Bodies are elements that share faces, named by their element sets; their regions are the sections. Bodies
    that share nodes alone are joined there by a linear constraint. Names are in capitals, as both programs
    read them. A set of nodes that are all nodes of some faces is a surface, another one a set of nodes of the
    mesh.

    Args:
        path: The file, mostly ``.inp``; files that it includes are looked for in its folder.
        comm: If given, rank 0 reads the file and all ranks receive the deck.
        statics_only: Whether the first step of another procedure, such as ``*FREQUENCY``, or of a
            perturbation, and all steps behind it are left out, which `Deck.notes` say. Else they are refused.

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
    return made_once(comm, lambda: _read(Path(path), statics_only))


def _read(path: Path, statics_only: bool = False) -> Deck:
    require_file(path, "a deck")
    cards: Sequence[Card] = read_cards(path)
    first_left = None
    if statics_only:
        cards, first_left = _leading_statics(cards)
    refuse_unknown(cards)
    try:
        builder = _Builder(path.name, cards)
        if first_left is not None:
            builder.model.note(first_left, "this step and all behind it are left out: they are no statics")
        return builder.deck()
    except DeckError:
        raise
    except InvalidInputError as error:
        raise DeckError(str(error), path.name) from error


def _leading_statics(cards: Sequence[Card]) -> tuple[Sequence[Card], Card | None]:
    """Return the cards before the first step that is no statics, and its card; None without any."""
    begin, steps = 0, 0
    for place, card in enumerate(cards):
        if card.name == "STEP":
            begin, steps = place, steps + 1
        other = card.name in PROCEDURES or (card.name == "STEP" and "PERTURBATION" in card.parameters)
        if other and steps == 1:
            raise card.error("the first step is no statics, so that nothing of it is left: give one that is")
        if other and steps:
            return cards[:begin], card
    return cards, None


class _Builder:
    """Builds the scene and the load steps of a deck."""

    def __init__(self, name: str, cards: Sequence[Card]) -> None:
        self.model = Model(name, cards)
        self.supports = SupportBuilder(self.model)
        self.loads = LoadBuilder(self.model, self.supports)

    def deck(self) -> Deck:
        """Return the deck."""
        model = self.model
        for card in model.cards:
            if card.name in WITHOUT_EFFECT and card.name != "HEADING":
                model.note(card, f"has no effect here ({WITHOUT_EFFECT[card.name]})")
            if card.name == "NSET" and "FREQUENCY" in card.parameters:
                model.note(card, "FREQUENCY is of output, it has no effect on a set")
        supported = self.supports.supported()
        sides = self._contact_surfaces()
        self.supports.name_surfaces()
        self.supports.name_nodes()
        self.loads.name_surfaces()
        self._named_surfaces()
        self._named_nodes()
        loaded = self.loads.loaded()
        model.build_meshes()
        bodies = model.bodies()
        preloads = self.supports.preloads()
        supports = self.supports.supports(supported, None)
        rollers, constraints = self.supports.equations()
        supports = (*supports, *rollers)
        scene = self._scene(bodies, supports, *self._pairs(sides), preloads, constraints)
        steps, step_of = self._steps(scene, bodies, supported, loaded, preloads, rollers)
        mesh = model.mesh
        return Deck(
            model.name,
            scene,
            steps,
            step_of,
            self._prints(),
            tuple(model.notes),
            model.thickness,
            {name: np.where(at < 0, 0, mesh.numbers[at]) for name, at in model.parts.nodes.items()},
            {part.name: mesh.element_numbers[model.in_cell_order(part)] for part in model.parts_of_mesh},
            {name: np.sort(mesh.numbers[members]) for name, members in mesh.node_sets.items()},
            {name: np.sort(mesh.element_numbers[members]) for name, members in mesh.element_sets.items()},
            model.mesh_cards(),
            model.cards[0].instances,
            model.origins,
        )

    def _steps(
        self,
        scene: Scene,
        bodies: Mapping[str, Body],
        supported: Mapping[str, tuple[np.ndarray, tuple[int, ...]]],
        loaded: Mapping[int, Sequence[tuple[str, np.ndarray | None]]],
        preloads: Sequence[Preload],
        rollers: Sequence[Roller],
    ) -> tuple[tuple[LoadStep, ...], tuple[int, ...]]:
        """Return the load steps, and the step of the deck of each."""
        steps: list[LoadStep] = []
        step_of = []
        before: Instant | None = None
        for number, step in enumerate(self.model.steps.steps):
            self.model.origins["step", step.name] = step.card.origin
            for instant in step.instants:
                part = "" if instant is step.instants[-1] else f", time {instant.time:g}"
                loads = self.loads.loads(instant, loaded[id(instant)], bodies)
                supports = (*self.supports.supports(supported, instant), *rollers)
                acting = None
                if self.model.bolts:
                    pairs = zip(self.model.bolts, preloads, strict=True)
                    aims = [drawn(bolt, held, instant, before) for bolt, held in pairs]
                    acting = [aim for aim in aims if aim is not None]
                contacts = self._contacts_of(number, scene)
                values = self.supports.equation_values(instant) if self.model.equations else None
                name = f"{step.name}{part}"
                steps.append(
                    LoadStep(
                        name, loads, supports, instant.time, acting, contacts=contacts, constraints=values
                    )
                )
                before = instant
                step_of.append(number)
        return tuple(steps), tuple(step_of)

    def _contacts_of(self, step: int, scene: Scene) -> list[ContactPair] | None:
        """Return the contact pairs of a step that changes them."""
        change = self.changes[step]
        if change is None:
            return None
        pairs = zip(self.sides_of_pairs, scene.contacts, strict=True)
        found = [change.applied(of, pair, self.model.note) for of, pair in pairs]
        return [pair for pair in found if pair is not None]

    def _contact_surfaces(self) -> list[Sides]:
        """Name the surfaces of contact pairs and ties."""
        self.interactions = read_interactions(self.model.cards)
        sides = read_sides(self.model.cards, self.interactions)
        self.changes = read_changes(self.model.cards, self.interactions, sides)
        self.sides_by_name: dict[str, str] = {}
        self.alone: dict[str, str] = {}
        for each in sides:
            self._contact_surface(each.slave, each, alone=not each.tied)
            self._contact_surface(each.master, each)
        return [reached for each in sides for reached in self._reached(each)]

    def _reached(self, of: Sides) -> list[Sides]:
        """Return a pair, or a tie of the faces within its tolerance, if there are any."""
        if of.card.name != "TIE" or of.around is not None:
            return [of]
        model = self.model
        slave, master = (model.surfaces[self.sides_by_name[name]] for name in (of.slave, of.master))
        reach = reach_of(of.card, model.mesh, slave, master)
        for words in reach.in_words(of.slave, of.master, model.mesh):
            model.note(of.card, words)
        if not reach.tied.any():
            return []
        if reach.tied.all():
            return [of]
        name = f"{of.slave} TIED TO {of.master}"
        model.surfaces[name], self.sides_by_name[name] = reach.kept, name
        return [replace(of, slave=name)]

    def _contact_surface(self, name: str, of: Sides, alone: bool = False) -> None:
        """Take the faces of a surface, of one of nodes, or of a node set, those that have all of them.

        `alone`: whether nodes that are not all nodes of some faces may touch one by one.
        """
        if name not in self.model.mesh.surfaces and name in self.model.mesh.node_sets:
            nodes: np.ndarray | None = self.model.mesh.node_sets[name]
            faces, known = self.model.exterior.covering(self.model.mesh.node_sets[name]), False
        else:
            given = self.model.mesh.surface_named(name, of.card, of.row)
            faces, nodes, known = self.model.exterior.faces_of(given), given.nodes, True
        if faces is None and alone and nodes is not None and len(nodes):
            self._touching_nodes(name, nodes, of)
            return
        if faces is None:
            raise of.card.error(
                f"contact is between faces, but the {0 if nodes is None else len(nodes)} nodes of "
                f"{name!r} are not all nodes of some faces: give the faces, as *SURFACE with TYPE=ELEMENT",
                of.row,
            )  # fmt: skip
        self.model.exterior.require(faces, of.card, of.row, f"surface {name!r} must lie", "correct it")
        label = name if known or name not in self.model.mesh.surfaces else f"{name} FACES"
        self.model.surfaces[label] = faces
        self.sides_by_name[name] = label

    def _touching_nodes(self, name: str, nodes: np.ndarray, of: Sides) -> None:
        """Let nodes touch one by one: their slave surface is that of the faces around them."""
        if name not in self.alone:
            label = f"{name} AROUND"
            self.alone[name] = name if name not in self.model.mesh.surfaces else f"{name} NODES"
            self.model.node_sets[self.alone[name]] = np.unique(nodes)
            self.model.surfaces[label] = self.model.exterior.around(nodes)
            self.sides_by_name[name] = label
        self.model.note(
            of.card,
            f"the {len(nodes)} nodes of {name} are not all nodes of some faces and touch one by one, each "
            "with its share of the faces around it as its area",
        )

    def _slave_nodes(self, of: Sides) -> np.ndarray:
        if of.slave in self.alone:
            return self.model.node_sets[self.alone[of.slave]]
        faces = self.model.surfaces[self.sides_by_name[of.slave]]
        return np.unique(np.concatenate([n.ravel() for _, _, _, n in self.model.mesh.parts_of(faces)]))

    def _pairs(self, sides: Sequence[Sides]) -> tuple[list[ContactPair], list[AnyTie]]:
        found = build_pairs(
            sides,
            self.sides_by_name,
            self.model.parts.meshes,
            self.interactions,
            {**adjusted(sides, self._slave_nodes, self.model.mesh), **clearances(self.model.cards)},
            self.alone,
            self.model.note,
        )
        for each, pair in found:
            kind = "contact" if isinstance(pair, ContactPair) else "tie"
            self.model.origins[kind, pair.place] = each.card.origin
        contacts = [(of, pair) for of, pair in found if isinstance(pair, ContactPair)]
        # Those that some step leaves out are the last ones.
        left_out = {pair for change in self.changes if change for pair in change.removed}
        contacts.sort(key=lambda each: (each[0].slave, each[0].master) in left_out)
        self.sides_of_pairs = [of for of, _ in contacts]
        return [pair for _, pair in contacts], [p for _, p in found if not isinstance(p, ContactPair)]

    def _scene(
        self,
        bodies: Mapping[str, Body],
        supports: Sequence[AnySupport],
        contacts: Sequence[ContactPair],
        ties: Sequence[AnyTie],
        preloads: Sequence[Preload],
        constraints: Sequence[LinearConstraint],
    ) -> Scene:
        """Return the scene before the first step; what does not suit the bodies is told with its card."""
        for kind, parts in (("contact", contacts), ("tie", ties)):
            for part in parts:
                try:
                    Scene(bodies, **{f"{kind}s" if kind == "tie" else "contacts": (part,)})  # type: ignore[arg-type]
                except InvalidInputError as error:
                    raise self.model.origins[kind, part.place].error(str(error)) from error
        return Scene(bodies, supports, (), contacts, ties, preloads, constraints=constraints)

    def _named_surfaces(self) -> None:
        """Take all surfaces of the deck that lie on the boundary of bodies."""
        for name, given in self.model.mesh.surfaces.items():
            faces = self.model.exterior.faces_of(given)
            if faces is not None and len(faces) and self.model.exterior.holds(faces).all():
                self.model.surfaces.setdefault(name, faces)
                self.model.origins["surface", name] = given.card.origin

    def _named_nodes(self) -> None:
        inside = self.model.nodes_of_bodies()
        for name, nodes in self.model.mesh.node_sets.items():
            mine = nodes[inside[nodes]]
            if name not in self.model.surfaces and name not in self.model.node_sets and len(mine):
                self.model.place(name, mine)
            self.model.origins["nodes", name] = self.model.mesh.origins[name].origin

    def _prints(self) -> tuple[Print, ...]:
        found = []
        for step, card in self.model.steps.prints:
            where = card.name_of("NSET") or card.name_of("ELSET") or card.name_of("SURFACE")
            variables = tuple(entry.upper() for row in card.rows for entry in row if entry)
            found.append(Print(step, card.written, where, variables, card.name_of("TOTALS"), card.origin))
        return tuple(found)
