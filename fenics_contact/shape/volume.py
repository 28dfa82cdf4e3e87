"""Volume of a body as a function of its nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.mesh import BodyMesh, boundary_faces, vector_areas
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import Scene
from fenics_contact.surfaces import shape_functions


def volume_of(scene: Scene, names: Sequence[str], numbers: NodeNumbers) -> tuple[float, np.ndarray]:
    """Return the volume of some bodies and its derivative by the nodes of all, (n_nodes, dim).

    Args:
        scene: The scene.
        names: Names of the bodies.
        numbers: Numbers of the nodes of all bodies.
    """
    total, by_points = 0.0, np.zeros((numbers.n_nodes, scene.dim))
    for name in names:
        mesh = scene.bodies[name].mesh
        total += mesh.volume
        by_points[numbers.global_nodes(name, np.arange(mesh.n_nodes))] = volume_by_points(mesh)
    return total, by_points


def volume_by_points(mesh: BodyMesh) -> np.ndarray:
    """Return the derivative of the volume by every node, shape (n_nodes, 3), [length²]; in 2D of the area.

    Moving the boundary by v changes the volume by ∫ v·n dA, so that only boundary nodes count; two Gauss
    points per direction integrate this exactly on bilinear faces.
    """
    faces, _ = boundary_faces(mesh.cells, mesh.dim)
    corners, result = mesh.points[faces], np.zeros_like(mesh.points)
    if mesh.dim == 2:
        np.add.at(result, faces, 0.5 * vector_areas(mesh.points, faces)[:, None])
        return result
    positions: np.ndarray
    if faces.shape[1] == 4:
        grid = np.array([-1.0, 1.0]) / np.sqrt(3)
        positions, weight = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2), 1.0
    else:
        positions, weight = np.array([[1 / 3, 1 / 3]]), 0.5
    for position in positions:
        values, derivatives = shape_functions(position[None], faces.shape[1])
        tangents = np.einsum("ka,nkd->nda", derivatives[0], corners)
        area = weight * np.cross(tangents[:, :, 0], tangents[:, :, 1])
        np.add.at(result, faces, values[0][None, :, None] * area[:, None])
    return result
