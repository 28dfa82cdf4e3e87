"""The mesh of one body: coordinates, cells, named surfaces; checked once, then passed around as a value."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fenics_contact.geometry import quality
from fenics_contact.geometry.validation import (
    check_jacobians,
    checked_cells,
    checked_grid,
    checked_points,
    checked_surfaces,
)


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """Hexahedra or tetrahedra of one body, replicated on all ranks.

    The arrays are copied and made read-only; a body that moves is a new value, see `moved`.

    Attributes:
        points: Coordinates, (n_nodes, 3) float64, in the scene's unit of length.
        cells: Node numbers, (n_cells, 8) for hexahedra or (n_cells, 4) for tetrahedra, int64, vertices in
            the order of VTK and gmsh, Jacobian positive.
        surfaces: Name to facets, (n_facets, 4 | 3) int64 node numbers in cyclic order, the right-hand
            normal pointing out of the body.
        grid: Structured index of every cell, (n_cells, 3) int64, or None. The tetrahedra that a hexahedron
            was split into share its index.

    Raises:
        InvalidInputError: If an array has the wrong shape or type, a coordinate is not finite, a node
            number is out of range or unused, a cell is inverted, or a facet is not an outward boundary face.
    """

    points: np.ndarray
    cells: np.ndarray
    surfaces: Mapping[str, np.ndarray] = field(default_factory=dict)
    grid: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check everything, cheap things first."""
        points = checked_points(self.points)
        cells = checked_cells(self.cells, points.shape[0])
        check_jacobians(
            points, cells, "list the vertices of the cells in VTK order and check the coordinates"
        )
        self._set(
            points=points,
            cells=cells,
            surfaces=checked_surfaces(self.surfaces, cells, points.shape[0]),
            grid=checked_grid(self.grid, cells.shape[0]),
        )

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def cell_type(self) -> str:
        """``"hexahedron"`` or ``"tetrahedron"``."""
        return "hexahedron" if self.cells.shape[1] == 8 else "tetrahedron"

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return int(self.points.shape[0])

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(self.cells.shape[0])

    @property
    def volume(self) -> float:
        """Volume of the body, exact for its trilinear or linear cells."""
        return quality.volume(self.points, self.cells)

    def moved(self, points: np.ndarray) -> BodyMesh:
        """Return the same mesh at new coordinates.

        Cells, surfaces and grid are shared with this mesh and not checked again.

        Args:
            points: New coordinates, (n_nodes, 3).

        Returns:
            The moved mesh.

        Raises:
            InvalidInputError: If the shape is wrong, a coordinate is not finite or a cell is inverted.
        """
        new_points = checked_points(points, self.points.shape)
        check_jacobians(
            new_points,
            self.cells,
            "move the nodes less, spread the motion over more cells, or coarsen the mesh there",
        )
        result = copy(self)
        result._set(points=new_points)
        return result
