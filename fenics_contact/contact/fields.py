"""Fields of a state on the bodies' own meshes: displacement and von Mises stress as dolfinx Functions."""

from __future__ import annotations

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.errors import together
from fenics_contact.fem import (
    Composition,
    Temperature,
    Template,
    Written,
    integrate,
    stress_in_space,
    volume_measure,
)
from fenics_contact.feti import Decomposition
from fenics_contact.scene import Body, Material


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


def von_mises(
    displacement: _dolfinx.fem.Function, body: Body, comm: MPI.Comm, temperature: Temperature = Temperature()
) -> _dolfinx.fem.Function:
    """Return the von Mises stress averaged over each cell, [force / length²], a piecewise constant Function.

    The stress is that in space: for plane bodies with the component normal to the plane. Collective on
    ``comm``.

    Args:
        displacement: The displacement Function of the body.
        body: The body with its materials.
        comm: Communicator of the state.
        temperature: Temperature change of the body, whose thermal stress is subtracted.
    """
    mesh, cell_type = displacement.function_space.mesh, body.mesh.cell_type
    parts = _composition(mesh, body)
    q = ufl.TestFunction(_dolfinx.cellwise_space(cell_type))
    with together(comm):
        form, constants, coefficients = _weighted(parts.materials, cell_type, q, temperature)
        functions = [displacement, *temperature.fields(mesh, body.mesh.points)]
    weighted = Template(mesh.comm, form, constants, coefficients)
    volume = Template(mesh.comm, q * volume_measure(cell_type, 2), ())
    space = _dolfinx.scalar_space(mesh, 0)
    result = _dolfinx.fem.Function(space, name="von_mises")
    values = (*temperature.numbers, *parts.parameters)
    above = _dolfinx.assemble_vector(weighted.bind([space], values, functions, cells=parts.cells))
    below = _dolfinx.assemble_vector(volume.bind([space], ()))
    result.x.array[: len(above)] = above / below
    result.x.scatter_forward()
    return result


def _weighted(materials: tuple[Material, ...], cell_type: str, q: Expr, temperature: Temperature) -> Written:
    """Return ∫ σ_M q dx (a form), its constants and its coefficients."""
    (u,) = _dolfinx.field_symbols(cell_type, 1)
    change, numbers, fields = temperature.write(cell_type)

    def density(material: Material, constants: tuple[ufl.Constant, ...]) -> Expr:
        stress = stress_in_space(material, u, constants, change)
        deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
        return ufl.sqrt(1.5 * ufl.inner(deviator, deviator)) * q

    form, constants = integrate(materials, cell_type, density, volume_measure(cell_type, 2))
    return form, (*numbers, *constants), [u, *fields]


def _composition(mesh: _dolfinx.mesh.Mesh, body: Body) -> Composition:
    """Return all materials of a body's mesh on every rank, wherever their cells are."""
    count = len(body.materials)
    if count == 1:
        return Composition(body.materials)
    number = body.material_of_cells[_cells_of_body(mesh, body.mesh.cells)]
    return Composition(body.materials, {k + 1: np.flatnonzero(number == k) for k in range(count)})


def _cells_of_body(mesh: _dolfinx.mesh.Mesh, cells: np.ndarray) -> np.ndarray:
    """Return the number in the body of each cell owned by this rank, shape (n_owned,)."""
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
        function: Function on the body's own mesh, one value per cell.
        cells: Node numbers of all cells of the body, (n_cells, n_vertices).

    Returns:
        One value for every cell, (n_cells,), replicated.
    """
    space = function.function_space
    number = _cells_of_body(space.mesh, cells)
    values = np.zeros(len(cells))
    values[number] = function.x.array[_dolfinx.cell_dofs(space).ravel()[: len(number)]]
    return np.asarray(space.mesh.comm.allreduce(values))
