"""Symbols for the status of contact points, which differ in shape and colour."""

from __future__ import annotations

from typing import Any

from fenics_contact.contact import Status
from fenics_contact.viz.colours import BLUE, GREY, ORANGE

#: Keywords of ``Axes.scatter``.
SYMBOLS: dict[Status, dict[str, Any]] = {
    Status.OPEN: {"marker": "o", "facecolors": "none", "edgecolors": GREY, "s": 30},
    Status.STICK: {"marker": "s", "facecolors": BLUE, "edgecolors": "white", "s": 90},
    Status.SLIP: {"marker": "^", "facecolors": ORANGE, "edgecolors": "white", "s": 110},
}


#: Without friction a closed point neither sticks nor slips.
CLOSED = {**SYMBOLS[Status.STICK], "marker": "D", "s": 70}


def symbols_of(rubs: bool) -> dict[Status, tuple[str, dict[str, Any]]]:
    """Return name and keywords of ``Axes.scatter`` of the statuses that points of a pair can have."""
    if rubs:
        return {status: (status.name.lower(), look) for status, look in SYMBOLS.items()}
    return {Status.OPEN: ("open", SYMBOLS[Status.OPEN]), Status.SLIP: ("closed", CLOSED)}
