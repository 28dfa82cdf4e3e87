"""Minimise a nonsmooth function, of which one subgradient at a point is known, over constraints."""

from __future__ import annotations

from fenics_contact.checkpoint import Checkpoint, CheckpointError
from fenics_contact.errors import InvalidDesignError
from fenics_contact.optimize.bundle_trust import BundleTrust
from fenics_contact.optimize.constraints import Bounds, LinearConstraints, nearest_feasible
from fenics_contact.optimize.for_scipy import ForScipy, Visit
from fenics_contact.optimize.manufacture import (
    convex,
    fixed_rim,
    joined,
    monotone,
    smallest_radius,
    symmetric,
)
from fenics_contact.optimize.minimization import minimize
from fenics_contact.optimize.nonlinear import ConstraintValue, NonlinearConstraint
from fenics_contact.optimize.objective import Inexact, Kinked, Pieced
from fenics_contact.optimize.problem import PosedProblem, pose
from fenics_contact.optimize.progress import Callback, Resumable
from fenics_contact.optimize.quadratic_program import SubproblemError
from fenics_contact.optimize.result import NotConvergedError, Reason, Record, Result, StepKind

__all__ = [
    "Bounds",
    "BundleTrust",
    "Callback",
    "Checkpoint",
    "CheckpointError",
    "ConstraintValue",
    "ForScipy",
    "Inexact",
    "InvalidDesignError",
    "Kinked",
    "LinearConstraints",
    "NonlinearConstraint",
    "NotConvergedError",
    "Pieced",
    "PosedProblem",
    "Reason",
    "Record",
    "Result",
    "Resumable",
    "StepKind",
    "SubproblemError",
    "Visit",
    "convex",
    "fixed_rim",
    "joined",
    "minimize",
    "monotone",
    "nearest_feasible",
    "pose",
    "smallest_radius",
    "symmetric",
]
