"""Scenes: bodies, materials, supports, loads and contact pairs."""

from fenics_contact.scene.loads import BodyForce, Load, Support, TotalForce, Traction
from fenics_contact.scene.materials import IsotropicElasticity, Material, rigid_body_modes
from fenics_contact.scene.obstacles import (
    DistanceObstacle,
    RigidCylinder,
    RigidObstacle,
    RigidPlane,
    RigidSphere,
)
from fenics_contact.scene.pairs import ContactPair, Coulomb, Surface, Tie, Tresca
from fenics_contact.scene.scene import Body, Effect, Scene
from fenics_contact.scene.steps import LoadStep

__all__ = [
    "Body",
    "BodyForce",
    "ContactPair",
    "Coulomb",
    "DistanceObstacle",
    "Effect",
    "IsotropicElasticity",
    "Load",
    "LoadStep",
    "Material",
    "RigidCylinder",
    "RigidObstacle",
    "RigidPlane",
    "RigidSphere",
    "Scene",
    "Support",
    "Surface",
    "Tie",
    "TotalForce",
    "Traction",
    "Tresca",
    "rigid_body_modes",
]
