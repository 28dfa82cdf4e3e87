"""Temperatures of bodies, the heat that passes between them, and the balance of heat."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.errors import collectively
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.heat.assembly import Heated
from fenics_contact.heat.fields import HeatOnBodies
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.points_of_cells import PointsOfCells
from fenics_contact.heat.scene import ConductingBody, HeatScene
from fenics_contact.mesh.cell_types import CellType, cell_type_of, quadrature
from fenics_contact.qp.solution import DualSolution


@displayed
@dataclass(frozen=True, eq=False)
class HeatThroughContact:
    """What passes at the points of one contact, replicated.

    Attributes:
        nodes: Slave nodes in the body of the slave, shape (n,).
        points: Where they are, shape (n, dim), [length].
        slave: Temperatures of the slave, shape (n,).
        master: Temperatures of the master opposite, shape (n,).
        conductance: h, shape (n,), [power / (length² · degree)].
        heat: Heat that passes from the slave to the master at each point, shape (n,), [power].
        flux: The same per area, shape (n,), [power / length²].
        friction: Heat of friction that enters both sides there, shape (n,), [power].
    """

    nodes: np.ndarray
    points: np.ndarray
    slave: np.ndarray
    master: np.ndarray
    conductance: np.ndarray
    heat: np.ndarray
    flux: np.ndarray
    friction: np.ndarray

    @property
    def jump(self) -> np.ndarray:
        """By how much the slave is warmer than the master, shape (n,)."""
        return self.slave - self.master

    @property
    def total(self) -> float:
        """Heat that passes from the slave to the master, [power]."""
        return float(self.heat.sum())


@displayed
@dataclass(frozen=True)
class HeatBalance:
    """Where heat comes from, [power], positive where it enters bodies.

    Attributes:
        by_part: Heat of each held temperature, load and obstacle by its place.
        stored: Heat that bodies take up.
        moved: Heat that their nodes take up or give off, by magnitude.
    """

    by_part: Mapping[str, float]
    stored: float
    moved: float = 0.0

    @classmethod
    def combined(cls, *terms: tuple[float, HeatBalance]) -> HeatBalance:
        """Return the sum of balances, each times a factor."""
        names = {name: None for _, balance in terms for name in balance.by_part}
        parts = {name: sum(factor * each.by_part.get(name, 0.0) for factor, each in terms) for name in names}
        stored, moved = np.sum(
            [(factor * each.stored, factor * each.moved) for factor, each in terms], axis=0
        )
        return cls(parts, float(stored), float(moved))

    @property
    def error(self) -> float:
        """What comes in less what is stored, relative to all that comes and goes."""
        flows = np.array([*self.by_part.values(), -self.stored])
        scale = max(np.abs(flows).sum(), self.moved, np.finfo(float).tiny)
        return float(abs(flows.sum()) / scale)

    def _facts(self) -> dict[str, Any]:
        parts = {name: f"{heat:.6g}" for name, heat in self.by_part.items()}
        return {**parts, "stored": f"{self.stored:.6g}", "error": f"{self.error:.1e}"}


@displayed
@dataclass(frozen=True, eq=False)
class HeatState(HeatOnBodies):
    """Temperatures of a scene, replicated on all ranks.

    Attributes:
        scene: The scene.
        torn: The torn system that was solved.
        heated: Its subdomains on this rank, with what they exchange with loads.
        system: Its dual.
        solution: The result of the dual solver.
        joints: The points of contacts and ties.
        values: Temperatures of the nodes of all bodies, body after body, shape (n_nodes,).
        contacts: What passes through each contact, in the order of the scene.
        ties: Heat that passes at tied points from slave to master, shape (n,), [power].
        balance: Where heat comes from and where it goes.
        rates: Heat that the nodes of each subdomain of this rank take up, shape (n,) each, [power].
        iterations: Linear systems that were solved.
        products: Applications of the dual operator.
        seconds: Wall time by phase.
    """

    scene: HeatScene
    torn: TornSystem
    heated: tuple[Heated, ...]
    system: DualSystem
    solution: DualSolution
    joints: Joints
    values: np.ndarray
    contacts: tuple[HeatThroughContact, ...]
    ties: np.ndarray
    balance: HeatBalance
    rates: tuple[np.ndarray, ...]
    iterations: int
    products: int
    seconds: Mapping[str, float]

    @property
    def heat(self) -> HeatState:
        """Itself: what it has in common with a `HeatedState`."""
        return self

    def adjoining(self) -> tuple[Any, ...]:
        """Return the temperatures for an adjoint: no mechanics follows them."""
        return (self,)

    @cached_property
    def temperature(self) -> dict[str, np.ndarray]:
        """Temperatures at the nodes of each body by its name, shape (n_nodes,) each."""
        tearing = self.torn.decomposition.tearing
        starts = tearing.node_offset
        return {name: self.values[starts[k] : starts[k + 1]] for k, name in enumerate(tearing.body_names)}

    @cached_property
    def flux(self) -> dict[str, np.ndarray]:
        """Mean heat flux of each cell by body, (n_cells, dim) each, [power / length²]."""
        return {
            name: cell_flux(self.scene, name, temperature) for name, temperature in self.temperature.items()
        }

    @collectively("HeatState.nodal_flux", lambda self, *_: self.torn.decomposition.comm)
    def nodal_flux(self, body: str) -> np.ndarray:
        """Return the heat flux at the nodes of a body, recovered in each of its materials. Collective.

        Its order is one above that of `flux`: around each node a polynomial of one degree more than the
        temperature is fitted to those of the nodes near by, and −k ∇T is that of its slope.

        Args:
            body: Name of the body.

        Returns:
            Shape (n_materials, n_nodes, dim), NaN where a node has no cell of the material, [power /
            length²].
        """
        from fenics_contact.heat.accuracy import nodal_flux

        return nodal_flux(self, body)

    @collectively("HeatState.heat_through", lambda self, *_: self.torn.decomposition.comm)
    def heat_through(self, body: str, surface: str) -> float:
        """Return the heat that enters a body through any of its named surfaces, [power]. Collective.

        It is what is left of the balance of each node, and loads as they were integrated: heat through
        surfaces that make up the boundary of a body adds up to what it stores less what its sources give, to
        rounding, and is far more accurate than integrals of the flux. That of a node on several surfaces
        which hold or touch counts for each by its area around the node.

        Example:
            >>> warm.heat_through("lower", "z0")  # doctest: +SKIP
        """
        from fenics_contact.heat.accuracy import heat_through

        return heat_through(self, body, surface)

    def _facts(self) -> dict[str, Any]:
        ranges = {
            f"temperature of {name}": f"{own.min():.6g} to {own.max():.6g}"
            for name, own in self.temperature.items()
        }
        through = {
            f"heat through {contact.place}": f"{each.total:.6g}"
            for contact, each in zip(self.scene.contacts, self.contacts, strict=True)
        }
        return {**ranges, **through, "balance": self.balance, "iterations": self.iterations,
                "products": self.products}  # fmt: skip


def cell_flux(scene: HeatScene, name: str, temperature: np.ndarray) -> np.ndarray:
    """Return −k ∇T of the cells of a body, (n_cells, dim)."""
    body = scene.bodies[name]
    cell = cell_type_of(body.mesh.cells, body.mesh.dim)
    positions, weights = quadrature(cell, 2)
    flux, _, volumes = flux_at(body, cell, temperature, positions)
    measure = weights * volumes
    return np.asarray(np.einsum("cq,cqi->ci", measure, flux) / measure.sum(axis=1)[:, None])


def flux_at(
    body: ConductingBody, cell: CellType, temperature: np.ndarray, positions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return −k ∇T at positions in all cells of a body, ∇ of the functions of nodes, and volumes.

    `cell`: its reference cell, in which `positions`, (n_points, dim), are; `temperature`: at the nodes of the
    body. Shapes are (n_cells, n_points, dim), (n_cells, n_points, n_nodes, dim) and (n_cells, n_points).
    """
    mesh, cells = body.mesh, np.arange(body.mesh.n_cells)
    at = PointsOfCells.of(mesh, cells, cell, positions)
    nodal = at.of_nodes(temperature[mesh.cells])
    flux = -body.conducted(cells, at.places, nodal @ at.shape.T, np.einsum("cqai,ca->cqi", at.slopes, nodal))
    return flux, at.slopes, at.volumes
