"""Equilibrium of scenes with contact and friction."""

from fenics_contact.contact.area import contact_area
from fenics_contact.contact.balance import Balance
from fenics_contact.contact.cell_stress import STRESS_COMPONENTS
from fenics_contact.contact.coulomb import FixedPoint
from fenics_contact.contact.deformed_state import AnyState, DeformedState
from fenics_contact.contact.energies import Energies
from fenics_contact.contact.equilibrium import default_solver
from fenics_contact.contact.fields import body_mesh
from fenics_contact.contact.gathered import GatheredFields, in_space
from fenics_contact.contact.linear_state import LinearState, as_linear
from fenics_contact.contact.multi_block import body_grid
from fenics_contact.contact.newton_steps import NewtonSteps
from fenics_contact.contact.pair_resultants import PairResultants
from fenics_contact.contact.problem import ContactProblem, solve_scene
from fenics_contact.contact.result import ContactResult, RowValues, Status
from fenics_contact.contact.resultant import Resultant, Resultants
from fenics_contact.contact.rigid_motion import RigidMotion
from fenics_contact.contact.slip_bounds import Damping
from fenics_contact.contact.state import State
from fenics_contact.contact.state_in_words import pairs_in_words
from fenics_contact.contact.static_admissibility import check_held
from fenics_contact.contact.steps import LoadSequence, solve_steps
from fenics_contact.contact.stored import stored_state
from fenics_contact.contact.tolerance import Tolerance
from fenics_contact.contact.unheld import UnheldMotion

__all__ = [
    "STRESS_COMPONENTS",
    "AnyState",
    "Balance",
    "ContactProblem",
    "ContactResult",
    "Damping",
    "DeformedState",
    "Energies",
    "FixedPoint",
    "GatheredFields",
    "LinearState",
    "LoadSequence",
    "NewtonSteps",
    "PairResultants",
    "Resultant",
    "Resultants",
    "RigidMotion",
    "RowValues",
    "State",
    "Status",
    "Tolerance",
    "UnheldMotion",
    "as_linear",
    "body_grid",
    "body_mesh",
    "check_held",
    "contact_area",
    "default_solver",
    "in_space",
    "pairs_in_words",
    "solve_scene",
    "solve_steps",
    "stored_state",
]
