"""How an objective changes with the geometry of the contact points: gap, normal, tangents, weights, areas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State
from fenics_contact.feti.contact_search import surface_of
from fenics_contact.scene import RigidPlane, Tresca
from fenics_contact.shape.adjoint import Adjoint
from fenics_contact.shape.linearised_face import LinearisedFace
from fenics_contact.shape.objective import Partials
from fenics_contact.shape.projection_derivative import PointDerivatives, projection_pulled_back
from fenics_contact.shape.surface_derivative import areas_pulled_back


@dataclass(frozen=True, eq=False)
class RowFields:
    """Multipliers and displacements of state and adjoint at the contact points, replicated.

    Attributes:
        normal: λ_N and ζ_N, shape (2, n).
        friction: τ and ζ_T in the points' tangents, shape (2, n, 2).
        relative: Slave minus master displacement, of the adjoint and of the state, shape (2, n, 3): the field
            that each multiplier is paired with.
        master: Displacement of the master's corners, shape (2, n, 4, 3), in the same order.
    """

    normal: np.ndarray
    friction: np.ndarray
    relative: np.ndarray
    master: np.ndarray


def contact_by_shape(state: State, adjoint: Adjoint, by_bound: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of −λᵀ B w + ζᵀ(c − B u) plus the slip bounds' share, replicated, shape (n_nodes, 3).

    Collective.

    Args:
        state: The state.
        adjoint: Its adjoint.
        by_bound: Derivative by each frictional point's slip bound, replicated, shape (n_friction,).
    """
    torn = state.system.torn
    tearing, points = torn.decomposition.tearing, torn.points
    result = np.zeros((int(tearing.node_offset[-1]), 3))
    if points.count == 0:
        return result
    derivatives = _by_point(state, _row_fields(state, adjoint))
    by_bound_full = np.zeros(points.count)
    by_bound_full[torn.frictional] = by_bound
    for index, pair in enumerate(torn.scene.contacts):
        mine = points.pair == index
        gap, slave = derivatives.gap[mine], points.slave[mine]
        surface = surface_of(torn.scene, pair.slave)
        nodes = tearing.global_nodes(pair.slave.body, surface.nodes)
        if isinstance(pair.friction, Tresca):
            by_areas = np.zeros(len(nodes))
            by_areas[np.searchsorted(nodes, slave)] = pair.friction.traction * by_bound_full[mine]
            result[nodes] += areas_pulled_back(surface, by_areas)
        if isinstance(pair.master, RigidPlane):
            result[slave] += gap[:, None] * np.asarray(pair.master.normal)
            continue
        master = surface_of(torn.scene, pair.master)
        by = PointDerivatives(
            gap,
            derivatives.normal[mine],
            derivatives.tangents[mine],
            derivatives.weight[mine][:, : master.corners],
        )
        by_slave, by_master = projection_pulled_back(
            master, points.facet[mine], points.local[mine], points.gap[mine], by
        )
        result[slave] += by_slave
        result[tearing.global_nodes(pair.master.body, master.nodes)] += by_master
    return result


def bound_sensitivity(
    state: State, adjoint: Adjoint, partials: Partials, linearised: LinearisedFace
) -> np.ndarray:
    """Return dJ by each slip bound at fixed geometry, d·(∂J/∂τ − B_T w), replicated. Collective."""
    system = state.system
    force = partials.by_multiplier - system.jump(adjoint.displacement)
    mine = np.einsum("na,na->n", linearised.slip_direction, force[system.problem.layout.tangential])
    result = np.zeros(len(system.torn.frictional))
    result[system.owned_discs()] = mine
    return np.asarray(system.problem.comm.allreduce(result))


def _row_fields(state: State, adjoint: Adjoint) -> RowFields:
    system = state.system
    torn = system.torn
    points, tearing = torn.points, torn.decomposition.tearing
    normal = np.stack(
        [torn.numbering.gather(x, torn.normal_rows) for x in (state.solution.multiplier, adjoint.multiplier)]
    )
    friction = np.zeros((2, points.count, 2))
    for k, x in enumerate((state.solution.multiplier, adjoint.multiplier)):
        friction[k, torn.frictional] = torn.numbering.gather(x, torn.tangential_rows.ravel()).reshape(-1, 2)
    nodes = np.unique(np.concatenate([points.slave, points.master.ravel()]))
    relative, master = np.zeros((2, points.count, 3)), np.zeros((2, points.count, 4, 3))
    for k, field in enumerate((adjoint.displacement, state.torn_displacement)):
        values = nodal_means(state, field, nodes)
        master[k] = values[np.searchsorted(nodes, points.master)]
        slave = values[np.searchsorted(nodes, points.slave)]
        relative[k] = slave - np.einsum("nj,njd->nd", points.weight, master[k])
    _ = tearing
    return RowFields(normal, friction, relative, master)


def nodal_means(state: State, field: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return the mean over all copies of a torn field at some nodes, replicated, shape (n, 3). Collective."""
    decomposition = state.system.torn.decomposition
    tearing = decomposition.tearing
    copies = tearing.multiplicity[nodes]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    block = decomposition.copy_block[np.repeat(tearing.first_copy[nodes], copies) + within]
    here = np.flatnonzero(block >= 0)
    owner = np.repeat(np.arange(len(nodes)), copies)[here]
    total = np.zeros((len(nodes), 3))
    np.add.at(total, owner, field.reshape(-1, 3)[block[here]])
    return np.asarray(decomposition.comm.allreduce(total)) / copies[:, None]


def _by_point(state: State, rows: RowFields) -> PointDerivatives:
    """Differentiate −λᵀ B w − ζᵀ B u + ζ_N g; rows −n·rel(v) and t·rel(v), rel(v) = v_s − Σ w_j v_j."""
    points = state.system.torn.points
    normal = np.einsum("kn,knd->nd", rows.normal, rows.relative)
    tangents = -np.einsum("kna,knd->nad", rows.friction, rows.relative)
    pulled = -rows.normal[:, :, None] * points.normal + np.einsum(
        "kna,nad->knd", rows.friction, points.tangents
    )
    weight = np.einsum("knd,knjd->nj", pulled, rows.master)
    return PointDerivatives(rows.normal[1], normal, tangents, weight)
