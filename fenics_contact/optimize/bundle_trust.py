"""The bundle trust method: null and serious steps until the model predicts no decrease."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact.errors import InvalidInputError
from fenics_contact.optimize.bundle import Bundle
from fenics_contact.optimize.objective import Evaluation, evaluate
from fenics_contact.optimize.problem import Problem
from fenics_contact.optimize.quadratic_program import SubproblemError
from fenics_contact.optimize.result import InvalidDesignError, Kind, NotConvergedError, Reason, Record, Result
from fenics_contact.optimize.subproblem import Step, solve_step
from fenics_contact.optimize.trust import Trial, Trust

Array = NDArray[np.float64]
Callback = Callable[[Record, Array], None]

_LOG = logging.getLogger(__name__)
