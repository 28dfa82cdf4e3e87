"""Sections of bodies of revolution turned around their axis, with their fields, to be looked at in space."""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.results.fields import COMPONENTS, components_of, tensors

if TYPE_CHECKING:
    import pyvista

#: Cells of a section -> cells between two of them.
_SWEPT = {"TRIANGLE": "WEDGE", "QUAD": "HEXAHEDRON"}


def check_turned(angle: float, axisymmetric: bool) -> None:
    """Reject an angle that sections cannot be turned by."""
    if not (axisymmetric and 0.0 < angle <= 360.0):
        raise InvalidInputError(
            "revolved must be an angle above 0 and up to 360 degrees, of bodies of revolution, got "
            f"{angle!r}{'' if axisymmetric else ' for other bodies'}: give it, or leave it out"
        )


def turned_around(
    grid: pyvista.UnstructuredGrid, angle: float, step: float = 5.0
) -> pyvista.UnstructuredGrid:
    """Return the cells between a section and copies of it, turned around the axis, which becomes that of z.

    Fields with three values are vectors and those with six stresses, of the radius, the axis and the way
    around it; others stay as they are. `step`: largest angle between two copies, in degrees.
    """
    import pyvista as pv  # as `multi_block` does

    (kind,) = {pv.CellType(int(number)).name for number in np.unique(grid.celltypes)}
    cells = grid.cells_dict[pv.CellType[kind]]
    count, n = ceil(angle / step), grid.n_points
    angles = np.radians(np.linspace(0.0, angle, count + 1))
    layers = n * np.arange(count)[:, None, None]
    ends = [cells + layers, cells + layers + n]
    points = np.concatenate([_turned(grid.points, turn) for turn in angles])

    def between(*ends: np.ndarray) -> pyvista.UnstructuredGrid:
        swept = np.concatenate(ends, axis=2).reshape(-1, 2 * cells.shape[1])
        return pv.UnstructuredGrid({pv.CellType[_SWEPT[kind]]: swept}, points)

    # The normal of the first face of VTK's hexahedra points inwards, that of its wedges outwards up to 9.3.
    solid = between(*ends[::-1])
    if solid.volume < 0.0:
        solid = between(*ends)
    middles = (angles[1:] + angles[:-1]) / 2
    for name in grid.point_data:
        solid.point_data[name] = np.concatenate([_field(name, grid.point_data[name], t) for t in angles])
    for name in grid.cell_data:
        solid.cell_data[name] = np.concatenate([_field(name, grid.cell_data[name], t) for t in middles])
    return solid


def _field(name: str, values: np.ndarray, turn: float) -> np.ndarray:
    """Return a field of the section on a copy of it."""
    values = np.asarray(values)
    if values.ndim == 1 or "principal" in name:
        return values
    if values.shape[1] == len(COMPONENTS):
        basis = _basis(turn)
        return components_of(basis @ tensors(values) @ basis.T)
    return _turned(values, turn)


def _turned(vectors: np.ndarray, turn: float) -> np.ndarray:
    """Return vectors of the section, (n, 3), in space."""
    return np.asarray(vectors @ _basis(turn).T)


def _basis(turn: float) -> np.ndarray:
    """Return the directions of the radius, the axis and the way around it as columns."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, 0.0, -s], [s, 0.0, c], [0.0, 1.0, 0.0]])
