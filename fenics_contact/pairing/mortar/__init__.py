"""Mortar coupling: surfaces whose meshes do not match, joined in weighted means by dual multipliers."""

from fenics_contact.pairing.mortar.coupling import MortarCoupling, mortar_coupling

__all__ = ["MortarCoupling", "mortar_coupling"]
