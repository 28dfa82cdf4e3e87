"""x."""
from fenics_contact.optimize.constraints import Bounds, LinearConstraints, nearest_feasible
