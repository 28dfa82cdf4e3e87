"""One subdomain: its own mesh on one rank, its stiffness, load and kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.forms import FormLibrary
from fenics_contact.scene import Body, BodyForce, Load, Material


@dataclass(frozen=True)
class SubdomainMesh:
    """The part of a scene that survives a change of geometry: mesh, numbering, tagged facets.

    Blocks of three dofs are numbered as dolfinx numbers them.

    Attributes:
        number: Number among all subdomains.
        body: Name of the body.
        cells: Cells of the body's mesh, in this mesh's order.
        nodes: Nodes of the body, by block: block b sits on node ``nodes[b]``.
        space: dolfinx function space of displacements on the subdomain's own mesh.
        facets: Index of a surface load in the scene -> (cells, local facets) on this mesh.
    """

    number: int
    body: str
    cells: np.ndarray
    nodes: np.ndarray
    space: Any
    facets: dict[int, tuple[np.ndarray, np.ndarray]]

    @property
    def size(self) -> int:
        """Number of dofs."""
        return 3 * len(self.nodes)


@dataclass(frozen=True)
class Subdomain:
    """A subdomain with its numbers for one geometry.

    Attributes:
        mesh: Mesh and numbering.
        material: Material it was assembled for.
        loads: Loads on it that it was assembled for.
        points: Coordinates by block, shape (n, 3), [length].
        load: f_s, shape (3 n,), [force].
        kernel: R_s, shape (3 n, n_modes): zero-energy modes as columns.
        typical_stiffness: Mean diagonal entry of K_s, [force / length].
        matrix: K_s, forgotten when it is factored.
    """

    mesh: SubdomainMesh
    material: Material
    loads: tuple[Load, ...]
    points: np.ndarray
    load: np.ndarray
    kernel: np.ndarray
    typical_stiffness: float
    matrix: Forgettable

    @property
    def stiffness(self) -> sp.csr_matrix:
        """K_s, shape (3 n, 3 n); assembled again if it was forgotten."""
        return self.matrix.get()


class Forgettable:
    """A matrix that can be made again, so that it need not be kept while nobody needs it."""

    def __init__(self, make: Callable[[], sp.csr_matrix]) -> None:
        """Make it for the first time."""
        self._make = make
        self._matrix: sp.csr_matrix | None = make()

    def get(self) -> sp.csr_matrix:
        """Return the matrix, made again if need be, and remember it."""
        if self._matrix is None:
            self._matrix = self._make()
        return self._matrix

    def forget(self) -> None:
        """Free the memory."""
        self._matrix = None


def cut_out(
    number: int, body_name: str, body: Body, cells: np.ndarray, loads: Sequence[Load]
) -> SubdomainMesh:
    """Build the mesh of one subdomain.

    Args:
        number: Number among all subdomains.
        body_name: Name of the body.
        body: The body.
        cells: Its cells that belong to the subdomain.
        loads: Loads of the scene; surface loads on this body are looked for among the facets.
    """
    mesh = body.mesh
    used, local = np.unique(mesh.cells[cells], return_inverse=True)
    local = local.reshape(len(cells), -1)
    own = _dolfinx.local_mesh(mesh.points[used], local, mesh.cell_type)
    space = _dolfinx.coefficient(own, "u").function_space
    input_nodes, dofs = _dolfinx.node_dofs(space)
    nodes = np.empty(len(used), dtype=np.int64)
    nodes[dofs] = used[input_nodes]
    facets = {}
    for index, load in enumerate(loads):
        if load.body == body_name and not isinstance(load, BodyForce):
            surface = mesh.surfaces[load.surface]
            inside = np.isin(surface, used).all(axis=1)
            matched = _dolfinx.match_facets(own, np.searchsorted(used, surface[inside]))
            if len(matched[0]):
                facets[index] = matched
    return SubdomainMesh(number, body_name, cells, nodes, space, facets)


def assemble(
    mesh: SubdomainMesh,
    body: Body,
    loads: Sequence[Load],
    forms: FormLibrary,
    earlier: Subdomain | None = None,
) -> Subdomain:
    """Assemble K_s, f_s and R_s for the present coordinates of ``body``.

    Args:
        mesh: The subdomain.
        body: Its body, with the coordinates to use.
        loads: Loads of the scene, resultants already spread.
        forms: Compiled forms.
        earlier: The same subdomain in another state, returned as it is if coordinates, material and loads
            are equal.

    Raises:
        InvalidInputError: If a matrix or load entry is not a number.
    """
    space, cell_type = mesh.space, body.mesh.cell_type
    points = body.mesh.points[mesh.nodes]
    acting = [
        (index, load)
        for index, load in enumerate(loads)
        if load.body == mesh.body and (isinstance(load, BodyForce) or index in mesh.facets)
    ]
    own_loads = tuple(load for _, load in acting)
    if (
        earlier is not None
        and (earlier.material, earlier.loads) == (body.material, own_loads)
        and np.array_equal(earlier.points, points)
    ):
        return earlier
    order = np.argsort(mesh.nodes)

    def stiffness() -> sp.csr_matrix:
        _dolfinx.update_coordinates(space.mesh, points[order])
        indptr, indices, data = _dolfinx.assemble_csr(forms.stiffness(body.material, cell_type, space))
        return sp.csr_matrix((data, indices, indptr), shape=(mesh.size, mesh.size))

    matrix = Forgettable(stiffness)
    diagonal = matrix.get().diagonal()
    force = np.zeros(mesh.size)
    for index, load in acting:
        force += _dolfinx.assemble_vector(forms.load(load, cell_type, space, mesh.facets.get(index)))
    if not (np.isfinite(matrix.get().data).all() and np.isfinite(force).all()):
        raise InvalidInputError(
            f"stiffness and load of subdomain {mesh.number} of body {mesh.body!r} must be finite, got NaN or "
            "infinity: check the material parameters, the loads and the coordinates"
        )
    kernel = body.material.kernel(points)
    return Subdomain(
        mesh, body.material, own_loads, points, force, kernel.reshape(mesh.size, -1), diagonal.mean(), matrix
    )
