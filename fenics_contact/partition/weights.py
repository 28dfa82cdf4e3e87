"""What a cut costs and what a cell counts: the weights by which meshes are cut into compact subdomains.

Subdomains that are slim in space, however many cells they are thick, have soft motions that cost iterations;
so have subdomains whose boundaries are jagged. Both have more area than compact ones of the same size.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import BodyMesh, cell_volumes, shared_faces, vector_areas


def face_areas(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of cells that share a face, (n, 2), and its area (in the plane length), (n,)."""
    faces, pairs = shared_faces(mesh.cells, mesh.dim)
    return pairs, np.linalg.norm(vector_areas(mesh.points, faces), axis=1)


def cell_weights(mesh: BodyMesh) -> np.ndarray:
    """Return what every cell counts, (n_cells,), together 1: the root of its volume.

    Between as many cells, which cost as much, and as much volume, which is as compact where cells are graded.
    """
    root = np.sqrt(cell_volumes(mesh.points, mesh.cells))
    return np.asarray(root / root.sum())
