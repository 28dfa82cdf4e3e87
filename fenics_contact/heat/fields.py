"""Temperatures as fields on bodies, and what files of results have of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._scene.pairs import Surface
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.results.fields import GatheredFields

if TYPE_CHECKING:
    from fenics_contact.heat.state import HeatState

#: Fields on the nodes of slaves by attributes of `HeatThroughContact`.
_ON_SLAVES = {
    "flux": "contact_heat_flux", "conductance": "contact_conductance", "jump": "contact_temperature_jump"
}  # fmt: skip


def fields_of(state: HeatState, body: str) -> GatheredFields:
    """Return the fields of a body; those of contacts on the nodes of slaves, zero on all others."""
    mesh, decomposition = state.scene.bodies[body].mesh, state.torn.decomposition
    first = decomposition.tearing.subdomain_offset[decomposition.tearing.body_names.index(body)]
    subdomain = np.asarray(decomposition.partitions[body], dtype=np.int32) + np.int32(first)
    on_nodes = {"temperature": state.temperature[body], "nodal_heat_flux": at_nodes(mesh, state.flux[body])}
    for contact, through in zip(state.scene.contacts, state.contacts, strict=True):
        for name, key in _ON_SLAVES.items():
            own = on_nodes.setdefault(key, np.zeros(mesh.n_nodes))
            if contact.slave.body == body:
                np.add.at(own, through.nodes, getattr(through, name))
    return GatheredFields(on_nodes, {"heat_flux": state.flux[body], "subdomain": subdomain})


def at_nodes(mesh: BodyMesh, values: np.ndarray) -> np.ndarray:
    """Return the means of vectors of cells over the cells around each node, (n_nodes, dim)."""
    nodes, width = mesh.cells.ravel(), mesh.cells.shape[1]
    count = np.bincount(nodes, minlength=mesh.n_nodes)
    sums = [np.bincount(nodes, np.repeat(each, width), minlength=mesh.n_nodes) for each in values.T]
    return mesh.hanging.placed(np.stack(sums, axis=1) / np.maximum(count, 1)[:, None])


def contact_columns(state: HeatState) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the number of the contact of each point, and the columns of a table of all."""
    counts = [len(at.nodes) for at in state.contacts]
    number, axes = np.repeat(np.arange(len(counts)), counts), "xyz"[: state.geometry.dim]
    names = ("nodes", "points", "slave", "master", "conductance", "heat", "flux")
    found = {name: np.concatenate([getattr(at, name) for at in state.contacts]) for name in names}
    places = np.array([contact.place for contact in state.scene.contacts], dtype=object)[number]
    at = {
        "contact": places,
        "node": found.pop("nodes"),
        **dict(zip(axes, found.pop("points").T, strict=True)),
    }
    return number, at | found


def record_of(state: HeatState) -> dict[str, Any]:
    """Return what a file of results has of a state."""
    scene, balance, decomposition = state.scene, state.balance, state.torn.decomposition
    bodies = {
        name: {
            "cells": body.mesh.n_cells, "cell_type": body.mesh.cell_type, "nodes": body.mesh.n_nodes,
            "subdomains": int(decomposition.partitions[name].max()) + 1, "material": body.material,
        }
        for name, body in scene.bodies.items()
    }  # fmt: skip
    contacts = [
        {**vars(each), "slave": _side(each.slave), "master": _side(each.master)} for each in scene.contacts
    ]
    return {
        "scene": {
            **state.geometry.dimension_record, "bodies": bodies, "held": scene.held, "loads": scene.loads,
            "contacts": contacts, "ties": scene.ties,
        },
        "counts": {
            "torn_unknowns": decomposition.torn_unknowns, "subdomains": decomposition.tearing.n_subdomains,
            "f_products": state.products, "linear_systems": state.iterations,
        },
        "seconds": dict(state.seconds),
        "temperature": {name: [own.min(), own.max()] for name, own in state.temperature.items()},
        "contact": [
            {
                "points": len(each.nodes), "heat": each.total,
                "largest_flux": np.abs(each.flux).max(initial=0.0),
                "largest_jump": np.abs(each.jump).max(initial=0.0),
            }
            for each in state.contacts
        ],
        "heat_balance": {"parts": balance.by_part, "stored": balance.stored, "error": balance.error},
    }  # fmt: skip


def _side(given: Any) -> Any:
    return {"body": given.body, "surface": given.name} if isinstance(given, Surface) else given
