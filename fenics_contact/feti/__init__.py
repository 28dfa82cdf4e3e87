"""Total FETI: torn systems, contact rows, the dual problem and its operators."""

from fenics_contact.feti.contact_points import ContactPoints
from fenics_contact.feti.decomposition import Decomposition, decompose
from fenics_contact.feti.direct import DirectSolution, DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.feti.nodal_mean import nodal_mean
from fenics_contact.feti.torn import TornSystem, build_torn_system

__all__ = [
    "ContactPoints",
    "Decomposition",
    "DirectSolution",
    "DirectSystem",
    "DualSystem",
    "LocalKind",
    "TornSystem",
    "build_torn_system",
    "decompose",
    "nodal_mean",
]
