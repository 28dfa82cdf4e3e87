"""Derivative of an objective by the geometry of the contact points: gap, normal, tangents, weights, areas."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.errors import together
from fenics_contact.feti import TornSystem
from fenics_contact.pairing import ContactPoints
from fenics_contact.scene import ContactPair, RigidObstacle, Surface, surface_of
from fenics_contact.shape.friction_derivative import bounds_by_area, bounds_by_place
from fenics_contact.shape.mortar_derivative import MortarDerivatives, mortar_by_shape
from fenics_contact.shape.point_motions import PairedFields, PointMotions, point_motions
from fenics_contact.shape.projection_derivative import (
    PointDerivatives,
    carriers,
    frames_pulled_back,
    projection_pulled_back,
)
from fenics_contact.shape.surface_derivative import areas_pulled_back
from fenics_contact.surface_shapes import evaluate_shape


@dataclass(frozen=True, eq=False)
class RowFields(PointMotions):
    """Multipliers and displacements of state and adjoint at the contact points, replicated.

    Attributes:
        normal: λ_N and ζ_N, shape (2, n).
        friction: τ and ζ_T in the points' tangents, shape (2, n, dim - 1).
    """

    normal: np.ndarray
    friction: np.ndarray


def contact_by_shape(
    torn: TornSystem, fields: PairedFields, by_bound: np.ndarray, by_area: np.ndarray | float
) -> np.ndarray:
    """Return the derivative by the geometry of the contact points, replicated, shape (n_nodes, dim).

    It is ∂/∂X of −λᵀ B w + (ζ − j)ᵀ(c − B u), with the objective's derivative j by B u − c, and the shares of
    slip bounds and areas, by which the derivatives are given. Collective.
    """
    tearing, points = torn.decomposition.tearing, torn.points
    result = np.zeros((tearing.n_nodes, torn.dim))
    if points.count == 0:
        return result
    rows = _row_fields(torn, fields)
    by_area = bounds_by_area(torn, by_bound) + by_area
    with together(torn.decomposition.comm):
        np.add.at(result, points.slave, bounds_by_place(torn, rows.normal[0], by_bound))
    for index, pair in enumerate(torn.scene.contacts):
        mine = np.flatnonzero(points.pair == index)
        if pair.by_mortar:
            result += _by_mortar(torn, index, rows, by_area)
            continue
        add_areas(result, torn, index, by_area)
        if not isinstance(pair.master, Surface):
            result[points.slave[mine]] += _by_obstacle(torn, pair.master, rows, mine)
        else:
            _add_projected(result, torn, pair, rows, mine)
    return result


def add_areas(
    result: np.ndarray, torn: TornSystem, index: int, by_area: np.ndarray, places: np.ndarray | None = None
) -> None:
    """Add the derivative by the nodes through the areas on the slave surface of a pair.

    Args:
        result: By the nodes of all bodies, shape (n_nodes, dim).
        by_area: By the areas of all points, shape (n_points,).
        places: Where all nodes lie, shape (n_nodes, dim), [length]; undeformed by default.
    """
    pair = torn.scene.contacts[index]
    slave, given = torn.points.of_surface(index, by_area)
    if given.any():
        surface = surface_of(torn.scene, pair.slave, "faceted")
        nodes = torn.decomposition.tearing.global_nodes(pair.slave.body, surface.nodes)
        if places is not None:
            surface = replace(surface, points=places[nodes])
        by_areas = np.zeros(len(nodes))
        by_areas[np.searchsorted(nodes, slave)] = given
        result[nodes] += areas_pulled_back(surface, by_areas)


def _by_mortar(torn: TornSystem, index: int, rows: RowFields, by_area: np.ndarray) -> np.ndarray:
    """Return the derivative by all nodes through points of mortar contact, (n_nodes, dim). Collective."""
    points, mine = torn.points, np.flatnonzero(torn.points.pair == index)
    by = _by_point(points, rows, mine)
    turned = frames_pulled_back(points.normal[mine], by.tangents, by.axes)
    # Nodes that have no point of this pair only give their areas to others.
    slave, areas = points.of_surface(index, by_area)
    own = np.isin(slave, points.slave[mine])
    pulled, normal, gap = np.zeros((2, len(slave), torn.dim)), np.zeros((len(slave), torn.dim)), 0.0 * areas
    pulled[:, own], normal[own], gap[own] = _pulled_master(points, rows, mine), by.normal + turned, by.gap
    given = MortarDerivatives(pulled, normal, gap, areas)
    return mortar_by_shape(torn, torn.scene.contacts[index], slave, rows, given)


def _by_obstacle(torn: TornSystem, obstacle: RigidObstacle, rows: RowFields, mine: np.ndarray) -> np.ndarray:
    """Return the derivative by the slave nodes that face an obstacle, shape (n, dim)."""
    by, normal = _by_point(torn.points, rows, mine), torn.points.normal[mine]
    with together(torn.decomposition.comm):
        bending = evaluate_shape(obstacle, "curvatures", torn.scene.points[torn.points.slave[mine]])
    turning = by.normal + frames_pulled_back(normal, by.tangents, by.axes)
    return np.asarray(by.gap[:, None] * normal + np.einsum("nde,ne->nd", bending, turning))


def _add_projected(
    result: np.ndarray, torn: TornSystem, pair: ContactPair, rows: RowFields, mine: np.ndarray
) -> None:
    """Add the derivative by slave and master nodes of projected points."""
    master = pair.master
    assert isinstance(master, Surface)
    points, surface = torn.points, surface_of(torn.scene, master, pair.geometry)
    nodes = torn.decomposition.tearing.global_nodes(master.body, surface.nodes)
    carrying, gradients = carriers(surface, points.facet[mine], points.local[mine])
    by = replace(_by_point(points, rows, mine, rows.at(nodes[carrying])), gradients=gradients)
    by_slave, by_master = projection_pulled_back(
        surface, points.facet[mine], points.local[mine], points.distance[mine], by
    )
    result[points.slave[mine]] += by_slave
    result[nodes] += by_master


def _row_fields(torn: TornSystem, fields: PairedFields) -> RowFields:
    """Gather multipliers and displacements at all points. Collective."""
    points, width = torn.points, torn.dim - 1
    normal = np.stack([torn.numbering.gather(x, torn.normal_rows) for x in fields.multipliers])
    friction = np.zeros((2, points.count, width))
    for k, x in enumerate(fields.multipliers):
        gathered = torn.numbering.gather(x, torn.tangential_rows.ravel())
        friction[k, torn.frictional] = gathered.reshape(-1, width)
    masters = [pair.master for pair in torn.scene.contacts]
    motions = point_motions(torn, points, masters, fields)
    return RowFields(motions.nodes, motions.values, motions.relative, normal, friction)


def _by_point(
    points: ContactPoints, rows: RowFields, mine: np.ndarray, corners: np.ndarray | None = None
) -> PointDerivatives:
    """Differentiate −λᵀ B w − ζᵀ B u + ζ_N g; rows −n·rel(v) and t·rel(v), rel(v) = v_s − Σ w_j v_j.

    Args:
        mine: The points to differentiate, shape (m,).
        corners: Displacements of the corners of their master facets, shape (2, m, corners, dim).
    """
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
