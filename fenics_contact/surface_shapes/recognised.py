"""Recognition of planes, spheres, cylinders, cones and tori from points and normals."""

from __future__ import annotations

import numpy as np

from fenics_contact.checks import floats
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.plane import Plane
from fenics_contact.surface_shapes.protocol import SurfaceShape
from fenics_contact.surface_shapes.revolved import Revolved
from fenics_contact.surface_shapes.round import Circle, Cylinder, Sphere
from fenics_contact.surface_shapes.torus import Torus

#: Largest distance of points from their shape, relative to their extent.
CLOSE = 1e-9


def recognised(points: np.ndarray, normals: np.ndarray) -> SurfaceShape | None:
    """Return the plane, sphere, cylinder, cone or torus on which points lie; in the plane the line or circle.

    Args:
        points: Points of the surface, (n, 3 | 2), many more than a shape has parameters, [length].
        normals: Their unit normals out of the body, (n, 3 | 2).

    Returns:
        The shape, or None if points lie off all of them by more than a billionth of their extent.
    """
    size = float(np.ptp(points, axis=0).max())
    for fit in (_plane, _sphere, _about_an_axis):
        try:
            shape = fit(points, normals)
        except (InvalidInputError, np.linalg.LinAlgError):  # invalid radius or direction: another shape
            continue
        if shape is not None and np.abs(shape.distance(points)).max() <= CLOSE * size:
            return shape
    return None


def _plane(points: np.ndarray, normals: np.ndarray) -> SurfaceShape:
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][-1]
    return Plane(floats(middle), floats(normal * np.sign((normals @ normal).sum())))


def _sphere(points: np.ndarray, normals: np.ndarray) -> SurfaceShape:
    """‖x − c‖² = r² is linear in c and r² − ‖c‖²."""
    middle = points.mean(axis=0)
    off = points - middle
    linear = np.column_stack([2 * off, np.ones(len(off))])
    centre, rest = np.split(np.linalg.lstsq(linear, np.einsum("nd,nd->n", off, off), rcond=None)[0], [-1])
    radius = float(np.sqrt(max(rest[0] + centre @ centre, 0.0)))
    hollow = bool(np.einsum("nd,nd->n", off - centre, normals).sum() < 0)
    kind = Circle if len(centre) == 2 else Sphere
    return kind(floats(middle + centre), radius, hollow)


def _about_an_axis(points: np.ndarray, normals: np.ndarray) -> SurfaceShape | None:
    """All normals of a surface of revolution meet its axis."""
    if points.shape[1] == 2:
        return None
    point, axis = _axis(points, normals)
    arm, out = points - point, normals - (normals @ axis)[:, None] * axis
    along = arm @ axis
    arm = arm - along[:, None] * axis
    radius = np.linalg.norm(arm, axis=1)
    outward = np.einsum("nd,nd->n", arm, out) / np.maximum(radius, np.finfo(float).tiny)
    flat = np.column_stack([radius, along]), np.column_stack([outward, normals @ axis])
    profile = recognised(*flat)
    place, direction = floats(point), floats(axis)
    if isinstance(profile, Sphere):
        ring, height = profile.centre
        centre = floats(point + height * axis)
        if ring > profile.radius:
            return Torus(centre, direction, ring, profile.radius, profile.hollow)
    if isinstance(profile, Plane) and abs(profile.normal[1]) < CLOSE:
        return Cylinder(place, direction, float(radius.mean()), profile.normal[0] < 0)
    return None if profile is None else Revolved(profile, place, direction)


def _axis(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a point and the direction of the line that all normals meet, in the sense of least squares.

    A line through x along n meets the one through c along a where (x × n)·a + n·(c × a) = 0.
    """
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    off = (points - middle) / size
    *_, flattest = np.linalg.svd(normals, full_matrices=False)[2]
    if np.abs(normals @ flattest).max() < CLOSE:  # a prism: its circular cross-section has a centre
        across = np.linalg.svd(flattest[None])[2][1:]
        circle = _sphere(off @ across.T, normals @ across.T)
        assert isinstance(circle, Sphere)
        return middle + size * np.asarray(circle.centre) @ across, flattest
    line = np.linalg.svd(np.hstack([np.cross(off, normals), normals]), full_matrices=False)[2][-1]
    direction, moment = line[:3], line[3:]
    length = float(np.linalg.norm(direction))
    if length < 1e-6:
        raise InvalidInputError("the normals meet no axis")
    return middle + size * np.cross(direction, moment) / length**2, direction / length
