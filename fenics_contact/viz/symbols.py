"""How the status of contact points is drawn: symbols that differ in shape and colour."""

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


def label_of(status: Status, count: int | None = None) -> str:
    """Return what the legend calls a status: "slip (12)"."""
    return status.name.lower() if count is None else f"{status.name.lower()} ({count})"
