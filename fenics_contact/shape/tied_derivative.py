"""Derivative of an objective by the geometry of tied points: weights, and normals where a tie slides."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti import TornSystem
from fenics_contact.scene import Tie, surface_of
from fenics_contact.shape.mortar_derivative import MortarDerivatives, mortar_by_shape
from fenics_contact.shape.point_motions import PairedFields, PointMotions, point_motions
from fenics_contact.shape.projection_derivative import PointDerivatives, carriers, projection_pulled_back


def ties_by_shape(torn: TornSystem, fields: PairedFields) -> np.ndarray:
    """Return the derivative by the geometry of tied points, replicated, shape (n_nodes, dim). Collective.

    It is ∂/∂X of −λᵀ B w − (ζ − j)ᵀ B u over the rows of ties, with the objective's derivative j by B u − c.
    Rows of bonded surfaces lie along the axes and change by the weights of the master alone, those of sliding
    ones by its normals, too.
    """
    result = np.zeros((torn.decomposition.tearing.n_nodes, torn.dim))
    if torn.ties.count == 0:
        return result
    masters = [tie.master for tie in torn.scene.ties]
    motions = point_motions(torn, torn.ties, masters, fields)
    forces = _forces(torn, fields.multipliers)
    for index, tie in enumerate(torn.scene.ties):
        mine = np.flatnonzero(torn.ties.pair == index)
        add = _add_tie if tie.discretisation == "node" else _add_mortar_tie
        add(result, torn, tie, motions, forces[:, mine], mine)
    return result


def _forces(torn: TornSystem, multipliers: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the multipliers of the rows times their directions, summed at each point, (2, n, dim)."""
    rows = torn.relations[0]
    result = np.zeros((2, torn.ties.count, torn.dim))
    for force, multiplier in zip(result, multipliers, strict=True):
        values = torn.numbering.gather(multiplier, torn.n_gluing + np.arange(rows.count))
        np.add.at(force, rows.which, values[:, None] * rows.directions)
    return result


def _add_tie(
    result: np.ndarray, torn: TornSystem, tie: Tie, motions: PointMotions, force: np.ndarray, mine: np.ndarray
) -> None:
    """Add the derivative by slave and master nodes of one tie; a row is d·(v_s − Σ w_j v_j)."""
    points, surface = torn.ties, surface_of(torn.scene, tie.master, "faceted")
    nodes = torn.decomposition.tearing.global_nodes(tie.master.body, surface.nodes)
    carrying, gradients = carriers(surface, points.facet[mine], points.local[mine])
    weight = np.einsum("knd,knjd->nj", force, motions.at(nodes[carrying]))
    by_normal = _by_normal(torn, tie, motions, force, mine)
    tangents = np.zeros_like(points.tangents[mine])
    by = PointDerivatives(np.zeros(len(mine)), by_normal, tangents, weight, points.axes[mine], gradients)
    by_slave, by_master = projection_pulled_back(
        surface, points.facet[mine], points.local[mine], points.distance[mine], by
    )
    result[points.slave[mine]] += by_slave
    result[nodes] += by_master


def _add_mortar_tie(
    result: np.ndarray, torn: TornSystem, tie: Tie, motions: PointMotions, force: np.ndarray, mine: np.ndarray
) -> None:
    """Add the derivative by slave and master nodes of one tie of weighted means. Collective."""
    none = np.zeros(len(mine))
    by = MortarDerivatives(force, _by_normal(torn, tie, motions, force, mine), none, none)
    result += mortar_by_shape(torn, tie, torn.ties.slave[mine], motions, by)


def _by_normal(
    torn: TornSystem, tie: Tie, motions: PointMotions, force: np.ndarray, mine: np.ndarray
) -> np.ndarray:
    """Return the derivative by the normals, shape (n, dim): rows of sliding ties lie along −n."""
    if not tie.sliding:
        return np.zeros((len(mine), torn.dim))
    along = -np.einsum("knd,nd->kn", force, torn.ties.normal[mine])
    return np.einsum("kn,knd->nd", along, motions.relative[:, mine])
