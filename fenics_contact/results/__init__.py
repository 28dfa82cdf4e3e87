"""What states consist of: forces, energies, errors, rigid motions."""

from typing import TYPE_CHECKING

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact._accuracy.discretisation import DiscretisationError
    from fenics_contact._accuracy.state_errors import BalancedTolerance, SolverErrors, StateErrors
    from fenics_contact._base.costs import Costs, PhaseCosts
    from fenics_contact.qp.fixed_point import Damping
    from fenics_contact.results.constraints import ConstraintForce, ConstraintForces
    from fenics_contact.results.contact import ContactResult
    from fenics_contact.results.fields import GatheredFields
    from fenics_contact.results.forces import Balance, PairResultants, Resultant, Resultants
    from fenics_contact.results.preloads import Preloads, SectionForces
    from fenics_contact.results.rigid_motions import RigidMotion, UnheldMotion
    from fenics_contact.results.springs import SpringForce, SpringForces
    from fenics_contact.results.state import Energies

__all__ = [
    "Balance",
    "BalancedTolerance",
    "ConstraintForce",
    "ConstraintForces",
    "ContactResult",
    "Costs",
    "Damping",
    "DiscretisationError",
    "Energies",
    "GatheredFields",
    "PairResultants",
    "PhaseCosts",
    "Preloads",
    "Resultant",
    "Resultants",
    "RigidMotion",
    "SectionForces",
    "SolverErrors",
    "SpringForce",
    "SpringForces",
    "StateErrors",
    "UnheldMotion",
]

__getattr__, __dir__ = late_names(__name__)
