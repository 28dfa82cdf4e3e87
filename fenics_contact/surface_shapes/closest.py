"""Closest points and principal curvatures from a signed distance."""

from __future__ import annotations

import numpy as np

from fenics_contact.surface_shapes.protocol import SurfaceShape, evaluate_shape

#: Largest number of steps onto a surface: one if the distance is exact, a few if it is nearly exact.
STEPS = 8
#: Points this close to the surface, relative to their coordinates, lie on it.
ROUNDING = 16 * float(np.finfo(float).eps)


def closest_points(shape: SurfaceShape, points: np.ndarray) -> np.ndarray:
    """Return the points of a surface that are closest to given ones.

    x − d(x) n(x), repeated if the distance is not exact, until the points lie on the surface or do not come
    closer.

    Args:
        shape: The shape.
        points: Points, shape (n, dim), [length].

    Returns:
        One point of the surface each, shape (n, dim); any of several closest ones.

    Raises:
        InvalidInputError: If the shape returns NaN or arrays of other shapes.
        UserCodeError: If it raises.
    """
    closest = np.array(points, dtype=np.float64)
    before = np.inf
    for _ in range(STEPS):
        distance = evaluate_shape(shape, "distance", closest)
        far = float(np.abs(distance).max(initial=0.0))
        if far <= ROUNDING * np.abs(closest).max(initial=0.0) or far > 0.5 * before:
            break
        closest, before = closest - distance[:, None] * evaluate_shape(shape, "normals", closest), far
    return closest


def principal_curvatures(shape: SurfaceShape, points: np.ndarray) -> np.ndarray:
    """Return the principal curvatures of a surface, positive where its body is convex.

    Args:
        shape: The shape.
        points: Points of the surface, shape (n, dim), [length]; elsewhere the parallel surface through the
            point is meant.

    Returns:
        Shape (n, dim − 1), ascending, [1 / length].

    Raises:
        InvalidInputError: If the shape returns NaN or arrays of other shapes.
        UserCodeError: If it raises.
    """
    tangents = tangent_bases(evaluate_shape(shape, "normals", points))
    bend = evaluate_shape(shape, "curvatures", points)
    return np.asarray(np.linalg.eigvalsh(tangents @ bend @ np.swapaxes(tangents, 1, 2)))


def tangent_bases(normals: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the plane normal to each unit normal, (n, dim) -> (n, dim − 1, dim).

    The reflection that maps ∓e_dim to the normal maps the other axes to it.
    """
    dim = normals.shape[1]
    mirror = normals + np.where(normals[:, -1:] >= 0, 1.0, -1.0) * np.eye(dim)[-1]
    length = np.einsum("nd,nd->n", mirror, mirror)[:, None, None]
    reflection = np.eye(dim) - 2 * mirror[:, :, None] * mirror[:, None, :] / length
    return np.asarray(reflection[:, :-1, :])
