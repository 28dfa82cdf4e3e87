"""Mechanics of a subdomain with cells of several shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._fem.mechanics import FROM_REST, MaterialStep, Mechanics, Response
from fenics_contact.feti.subdomain import MixedMesh


@dataclass(frozen=True, eq=False)
class OfHexahedra:
    """`Mechanics` of a mesh of several shapes of cells by that of its hexahedra."""

    mesh: MixedMesh
    mechanics: Mechanics

    def at(self, displacement: np.ndarray, step: MaterialStep = FROM_REST) -> Response:
        """Return the response to a displacement of the dofs."""
        mesh = self.mesh
        origin = None if step.origin is None else mesh.on_space(step.origin)
        response = self.mechanics.at(mesh.on_space(displacement), replace(step, origin=origin))
        force = mesh.force_of(response.force)
        return replace(response, force=force).with_matrices(mesh.matrix_of)

    def least_jacobian(self, displacement: np.ndarray) -> float:
        """Return the least ratio of volumes."""
        return self.mechanics.least_jacobian(self.mesh.on_space(displacement))
