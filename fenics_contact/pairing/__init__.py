"""Contact search: slave nodes and their counterparts on the master, nodal or mortar."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fenics_contact.pairing.contact_points import HELD, ContactPoints, join_points, movable, reference_axes
from fenics_contact.pairing.contact_search import find_contact_points, find_tied_points
from fenics_contact.pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact.pairing.friction import friction_data
from fenics_contact.pairing.mortar_points import MortarPoints
from fenics_contact.pairing.node_numbers import NodeNumbers
from fenics_contact.pairing.shared_nodes import shared_once, tied_once, without_tied
from fenics_contact.pairing.sliding_contact import sliding_contact

if TYPE_CHECKING:
    from fenics_contact.pairing.sliding import GeometricStiffness as GeometricStiffness
    from fenics_contact.pairing.sliding import LowRank as LowRank
    from fenics_contact.pairing.sliding import MaterialPoints as MaterialPoints
    from fenics_contact.pairing.sliding import SlidingContact as SlidingContact
    from fenics_contact.pairing.sliding import SlidingPoints as SlidingPoints

__all__ = [
    "HELD",
    "ContactPoints",
    "CouplingDerivatives",
    "MortarPoints",
    "NodeNumbers",
    "find_contact_points",
    "find_tied_points",
    "friction_data",
    "join_points",
    "movable",
    "reference_axes",
    "shared_once",
    "sliding_contact",
    "tied_once",
    "without_tied",
]
