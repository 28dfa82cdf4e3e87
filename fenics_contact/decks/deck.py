"""Decks of CalculiX and Abaqus as scenes with load steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fenics_contact._base.checks import naming_arguments, require_file
from fenics_contact._base.display import displayed
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.decks.bodies import DeckBodies, bodies_of
from fenics_contact.decks.cards import DeckCards, Record, steps_of
from fenics_contact.decks.couplings import drawn
from fenics_contact.decks.loads import LoadBuilder
from fenics_contact.decks.names import names_of
from fenics_contact.decks.pairs import Pairs, pairs_of
from fenics_contact.decks.shells import ShellPrints, on_solids
from fenics_contact.decks.spring_ends import springs_of
from fenics_contact.decks.supports import SupportBuilder
from fenics_contact.decks.tables import Print, PrintTable
from fenics_contact.decks.vocabulary import HEAT, PROCEDURES, refuse_unknown
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.readers.deck_assembly import read_cards
from fenics_contact.readers.deck_cards import NO_INSTANCES, Card, DeckError, Instances, Origin
from fenics_contact.readers.deck_mesh import MeshCards

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.results.state import State


#: Components of stresses in the order of the deck's tables.
_COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


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
        node_numbers: Body -> numbers in the deck of the nodes of its mesh, 0 for nodes that it has not. Nodes
            across shells have numbers above all of the deck.
        element_numbers: Body -> numbers in the deck of the cells of its mesh.
        node_sets: Name -> numbers of nodes in the deck, ascending.
        element_sets: Name -> numbers of elements in the deck, ascending.
        mesh: Its mesh with sets and surfaces named as in the scene.
        instances: How the numbers above are those of instances of parts, whose nodes and elements have other
            numbers there; one without a name where there are none.
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
    _shells: ShellPrints = field(repr=False)
    instances: Instances = field(default=NO_INSTANCES, repr=False)
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
            raise InvalidInputError(f"the deck {self.name} says of {part!r}: {known}; got {name!r}")
        return self._origins[part, name]

    @property
    def sources(self) -> Mapping[tuple[str, str], Origin]:
        """All parts with where they are said."""
        return self._origins

    def problem(self, comm: MPI.Comm, **settings: Any) -> ContactProblem:
        """Return the problem before the first step, unsolved; settings are those of `ContactProblem`.

        With beams the tolerance is 1e-6 by default.
        """
        if not {"solver", "tolerance"} & settings.keys():
            settings["tolerance"] = self._shells.tolerance
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
        TOTALS a last row, of number 0, has the sums. Other variables are in the files for ParaView.

        Args:
            state: The state at the end of the step.
            step: Number of the deck's step, from 0.
        """
        asked = [each for each in self.prints if each.step == step]
        return [self._in_instances(table) for each in asked for table in self._tables(each, state)]

    def _in_instances(self, table: PrintTable) -> PrintTable:
        """Return a table with the numbers that nodes and elements have in their instances."""
        if len(self.instances.names) == 1:
            return table
        names, own = self.instances.own(table.rows[:, 0])
        return replace(table, rows=np.column_stack([own, table.rows[:, 1:]]), instances=tuple(names))

    def _tables(self, asked: Print, state: State) -> Iterator[PrintTable]:
        for variable in asked.variables:
            name = f"{asked.card} {variable} {asked.where}".strip()
            if asked.card == "NODE PRINT" and variable in ("U", "RF"):
                rows = self.of_nodes(asked.where, state, variable)
                if asked.totals:
                    sums = [0.0, *rows[:, 1:].sum(axis=0)]
                    rows = np.vstack([rows[:0] if asked.totals == "ONLY" else rows, sums])
                short = {"U": "u", "RF": "f"}[variable]
                names = [f"{short}{axis}" for axis in "xyz"[: rows.shape[1] - 1]]
                yield PrintTable(name, ("node", *names), rows)
            elif asked.card == "EL PRINT" and variable == "S":
                names = [f"S{'xyz'[a]}{'xyz'[b]}" for a, b in _COMPONENTS]
                yield PrintTable(name, ("element", *names), self._of_elements(asked.where, state))

    def of_nodes(self, where: str, state: State, variable: str) -> np.ndarray:
        """Return displacements or reactions of nodes behind their numbers, (n, 1 + dim). Collective.

        Args:
            where: A set of nodes, all if empty.
            state: The state.
            variable: "U" or "RF".
        """
        found = list[np.ndarray]()
        for body, nodes in self.node_numbers.items():
            if variable == "U":
                found.append(self._shells.moved(nodes, state.gather_displacement(body)))
            else:
                found.append(self._shells.summed(nodes, state.nodal_reactions(body) * self.thickness))
        if variable == "RF" and self._shells.is_held:
            found.append(self._shells.held(state.constraints()))
        rows = np.vstack(found)
        rows = rows[np.isin(rows[:, 0], self.node_sets[where])] if where else rows
        nodes, first, number = np.unique(rows[:, 0], return_index=True, return_inverse=True)
        if variable == "U" or len(nodes) == len(rows):
            return rows[first]
        sums = [np.bincount(number.ravel(), column) for column in rows[:, 1:].T]  # of bodies that share nodes
        return np.column_stack([nodes, *sums])

    def are_of_shells(self, nodes: np.ndarray) -> np.ndarray:
        """Return which numbers of nodes are those of shells, same shape."""
        return np.isin(nodes, self._shells.sources)

    def across_shells(self, nodes: np.ndarray) -> np.ndarray:
        """Return numbers of nodes with those of the nodes across the thickness of shells, ascending."""
        return self._shells.across(nodes)

    def on_shells(self, kind: str, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return values of a field of a file behind numbers of nodes, (n, 1 + k), on the nodes of shells."""
        return self._shells.flat(kind, nodes, values)

    def nodes_of_shells(self, nodes: np.ndarray) -> np.ndarray:
        """Return the numbers of the nodes of shells that nodes across their thickness belong to."""
        return self._shells.owners(nodes)

    def _of_elements(self, where: str, state: State) -> np.ndarray:
        """Return the mean stresses of elements behind their numbers."""
        found = []
        for body, elements in self.element_numbers.items():
            mine = np.flatnonzero(np.isin(elements, self.element_sets[where] if where else elements))
            stress = state.gather_stress(body)[mine]
            found.append(np.column_stack([elements[mine], *(stress[:, a, b] for a, b in _COMPONENTS)]))
        rows = np.vstack(found)
        return rows[np.argsort(rows[:, 0], kind="stable")]


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
    chosen = _leading_statics if statics_only else _all
    return on_root_then_bcast(comm, lambda: _read(Path(path), chosen))


def conducts(path: Path) -> bool:
    """Return whether a step of a deck conducts heat."""
    return path.is_file() and any(card.name in HEAT for card in read_cards(path))


#: Splits cards into those that are read and those that are left out.
Chosen: TypeAlias = Callable[[Sequence[Card]], tuple[Sequence[Card], Sequence[Card]]]


def _all(cards: Sequence[Card]) -> tuple[Sequence[Card], Sequence[Card]]:
    return cards, ()


def _read(path: Path, chosen: Chosen = _all) -> Deck:
    require_file(path, "a deck")
    cards, left = chosen(read_cards(path))
    record = Record()
    if left:
        record.note(left[0], "this step and all behind it are left out: they are no statics")
    return deck_of(path.name, cards, record)


def deck_of(name: str, cards: Sequence[Card], record: Record) -> Deck:
    """Return the deck of some cards of a file."""
    refuse_unknown(cards)
    try:
        deck = DeckCards.of(name, cards, record)
        deck, steps = steps_of(deck)
        steps = on_solids(deck, steps)
        deck = deck.cut_where_loaded(steps)
        deck.note_without_effect()
        built = bodies_of(deck, steps, names_of(deck, steps))
        return _built(built)
    except DeckError:
        raise
    except InvalidInputError as error:
        raise DeckError(str(error), name) from error


def _leading_statics(cards: Sequence[Card]) -> tuple[Sequence[Card], Sequence[Card]]:
    """Return the cards before the first step that is not static, and those from it on."""
    begin, steps = 0, 0
    for place, card in enumerate(cards):
        if card.name == "STEP":
            begin, steps = place, steps + 1
        other = card.name in PROCEDURES or (card.name == "STEP" and "PERTURBATION" in card.parameters)
        if other and steps == 1:
            raise card.error("the first step is not static: nothing remains; start with a *STATIC step")
        if other and steps:
            return cards[:begin], [card, *cards[place:]]
    return cards, []


def _built(built: DeckBodies) -> Deck:
    """Return the deck: the scene before the first step, and the steps."""
    supports, pairs = SupportBuilder(built), pairs_of(built)
    scene = _scene(built, supports, pairs)
    return deck_with(built, scene, *_load_steps(built, supports, pairs, scene), built.steps.prints)


def deck_with(
    built: DeckBodies,
    scene: Scene,
    steps: Sequence[LoadStep],
    step_of: Sequence[int],
    prints: Sequence[tuple[int, Card]],
) -> Deck:
    """Return a deck of a scene and its steps, with the numbers of the mesh."""
    deck, mesh = built.deck, built.deck.mesh
    return Deck(
        name=deck.name,
        scene=scene,
        steps=steps,
        step_of=step_of,
        prints=tuple(_print(step, card) for step, card in prints),
        notes=tuple(deck.record.notes),
        thickness=deck.thickness,
        node_numbers={n: np.where(at < 0, 0, mesh.numbers[at]) for n, at in built.parts.nodes.items()},
        element_numbers={
            part.name: mesh.element_numbers[mesh.in_cell_order(part.elements)] for part in deck.components
        },
        node_sets={name: np.sort(mesh.numbers[members]) for name, members in mesh.node_sets.items()},
        element_sets={n: np.sort(mesh.element_numbers[members]) for n, members in mesh.element_sets.items()},
        mesh=built.mesh_cards(),
        _shells=ShellPrints.of(deck, built.steps),
        instances=deck.cards[0].instances,
        _origins=deck.record.origins,
    )


def _scene(built: DeckBodies, supports: SupportBuilder, pairs: Pairs) -> Scene:
    """Return the scene before the first step; errors of a pair name its card."""
    contacts, ties = [pair for _, pair in pairs.contacts], [pair for _, pair in pairs.ties]
    alone = [(of, {"contacts": (pair,)}) for of, pair in pairs.contacts]
    for of, part in [*alone, *((of, {"ties": (pair,)}) for of, pair in pairs.ties)]:
        try:
            Scene(built.bodies, **part)  # type: ignore[arg-type]
        except InvalidInputError as error:
            raise of.card.error(str(error)) from error
    held = supports.at(built.steps.at_rest)
    return Scene(
        built.bodies,
        held,
        (),
        contacts,
        ties,
        supports.preloads,
        constraints=supports.constraints(),
        springs=springs_of(built),
    )


def _load_steps(
    built: DeckBodies, supports: SupportBuilder, pairs: Pairs, scene: Scene
) -> tuple[tuple[LoadStep, ...], tuple[int, ...]]:
    """Return the load steps, and the step of the deck of each."""
    found, step_of = list[LoadStep](), list[int]()
    loads, forced = LoadBuilder(built), iter(built.names.forced)
    deck, before = built.deck, replace(built.steps.at_rest, held=built.steps.at_rest.held * np.nan)
    for number, (step, change) in enumerate(zip(built.steps.steps, deck.changes, strict=True)):
        deck.record.origins["step", step.name] = step.card.origin
        contacts = None
        if change is not None:
            both = zip(pairs.contacts, scene.contacts, strict=True)
            contacts = [new for (of, _), pair in both for new in change.applied(of, pair, deck.note)]
        for instant in step.instants:
            last = instant is step.instants[-1]
            drawn_now = None
            if deck.bolts:
                bolts = zip(deck.bolts, supports.preloads, strict=True)
                drawn_now = [aim for bolt, held in bolts for aim in drawn(bolt, held, instant, before)]
            found.append(LoadStep(
                step.name if last else f"{step.name}, time {instant.time:g}",
                loads.at(instant, next(forced)),
                supports.at(instant),
                instant.time,
                drawn_now,
                contacts=contacts,
                constraints=supports.values(instant),
            ))  # fmt: skip
            before = instant
            step_of.append(number)
    return tuple(found), tuple(step_of)


def _print(step: int, card: Card) -> Print:
    where = card.name_of("NSET") or card.name_of("ELSET") or card.name_of("SURFACE")
    variables = [entry.upper() for row in card.rows for entry in row if entry]
    variables += ["SECTION FORCES"] if "SECTIONFORCES" in card.parameters else []
    totals, output = card.name_of("TOTALS"), card.name_of("OUTPUT")
    return Print(step, card.written, where, tuple(variables), totals, output, card.origin)
