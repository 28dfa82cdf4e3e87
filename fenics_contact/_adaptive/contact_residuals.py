"""What contact laws that hold at nodes miss between them, and what nodal forces miss of pressures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.inside import InsideOf
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.parts import slave_of, surface_of
from fenics_contact._surfaces.facets import FacetedSurface, has_midside_pressure, heights, shape_functions
from fenics_contact._surfaces.projection import Projection, interpolated_normal, node_weights, project
from fenics_contact.design.objective import Partials
from fenics_contact.errors import together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.mesh.cell_types import FACET_TYPES, quadrature
from fenics_contact.results.state import State
from fenics_contact.shapes.simple import evaluate_shape


@dataclass(frozen=True, eq=False)
class Places:
    """Points of quadrature on the true slave surface of a pair, on this rank's share of its facets.

    `weight`: the area that belongs to each; `height`: how far the true surface lies above the facet, along
    the normal; `values`: weights of the surface's nodes in fields.
    """

    points: np.ndarray
    normal: np.ndarray
    weight: np.ndarray
    height: np.ndarray
    values: sp.csr_matrix

    @classmethod
    def of(cls, surface: FacetedSurface, facets: np.ndarray, degree: int = 4) -> Places:
        """Return the points of a rule of a degree on some facets, (n_facets,)."""
        local, weights = quadrature(FACET_TYPES[surface.corners, surface.dim], degree)
        if surface.corners != 3:  # facets use coordinates from −1 to 1, as their shape functions do
            local, weights = 2.0 * local - 1.0, weights * 2.0 ** (surface.dim - 1)
        facet, local = np.repeat(facets, len(local)), np.tile(local, (len(facets), 1))
        values, slopes = shape_functions(local, surface.corners)
        nodes = surface.facets[facet]
        points = np.einsum("nk,nkd->nd", values, surface.points[nodes])
        along = np.einsum("nka,nkd->nad", slopes, surface.points[nodes])
        gram = np.einsum("nad,nbd->nab", along, along)
        area = np.tile(weights, len(facets)) * np.sqrt(np.linalg.det(gram))
        area = surface.measure.around(points[:, 0]) * area
        normal, _ = interpolated_normal(values, surface.normals[nodes])
        nothing, every = np.zeros(len(facet)), np.arange(len(facet))
        here = Projection(every, facet, local, nothing, normal, nothing, every[:0])
        height = heights(surface, facet, local).value
        return cls(points + height[:, None] * normal, normal, area, height, node_weights(surface, here))

    def part(self, chosen: np.ndarray) -> Places:
        """Return some of the points."""
        points, normal, values = self.points[chosen], self.normal[chosen], self.values[chosen]
        return Places(points, normal, self.weight[chosen], self.height[chosen], values)


class _Slave:
    """The slave of a pair with values of contact points at its nodes."""

    def __init__(self, state: State, index: int) -> None:
        """Find the nodes of the points of a pair."""
        torn, pair = state.torn, state.torn.scene.contacts[index]
        self.surface = slave_of(torn.scene, pair, pair.slave_geometry)
        self.nodes = torn.decomposition.tearing.global_nodes(pair.slave.body, self.surface.nodes)
        self.mine = np.flatnonzero(torn.points.pair == index)
        self.place = np.searchsorted(self.nodes, torn.points.slave[self.mine])
        hanging = torn.scene.bodies[pair.slave.body].mesh.hanging
        known = np.isin(np.arange(len(self.nodes)), self.place)
        self._fill = hanging.filled(self.surface.nodes, known)

    def at_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return values of all contact points at the nodes of the surface, zero at others, (n_nodes, ...).

        At hanging nodes they are the means of their masters.
        """
        result = np.zeros((len(self.nodes), *values.shape[1:]))
        result[self.place] = values[self.mine]
        return np.asarray(self._fill @ result)

    def facets(self, state: State, weight: np.ndarray) -> np.ndarray:
        """Return this rank's share of the facets all of whose nodes have points, and one of them a weight."""
        comm, known = state.torn.decomposition.comm, self.at_nodes(np.ones(state.torn.points.count)) > 0.0
        facets = self.surface.facets
        chosen = known[facets].all(axis=1) & (weight[facets] != 0.0).any(axis=1)
        return np.asarray(np.flatnonzero(chosen)[comm.rank :: comm.size])


def at_rest(state: State, index: int, slave: _Slave, facets: np.ndarray) -> tuple[Places, np.ndarray]:
    """Return points of facets where bodies move little, with gaps along the normals of undeformed ones."""
    decomposition, field = state.torn.decomposition, state.conforming_displacement
    own = nodal_mean_at(decomposition, field, slave.nodes)[:, : slave.surface.dim]
    places = Places.of(slave.surface, facets)
    along = places.values @ slave.at_nodes(state.torn.points.normal)
    found, gap, normal, theirs = _opposite(state, state.scene.contacts[index], places, along)
    places = places.part(found)
    closing = places.values @ own - theirs[:, : slave.surface.dim]
    return places, gap + np.einsum("nd,nd->n", normal, closing)


def where_they_are(state: Any, index: int, slave: _Slave, facets: np.ndarray) -> tuple[Places, np.ndarray]:
    """Return points of facets of moved bodies, as far off them as of undeformed ones, and the gaps there.

    `state`: a `DeformedState`.
    """
    inside = InsideOf.of(state.scene, state.scene.contacts[index])
    inside = state.equilibrium.evaluation.contact.where_they_are(inside, index)
    places, height = Places.of(inside.slave, facets), Places.of(slave.surface, facets).height
    with together(state.torn.decomposition.comm):
        met = inside.master.met(places.points + height[:, None] * places.normal, places.normal)
    found = np.flatnonzero(np.isfinite(met.distance))
    return places.part(found), met.distance[found]


#: Returns points on some facets of the slave of a pair that face its master, and the gaps there. Collective.
Faced: TypeAlias = "Callable[[State, int, _Slave, np.ndarray], tuple[Places, np.ndarray]]"


def between_nodes(state: State, multiplier: np.ndarray, opening: float, faced: Faced = at_rest) -> float:
    """Return Σ ∫ ζ (g + n·(u_s − u_m) − r) over the slaves of all pairs. Collective.

    Contact holds at nodes, or as a mean: between them facets of one surface enter the other one, or leave
    gaps where the surfaces are curved. The function ζ interpolates forces per area, r the residuals at the
    contact points; the gap g and the normal n are those of the true surfaces in each point. `multiplier`:
    forces ζ of an adjoint, owned; `opening`: share of the gaps at open nodes that is not part of r. The rim
    of the contact lies somewhere between closed and open nodes, and forces that do not vanish there work on
    the gaps within it: half of them, on average. `faced`: `at_rest`, or `where_they_are` for bodies that have
    moved far.
    """
    torn, total = state.torn, 0.0
    pressing, residual = (
        torn.numbering.gather(x, torn.normal_rows) for x in (multiplier, state.rows.residual)
    )
    missed = np.where(state.contact.normal_force > 0.0, residual, (1.0 - opening) * residual)
    for index, pair in enumerate(torn.scene.contacts):
        if not pair.is_self_contact:
            total += _of_pair(state, index, pressing, missed, faced)
    return float(torn.decomposition.comm.allreduce(total))


def _of_pair(state: State, index: int, pressing: np.ndarray, residual: np.ndarray, faced: Faced) -> float:
    slave, points = _Slave(state, index), state.torn.points
    if has_midside_pressure(slave.surface.bearing):
        return 0.0  # without forces at the corners; the error of quadratic facets is small
    weight = slave.at_nodes(pressing / state.contact.area)
    # Where a pair gives other gaps than the measured ones, the difference is interpolated.
    missed = slave.at_nodes(residual - (points.gap - points.distance))
    places, gap = faced(state, index, slave, slave.facets(state, weight))
    return float(places.weight * (places.values @ weight) @ (gap - places.values @ missed))


def _nearest(
    places: Places, master: FacetedSurface
) -> tuple[np.ndarray, np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return which points face a master, gaps and normals along its own, and its nodes' weights there."""
    hit = project(places.points, places.normal, master)
    return hit.point, hit.gap, hit.normal, node_weights(master, hit)


def _along(
    places: Places, along: np.ndarray, master: FacetedSurface
) -> tuple[np.ndarray, np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return the same along other directions, in which mortar measures gaps: the slave's normals.

    The master's point straight ahead is the one nearest to where the tangential plane of the first one is
    met. Where contact on a roller is a quarter of its radius wide, gaps along the master's normals are off by
    as much as the whole error of a good mesh, however fine that is. `along`: from the master to the slave, of
    any length.
    """
    first = project(places.points, places.normal, master)
    normal = along[first.point] / np.linalg.norm(along[first.point], axis=1, keepdims=True)
    away = first.gap / np.einsum("nd,nd->n", first.normal, normal)
    ahead = places.points[first.point] - away[:, None] * normal
    hit = project(ahead, places.normal[first.point], master)
    chosen = hit.point
    gap = away[chosen] + hit.gap / np.einsum("nd,nd->n", hit.normal, normal[chosen])
    return first.point[chosen], gap, normal[chosen], node_weights(master, hit)


def _opposite(
    state: State, pair: ContactPair, places: Places, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return which points face the master, their gaps and normals, and how it moves there. Collective."""
    torn, scene, field = state.torn, state.torn.scene, state.conforming_displacement
    decomposition = torn.decomposition
    tearing, comm = decomposition.tearing, decomposition.comm
    if pair.between_bodies:
        master = surface_of(scene, pair.master_surface, pair.geometry)
        nodes = tearing.global_nodes(pair.master_surface.body, master.nodes)
        moved = nodal_mean_at(decomposition, field, nodes)
        with together(comm):
            found = _along(places, along, master) if pair.by_mortar else _nearest(places, master)
        found_at, gap, normal, weights = found
        return found_at, gap, normal, weights @ moved
    every = np.arange(len(places.points))
    with together(comm):
        gap = evaluate_shape(pair.obstacle, "distance", places.points)
        normal = evaluate_shape(pair.obstacle, "normals", places.points)
    moved = np.zeros_like(places.points)
    if pair.tool:
        body = scene.tools[pair.tool]
        nodes = tearing.global_nodes(pair.tool, np.arange(body.mesh.n_nodes))
        moved = body.weights(places.points) @ nodal_mean_at(decomposition, field, nodes)
    return every, gap, normal, moved


def of_pressures(state: State, partials: Partials) -> float:
    """Return by how much an objective changes from nodal forces per area to the pressures at the nodes.

    A nodal force λ_i = ∫ p φ_i is a mean of the pressure about the node. With M_ij = ∫ φ_i φ_j the pressure
    at the node is p_i = λ_i / A_i + ½ (λ_i − Σ_j M_ij λ_j / A_j) / A_i + O(h⁴): the second moment of M_i is
    twice that of φ_i on linear facets; on quadratic ones nothing is added. The sum of forces stays the same,
    so that sums over nodes are integrals up to the rim of a surface. Collective.
    """
    torn, points = state.torn, state.torn.points
    rows = torn.numbering.gather(partials.by_multiplier, torn.normal_rows)
    total = 0.0
    for index, pair in enumerate(torn.scene.contacts):
        slave = None if pair.is_self_contact else _Slave(state, index)
        if slave is None or slave.surface.order > 1:
            continue
        pressure = slave.at_nodes(state.contact.normal_force / points.area)
        by_force, every = slave.at_nodes(rows), np.ones(len(slave.nodes))
        places = Places.of(slave.surface, slave.facets(state, every), degree=2)
        area = places.values.T @ places.weight
        spread = places.values.T @ (places.weight * (places.values @ pressure))
        total += 0.5 * float(by_force @ (area * pressure - spread))
    return float(torn.decomposition.comm.allreduce(total))
