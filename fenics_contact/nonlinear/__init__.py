"""Large deformations and nonlinear materials: Newton's method on the torn system."""

from fenics_contact.nonlinear.equations import Configuration, Equations, Evaluation, law_of
from fenics_contact.nonlinear.load_steps import AutomaticSteps, Path, PathEndsError, unloaded
from fenics_contact.nonlinear.newton import NonlinearEquilibrium, TangentNewton
from fenics_contact.nonlinear.tangent_system import TangentSystem

__all__ = [
    "AutomaticSteps",
    "Configuration",
    "Equations",
    "Evaluation",
    "NonlinearEquilibrium",
    "Path",
    "PathEndsError",
    "TangentNewton",
    "TangentSystem",
    "law_of",
    "unloaded",
]
