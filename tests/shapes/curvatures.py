"""Curvatures of shapes."""

from __future__ import annotations

import numpy as np

from fenics_contact.shapes.simple import SurfaceShape, evaluate_shape, tangent_bases


def principal_curvatures(shape: SurfaceShape, points: np.ndarray) -> np.ndarray:
    """Return the principal curvatures, positive where the body is convex, ascending, (n, dim - 1)."""
    tangents = tangent_bases(evaluate_shape(shape, "normals", points))
    bend = evaluate_shape(shape, "curvatures", points)
    return np.asarray(np.linalg.eigvalsh(tangents @ bend @ np.swapaxes(tangents, 1, 2)))
