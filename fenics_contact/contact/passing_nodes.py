"""How far nodes of a master pass between those of a coarser slave, where contact is by nodes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.contact.state import State
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import ContactPair, Surface, surface_of
from fenics_contact.surfaces import node_weights, project


def passing_nodes(state: State, number: int, moved: float, share: float) -> list[tuple[int, str, str]]:
    """Return the doubt about a pair whose master passes between the nodes of its slave. Collective.

    Args:
        state: A state of small strain.
        number: Number of the pair.
        moved: How far its surfaces move against each other, [length].
        share: Share of that which is told of no more.
    """
    pair = state.scene.contacts[number]
    if pair.by_mortar or not isinstance(pair.master, Surface) or pair.within_body:
        return []
    deep = _depth(state, number, pair, pair.master)
    if deep <= share * moved:
        return []
    words = (
        f"nodes of the master of {pair.place} pass between those of the slave, which is too coarse, by up to "
        f"{deep:.2g}, where surfaces move by {moved:.2g} against each other: refine the slave, or let the "
        "finer surface be the slave; linear cells have discretisation='mortar', which has no such error"
    )
    return [(number, "between nodes", words)]


def _depth(state: State, number: int, pair: ContactPair, other: Surface) -> float:
    """Return the largest depth of master nodes below facets of the slave that press, [length].

    Zero where no more master nodes meet these than they have nodes: the slave is the finer surface.
    """
    contact, scene = state.contact, state.scene
    mine = contact.on_pair(number)
    mine = mine[contact.normal_force[mine] > 0.0]
    slave, master = (surface_of(scene, side, pair.geometry) for side in (pair.slave, other))
    first = NodeNumbers.of(scene).first_of(pair.slave.body)
    presses = np.isin(slave.nodes, contact.points.slave[mine] - first)
    if not presses.any():
        return 0.0
    pressed = slave.facets[presses[slave.facets].any(axis=1)]
    size = np.linalg.norm(np.ptp(slave.points[pressed], axis=1), axis=1).max()
    reach = size + np.abs(contact.points.gap[mine]).max()
    away, _ = cKDTree(slave.points[presses]).query(master.points, distance_upper_bound=reach)
    near = np.flatnonzero(np.isfinite(away))
    hit = project(master.points[near], master.normals[near], slave)
    inside = presses[slave.facets[hit.facet]].all(axis=1)
    if np.count_nonzero(inside) <= np.count_nonzero(presses):
        return 0.0
    own = state.gather_displacement(pair.slave.body)[slave.nodes]
    moves = state.gather_displacement(other.body)[master.nodes[near[hit.point]]]
    gap = hit.gap + np.einsum("nd,nd->n", hit.normal, moves - node_weights(slave, hit) @ own)
    return -float(gap[inside].min(initial=0.0))
