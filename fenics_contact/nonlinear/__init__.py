"""Large deformations and nonlinear materials: Newton's method on the torn system."""

from fenics_contact.nonlinear.equations import Configuration, Equations, Evaluation
from fenics_contact.nonlinear.load_steps import AutomaticSteps, LoadStepError, Path, unloaded
from fenics_contact.nonlinear.newton import Equilibrium, TangentNewton

__all__ = [
    "AutomaticSteps",
    "Configuration",
    "Equations",
    "Equilibrium",
    "Evaluation",
    "LoadStepError",
    "Path",
    "TangentNewton",
    "unloaded",
]
