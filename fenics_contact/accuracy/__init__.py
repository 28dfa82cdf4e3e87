"""How accurate a state is: its errors by solver, friction law and mesh, in energy norm."""

from fenics_contact.accuracy.balanced import BalancedTolerance
from fenics_contact.accuracy.certificate import Certificate, certify, direct_error
from fenics_contact.accuracy.discretisation import DiscretisationError, discretisation_error
from fenics_contact.accuracy.fixed_point import friction_error
from fenics_contact.accuracy.moduli import moduli
from fenics_contact.accuracy.recovery import recovered_gradients
from fenics_contact.accuracy.sites import Sites, find_sites
from fenics_contact.accuracy.state_errors import SolverErrors, StateErrors, solver_errors, state_errors

__all__ = [
    "BalancedTolerance",
    "Certificate",
    "DiscretisationError",
    "Sites",
    "SolverErrors",
    "StateErrors",
    "certify",
    "direct_error",
    "discretisation_error",
    "find_sites",
    "friction_error",
    "moduli",
    "recovered_gradients",
    "solver_errors",
    "state_errors",
]
