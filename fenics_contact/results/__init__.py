"""What states consist of: forces, energies, errors, rigid motions."""

from fenics_contact._accuracy.discretisation import DiscretisationError
from fenics_contact._accuracy.state_errors import BalancedTolerance, SolverErrors, StateErrors
from fenics_contact.qp.fixed_point import Damping
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.fields import GatheredFields
from fenics_contact.results.forces import Balance, PairResultants, Resultant, Resultants
from fenics_contact.results.rigid_motions import RigidMotion, UnheldMotion
from fenics_contact.results.state import Energies

__all__ = [
    "Balance",
    "BalancedTolerance",
    "ContactResult",
    "Damping",
    "DiscretisationError",
    "Energies",
    "GatheredFields",
    "PairResultants",
    "Resultant",
    "Resultants",
    "RigidMotion",
    "SolverErrors",
    "StateErrors",
    "UnheldMotion",
]
