"""The one module that knows which dolfinx runs; everything else takes FEniCSx through it.

Forms are written once on a *template*, a `ufl.Mesh` without coordinates, compiled once, and then bound to any
number of meshes: subdomain meshes of one body differ in their numbers, never in their code.

Node numbers of meshes handed in are called *input nodes*; cells come in VTK vertex order.
"""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from mpi4py import MPI


@contextmanager
def _side_effects_undone() -> Iterator[None]:
    """Undo what importing and compiling with old releases leaves behind in the process.

    dolfinx 0.5 switches `sys.setdlopenflags` to RTLD_GLOBAL for good, after which VTK's own
    libraries clash with the system's; ffcx 0.5 configures the root logger and captures warnings.
    """
    root = logging.getLogger()
    handlers, level, setdlopenflags = list(root.handlers), root.level, sys.setdlopenflags
    showwarning = warnings.showwarning
    sys.setdlopenflags = lambda flags: None
    try:
        yield
    finally:
        sys.setdlopenflags = setdlopenflags
        root.handlers[:] = handlers
        root.setLevel(level)
        if warnings.showwarning is not showwarning:
            logging.captureWarnings(False)


with _side_effects_undone():
    import dolfinx
    import dolfinx.fem
    import dolfinx.fem.petsc
    import dolfinx.io
    import dolfinx.mesh
    from dolfinx import cpp, jit
    from dolfinx.fem import Constant, Function

__all__ = [
    "VERSION",
    "CompiledForm",
    "Constant",
    "Function",
    "assemble_csr",
    "assemble_matrix",
    "assemble_scalar",
    "assemble_vector",
    "cell_dofs",
    "cell_nodes",
    "cellwise_space",
    "coefficient",
    "displacement_space",
    "field_symbols",
    "global_dofs",
    "local_mesh",
    "match_facets",
    "nodal_space",
    "node_dofs",
    "rank_mesh",
    "scalar_space",
    "template",
    "update_coordinates",
    "write_xdmf",
]

VERSION: tuple[int, ...] = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])
_OLD = VERSION < (0, 7)

#: Vertex order of VTK -> tensor-product order of dolfinx; each permutation is its own inverse.
_VERTEX_ORDER = {"hexahedron": [0, 1, 3, 2, 4, 5, 7, 6], "tetrahedron": [0, 1, 2, 3]}
#: Vertices (tensor-product order) of the facets of the reference cell, in dolfinx's facet numbering.
_FACET_VERTICES = {
    "hexahedron": [[0, 1, 2, 3], [0, 1, 4, 5], [0, 2, 4, 6], [1, 3, 5, 7], [2, 3, 6, 7], [4, 5, 6, 7]],
    "tetrahedron": [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]],
}


def _element(cell_type: str, shape: tuple[int, ...]) -> Any:
    if not _OLD:
        import basix.ufl

        return basix.ufl.element("Lagrange", cell_type, 1, shape=shape)
    # The variant is spelt out because ffcx 0.5 rewrites coordinate elements to it while compiling: without
    # it the signature of the next process differs and misses the compilation cache.
    cell = ufl.Cell(cell_type)
    return (ufl.VectorElement if shape else ufl.FiniteElement)("Lagrange", cell, 1, variant="equispaced")


@lru_cache(maxsize=8)
def template(cell_type: str) -> Any:
    """Return the mesh without coordinates on which forms for cells of this type are written."""
    return ufl.Mesh(_element(cell_type, (3,)))


@lru_cache(maxsize=8)
def displacement_space(cell_type: str) -> Any:
    """Return the template's space of vector fields, linear (tetrahedra) or trilinear (hexahedra)."""
    return ufl.FunctionSpace(template(cell_type), _element(cell_type, (3,)))


def field_symbols(cell_type: str, count: int) -> list[Any]:
    """Return UFL coefficients on the template's `displacement_space`, to be bound to Functions later.

    They are counted from 0 in every form: ffcx 0.5 writes counts into C identifiers, which fails from ten on.
    """
    return [ufl.Coefficient(displacement_space(cell_type), count=number) for number in range(count)]


@lru_cache(maxsize=8)
def nodal_space(cell_type: str) -> Any:
    """Return the template's space of scalars, linear or trilinear."""
    return ufl.FunctionSpace(template(cell_type), _element(cell_type, ()))


@lru_cache(maxsize=8)
def cellwise_space(cell_type: str) -> Any:
    """Return the template's space of scalars that are constant on each cell."""
    return ufl.FunctionSpace(template(cell_type), _cellwise_element(cell_type))


def _cellwise_element(cell_type: str) -> Any:
    if _OLD:
        return ufl.FiniteElement("DG", ufl.Cell(cell_type), 0)
    import basix.ufl

    return basix.ufl.element("DG", cell_type, 0)


def _partitioner(destinations: Any) -> Any:
    """Send every cell to the ranks in its row of ``destinations``, the first of which owns it."""
    if _OLD:
        return lambda comm, parts, tdim, cells, ghost_mode: destinations
    return lambda comm, parts, cell_types, cells: destinations


def local_mesh(points: np.ndarray, cells: np.ndarray, cell_type: str) -> Any:
    """Build a mesh that lives on this rank alone.

    Args:
        points: Coordinates, shape (n, 3), [length].
        cells: Rows of node numbers in VTK order, shape (m, 8) or (m, 4).
        cell_type: ``"hexahedron"`` or ``"tetrahedron"``.
    """
    return _create_mesh(MPI.COMM_SELF, points, cells, cell_type, np.zeros((len(cells), 1), dtype=np.int32))


def rank_mesh(comm: MPI.Comm, points: np.ndarray, cells: np.ndarray, rank: np.ndarray, cell_type: str) -> Any:
    """Build a distributed mesh whose cells live on given ranks; a rank may have none. Collective on ``comm``.

    Args:
        comm: Communicator of the mesh.
        points: All coordinates, shape (n_nodes, 3), replicated, [length].
        cells: All cells, rows of node numbers in VTK order, replicated.
        rank: Owner of each cell, shape (n_cells,), replicated.
        cell_type: ``"hexahedron"`` or ``"tetrahedron"``.
    """
    bounds = np.linspace(0, len(points), comm.size + 1).astype(int)
    mine = np.flatnonzero(rank == comm.rank)
    destinations: Any = np.full((len(mine), 1), comm.rank, dtype=np.int32)
    if _OLD and comm.size > 1:
        destinations = _with_ghosts(cells, rank, mine, comm)
    part = points[bounds[comm.rank] : bounds[comm.rank + 1]]
    return _create_mesh(comm, part, cells[mine], cell_type, destinations)


def _with_ghosts(cells: np.ndarray, rank: np.ndarray, mine: np.ndarray, comm: MPI.Comm) -> Any:
    """Send each cell to its owner and to all ranks around it.

    dolfinx 0.5 does not find out that two ranks share a vertex unless a ghost cell tells it.
    """
    vertices = cells.shape[1]
    touching = sp.csr_matrix((np.ones(cells.size), (cells.ravel(), np.repeat(rank, vertices))))
    reached = touching[cells[mine].ravel()].tocoo()
    cell, to = np.unique([reached.row // vertices, reached.col], axis=1)
    order = np.lexsort((to, to != comm.rank, cell))  # the owner comes first
    offsets = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=len(mine)))])
    return cpp.graph.AdjacencyList_int32(to[order].astype(np.int32), offsets.astype(np.int32))


def _create_mesh(
    comm: MPI.Comm, points: np.ndarray, cells: np.ndarray, cell_type: str, destinations: Any
) -> Any:
    ordered = np.ascontiguousarray(cells[:, _VERTEX_ORDER[cell_type]], dtype=np.int64)
    points = np.ascontiguousarray(points, dtype=np.float64)
    if isinstance(destinations, np.ndarray):
        destinations = cpp.graph.AdjacencyList_int32(destinations)
    element, partitioner = _element(cell_type, (3,)), _partitioner(destinations)
    if _OLD:
        adjacency, ghost_mode = cpp.graph.AdjacencyList_int64(ordered), cpp.mesh.GhostMode.shared_facet
        return dolfinx.mesh.create_mesh(comm, adjacency, points, ufl.Mesh(element), ghost_mode, partitioner)
    return dolfinx.mesh.create_mesh(comm, cells=ordered, x=points, e=element, partitioner=partitioner)


def _space(mesh: Any, element: Any) -> Any:
    return dolfinx.fem.FunctionSpace(mesh, element) if _OLD else dolfinx.fem.functionspace(mesh, element)


def coefficient(mesh: Any, name: str) -> Any:
    """Return a vector field on ``mesh`` with the given name (a C identifier)."""
    return Function(_space(mesh, _element(mesh.topology.cell_name(), (3,))), name=name)


def scalar_space(mesh: Any, degree: int) -> Any:
    """Return the space of scalar fields of degree 0 (one value a cell) or 1 on ``mesh``."""
    cell_type = mesh.topology.cell_name()
    return _space(mesh, _element(cell_type, ()) if degree == 1 else _cellwise_element(cell_type))


def _table(adjacency: Any, rows: int) -> np.ndarray:
    flat = np.asarray(getattr(adjacency, "array", adjacency))
    # A rank without cells of a body has no rows; numpy cannot guess their length then.
    return flat.reshape(rows, flat.size // max(rows, 1))


def _cell_count(mesh: Any) -> int:
    index_map = mesh.topology.index_map(mesh.topology.dim)
    return int(index_map.size_local + index_map.num_ghosts)


def _input_nodes(mesh: Any) -> np.ndarray:
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def cell_nodes(mesh: Any) -> np.ndarray:
    """Return the input nodes of this rank's cells, tensor-product order, shape (n_cells, n_vertices)."""
    dofmap = _table(mesh.geometry.dofmap, _cell_count(mesh))
    return _input_nodes(mesh)[dofmap]


def cell_dofs(space: Any) -> np.ndarray:
    """Return the blocked dofs of this rank's cells, ghosts included, shape (n_cells, n_dofs of a cell)."""
    return _table(space.dofmap.list, _cell_count(space.mesh))


def node_dofs(space: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return (input nodes, blocked dofs): dof ``dofs[i]`` of ``space`` sits on input node ``nodes[i]``.

    Both arrays have one entry for each node of this rank, ghosts included, in ascending node order.
    """
    mesh = space.mesh
    cells = _cell_count(mesh)
    nodes = cell_nodes(mesh).ravel()
    dofs = _table(space.dofmap.list, cells).ravel()
    nodes, first = np.unique(nodes, return_index=True)
    return nodes, dofs[first]


def update_coordinates(mesh: Any, points: np.ndarray) -> None:
    """Move the nodes of ``mesh`` to ``points``, shape (n_nodes, 3), indexed by input node."""
    mesh.geometry.x[:] = points[_input_nodes(mesh)]


def match_facets(mesh: Any, surface: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the facets of ``mesh`` whose nodes form a row of ``surface``.

    Args:
        mesh: A mesh on one rank.
        surface: Facets as input nodes, shape (n_facets, 3 or 4), any vertex order.

    Returns:
        Cells and local facet numbers of those that lie on this mesh, one entry each.
    """
    cell_type = mesh.topology.cell_name()
    local = np.array(_FACET_VERTICES[cell_type])
    faces = np.sort(cell_nodes(mesh)[:, local].reshape(-1, local.shape[1]), axis=1)
    wanted = np.sort(surface, axis=1)
    # One integer key a facet: rows of both tables are numbered together.
    _, key = np.unique(np.vstack([wanted, faces]), axis=0, return_inverse=True)
    key = key.ravel()
    found = np.flatnonzero(np.isin(key[len(wanted) :], key[: len(wanted)]))
    return found // len(local), found % len(local)


class CompiledForm:
    """A UFL form on a template, compiled once, bound to many meshes."""

    def __init__(self, comm: MPI.Comm, form: Any) -> None:
        """Compile ``form``. Collective on ``comm``: one rank compiles, the others read its cache."""
        self.form = form
        with _side_effects_undone():
            build = jit.ffcx_jit if _OLD else dolfinx.fem.compile_form
            self._compiled = build(comm, form, {}, {})

    def bind(
        self,
        mesh: Any,
        spaces: Sequence[Any],
        coefficients: Mapping[Any, Any],
        constants: Mapping[Any, Any],
        facets: Mapping[int, tuple[np.ndarray, np.ndarray]] | None = None,
    ) -> Any:
        """Return the form on one mesh.

        Args:
            mesh: The mesh.
            spaces: dolfinx function spaces of the form's arguments, in their order.
            coefficients: Template coefficient -> dolfinx Function on ``mesh``.
            constants: Template constant -> dolfinx Constant.
            facets: Tag of a surface integral -> (cells, local facets), as `match_facets` returns them.
        """
        if _OLD:
            return self._bind_old(mesh, spaces, coefficients, constants, facets or {})
        tagged = sorted((facets or {}).items())
        pairs = [(tag, np.column_stack(pair).astype(np.int32).ravel()) for tag, pair in tagged]
        domains = {dolfinx.fem.IntegralType.exterior_facet: pairs} if pairs else {}
        # A symbol that dropped out of the form while UFL simplified it must not be handed over.
        functions = {symbol: coefficients[symbol] for symbol in self.form.coefficients()}
        numbers = {symbol: constants[symbol] for symbol in self.form.constants()}
        return dolfinx.fem.create_form(self._compiled, list(spaces), mesh, domains, functions, numbers)

    def _bind_old(self, mesh: Any, spaces: Any, coefficients: Any, constants: Any, facets: Any) -> Any:
        compiled, module, code = self._compiled
        mine = self.form.coefficients()
        order = [compiled.original_coefficient_position[i] for i in range(compiled.num_coefficients)]
        kinds = cpp.fem.IntegralType
        domains = dict.fromkeys((kinds.cell, kinds.exterior_facet, kinds.interior_facet, kinds.vertex))
        if facets:
            domains[kinds.exterior_facet] = _facet_tags(mesh, facets)
        bound = type("Form", (dolfinx.fem.FormMetaClass, cpp.fem.Form_float64), {})
        return bound(
            compiled,
            [space._cpp_object for space in spaces],
            [coefficients[mine[i]]._cpp_object for i in order],
            [constants[constant]._cpp_object for constant in self.form.constants()],
            domains,
            mesh._mesh,
            module.ffi,
            code,
        )


def _facet_tags(mesh: Any, facets: Mapping[int, tuple[np.ndarray, np.ndarray]]) -> Any:
    """Facet tags of dolfinx 0.5 from (cell, local facet) pairs."""
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    table = _table(mesh.topology.connectivity(tdim, tdim - 1), _cell_count(mesh))
    indices = np.concatenate([table[cells, local] for cells, local in facets.values()])
    tags = np.concatenate([np.full(len(pair[0]), tag, np.int32) for tag, pair in facets.items()])
    order = np.argsort(indices)
    return dolfinx.mesh.meshtags(mesh, tdim - 1, indices[order].astype(np.int32), tags[order])


def assemble_csr(form: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Assemble a bilinear form on one rank; return the matrix as CSR arrays (indptr, indices, data)."""
    matrix = assemble_matrix(form)
    indptr, indices, data = matrix.getValuesCSR()
    matrix.destroy()
    return indptr, indices, data


def assemble_matrix(form: Any) -> Any:
    """Assemble a bilinear form on a distributed mesh into a PETSc matrix. Collective on the mesh."""
    matrix = dolfinx.fem.petsc.assemble_matrix(form)
    matrix.assemble()
    return matrix


def global_dofs(space: Any, dofs: np.ndarray) -> np.ndarray:
    """Return the global numbers of this rank's blocked dofs, ghosts included."""
    return np.asarray(space.dofmap.index_map.local_to_global(dofs.astype(np.int32)))


def assemble_vector(form: Any) -> np.ndarray:
    """Assemble a linear form on one rank; return its values, length block size x n_dofs."""
    vector = dolfinx.fem.petsc.assemble_vector(form)
    values = np.array(vector.array_r)
    vector.destroy()
    return values


def assemble_scalar(form: Any) -> float:
    """Assemble a functional on this rank's cells (no communication)."""
    return float(dolfinx.fem.assemble_scalar(form))


def write_xdmf(path: Any, mesh: Any, functions: Sequence[Any]) -> None:
    """Write fields on one mesh to an XDMF file (with its HDF5 file). Collective on the mesh."""
    with dolfinx.io.XDMFFile(mesh.comm, str(path), "w") as file:
        file.write_mesh(mesh)
        for function in functions:
            file.write_function(function)
