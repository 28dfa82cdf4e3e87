"""The fields of a state as plain arrays in the order of the bodies' meshes."""

from __future__ import annotations

import numpy as np

from fenics_contact.contact import State


def contact_fields(state: State, body: str) -> dict[str, np.ndarray]:
    """Return what happens on a body's contact surfaces as fields on all its nodes.

    Args:
        state: The state.
        body: Name of the body.

    Returns:
        ``contact_status``, (n_nodes,) int: the value of `Status`, −1 on nodes that are no contact points;
        and, zero on those, ``contact_pressure``, (n_nodes,), [force / length²], ``contact_force`` on the
        slave and ``contact_slip``, (n_nodes, 3), [force] and [length]. A node that belongs to several pairs
        has their sum, and the status of the last.
    """
    contact, tearing = state.contact, state.torn.decomposition.tearing
    start = int(tearing.node_offset[tearing.body_names.index(body)])
    count = state.scene.bodies[body].mesh.n_nodes
    nodes = contact.points.slave - start
    mine = np.flatnonzero((nodes >= 0) & (nodes < count))
    slip = np.einsum("na,nad->nd", contact.slip, contact.points.tangents)

    def summed(values: np.ndarray) -> np.ndarray:
        field = np.zeros((count, *values.shape[1:]))
        np.add.at(field, nodes[mine], values[mine])
        return field

    status = np.full(count, -1, dtype=np.int32)
    status[nodes[mine]] = contact.status[mine]
    return {
        "contact_status": status,
        "contact_pressure": summed(contact.pressure),
        "contact_force": summed(contact.force),
        "contact_slip": summed(slip),
    }
