"""Heat fluxes of better accuracy than slopes of cells: recovered at nodes, and conserved through surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fenics_contact._accuracy.recovery import find_sites, recovered_gradients
from fenics_contact._scene.checks import check_known
from fenics_contact._scene.pairs import Surface
from fenics_contact._surfaces.facets import gauss_points, quadrature_areas
from fenics_contact.feti.averages import nodal_sum
from fenics_contact.heat.parts import OnSurface
from fenics_contact.mesh.faces import corners_of, match_faces, of_one_shape

if TYPE_CHECKING:
    from fenics_contact._kinematics.measure import Measure
    from fenics_contact.feti.torn import TornSystem
    from fenics_contact.heat.assembly import Heated
    from fenics_contact.heat.joints import Joints
    from fenics_contact.heat.scene import ConductingBody, HeatScene
    from fenics_contact.qp.solution import DualSolution


class Solved(Protocol):
    """What is known of a `HeatState`."""

    @property
    def scene(self) -> HeatScene:
        """The scene."""

    @property
    def torn(self) -> TornSystem:
        """The torn system that was solved."""

    @property
    def heated(self) -> tuple[Heated, ...]:
        """Its subdomains with what they exchange with loads."""

    @property
    def solution(self) -> DualSolution:
        """The heat that passes at rows."""

    @property
    def joints(self) -> Joints:
        """The points of contacts and ties."""

    @property
    def contacts(self) -> Sequence[Any]:
        """What passes through each contact."""

    @property
    def values(self) -> np.ndarray:
        """Temperatures of all nodes."""

    @property
    def temperature(self) -> dict[str, np.ndarray]:
        """Temperatures at the nodes of each body."""


def nodal_flux(state: Solved, body: str) -> np.ndarray:
    """Return −k ∇T at the nodes of a body, material by material, (n_materials, n_nodes, dim). Collective."""
    check_known(body, state.scene.bodies, f"nodal_flux names body {body!r}, the scene has")
    own, torn = state.scene.bodies[body], state.torn
    mesh, dim, number = own.mesh, own.mesh.dim, len(own.materials)
    sites = find_sites(torn, mesh.order)
    slope = recovered_gradients(sites, state.values[sites.node][:, None])[:, 0]
    total = np.zeros((number, mesh.n_nodes, dim + 1))
    material = torn.scene.bodies[body].material_of_cells
    for part in torn.decomposition.meshes:
        if part.body == body:
            site, node = sites.of_cells[part.number], mesh.cells[part.cells]
            kind = np.broadcast_to(material[part.cells][:, None], node.shape)
            total[kind, node] = np.pad(slope, ((0, 0), (0, 1)), constant_values=1.0)[site]
    total = torn.decomposition.comm.allreduce(total)
    flux = np.full((number, mesh.n_nodes, dim), np.nan)
    for row, conductor in enumerate(own.materials):
        here = np.flatnonzero(total[row, :, -1])
        gradient = total[row, here, :-1] / total[row, here, -1:]
        flux[row, here] = -conductor.conducted(mesh.points[here], state.temperature[body][here], gradient)
    return flux


def heat_through(state: Solved, body: str, surface: str) -> float:
    """Return the heat that enters a body through one of its surfaces, [power]. Collective."""
    scene, torn = state.scene, state.torn
    check_known(body, scene.bodies, f"heat_through names body {body!r}, the scene has")
    mesh, first = scene.bodies[body].mesh, torn.decomposition.tearing.first_of(body)
    check_known(surface, mesh.surfaces, f"heat_through names {surface!r} of body {body!r}, which has")
    here = slice(first, first + mesh.n_nodes)
    # What rows of held temperatures, contacts and ties give to nodes; forces of gluing rows cancel.
    rows = nodal_sum(torn.decomposition, torn.force(state.solution.multiplier))[:, 0]
    given = (_rubbed(state) - rows)[here]
    sides = [Surface(each.body, each.surface) for each in scene.held]
    sides += [side for pair in (*scene.geometry.contacts, *scene.geometry.ties)
              for side in (pair.slave, pair.master) if isinstance(side, Surface)]  # fmt: skip
    around = _Around.of(state, body, surface, [side.name for side in sides if side.body == body])
    expected = around.heat(nodal_flux(state, body))
    total = float((given - expected[0]) @ around.share + expected[1].sum())
    for number, load in enumerate(scene.loads):
        if load.body == body and isinstance(load, OnSurface):
            share = _Around.of(state, body, surface, [load.surface]).share
            total += torn.decomposition.comm.allreduce(_given(state, number, share))
    return total


def _rubbed(state: Solved) -> np.ndarray:
    """Return the heat of friction at all nodes, (n_nodes,)."""
    heat = np.zeros((2, state.joints.points.count))
    for number, (contact, each) in enumerate(zip(state.scene.contacts, state.contacts, strict=True)):
        heat[:, state.joints.points.pair == number] = contact.friction.split(each.friction)
    return state.joints.at_nodes(heat)


def _given(state: Solved, number: int, share: np.ndarray) -> float:
    """Return what a load gives to shares of nodes of its body, (n_nodes,), on this rank."""
    total, decomposition = 0.0, state.torn.decomposition
    for each, mesh in zip(state.heated, decomposition.meshes, strict=True):
        if number in each.exchanges:
            temperature = state.temperature[mesh.body][mesh.nodes]
            total += float(each.exchanges[number].at_nodes(temperature) @ share[mesh.nodes])
    return total


@dataclass(frozen=True, eq=False)
class _Around:
    """Facets of a body through which heat passes, and which of them belong to one surface, (n,)."""

    body: ConductingBody
    measure: Measure
    facets: np.ndarray
    mine: np.ndarray

    @classmethod
    def of(cls, state: Solved, body: str, surface: str, others: Iterable[str]) -> _Around:
        """Return those of other surfaces; sets of nodes may pass heat through all of the boundary."""
        own = state.scene.bodies[body]
        mesh, measure = own.mesh, state.torn.scene.bodies[body].kinematics.measure
        boundary, _ = mesh.boundary

        def numbers(name: str) -> np.ndarray:
            if name not in mesh.surfaces:
                return np.arange(len(boundary))
            return match_faces(corners_of(mesh.surfaces[name], mesh.dim), corners_of(boundary, mesh.dim))

        acting = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *map(numbers, others)]))
        return cls(own, measure, boundary[acting], np.isin(acting, numbers(surface)))

    @property
    def share(self) -> np.ndarray:
        """Of the surface in the area of all around each node of the body, (n_nodes,)."""
        size, points = self.body.mesh.n_nodes, self.body.mesh.points
        every, own = np.zeros(size), np.zeros(size)
        for numbers, some in of_one_shape(self.facets):
            area, mine = quadrature_areas(points, some, self.measure)[:, None], self.mine[numbers]
            np.add.at(every, some, area)
            np.add.at(own, some[mine], area[mine])
        return np.divide(own, every, out=np.zeros(size), where=every > 0.0)

    def heat(self, flux: np.ndarray) -> np.ndarray:
        """Return what enters around nodes through all facets, and those of the surface, (2, n_nodes).

        `flux`: at nodes by material, (n_materials, n_nodes, dim).
        """
        points, result = self.body.mesh.points, np.zeros((2, self.body.mesh.n_nodes))
        known = np.isfinite(flux[..., :1])
        mean = np.where(known, flux, 0.0).sum(axis=0) / known.sum(axis=0)
        for numbers, some in of_one_shape(self.facets):
            for at in gauss_points(points, some, self.measure):
                entering = -np.einsum("nd,nd->n", at.of(mean, some), at.normals)
                heat, mine = self.body.thickness * entering[:, None] * at.values, self.mine[numbers]
                np.add.at(result[0], some, heat)
                np.add.at(result[1], some[mine], heat[mine])
        return result
