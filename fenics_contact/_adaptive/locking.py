"""Bodies whose cells lock, so that no refinement pays."""

from __future__ import annotations

from fenics_contact._scene.body import Body
from fenics_contact._scene.scene import Scene
from fenics_contact.materials.elastic import PlaneStress, isotropic_constants
from fenics_contact.materials.hyperelastic import has_mean_dilatation


def locking_in_words(scene: Scene) -> str:
    """Return which bodies lock, and what helps; empty where none does."""
    locked = [name for name, body in scene.deforming.items() if locks(body)]
    if not locked:
        return ""
    return (
        f"linear cells of {' and '.join(locked)} lock, as the bulk modulus is more than 100 times the shear "
        "modulus: take quadratic cells (fenics_contact.mesh.quadratic), or quadrilaterals and hexahedra of a "
        "rubber with mean_dilatation=True"
    )


def locks(body: Body, most: float = 100.0) -> bool:
    """Return whether linear cells of a body keep their volume at each point, so that they hardly deform.

    Plates in plane stress do not, as they become thicker; materials without Poisson's ratio count as ones
    that do not. `most`: ratio of bulk and shear modulus above which they do, ν = 0.495.
    """
    if body.mesh.order > 1:
        return False
    keeping = [each for each in body.materials if not isinstance(each, PlaneStress)]
    constants = [isotropic_constants(each) for each in keeping if not has_mean_dilatation(each)]
    return any(2.0 * (1.0 + known[1]) > most * 3.0 * (1.0 - 2.0 * known[1]) for known in constants if known)
