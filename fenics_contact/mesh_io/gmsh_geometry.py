"""A face or curve of gmsh's geometry as a shape that is independent of gmsh."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np

from fenics_contact.surface_shapes import SplinePatch, SurfaceShape, recognised, tensor_grid

#: Smallest and largest number of points along each parameter, doubled until the spline through them is this
#: close to the face, relative to its extent.
FEWEST, MOST, CLOSE = 33, 129, 1e-9
#: Tangents whose cross product is below this fraction of the largest define no normal.
POLE = 1e-6


def shape_of_entity(
    gmsh: ModuleType, entity: tuple[int, int], middles: np.ndarray, outwards: np.ndarray
) -> SurfaceShape | None:
    """Return the shape of a face, in the plane of a curve, of gmsh's current model.

    Args:
        gmsh: The module, initialised.
        entity: Dimension and tag.
        middles: Points on or close to it, (n, 3 | 2), [length].
        outwards: Directions out of the body there, (n, 3 | 2).

    Returns:
        A plane, sphere, cylinder, cone or torus if it is one, else a spline through its points; None if the
        model has only a mesh and no geometry.
    """
    if gmsh.model.getType(*entity).startswith("Discrete"):
        return None
    points, normals = _normals(gmsh, entity)
    for shape in (recognised(points, sign * normals) for sign in (1.0, -1.0)):
        if shape is not None and _leads_out(shape, middles, outwards):
            return shape
    grid = _grid(gmsh, entity)
    shape = SplinePatch(grid, _periodic(grid))
    return shape if _leads_out(shape, middles, outwards) else replace(shape, flipped=True)


def shape_seen(gmsh: ModuleType, entity: tuple[int, int]) -> SurfaceShape | None:
    """Return the plane, sphere, cylinder, cone or torus that a face is, facing either side; else None."""
    return recognised(*_normals(gmsh, entity))


def _leads_out(shape: SurfaceShape, middles: np.ndarray, outwards: np.ndarray) -> bool:
    return bool(np.einsum("nd,nd->", shape.normals(middles), outwards) > 0)


def _normals(gmsh: ModuleType, entity: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return points of an entity and the normals there, to either side, where these exist."""
    parameters = _parameters(gmsh, entity, FEWEST)
    points = _values(gmsh, entity, parameters)
    slopes = np.reshape(gmsh.model.getDerivative(*entity, parameters.ravel()), (len(points), -1, 3))
    first = slopes[:, 0]
    across = np.column_stack([first[:, 1], -first[:, 0]]) if entity[0] == 1 else np.cross(first, slopes[:, 1])
    length = np.linalg.norm(across, axis=1)
    sound = length > POLE * length.max()
    return points[sound], across[sound] / length[sound, None]


def _grid(gmsh: ModuleType, entity: tuple[int, int]) -> np.ndarray:
    """Return a grid of points, (n, n, 3) or (n, 2), such that a spline through every second is accurate."""
    count = FEWEST
    while True:
        count = 2 * count - 1
        fine = _values(gmsh, entity, _parameters(gmsh, entity, count))
        grid = fine.reshape(*[count] * entity[0], entity[0] + 1)
        coarse = SplinePatch(grid[(slice(None, None, 2),) * entity[0]], _periodic(grid))
        off = np.abs(coarse.at(_counts(count, entity[0]) / 2) - fine).max()
        if off <= CLOSE * np.ptp(fine, axis=0).max() or count >= MOST:
            return grid


def _counts(count: int, directions: int) -> np.ndarray:
    return tensor_grid([np.arange(float(count))] * directions)


def _parameters(gmsh: ModuleType, entity: tuple[int, int], count: int) -> np.ndarray:
    """Return a grid of parameters, (countᵏ, k)."""
    low, high = map(np.asarray, gmsh.model.getParametrizationBounds(*entity))
    return np.asarray(low + (high - low) * _counts(count, entity[0]) / (count - 1))


def _values(gmsh: ModuleType, entity: tuple[int, int], parameters: np.ndarray) -> np.ndarray:
    points = np.reshape(gmsh.model.getValue(*entity, parameters.ravel()), (-1, 3))
    return np.asarray(points[:, : entity[0] + 1])


def _periodic(grid: np.ndarray) -> tuple[bool, ...]:
    """Return in which directions a grid is smoothly periodic: bent there no more than elsewhere."""
    periodic = []
    for axis in range(grid.ndim - 1):
        steps = np.diff(np.moveaxis(grid, axis, 0), axis=0)
        closed = np.abs(steps.sum(axis=0)).max() <= 1e-6 * np.abs(steps).max()
        bend = np.linalg.norm(np.diff(steps, axis=0), axis=-1).max()
        periodic.append(bool(closed and np.linalg.norm(steps[0] - steps[-1], axis=-1).max() <= 2 * bend))
    return tuple(periodic)
