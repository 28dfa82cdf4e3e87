"""Fields of a state on the bodies' own meshes: displacement and von Mises stress as dolfinx Functions."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact.feti import Decomposition
from fenics_contact.feti.forms import Template, scalar_constants, volume_measure
from fenics_contact.scene import Body


def body_mesh(decomposition: Decomposition, name: str, body: Body) -> Any:
    """Build the mesh of one body; a cell lives on the rank that owns its subdomain. Collective."""
    tearing, mesh = decomposition.tearing, body.mesh
    first = tearing.subdomain_offset[tearing.body_names.index(name)]
    rank = tearing.subdomain_rank[first + decomposition.partitions[name]]
    return _dolfinx.rank_mesh(decomposition.comm, mesh.points, mesh.cells, rank, mesh.cell_type)


def nodal_displacement(decomposition: Decomposition, name: str, body: Body, torn: np.ndarray) -> np.ndarray:
    """Average this rank's copies of each node.

    Args:
        decomposition: Meshes and numbering.
        name: Name of the body.
        body: The body.
        torn: Torn displacement of this rank, shape (torn_size,).

    Returns:
        Displacement of every node of the body, NaN on nodes that this rank does not hold, (n_nodes, dim).
    """
    dim = body.mesh.points.shape[1]
    total, count = np.zeros((body.mesh.n_nodes, dim)), np.zeros(body.mesh.n_nodes)
    blocks = torn.reshape(-1, dim)
    for mesh, start in zip(decomposition.meshes, decomposition.block_offset[:-1], strict=True):
        if mesh.body == name:
            total[mesh.nodes] += blocks[start : start + len(mesh.nodes)]
            count[mesh.nodes] += 1
    return total / np.where(count, count, np.nan)[:, None]


def displacement_function(mesh: Any, values: np.ndarray) -> Any:
    """Return the displacement as a Function on a body's mesh. Collective.

    Args:
        mesh: The body's mesh.
        values: Displacement of the body's nodes, known at least on this rank's own, shape (n_nodes, dim).
    """
    function = _dolfinx.coefficient(mesh, "displacement")
    nodes, dofs = _dolfinx.node_dofs(function.function_space)
    function.x.array.reshape(-1, values.shape[1])[dofs] = values[nodes]
    function.x.scatter_forward()
    return function


def von_mises(displacement: Any, body: Body) -> Any:
    """Return the von Mises stress averaged over each cell, [force / length²], a piecewise constant Function.

    Collective on the mesh.

    Args:
        displacement: The displacement Function of the body.
        body: Gives the material.
    """
    mesh = displacement.function_space.mesh
    cell_type = body.mesh.cell_type
    (u,) = _dolfinx.field_symbols(cell_type, 1)
    constants = scalar_constants(cell_type, len(body.material.parameters))
    stress = body.material.stress(u, constants)
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    q = ufl.TestFunction(_dolfinx.cellwise_space(cell_type))
    dx = volume_measure(cell_type, 2)
    weighted = Template(mesh.comm, ufl.sqrt(1.5 * ufl.inner(deviator, deviator)) * q * dx, constants, [u])
    volume = Template(mesh.comm, q * dx, ())
    space = _dolfinx.scalar_space(mesh, 0)
    result = _dolfinx.Function(space, name="von_mises")
    above = _dolfinx.assemble_vector(weighted.bind([space], body.material.parameters, [displacement]))
    below = _dolfinx.assemble_vector(volume.bind([space], ()))
    result.x.array[: len(above)] = above / below
    result.x.scatter_forward()
    return result


def cell_values(function: Any, cells: np.ndarray) -> np.ndarray:
    """Collect a cellwise constant Function in the order of a body's cells. Collective on its mesh.

    Args:
        function: Function on the body's own mesh, one value a cell.
        cells: Node numbers of all cells of the body, (n_cells, 8 | 4).

    Returns:
        One value for every cell, (n_cells,), replicated.
    """
    space = function.function_space
    topology = space.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    mine = _dolfinx.cell_nodes(space.mesh).reshape(-1, cells.shape[1])[:owned]
    # dolfinx has its own order of cells: they are recognised by their nodes.
    _, key = np.unique(np.sort(np.vstack([cells, mine]), axis=1), axis=0, return_inverse=True)
    place = np.empty(len(cells), dtype=np.int64)
    place[key.ravel()[: len(cells)]] = np.arange(len(cells))
    dofs = _dolfinx.cell_dofs(space).ravel()[:owned]
    values = np.zeros(len(cells))
    values[place[key.ravel()[len(cells) :]]] = function.x.array[dofs]
    return np.asarray(space.mesh.comm.allreduce(values))
