"""Spaces on a mesh, and maps from its cells, nodes, dofs and facets to the input."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from fenics_contact._base.libraries import MPI
from fenics_contact._dolfinx.cache import compiled_once
from fenics_contact._dolfinx.cells import NODE_ORDER, cell_type_named, facet_vertices
from fenics_contact._dolfinx.loading import cpp, dolfinx, old, side_effects_undone, version
from fenics_contact._dolfinx.templates import cellwise_element, point_element, scalar_element, vector_element

#: Elements that this process has compiled, each with its dofmap and the library that holds both: dolfinx 0.5
#: looks them up in the folder of compiled forms for every space, of which each subdomain has several.
_ELEMENTS: dict[ufl.finiteelement.AbstractFiniteElement, tuple[cpp.fem.FiniteElement, int, Any]] = {}


def _space(
    mesh: dolfinx.mesh.Mesh, element: ufl.finiteelement.AbstractFiniteElement
) -> dolfinx.fem.FunctionSpace:
    if not old():
        with side_effects_undone():
            return dolfinx.fem.functionspace(mesh, element)
    if not mesh.comm.allreduce(element in _ELEMENTS, op=MPI.LAND):
        with side_effects_undone(), compiled_once():
            (compiled, dofmap), library, _ = dolfinx.jit.ffcx_jit(mesh.comm, element)
        places = (int(library.ffi.cast("uintptr_t", library.ffi.addressof(of))) for of in (compiled, dofmap))
        _ELEMENTS[element] = (cpp.fem.FiniteElement(next(places)), next(places), library)
    made, dofmap, _ = _ELEMENTS[element]
    dofs = cpp.fem.create_dofmap(mesh.comm, dofmap, mesh.topology, made)
    return dolfinx.fem.FunctionSpace(mesh, element, cpp.fem.FunctionSpace(mesh._mesh, made, dofs))


def geometry_degree(mesh: dolfinx.mesh.Mesh) -> int:
    """Return the degree of the map from the reference cell to the cells of a mesh."""
    geometry = mesh.geometry
    return int((geometry.cmap if version() < (0, 11) else geometry.cmaps[0]).degree)


def cell_type_of_mesh(mesh: dolfinx.mesh.Mesh) -> str:
    """Return which of `CELL_TYPES` the cells of a mesh are."""
    return cell_type_named(mesh.topology.cell_name(), geometry_degree(mesh))


def coefficient(mesh: dolfinx.mesh.Mesh, name: str, size: int = 0) -> dolfinx.fem.Function:
    """Return a vector field on ``mesh`` with the given name (a C identifier).

    `size`: number of components; by default as many as coordinates.
    """
    return dolfinx.fem.Function(_space(mesh, vector_element(cell_type_of_mesh(mesh), size)), name=name)


def scalar_space(mesh: dolfinx.mesh.Mesh, degree: int) -> dolfinx.fem.FunctionSpace:
    """Return the space of scalar fields on ``mesh``: one value per cell (degree 0) or node (1)."""
    cell_type = cell_type_of_mesh(mesh)
    return _space(mesh, scalar_element(cell_type) if degree == 1 else cellwise_element(cell_type))


def cellwise_space_on(mesh: dolfinx.mesh.Mesh, shape: tuple[int, ...]) -> dolfinx.fem.FunctionSpace:
    """Return the space of scalars, or vectors, on ``mesh`` that are constant on each cell."""
    return _space(mesh, cellwise_element(cell_type_of_mesh(mesh), shape))


def point_space_on(mesh: dolfinx.mesh.Mesh, degree: int) -> dolfinx.fem.FunctionSpace:
    """Return the space of scalars on ``mesh`` at the points of the quadrature of a degree."""
    return _space(mesh, point_element(cell_type_of_mesh(mesh), degree))


def nodal_space_on(mesh: dolfinx.mesh.Mesh, size: int) -> dolfinx.fem.FunctionSpace:
    """Return the space of nodal fields with a number of components on ``mesh``, of the cells' degree."""
    cell_type = cell_type_of_mesh(mesh)
    if size == 1:
        return _space(mesh, scalar_element(cell_type))
    return _space(mesh, vector_element(cell_type, size))


def lagrange_degree(space: dolfinx.fem.FunctionSpace) -> int | None:
    """Return the degree of a space of Lagrange elements, continuous or not; None for others."""
    element = space.ufl_element()
    if old():
        known = ("Lagrange", "Q", "Discontinuous Lagrange", "DQ")
        return int(element.degree()) if element.family() in known else None
    return int(element.degree) if getattr(element, "family_name", "") in ("P", "Q") else None


def cell_field(mesh: dolfinx.mesh.Mesh, name: str, values: np.ndarray) -> dolfinx.fem.Function:
    """Return a field on ``mesh`` that is constant on each cell, by the values on this rank's own cells."""
    element = cellwise_element(cell_type_of_mesh(mesh), values.shape[1:])
    field = dolfinx.fem.Function(_space(mesh, element), name=name)
    dofs = cell_dofs(field.function_space).ravel()[: len(values)]
    size = int(np.prod(values.shape[1:]))
    field.x.array.reshape(-1, size)[dofs] = values.reshape(-1, size)  # a rank may have no cells
    field.x.scatter_forward()
    return field


def table(adjacency: np.ndarray | cpp.graph.AdjacencyList_int32, rows: int) -> np.ndarray:
    """Return a list of lists of equal length as an array, (rows, length)."""
    flat = np.asarray(getattr(adjacency, "array", adjacency))
    # A rank without cells of a body has no rows; numpy cannot guess their length then.
    return flat.reshape(rows, flat.size // max(rows, 1))


def cell_count(mesh: dolfinx.mesh.Mesh) -> int:
    """Return the number of this rank's cells, ghosts included."""
    index_map = mesh.topology.index_map(mesh.topology.dim)
    return int(index_map.size_local + index_map.num_ghosts)


def _input_nodes(mesh: dolfinx.mesh.Mesh) -> np.ndarray:
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def cell_nodes(mesh: dolfinx.mesh.Mesh) -> np.ndarray:
    """Return the input nodes of this rank's cells, tensor-product order, shape (n_cells, nodes of a cell)."""
    return _input_nodes(mesh)[cell_geometry(mesh)]


def cell_geometry(mesh: dolfinx.mesh.Mesh) -> np.ndarray:
    """Return the nodes in dolfinx's geometry of this rank's cells, shape (n_cells, nodes of a cell)."""
    geometry = mesh.geometry
    nodes = geometry.dofmap if version() < (0, 11) else geometry.dofmaps[0]
    return table(nodes, cell_count(mesh))


def cell_dofs(space: dolfinx.fem.FunctionSpace) -> np.ndarray:
    """Return the blocked dofs of this rank's cells, ghosts included, shape (n_cells, n_dofs of a cell)."""
    return table(space.dofmap.list, cell_count(space.mesh))


def vtk_cell_dofs(space: dolfinx.fem.FunctionSpace) -> np.ndarray:
    """Return the blocked dofs of this rank's cells, one for each node, in VTK order, (n_cells, n_nodes)."""
    return cell_dofs(space)[:, np.argsort(NODE_ORDER[cell_type_of_mesh(space.mesh)])]


def input_cells(mesh: dolfinx.mesh.Mesh) -> np.ndarray:
    """Return the input cell of each cell of a mesh on one rank, in dolfinx's order, shape (n_cells,)."""
    return np.asarray(mesh.topology.original_cell_index, dtype=np.int64)


def node_dofs(space: dolfinx.fem.FunctionSpace) -> tuple[np.ndarray, np.ndarray]:
    """Return (input nodes, blocked dofs): dof ``dofs[i]`` of ``space`` sits on input node ``nodes[i]``.

    One entry for each node of this rank, ghosts included, in ascending node order.
    """
    mesh = space.mesh
    cells = cell_count(mesh)
    nodes = cell_nodes(mesh).ravel()
    dofs = table(space.dofmap.list, cells).ravel()
    nodes, first = np.unique(nodes, return_index=True)
    return nodes, dofs[first]


def global_dofs(space: dolfinx.fem.FunctionSpace, dofs: np.ndarray) -> np.ndarray:
    """Return the global numbers of this rank's blocked dofs, ghosts included."""
    return np.asarray(space.dofmap.index_map.local_to_global(dofs.astype(np.int32)))


def update_coordinates(mesh: dolfinx.mesh.Mesh, points: np.ndarray) -> None:
    """Move the nodes of ``mesh`` to ``points``, shape (n_nodes, dim), indexed by input node."""
    # dolfinx stores three coordinates per node in any dimension.
    mesh.geometry.x[:, : points.shape[1]] = points[_input_nodes(mesh)]


def match_facets(mesh: dolfinx.mesh.Mesh, surface: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the facets of ``mesh``, on one rank, whose nodes form a row of ``surface``, in any order.

    Returns cells and local facet numbers of those on this mesh, one entry each.
    """
    cell_type = cell_type_of_mesh(mesh)
    local = np.array(facet_vertices(cell_type))
    nodes = cell_nodes(mesh)
    near = np.flatnonzero(np.isin(nodes, surface)[:, local].all(axis=2))
    faces = np.sort(nodes[near[:, None] // len(local), local[near % len(local)]], axis=1)
    wanted = np.sort(surface, axis=1)
    # One integer key per facet: rows of both tables are numbered together.
    _, key = np.unique(np.vstack([wanted, faces]), axis=0, return_inverse=True)
    key = key.ravel()
    matches = near[np.isin(key[len(wanted) :], key[: len(wanted)])]
    return matches // len(local), matches % len(local)
