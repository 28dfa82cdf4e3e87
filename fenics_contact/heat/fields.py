"""Temperatures as fields on bodies, and what files of results have of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.scene import Scene
from fenics_contact.results.fields import GatheredFields, body_mesh, nodal_function
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.tools import ToolResult

if TYPE_CHECKING:
    import dolfinx

    from fenics_contact.feti.torn import TornSystem
    from fenics_contact.heat.scene import HeatScene
    from fenics_contact.results.deformed_state import AnyState

#: Fields on the nodes of slaves by attributes of `HeatThroughContact`.
_ON_SLAVES = {
    "flux": "contact_heat_flux", "conductance": "contact_conductance", "jump": "contact_temperature_jump"
}  # fmt: skip


class HeatOnBodies(OnBodies):
    """What a `HeatState` is seen by."""

    kind = "heat"
    parts = ()
    scene: HeatScene
    torn: TornSystem
    contacts: tuple[Any, ...]
    balance: Any
    iterations: int
    products: int
    seconds: Mapping[str, float]

    @property
    @abstractmethod
    def temperature(self) -> Mapping[str, np.ndarray]:
        """Temperatures at the nodes of each body by its name, shape (n_nodes,) each."""

    @property
    @abstractmethod
    def flux(self) -> Mapping[str, np.ndarray]:
        """Mean heat flux of each cell by body, (n_cells, dim) each, [power / length²]."""

    @abstractmethod
    def nodal_flux(self, body: str) -> np.ndarray:
        """Return the heat flux at nodes by material, (n_materials, n_nodes, dim). Collective."""

    @property
    def comm(self) -> MPI.Comm:
        """The communicator over which subdomains are spread."""
        return self.torn.decomposition.comm

    @property
    def geometry(self) -> Scene:
        """Meshes, surfaces and obstacles."""
        return self.scene.geometry

    def gather_fields(self, body: str) -> GatheredFields:
        """Return the fields of a body. Collective.

        On nodes ``temperature``, ``nodal_heat_flux``, `HeatState.nodal_flux` in the material in which it is
        largest, and, where there are contacts, on those of slaves ``contact_heat_flux``, positive towards the
        master, ``contact_conductance`` and ``contact_temperature_jump``, zero on all others; on cells
        ``heat_flux`` and ``subdomain``.
        """
        mesh, decomposition, flux = self.scene.bodies[body].mesh, self.torn.decomposition, self.flux[body]
        first = decomposition.tearing.subdomain_offset[decomposition.tearing.body_names.index(body)]
        subdomain = np.asarray(decomposition.partitions[body], dtype=np.int32) + np.int32(first)
        on_nodes = {
            "temperature": self.temperature[body],
            "nodal_heat_flux": mesh.hanging.placed(_largest(self.nodal_flux(body))),
        }
        for contact, through in zip(self.scene.contacts, self.contacts, strict=True):
            for name, key in _ON_SLAVES.items():
                own = on_nodes.setdefault(key, np.zeros(mesh.n_nodes))
                if contact.slave.body == body:
                    np.add.at(own, through.nodes, getattr(through, name))
        return GatheredFields(on_nodes, {"heat_flux": flux, "subdomain": subdomain})

    def functions(self, body: str) -> list[dolfinx.fem.Function]:
        """Return the temperature of a body as a Function on its own mesh. Collective."""
        whole = self.geometry.bodies[body]
        mesh = body_mesh(self.torn.decomposition, body, whole)
        return [nodal_function(mesh, "temperature", whole.mesh.at_nodes_apart(self.temperature[body]))]

    def contact_columns(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the contact of each point by its number, and the columns of `write_contact_table`."""
        counts = [len(at.nodes) for at in self.contacts]
        number, axes = np.repeat(np.arange(len(counts)), counts), "xyz"[: self.geometry.dim]
        names = ("nodes", "points", "slave", "master", "conductance", "heat", "flux")
        found = {name: np.concatenate([getattr(at, name) for at in self.contacts]) for name in names}
        places = np.array([contact.place for contact in self.scene.contacts], dtype=object)[number]
        along = dict(zip(axes, found.pop("points").T, strict=True))
        return number, {"contact": places, "node": found.pop("nodes"), **along, **found}

    def record(self) -> dict[str, Any]:
        """Return what `write_result` writes of it."""
        balance, decomposition = self.balance, self.torn.decomposition
        return {
            "scene": _described(self.scene, decomposition.partitions),
            "counts": {
                "torn_unknowns": decomposition.torn_unknowns,
                "subdomains": decomposition.tearing.n_subdomains,
                "f_products": self.products, "linear_systems": self.iterations,
            },
            "seconds": dict(self.seconds),
            "temperature": {name: [own.min(), own.max()] for name, own in self.temperature.items()},
            "contact": [
                {
                    "points": len(each.nodes), "heat": each.total,
                    "largest_flux": np.abs(each.flux).max(initial=0.0),
                    "largest_jump": np.abs(each.jump).max(initial=0.0),
                }
                for each in self.contacts
            ],
            "heat_balance": {"parts": balance.by_part, "stored": balance.stored, "error": balance.error},
        }  # fmt: skip


class BothOnBodies(OnBodies):
    """What a `HeatedState` is seen by: deformed bodies with their temperatures."""

    kind = "heated"
    mechanics: AnyState
    heat: HeatOnBodies

    @property
    def parts(self) -> tuple[AnyState, ...]:
        """Whose records and nodal fields it has, too."""
        return (self.mechanics,)

    @property
    def comm(self) -> MPI.Comm:
        """The communicator over which subdomains are spread."""
        return self.mechanics.comm

    @property
    def unit_names(self) -> dict[str, str]:
        """Power in N mm/s, as stresses are in N/mm²."""
        return {"power": "mW"}

    @property
    def geometry(self) -> Scene:
        """The scene of mechanics."""
        return self.mechanics.scene

    @property
    def time(self) -> float:
        """The time of mechanics."""
        return self.mechanics.time

    def tools(self) -> dict[str, ToolResult]:
        """Return where rigid tools are, by name. Collective."""
        return self.mechanics.tools()

    def gather_fields(self, body: str) -> GatheredFields:
        """Return all fields of a body, of both. Collective."""
        fields = self.mechanics.gather_fields(body)
        if body not in self.heat.scene.bodies:
            return fields
        warm = self.heat.gather_fields(body)
        return GatheredFields({**fields.points, **warm.points}, {**warm.cells, **fields.cells})

    def functions(self, body: str) -> list[dolfinx.fem.Function]:
        """Return displacement, stress and temperature of a body, spread over the ranks. Collective."""
        found = self.mechanics.functions(body)
        mesh = self.geometry.bodies[body].mesh
        warm = [self.heat.temperature[body]] if body in self.heat.scene.bodies else []
        space = found[0].function_space.mesh
        return [*found, *(nodal_function(space, "temperature", mesh.at_nodes_apart(each)) for each in warm)]

    def contact_columns(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return those of heat."""
        return self.heat.contact_columns()

    def record(self) -> dict[str, Any]:
        """Return what `write_result` writes of its heat."""
        heat = self.heat.record()
        seen = {name: heat[name] for name in ("temperature", "heat_balance")}
        return {"heat": heat, "unit_names": self.unit_names, **seen}


def _largest(by_material: np.ndarray) -> np.ndarray:
    """Return vectors at nodes in the material in which they are largest; NaN where there is none."""
    chosen = np.nan_to_num(np.linalg.norm(by_material, axis=2), nan=-1.0).argmax(axis=0)
    return np.asarray(by_material[chosen, np.arange(by_material.shape[1])])


def _described(scene: HeatScene, partitions: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return bodies, what heats them, and contacts as plain data."""
    bodies = {
        name: {
            "cells": body.mesh.n_cells, "cell_type": body.mesh.cell_type, "nodes": body.mesh.n_nodes,
            "subdomains": int(partitions[name].max()) + 1, "material": body.material,
        }
        for name, body in scene.bodies.items()
    }  # fmt: skip
    contacts = [
        {**vars(each), "slave": _side(each.slave), "master": _side(each.master)} for each in scene.contacts
    ]
    return {
        **scene.geometry.dimension_record, "bodies": bodies, "held": scene.held, "loads": scene.loads,
        "contacts": contacts, "ties": scene.ties,
    }  # fmt: skip


def _side(given: Any) -> Any:
    return {"body": given.body, "surface": given.name} if isinstance(given, Surface) else given
