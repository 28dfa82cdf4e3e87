"""Volume of a body as a function of its nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.mesh import BodyMesh, boundary_faces
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import Scene
from fenics_contact.surfaces import gauss_points


def volume_of(scene: Scene, names: Sequence[str], numbers: NodeNumbers) -> tuple[float, np.ndarray]:
    """Return the volume of some bodies and its derivative by the nodes of all, (n_nodes, dim)."""
    total, by_points = 0.0, np.zeros((numbers.n_nodes, scene.dim))
    for name in names:
        mesh = scene.bodies[name].mesh
        total += mesh.volume
        by_points[numbers.global_nodes(name, np.arange(mesh.n_nodes))] = volume_by_points(mesh)
    return total, by_points


def volume_by_points(mesh: BodyMesh) -> np.ndarray:
    """Return the derivative of the volume by every node, shape (n_nodes, 3), [length²]; in 2D of the area.

    Moving the boundary by v changes the volume by ∫ v·n dA, so that only boundary nodes count.
    """
    faces, _ = boundary_faces(mesh.cells, mesh.dim)
    result = np.zeros_like(mesh.points)
    for at in gauss_points(mesh.points, faces):
        np.add.at(result, faces, at.values[:, None] * at.normals[:, None])
    return result
