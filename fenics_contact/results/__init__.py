"""What states consist of: forces, energies, errors, rigid motions."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fenics_contact._base.costs import Costs, PhaseCosts
from fenics_contact.qp.fixed_point import Damping
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.fields import GatheredFields
from fenics_contact.results.forces import Balance, PairResultants, Resultant, Resultants
from fenics_contact.results.preloads import Preloads, SectionForces
from fenics_contact.results.rigid_motions import RigidMotion, UnheldMotion
from fenics_contact.results.springs import SpringForce, SpringForces
from fenics_contact.results.state import Energies

if TYPE_CHECKING:
    from fenics_contact._accuracy.discretisation import DiscretisationError
    from fenics_contact._accuracy.state_errors import BalancedTolerance, SolverErrors, StateErrors

__all__ = [
    "Balance",
    "BalancedTolerance",
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


def __getattr__(name: str) -> Any:
    """Load what belongs to errors on first use: states with a fixed tolerance do without."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = "discretisation" if name == "DiscretisationError" else "state_errors"
    return getattr(import_module(f"fenics_contact._accuracy.{home}"), name)
