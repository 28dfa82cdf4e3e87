"""Contact shape optimisation: designs, problems, objectives, constraints and optimisers."""

from typing import TYPE_CHECKING

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact._optimize.bundle_trust import BundleTrust
    from fenics_contact._optimize.constraints import LinearConstraints, nearest_feasible
    from fenics_contact._optimize.manufacture import convex, fixed_rim, monotone, smallest_radius, symmetric
    from fenics_contact._optimize.nonlinear import NonlinearConstraint
    from fenics_contact._optimize.objective import Kinked, MaxFunction
    from fenics_contact._optimize.result import NotConvergedError, Result
    from fenics_contact._optimize.scipy import ForScipy
    from fenics_contact.design.adjoint import Adjoint, WeakChoice
    from fenics_contact.design.design import MovedSurface
    from fenics_contact.design.memory import AdaptiveTolerance, DesignPoint
    from fenics_contact.design.motion import VolumeIntegral
    from fenics_contact.design.near import MovementNear, StressNear
    from fenics_contact.design.objective import Maximum, Objective, Partials, Weighable
    from fenics_contact.design.objectives import (
        ContactArea,
        ContactForces,
        FrictionWork,
        LargestPressure,
        LargestStress,
        Movement,
        PressureNonuniformity,
        PressureNorm,
        StrainEnergy,
        TotalPotential,
    )
    from fenics_contact.design.peak_pressure import PeakPressure
    from fenics_contact.design.remeshed import Remeshed
    from fenics_contact.design.several import LoadCases, LoadPath
    from fenics_contact.design.wear import LargestWornDepth, WearNonuniformity, WornDepthNorm, WornVolume

__all__ = [
    "AdaptiveTolerance",
    "Adjoint",
    "BundleTrust",
    "ContactArea",
    "ContactForces",
    "DesignPoint",
    "ForScipy",
    "FrictionWork",
    "Kinked",
    "LargestPressure",
    "LargestStress",
    "LargestWornDepth",
    "LinearConstraints",
    "LoadCases",
    "LoadPath",
    "MaxFunction",
    "Maximum",
    "MovedSurface",
    "Movement",
    "MovementNear",
    "NonlinearConstraint",
    "NotConvergedError",
    "Objective",
    "Partials",
    "PeakPressure",
    "PressureNonuniformity",
    "PressureNorm",
    "Remeshed",
    "Result",
    "StrainEnergy",
    "StressNear",
    "TotalPotential",
    "VolumeIntegral",
    "WeakChoice",
    "WearNonuniformity",
    "Weighable",
    "WornDepthNorm",
    "WornVolume",
    "convex",
    "fixed_rim",
    "monotone",
    "nearest_feasible",
    "smallest_radius",
    "symmetric",
]

__getattr__, __dir__ = late_names(
    __name__, renamed={"PressureUnevenness": "PressureNonuniformity", "Pieced": "MaxFunction"}
)
