"""Shape sensitivity of scenes with contact and friction."""

from fenics_contact.shape.adjoint import Adjoint, solve_adjoint
from fenics_contact.shape.design import SurfaceDesign
from fenics_contact.shape.linearised_face import WeakChoice, WeakPoints, linearise_face
from fenics_contact.shape.memory import DesignPoint
from fenics_contact.shape.motion import HarmonicExtension
from fenics_contact.shape.objective import (
    ContactForces,
    Objective,
    Partials,
    TotalPotential,
    VolumeIntegral,
    Weighable,
    WeightedSum,
)
from fenics_contact.shape.problem import ShapeProblem
from fenics_contact.shape.tolerance import AdaptiveTolerance

__all__ = [
    "AdaptiveTolerance",
    "Adjoint",
    "ContactForces",
    "DesignPoint",
    "HarmonicExtension",
    "Objective",
    "Partials",
    "ShapeProblem",
    "SurfaceDesign",
    "TotalPotential",
    "VolumeIntegral",
    "WeakChoice",
    "WeakPoints",
    "Weighable",
    "WeightedSum",
    "linearise_face",
    "solve_adjoint",
]
