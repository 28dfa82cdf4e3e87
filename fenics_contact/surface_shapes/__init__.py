"""True shapes of surfaces: signed distances with their normals and curvatures."""

from __future__ import annotations

from fenics_contact.surface_shapes.closest import closest_points, principal_curvatures, tangent_bases
from fenics_contact.surface_shapes.extruded import Extruded
from fenics_contact.surface_shapes.joined import Joined
from fenics_contact.surface_shapes.parametric import Parametric
from fenics_contact.surface_shapes.placed import Placed, placed, simplified
from fenics_contact.surface_shapes.plane import Plane
from fenics_contact.surface_shapes.profile import Profile
from fenics_contact.surface_shapes.protocol import SurfaceShape, evaluate_shape
from fenics_contact.surface_shapes.recognised import recognised
from fenics_contact.surface_shapes.revolved import Revolved
from fenics_contact.surface_shapes.round import Circle, Cylinder, Sphere
from fenics_contact.surface_shapes.signed_distance import SignedDistance
from fenics_contact.surface_shapes.spline_patch import SplinePatch
from fenics_contact.surface_shapes.tensor_grid import tensor_grid
from fenics_contact.surface_shapes.torus import Torus

__all__ = [
    "Circle",
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
    "closest_points",
    "evaluate_shape",
    "placed",
    "principal_curvatures",
    "recognised",
    "simplified",
    "tangent_bases",
    "tensor_grid",
]
