"""Mortar coupling: surfaces with non-matching meshes, coupled in weighted means by dual multipliers."""

from fenics_contact.pairing.mortar.coupling import MortarCoupling, mortar_coupling

__all__ = ["MortarCoupling", "mortar_coupling"]
