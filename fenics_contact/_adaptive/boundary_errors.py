"""What bodies miss between the facets of a curved boundary and its true shape, and their loads with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fenics_contact._accuracy.discretisation import CellEnergies, OfCells, Parts
from fenics_contact._adaptive.boundary_defect import boundary_defect
from fenics_contact._adaptive.contact_residuals import Places
from fenics_contact._fem.loads import as_tractions
from fenics_contact._scene.body import Body
from fenics_contact._scene.loads import Load, Traction
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import FacetedSurface, corner_places, heights
from fenics_contact.errors import together
from fenics_contact.feti.averages import nodal_mean
from fenics_contact.feti.subdomain import Subdomain, assemble
from fenics_contact.feti.torn import TornSystem
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.results.state import State


@dataclass(frozen=True, eq=False)
class LinearChange:
    """The change of ∫ C ∇u : ∇v, see `between_facets`, from the energies of u + v and u − v."""

    before: Mapping[str, CellEnergies]

    @classmethod
    def of(cls, torn: TornSystem) -> LinearChange:
        """Return that of a scene. Collective."""
        return cls({name: CellEnergies(torn, body) for name, body in torn.scene.bodies.items()})

    def __call__(
        self, subdomain: Subdomain, after: Body, u: np.ndarray, v: np.ndarray, among: np.ndarray
    ) -> np.ndarray:
        """Return it over each cell."""
        size = [np.ptp(field, axis=1).max(initial=0.0) for field in (u, v)]
        scale = size[0] / size[1] if min(size) > 0.0 else 1.0
        nothing = np.zeros((*u.shape, after.mesh.dim))
        before = self.before[subdomain.mesh.body]
        moved = replace(subdomain, points=after.mesh.points[subdomain.mesh.nodes])
        change = np.zeros(len(u))
        for energies, part, sign in ((before, subdomain, -1.0), (before.moved(after), moved, 1.0)):
            for way in (1.0, -1.0):
                change += sign * way * energies.by_cell(part, u + way * scale * v, nothing, among)
        return change / (4.0 * scale)


@dataclass(frozen=True)
class EnergyShares:
    """An objective that depends on the shape by s ½ a(u, u) − l L(u), and else through the state alone."""

    strain: float = 0.0
    load: float = 0.0


#: Change of ∫ P : ∇v over each cell of a subdomain when its nodes move: takes the subdomain, the body after
#: that, u and v at the nodes of cells, and which cells of the body count.
Change: TypeAlias = "Callable[[Subdomain, Body, np.ndarray, np.ndarray, np.ndarray], np.ndarray]"


def between_facets(
    state: State, along: np.ndarray, own: EnergyShares, change: Change, step: float = 1e-3
) -> tuple[float, OfCells]:
    """Return δL(w) − δa(u, w) + δJ by true shapes instead of facets, and the share of each cell. Collective.

    All nodes of a curved boundary move outwards along its normals by the mean height of the true surface
    around them, which makes the volume the true one to first order. δ is the derivative along that motion, of
    the work a of stresses, the work L of loads and what the objective itself depends on the shape, as far as
    that is known. Gaps between true surfaces do not change. Nothing is done for quadratic cells, whose facets
    are curved themselves. Pressures that follow their surfaces count as on undeformed ones. `along`: the
    adjoint w, torn; `change`: of the work of stresses; `step`: part of the motion by which differences are
    taken.
    """
    torn, parts, total = state.torn, Parts(state.scene.bodies), 0.0
    comm = torn.decomposition.comm
    with together(comm):
        meshes = towards_shapes(torn.scene, step)
    if not meshes:
        return 0.0, {}
    bodies = torn.scene.bodies
    changed = {name: replace(bodies[name], mesh=mesh) for name, mesh in meshes.items()}
    moved = replace(torn.scene, bodies={**bodies, **changed})
    fields = (
        nodal_mean(torn.decomposition, state.conforming_displacement),
        nodal_mean(torn.decomposition, along),
    )
    with together(comm):
        loads = as_tractions(moved)
        changes = {name: _Change(state, moved, name, loads, change) for name in changed}
        for subdomain in torn.subdomains:
            if (found := changes.get(subdomain.mesh.body)) is not None:
                by_cell = found.by_cell(subdomain, fields, own) / step
                parts.add(subdomain, np.abs(by_cell))
                total += float(by_cell.sum())
    return float(comm.allreduce(total)), parts.joined()


def towards_shapes(scene: Scene, step: float) -> dict[str, BodyMesh]:
    """Return the meshes with a part of the way of their curved boundaries to their true shapes, by body."""
    moved = {}
    for name, body in scene.bodies.items():
        if body.mesh.order > 1 or body.is_rigid:
            continue
        if body.mesh.origin.chart is not None:
            way = boundary_defect(body.mesh.origin)
        else:
            curved = [surface_of(scene, Surface(name, each), "best") for each in body.mesh.shapes]
            curved = [surface for surface in curved if surface.relief is not None]
            way = _way_outwards(body.mesh.n_nodes, curved) if curved else np.zeros(1)
        if way.any():
            moved[name] = body.mesh.moved(body.mesh.points + step * way)
    return moved


def _way_outwards(n_nodes: int, curved: list[FacetedSurface]) -> np.ndarray:
    """Return how nodes of a body move so that its facets enclose as much as its shapes, (n_nodes, dim).

    Rims, where the curved boundary ends, move as far as their own edges ask for, in the plane not at all.
    """
    dim = curved[0].dim
    raised, area, normals = np.zeros(n_nodes), np.zeros(n_nodes), np.zeros((n_nodes, dim))
    edges, bulges, inside = [], [], np.zeros(n_nodes, dtype=bool)
    for surface in curved:
        places = Places.of(surface, np.arange(len(surface.facets)), degree=2)
        raised[surface.nodes] += places.values.T @ (places.weight * places.height)
        area[surface.nodes] += places.values.T @ places.weight
        normals[surface.nodes] = surface.normals
        inside[surface.nodes] |= surface.mirrored.any(axis=1)
        found, height = _edges(surface)
        edges.append(surface.nodes[found])
        bulges.append(height)
    distance = np.divide(raised, area, out=np.zeros(n_nodes), where=area > 0.0)
    known, first, count = np.unique(np.concatenate(edges), axis=0, return_index=True, return_counts=True)
    rim = (count == 1) & ~inside[known].all(axis=1)
    ends, bulge = known[rim], np.concatenate(bulges)[first[rim]]
    around = np.bincount(ends.ravel(), minlength=n_nodes)
    own = np.bincount(ends.ravel(), np.repeat(bulge, ends.shape[1]), minlength=n_nodes)
    distance[around > 0] = 2.0 / 3.0 * own[around > 0] / around[around > 0]
    return np.asarray(distance[:, None] * normals)


def _edges(surface: FacetedSurface) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the edges of all facets and the heights at their middles; in the plane nodes."""
    facets, count = surface.facets, surface.corners
    if surface.dim == 2:
        return facets.reshape(-1, 1), np.zeros(facets.size)
    corners = corner_places(count)
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    height = heights(surface, np.repeat(np.arange(len(facets)), count), np.tile(middles, (len(facets), 1)))
    ends = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.sort(ends, axis=1), height.value


class _Change:
    """What works on cells of one body change by when its nodes move."""

    def __init__(
        self, state: State, moved: Scene, name: str, loads: tuple[Load, ...], change: Change
    ) -> None:
        torn = state.torn
        self._bodies = torn.scene.bodies[name], moved.bodies[name]
        before, after = (body.mesh for body in self._bodies)
        self._loads = loads
        self._along = [
            load
            for load in torn.scene.loads
            if isinstance(load, Traction) and load.body == name and load.surface in before.shapes
        ]
        self._nodes = torn.decomposition.tearing.global_nodes(name, np.arange(before.n_nodes))
        self._marked = (before.points != after.points).any(axis=1)[before.cells].any(axis=1)
        self._forms = torn.decomposition.forms
        self._work = change

    def by_cell(
        self, subdomain: Subdomain, fields: tuple[np.ndarray, np.ndarray], own: EnergyShares
    ) -> np.ndarray:
        """Return δL(w) − δa(u, w) + s δ½ a(u, u) − l δL(u) of the cells of a subdomain."""
        mesh = subdomain.mesh
        cells = self._bodies[1].mesh.cells[mesh.cells]
        u, w = (field[self._nodes] for field in fields)
        both = u[cells], (0.5 * own.strain * u - w)[cells]
        turned = self._work(subdomain, self._bodies[1], *both, self._marked)
        load = self._load(subdomain) * (w - own.load * u)[mesh.nodes].ravel()
        by_node = np.zeros(len(self._nodes))
        by_node[mesh.nodes] = load.reshape(len(mesh.nodes), -1).sum(axis=1)
        around = np.bincount(cells.ravel(), minlength=len(by_node))
        return np.asarray(turned + (by_node / np.maximum(around, 1))[cells].sum(axis=1))

    def _load(self, subdomain: Subdomain) -> np.ndarray:
        """Return the change of the nodal forces of a subdomain.

        Arcs are longer than their chords by half of what chords grow by when moved to enclose as much.
        """
        change = self._forces(subdomain, self._bodies[1], self._loads) - subdomain.load
        if self._along:
            before, after = (self._forces(subdomain, body, self._along) for body in self._bodies)
            change -= 0.5 * (after - before)
        return np.asarray(change)

    def _forces(self, subdomain: Subdomain, body: Body, loads: Sequence[Load]) -> np.ndarray:
        points = body.mesh.points[subdomain.mesh.nodes]
        # It is given its stiffness, whatever that is there, so that none is assembled.
        bare = replace(subdomain, points=points, loads=(), load=np.zeros_like(subdomain.load))
        return assemble(subdomain.mesh, body, loads, self._forms, bare, subdomain.foundations).load
