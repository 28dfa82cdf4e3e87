"""A state as pyvista's MultiBlock: one block per body, the same on all ranks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError, MissingRequirementError, together
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.mesh.collapsed import SHAPES, by_shape
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes
from fenics_contact.results.fields import GatheredFields, in_space

if TYPE_CHECKING:
    import pyvista
    from mpi4py import MPI

    from fenics_contact.mesh.body_mesh import BodyMesh


#: Of shapes of cells, VTK's number and the number of nodes that it has, by order.
_VTK_SHAPES = {
    "triangle": ((5, 3), (22, 6)), "quadrilateral": ((9, 4), (28, 9)), "tetrahedron": ((10, 4), (24, 10)),
    "pyramid": ((14, 5), (27, 13)), "prism": ((13, 6), (26, 15)), "hexahedron": ((12, 8), (29, 27)),
}  # fmt: skip


def multi_block(
    comm: MPI.Comm,
    meshes: Mapping[str, BodyMesh],
    gather: Callable[[str], GatheredFields],
    deformed: float,
    *,
    linear: bool,
) -> pyvista.MultiBlock:
    """Return the result of `State.to_pyvista` from meshes and a function that gathers fields. Collective."""
    with together(comm):
        pv = _pyvista()
    if not np.isfinite(deformed):
        raise InvalidInputError(
            f"deformed must be finite, got {deformed}: give the factor of the displacement, such as 1"
        )
    blocks = pv.MultiBlock()
    for name, whole in meshes.items():
        fields = gather(name)
        moved = fields.points.get("displacement", np.zeros(whole.points.shape))
        points = in_space(whole.points) + deformed * in_space(moved)
        mesh = whole.linear if linear else whole
        grid = body_grid(mesh, points, by_shapes=not linear)
        for key, values in fields.points.items():
            grid.point_data[key] = in_space(values)
        for key, values in fields.cells.items():
            grid.cell_data[key] = in_space(values[whole.cells_cut] if linear else values)
        blocks[name] = grid
    return blocks


def body_grid(mesh: BodyMesh, points: np.ndarray, *, by_shapes: bool = False) -> pyvista.UnstructuredGrid:
    """Return the cells of a body on points in space as pyvista's UnstructuredGrid.

    Cells of several shapes are hexahedra (quadrilaterals) some of whose nodes coincide, unless `by_shapes`.
    If nodes hang, it has their numbers and their masters as fields of its own, ``hanging_nodes`` and
    ``hanging_masters``, (n, 2 | 4).
    """
    pv = _pyvista()
    if by_shapes and mesh.has_several_shapes:
        return _grid_of_shapes(mesh, points)
    kind = _VTK_SHAPES[CELL_TYPES[mesh.cell_type].shape_name][mesh.order - 1][0]
    grid = pv.UnstructuredGrid({pv.CellType(kind): mesh.cells}, points)
    if mesh.hanging:
        grid.field_data["hanging_nodes"] = mesh.hanging.nodes
        grid.field_data["hanging_masters"] = mesh.hanging.masters
    return grid


def vtk_nodes(shape: str, count: int) -> np.ndarray:
    """Return the nodes of a cell in the order of VTK, whose prisms begin with an outward triangle."""
    return SHAPES[shape].mirror(count) if shape == "prism" else np.arange(count)


def _grid_of_shapes(mesh: BodyMesh, points: np.ndarray) -> pyvista.UnstructuredGrid:
    found = by_shape(mesh.cells, mesh.dim)
    kinds = {name: _VTK_SHAPES[name][mesh.order - 1] for name in found}
    types, counts = np.empty((2, mesh.n_cells), dtype=np.int64)
    for name, (mine, _) in found.items():
        types[mine], counts[mine] = kinds[name]
    starts = np.concatenate([[0], np.cumsum(counts + 1)])
    flat = np.empty(starts[-1], dtype=np.int64)
    flat[starts[:-1]] = counts
    for name, (mine, own) in found.items():
        width = kinds[name][1]
        flat[starts[mine][:, None] + 1 + np.arange(width)] = own[:, vtk_nodes(name, width)]
    return _pyvista().UnstructuredGrid(flat, types, points)


def hanging_of(grid: pyvista.DataSet) -> HangingNodes:
    """Return the hanging nodes of a body on a grid from `body_grid`, levels left out."""
    if "hanging_nodes" not in grid.field_data:
        return NO_HANGING
    nodes, masters = (np.asarray(grid.field_data[f"hanging_{key}"]) for key in ("nodes", "masters"))
    return HangingNodes(nodes, masters, np.zeros(grid.n_cells, dtype=np.int64))


def _pyvista() -> ModuleType:
    try:
        import pyvista
    except ImportError as error:
        raise MissingRequirementError(
            f"to_pyvista needs pyvista, got {error}: pip install 'fenics_contact[viz]'",
            name="pyvista",
        ) from error
    return pyvista
