"""VTU files, one per body, gathered from all ranks, with an index that opens them together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from fenics_contact.contact import State, in_space
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.io.names import checked_name, file_of_each
from fenics_contact.io.replacing import replacing

if TYPE_CHECKING:
    import meshio

_MESHIO_NAMES = {
    "hexahedron": "hexahedron",
    "tetrahedron": "tetra",
    "quadrilateral": "quad",
    "triangle": "triangle",
    "hexahedron27": "hexahedron27",
    "quadrilateral9": "quad9",
    "triangle6": "triangle6",
    "tetrahedron10": "tetra10",
}


@collectively("write_vtu", lambda state, *_, **__: state.torn.decomposition.comm)
def write_vtu(
    state: State,
    folder: str | Path,
    name: str = "state",
    *,
    cell_fields: Mapping[str, Mapping[str, np.ndarray]] | None = None,
) -> Path:
    """Write a state for ParaView: a file for each body and a multi-block file to open. Collective.

    They hold the fields of `contact.GatheredFields`, and the given fields on cells. Plane bodies lie in the
    plane z = 0, their vectors have zero z component.

    Args:
        state: The state.
        folder: Output folder; created.
        name: Beginning of the files' names: "state" gives "state.vtm" and, for a body "link 1",
            "state_link_1.vtu". Files are replaced when the new ones are complete.
        cell_fields: Further fields: name -> body -> a number or a row for every cell, such as
            ``{"discretisation_error": {body: estimate.by_cell(body) for body in state.scene.bodies}}``.

    Returns:
        The multi-block file.

    Raises:
        InvalidInputError: If the name contains a folder, or a field lacks a body or does not fit its cells.
    """
    import meshio  # takes a tenth of a second

    index = checked_name(folder, name, ".vtm")
    more = {body: _checked(state, body, cell_fields or {}) for body in state.scene.bodies}
    meshes = {body: _gathered(state, body, more[body]) for body in state.scene.bodies}
    files = list(file_of_each(meshes, index.parent, name, ".vtu").values())
    comm = state.torn.decomposition.comm
    with together(comm):
        if comm.rank == 0:
            # The index last: when it exists, so do its files.
            with replacing(*files, index) as paths:
                for path, mesh in zip(paths, meshes.values(), strict=False):
                    meshio.write(path, mesh, file_format="vtu")
                paths[-1].write_text(_multi_block(list(meshes), files), encoding="utf-8")
    return index


def _checked(
    state: State, body: str, fields: Mapping[str, Mapping[str, np.ndarray]]
) -> dict[str, np.ndarray]:
    count, arrays = state.scene.bodies[body].mesh.n_cells, {}
    for name, values in fields.items():
        arrays[name] = np.asarray(values[body]) if body in values else np.zeros(0)
        if arrays[name].shape[:1] != (count,):
            given = f"shape {arrays[name].shape}" if body in values else "none"
            raise InvalidInputError(
                f"the cell field {name!r} must have {count} rows for body {body!r}, one per cell, got "
                f"{given}: give every body an array in the order of the cells of its mesh"
            )
    return arrays


def _gathered(state: State, body: str, more: Mapping[str, np.ndarray]) -> meshio.Mesh:
    mesh = state.scene.bodies[body].mesh
    fields = state.gather_fields(body)
    import meshio

    return meshio.Mesh(
        in_space(mesh.points),
        [(_MESHIO_NAMES[mesh.cell_type], mesh.cells)],
        point_data={key: in_space(values) for key, values in fields.points.items()},
        cell_data={key: [in_space(values)] for key, values in {**fields.cells, **more}.items()},
    )


def _multi_block(bodies: list[str], files: list[Path]) -> str:
    blocks = "".join(
        f"    <DataSet index={quoteattr(str(number))} name={quoteattr(body)} file={quoteattr(file.name)}/>\n"
        for number, (body, file) in enumerate(zip(bodies, files, strict=True))
    )
    return (
        '<?xml version="1.0"?>\n<VTKFile type="vtkMultiBlockDataSet" version="1.0">\n'
        f"  <vtkMultiBlockDataSet>\n{blocks}  </vtkMultiBlockDataSet>\n</VTKFile>\n"
    )
