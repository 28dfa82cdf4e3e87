"""A block with friction on a floor, and what a conic solver finds for a load step of it."""

from __future__ import annotations

import numpy as np

from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, Scene, Surface, Tresca
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.equilibrium.conic_reference import ConicReference

FRICTION = 0.3
FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def sheared_block(law: Coulomb | Tresca) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 3))
    pair = ContactPair(Surface("block", "z0"), FLOOR, law)
    return Scene({"block": Body(mesh, IsotropicElasticity(1000.0, 0.3))}, contacts=[pair])


def coulomb_reference(
    scene: Scene, before: np.ndarray | None, friction: float = FRICTION
) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and contact forces of one step: a fixed point of conic programs."""
    reference = ConicReference(scene)
    normal = np.full(len(reference.rows.gap), 0.5)
    for _ in range(60):
        found = reference.solve(friction * normal, before)
        change = np.abs(found.normal_force - normal).max() / found.normal_force.max()
        normal = found.normal_force
        if change < 1e-9:
            break
    assert change < 1e-7
    return found.displacement, found.contact_force
