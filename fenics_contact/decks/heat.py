"""Decks whose steps conduct heat, as scenes of heat."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checks import naming_arguments, require_file
from fenics_contact._base.display import displayed
from fenics_contact._scene.pairs import Tie
from fenics_contact.decks.bodies import DeckBodies
from fenics_contact.decks.cards import DeckCards, Record
from fenics_contact.decks.deck import Deck, deck_of, deck_with
from fenics_contact.decks.heat_coupled import EVERYWHERE, both_ways
from fenics_contact.decks.heat_materials import conductor_of, passage_of, read_passages
from fenics_contact.decks.heat_statics import Temperatures, moving, statics_of, warmer
from fenics_contact.decks.heat_steps import Acting, HeatCards, Whole, heat_steps
from fenics_contact.decks.names import names_of
from fenics_contact.decks.pairs import pairs_of
from fenics_contact.decks.steps import groups_of, read_steps
from fenics_contact.decks.vocabulary import HEAT_CARDS, HEAT_MODEL, KNOWN, PRINT_CARDS, refuse_unknown
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.heat.parts import HeldTemperature
from fenics_contact.heat.problem import solve_heat
from fenics_contact.heat.properties import Conductor
from fenics_contact.heat.scene import ConductingBody, HeatScene, ThermalContact
from fenics_contact.heat.state import HeatState
from fenics_contact.heat.time import heat_in_time
from fenics_contact.readers.deck_assembly import read_cards
from fenics_contact.readers.deck_bodies import Component, build_bodies, regions_of, split_sections
from fenics_contact.readers.deck_cards import Card, DeckError

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True, eq=False)
class Placed:
    """What makes a part of a scene: where it is, and the first of its values follows an amplitude."""

    of: Acting
    body: str
    name: str

    def at(self, factors: np.ndarray) -> Any:
        """Return the part with factors of amplitudes by their numbers."""
        first, *rest = self.of.values
        return self.of.make(self.body, self.name, float(first * factors[self.of.by]), *rest)


@displayed
@dataclass(frozen=True, eq=False)
class HeatDeck:
    """A deck of CalculiX or Abaqus whose steps conduct heat.

    Attributes:
        frame: Its mesh, numbers, sets, prints and notes.
        bodies: Its bodies by name.
        contacts: Its contact pairs with a conductance.
        ties: Its ties, whose temperatures are equal.
        initial: Initial temperatures of the nodes of each body.
        steps: Its steps that conduct heat, with what makes the parts of their scenes.
        moving: Numbers of the steps of the deck, from 0, in which bodies move.
    """

    frame: Deck
    bodies: Mapping[str, ConductingBody]
    contacts: Sequence[ThermalContact]
    ties: Sequence[Tie]
    initial: Mapping[str, np.ndarray]
    steps: Sequence[tuple[HeatCards, Sequence[Placed]]]
    moving: Sequence[int]
    _cards: Sequence[Card] = field(repr=False)

    def scene(self, step: int = 0, time: float | None = None) -> HeatScene:
        """Return the scene of a step, numbered from 0, at a time since it began, by default at its end."""
        cards, placed = self.steps[step]
        factors = cards.factors(cards.period if time is None else time)
        held = [each.at(factors) for each in placed if each.of.make is HeldTemperature]
        loads = [each.at(factors) for each in placed if each.of.make is not HeldTemperature]
        return HeatScene(self.bodies, held, loads, self.contacts, self.ties)

    def solve(self, comm: MPI.Comm, **settings: Any) -> list[Any]:
        """Compute the state at the end of each step. Collective; settings are those of `increments`."""
        last = {number: state for number, _, state in self.increments(comm, **settings)}
        return list(last.values())

    def increments(self, comm: MPI.Comm, error: float = 1e-3, **cut: Any) -> Iterator[tuple[int, float, Any]]:
        """Yield step, time since it began and state where steps end or amplitudes turn. Collective.

        Steps in time are as long as the deck says with DIRECT, by Euler's rule as there; else they err by no
        more than a part of the range of temperatures that are given. Where contact acts on heat each is half
        as long again as the one before, up to the longest of the deck, and states are `HeatedState`.

        Args:
            comm: Communicator.
            error: This part; ``partitions`` are as for `solve_heat`.
        """
        if self.acts_back:
            every = [each for each, _ in self.steps]
            yield from both_ways(self.mechanics[0], self.scene, every, self.initial, comm, **cut)
            return
        state: Any = self.initial
        for number, (cards, _) in enumerate(self.steps):
            if cards.steady:
                state = solve_heat(self.scene(number), comm, **cut)
                yield number, cards.period, state
                continue
            start = [T for own in self.initial.values() for T in (own.min(), own.max())]
            known = float(np.ptp([*self.scene(number).levels, *start])) or 1.0
            how: Any = {"tolerance": error * known}
            if cards.direct:
                how = {"step": cards.first, "scheme": "euler"}
            history = heat_in_time(
                partial(self.scene, number), comm, cards.period, state, outputs=cards.turns, **how, **cut
            )
            for time, state in zip(history.times[1:], history.states, strict=True):
                yield number, float(time), state

    def statics(self, states: Sequence[HeatState]) -> Deck:
        """Return the deck of the steps in which bodies move, at the temperatures of states.

        Steps with both procedures, and ``*STATIC``, have the temperatures of the last step that conducts
        heat, reached along a line. Heat does not depend on the deformation.

        Args:
            states: The state at the end of each step that conducts heat.

        Raises:
            InvalidInputError: If bodies move in no step.
        """
        if not self.moving or self.acts_back:
            raise InvalidInputError(
                f"{self.frame.name} has no step in which bodies move at known temperatures: add *STATIC"
            )
        pairs = zip(self.steps, states, strict=True)
        found = {cards.number: self._by_number(state.temperature) for (cards, _), state in pairs}
        return deck_of(self.frame.name, list(statics_of(self._cards, found, {})), Record())

    @cached_property
    def mechanics(self) -> Sequence[Deck]:
        """The deck of the steps in which bodies move, if any do, at no temperatures yet, and one more."""
        times = {cards.number: cards.ends for cards, _ in self.steps} if self.acts_back else {}
        cards = (list(warmer(self._cards, *self._by_number(self.initial), times)) for _ in self.moving[:1])
        return [deck_of(self.frame.name, each, Record()) for each in cards]

    @property
    def acts_back(self) -> bool:
        """Whether pressures, gaps or friction of bodies that move act on heat."""
        return bool(self.contacts) and any(cards.number in self.moving for cards, _ in self.steps)

    @property
    def notes(self) -> Sequence[str]:
        """What is done otherwise than the deck says, and known cards without effect."""
        every = [*self.frame.notes, *(note for each in self.mechanics for note in each.notes)]
        return list(dict.fromkeys(every))

    def _by_number(self, temperature: Mapping[str, np.ndarray]) -> Temperatures:
        """Return numbers of nodes and their temperatures."""
        own = [(n[n > 0], temperature[body][n > 0]) for body, n in self.frame.node_numbers.items()]
        numbers, values = (np.concatenate(each) for each in zip(*own, strict=True))
        return numbers, values


@naming_arguments
def read_heat_deck(path: str | Path, comm: MPI.Comm | None = None) -> HeatDeck:
    """Read a deck with steps that conduct heat, alone, coupled with mechanics, or before ``*STATIC``.

    Elements of heat (DC3D8, ...) and of mechanics (C3D8, ...) conduct alike, integrated in full. What holds
    and loads bodies mechanically is left out where they do not move, which the notes say.

    Args:
        path: The file, mostly ``.inp``.
        comm: If given, rank 0 reads the file and all ranks receive the deck.

    Raises:
        DeckError: With card and line, if a card, an element, a set or a parameter is not known or does not
            fit.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> states = read_heat_deck("fin.inp").solve(MPI.COMM_WORLD)  # doctest: +SKIP
    """
    return on_root_then_bcast(comm, lambda: _read(Path(path)))


def _read(path: Path) -> HeatDeck:
    require_file(path, "a deck")
    given = read_cards(path)
    cards = [_solid(card) for card in given]
    refuse_unknown(cards, KNOWN | HEAT_CARDS)
    start = next((k for k, card in enumerate(cards) if card.name == "STEP"), len(cards))
    frame = [card for card in cards[:start] if card.name in HEAT_MODEL]
    deck = DeckCards.of(path.name, frame, Record())
    moves = moving(cards)
    for card in cards:
        if not moves and card.name not in HEAT_MODEL | HEAT_CARDS | PRINT_CARDS:
            deck.note(card, "has no effect on heat")
        deck.note_idle(card)
        if card.name == "EQUATION" and any(len(row) > 1 and row[1] == "11" for row in card.rows):
            raise card.error("equations of temperatures are not solved: join bodies by *TIE")
    steps = heat_steps(cards, deck.mesh)
    for card in [card for card in cards if card.name == "STATIC"][: steps[0].number if steps else 0]:
        deck.note(card, "is before heat is computed: NT of this step is not written")
    heated = [each.at.elements for step in steps for each in step.acting if each.at.sides[0] == Whole.VOLUME]
    sets = [(f"DFLUX {k}", elements) for k, elements in enumerate(heated, start=1)]
    mesh, sections, of_element, parts = split_sections(
        deck.mesh, deck.sections, deck.of_element, deck.components, sets
    )
    deck = replace(deck, mesh=mesh, sections=sections, of_element=of_element, components=parts)
    made = replace(_Builder(deck, cards, steps).made(), moving=moves, _cards=given)
    _ = made.notes  # refuses mechanics before anything is solved
    apart = {"HEATTRANSFER", "STATIC", "MODELCHANGE", "CHANGEFRICTION", "PRE-TENSIONSECTION"}
    for card in (each for each in cards if made.acts_back and each.name in apart):
        raise card.error("does not go with contact that acts on heat: give coupled steps alone")
    return made


def _solid(card: Card) -> Card:
    """Return a card with elements of heat as solid ones; reduced ones are integrated in full."""
    if card.name != "ELEMENT":
        return card
    match = re.fullmatch(r"D?(C3D|C2D|CPS|CPE|CAX)(\d+)(R?)[A-Z]*", card.name_of("TYPE"))
    if match is None:
        raise card.error(
            f"elements of type {card.name_of('TYPE')} do not conduct heat here: give solid ones (DC3D, C3D), "
            "plane ones (DC2D, CPS, CPE) or axisymmetric ones (DCAX, CAX)"
        )
    kind = match[1].replace("C2D", "CPE") + match[2] + match[3]
    return replace(card, parameters={**card.parameters, "TYPE": kind})


class _Builder:
    """Names what is held and heated, and makes the bodies with these names."""

    def __init__(self, deck: DeckCards, cards: Sequence[Card], steps: Sequence[HeatCards]) -> None:
        self.deck, self.cards, self.steps = deck, cards, steps
        names, self.known = names_of(deck, read_steps(deck.cards, deck.mesh)), dict[bytes, str]()
        surfaces, node_sets = dict(names.surfaces), dict(names.node_sets)
        node_sets[EVERYWHERE] = np.arange(len(deck.mesh.points))
        for each in (each for step in steps for each in step.acting):
            if each.at.sides[0] == Whole.NODE:
                node_sets[self._name(each)] = each.at.elements
            elif each.at.sides[0] != Whole.VOLUME:
                deck.exterior.require(each.at, each.card, each.row, "heat must enter", "correct it")
                surfaces[self._name(each)] = each.at
        self.parts = build_bodies(
            deck.mesh, deck.components, deck.of_element, deck.sections, surfaces, node_sets,
            f"deck '{deck.name}'",
        )  # fmt: skip
        self.built = DeckBodies(deck, read_steps(deck.cards, deck.mesh), names, self.parts, {})

    def _name(self, of: Acting) -> str:
        """Return the name of nodes or faces, always the same one."""
        key = of.at.elements.tobytes() + of.at.sides.tobytes()
        return self.known.setdefault(key, f"{of.card.written} {len(self.known) + 1}")

    def made(self) -> HeatDeck:
        """Return the deck."""
        deck, meshes = self.deck, self.parts.meshes
        for first, second, _ in self.parts.joints():
            words = f"bodies {first} and {second} share nodes, but no faces: heat passes by *TIE"
            raise DeckError(words, deck.name)
        bodies = {part.name: self._body(part) for part in deck.components}
        contacts, ties = self._contacts()
        steps = [(step, [*self._placed(step.acting)]) for step in self.steps]
        every = self.built.steps.initial
        initial = {
            # The centres of cells, which the deck has not, follow the nodes around them.
            name: mesh.followers.followed(mesh.n_nodes) @ every[self.parts.nodes[name][: mesh.n_nodes]]
            for name, mesh in meshes.items()
        }
        known = any(card.name == "INITIALCONDITIONS" for card in self.cards)
        for step in () if known else (step for step in self.steps if not step.steady):
            raise step.card.error(
                "needs temperatures at its start: add *INITIAL CONDITIONS, TYPE=TEMPERATURE"
            )
        scene = HeatScene(bodies, contacts=contacts, ties=ties).geometry
        inside = [group for group in groups_of(self.cards) if group[0].name == "STEP"]
        prints = [(k, card) for k, own in enumerate(inside) for card in own if card.name in PRINT_CARDS]
        frame = deck_with(self.built, scene, (), range(len(inside)), prints)
        return HeatDeck(frame, bodies, contacts, ties, initial, steps, (), ())

    def _contacts(self) -> tuple[list[ThermalContact], list[Tie]]:
        """Return contact pairs with a conductance, and ties."""
        deck, pairs, known = self.deck, pairs_of(self.built), read_passages(self.cards)
        size, contacts, ties = float(np.ptp(deck.mesh.points, axis=0).max()), [], []
        for of, pair in pairs.contacts:
            laws = known.get(of.card.name_of("INTERACTION"), {})
            if not laws.keys() - {"FRICTION"}:
                deck.note(of.card, "passes no heat: its interaction has no *GAP CONDUCTANCE")
                continue
            passage = passage_of(laws, max(pair.adjust or 0.0, 1e-4 * size))
            contacts.append(ThermalContact(pair.slave, pair.master, **passage))
        for step in self.steps if contacts else ():
            if step.card.name.startswith("UNCOUPLED"):
                deck.note(step.card, "contact acts on heat, both are solved until they agree")
        for of, tie in pairs.ties:
            if not isinstance(tie, Tie):
                raise of.error("sectors around an axis do not conduct heat here: mesh all of it")
            ties.append(tie)
        return contacts, ties

    def _body(self, part: Component) -> ConductingBody:
        deck, given = self.deck, dict[str, Conductor]()
        sections = regions_of(deck.sections, part)
        for region, each in sections.items():
            cards = each.card.known("material", each.material, deck.materials)
            given[region] = conductor_of(cards, deck.orientations.get(each.orientation), deck.dim)
        flat = deck.kind in ("plane stress", "plane strain")
        thick = {each.thickness for each in sections.values()} if flat else {1.0}
        if len(thick) > 1:
            raise deck.sections[0].card.error("one plane body must have one thickness: cut it, and tie parts")
        material: Any = given if len(given) > 1 else next(iter(given.values()))
        return ConductingBody(self.parts.meshes[part.name], material, deck.kind == "axisymmetric", *thick)

    def _placed(self, acting: Sequence[Acting]) -> Iterator[Placed]:
        """Yield what is given to nodes, faces and volumes, body by body."""
        deck = self.deck
        for each in acting:
            if each.at.sides[0] != Whole.VOLUME:
                name = self._name(each)
                found = [Placed(each, body, name) for body in self.built.bodies_with(name)]
            else:
                found = [
                    Placed(each, part.name, region if len(part.sections) > 1 else "")
                    for part in deck.components
                    for region, number in zip(regions_of(deck.sections, part), part.sections, strict=True)
                    if np.isin(np.flatnonzero(deck.of_element == number), each.at.elements).all()
                ]
            if not found:
                deck.note(each.card, f"nodes of line {each.card.numbers[each.row]} belong to no element")
            yield from found
