"""Internal forces and tangent of meshes with materials that have a history."""

from __future__ import annotations

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem.composition import Composition
from fenics_contact.fem.deformation import Dilatation
from fenics_contact.fem.gauss_points import GaussPoints
from fenics_contact.fem.mechanics import Mechanics, Response
from fenics_contact.mesh import determinants
from fenics_contact.scene import HistoryMaterial, has_mean_dilatation


class HistoryMechanics:
    """`Mechanics` of materials with a history; others on the same mesh are added."""

    def __init__(
        self,
        parts: Composition,
        cell_type: str,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
        others: Mechanics | None,
    ) -> None:
        """Evaluate shape functions.

        Args:
            parts: Materials of the mesh.
            cell_type: Of the mesh.
            space: Displacements on the mesh.
            points: Coordinates by input node, shape (n, dim), [length].
            others: The mechanics of the materials without history, None where there are none.
        """
        nodes, dofs = _dolfinx.node_dofs(space)
        by_block = np.empty_like(points)
        by_block[dofs] = points[nodes]
        self._gauss = GaussPoints(space, cell_type, by_block)
        self._dilatation = Dilatation(space, cell_type, by_block)
        self._others = others
        every = np.arange(self._gauss.shape[0])
        self._parts = [
            (material, every if parts.cells is None else parts.cells[tag])
            for tag, material in enumerate(parts.materials, start=1)
            if isinstance(material, HistoryMaterial)
        ]
        self._size = max(material.history_size for material, _ in self._parts)

    @property
    def history_shape(self) -> tuple[int, int, int]:
        """Shape of a history: cells, Gauss points of a cell, internal variables."""
        return *self._gauss.shape, self._size

    def at(
        self,
        displacement: np.ndarray,
        history: np.ndarray | None = None,
        duration: float = np.nan,
        origin: np.ndarray | None = None,
    ) -> Response:
        """Evaluate the materials and assemble; see `Mechanics.at`.

        Raises:
            InvalidInputError: If the history has another shape, or a material answers what it must not.
            UserCodeError: If a material raises.
        """
        before, gradient = self._before(history), self._gauss.gradient(displacement)
        after, stress = before.copy(), np.full(gradient.shape, np.nan)
        force, entries = np.zeros(displacement.size), np.zeros(self._gauss.entries)
        for material, cells in self._parts:
            if not len(cells):
                continue
            shape, size = (len(cells), gradient.shape[1]), material.history_size
            means = None
            if has_mean_dilatation(material):
                means = self._gauss.mean_strain(cells, material.moduli)
            given = gradient[cells] if means is None else means.averaged(gradient[cells])
            end = material.answer(
                given.reshape(-1, 3, 3), before[cells, :, :size].reshape(-1, size), duration
            )
            after[cells, :, :size] = end.history.reshape(*shape, size)
            nominal = end.stress.reshape(*shape, 3, 3)
            stress[cells] = cauchy(nominal, gradient[cells]) if material.finite else nominal
            force += self._gauss.force(nominal if means is None else means.averaged(nominal), cells)
            entries += self._gauss.stiffness(end.tangent.reshape(*shape, 3, 3, 3, 3), cells, means)
        rest = None if self._others is None else self._others.at(displacement, origin=origin)
        return Response(
            force=force if rest is None else force + rest.force,
            tangent=lambda: self._gauss.assembled(entries, None if rest is None else rest.stiffness),
            energy=None,
            least_jacobian=self.least_jacobian(displacement),
            history=after,
            stress=stress,
        )

    def least_jacobian(self, displacement: np.ndarray) -> float:
        """Return the smallest det F; see `Mechanics.least_jacobian`."""
        return self._dilatation.least(displacement)

    def _before(self, history: np.ndarray | None) -> np.ndarray:
        if history is None:
            return np.zeros(self.history_shape)
        if history.shape != self.history_shape:
            raise InvalidInputError(
                f"the history of this mesh must have shape {self.history_shape} (cells, Gauss points, "
                f"internal variables), got {history.shape}: it belongs to another mesh or other materials; "
                "start with None"
            )
        return history


def cauchy(nominal: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Return P Fᵀ / det F by the first Piola-Kirchhoff stress and the displacement gradient, (..., 3, 3)."""
    F = np.eye(3) + gradient
    return np.asarray(nominal @ F.swapaxes(-1, -2) / determinants(F)[..., None, None])
