"""Contact in the current configuration: closest points, their derivatives and slip as surfaces slide far."""

from fenics_contact.pairing.sliding.contact import SlidingContact
from fenics_contact.pairing.sliding.points import SlidingPoints
from fenics_contact.pairing.sliding.slip import MaterialPoints
from fenics_contact.pairing.sliding.stiffness import GeometricStiffness, LowRank

__all__ = ["GeometricStiffness", "LowRank", "MaterialPoints", "SlidingContact", "SlidingPoints"]
