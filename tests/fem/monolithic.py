"""The same linear scene on one mesh that nobody has torn: dolfinx assembles, MUMPS solves."""

from __future__ import annotations

from typing import Any

import dolfinx.fem
import dolfinx.fem.petsc
import dolfinx.mesh
import numpy as np
import scipy.sparse as sp
import ufl
from petsc4py import PETSc
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from fenics_contact import Body, BodyForce, Scene, Traction, _dolfinx
from fenics_contact.materials import IsotropicElasticity


def displacement(scene: Scene, name: str) -> np.ndarray:
    """Solve for one body with tractions and body forces, clamped or held in components.

    Supports and loads must lie on whole surfaces of the body; facets are marked by their midpoints.

    Returns:
        Displacement of the nodes of the body, shape (n_nodes, 3).
    """
    body = scene.bodies[name]
    mesh = _dolfinx.local_mesh(body.mesh.points, body.mesh.cells, body.mesh.cell_type)
    V = _dolfinx.coefficient(mesh, "u").function_space
    nodes, dofs = _dolfinx.node_dofs(V)
    a, L = _forms(scene, name, V)
    matrix_form, vector_form = dolfinx.fem.form(a), dolfinx.fem.form(L)
    A = dolfinx.fem.petsc.assemble_matrix(matrix_form)
    A.assemble()
    b = dolfinx.fem.petsc.assemble_vector(vector_form)
    fixed, value = _prescribed(scene, name, body, nodes, dofs)
    if not body.mesh.hanging:
        x = _solve(A, b, fixed, value)
    else:
        x = _solve_following(A, b, fixed, value, _followed(body, nodes, dofs))
    result = np.empty_like(body.mesh.points)
    result[nodes] = x.reshape(-1, 3)[dofs]
    return result


def _forms(scene: Scene, name: str, V: Any) -> tuple[Any, Any]:
    body, mesh = scene.bodies[name], V.mesh
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 2})
    material = body.material
    assert isinstance(material, IsotropicElasticity)
    E, nu = material.young_modulus, material.poisson_ratio
    strain = ufl.sym(ufl.grad(u))
    stress = E / (1 + nu) * (strain + nu / (1 - 2 * nu) * ufl.tr(strain) * ufl.Identity(3))
    a = ufl.inner(stress, ufl.sym(ufl.grad(v))) * dx
    L = ufl.inner(dolfinx.fem.Constant(mesh, np.zeros(3)), v) * dx
    for load in scene.loads:
        if load.body != name:
            continue
        density = dolfinx.fem.Constant(mesh, np.array(load.value, dtype=float))
        if isinstance(load, BodyForce):
            L += ufl.inner(density, v) * dx
        else:
            assert isinstance(load, Traction)
            tags = _marked(mesh, body, load.surface)
            ds = ufl.Measure("ds", mesh, subdomain_data=tags, metadata={"quadrature_degree": 2})
            L += ufl.inner(density, v) * ds(1)
    return a, L


def _marked(mesh: Any, body: Body, surface: str) -> Any:
    corners = body.mesh.points[body.mesh.surfaces[surface]].mean(axis=1)
    mesh.topology.create_connectivity(2, 3)
    everywhere = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda x: np.full(x.shape[1], True))
    mesh.topology.create_connectivity(2, 0)
    midpoints = np.asarray(dolfinx.mesh.compute_midpoints(mesh, 2, everywhere))
    near = np.linalg.norm(midpoints[:, None] - corners[None], axis=2).min(axis=1) < 1e-10
    assert near.sum() == len(corners)
    return dolfinx.mesh.meshtags(mesh, 2, np.sort(everywhere[near]), np.full(near.sum(), 1, dtype=np.int32))


def _prescribed(
    scene: Scene, name: str, body: Body, nodes: np.ndarray, dofs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    fixed, value = [], []
    for support in scene.supports:
        if support.body != name:
            continue
        held = dofs[np.isin(nodes, body.mesh.surfaces[support.surface])]
        for component, given in enumerate(support.value):
            if given is not None:
                fixed.append(3 * held + component)
                value.append(np.full(len(held), given))
    assert fixed
    rows, first = np.unique(np.concatenate(fixed), return_index=True)
    return rows, np.concatenate(value)[first]


def _followed(body: Body, nodes: np.ndarray, dofs: np.ndarray) -> sp.csr_matrix:
    """Return T: the displacement of all nodes for that of nodes which do not hang, zero columns of others.

    Where a node hangs is found from the coordinates alone.
    """
    mesh, block = body.mesh, np.empty(body.mesh.n_nodes, dtype=np.int64)
    block[nodes] = dofs
    edges = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]
    faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [0, 4, 7, 3], [1, 2, 6, 5]]
    tree, entries = cKDTree(mesh.points), {}
    for parts in (edges, faces):
        corners = mesh.cells[:, parts].reshape(-1, len(parts[0]))
        away, node = tree.query(mesh.points[corners].mean(axis=1))
        for row in np.flatnonzero(away < 1e-10):
            entries[block[node[row]]] = block[corners[row]]
    assert entries
    matrix = sp.identity(mesh.n_nodes, format="lil")
    for node, masters in entries.items():
        matrix[node, node] = 0.0
        for master in masters:
            matrix[node, master] = 1.0 / len(masters)
    return sp.kron(matrix, sp.identity(3), format="csr")


def _solve_following(
    A: Any, b: Any, fixed: np.ndarray, value: np.ndarray, followed: sp.csr_matrix
) -> np.ndarray:
    indptr, indices, data = A.getValuesCSR()
    K = sp.csr_matrix((data, indices, indptr), shape=followed.shape)
    K, f, x = followed.T @ K @ followed, followed.T @ b.array_r, np.zeros(len(b.array_r))
    kept = np.flatnonzero(followed.getnnz(axis=0))
    x[fixed] = value
    free = np.setdiff1d(kept, fixed)
    held = np.intersect1d(kept, fixed)
    x[free] = spsolve(K[free][:, free].tocsc(), f[free] - K[free][:, held] @ x[held])
    return np.asarray(followed @ x)


def _solve(A: Any, b: Any, fixed: np.ndarray, value: np.ndarray) -> np.ndarray:
    x = A.createVecRight()
    x.setValues(fixed.astype(PETSc.IntType), value)
    x.assemble()
    A.zeroRowsColumns(fixed.astype(PETSc.IntType), 1.0, x, b)
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOperators(A)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.getPC().setType(PETSc.PC.Type.LU)
    ksp.getPC().setFactorSolverType("mumps")
    ksp.solve(b, x)
    residual = A.createVecLeft()
    A.mult(x, residual)
    residual.axpy(-1.0, b)
    assert residual.norm() < 1e-10 * b.norm()
    return np.array(x.array_r)
