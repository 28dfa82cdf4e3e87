"""How the points of rigid surfaces move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact.unheld import ROUNDING
from fenics_contact.display import displayed
from fenics_contact.scene import RigidSurface, Scene, Surface


@displayed
@dataclass(frozen=True, eq=False)
class RigidMotion:
    """The motion of a rigid surface: u = U + θ × (x − p), of bodies that deform much U + (R(θ) − I)(x − p).

    Attributes:
        surface: The surface.
        about: The point p of its `RigidSurface`, shape (dim,), [length].
        displacement: U, shape (dim,), [length].
        rotation: θ, shape (3,) in space; one number in the plane, positive from x to y; in radians.
    """

    surface: Surface
    about: np.ndarray
    displacement: np.ndarray
    rotation: np.ndarray | float

    def __str__(self) -> str:
        """Return it in words; what is only rounding beside other components is zero."""
        words = []
        for values in map(np.atleast_1d, (self.displacement, self.rotation, self.about)):
            known = np.where(np.abs(values) > ROUNDING * np.abs(values).max(), values, 0.0)
            words.append(f"({', '.join(f'{number:.5g}' for number in known)})")
        moved, turned, about = words
        return (
            f"{self.surface.body} {self.surface.name}: displacement {moved} [length] of {about}, "
            f"rotation {turned} rad"
        )


def rigid_motion(scene: Scene, support: RigidSurface, displacement: np.ndarray) -> RigidMotion:
    """Return the motion of a rigid surface.

    Args:
        scene: The scene.
        support: The surface.
        displacement: Displacement of the nodes of its body, shape (n_nodes, dim), [length].
    """
    body, where = scene.bodies[support.body], Surface(support.body, support.surface)
    if body.deforms_much:  # all of it is prescribed
        moved, turned = np.split(support.prescribed, [scene.dim])
        return RigidMotion(where, np.array(support.at), moved, float(turned[0]) if scene.dim == 2 else turned)
    mesh = body.mesh
    nodes = np.unique(mesh.surfaces[support.surface])
    modes = support.modes(mesh.points[nodes]).reshape(-1, len(support.motion))
    size = np.linalg.norm(modes, axis=0)
    motion = np.linalg.lstsq(modes / size, displacement[nodes].ravel(), rcond=None)[0] / size
    moved, turned = np.split(motion, [scene.dim])
    return RigidMotion(where, np.array(support.at), moved, float(turned[0]) if scene.dim == 2 else turned)
