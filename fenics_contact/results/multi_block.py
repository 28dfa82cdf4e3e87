"""A state as pyvista's MultiBlock: one block per body, the same on all ranks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError, MissingRequirementError, together
from fenics_contact.mesh.hanging import HangingNodes
from fenics_contact.results.fields import GatheredFields, in_space

if TYPE_CHECKING:
    import pyvista
    from mpi4py import MPI

    from fenics_contact.mesh.body_mesh import BodyMesh


#: VTK's names of the cell types; their nodes are in VTK's order.
_VTK_NAMES = {
    "hexahedron": "HEXAHEDRON",
    "tetrahedron": "TETRA",
    "quadrilateral": "QUAD",
    "triangle": "TRIANGLE",
    "hexahedron27": "TRIQUADRATIC_HEXAHEDRON",
    "quadrilateral9": "BIQUADRATIC_QUAD",
    "triangle6": "QUADRATIC_TRIANGLE",
    "tetrahedron10": "QUADRATIC_TETRA",
}


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
        points = in_space(whole.points) + deformed * in_space(fields.points["displacement"])
        mesh = whole.linear if linear else whole
        grid = body_grid(mesh, points)
        for key, values in fields.points.items():
            grid.point_data[key] = in_space(values)
        for key, values in fields.cells.items():
            grid.cell_data[key] = np.repeat(values, mesh.n_cells // whole.n_cells, axis=0)
        blocks[name] = grid
    return blocks


def body_grid(mesh: BodyMesh, points: np.ndarray) -> pyvista.UnstructuredGrid:
    """Return the cells of a body on points in space, (n_nodes, 3), as pyvista's UnstructuredGrid.

    If nodes hang, it has their numbers and their masters as fields of its own, ``hanging_nodes``, (n,), and
    ``hanging_masters``, (n, 2 | 4).
    """
    pv = _pyvista()
    grid = pv.UnstructuredGrid({pv.CellType[_VTK_NAMES[mesh.cell_type]]: mesh.cells}, points)
    if mesh.hanging is not None:
        grid.field_data["hanging_nodes"] = mesh.hanging.nodes
        grid.field_data["hanging_masters"] = mesh.hanging.masters
    return grid


def hanging_of(grid: pyvista.DataSet) -> HangingNodes | None:
    """Return the hanging nodes of a body on a grid from `body_grid`, levels left out; None without any."""
    if "hanging_nodes" not in grid.field_data:
        return None
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
