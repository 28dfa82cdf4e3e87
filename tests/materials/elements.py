"""Element matrices by NumPy alone, and those of the package, both ordered by node."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, Scene
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.loads import as_tractions
from fenics_contact.feti.subdomain import Subdomain, assemble, cut_out
from fenics_contact.materials import Material
from tests.scenes import Load

#: Reference coordinates of the vertices in VTK order.
VERTICES = {
    "triangle": np.array([[0, 0], [1, 0], [0, 1.0]]),
    "quadrilateral": np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]),
    "tetrahedron": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    "hexahedron": np.array(
        [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1.0]]
    ),
}
CELLS = tuple(VERTICES)
PLANE, SPACE = CELLS[:2], CELLS[2:]


def skewed_cell(cell: str, size: float = 0.15) -> np.ndarray:
    """Vertices of a cell without symmetry, of another size in every direction."""
    vertices = VERTICES[cell]
    shift = np.cos(np.arange(vertices.size)).reshape(vertices.shape)
    return (vertices + size * shift) * np.array([2.0, 1.0, 0.7])[: vertices.shape[1]]


def gradients(vertices: np.ndarray, cell: str) -> list[tuple[np.ndarray, float]]:
    """Gradients of the shape functions, shape (n, dim), and weight at every Gauss point."""
    n, dim = vertices.shape
    if cell in ("triangle", "tetrahedron"):
        local = np.vstack([-np.ones(dim), np.eye(dim)])
        jacobian = vertices.T @ local
        return [(local @ np.linalg.inv(jacobian), float(np.linalg.det(jacobian)) / (2 if dim == 2 else 6))]
    signs, found = VERTICES[cell], []
    for corner in np.ndindex(*(2,) * dim):
        point = (2 * np.array(corner) - 1) / np.sqrt(3)
        factors = (1 + signs * point) / 2
        local = np.empty((n, dim))
        for d in range(dim):
            local[:, d] = signs[:, d] / 2 * np.prod(np.delete(factors, d, axis=1), axis=1)
        jacobian = vertices.T @ local
        found.append((local @ np.linalg.inv(jacobian), float(np.linalg.det(jacobian))))
    return found


def strain_matrix(gradient: np.ndarray) -> np.ndarray:
    """Voigt strains (xx, yy, zz, yz, xz, xy or xx, yy, xy) by nodal displacements."""
    n, dim = gradient.shape
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)] if dim == 3 else [(0, 0), (1, 1), (0, 1)]
    B = np.zeros((len(pairs), n, dim))
    for row, (i, j) in enumerate(pairs):
        B[row, :, i] += gradient[:, j]
        if i != j:
            B[row, :, j] += gradient[:, i]
    return B.reshape(len(pairs), -1)


def element_stiffness(vertices: np.ndarray, cell: str, C: np.ndarray) -> np.ndarray:
    """∫ Bᵀ C B, ordered by node."""
    parts = [(strain_matrix(gradient), weight) for gradient, weight in gradients(vertices, cell)]
    return np.asarray(sum(weight * B.T @ C @ B for B, weight in parts))


def isotropic_matrix(young: float, poisson: float, dim: int) -> np.ndarray:
    """Voigt stiffness of an isotropic body; in the plane that of plane strain."""
    lame, shear = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    C = np.diag([shear] * (6 if dim == 3 else 3))
    C[:dim, :dim] = lame * np.ones((dim, dim)) + 2 * shear * np.eye(dim)
    return C


def one_cell(material: Material, cell: str, vertices: np.ndarray, loads: tuple[Load, ...] = ()) -> Subdomain:
    """The subdomain that a body of one cell makes; its body is called "cell"."""
    mesh = BodyMesh(vertices, np.arange(len(vertices))[None])
    assert mesh.cell_type == cell
    return whole(Body(mesh, material), loads)


def whole(body: Body, loads: tuple[Load, ...] = (), forms: FormLibrary | None = None) -> Subdomain:
    """A body of the name "cell" as one subdomain."""
    scene = Scene({"cell": body}, loads=loads)
    forms = FormLibrary(MPI.COMM_SELF) if forms is None else forms
    forms.prepare(scene)
    mesh = cut_out(0, "cell", body, np.arange(body.mesh.n_cells), {})
    return assemble(mesh, body, as_tractions(scene), forms)


def by_node(subdomain: Subdomain) -> np.ndarray:
    """Its stiffness matrix, ordered by node."""
    dim = subdomain.mesh.components
    order = np.argsort(subdomain.mesh.nodes)
    dofs = (dim * order[:, None] + np.arange(dim)).ravel()
    return np.asarray(subdomain.stiffness.toarray()[np.ix_(dofs, dofs)])


def load_by_node(subdomain: Subdomain) -> np.ndarray:
    """Its load, ordered by node, shape (n, dim)."""
    return np.asarray(subdomain.load.reshape(-1, subdomain.mesh.components)[np.argsort(subdomain.mesh.nodes)])
