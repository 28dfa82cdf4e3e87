"""How accurate a state is: estimates of its errors, in energy norm."""

from fenics_contact.accuracy.discretisation import DiscretisationError, discretisation_error

__all__ = ["DiscretisationError", "discretisation_error"]
