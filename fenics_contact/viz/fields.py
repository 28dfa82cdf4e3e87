"""The bodies of a state for drawing: the blocks of `State.to_pyvista` by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pyvista as pv

from fenics_contact.contact import State

#: Drawn bodies by name.
Bodies = Mapping[str, pv.UnstructuredGrid]


def drawn_bodies(state: State) -> dict[str, pv.UnstructuredGrid]:
    """Return the undeformed bodies, with linear cells and all fields. Collective."""
    blocks = state.to_pyvista(linear=True)
    return {name: blocks[name] for name in blocks.keys()}


def moved(bodies: Bodies, scale: float) -> dict[str, pv.UnstructuredGrid]:
    """Return the bodies moved by ``scale`` times their displacement."""
    return {name: body.warp_by_vector("displacement", factor=scale) for name, body in bodies.items()}


def points_of(bodies: Bodies) -> np.ndarray:
    """Return the nodes of all bodies, (n, 3), [length]."""
    return np.concatenate([body.points for body in bodies.values()])


def contact_places(state: State, bodies: Bodies) -> np.ndarray:
    """Return the positions of the contact points' slave nodes on drawn bodies, (n, dim), [length]."""
    return np.asarray(points_of(bodies)[state.contact.points.slave, : state.scene.dim])


def cells_of(body: pv.UnstructuredGrid) -> np.ndarray:
    """Return the nodes of a body's cells, which are of one type, (n_cells, nodes of a cell)."""
    return np.asarray(body.cell_connectivity).reshape(body.n_cells, -1)


def nodal(body: pv.UnstructuredGrid, name: str) -> np.ndarray:
    """Return a field on cells as the mean over the cells around each node, (n_nodes,)."""
    return np.asarray(body.cell_data_to_point_data()[name])


def lengths(body: pv.UnstructuredGrid) -> np.ndarray:
    """Return the magnitude of each node's displacement, (n_nodes,), [length]."""
    return np.linalg.norm(body["displacement"], axis=1)
