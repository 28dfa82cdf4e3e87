"""Large deformations and nonlinear materials: Newton's method on the torn system."""

from fenics_contact.nonlinear.equations import Configuration, Equations, Linearisation, ResidualState
from fenics_contact.nonlinear.load_steps import AutomaticSteps, Path, PathEndsError
from fenics_contact.nonlinear.loading import FollowingPressures, LoadHistory, Loading, TurnedSurface
from fenics_contact.nonlinear.meeting import Contact, ContactConfiguration, MovingContact, StillContact
from fenics_contact.nonlinear.newton import NotHeldError, TangentNewton
from fenics_contact.nonlinear.snapping import Snap
from fenics_contact.nonlinear.starts import Effort, NonlinearEquilibrium
from fenics_contact.nonlinear.tangent_step import tangent_adjoint

__all__ = [
    "AutomaticSteps",
    "Configuration",
    "Contact",
    "ContactConfiguration",
    "Effort",
    "Equations",
    "FollowingPressures",
    "Linearisation",
    "LoadHistory",
    "Loading",
    "MovingContact",
    "NonlinearEquilibrium",
    "NotHeldError",
    "Path",
    "PathEndsError",
    "ResidualState",
    "Snap",
    "StillContact",
    "TangentNewton",
    "TurnedSurface",
    "tangent_adjoint",
]
