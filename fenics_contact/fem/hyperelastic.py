"""Internal forces and tangent of hyperelastic materials."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.fem.composition import Composition, material_sets
from fenics_contact.fem.deformation import Dilatation
from fenics_contact.fem.deformed_forms import FORMS, have_mean_energy, prepare_forms
from fenics_contact.fem.mean_dilatation import MeanDilatation, assembled, mean_fields
from fenics_contact.fem.mechanics import Response
from fenics_contact.fem.templates import Templates
from fenics_contact.scene import HistoryMaterial, Scene, is_nonlinear


class HyperelasticMechanics:
    """`Mechanics` of materials with an energy; linear ones among them stay small-strain."""

    def __init__(
        self,
        templates: Templates,
        parts: Composition,
        cell_type: str,
        space: _dolfinx.fem.FunctionSpace,
        points: np.ndarray,
    ) -> None:
        """Bind the forms; arguments as in `FormLibrary.mechanics`."""
        nodes, dofs = _dolfinx.node_dofs(space)
        by_block = np.empty_like(points)
        by_block[dofs] = points[nodes]
        self._mesh, self._points = space.mesh, points
        self._dilatation = Dilatation(space, cell_type, by_block)
        self._displacement = _dolfinx.fem.Function(space)
        fields = [self._displacement, *mean_fields(space.mesh, cell_type)]
        self._energy, self._force, self._tangent = (
            templates[kind, parts.materials, cell_type].bind(
                [space] * number, parts.parameters, fields, mesh=space.mesh, cells=parts.cells
            )
            for number, kind in enumerate(FORMS)
        )
        self._mean: MeanDilatation | None = None
        if have_mean_energy(parts.materials):
            self._mean = MeanDilatation(templates, parts, cell_type, fields, self._dilatation)

    def at(
        self,
        displacement: np.ndarray,
        history: np.ndarray | None = None,
        duration: float = np.nan,
        origin: np.ndarray | None = None,
    ) -> Response:
        """Assemble; see `Mechanics.at`."""
        _dolfinx.update_coordinates(self._mesh, self._points)
        self._displacement.x.array[:] = displacement
        if self._mean is not None:
            self._mean.follow(displacement)
        force, energy = _dolfinx.assemble_vector(self._force), _dolfinx.assemble_scalar(self._energy)
        tangent = partial(self._stiffness, displacement.copy(), origin)
        return Response(force, tangent, energy, self.least_jacobian(displacement))

    def _stiffness(self, displacement: np.ndarray, origin: np.ndarray | None) -> sp.csr_matrix:
        """Return the tangent.

        Pressures that grow with the bulk modulus overshoot within a Newton step, by the square of its
        displacements: the tangent has those that the step foresaw.
        """
        _dolfinx.update_coordinates(self._mesh, self._points)
        if self._mean is not None and origin is not None:
            self._displacement.x.array[:] = origin
            self._mean.foresee(origin, displacement)
        elif self._mean is not None:
            self._mean.follow(displacement)
        self._displacement.x.array[:] = displacement
        stiffness = assembled(self._tangent, (displacement.size,) * 2)
        return stiffness if self._mean is None else (stiffness + self._mean.stiffness()).tocsr()

    def least_jacobian(self, displacement: np.ndarray) -> float:
        """Return the smallest det F; see `Mechanics.least_jacobian`."""
        least = self._dilatation.least(displacement)
        return least if self._mean is None else min(least, self._mean.least(displacement))


def prepare_mechanics(templates: Templates, scene: Scene) -> None:
    """Compile the missing forms of a scene's nonlinear materials. Collective."""
    for body in scene.bodies.values():
        for materials in material_sets(body):
            others = [material for material in materials if not isinstance(material, HistoryMaterial)]
            if others and any(map(is_nonlinear, materials)):
                prepare_forms(templates, materials, body.mesh.cell_type)
