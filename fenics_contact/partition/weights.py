"""Weights of faces and cells for cutting meshes into compact subdomains.

Slender subdomains, however many cells thick, have soft modes that cost iterations, and so have subdomains
with jagged boundaries. Both have more area than compact ones of the same size.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import BodyMesh, cell_volumes, shared_faces, vector_areas


def face_areas(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of cells that share a face, (n, 2), and its area (in the plane length), (n,)."""
    faces, pairs = shared_faces(mesh.cells, mesh.dim)
    return pairs, np.linalg.norm(vector_areas(mesh.points, faces), axis=1)


def cell_weights(mesh: BodyMesh) -> np.ndarray:
    """Return the weight of every cell, (n_cells,), with sum 1: the root of its volume.

    A compromise between equal numbers of cells, hence equal cost, and equal volume, hence compactness.
    """
    root = np.sqrt(cell_volumes(mesh.points, mesh.cells))
    return np.asarray(root / root.sum())
