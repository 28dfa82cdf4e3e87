"""Metadata of the grids of an XDMF file, without reading the data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from fenics_contact.checks import require_file
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import OF_THE_FILE

_FACETS = {
    "tetrahedron": ("triangle",),
    "hexahedron": ("quadrilateral",),
    "triangle": ("polyline", "edge"),
    "quadrilateral": ("polyline", "edge"),
}
"""XDMF's names of the facets of each shape of cells."""
_QUADRATIC = {"tetrahedron_10", "hexahedron_27", "triangle_6", "quadrilateral_9", "edge_3"}
"""XDMF's names of quadratic cells and facets."""


@dataclass(frozen=True)
class Grid:
    """One grid.

    Attributes:
        name: Its name.
        topology: XDMF's name of its cells, in lower case.
        has_points: Whether it has coordinates of its own.
        has_values: Whether it has values on its cells.
        inline: Whether its data are in the file itself and not in an HDF5 file beside it.
    """

    name: str
    topology: str
    has_points: bool
    has_values: bool
    inline: bool

    @property
    def shape(self) -> str:
        """XDMF's name of linear cells of the same shape."""
        return self.topology.partition("_")[0]

    @property
    def is_mesh(self) -> bool:
        """Whether it is a mesh of solids or plane bodies."""
        return self.has_points and self.shape in _FACETS

    def tags_cells(self, mesh: Grid) -> bool:
        """Whether its values are tags of the cells of a mesh."""
        return self.has_values and self.shape == mesh.shape

    def tags_facets(self, mesh: Grid) -> bool:
        """Whether its values are tags of the facets of a mesh."""
        return self.has_values and self.shape in _FACETS[mesh.shape]


def grids_of(path: Path) -> list[Grid]:
    """List the grids of an XDMF file.

    Raises:
        InvalidInputError: If the file is missing, is not an XDMF file, or its cells are not linear or
            complete quadratic ones of one type.
    """
    require_file(path)
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as reason:
        raise InvalidInputError(
            f"file '{path}' must be an XDMF file, it is no XML ({reason}): give the .xdmf file, not "
            f"the .h5 file"
        ) from reason
    grids = []
    for node in root.findall("Domain/Grid"):
        topology = node.find("Topology")
        if topology is not None:
            grids.append(_grid(node, topology))
    for grid in grids:
        _check_topology(grid, path)
    return grids


def _grid(node: ElementTree.Element, topology: ElementTree.Element) -> Grid:
    formats = {item.get("Format", "XML").upper() for item in node.iter("DataItem")}
    centres = {attribute.get("Center") for attribute in node.findall("Attribute")}
    return Grid(
        name=node.get("Name", ""),
        topology=topology.get("TopologyType", topology.get("Type", "")).lower(),
        has_points=node.find("Geometry") is not None,
        has_values="Cell" in centres,
        inline="HDF" not in formats,
    )


def _check_topology(grid: Grid, path: Path) -> None:
    if grid.topology == "mixed":
        raise InvalidInputError(
            f"a body must have cells of one type, grid '{grid.name}' of file '{path}' is mixed: write "
            f"cells and "
            "facets to files of their own (facet_file=...), and cells of one type only"
        )
    if "_" in grid.topology and grid.topology not in _QUADRATIC:  # Hexahedron_20, Hexahedron_64
        raise InvalidInputError(
            f"grid '{grid.name}' of file '{path}' is of type '{grid.topology}': {OF_THE_FILE}"
        )
    if grid.topology in ("wedge", "pyramid"):
        raise InvalidInputError(
            f"cells must be tetrahedra or hexahedra, grid '{grid.name}' of file '{path}' is of type "
            f"'{grid.topology}': mesh it without prisms and pyramids"
        )


def chosen_grid(
    grids: Sequence[Grid],
    name: str | None,
    argument: str,
    suits: Callable[[Grid], bool],
    path: Path,
    optional: bool = False,
) -> Grid | None:
    """Return the grid of a name, or the only suitable one.

    Args:
        grids: The grids of the file.
        name: Its name, or None.
        argument: Its name among the caller's arguments.
        suits: Whether a grid is suitable.
        path: The file, for messages.
        optional: Whether there may be none.

    Raises:
        InvalidInputError: If there is no such grid, or there are several and none is named.
    """
    suitable = [grid for grid in grids if suits(grid) and name in (None, grid.name)]
    if len(suitable) == 1:
        return suitable[0]
    there = ", ".join(f"'{grid.name}' ({grid.topology})" for grid in grids) or "no grids at all"
    if name is not None:
        raise InvalidInputError(f"file '{path}' has no grid for {argument}='{name}': it has {there}")
    if suitable:
        raise InvalidInputError(
            f"file '{path}' has several grids that could be {argument}: it has {there}; name one of them"
        )
    if not optional:
        raise InvalidInputError(
            f"file '{path}' must have a mesh of tetrahedra, hexahedra, triangles or quadrilaterals: "
            f"it has {there}"
        )
    return None
