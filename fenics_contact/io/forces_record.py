"""Forces and moments of a state, and motions of rigid surfaces, as they stand in a result file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fenics_contact.contact import Resultant, State


def forces_record(state: State) -> dict[str, Any]:
    """Return reactions, forces of ties and contacts, and their balance by name. Collective."""
    pairs, balance = state.resultants(), state.balance()
    return {
        "reactions": [_on_surface(each) for each in state.reactions()],
        "contacts": [_on_surface(each) for each in pairs.contacts],
        "ties": [_on_surface(each) for each in pairs.ties],
        "balance": {
            "about": balance.total.about,
            **{name: {"force": part.force, "moment": part.moment} for name, part in balance.parts.items()},
            "imbalance": balance.imbalance,
            "force_scale": balance.force_scale,
            "moment_scale": balance.moment_scale,
        },
    }


def listed_forces(forces: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Return the entries of a record of forces by what they are: "reaction 0", ..., "sum of loads", ...

    Each has ``force``, ``moment`` and ``about``; those of surfaces ``body`` and ``surface``, too.

    Args:
        forces: What `forces_record` returns, or the entry of a result file.
    """
    words = {"reactions": "reaction", "contacts": "contact", "ties": "tie"}
    single = [(f"{words[kind]} {k}", entry) for kind in words for k, entry in enumerate(forces[kind])]
    balance = forces["balance"]
    sums = {name: entry for name, entry in balance.items() if isinstance(entry, Mapping)}
    whole = [
        (f"sum {'across' if name == 'gaps' else 'of'} {name}", {**entry, "about": balance["about"]})
        for name, entry in sums.items()
    ]
    return [*single, *whole]


def scales_of(forces: Mapping[str, Any]) -> dict[str, float]:
    """Return a force and a moment beside which what is only rounding can be told.

    Results of before these were stored have the largest entries instead.
    """
    entries: Sequence[Mapping[str, Any]] = [entry for _, entry in listed_forces(forces)]
    return {
        kind: forces["balance"].get(
            f"{kind}_scale", max(float(np.max(np.abs(each[kind]))) for each in entries)
        )
        for kind in ("force", "moment")
    }


def motions_record(state: State) -> list[dict[str, Any]]:
    """Return the motions of rigid surfaces. Collective."""
    return [
        {
            "body": each.surface.body,
            "surface": each.surface.name,
            "about": each.about,
            "displacement": each.displacement,
            "rotation": each.rotation,
        }
        for each in state.rigid_motions()
    ]


def _on_surface(each: Resultant) -> dict[str, Any]:
    where = {"body": each.surface.body, "surface": each.surface.name} if each.surface else {}
    return {**where, "force": each.force, "moment": each.moment, "about": each.about}
