"""The surfaces of a scene as contact sees them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fenics_contact.scene.mirrors import mirrored
from fenics_contact.scene.pairs import Surface
from fenics_contact.surfaces import FacetedSurface, Geometry, true_surface

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts


def surface_of(
    scene: SceneParts, surface: Surface, geometry: Geometry, *, finer: bool = False
) -> FacetedSurface:
    """Return a named surface; its normals lie in the planes of symmetry that cut it.

    Args:
        scene: The scene.
        surface: The surface.
        geometry: How it is represented between its nodes, see `ContactPair`.
        finer: Use a better representation than that if there is one, see `true_surface`.
    """
    mesh = scene.bodies[surface.body].mesh
    return true_surface(mesh, surface.name, geometry, mirrored=mirrored(scene, surface.body), finer=finer)
