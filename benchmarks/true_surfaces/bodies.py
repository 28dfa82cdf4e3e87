"""Bodies of the study: stamps with equal facets, and what they are pressed on."""

from __future__ import annotations

import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.gallery import box_lattice, half_cylinder, half_disc, hemisphere, rectangle_lattice
from fenics_contact.gallery.blocks import graded
from fenics_contact.shapes import Sphere


def stamp(dim: int, facets: int) -> BodyMesh:
    """Mesh a half disc or ball of radius one, with that many equal facets around a quarter of a circle."""
    return (half_disc if dim == 2 else hemisphere)(1.0, facets // 2, grading=0.0)


def pad(dim: int, size: float, cells: int, grading: float) -> BodyMesh:
    """Mesh the part x ≥ 0 (and y ≥ 0) of a block below the origin, whose cells shrink towards it."""
    ticks = size * graded(cells, grading)
    lattice = rectangle_lattice if dim == 2 else box_lattice
    return lattice([ticks] * (dim - 1) + [-ticks[::-1]])


def bar(cells: int, grading: float) -> BodyMesh:
    """Mesh a quarter of a half cylinder of radius and length one whose cells shrink towards the origin."""
    even = half_cylinder(1.0, 1.0, cells, cells, grading=grading)
    points = even.points.copy()
    points[:, 1] = np.expm1(grading * points[:, 1]) / np.expm1(grading)
    return even.moved(points).with_shapes(even.shapes)


def ring(radii: np.ndarray, facets: int) -> BodyMesh:
    """Mesh the half x ≥ 0 of a ring about the origin, with that many facets around each of its quarters.

    The surfaces "inner" and "outer" are the whole half circles, "x0" is the plane of symmetry.
    """
    flat = rectangle_lattice([radii, np.linspace(-np.pi / 2, np.pi / 2, 2 * facets + 1)])
    radius, angle = flat.points.T
    points = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    points[np.isclose(np.abs(angle), np.pi / 2), 0] = 0.0
    sides = flat.surfaces
    surfaces = {"inner": sides["x0"], "outer": sides["x1"], "x0": np.vstack([sides["y0"], sides["y1"]])}
    middle = (0.0, 0.0)
    shapes = {"inner": Sphere(middle, radii[0], hollow=True), "outer": Sphere(middle, radii[-1])}
    return BodyMesh(points, flat.cells, surfaces, shapes=shapes)


def seat(radii: np.ndarray, cells: int) -> BodyMesh:
    """Mesh a quarter of a spherical socket, up to 45 degrees in x and y from its lowest point, the origin.

    The surface "contact" is the inner sphere, "base" the outer one, "x0" and "y0" are planes of symmetry.
    """
    angle = np.linspace(0.0, np.pi / 4, cells + 1)
    box = box_lattice([angle, angle, -radii[::-1]])
    rays = np.column_stack([np.tan(box.points[:, :2]), -np.ones(box.n_nodes)])
    points = -box.points[:, 2:] * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    lift = np.array([0.0, 0.0, radii[0]])
    names = {"contact": "z1", "base": "z0", "x0": "x0", "y0": "y0"}
    surfaces = {name: box.surfaces[side] for name, side in names.items()}
    shapes = {"contact": Sphere(tuple(lift), radii[0], hollow=True)}
    return BodyMesh(points + lift, box.cells, surfaces, shapes=shapes)
