"""True shapes of surfaces: signed distances with their normals and curvatures."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.shapes.parametric import Parametric, SplinePatch
    from fenics_contact.shapes.profile import Profile
    from fenics_contact.shapes.rounded import Box, Cone
    from fenics_contact.shapes.simple import (
        Circle,
        Cylinder,
        Extruded,
        Plane,
        Revolved,
        SignedDistance,
        Sphere,
        SurfaceShape,
        Torus,
    )
    from fenics_contact.shapes.triangulation import Triangulation

__all__ = [
    "Box",
    "Circle",
    "Cone",
    "Cylinder",
    "Extruded",
    "Parametric",
    "Plane",
    "Profile",
    "Revolved",
    "SignedDistance",
    "Sphere",
    "SplinePatch",
    "SurfaceShape",
    "Torus",
    "Triangulation",
]

__getattr__, __dir__ = late_names(__name__)
