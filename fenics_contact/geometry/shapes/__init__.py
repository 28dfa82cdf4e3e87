"""True shapes of surfaces: signed distances with their normals and curvatures."""

from __future__ import annotations

from fenics_contact.geometry.shapes.closest import closest_points, principal_curvatures
from fenics_contact.geometry.shapes.extruded import Extruded
from fenics_contact.geometry.shapes.joined import Joined
from fenics_contact.geometry.shapes.parametric import Parametric
from fenics_contact.geometry.shapes.placed import Placed, placed
from fenics_contact.geometry.shapes.plane import Plane
from fenics_contact.geometry.shapes.profile import Profile
from fenics_contact.geometry.shapes.protocol import SurfaceShape, asked
from fenics_contact.geometry.shapes.recognised import recognised
from fenics_contact.geometry.shapes.revolved import Revolved
from fenics_contact.geometry.shapes.round import Cylinder, Sphere
from fenics_contact.geometry.shapes.signed_distance import SignedDistance
from fenics_contact.geometry.shapes.spline_patch import SplinePatch
from fenics_contact.geometry.shapes.torus import Torus

__all__ = [
    "Cylinder",
    "Extruded",
    "Joined",
    "Parametric",
    "Placed",
    "Plane",
    "Profile",
    "Revolved",
    "SignedDistance",
    "Sphere",
    "SplinePatch",
    "SurfaceShape",
    "Torus",
    "asked",
    "closest_points",
    "placed",
    "principal_curvatures",
    "recognised",
]
