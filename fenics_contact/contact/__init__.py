"""Equilibrium of scenes with contact and friction."""

from fenics_contact.contact.area import contact_area
from fenics_contact.contact.coulomb import FixedPoint
from fenics_contact.contact.energies import Energies
from fenics_contact.contact.equilibrium import find_state, solve_scene
from fenics_contact.contact.gathered import GatheredFields, contact_fields, gathered_fields, in_space
from fenics_contact.contact.held import check_held
from fenics_contact.contact.result import ContactResult, Status
from fenics_contact.contact.slip_bounds import Damping
from fenics_contact.contact.state import State
from fenics_contact.contact.steps import LoadSequence, solve_steps
from fenics_contact.contact.stored import restored_state, stored_state
from fenics_contact.contact.unheld import UnheldMotion

__all__ = [
    "ContactResult",
    "Damping",
    "Energies",
    "FixedPoint",
    "GatheredFields",
    "LoadSequence",
    "State",
    "Status",
    "UnheldMotion",
    "check_held",
    "contact_area",
    "contact_fields",
    "find_state",
    "gathered_fields",
    "in_space",
    "restored_state",
    "solve_scene",
    "solve_steps",
    "stored_state",
]
