"""Material models, written in UFL."""

from fenics_contact.scene.materials.elasticity import Elasticity, strain
from fenics_contact.scene.materials.energy import EnergyModel
from fenics_contact.scene.materials.finite_plasticity import FinitePlasticity
from fenics_contact.scene.materials.history_material import HistoryMaterial, MaterialResponse
from fenics_contact.scene.materials.hyperelasticity import (
    Hyperelasticity,
    deformation_gradient,
    gradient_in_space,
    is_finite_strain,
    is_nonlinear,
)
from fenics_contact.scene.materials.isotropic import IsotropicElasticity
from fenics_contact.scene.materials.j2_plasticity import J2Plasticity
from fenics_contact.scene.materials.nearly_incompressible import (
    NearlyIncompressible,
    cofactor,
    has_mean_dilatation,
    volume_change,
)
from fenics_contact.scene.materials.neo_hooke import NeoHooke
from fenics_contact.scene.materials.orthotropic import (
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    material_axes,
)
from fenics_contact.scene.materials.plane import PlaneStrain, PlaneStress
from fenics_contact.scene.materials.protocol import Material, Thermoelastic, Transverse, can_expand
from fenics_contact.scene.materials.rubber import MooneyRivlin, Ogden
from fenics_contact.scene.materials.st_venant_kirchhoff import StVenantKirchhoff

__all__ = [
    "Elasticity",
    "EnergyModel",
    "FinitePlasticity",
    "HistoryMaterial",
    "Hyperelasticity",
    "IsotropicElasticity",
    "J2Plasticity",
    "Material",
    "MaterialResponse",
    "MooneyRivlin",
    "NearlyIncompressible",
    "NeoHooke",
    "Ogden",
    "OrthotropicElasticity",
    "OrthotropicPlaneStress",
    "PlaneStrain",
    "PlaneStress",
    "StVenantKirchhoff",
    "Thermoelastic",
    "Transverse",
    "can_expand",
    "cofactor",
    "deformation_gradient",
    "gradient_in_space",
    "has_mean_dilatation",
    "is_finite_strain",
    "is_nonlinear",
    "material_axes",
    "strain",
    "volume_change",
]
