"""The fields of a state as plain arrays in the order of the bodies' meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State
from fenics_contact.mesh import BodyMesh


@dataclass(frozen=True)
class Moved:
    """One body and how it moves, replicated on all ranks.

    Attributes:
        mesh: The body's mesh in the state's geometry, quadratic cells cut into linear ones.
        displacement: (n_nodes, dim), [length].
    """

    mesh: BodyMesh
    displacement: np.ndarray

    def deformed(self, scale: float) -> np.ndarray:
        """Return the coordinates moved by ``scale`` times the displacement, (n_nodes, dim), [length]."""
        return self.mesh.points + scale * self.displacement


@dataclass(frozen=True)
class BodyFields(Moved):
    """Displacement and stress of one body, replicated on all ranks.

    Attributes:
        von_mises: Constant on cells, (n_cells,), [force / length²].
    """

    von_mises: np.ndarray

    @property
    def nodal_von_mises(self) -> np.ndarray:
        """Mean over the cells around each node, (n_nodes,), [force / length²]."""
        cells, count = self.mesh.cells, self.mesh.n_nodes
        spread = np.repeat(self.von_mises, cells.shape[1])
        summed = np.bincount(cells.ravel(), weights=spread, minlength=count)
        return np.asarray(summed / np.bincount(cells.ravel(), minlength=count))


def moved(state: State) -> dict[str, Moved]:
    """Collect the displacement of all bodies on every rank. Collective."""
    return {
        name: Moved(body.mesh, state.gather_displacement(name)) for name, body in state.scene.bodies.items()
    }


def gather(state: State) -> dict[str, BodyFields]:
    """Collect displacement and stress of all bodies on every rank. Collective."""
    found = {}
    for name, body in state.scene.bodies.items():
        linear = body.mesh.linear
        stress = np.repeat(state.gather_von_mises(name), linear.n_cells // body.mesh.n_cells)
        found[name] = BodyFields(linear, state.gather_displacement(name), stress)
    return found
