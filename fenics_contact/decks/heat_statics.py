"""The statics of decks that conduct heat: their cards with the temperatures that were found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fenics_contact.decks.heat_steps import procedure_of
from fenics_contact.decks.steps import groups_of
from fenics_contact.decks.vocabulary import HEAT, HEAT_ALONE, PARAMETERS
from fenics_contact.readers.deck_cards import Card

#: Numbers of nodes and their temperatures.
Temperatures = tuple[np.ndarray, np.ndarray]


def moving(cards: Sequence[Card]) -> list[int]:
    """Return the numbers of the steps, from 0, in which bodies move."""
    steps = [group for group in groups_of(cards) if group[0].name == "STEP"]
    return [k for k, group in enumerate(steps) if procedure_of(group).name != "HEATTRANSFER"]


def statics_of(
    cards: Sequence[Card], found: Mapping[int, Temperatures], times: Mapping[int, Sequence[float]]
) -> Iterator[Card]:
    """Yield the cards of mechanics; steps have the temperatures of the last step that has found some.

    `found`: temperatures at the ends of steps by their numbers, from 0; `times`: at which increments of steps
    that have some end, since their start.
    """
    steps, number = set(moving(cards)), -1
    for card in cards:
        number += card.name == "STEP"
        if number >= 0 and number not in steps:
            continue
        if card.name == "BOUNDARY":
            kept = [k for k, row in enumerate(card.rows) if row[1:2] not in (["0"], ["11"])]
            lines, numbers = [card.lines[k] for k in kept], [card.numbers[k] for k in kept]
            if kept:
                yield replace(
                    card, lines=lines, numbers=numbers, files=[card.files[k] for k in kept if card.files]
                )
        elif card.name in HEAT or card.name == "STATIC":
            known = {name: card.parameters[name] for name in PARAMETERS["STATIC"] & set(card.parameters)}
            static = replace(card, name="STATIC", written="STATIC", parameters=known)
            ends = [repr(time) for time in times.get(number, ())]
            yield _with(static, [*(card.lines[:1] or ["1., 1."]), *ends]) if ends else static
            last = [k for k in found if k <= number]
            if last:
                yield _given(card, *found[max(last)])
        elif card.name not in HEAT_ALONE | {"CONDUCTIVITY", "SPECIFICHEAT", "PHYSICALCONSTANTS"}:
            yield card


def warmer(
    cards: Sequence[Card], numbers: np.ndarray, values: np.ndarray, times: Mapping[int, Sequence[float]]
) -> Iterator[Card]:
    """Yield the cards of mechanics with one more step of other temperatures: bodies will be heated."""
    found = [*statics_of(cards, {}, times)]
    yield from found
    head, static, end = (
        [card for card in found if card.name == name][-1] for name in ("STEP", "STATIC", "ENDSTEP")
    )
    known = {key: text for key, text in head.parameters.items() if key == "NLGEOM"}
    yield from (replace(head, parameters=known), static, _given(static, numbers, values + 1.0), end)


def _given(card: Card, numbers: np.ndarray, values: np.ndarray) -> Card:
    """Return the card that gives nodes their temperatures, at the place of another one."""
    lines = [f"{number}, {value!r}" for number, value in zip(numbers.tolist(), values.tolist(), strict=True)]
    return _with(replace(card, name="TEMPERATURE", written="TEMPERATURE", parameters={}), lines)


def _with(card: Card, lines: list[str]) -> Card:
    return replace(card, lines=lines, numbers=[card.line] * len(lines), files=())
