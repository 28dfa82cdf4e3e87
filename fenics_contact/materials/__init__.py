"""Material models, written in UFL."""

from typing import TYPE_CHECKING

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.materials.anisotropic import AnisotropicElasticity
    from fenics_contact.materials.elastic import (
        Elasticity,
        IsotropicElasticity,
        Material,
        PlaneStrain,
        PlaneStress,
        Thermoelastic,
        Transverse,
        strain,
    )
    from fenics_contact.materials.foam import Hyperfoam
    from fenics_contact.materials.hyperelastic import (
        EnergyModel,
        Hyperelasticity,
        MooneyRivlin,
        NearlyIncompressible,
        NeoHooke,
        Ogden,
        StVenantKirchhoff,
    )
    from fenics_contact.materials.kernels import rigid_body_modes
    from fenics_contact.materials.neo_hookean_metal import NeoHookeanPlasticity
    from fenics_contact.materials.orthotropic import (
        OrthotropicElasticity,
        OrthotropicPlaneStress,
        material_axes,
    )
    from fenics_contact.materials.plane_stress import HistoryPlaneStress, HyperelasticPlaneStress
    from fenics_contact.materials.plastic import (
        FinitePlasticity,
        HistoryMaterial,
        J2Plasticity,
        MaterialResponse,
    )
    from fenics_contact.materials.ramberg_osgood import RambergOsgood
    from fenics_contact.materials.temperature_dependent import TemperatureDependentElasticity

__all__ = [
    "AnisotropicElasticity",
    "Elasticity",
    "EnergyModel",
    "FinitePlasticity",
    "HistoryMaterial",
    "HistoryPlaneStress",
    "HyperelasticPlaneStress",
    "Hyperelasticity",
    "Hyperfoam",
    "IsotropicElasticity",
    "J2Plasticity",
    "Material",
    "MaterialResponse",
    "MooneyRivlin",
    "NearlyIncompressible",
    "NeoHooke",
    "NeoHookeanPlasticity",
    "Ogden",
    "OrthotropicElasticity",
    "OrthotropicPlaneStress",
    "PlaneStrain",
    "PlaneStress",
    "RambergOsgood",
    "StVenantKirchhoff",
    "TemperatureDependentElasticity",
    "Thermoelastic",
    "Transverse",
    "material_axes",
    "rigid_body_modes",
    "strain",
]

__getattr__, __dir__ = late_names(__name__)
