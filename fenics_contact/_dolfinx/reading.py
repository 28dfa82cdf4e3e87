"""Meshes of dolfinx, from files or in memory, as plain arrays; imported only for that."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._dolfinx.cells import NODE_ORDER, cell_type_named, facet_vertices
from fenics_contact._dolfinx.loading import cpp, dolfinx, old
from fenics_contact._dolfinx.numbering import cell_geometry, geometry_degree
from fenics_contact.errors import InvalidInputError

__all__ = ["MeshArrays", "TagArrays", "mesh_arrays", "read_mesh", "read_tags", "tag_arrays"]


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """A mesh, the same on all ranks of its communicator but for what is on this rank.

    `cell_type`: type of the cells; dolfinx's name if bodies cannot have them; `points`: coordinates, in the
    order of dolfinx's input; `inputs`: dolfinx's number of each of them in its input, ascending; `cells`:
    node numbers, in the order of dolfinx's input; nodes of cells that bodies can have in VTK order; `node`:
    number of every node of this rank's geometry among ``points``; `cell`: number of every cell that this rank
    owns among ``cells``.
    """

    cell_type: str
    dim: int
    points: np.ndarray
    inputs: np.ndarray
    cells: np.ndarray
    order: int
    node: np.ndarray
    cell: np.ndarray


@dataclass(frozen=True, eq=False)
class TagArrays:
    """Tags on cells or facets of one mesh.

    `entities`: cell numbers, or node numbers of facets in any order.
    """

    entities: np.ndarray
    values: np.ndarray


def read_mesh(path: Path, name: str, inline: bool) -> dolfinx.mesh.Mesh:
    """Read a grid of an XDMF file on this rank only.

    `inline`: whether the data are in the file itself and not in an HDF5 file beside it. A node that belongs
    to no cell is refused: dolfinx 0.5 would end the whole process.
    """
    with _opened(path, inline) as file:
        n_nodes = len(file.read_geometry_data(name, "/Xdmf/Domain"))
        used = np.unique(file.read_topology_data(name, "/Xdmf/Domain"))
        unused = np.setdiff1d(np.arange(n_nodes), used)
        if unused.size:
            raise InvalidInputError(
                f"every node must belong to a cell, {unused.size} of {n_nodes} in grid '{name}' of file "
                f"'{path}' do not, first node {unused[0]}: remove them (meshio: mesh.remove_orphaned_nodes())"
            )
        return file.read_mesh(name=name)


def read_tags(
    path: Path, mesh: dolfinx.mesh.Mesh, name: str, inline: bool, own_points: bool
) -> dolfinx.mesh.MeshTags:
    """Read the first attribute of a grid of an XDMF file as tags on ``mesh``."""
    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim - 1, tdim)
    with _opened(path, inline) as file:
        if own_points:
            _check_points(mesh, file.read_geometry_data(name, "/Xdmf/Domain"), path)
        tagged = len(file.read_topology_data(name, "/Xdmf/Domain"))
        tags = file.read_meshtags(mesh, name=name)
    if len(tags.indices) != tagged:
        raise InvalidInputError(
            f"tags must be on cells or facets of the mesh, {tagged - len(tags.indices)} of {tagged} in grid "
            f"'{name}' of file '{path}' are on none: write both files from one mesh, with all its nodes"
        )
    return tags


def _check_points(mesh: dolfinx.mesh.Mesh, points: np.ndarray, path: Path) -> None:
    """Reject tags on other nodes, which would be mistaken for those with the same numbers."""
    own = np.empty((len(mesh.geometry.x), mesh.geometry.dim))
    own[mesh.geometry.input_global_indices] = mesh.geometry.x[:, : mesh.geometry.dim]
    if own.shape != points.shape or not np.allclose(own, points, rtol=0.0, atol=1e-8 * np.abs(own).max()):
        raise InvalidInputError(
            f"the facets of file '{path}' must be on the nodes of the mesh, they are on {len(points)} nodes "
            f"of their own, the mesh has {len(own)}: write both files with all nodes, in the same order"
        )


def _opened(path: Path, inline: bool) -> dolfinx.io.XDMFFile:
    kind = dolfinx.io.XDMFFile
    encoding = kind.Encoding.ASCII if inline else kind.Encoding.HDF5
    return kind(MPI.COMM_SELF, str(path), "r", encoding)


def mesh_arrays(mesh: dolfinx.mesh.Mesh) -> MeshArrays:
    """Extract the arrays of a mesh, of a distributed one on all its ranks. Collective on its communicator."""
    topology, geometry = mesh.topology, mesh.geometry
    owned, name = topology.index_map(topology.dim).size_local, topology.cell_name()
    given = np.asarray(geometry.input_global_indices, dtype=np.int64)
    inputs, first = np.unique(_from_all(mesh, given), return_index=True)
    points = _from_all(mesh, np.asarray(geometry.x)[:, : geometry.dim])[first]
    node = np.searchsorted(inputs, given)
    original = np.asarray(topology.original_cell_index[:owned], dtype=np.int64)
    every, place = np.unique(_from_all(mesh, original), return_index=True)
    order = geometry_degree(mesh)
    kind = cell_type_named(name, order)
    cells = _from_all(mesh, node[cell_geometry(mesh)[:owned]])[place]
    if kind in NODE_ORDER:
        cells = cells[:, np.argsort(NODE_ORDER[kind])]
    cell = np.searchsorted(every, original)
    return MeshArrays(kind, topology.dim, points, inputs, cells, order, node, cell)


def _from_all(mesh: dolfinx.mesh.Mesh, rows: np.ndarray) -> np.ndarray:
    """Return the rows of all ranks one after another; a rank without rows takes part. Collective."""
    if mesh.comm.size == 1:
        return rows
    parts = [part for part in mesh.comm.allgather(rows) if len(part)]
    return np.concatenate(parts) if parts else rows


def tag_arrays(mesh: dolfinx.mesh.Mesh, arrays: MeshArrays, tags: dolfinx.mesh.MeshTags) -> TagArrays:
    """Extract the arrays of tags on the cells or facets of a mesh. Collective on its communicator."""
    indices, values = np.asarray(tags.indices, dtype=np.int32), np.asarray(tags.values)
    if tags.dim == arrays.dim:
        mine = indices < len(arrays.cell)
        return TagArrays(_from_all(mesh, arrays.cell[indices[mine]]), _from_all(mesh, values[mine]))
    topology = mesh.topology
    topology.create_connectivity(tags.dim, arrays.dim)
    topology.create_connectivity(arrays.dim, tags.dim)
    core = mesh._mesh if old() else mesh._cpp_object
    corners = len(facet_vertices(arrays.cell_type)[0])  # before the other nodes of quadratic facets
    facets: np.ndarray = np.empty((0, corners), dtype=np.int64)
    if len(indices):  # of no facets dolfinx 0.9 divides by their number
        rows = np.asarray(cpp.mesh.entities_to_geometry(core, tags.dim, indices, False))
        facets = arrays.node[rows.reshape(len(indices), -1)][:, :corners]
    facets, values = _from_all(mesh, facets), _from_all(mesh, values)
    if mesh.comm.size > 1:  # a facet between two ranks may have its tag on both
        _, first = np.unique(np.column_stack([np.sort(facets, axis=1), values]), axis=0, return_index=True)
        facets, values = facets[first], values[first]
    return TagArrays(facets, values)
