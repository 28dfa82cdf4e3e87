"""Steps of heat of a deck: which temperatures it holds, and what heats and cools, by nodes and faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, TypeAlias

import numpy as np

from fenics_contact.decks.steps import Amplitudes, groups_of
from fenics_contact.decks.vocabulary import HEAT
from fenics_contact.heat.parts import (
    Convection,
    HeatAtNodes,
    HeatFlux,
    HeatSource,
    HeldTemperature,
    Radiation,
)
from fenics_contact.readers.deck_cards import AtLine, Card, plain
from fenics_contact.readers.deck_mesh import DeckMesh, Faces

#: Makes a part of a scene of the body, a place in it, and the numbers of a line.
Maker: TypeAlias = Callable[..., Any]


def _source(body: str, region: str, value: float) -> HeatSource:
    return HeatSource(body, value, region)


def _film(body: str, surface: str, ambient: float, coefficient: float) -> Convection:
    return Convection(body, surface, coefficient, ambient)


def _radiation(body: str, surface: str, ambient: float, emissivity: float, *constants: float) -> Radiation:
    return Radiation(body, surface, emissivity, ambient, *constants)


#: Letter of the faces of a card, numbers of its lines, and what they make.
_ON_FACES: Mapping[str, tuple[str, int, Maker]] = {
    "DFLUX": ("S", 1, HeatFlux), "FILM": ("F", 2, _film), "RADIATE": ("R", 2, _radiation),
}  # fmt: skip
#: Entries of the value behind the component in a line, and what it makes.
_AT_NODES: Mapping[str, tuple[int, Maker]] = {"BOUNDARY": (2, HeldTemperature), "CFLUX": (1, HeatAtNodes)}
#: What ends of labels ask for that is not there.
_OTHERS = {
    "CR": "radiation between the surfaces of a cavity is not solved: give the temperature around (R1, R2, "
    "...), or let surfaces that face each other exchange heat by GapRadiation in Python",
    "NU": "fluxes and films of user routines are not read: give numbers, or functions in Python",
    "FC": "fluid networks are not solved: give the temperature of the fluid (F1, F2, ...)",
}


class Whole(IntEnum):
    """In place of the side of an element: all of it, or a node."""

    VOLUME = -1
    NODE = -2


@dataclass(frozen=True, eq=False)
class Acting(AtLine):
    """What a line gives to faces of elements, to volumes, or to nodes in place of elements.

    `values`: a temperature or heat, and what belongs to it; `by`: number of the amplitude of the first.
    """

    card: Card
    row: int
    make: Maker
    at: Faces
    values: tuple[float, ...]
    by: int


@dataclass(frozen=True, eq=False)
class HeatCards:
    """A step of heat as the deck has it.

    `number`: that of the step in the deck, from 0; `card`: its procedure; `steady`: whether nothing is
    stored; `start` and `period`: total time before it and its own; `first` and `most`: length of its first
    and its longest increment; `direct`: whether all have this length; `ramped`: whether what has no amplitude
    grows from zero.
    """

    number: int
    card: Card
    steady: bool
    start: float
    period: float
    first: float
    most: float
    direct: bool
    ramped: bool
    acting: Sequence[Acting]
    amplitudes: Amplitudes

    @property
    def turns(self) -> list[float]:
        """Times since it began at which amplitudes turn, and its end."""
        times = self.amplitudes.times(np.array([each.by for each in self.acting], dtype=int), self.start)
        return sorted({t for t in times if 1e-9 < t / self.period < 1.0 - 1e-9} | {self.period})

    @property
    def ends(self) -> list[float]:
        """Ends of increments: each is half as long again as the one before, up to the longest."""
        time = length = np.inf if self.steady else self.first
        found = self.turns
        while time < self.period * (1.0 - 1e-9):
            found.append(time)
            length = min(1.5 * length, self.most)
            time += length
        return sorted(set(found))

    def factors(self, time: float) -> np.ndarray:
        """Return the factors of amplitudes by their numbers at a time since the step began."""
        known = self.amplitudes.factors(time, self.start + time)
        known[0] = min(time / self.period, 1.0) if self.ramped else 1.0
        return known


def heat_steps(cards: Sequence[Card], mesh: DeckMesh) -> list[HeatCards]:
    """Return the steps of a deck, each with what the ones before it have left."""
    amplitudes, acting, found = Amplitudes.of(cards), list[Acting](), list[HeatCards]()
    physics = [card for card in cards if card.name == "PHYSICALCONSTANTS"]
    constants = tuple(card.number_of(n) for card in physics[-1:] for n in ("ABSOLUTEZERO", "STEFANBOLTZMANN"))
    number, start = -1, 0.0
    for head, *rest in groups_of(cards):
        new = {card.name for card in (head, *rest) if card.name_of("OP") == "NEW"}
        acting = [each for each in acting if each.card.name not in new]
        for card in (head, *rest):
            if card.name in _AT_NODES:
                acting += _at_nodes(card, mesh, amplitudes.number(card))
            elif card.name in _ON_FACES:
                acting += _on_faces(card, mesh, amplitudes.number(card), constants)
        if head.name != "STEP":
            continue
        number, card = number + 1, procedure_of([head, *rest])
        numbers = [*(card.floats(0) if card.lines else []), *[0.0] * 4]
        first, period = (each if each > 0.0 else 1.0 for each in numbers[:2])
        if card.name in HEAT:
            for given in (each for each in rest if each.name == "TEMPERATURE"):
                raise given.error("is not known before it is computed: hold it by *BOUNDARY of component 11")
            steady = "STEADYSTATE" in card.parameters
            direct = plain(card.parameters.get("DIRECT", "NO")) != "NO"
            ramped = head.name_of("AMPLITUDE") == "RAMP" and not steady
            acting = _last(acting)
            length = first, first if direct else numbers[3] or period, direct
            found.append(HeatCards(number, card, steady, start, period, *length, ramped, acting, amplitudes))
        start += period
    return found


def procedure_of(group: Sequence[Card]) -> Card:
    """Return the card of a step that says what is solved."""
    for card in group:
        if card.name in HEAT or card.name == "STATIC":
            return card
    raise group[0].error("needs *HEAT TRANSFER, *STATIC or both coupled: nothing else is solved here")


def _at_nodes(card: Card, mesh: DeckMesh, by: int) -> Iterator[Acting]:
    """Yield what a card gives to nodes by component 11 or 0; displacements have no effect."""
    place, make = _AT_NODES[card.name]
    for row, entries in enumerate(card.rows):
        component = entries[1] if len(entries) > 1 else ""
        if component in ("0", "11"):
            if {"FIXED", "TYPE"} & set(card.parameters):
                raise card.error("holds temperatures by their values alone: leave FIXED and TYPE out")
            nodes = mesh.nodes_named(entries[0], card, row)
            value = [*card.floats(row, 1), 0.0, 0.0][place]
            yield Acting(card, row, make, Faces(nodes, np.full(len(nodes), Whole.NODE)), (value,), by)
        elif card.name == "CFLUX" or entries[2:3] == ["11"]:
            raise card.error(f"needs node or set, 11 and a number, got component {component!r}", row)


def _on_faces(card: Card, mesh: DeckMesh, by: int, constants: tuple[float, ...]) -> Iterator[Acting]:
    """Yield what a card gives to faces and volumes."""
    letter, count, make = _ON_FACES[card.name]
    for row, entries in enumerate(card.rows):
        name, label = [*map(plain, entries[:2]), ""][:2]
        if label[-2:] in _OTHERS:
            raise card.error(f"{label}: {_OTHERS[label[-2:]]}", row)
        numbers = tuple(card.floats(row, 2))[:count]
        if len(numbers) < count:
            raise card.error(f"needs {count} numbers behind {label!r}, got {len(numbers)}: add them", row)
        if letter == "R" and not constants:
            raise card.error("needs *PHYSICAL CONSTANTS with ABSOLUTE ZERO= and STEFAN BOLTZMANN=: add them")
        if label == letter:
            at = mesh.surface_named(name, card, row).faces
        elif label == "BF" and letter == "S":
            elements = mesh.elements_named(name, card, row)
            at = Faces(elements, np.full(len(elements), Whole.VOLUME))
        elif label[:1] == letter and label[1:].isdecimal():
            at = mesh.faces_of(mesh.elements_named(name, card, row), f"S{label[1:]}", card, row)
        else:
            needed = f"{letter}1, {letter}2, ... of elements, {letter} of a surface" + ", BF" * (count == 1)
            raise card.error(f"load {label!r} is not supported: give {needed}", row)
        values = numbers + constants * (letter == "R")
        yield Acting(card, row, _source if label == "BF" else make, at, values, by)


def _last(given: Sequence[Acting]) -> list[Acting]:
    """Return loads where no later one of their kind is, those of equal values together."""
    found = list[Acting]()
    for make in dict.fromkeys(each.make for each in given):
        own = [each for each in given if each.make == make]
        line = np.repeat(np.arange(len(own)), [len(each.at) for each in own])
        rows = np.concatenate([np.column_stack([each.at.elements, each.at.sides]) for each in own])
        _, last = np.unique(rows[::-1], axis=0, return_index=True)
        kept, first = len(line) - 1 - last, dict[object, int]()
        alike = np.array([first.setdefault((each.values, each.by), k) for k, each in enumerate(own)])
        for k in np.unique(alike[line[kept]]).tolist():
            mine = rows[np.sort(kept[alike[line[kept]] == k])]
            found.append(replace(own[k], at=Faces(mine[:, 0], mine[:, 1])))
    return found
