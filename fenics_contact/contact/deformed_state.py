"""The state of bodies with nonlinear materials."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.contact.nodal_forces import NodalForces, nodal_forces
from fenics_contact.contact.state import State
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from fenics_contact.accuracy import StateErrors
    from fenics_contact.nonlinear import NonlinearEquilibrium


@displayed
@dataclass(frozen=True, eq=False)
class DeformedState(State):
    """An equilibrium of large deformations or nonlinear materials.

    Forces, gaps, balance and stresses (Cauchy's) are those of the deformed bodies. `energies` has the stored
    energy, NaN where materials dissipate, and no dual value.

    Attributes:
        equilibrium: Displacement, forces and history of the materials.
        fractions: Parts of the last load step at which equilibria were found.
        factorisations: Factored tangents of the last load step, counting all subdomains as one.
    """

    equilibrium: NonlinearEquilibrium = field(kw_only=True)
    fractions: tuple[float, ...] = field(kw_only=True)
    factorisations: int = field(kw_only=True)

    @cached_property
    def errors(self) -> StateErrors:  # type: ignore[override]
        """Refused: the bounds and estimates of `accuracy` are those of linear elasticity.

        Raises:
            InvalidInputError: Always.
        """
        raise InvalidInputError(
            "errors are bounded and estimated for small strains and linear materials alone, this state has "
            "nonlinear materials: compare states on two meshes instead"
        )

    @cached_property
    def _nodal_forces(self) -> NodalForces:
        forces = nodal_forces(
            self.system, self.solution.multiplier, self.torn_displacement, self.contact.force
        )
        return NodalForces(
            self.scene.points + self._displacement_everywhere, forces.load, forces.reaction, forces.contact,
            forces.tie, np.zeros_like(forces.bed),
        )  # fmt: skip

    @cached_property
    def _displacement_everywhere(self) -> np.ndarray:
        """Displacement of the nodes of all bodies on every rank, shape (n_nodes, dim), [length]."""
        return np.concatenate([self.gather_displacement(name) for name in self.scene.bodies])
