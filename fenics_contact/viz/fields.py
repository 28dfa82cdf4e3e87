"""The fields of a state as plain arrays in the order of the bodies' meshes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.contact import State
from fenics_contact.geometry import BodyMesh


@dataclass(frozen=True)
class BodyFields:
    """Displacement and stress of one body, replicated on all ranks.

    Attributes:
        mesh: The body's mesh in the state's geometry.
        displacement: (n_nodes, 3), [length].
        von_mises: Constant on cells, (n_cells,), [force / length²].
    """

    mesh: BodyMesh
    displacement: np.ndarray
    von_mises: np.ndarray

    def deformed(self, scale: float) -> np.ndarray:
        """Return the coordinates moved by ``scale`` times the displacement, (n_nodes, 3), [length]."""
        return self.mesh.points + scale * self.displacement

    @property
    def nodal_von_mises(self) -> np.ndarray:
        """Mean over the cells around each node, (n_nodes,), [force / length²]."""
        cells, count = self.mesh.cells, self.mesh.n_nodes
        spread = np.repeat(self.von_mises, cells.shape[1])
        summed = np.bincount(cells.ravel(), weights=spread, minlength=count)
        return np.asarray(summed / np.bincount(cells.ravel(), minlength=count))


def gather(state: State) -> dict[str, BodyFields]:
    """Collect displacement and stress of all bodies on every rank. Collective."""
    return {
        name: BodyFields(
            body.mesh, state.gather_displacement(name), cell_values(state.von_mises[name], body.mesh.cells)
        )
        for name, body in state.scene.bodies.items()
    }


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
