"""Heat: through bodies, through contacts, from friction, and what it does to contact."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.heat.adjoint import HeatAdjoint, heat_adjoint
    from fenics_contact.heat.conductance import (
        Conductance,
        ConductanceTable,
        EvenConductance,
        GapConductance,
        GapRadiation,
        PressureConductance,
        harmonic_mean,
    )
    from fenics_contact.heat.coupled import HeatedState, solve_heated
    from fenics_contact.heat.coupled_time import heated_in_time
    from fenics_contact.heat.friction import FrictionHeat, effusivity_share
    from fenics_contact.heat.goal_errors import heat_goal_error
    from fenics_contact.heat.levels import solve_heat_to
    from fenics_contact.heat.objectives import (
        HeatObjective,
        HeatOfContact,
        HeatOfHeld,
        JointResistance,
        TemperatureMean,
    )
    from fenics_contact.heat.parts import (
        Convection,
        HeatAtNodes,
        HeatFlux,
        HeatSource,
        HeldTemperature,
        PlasticHeat,
        Radiation,
    )
    from fenics_contact.heat.plan import HeatPlan
    from fenics_contact.heat.problem import HeatProblem, solve_heat
    from fenics_contact.heat.properties import Conductor, TemperatureTable
    from fenics_contact.heat.scene import ConductingBody, HeatScene, ThermalContact
    from fenics_contact.heat.state import HeatBalance, HeatState, HeatThroughContact
    from fenics_contact.heat.time import HeatHistory, heat_in_time

__all__ = [
    "Conductance",
    "ConductanceTable",
    "ConductingBody",
    "Conductor",
    "Convection",
    "EvenConductance",
    "FrictionHeat",
    "GapConductance",
    "GapRadiation",
    "HeatAdjoint",
    "HeatAtNodes",
    "HeatBalance",
    "HeatFlux",
    "HeatHistory",
    "HeatObjective",
    "HeatOfContact",
    "HeatOfHeld",
    "HeatPlan",
    "HeatProblem",
    "HeatScene",
    "HeatSource",
    "HeatState",
    "HeatThroughContact",
    "HeatedState",
    "HeldTemperature",
    "JointResistance",
    "PlasticHeat",
    "PressureConductance",
    "Radiation",
    "TemperatureMean",
    "TemperatureTable",
    "ThermalContact",
    "effusivity_share",
    "harmonic_mean",
    "heat_adjoint",
    "heat_goal_error",
    "heat_in_time",
    "heated_in_time",
    "solve_heat",
    "solve_heat_to",
    "solve_heated",
]

__getattr__, __dir__ = late_names(__name__)
