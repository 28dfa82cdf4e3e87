"""Solvers for the dual problem of contact: quadratic, with equilibrium, bounds and friction discs.

The problem (`DualProblem`) is an operator, a coarse space and a layout; a solver (`FaceNewton`, `Smalse`,
`ProjectedCG`) holds only its parameters; `solve` joins them to a `DualSolution` or raises. Vectors are
distributed over the ranks of the problem's communicator.
"""

from __future__ import annotations

from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.equilibrium import Equilibrium, find_equilibrium, may_grip, require_equilibrium
from fenics_contact.qp.face import STEEP, Face, Marks, classify, face_basis
from fenics_contact.qp.face_newton import FaceNewton, ProjectedCG
from fenics_contact.qp.face_system import CoupledSystem, FaceSystem, FaceSystems, ObliqueProjector
from fenics_contact.qp.feasible import FeasibleSet
from fenics_contact.qp.forcing import Damped, Forcing, damp, run_newton
from fenics_contact.qp.iterate import Start, apply_unless_zero, iterate_at
from fenics_contact.qp.krylov import FaceStep, Kept, Stop, gmres, projected_cg, projected_gmres
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.mpgp import Mpgp
from fenics_contact.qp.not_held import SlidingError
from fenics_contact.qp.problem import (
    EVEN,
    CountedOperator,
    DualProblem,
    FacePreconditioner,
    RowsOfFace,
    Scaling,
)
from fenics_contact.qp.reductions import Vector, global_max, global_min, global_sum
from fenics_contact.qp.slip_law import CoulombLaw, SlipLaw, TrescaLaw
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import (
    DualSolution,
    Residuals,
    SmalseMemory,
    Solution,
    SolverStep,
    contact_step,
    measure,
)
from fenics_contact.qp.solve import DualSolver, solve

__all__ = [
    "EVEN",
    "STEEP",
    "CoarseSpace",
    "ContactLayout",
    "CoulombLaw",
    "CountedOperator",
    "CoupledSystem",
    "Damped",
    "DualProblem",
    "DualSolution",
    "DualSolver",
    "Equilibrium",
    "Face",
    "FaceNewton",
    "FacePreconditioner",
    "FaceStep",
    "FaceSystem",
    "FaceSystems",
    "FeasibleSet",
    "Forcing",
    "Kept",
    "Marks",
    "Mpgp",
    "ObliqueProjector",
    "ProjectedCG",
    "Residuals",
    "RowsOfFace",
    "Scaling",
    "SlidingError",
    "SlipLaw",
    "Smalse",
    "SmalseMemory",
    "Solution",
    "SolverStep",
    "Start",
    "Stop",
    "TrescaLaw",
    "Vector",
    "apply_unless_zero",
    "classify",
    "contact_step",
    "damp",
    "face_basis",
    "find_equilibrium",
    "global_max",
    "global_min",
    "global_sum",
    "gmres",
    "iterate_at",
    "may_grip",
    "measure",
    "projected_cg",
    "projected_gmres",
    "require_equilibrium",
    "run_newton",
    "solve",
]
