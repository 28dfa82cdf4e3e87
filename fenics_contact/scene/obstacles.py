"""Rigid obstacles: bodies that do not move, given by the shapes of their surfaces."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from fenics_contact.surface_shapes import Cylinder, Plane, SignedDistance, Sphere, SurfaceShape


@runtime_checkable
class RigidObstacle(SurfaceShape, Protocol):
    """A body that does not move: any of `fenics_contact.surface_shapes`, or a class with its members."""


class RigidPlane(Plane):
    """A half space that does not move, in the plane a half plane; arguments as for `Plane`."""


class RigidSphere(Sphere):
    """A ball that does not move, in the plane a disc; or everything outside it; arguments as for `Sphere`."""


class RigidCylinder(Cylinder):
    """An endless round bar that does not move; or everything outside it; arguments as for `Cylinder`."""


class DistanceObstacle(SignedDistance):
    """A body that does not move, given by a distance function; arguments as for `SignedDistance`."""
