"""Bodies of small strain that turn so far that they are strained by it."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.errors import safe_log
from fenics_contact.mesh import BodyMesh

if TYPE_CHECKING:
    from fenics_contact.contact.state import State

_LOG = logging.getLogger(__name__)
#: Rotation in radians, as the root mean square of all cells, beyond which it is told: half of its square is
#: the strain that it makes.
FAR = 0.05


class TurnedBodies:
    """Bodies of small strain that have turned far; each is told of once."""

    def __init__(self) -> None:
        """Start without any."""
        self._told: set[str] = set()
        self._bounds = dict[str, tuple[BodyMesh, float]]()

    def tell(self, state: State) -> None:
        """Log a warning for each body of small strain that has turned far. Collective."""
        comm = state.torn.decomposition.comm
        steps = state.torn_displacement.reshape(-1, state.torn.dim)
        longest = float(comm.allreduce(np.linalg.norm(steps, axis=1).max(initial=0.0), op=MPI.MAX))
        for name, body in state.scene.bodies.items():
            if body.deforms_much or name in self._told or longest == 0.0:
                continue
            if longest * self._bound(name, body.mesh) <= FAR:
                continue
            angle = rotation_of(body.mesh, state.gather_displacement(name))
            if angle <= FAR:
                continue
            self._told.add(name)
            if comm.rank == 0:
                words = (
                    "body %r has turned by %.2g rad; its material is for small rotations, %.1g of strain is "
                    "due to this alone: give it a material for large deformations, such as StVenantKirchhoff"
                )
                safe_log(_LOG.warning, words, name, angle, angle**2 / 2)

    def _bound(self, name: str, mesh: BodyMesh) -> float:
        """Return `_Arms.largest` of a body, computed once for a mesh."""
        if name not in self._bounds or self._bounds[name][0] is not mesh:
            self._bounds[name] = mesh, _Arms.of(mesh).largest
        return self._bounds[name][1]


@dataclass(frozen=True)
class _Arms:
    """How gradients of cells follow from the displacements of their corners, by least squares.

    Attributes:
        corners: Corners of the cells, shape (n, k).
        inverse: Gradient by the displacement of each corner, shape (n, k, dim), [1 / length].
        size: Volumes up to a factor, shape (n,).
    """

    corners: np.ndarray
    inverse: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, mesh: BodyMesh) -> _Arms:
        corners = mesh.linear.cells
        arms = mesh.points[corners]
        arms = arms - arms.mean(axis=1, keepdims=True)
        metric = np.einsum("nkd,nke->nde", arms, arms)
        return cls(corners, arms @ np.linalg.inv(metric), np.sqrt(np.linalg.det(metric)))

    @property
    def largest(self) -> float:
        """A bound on the rotation of any cell by displacements of length one, [1 / length]."""
        return float(np.linalg.norm(self.inverse, axis=2).sum(axis=1).max())

    def rotation(self, displacement: np.ndarray) -> float:
        """Return the root mean square of the rotations of cells, in radians.

        Args:
            displacement: Of the nodes, shape (n_nodes, dim), [length].
        """
        gradient = np.einsum("nkd,nke->nde", self.inverse, displacement[self.corners])
        square = ((gradient - gradient.transpose(0, 2, 1)) ** 2).sum(axis=(1, 2)) / 8.0
        return float(np.sqrt(np.average(square, weights=self.size)))


def rotation_of(mesh: BodyMesh, displacement: np.ndarray) -> float:
    """Return by how much the cells of a body turn, as a root mean square, in radians.

    Args:
        mesh: Its mesh.
        displacement: Of the nodes, shape (n_nodes, dim), [length].
    """
    return _Arms.of(mesh).rotation(displacement)
