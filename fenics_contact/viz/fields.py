"""The fields of a state as plain arrays in the order of the bodies' meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State
from fenics_contact.geometry import BodyMesh


@dataclass(frozen=True)
class BodyFields:
    """Displacement and stress of one body, replicated on all ranks.

    Attributes:
        mesh: The body's mesh in the state's geometry, quadratic cells cut into linear ones.
        displacement: (n_nodes, dim), [length].
        von_mises: Constant on cells, (n_cells,), [force / length²].
    """

    mesh: BodyMesh
    displacement: np.ndarray
    von_mises: np.ndarray

    def deformed(self, scale: float) -> np.ndarray:
        """Return the coordinates moved by ``scale`` times the displacement, (n_nodes, dim), [length]."""
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
    found = {}
    for name, body in state.scene.bodies.items():
        linear = body.mesh.linear
        stress = np.repeat(state.gather_von_mises(name), linear.n_cells // body.mesh.n_cells)
        found[name] = BodyFields(linear, state.gather_displacement(name), stress)
    return found
