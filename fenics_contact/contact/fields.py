"""Fields of a state on the bodies' own meshes as dolfinx Functions, and back in the order of the bodies."""

from __future__ import annotations

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.feti import Decomposition
from fenics_contact.scene import Body


def body_mesh(decomposition: Decomposition, name: str, body: Body) -> _dolfinx.mesh.Mesh:
    """Build the mesh of one body; a cell lives on the rank that owns its subdomain. Collective."""
    tearing, mesh = decomposition.tearing, body.mesh
    first = tearing.subdomain_offset[tearing.body_names.index(name)]
    rank = tearing.subdomain_rank[first + decomposition.partitions[name]]
    return _dolfinx.rank_mesh(decomposition.comm, mesh.points, mesh.cells, rank, mesh.cell_type)


def displacement_function(mesh: _dolfinx.mesh.Mesh, values: np.ndarray) -> _dolfinx.fem.Function:
    """Return the displacement as a Function on a body's mesh. Collective.

    Args:
        mesh: The body's mesh.
        values: Displacement of the body's nodes, valid at least on those of this rank, shape (n_nodes, dim).
    """
    function = _dolfinx.coefficient(mesh, "displacement")
    nodes, dofs = _dolfinx.node_dofs(function.function_space)
    function.x.array.reshape(-1, values.shape[1])[dofs] = values[nodes]
    function.x.scatter_forward()
    return function


def nodal_function(mesh: _dolfinx.mesh.Mesh, name: str, values: np.ndarray) -> _dolfinx.fem.Function:
    """Return a scalar field on a body's mesh from its nodal values. Collective.

    Args:
        mesh: The body's mesh.
        name: Name of the Function.
        values: Nodal values of the body, on every rank, shape (at least n_nodes,).
    """
    function = _dolfinx.fem.Function(_dolfinx.scalar_space(mesh, 1), name=name)
    nodes, dofs = _dolfinx.node_dofs(function.function_space)
    function.x.array[dofs] = values[nodes]
    function.x.scatter_forward()
    return function


def cells_of_body(mesh: _dolfinx.mesh.Mesh, cells: np.ndarray) -> np.ndarray:
    """Return the number in the body of each cell owned by this rank, shape (n_owned,).

    Args:
        mesh: The body's mesh in dolfinx.
        cells: Node numbers of all cells of the body, shape (n_cells, nodes of a cell).
    """
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    mine = _dolfinx.cell_nodes(mesh).reshape(-1, cells.shape[1])[:owned]
    # dolfinx reorders cells: they are identified by their nodes.
    _, key = np.unique(np.sort(np.vstack([cells, mine]), axis=1), axis=0, return_inverse=True)
    key = key.ravel()
    place = np.empty(len(cells) + len(mine), dtype=np.int64)
    place[key[: len(cells)]] = np.arange(len(cells))
    return place[key[len(cells) :]]


def cell_values(function: _dolfinx.fem.Function, cells: np.ndarray) -> np.ndarray:
    """Gather a cellwise constant Function in the order of a body's cells. Collective on its mesh.

    Args:
        function: Function on the body's own mesh: numbers, vectors or tensors.
        cells: Node numbers of all cells of the body, (n_cells, n_vertices).

    Returns:
        One value for every cell, (n_cells, ...), replicated.
    """
    space, shape = function.function_space, function.ufl_shape
    number = cells_of_body(space.mesh, cells)
    values = np.zeros((len(cells), *shape))
    own = _dolfinx.cell_dofs(space).ravel()[: len(number)]
    values[number] = function.x.array.reshape(-1, *shape)[own]
    return np.asarray(space.mesh.comm.allreduce(values))
