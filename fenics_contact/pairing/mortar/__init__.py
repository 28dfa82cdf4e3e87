"""Mortar coupling: surfaces with non-matching meshes, coupled in weighted means by dual multipliers."""

from fenics_contact.pairing.mortar.coupling import MortarCoupling, mortar_coupling
from fenics_contact.pairing.mortar.coupling_derivative import mortar_pulled_back
from fenics_contact.pairing.mortar.gathering import Gathering
from fenics_contact.pairing.mortar.relief_derivative import SurfaceDerivatives
from fenics_contact.pairing.mortar.weight_derivative import WeightDerivatives, weight_derivatives

__all__ = [
    "Gathering",
    "MortarCoupling",
    "SurfaceDerivatives",
    "WeightDerivatives",
    "mortar_coupling",
    "mortar_pulled_back",
    "weight_derivatives",
]
