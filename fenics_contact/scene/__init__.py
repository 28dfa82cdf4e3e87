"""Scenes: bodies, materials, supports, loads and contact pairs."""

from fenics_contact.scene.approach import master_share
from fenics_contact.scene.automatic import Automatic
from fenics_contact.scene.bodies import bodies_from
from fenics_contact.scene.body import Body
from fenics_contact.scene.chosen_discretisation import keeping_discretisation
from fenics_contact.scene.effects import Effect, EffectName
from fenics_contact.scene.field_files import read_field
from fenics_contact.scene.held import RANK_TOLERANCE, held_components, point_loads, resisted_motions
from fenics_contact.scene.kernels import rigid_body_modes
from fenics_contact.scene.loads import (
    BodyForce,
    Load,
    Pressure,
    SurfaceLoad,
    ThermalStrain,
    TotalForce,
    Traction,
    VolumeLoad,
    gravity,
)
from fenics_contact.scene.materials import (
    Elasticity,
    EnergyModel,
    FinitePlasticity,
    HistoryMaterial,
    Hyperelasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MaterialResponse,
    MooneyRivlin,
    NearlyIncompressible,
    NeoHooke,
    Ogden,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    StVenantKirchhoff,
    Thermoelastic,
    Transverse,
    can_expand,
    cofactor,
    deformation_gradient,
    gradient_in_space,
    has_mean_dilatation,
    is_finite_strain,
    is_nonlinear,
    material_axes,
    strain,
    volume_change,
)
from fenics_contact.scene.mirrors import mirrored
from fenics_contact.scene.obstacles import (
    DistanceObstacle,
    MovingObstacle,
    RigidCylinder,
    RigidObstacle,
    RigidPlane,
    RigidSphere,
)
from fenics_contact.scene.pair_geometry import PairGeometry
from fenics_contact.scene.pairs import ContactPair, Coulomb, Discretisation, Friction, Surface, Tie, Tresca
from fenics_contact.scene.plan import ConeKind, Plan, SolverKind, choose_solver
from fenics_contact.scene.rigid_surfaces import AnySupport, RigidSurface
from fenics_contact.scene.sampled import Sampled
from fenics_contact.scene.scene import Scene
from fenics_contact.scene.steps import LoadStep
from fenics_contact.scene.supports import Support
from fenics_contact.scene.true_surfaces import surface_of
from fenics_contact.scene.unpaired import bodies_near, outline_of, unpaired
from fenics_contact.scene.values import OfPosition, ScalarValue, Ufl, VectorValue, evaluate, gradients_of

__all__ = [
    "RANK_TOLERANCE",
    "AnySupport",
    "Automatic",
    "Body",
    "BodyForce",
    "ConeKind",
    "ContactPair",
    "Coulomb",
    "Discretisation",
    "DistanceObstacle",
    "Effect",
    "EffectName",
    "Elasticity",
    "EnergyModel",
    "FinitePlasticity",
    "Friction",
    "HistoryMaterial",
    "Hyperelasticity",
    "IsotropicElasticity",
    "J2Plasticity",
    "Load",
    "LoadStep",
    "Material",
    "MaterialResponse",
    "MooneyRivlin",
    "MovingObstacle",
    "NearlyIncompressible",
    "NeoHooke",
    "OfPosition",
    "Ogden",
    "OrthotropicElasticity",
    "OrthotropicPlaneStress",
    "PairGeometry",
    "Plan",
    "PlaneStrain",
    "PlaneStress",
    "Pressure",
    "RigidCylinder",
    "RigidObstacle",
    "RigidPlane",
    "RigidSphere",
    "RigidSurface",
    "Sampled",
    "ScalarValue",
    "Scene",
    "SolverKind",
    "StVenantKirchhoff",
    "Support",
    "Surface",
    "SurfaceLoad",
    "ThermalStrain",
    "Thermoelastic",
    "Tie",
    "TotalForce",
    "Traction",
    "Transverse",
    "Tresca",
    "Ufl",
    "VectorValue",
    "VolumeLoad",
    "bodies_from",
    "bodies_near",
    "can_expand",
    "choose_solver",
    "cofactor",
    "deformation_gradient",
    "evaluate",
    "gradient_in_space",
    "gradients_of",
    "gravity",
    "has_mean_dilatation",
    "held_components",
    "is_finite_strain",
    "is_nonlinear",
    "keeping_discretisation",
    "master_share",
    "material_axes",
    "mirrored",
    "outline_of",
    "point_loads",
    "read_field",
    "resisted_motions",
    "rigid_body_modes",
    "strain",
    "surface_of",
    "unpaired",
    "volume_change",
]
