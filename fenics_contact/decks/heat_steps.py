"""Steps of heat of a deck: which temperatures it holds, and what heats and cools, by nodes and faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fenics_contact.decks.steps import Amplitudes, groups_of
from fenics_contact.decks.vocabulary import HEAT
from fenics_contact.heat.parts import Convection, HeatFlux, HeatLoad, HeatSource, Radiation
from fenics_contact.readers.deck_cards import AtLine, Card, plain
from fenics_contact.readers.deck_mesh import DeckMesh, Faces, joined

#: Makes a load of the body, a surface or region of it, and the numbers of a line.
Maker: TypeAlias = Callable[..., HeatLoad]


def _source(body: str, region: str, value: float) -> HeatLoad:
    return HeatSource(body, value, region)


def _film(body: str, surface: str, ambient: float, coefficient: float) -> HeatLoad:
    return Convection(body, surface, coefficient, ambient)


def _radiation(body: str, surface: str, ambient: float, emissivity: float, *constants: float) -> HeatLoad:
    return Radiation(body, surface, emissivity, ambient, *constants)


#: Letter of the faces of a card, numbers of its lines, and what they make.
LOADS: Mapping[str, tuple[str, int, Maker]] = {
    "DFLUX": ("S", 1, HeatFlux), "FILM": ("F", 2, _film), "RADIATE": ("R", 2, _radiation),
}  # fmt: skip
#: What ends of labels ask for that is not there.
_OTHERS = {
    "CR": "radiation between the surfaces of a cavity is not solved: give the temperature around (R1, R2, "
    "...), or let surfaces that face each other exchange heat by GapRadiation in Python",
    "NU": "fluxes and films of user routines are not read: give numbers, or functions in Python",
    "FC": "fluid networks are not solved: give the temperature of the fluid (F1, F2, ...)",
}


@dataclass(frozen=True, eq=False)
class Acting(AtLine):
    """What a line gives to faces, or to volumes, whose sides are −1.

    `values`: a flux, or a temperature around and what belongs to it; `by`: amplitude of the first.
    """

    card: Card
    row: int
    make: Maker
    faces: Faces
    values: tuple[float, ...]
    by: int

    @property
    def on_faces(self) -> bool:
        """Whether it is on faces."""
        return bool((self.faces.sides >= 0).all())


@dataclass(frozen=True, eq=False)
class AtNodes:
    """Values of nodes, NaN where there are none, and the numbers of their amplitudes, (n_nodes,) each."""

    values: np.ndarray
    by: np.ndarray

    def groups(self, most: int = 9) -> Iterator[tuple[np.ndarray, np.ndarray, int]]:
        """Yield nodes, their values and the number of their amplitude: of few values those of each alone."""
        there = np.flatnonzero(~np.isnan(self.values))
        keys = np.column_stack([self.by[there], self.values[there]])
        keys = keys if len(np.unique(keys, axis=0)) <= most else keys[:, :1]
        for key in np.unique(keys, axis=0):
            nodes = there[(keys == key).all(axis=1)]
            yield nodes, self.values[nodes], int(key[0])


@dataclass(frozen=True, eq=False)
class HeatCards:
    """A step of heat as the deck has it.

    `card`: its procedure; `steady`: whether nothing is stored; `start` and `period`: total time before it and
    its own; `first`: length of its first increment; `direct`: whether all have this length; `ramped`: whether
    what has no amplitude grows from zero.
    """

    card: Card
    steady: bool
    start: float
    period: float
    first: float
    direct: bool
    ramped: bool
    held: AtNodes
    flux: AtNodes
    acting: Sequence[Acting]
    amplitudes: Amplitudes

    def factors(self, time: float) -> np.ndarray:
        """Return the factors of amplitudes by their numbers at a time since the step began."""
        known = self.amplitudes.factors(time, self.start + time)
        known[0] = min(time / self.period, 1.0) if self.ramped else 1.0
        return known


def heat_steps(cards: Sequence[Card], mesh: DeckMesh) -> list[HeatCards]:
    """Return the steps of a deck, each with what the ones before it have left."""
    amplitudes, constants = Amplitudes.of(cards), _constants(cards)
    none = AtNodes(np.full(len(mesh.points), np.nan), np.zeros(len(mesh.points), dtype=int))
    held, flux, acting, found = none, none, list[Acting](), list[HeatCards]()
    for group in groups_of(cards):
        new = {card.name for card in group if card.name_of("OP") == "NEW"}
        held, flux = none if "BOUNDARY" in new else held, none if "CFLUX" in new else flux
        acting = [each for each in acting if each.card.name not in new]
        for card in group:
            if card.name == "BOUNDARY":
                held = _with(held, card, mesh, amplitudes.number(card), 2)
            elif card.name == "CFLUX":
                flux = _with(flux, card, mesh, amplitudes.number(card), 1)
            elif card.name in LOADS:
                acting += _acting(card, mesh, amplitudes.number(card), constants)
        head, *rest = group
        if head.name == "STEP":
            card = next((card for card in rest if card.name in HEAT), head)
            if card is head:
                raise head.error(
                    "all steps must be *HEAT TRANSFER, as one is: give other steps in other decks"
                )
            numbers = [*(card.floats(0) if card.lines else []), 0.0, 0.0]
            first, period = (each if each > 0.0 else 1.0 for each in numbers[:2])
            steady = "STEADYSTATE" in card.parameters
            direct = plain(card.parameters.get("DIRECT", "NO")) != "NO"
            start = found[-1].start + found[-1].period if found else 0.0
            ramped = head.name_of("AMPLITUDE") == "RAMP" and not steady
            found.append(HeatCards(
                card, steady, start, period, first, direct, ramped, held, flux, _last(acting), amplitudes
            ))  # fmt: skip
    return found


def _constants(cards: Sequence[Card]) -> tuple[float, ...]:
    """Return absolute zero and the constant of Stefan and Boltzmann, nothing where no card has them."""
    given = [card for card in cards if card.name == "PHYSICALCONSTANTS"]
    names = "ABSOLUTEZERO", "STEFANBOLTZMANN"
    return tuple(given[-1].number_of(name) for name in names) if given else ()


def _with(known: AtNodes, card: Card, mesh: DeckMesh, by: int, place: int) -> AtNodes:
    """Return values with those of a card for component 11 or 0, `place` entries behind it."""
    values, number = known.values.copy(), known.by.copy()
    for row, entries in enumerate(card.rows):
        component = entries[1] if len(entries) > 1 else ""
        if not component.isdecimal() or int(component) not in (0, 11):
            if card.name == "CFLUX":
                raise card.error(f"needs node or set, 11 and a heat, got component {component!r}", row)
            continue  # displacements
        nodes = mesh.nodes_named(entries[0], card, row)
        values[nodes], number[nodes] = [*card.floats(row, 1), 0.0, 0.0][place], by
    return AtNodes(values, number)


def _acting(card: Card, mesh: DeckMesh, by: int, constants: tuple[float, ...]) -> Iterator[Acting]:
    """Yield what a card gives to faces and volumes."""
    letter, count, make = LOADS[card.name]
    for row, entries in enumerate(card.rows):
        name, label = [*map(plain, entries[:2]), ""][:2]
        if label[-2:] in _OTHERS:
            raise card.error(f"{label}: {_OTHERS[label[-2:]]}", row)
        numbers = tuple(card.floats(row, 2))[:count]
        if len(numbers) < count:
            raise card.error(f"needs {count} numbers behind {label!r}, got {len(numbers)}: add them", row)
        if label == letter:
            acting = Acting(card, row, make, mesh.surface_named(name, card, row).faces, numbers, by)
        elif label == "BF" and letter == "S":
            elements = mesh.elements_named(name, card, row)
            acting = Acting(card, row, _source, Faces(elements, np.full(len(elements), -1)), numbers, by)
        elif label[:1] == letter and label[1:].isdecimal():
            faces = mesh.faces_of(mesh.elements_named(name, card, row), f"S{label[1:]}", card, row)
            acting = Acting(card, row, make, faces, numbers, by)
        else:
            needed = f"{letter}1, {letter}2, ... of elements, {letter} of a surface" + ", BF" * (count == 1)
            raise card.error(f"load {label!r} is not supported: give {needed}", row)
        if letter == "R" and not constants:
            raise card.error("needs *PHYSICAL CONSTANTS with ABSOLUTE ZERO= and STEFAN BOLTZMANN=: add them")
        yield replace(acting, values=numbers + constants * (letter == "R"))


def _last(given: Sequence[Acting]) -> list[Acting]:
    """Return loads on the faces that no later one of their kind is on, those of equal values together."""
    found = list[Acting]()
    for make in dict.fromkeys(each.make for each in given):
        own = [each for each in given if each.make == make]
        line = np.repeat(np.arange(len(own)), [len(each.faces) for each in own])
        elements = np.concatenate([each.faces.elements for each in own])
        sides = np.concatenate([each.faces.sides for each in own])
        _, last = np.unique((elements * 8 + sides)[::-1], return_index=True)
        kept, first = len(line) - 1 - last, dict[object, int]()
        alike = np.array([first.setdefault((each.values, each.by), k) for k, each in enumerate(own)])
        for k in np.unique(alike[line[kept]]).tolist():
            mine = kept[alike[line[kept]] == k]
            found.append(replace(own[k], faces=joined([Faces(elements[mine], sides[mine])])))
    return found
