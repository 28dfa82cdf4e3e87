"""The fields of a state as plain arrays in the order of the bodies' meshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.contact import State


def cell_values(function: Any, cells: np.ndarray) -> np.ndarray:
    """Collect a cellwise constant Function in the order of a body's cells. Collective on its mesh.

    Args:
        function: Function on the body's own mesh, one value a cell.
        cells: Node numbers of all cells of the body, (n_cells, 8 | 4).

    Returns:
        One value for every cell, (n_cells,), replicated.
    """
    space = function.function_space
    topology = space.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    mine = _dolfinx.cell_nodes(space.mesh).reshape(-1, cells.shape[1])[:owned]
    # dolfinx has its own order of cells: they are recognised by their nodes.
    _, key = np.unique(np.sort(np.vstack([cells, mine]), axis=1), axis=0, return_inverse=True)
    place = np.empty(len(cells), dtype=np.int64)
    place[key.ravel()[: len(cells)]] = np.arange(len(cells))
    dofs = [int(space.dofmap.cell_dofs(cell)[0]) for cell in range(owned)]
    values = np.zeros(len(cells))
    values[place[key.ravel()[len(cells) :]]] = function.x.array[dofs]
    return np.asarray(space.mesh.comm.allreduce(values))


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
    contact, tearing = state.contact, state.system.torn.decomposition.tearing
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
