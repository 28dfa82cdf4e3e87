"""Total FETI: torn systems, contact rows, the dual problem and its operators."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.feti.decomposition import Rows, decompose
    from fenics_contact.feti.dual import DualSystem
    from fenics_contact.feti.torn import TornSystem, build_torn_system

__all__ = [
    "DualSystem",
    "Rows",
    "TornSystem",
    "build_torn_system",
    "decompose",
]

__getattr__, __dir__ = late_names(__name__)
