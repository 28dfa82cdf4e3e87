"""Derivatives of an objective by the geometry of contact and ties, in reverse mode.

From gaps, normals, tangents, weights, areas and slip bounds at points back to the nodes of both surfaces:
through closest points, mortar couplings, averaged normals and nodal areas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.points import MortarPoints
from fenics_contact._pairing.points import HELD, ContactPoints
from fenics_contact._scene.fields import gradients_of
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact._scene.pairs import ContactPair, PairPart, Tie, Tresca
from fenics_contact._scene.parts import slave_of, surface_of
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import Projection
from fenics_contact.design.adjoint import LinearisedFace, slips_by_area
from fenics_contact.design.surface_derivatives import (
    PointDerivatives,
    carriers,
    frames_pulled_back,
    normals_pulled_back,
    point_areas_pulled_back,
    projection_pulled_back,
    slopes_pulled_back,
)
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.constraints import ConstraintRows
from fenics_contact.feti.torn import TornSystem
from fenics_contact.shapes.simple import evaluate_shape


def bound_sensitivity(
    torn: TornSystem, by_multiplier: np.ndarray, w: np.ndarray, linearised: LinearisedFace
) -> np.ndarray:
    """Return dJ by each slip bound at fixed geometry, d·(∂J/∂τ − B_T w), replicated. Collective."""
    force = by_multiplier - torn.jump(w)
    mine = np.einsum("na,na->n", linearised.slip_direction, force[torn.layout.tangential])
    result = np.zeros(len(torn.frictional))
    result[torn.owned_discs] = mine
    return np.asarray(torn.decomposition.comm.allreduce(result))


def bounds_by_area(torn: TornSystem, normal_force: np.ndarray, by_bound: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the slip bounds with respect to the areas of the points, (n_points,).

    Tresca's bound is a traction times a nodal area, which moves with the nodes; so is a limit, and a curve
    gives tractions at pressures. `by_bound`: derivative by each frictional point's slip bound.
    """
    by_area = np.zeros(torn.points.count)
    area = torn.points.area[torn.frictional]
    slope = torn.groups.slips.tresca_bound / np.where(area > 0.0, area, 1.0)
    slope = slope + torn.groups.slips.strength.by_area(normal_force[torn.frictional])
    by_area[torn.frictional] = by_bound * slope
    return by_area


def closures_by_area(torn: TornSystem, multiplier: np.ndarray, adjoint: np.ndarray) -> np.ndarray | float:
    """Return dJ by the areas of points through compliances, ζ ∂C/∂A, replicated, (n_points,). Collective."""
    if not torn.compliance.contact.gives_way:
        return 0.0
    by_area = slips_by_area(torn, multiplier, adjoint)
    if torn.groups.normal.closures is not None:
        force, weight = (torn.numbering.gather(x, torn.normal_rows) for x in (multiplier, adjoint))
        by_area += weight * torn.groups.normal.closures.by_area(force)
    return by_area


def bounds_by_place(torn: TornSystem, normal_force: np.ndarray, by_bound: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the slip bounds with respect to the slave nodes, (n_points, dim).

    Friction given as a function of position changes with the place of the node: a bound μ(x) λ_N by λ_N ∇μ,
    Tresca's bound by the area times the gradient of the traction. Gradients are central differences.
    """
    points = torn.points
    result, by_all = np.zeros((points.count, torn.components)), np.zeros(points.count)
    by_all[torn.frictional] = by_bound
    limited = np.zeros(points.count, dtype=bool)
    limited[torn.frictional] = torn.groups.slips.strength.limited(normal_force[torn.frictional])
    places = torn.scene.points[points.slave]
    for index, pair in enumerate(torn.scene.contacts):
        if pair.friction_varies:
            mine = np.flatnonzero(points.pair == index)
            size = points.area if isinstance(pair.friction, Tresca) else normal_force
            slope = gradients_of(f"friction of {pair.place}", pair.friction_value, places[mine], ())
            result[mine] = np.where(limited, 0.0, size * by_all)[mine, None] * slope
        if callable(pair.shear_limit):
            mine = np.flatnonzero(points.pair == index)
            slope = gradients_of(f"shear limit of {pair.place}", pair.shear_limit, places[mine], ())
            result[mine] += np.where(limited, points.area * by_all, 0.0)[mine, None] * slope
    return result


@dataclass(frozen=True, eq=False)
class PairedFields:
    """State and adjoint as derivatives by the geometry combine them: multipliers of one, motion of the other.

    `multipliers`: λ and ζ − ∂J/∂(B u − c), owned; `displacements`: w and u, torn displacements of this rank;
    `sliding`: ∂J/∂s of points without friction, replicated.
    """

    multipliers: tuple[np.ndarray, np.ndarray]
    displacements: tuple[np.ndarray, np.ndarray]
    sliding: np.ndarray | float = 0.0


@dataclass(frozen=True, eq=False)
class PointMotions:
    """Displacements of state and adjoint at points, replicated.

    `values`: displacement of these nodes, of the adjoint and of the state, shape (2, n_nodes, dim): each
    multiplier is paired with the other field; `relative`: slave minus master displacement, in the same order.
    """

    nodes: np.ndarray
    values: np.ndarray
    relative: np.ndarray

    def at(self, nodes: np.ndarray) -> np.ndarray:
        """Return the displacements of some of the nodes, shape (2, ..., dim)."""
        return np.asarray(self.values[:, np.searchsorted(self.nodes, nodes)])


def point_motions(
    torn: TornSystem, points: ContactPoints, pairs: Sequence[PairPart], fields: PairedFields
) -> PointMotions:
    """Return the motions of points. Collective."""
    tearing, scene = torn.decomposition.tearing, torn.scene
    surfaces = [master for pair in pairs for master in pair.surfaces[1:]]
    opposite = [tearing.global_nodes(each.body, np.unique(scene.facets(each))) for each in surfaces]
    nodes = np.unique(np.concatenate([points.jump.indices, *opposite]))
    values = np.stack([nodal_mean_at(torn.decomposition, field, nodes) for field in fields.displacements])
    jump = points.jump[:, nodes]
    return PointMotions(nodes, values, np.stack([jump @ value for value in values]))


@dataclass(frozen=True)
class MortarDerivatives:
    """Derivatives of a scalar by mortar points."""

    pulled: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    area: np.ndarray


def mortar_by_shape(
    torn: TornSystem,
    pair: ContactPair | Tie,
    points: np.ndarray,
    motions: PointMotions,
    by: MortarDerivatives,
) -> np.ndarray:
    """Return the derivative by the nodes of all bodies, replicated, shape (n_nodes, dim). Collective."""
    tearing, scene = torn.decomposition.tearing, torn.scene
    faced = pair.master_surface
    slave, master = slave_of(scene, pair, pair.geometry), surface_of(scene, faced, pair.geometry)
    nodes, opposite = (
        tearing.global_nodes(side.body, surface.nodes)
        for side, surface in ((pair.slave, slave), (faced, master))
    )
    bearing, comm = np.isin(nodes, points), torn.decomposition.comm
    movable = ~scene.fixed(pair.slave.body)[slave.nodes].all(axis=1)
    met = MortarPoints.of(slave, master, bearing, master_share(scene, pair), comm, movable)
    left, right = (np.hstack(list(each)) for each in (by.pulled, motions.at(opposite)))
    own, known = np.zeros((len(nodes), left.shape[1])), np.isin(nodes, motions.nodes)
    own[known] = np.hstack(list(motions.at(nodes[known])))
    coupled = CouplingDerivatives(by.area, left, right, by.normal, by.gap, own)
    by_slave, by_master = mortar_points_pulled_back(met, coupled, comm)
    result = np.zeros((tearing.n_nodes, torn.components))
    result[nodes] += by_slave
    result[opposite] += by_master
    return result


def mortar_points_pulled_back(
    points: MortarPoints, by: CouplingDerivatives, comm: MPI.Comm
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives by the nodes of slave and master, shape (n_nodes, dim) each. Collective.

    Gaps between true surfaces are those that linear displacements can close: combinations of gaps at the
    nodes of both, each of which is a projection.
    """
    slave, master, coupling, gaps = points.slave, points.master, points.coupling, points.closable
    by_slave, by_master = np.zeros_like(slave.points), np.zeros_like(master.points)
    if gaps is not None:
        across = gaps.share * by.gap
        by_own = np.where(gaps.kept, 0.0, by.gap) - across
        here, there = gaps.here, gaps.there
        by_nodes = gaps.by_nodes(coupling, by_own)
        by_own = np.where(gaps.nodal, 0.0, by_own)
        at_slave, at_master = _gaps_pulled_back(master, here, by_nodes[here.point])
        by_slave[here.point] += at_slave
        by_master += at_master
        at_master, at_slave = _gaps_pulled_back(slave, there, (coupling.weight.T @ across)[there.point])
        by_master[there.point] += at_master
        by_slave += at_slave
        own = np.zeros((len(slave.nodes), by.left.shape[1])) if by.own is None else by.own
        none = np.zeros(len(slave.nodes)), np.zeros(len(master.nodes))
        by = replace(
            by,
            own=np.column_stack([own, none[0], -gaps.own]),
            gap=np.where(gaps.kept, by.gap, 0.0),
            left=np.column_stack([by.left, across, by_own]),
            right=np.column_stack([by.right, gaps.opposite, none[1]]),
        )
    parts = points.pulled_back(by, comm)
    for surface, part, result in zip((slave, master), parts, (by_slave, by_master), strict=True):
        every = np.arange(len(surface.facets))
        by_points, by_normals, by_averaged = slopes_pulled_back(surface, every, part.slopes)
        result += part.points + by_points
        result += normals_pulled_back(surface, part.normals + by_normals, by_averaged)
    return by_slave, by_master


def _gaps_pulled_back(
    surface: FacetedSurface, hit: Projection, by_gap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of the gaps with respect to projected points and the surface's nodes."""
    count, dim, corners = len(hit.point), surface.dim, surface.corners
    by = PointDerivatives(
        by_gap, np.zeros((count, dim)), np.zeros((count, dim - 1, dim)), np.zeros((count, corners))
    )
    return projection_pulled_back(surface, hit.facet, hit.local, hit.gap, by)


@dataclass(frozen=True, eq=False)
class RowFields(PointMotions):
    """Multipliers and displacements of state and adjoint at the contact points, replicated.

    `normal`: λ_N and ζ_N; `friction`: τ and ζ_T in the points' tangents.
    """

    normal: np.ndarray
    friction: np.ndarray


def _require_own_rows(torn: TornSystem, points: ContactPoints) -> None:
    """Reject means over the facets at two periodic edges, whose shares would change with the shape."""
    diagonal = np.asarray(points.master[np.arange(points.count), points.slave]).ravel()
    if np.any(np.abs(diagonal) > HELD) and torn.groups.of(ConstraintRows):
        raise InvalidInputError(
            "derivatives by the shape need surfaces that meet alike at both periodic edges, got means over "
            "different facets: give both surfaces the same cells, or discretisation='node'"
        )


def contact_by_shape(
    torn: TornSystem, fields: PairedFields, by_bound: np.ndarray, by_area: np.ndarray | float
) -> np.ndarray:
    """Return the derivative by the geometry of the contact points, replicated, shape (n_nodes, dim).

    It is ∂/∂X of −λᵀ B w + (ζ − j)ᵀ(c − B u), with the objective's derivative j by B u − c, and the shares of
    slip bounds and areas, by which the derivatives are given. Fluid acts as λ_N = p A does, where it is now.
    Collective.
    """
    tearing, points = torn.decomposition.tearing, torn.points
    result = np.zeros((tearing.n_nodes, torn.components))
    if points.count == 0:
        return result
    _require_own_rows(torn, points)
    rows = _row_fields(torn, fields)
    by_area = bounds_by_area(torn, rows.normal[0], by_bound) + by_area
    with together(torn.decomposition.comm):
        np.add.at(result, points.slave, bounds_by_place(torn, rows.normal[0], by_bound))
    pressure = torn.fluid.pressure
    by_area = np.asarray(by_area + pressure * np.einsum("nd,nd->n", points.normal, rows.relative[0]))
    rows = replace(rows, normal=rows.normal + np.stack([pressure * points.area, 0.0 * points.area]))
    for index, pair in enumerate(torn.scene.contacts):
        mine = np.flatnonzero(points.pair == index)
        if pair.by_mortar:
            result += _by_mortar(torn, index, rows, by_area)
            continue
        add_areas(result, torn, index, by_area)
        if pair.between_bodies:
            _add_projected(result, torn, pair, rows, mine)
        else:
            result[points.slave[mine]] += _by_obstacle(torn, pair, rows, mine)
    return result


def add_areas(
    result: np.ndarray, torn: TornSystem, index: int, by_area: np.ndarray, places: np.ndarray | None = None
) -> None:
    """Add the derivative by the nodes through the areas on the slave surface of a pair."""
    pair = torn.scene.contacts[index]
    slave, given = torn.points.of_surface(index, by_area)
    if given.any():
        surface = slave_of(torn.scene, pair, "faceted")
        nodes = torn.decomposition.tearing.global_nodes(pair.slave.body, surface.nodes)
        if places is not None:
            surface = replace(surface, points=places[nodes])
        by_areas = np.zeros(len(nodes))
        by_areas[np.searchsorted(nodes, slave)] = given
        result[nodes] += point_areas_pulled_back(surface, by_areas)


def _by_mortar(torn: TornSystem, index: int, rows: RowFields, by_area: np.ndarray) -> np.ndarray:
    """Return the derivative by all nodes through points of mortar contact, (n_nodes, dim). Collective."""
    points, mine = torn.points, np.flatnonzero(torn.points.pair == index)
    by = _by_point(points, rows, mine)
    turned = frames_pulled_back(points.normal[mine], by.tangents, by.axes)
    # Nodes that have no point of this pair only give their areas to others.
    slave, areas = points.of_surface(index, by_area)
    own = np.isin(slave, points.slave[mine])
    pulled, normal, gap = (
        np.zeros((2, len(slave), torn.components)),
        np.zeros((len(slave), torn.components)),
        0.0 * areas,
    )
    pulled[:, own], normal[own], gap[own] = _pulled_master(points, rows, mine), by.normal + turned, by.gap
    given = MortarDerivatives(pulled, normal, gap, areas)
    return mortar_by_shape(torn, torn.scene.contacts[index], slave, rows, given)


def _by_obstacle(torn: TornSystem, pair: ContactPair, rows: RowFields, mine: np.ndarray) -> np.ndarray:
    """Return the derivative by the slave nodes that face an obstacle, shape (n, dim)."""
    by, normal = _by_point(torn.points, rows, mine), torn.points.normal[mine]
    carried = np.zeros(normal.shape)
    if pair.tool:  # a point farther from its reference point moves more
        body = torn.scene.tools[pair.tool]
        nodes = torn.decomposition.tearing.global_nodes(pair.tool, np.arange(body.mesh.n_nodes))
        moved = np.broadcast_to(rows.at(nodes)[:, None], (2, len(mine), len(nodes), torn.components))
        carried = _by_point(torn.points, rows, mine, moved).weight @ body.weight_slopes
    with together(torn.decomposition.comm):
        bending = evaluate_shape(pair.obstacle, "curvatures", torn.scene.points[torn.points.slave[mine]])
    turning = by.normal + frames_pulled_back(normal, by.tangents, by.axes)
    return np.asarray(carried + by.gap[:, None] * normal + np.einsum("nde,ne->nd", bending, turning))


def _add_projected(
    result: np.ndarray, torn: TornSystem, pair: ContactPair, rows: RowFields, mine: np.ndarray
) -> None:
    """Add the derivative by slave and master nodes of projected points."""
    master = pair.master_surface
    points, surface = torn.points, surface_of(torn.scene, master, pair.geometry)
    nodes = torn.decomposition.tearing.global_nodes(master.body, surface.nodes)
    carrying, gradients = carriers(surface, points.facet[mine], points.local[mine])
    by = replace(_by_point(points, rows, mine, rows.at(nodes[carrying])), gradients=gradients)
    _add_projection(result, surface, nodes, points, mine, by)


def _add_projection(
    result: np.ndarray,
    surface: FacetedSurface,
    nodes: np.ndarray,
    points: ContactPoints,
    mine: np.ndarray,
    by: PointDerivatives,
) -> None:
    """Add the derivative by the slave nodes of some points and by the nodes of their master."""
    by_slave, by_master = projection_pulled_back(
        surface, points.facet[mine], points.local[mine], points.distance[mine], by
    )
    result[points.slave[mine]] += by_slave
    result[nodes] += by_master


def _row_fields(torn: TornSystem, fields: PairedFields) -> RowFields:
    """Gather multipliers and displacements at all points. Collective."""
    points, width = torn.points, torn.components - 1
    normal = np.stack([torn.numbering.gather(x, torn.normal_rows) for x in fields.multipliers])
    friction = np.zeros((2, points.count, width))
    for k, x in enumerate(fields.multipliers):
        gathered = torn.numbering.gather(x, torn.tangential_rows.ravel())
        friction[k, torn.frictional] = gathered.reshape(-1, width)
    friction[1, torn.groups.slips.frictionless] = -np.asarray(fields.sliding)
    motions = point_motions(torn, points, torn.scene.contacts, fields)
    return RowFields(motions.nodes, motions.values, motions.relative, normal, friction)


def _by_point(
    points: ContactPoints, rows: RowFields, mine: np.ndarray, corners: np.ndarray | None = None
) -> PointDerivatives:
    """Differentiate −λᵀ B w − ζᵀ B u + ζ_N g; rows −n·rel(v) and t·rel(v), rel(v) = v_s − Σ w_j v_j."""
    force, friction, relative = rows.normal[:, mine], rows.friction[:, mine], rows.relative[:, mine]
    normal = np.einsum("kn,knd->nd", force, relative)
    tangents = -np.einsum("kna,knd->nad", friction, relative)
    if corners is None:
        return PointDerivatives(force[1], normal, tangents, np.zeros((len(mine), 0)), points.axes[mine])
    weight = np.einsum("knd,knjd->nj", _pulled_master(points, rows, mine), corners)
    return PointDerivatives(force[1], normal, tangents, weight, points.axes[mine])


def _pulled_master(points: ContactPoints, rows: RowFields, mine: np.ndarray) -> np.ndarray:
    """Return the forces on the master, whose work in the other field is derived, shape (2, m, dim)."""
    pressed = -rows.normal[:, mine, None] * points.normal[mine]
    rubbed = np.einsum("kna,nad->knd", rows.friction[:, mine], points.tangents[mine])
    return np.asarray(pressed + rubbed)


def ties_by_shape(torn: TornSystem, fields: PairedFields) -> np.ndarray:
    """Return the derivative by the geometry of tied points, replicated, shape (n_nodes, dim). Collective.

    It is ∂/∂X of −λᵀ B w − (ζ − j)ᵀ B u over the rows of ties, with the objective's derivative j by B u − c.
    Rows of bonded surfaces lie along the axes and change by the weights of the master alone, those of sliding
    ones by its normals, too. Sides of sectors do not move.
    """
    result = np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
    for rows in torn.tie_rows:
        points = rows.points
        if points.count == 0:
            continue
        _require_own_rows(torn, points)
        motions = point_motions(torn, points, torn.scene.ties, fields)
        forces = np.stack([rows.along_rows(torn.gathered(x, rows)) for x in fields.multipliers])
        for index in np.unique(points.pair):
            tie, mine = torn.scene.ties[index], np.flatnonzero(points.pair == index)
            if tie.sectors:
                continue
            assert isinstance(tie, Tie)
            add = _add_tie if tie.discretisation == "node" else _add_mortar_tie
            add(result, torn, points, tie, motions, forces[:, mine], mine)
    return result


def _add_tie(
    result: np.ndarray,
    torn: TornSystem,
    points: ContactPoints,
    tie: Tie,
    motions: PointMotions,
    force: np.ndarray,
    mine: np.ndarray,
) -> None:
    """Add the derivative by slave and master nodes of one tie; a row is d·(v_s − Σ w_j v_j)."""
    surface = surface_of(torn.scene, tie.master, "faceted")
    nodes = torn.decomposition.tearing.global_nodes(tie.master.body, surface.nodes)
    carrying, gradients = carriers(surface, points.facet[mine], points.local[mine])
    weight = np.einsum("knd,knjd->nj", force, motions.at(nodes[carrying]))
    by_normal = _by_normal(points, tie, motions, force, mine)
    tangents = np.zeros_like(points.tangents[mine])
    by = PointDerivatives(np.zeros(len(mine)), by_normal, tangents, weight, points.axes[mine], gradients)
    _add_projection(result, surface, nodes, points, mine, by)


def _add_mortar_tie(
    result: np.ndarray,
    torn: TornSystem,
    points: ContactPoints,
    tie: Tie,
    motions: PointMotions,
    force: np.ndarray,
    mine: np.ndarray,
) -> None:
    """Add the derivative by slave and master nodes of one tie of weighted means. Collective."""
    none = np.zeros(len(mine))
    by = MortarDerivatives(force, _by_normal(points, tie, motions, force, mine), none, none)
    result += mortar_by_shape(torn, tie, points.slave[mine], motions, by)


def _by_normal(
    points: ContactPoints, tie: Tie, motions: PointMotions, force: np.ndarray, mine: np.ndarray
) -> np.ndarray:
    """Return the derivative by the normals, shape (n, dim): rows of sliding ties lie along −n."""
    if not tie.sliding:
        return np.zeros(points.normal[mine].shape)
    along = -np.einsum("knd,nd->kn", force, points.normal[mine])
    return np.einsum("kn,knd->nd", along, motions.relative[:, mine])
