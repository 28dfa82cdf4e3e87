"""What conducts heat in a deck, and how much passes between surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any

import numpy as np

from fenics_contact.decks.materials import MaterialCards, axes_of, depends_on_temperature, row_at, table_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.heat.conductance import Conductance, ConductanceTable
from fenics_contact.heat.friction import FrictionHeat
from fenics_contact.heat.properties import Conductor, GivenProperty, TemperatureTable
from fenics_contact.readers.deck_cards import Card

#: Place of 11, 22, 33, 12, 13, 23 in a matrix, row by row.
_SYMMETRIC = [0, 3, 4, 3, 1, 5, 4, 5, 2]


def conductor_of(cards: MaterialCards, axes: Card | None, dim: int) -> Conductor:
    """Return a material; of plane bodies its axes are those of the plane."""
    parts = cards.parts
    card = parts.get("CONDUCTIVITY")
    if card is None:
        raise cards.card.error("conducts no heat: add *CONDUCTIVITY behind it")
    kind = card.name_of("TYPE") or "ISO"
    width = {"ISO": 1, "ORTHO": 3, "ANISO": 6}.get(kind, 0)
    if not width:
        raise card.error(f"TYPE={kind} is not read: ISO, ORTHO and ANISO are")
    try:
        if width == 1 or (width == 3 and axes is None):
            along = [_by_temperature(card, width, k) for k in range(min(width, dim))]
            return Conductor(along if width > 1 else along[0], _capacity(cards))
        if depends_on_temperature(card, width):
            raise card.error("with axes of its own must not depend on the temperature: give its mean")
        given = row_at(card, width, 0.0, "conductivities")
        matrix = np.diag(given) if width == 3 else np.array(given)[_SYMMETRIC].reshape(3, 3)
        rows = np.array(axes_of(axes))
        return Conductor((rows.T @ matrix @ rows)[:dim, :dim], _capacity(cards))
    except InvalidInputError as error:
        raise error if getattr(error, "card", "") else card.error(str(error)) from error


def _capacity(cards: MaterialCards) -> GivenProperty | None:
    """Return specific heat times density, none where one of them is not given."""
    heat, density = cards.parts.get("SPECIFICHEAT"), cards.parts.get("DENSITY")
    if heat is None or density is None:
        return None
    if depends_on_temperature(density, 1):
        raise density.error("must not depend on the temperature, as mass is kept: give that of the start")
    return _by_temperature(heat, 1, 0, cards.density)


def _by_temperature(card: Card, width: int, column: int, factor: float = 1.0) -> GivenProperty:
    """Return a column of a table with a temperature behind each row."""
    if not card.lines:
        raise card.error("has no data line: add it")
    table = table_of(card, width)
    if not depends_on_temperature(card, width):
        return factor * float(table[0, column])
    return TemperatureTable(table[:, -1].tolist(), (factor * table[:, column]).tolist())


def read_passages(cards: Sequence[Card]) -> dict[str, dict[str, Card]]:
    """Return what surface interactions say of heat and friction, by their names and those of cards."""
    found, name = dict[str, dict[str, Card]](), ""
    for card in takewhile(lambda card: card.name != "STEP", cards):
        name = card.required("NAME") if card.name == "SURFACEINTERACTION" else name
        if card.name in ("GAPCONDUCTANCE", "GAPHEATGENERATION", "FRICTION"):
            found.setdefault(name, {})[card.name] = card
    return found


def passage_of(laws: Mapping[str, Card], reach: float) -> dict[str, Any]:
    """Return conductance and heat of friction of surfaces that touch, which is up to a distance."""
    law, heat = laws.get("GAPCONDUCTANCE"), laws.get("GAPHEATGENERATION")
    friction = _friction_heat(heat, laws.get("FRICTION")) if heat else FrictionHeat(part=0.0)
    conductance = _conductance(law, reach) if law else ConductanceTable((), ())
    return {"conductance": conductance, "friction": friction}


def _friction_heat(card: Card, friction: Card | None) -> FrictionHeat:
    """Return the part of friction's work that is heat, the slave's share of it, and any speed."""
    given = card.floats(0) if card.lines else []
    part, share, speed = [*given, *(1.0, 0.5, -1.0)[len(given) :]]
    if friction is None:
        raise card.error("needs the *FRICTION of its interaction, there is none: add it")
    try:
        return FrictionHeat(friction.floats(0)[0], max(speed, 0.0), part, share)
    except InvalidInputError as error:
        raise card.error(f"{error}; its line has the part, the share and a speed") from error


def _conductance(card: Card, reach: float) -> Conductance:
    """Return what passes by the pressure, in lines of a conductance, a pressure and a temperature."""
    if not card.lines:
        raise card.error("has no data line: add it")
    table = card.table(3)
    if len(np.unique(table[:, 2])) > 1:
        raise card.error("must not depend on the temperature: give its mean")
    order = np.argsort(table[:, 1], kind="stable")
    closed, pressure = table[order, 0].tolist(), table[order, 1].tolist()
    try:
        return ConductanceTable(pressure, closed, (0.0, reach), (closed[0], closed[0]))
    except InvalidInputError as error:
        raise card.error(f"{error}; lines have a conductance and its pressure") from error
