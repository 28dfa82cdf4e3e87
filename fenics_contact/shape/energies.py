"""Energies as objectives."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import ThermalStrain
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.objective import Partials, require_linear
from fenics_contact.shape.sums import Weighable
from fenics_contact.shape.work_derivative import strain_work_by_shape, work_by_shape


@dataclass(frozen=True)
class TotalPotential(Weighable):
    """J = ½ uᵀK u − fᵀu, less the work of loads at the points of rigid surfaces, [force · length]."""

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the total potential energy; raises as `require_linear` does."""
        require_linear(state, self)
        return state.energies.total_potential

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂u = K u − f, ∂J/∂q = −g, ∂J/∂X from UFL: half of a(u, u), all of L(u)."""
        torn, u = state.torn, state.torn_displacement
        by_shape = work_by_shape(forms, torn, 0.5 * u, u)
        # In equilibrium K u − f = −Bᵀλ.
        return Partials.of(
            state,
            self.value(state, forms),
            by_displacement=-torn.force(state.solution.multiplier),
            by_motion=-torn.free.load,
            by_shape=by_shape,
        )


@dataclass(frozen=True)
class StrainEnergy(Weighable):
    """J = ½ uᵀK u, [force · length]: the compliance of the bodies, without the way that a load gains.

    Without friction and prescribed displacements, with dead loads, the total potential is

        ½ uᵀK u − fᵀu = −½ uᵀK u − Σ λ_N g,

    g the gaps before deformation. A surface that gives way opens the gaps along the load, and lowers the
    potential by the load times the way that the body follows, however soft the bodies become. Minimising the
    strain energy makes them stiff under a given load; under prescribed displacements it makes them soft.

    Raises:
        InvalidInputError: If the scene has a `ThermalStrain`: a part of the strain is then without stress,
            and ½ uᵀK u is no stored energy.
    """

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the strain energy; raises as `require_linear` does."""
        require_linear(state, self)
        if any(isinstance(load, ThermalStrain) for load in state.scene.loads):
            raise InvalidInputError(
                "StrainEnergy needs a scene without ThermalStrain, whose strain stores no energy, got one: "
                "integrate a density of your own by VolumeIntegral"
            )
        return state.energies.strain

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂u = K u, ∂J/∂X half of that of a(u, u)."""
        value, torn, u = self.value(state, forms), state.torn, state.torn_displacement
        # In equilibrium K u = f − Bᵀλ.
        by_displacement = torn.load - torn.force(state.solution.multiplier)
        by_shape = strain_work_by_shape(forms, torn, 0.5 * u, u)
        return Partials.of(state, value, by_displacement=by_displacement, by_shape=by_shape)
