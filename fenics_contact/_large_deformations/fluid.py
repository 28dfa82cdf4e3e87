"""Fluid that enters contacts of bodies that deform much: it presses where it is, normal to surfaces there."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.display import counted
from fenics_contact._large_deformations.contact_feedback import ContactFeedback, OnSurfaces
from fenics_contact._large_deformations.loading import DeadLoads, FollowingPressures, Loading
from fenics_contact._large_deformations.moving_contact import (
    Contact,
    MovedContact,
    MovingContact,
    facet_size,
)
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.loads import Pressure
from fenics_contact._scene.scene import Scene
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.averages import at_copies, nodal_mean_transposed
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.fluid_front import Front, returning
from fenics_contact.qp.reductions import Vector

if TYPE_CHECKING:
    from fenics_contact._large_deformations.newton import NonlinearEquilibrium

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class EnteredFluid(ContactFeedback):
    """Fluid where the last equilibrium was open to it, at the pressure of the present load.

    It presses wet nodes of slaves as `Pressure` does, whether they face a master or not, and those of masters
    that are next to them. On tools, and on masters of small strains, it presses as far as points of the slave
    face them; how that changes with the shape Newton's method does not know.

    `marks`: which nodes of all bodies are wet, shape (n_nodes,); `pressing`: what fluids of a pressure of one
    exert, by their names; `earlier`: where they have been at a load, with its time.
    """

    front: Front
    contact: MovingContact
    scene: Scene
    marks: np.ndarray
    pressing: Mapping[str, FluidOnSurfaces]
    earlier: tuple[tuple[float, bytes], ...] = ()

    @classmethod
    def of(cls, scene: Scene, contact: Contact, marks: np.ndarray) -> EnteredFluid:
        """Return it at nodes of bodies that move, shape (n_nodes,), none of (0,). Collective."""
        moving = cast(MovingContact, contact)
        marks = marks if len(marks) else np.zeros(len(scene.points), dtype=bool)
        front = moving.fluid_front(scene)
        return cls(front, moving, scene, marks, _pressing(scene, moving.decomposition, front, marks))

    def on(self, contact: MovedContact, load: Loading) -> MovedContact:
        """Return contact with fluid in it."""
        front, torn = self.front, contact.torn
        points, wet = torn.points, self.marks[front.nodes.slave]
        by_node = np.where(wet, front.pressures(load.fluids), 0.0)
        pressure, wet = front.at_points(by_node, points), front.at_points(wet, points) > 0.0
        facing = np.maximum(-np.einsum("nd,nd->n", self._outward(contact), points.normal), 0.0)
        force = pressure * contact.points.areas(torn.scene).pressed * facing
        force[np.isin(points.pair, [k for k in self._pairs if _has_wet_master(self.scene, k)])] = 0.0
        # On the master alone: slaves have pressures of their own.
        slaves = np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
        dim = points.normal.shape[1]
        np.add.at(slaves[:, :dim], points.slave, -force[:, None] * points.normal)
        nodes = np.unique(points.slave)
        alone = nodal_mean_transposed(torn.decomposition, nodes, slaves[nodes])
        torn = torn.with_fluid(pressure, wet, force, alone)
        torn = replace(torn, fluid=replace(torn.fluid, marks=self.marks))
        acting = tuple((load.fluids.get(name, 0.0), each) for name, each in self.pressing.items())
        return replace(contact, torn=torn, on_surfaces=ByFluid(acting))

    def _outward(self, contact: MovedContact) -> np.ndarray:
        """Return the outward normals of slaves at the points where fluid may be, shape (n_points, dim)."""
        points, coordinates = contact.torn.points, contact.points.coordinates
        result = -points.normal
        for number in self._pairs:
            mine, slave = points.pair == number, self.contact.slaves[number]
            result[mine] = slave.normals(coordinates)[np.searchsorted(slave.nodes, points.slave[mine])]
        return result

    def after(self, found: NonlinearEquilibrium, tolerance: float) -> EnteredFluid:
        """Return this if the equilibrium is open to fluid just where it is. Collective.

        Raises:
            ConvergenceError: If the front returns to where it was at the same load.
        """
        contact, load = cast(MovedContact, found.evaluation.contact), found.evaluation.load
        force, _ = contact.at_points(found.evaluation.at.multiplier)
        torn, front = contact.torn, self.front
        pressed = np.maximum(force, 0.0) / contact.points.areas(torn.scene).true
        wet = front.reached(torn.points, pressed, load.fluids)
        if np.array_equal(wet, self.marks[front.nodes.slave]):
            return self
        earlier = *(each for each in self.earlier if each[0] == load.time), (load.time, self._key)
        following = replace(self, marks=self._reached(contact, wet), earlier=earlier)
        if (load.time, following._key) in earlier:
            passes = counted(len(earlier), "pass", "passes")
            raise returning(passes, int(wet.sum()), found.effort.history)
        safe_log(_LOG.info, "fluid reaches %s", counted(int(wet.sum()), "point"))
        pressing = _pressing(self.scene, self.contact.decomposition, front, following.marks)
        return replace(following, pressing=pressing)

    @property
    def _key(self) -> bytes:
        return self.marks[self.front.nodes.slave].tobytes()

    @property
    def _pairs(self) -> np.ndarray:
        """Numbers of the pairs that fluids enter."""
        return np.flatnonzero(self.front.fluids >= 0)

    def _reached(self, contact: MovedContact, wet: np.ndarray) -> np.ndarray:
        """Return the marks of nodes: wet ones of the front, shape (n,), and those of masters next to them."""
        points, coordinates, scene = contact.torn.points, contact.points.coordinates, self.scene
        marks, at_points = np.zeros_like(self.marks), self.front.at_points(wet, points) > 0.0
        marks[self.front.nodes.slave] = wet
        for number in self._pairs:
            mine = np.flatnonzero(points.pair == number)
            if not _has_wet_master(scene, number) or not len(mine):
                continue
            side = scene.contacts[number].master_surface
            nodes = self.contact.decomposition.tearing.global_nodes(side.body, np.unique(scene.facets(side)))
            away, nearest = cKDTree(coordinates[points.slave[mine]]).query(coordinates[nodes])
            size = facet_size(scene, scene.contacts[number].slave)
            next_to = away <= np.abs(points.gap[mine][nearest]) + size
            marks[nodes[next_to & at_points[mine][nearest]]] = True
        return marks


def _has_wet_master(scene: Scene, number: int) -> bool:
    """Return whether the master of a pair is of a material for large deformations, whose nodes get wet."""
    pair = scene.contacts[number]
    return pair.between_bodies and scene.bodies[pair.master_surface.body].deforms_much


@dataclass(frozen=True, eq=False)
class ByFluid(OnSurfaces):
    """What fluids exert, each with its pressure."""

    parts: tuple[tuple[float, FluidOnSurfaces], ...]

    @property
    def rim(self) -> np.ndarray | bool:
        return np.logical_or.reduce([each.rim for _, each in self.parts])

    def added(self, force: Vector, growth: DeadLoads, displacement: Vector) -> tuple[Vector, DeadLoads]:
        for pressure, surfaces in self.parts:
            more, softening = surfaces.pressures.at(displacement)
            force, growth = force + pressure * (surfaces.at_rest + more), growth.plus(pressure * softening)
        return force, growth

    def pulled_back(self, displacement: Vector, field: Vector) -> Vector:
        parts = (-pressure * (each.pressures.at(displacement)[1].T @ field) for pressure, each in self.parts)
        return np.asarray(sum(parts, start=np.zeros(len(displacement))))


@dataclass(frozen=True, eq=False)
class FluidOnSurfaces:
    """A fluid of a pressure of one on wet nodes; linear between them and dry ones.

    `at_rest`: its forces on undeformed bodies, torn; `rim`: marks of nodes around which its stiffness is not
    symmetric.
    """

    pressures: FollowingPressures
    at_rest: Vector
    rim: np.ndarray

    @classmethod
    def of(cls, scene: Scene, decomposition: Decomposition, split: np.ndarray) -> FluidOnSurfaces:
        """Return that of pressures of a scene; `split`: marks of nodes of partly wet facets. Collective."""
        pressures = FollowingPressures(scene, decomposition)
        # Without extent surfaces have no area: what forces change by from there is all of them.
        nowhere, _ = pressures.at(-at_copies(decomposition, scene.points))
        return cls(pressures, -nowhere, pressures.rim | split)


def _pressing(
    scene: Scene,
    decomposition: Decomposition,
    front: Front,
    marks: np.ndarray,
    surface: str = "wetted by a fluid",
) -> dict[str, FluidOnSurfaces]:
    """Return what fluids exert at wet nodes of all bodies, by their names. Collective.

    `surface`: name of all facets of a body that a fluid may reach: each counts once, whatever pairs have it.
    """
    found = {}
    for fluid, name in enumerate(front.names):
        split, loads, bodies = np.zeros(len(marks), dtype=bool), [], dict(scene.bodies)
        pairs, known = np.flatnonzero(front.fluids == fluid), front.nodes.slave[front.nodes.pair == fluid]
        for body, facets in _wettable(scene, pairs).items():
            mesh, first = scene.bodies[body].mesh, decomposition.tearing.first_of(body)
            wet = marks[first : first + mesh.n_nodes].astype(float)
            # Fluid reaches nodes that are held where it is next to them.
            held = ~np.isin(first + facets, known) & np.isin(facets, _slave_nodes(scene, body, pairs))
            beside = np.broadcast_to(wet[facets].max(axis=1)[:, None], facets.shape)
            np.maximum.at(wet, facets[held], beside[held])
            split[first + np.unique(facets[np.ptp(wet[facets], axis=1) > 0.0])] = True
            loads.append(Pressure(body, surface, NodeValues(mesh.points, wet)))
            named = replace(mesh, surfaces={**mesh.surfaces, surface: facets})
            bodies[body] = replace(scene.bodies[body], mesh=named)
        wetted = replace(scene, bodies=bodies, loads=loads)
        found[name] = FluidOnSurfaces.of(wetted, decomposition, split)
    return found


def _wettable(scene: Scene, pairs: np.ndarray) -> dict[str, np.ndarray]:
    """Return the facets of each body that the fluid of some pairs may reach, each once."""
    parts: dict[str, list[np.ndarray]] = {}
    for number in pairs:
        pair = scene.contacts[number]
        for side in pair.surfaces if _has_wet_master(scene, number) else (pair.slave,):
            parts.setdefault(side.body, []).append(scene.bodies[side.body].mesh.surfaces[side.name])
    joined = {body: np.concatenate(each) for body, each in parts.items()}
    once = {
        body: np.unique(np.sort(each, axis=1), axis=0, return_index=True)[1] for body, each in joined.items()
    }
    return {body: facets[np.sort(once[body])] for body, facets in joined.items()}


def _slave_nodes(scene: Scene, body: str, pairs: np.ndarray) -> np.ndarray:
    """Return the nodes of the slaves of some pairs on a body."""
    sides = [scene.contacts[number].slave for number in pairs]
    own = [scene.bodies[body].mesh.surfaces[side.name].ravel() for side in sides if side.body == body]
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *own]))
