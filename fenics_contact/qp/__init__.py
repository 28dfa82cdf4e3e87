"""Solvers for the dual problem of contact: quadratic, with equilibrium, bounds and friction discs.

The problem (`DualProblem`) is an operator, a coarse space and a layout; a solver (`InTurn`,
`FaceNewton`, `Smalse` with `Mpgp` inside, `ProjectedCG`) holds only its parameters; `solve` joins them to a
`DualSolution` or raises. Vectors are distributed over the ranks of the problem's communicator.
"""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names
from fenics_contact.qp.solve import DualSolver, Equilibrium, solve

if TYPE_CHECKING:
    from fenics_contact.qp.cones import FeasibleSet, SlipLaw
    from fenics_contact.qp.face import Face
    from fenics_contact.qp.face_newton import FaceNewton, ProjectedCG, SlidingError
    from fenics_contact.qp.in_turn import InTurn
    from fenics_contact.qp.krylov import Stop
    from fenics_contact.qp.problem import DualProblem, FacePreconditioner
    from fenics_contact.qp.smalse import Mpgp, Smalse
    from fenics_contact.qp.solution import DualSolution, Residuals, Start, measure

__all__ = [
    "DualProblem",
    "DualSolution",
    "DualSolver",
    "Equilibrium",
    "Face",
    "FaceNewton",
    "FacePreconditioner",
    "FeasibleSet",
    "InTurn",
    "Mpgp",
    "ProjectedCG",
    "Residuals",
    "SlidingError",
    "SlipLaw",
    "Smalse",
    "Start",
    "Stop",
    "measure",
    "solve",
]

__getattr__, __dir__ = late_names(__name__)
