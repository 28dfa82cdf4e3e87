"""Forces and moments of a state, and motions of rigid surfaces, as they stand in a result file."""

from __future__ import annotations

from typing import Any

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
