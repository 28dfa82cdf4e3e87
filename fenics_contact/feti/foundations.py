"""Stiffness of elastic foundations, ∫ k (n·u)(n·v) or ∫ Σ k_d u_d v_d over a surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from fenics_contact._scene.body import Body
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._surfaces.facets import gauss_points, quadrature_areas
from fenics_contact.mesh.faces import boundary_faces, corners_of, match_faces, of_one_shape


def foundation_stiffness(
    foundations: Sequence[ElasticFoundation], body: Body, cells: np.ndarray | None = None
) -> sp.csr_matrix:
    """Return the stiffness of the foundations of a body, or of those under some of its cells."""
    mesh = body.mesh
    size = mesh.n_nodes * body.components
    total = sp.csr_matrix((size, size))
    for foundation in foundations:
        facets = mesh.surfaces[foundation.surface]
        area = 1.0
        if foundation.total:
            area = quadrature_areas(mesh.points, facets, body.kinematics.measure).sum()
        if cells is not None:
            own, _ = boundary_faces(mesh.cells[cells], mesh.dim)
            facets = facets[match_faces(corners_of(facets, mesh.dim), corners_of(own, mesh.dim)) >= 0]
        for _, some in of_one_shape(facets):
            if len(some):
                total = total + _of_facets(foundation, body, some) / area
    return sp.csr_matrix(total)


def _of_facets(foundation: ElasticFoundation, body: Body, facets: np.ndarray) -> sp.csr_matrix:
    mesh, stiffness = body.mesh, np.asarray(foundation.stiffness)
    dim, width = body.components, facets.shape[1]
    blocks = np.zeros((len(facets), width, dim, width, dim))
    for at in gauss_points(mesh.points, facets, body.kinematics.measure):
        if stiffness.ndim:
            springs = at.areas[:, None, None] * np.diag(stiffness)
        else:
            normal = np.pad(at.normals / at.areas[:, None], ((0, 0), (0, dim - mesh.dim)))
            springs = stiffness * np.einsum("n,nc,nd->ncd", at.areas, normal, normal)
        blocks += np.einsum("a,b,ncd->nacbd", at.values, at.values, springs)
    dofs = (dim * facets[:, :, None] + np.arange(dim)).reshape(len(facets), -1)
    row, column = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = mesh.n_nodes * dim
    return sp.csr_matrix((blocks.ravel(), (row.ravel(), column.ravel())), shape=(size, size))


def separated(
    stiffness: sp.csr_matrix, modes: np.ndarray, rounding: float = 1e-10
) -> tuple[np.ndarray, np.ndarray]:
    """Separate motions, (n, k), by whether a stiffness resists them.

    Returns orthonormal coefficients of those that it does, (k, r), and of the others, (k, k − r). `rounding`:
    energy of a motion that is none, relative to the largest of any displacement of its size.
    """
    basis, scale = np.linalg.qr(modes)
    values, vectors = np.linalg.eigh(basis.T @ (stiffness @ basis))
    held = values > rounding * abs(stiffness).sum(axis=1).max()
    free = np.linalg.qr(np.linalg.solve(scale, vectors[:, ~held]))[0]
    # What is resisted is all that is across the others.
    return np.linalg.svd(np.eye(len(values)) - free @ free.T)[0][:, : held.sum()], free


def by_resistance(stiffness: sp.csr_matrix, modes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return those of some motions, (n, k), that a stiffness leaves free, the others, and RᵀK R of these."""
    if not stiffness.nnz:
        return modes, modes[:, :0], np.zeros(0)
    resisted, free = separated(stiffness, modes)
    return modes @ free, *by_stiffness(stiffness, modes @ resisted, modes[:, :0])


def by_stiffness(
    stiffness: sp.csr_matrix, modes: np.ndarray, kernel: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return orthonormal motions R that span modes, (n, k), without those of a kernel, and RᵀK R of each."""
    basis = np.linalg.qr(np.hstack([kernel, modes]))[0][:, kernel.shape[1] :]
    values, vectors = np.linalg.eigh(basis.T @ (stiffness @ basis))
    return basis @ vectors, values
