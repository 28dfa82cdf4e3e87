"""Shape sensitivity of scenes with contact and friction."""

from fenics_contact.shape.adjoint import Adjoint, solve_adjoint
from fenics_contact.shape.contact_forces import ContactForces
from fenics_contact.shape.design import SurfaceDesign
from fenics_contact.shape.design_function import DesignFunction
from fenics_contact.shape.energies import StrainEnergy, TotalPotential
from fenics_contact.shape.friction_work import FrictionWork
from fenics_contact.shape.largest_stress import LargestStress
from fenics_contact.shape.linearised_face import WeakChoice, WeakPoints, linearise_face
from fenics_contact.shape.load_cases import LoadCases
from fenics_contact.shape.load_path import LoadPath
from fenics_contact.shape.memory import DesignPoint, JointPoint
from fenics_contact.shape.motion import MeshMotion
from fenics_contact.shape.moved_surface import MovedSurface
from fenics_contact.shape.movement import Movement
from fenics_contact.shape.objective import Objective, Partials
from fenics_contact.shape.pressures import ContactArea, LargestPressure, PressureNorm, PressureUnevenness
from fenics_contact.shape.problem import ShapeProblem
from fenics_contact.shape.remeshed import Remeshed, Remeshing
from fenics_contact.shape.sums import Maximum, Weighable, WeightedSum
from fenics_contact.shape.tolerance import AdaptiveTolerance
from fenics_contact.shape.volume_integral import VolumeIntegral

__all__ = [
    "AdaptiveTolerance",
    "Adjoint",
    "ContactArea",
    "ContactForces",
    "DesignFunction",
    "DesignPoint",
    "FrictionWork",
    "JointPoint",
    "LargestPressure",
    "LargestStress",
    "LoadCases",
    "LoadPath",
    "Maximum",
    "MeshMotion",
    "MovedSurface",
    "Movement",
    "Objective",
    "Partials",
    "PressureNorm",
    "PressureUnevenness",
    "Remeshed",
    "Remeshing",
    "ShapeProblem",
    "StrainEnergy",
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
