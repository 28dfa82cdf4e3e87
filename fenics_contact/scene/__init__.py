"""Scenes: bodies, materials, supports, loads and contact pairs."""

from fenics_contact.scene.effects import Effect, EffectName
from fenics_contact.scene.loads import BodyForce, Load, Support, TotalForce, Traction
from fenics_contact.scene.materials import IsotropicElasticity, Material, rigid_body_modes
from fenics_contact.scene.obstacles import (
    DistanceObstacle,
    RigidCylinder,
    RigidObstacle,
    RigidPlane,
    RigidSphere,
)
from fenics_contact.scene.pairs import ContactPair, Coulomb, Discretisation, Friction, Surface, Tie, Tresca
from fenics_contact.scene.plan import ConeKind, Plan, SolverKind, choose_solver
from fenics_contact.scene.scene import Body, Scene
from fenics_contact.scene.steps import LoadStep

__all__ = [
    "Body",
    "BodyForce",
    "ConeKind",
    "ContactPair",
    "Coulomb",
    "Discretisation",
    "DistanceObstacle",
    "Effect",
    "EffectName",
    "Friction",
    "IsotropicElasticity",
    "Load",
    "LoadStep",
    "Material",
    "Plan",
    "RigidCylinder",
    "RigidObstacle",
    "RigidPlane",
    "RigidSphere",
    "Scene",
    "SolverKind",
    "Support",
    "Surface",
    "Tie",
    "TotalForce",
    "Traction",
    "Tresca",
    "choose_solver",
    "rigid_body_modes",
]
