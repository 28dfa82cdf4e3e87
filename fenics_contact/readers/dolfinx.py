"""Bodies from dolfinx meshes in memory and from XDMF files, by numeric tags, and the way back.

By default every cell tag is a body and every facet tag a surface, called by its number, as text. Without cell
tags the whole mesh is one body called "mesh".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from fenics_contact._base.checks import check_each, naming_arguments, require_file
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import start
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, OF_THE_FILE
from fenics_contact.mesh.plane import flattened, turned_right_handed
from fenics_contact.readers.bodies import Label, TaggedMesh, bodies_of, cells_of_bodies, labelled, other_cells

if TYPE_CHECKING:
    import dolfinx
    from mpi4py import MPI

    from fenics_contact._dolfinx import MeshArrays, TagArrays


@displayed
@dataclass(frozen=True, eq=False)
class DolfinxBodies(Mapping[str, BodyMesh]):
    """Name to body, as a read-only mapping, the same on all ranks of the mesh.

    Attributes:
        bodies: Name to body.
        cells: Name to the number of each of its cells in the order in which the mesh was created.
        nodes: Name to the number of each of its nodes, likewise.
        arrays: The mesh.
    """

    bodies: Mapping[str, BodyMesh]
    cells: Mapping[str, np.ndarray]
    nodes: Mapping[str, np.ndarray]
    arrays: MeshArrays

    def __getitem__(self, name: str) -> BodyMesh:
        """Return a body."""
        return self.bodies[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.bodies)

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.bodies)

    def _facts(self) -> dict[str, Any]:
        return {name: mesh.cells_in_words for name, mesh in self.bodies.items()}

    def function_on(
        self, space: dolfinx.fem.FunctionSpace, values: Mapping[str, np.ndarray], name: str = "f"
    ) -> dolfinx.fem.Function:
        """Return values of the bodies as a Function in a space on the mesh that they were made of.

        Example:
            ``bodies.function_on(V, {name: state.gather_displacement(name) for name in bodies})`` is the
            displacement in the caller's own dofs, ``state.stress[name]`` likewise in a space of degree 0.

        Args:
            space: Space of Lagrange elements on that mesh, of its order or higher, or of degree 0 for values
                on cells; scalar, or with as many components as there are.
            values: Name of a body to its values at nodes, (n_nodes,) or (n_nodes, k), in a space of degree 0
                on cells, (n_cells,) or (n_cells, k); the same on all ranks. Other bodies have zero.
            name: Name of the Function.

        Returns:
            The Function, ghosts included.

        Raises:
            InvalidInputError: If the space is on another mesh or of lower order, a body is not known, values
                have another shape, or two bodies have different values at a node that they share.

        Note:
            Collective on the mesh's communicator.
        """
        from fenics_contact import _dolfinx

        with together(space.mesh.comm):
            degree = self._checked_degree(space)
            per_body = self._checked_values(space, values, degree)
        found = _dolfinx.fem.Function(space, name=name)
        if degree > self.arrays.order:
            isoparametric = _dolfinx.nodal_space_on(space.mesh, int(space.dofmap.index_map_bs))
            found.interpolate(self.function_on(isoparametric, values))
            return found
        count, dofs = len(self.arrays.cell), _dolfinx.cell_dofs(space)
        nodes = self.arrays.node[_dolfinx.cell_geometry(space.mesh)]
        field = found.x.array.reshape(-1, int(space.dofmap.index_map_bs))
        for body, rows in per_body.items():
            place = np.full(len(self.arrays.cells), -1)
            place[self.cells[body]] = np.arange(len(self.cells[body]))
            mine = np.flatnonzero(place[self.arrays.cell] >= 0)
            if degree == 0:
                field[dofs[:count][mine]] = rows[place[self.arrays.cell[mine]], None]
            else:
                field[dofs[mine]] = rows[np.searchsorted(self.nodes[body], nodes[mine])]
        found.x.scatter_forward()
        return found

    def _checked_degree(self, space: dolfinx.fem.FunctionSpace) -> int:
        """Return the degree of a space; reject other elements and meshes."""
        from fenics_contact import _dolfinx

        given = np.asarray(space.mesh.geometry.input_global_indices)
        if not np.array_equal(self.arrays.inputs[self.arrays.node], given):
            raise InvalidInputError("function_on needs a space on the mesh that the bodies were made of")
        degree, order = _dolfinx.lagrange_degree(space), self.arrays.order
        if degree is None or 0 < degree < order:
            raise InvalidInputError(
                f"space must be Lagrange of degree {order} or higher, or degree 0, got {space.ufl_element()}"
            )
        return degree

    def _checked_values(
        self, space: dolfinx.fem.FunctionSpace, values: Mapping[str, np.ndarray], degree: int
    ) -> dict[str, np.ndarray]:
        """Return the values of each body as rows of the space's components."""
        size, result = int(space.dofmap.index_map_bs), {}
        numbers = self.cells if degree == 0 else self.nodes
        for body, given in values.items():
            if body not in self.bodies:
                raise InvalidInputError(f"function_on knows the bodies {list(self.bodies)}, got {body!r}")
            rows = np.asarray(given, dtype=np.float64)
            rows = rows.reshape(len(rows), -1)
            if rows.shape != (len(numbers[body]), size):
                raise InvalidInputError(
                    f"{body!r} needs values of shape ({len(numbers[body])}, {size}), got {np.shape(given)}"
                )
            result[body] = rows
        if degree > 0:
            self._check_alike(result)
        return result

    def _check_alike(self, values: Mapping[str, np.ndarray]) -> None:
        """Reject different values of two bodies at one node, which a continuous function cannot have."""
        nodes = np.concatenate([self.nodes[body] for body in values])
        rows = np.concatenate(list(values.values()))
        order = np.argsort(nodes, kind="stable")
        same = np.diff(nodes[order]) == 0
        apart = np.abs(np.diff(rows[order], axis=0)).max(axis=1, initial=0.0)[same].max(initial=0.0)
        if apart > 1e-6 * np.abs(rows).max(initial=0.0):
            raise InvalidInputError(
                f"{list(values)} share nodes, but differ by up to {apart:.3g}: bring them back one by one"
            )


_FACETS = {
    "tetrahedron": ("triangle",),
    "hexahedron": ("quadrilateral",),
    "triangle": ("polyline", "edge"),
    "quadrilateral": ("polyline", "edge"),
}
"""XDMF's names of the facets of each shape of cells."""
_KNOWN = "tetrahedra or hexahedra"
_QUADRATIC = {"tetrahedron_10", "hexahedron_27", "triangle_6", "quadrilateral_9", "edge_3"}
"""XDMF's names of quadratic cells and facets."""


@dataclass(frozen=True)
class Grid:
    """One grid.

    `topology`: XDMF's name of its cells, in lower case; `has_points`: whether it has coordinates of its own;
    `inline`: whether its data are in the file itself and not in an HDF5 file beside it.
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
    """List the grids of an XDMF file."""
    require_file(path)
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as reason:
        raise InvalidInputError(
            f"file '{path}' must be an XDMF file, it is no XML ({reason}): give the .xdmf, not the .h5 file"
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
            f"grid '{grid.name}' of file '{path}' is mixed: write cells and facets apart (facet_file=...)"
        )
    if "_" in grid.topology and grid.topology not in _QUADRATIC:  # Hexahedron_20, Hexahedron_64
        raise InvalidInputError(
            f"grid '{grid.name}' of file '{path}' is of type '{grid.topology}': {OF_THE_FILE}"
        )
    if grid.topology in ("wedge", "pyramid"):
        raise other_cells(f"grid '{grid.name}' of file '{path}'", grid.topology, _KNOWN)


def chosen_grids(
    grids: Sequence[Grid],
    name: str | None,
    argument: str,
    suits: Callable[[Grid], bool],
    path: Path,
) -> list[Grid]:
    """Return the grid of a name, or the only suitable one, if there is any."""
    suitable = [grid for grid in grids if suits(grid) and name in (None, grid.name)]
    if len(suitable) == 1:
        return suitable
    there = _listed(grids)
    if name is not None:
        raise InvalidInputError(f"file '{path}' has no grid for {argument}='{name}': it has {there}")
    if suitable:
        raise InvalidInputError(
            f"file '{path}' has several grids that could be {argument}: it has {there}; name one of them"
        )
    return []


def _listed(grids: Sequence[Grid]) -> str:
    return ", ".join(f"'{grid.name}' ({grid.topology})" for grid in grids) or "no grids at all"


Bodies = Sequence[Label] | Mapping[str, Label | Sequence[Label] | Mapping[str, Label]]
"""Tags; or body to tag, to tags that become regions, or to region to tag."""

Surfaces = Sequence[Label] | Mapping[str, Label | Sequence[Label]]
"""Tags; or surface to tag or tags."""


@naming_arguments
def read_xdmf(
    path: str | Path,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
    *,
    mesh: str | None = None,
    cell_tags: str | None = None,
    facet_tags: str | None = None,
    facet_file: str | Path | None = None,
    comm: MPI.Comm | None = None,
) -> dict[str, BodyMesh]:
    """Read bodies from an XDMF file of dolfinx or meshio.

    The mesh and its tags are grids of the file. Those of dolfinx's ``write_meshtags`` are identified by their
    cells and facets, and so is meshio's only grid, whose first cell data are the tags. Nodes and cells keep
    the file's order. Cells may be left-handed, as these files do not prescribe an orientation.

    Example:
        ``read_xdmf("press.xdmf", bodies={"tool": 1, "sheet": {"steel": 2, "copper": 3}})``

    Args:
        path: The file, beside its HDF5 file if it has one.
        bodies: Which cell tags make up which bodies: tags that are bodies; or name of the body to a tag, to
            several tags, which become its regions, or to name of the region to a tag. Every tag is a body
            unless given; ``{"beam": "mesh"}`` names the only body of a mesh without cell tags.
        surfaces: Which facet tags are surfaces: tags, or name of the surface to a tag or tags. All unless
            given.
        mesh: Name of the grid with the mesh; needed where there are several.
        cell_tags: Name of the grid with the tags of the cells; needed where there are several.
        facet_tags: Name of the grid with the tags of the facets; needed where there are several.
        facet_file: Separate file with the facets, as meshio writes them, on the same nodes.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: If a file, a grid or a tag is missing, a cell has no tag, cells are of third
            order, prisms or pyramids, or of several types, or the bodies or surfaces cannot be made of them,
            see `read_msh`.

    Note:
        Collective on ``comm`` if given.
    """
    names = (mesh, cell_tags, facet_tags)
    facets = Path(path if facet_file is None else facet_file)
    if comm is not None:
        start(comm)  # dolfinx starts PETSc, on one rank it would wait for the others
    return bodies_of(on_root_then_bcast(comm, lambda: _read(Path(path), facets, names)), bodies, surfaces)


@naming_arguments
def from_dolfinx(
    mesh: dolfinx.mesh.Mesh,
    cell_tags: dolfinx.mesh.MeshTags | None = None,
    facet_tags: dolfinx.mesh.MeshTags | None = None,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
) -> DolfinxBodies:
    """Build bodies from a dolfinx mesh, on one rank or distributed over several.

    Args:
        mesh: The mesh. One that is distributed is gathered: the bodies are the same on all its ranks.
        cell_tags: Its tags of cells, if any.
        facet_tags: Its tags of facets, if any.
        bodies: As in `read_xdmf`.
        surfaces: As in `read_xdmf`.

    Returns:
        Name to body; nodes and cells in the order in which the mesh was created from them. Its method
        `DolfinxBodies.function_on` brings values of the bodies back to the mesh.

    Raises:
        InvalidInputError: As `read_xdmf`.

    Note:
        Collective on the mesh's communicator.
    """
    from fenics_contact import _dolfinx

    arrays = _dolfinx.mesh_arrays(mesh)
    of_cells, of_facets = ([each for each in (tags,) if each is not None] for tags in (cell_tags, facet_tags))
    tagged = _tagged_mesh(mesh, arrays, of_cells, of_facets, "mesh of dolfinx")
    made, cells = bodies_of(tagged, bodies, surfaces), cells_of_bodies(tagged, bodies)
    return DolfinxBodies(
        made, cells, {name: np.unique(arrays.cells[rows]) for name, rows in cells.items()}, arrays
    )


def _read(path: Path, facet_path: Path, names: tuple[str | None, str | None, str | None]) -> TaggedMesh:
    from fenics_contact import _dolfinx

    grids = grids_of(path)
    others = grids if facet_path == path else grids_of(facet_path)
    places = chosen_grids(grids, names[0], "mesh", lambda grid: grid.is_mesh, path)
    if not places:
        raise InvalidInputError(
            f"file '{path}' must have tetrahedra, hexahedra, triangles or quadrilaterals, it has "
            f"{_listed(grids)}"
        )
    (place,) = places
    cells = chosen_grids(grids, names[1], "cell_tags", lambda grid: grid.tags_cells(place), path)
    facets = chosen_grids(others, names[2], "facet_tags", lambda grid: grid.tags_facets(place), facet_path)

    def tags(file: Path, grids: Sequence[Grid]) -> list[dolfinx.mesh.MeshTags]:
        return [_dolfinx.read_tags(file, mesh, each.name, each.inline, each.has_points) for each in grids]

    try:
        mesh = _dolfinx.read_mesh(path, place.name, place.inline)
        arrays, source = _dolfinx.mesh_arrays(mesh), f"file '{path}'"
        return _tagged_mesh(mesh, arrays, tags(path, cells), tags(facet_path, facets), source)
    except RuntimeError as reason:  # dolfinx raises no other class
        raise InvalidInputError(
            f"file '{path}' must be XDMF with its HDF5 file beside it, dolfinx says: {reason}: write it again"
        ) from reason


def _tagged_mesh(
    mesh: dolfinx.mesh.Mesh,
    arrays: MeshArrays,
    cell_tags: Sequence[dolfinx.mesh.MeshTags],
    facet_tags: Sequence[dolfinx.mesh.MeshTags],
    source: str,
) -> TaggedMesh:
    from fenics_contact import _dolfinx

    if arrays.order > 2:
        raise InvalidInputError(f"{source} has {arrays.cell_type} of order {arrays.order}: {OF_THE_FILE}")
    if arrays.cell_type not in CELL_TYPES:
        raise other_cells(source, arrays.cell_type, _KNOWN)
    points = arrays.points
    if arrays.dim == 2:
        points = flattened(points, np.unique(arrays.cells), source)
    cells = {arrays.cell_type: turned_right_handed(points, arrays.cells, source)}
    groups = _groups(arrays, [_dolfinx.tag_arrays(mesh, arrays, tags) for tags in cell_tags], source)
    facets: dict[Label, list[np.ndarray]] = {}
    for tags in facet_tags:
        tagged = _dolfinx.tag_arrays(mesh, arrays, tags)
        facets = {int(tag): [tagged.entities[tagged.values == tag]] for tag in np.unique(tagged.values)}
    return TaggedMesh(source, points, cells, groups, facets, ("cell tag", "facet tag"))


def _groups(
    arrays: MeshArrays, every: Sequence[TagArrays], source: str
) -> dict[Label, dict[str, np.ndarray]]:
    """Cells by tag; every cell has one, or all are "mesh"."""
    n_cells = arrays.cells.shape[0]
    if not every:
        return {"mesh": {arrays.cell_type: np.arange(n_cells)}}
    (tagged,) = every
    fits = np.isin(np.arange(n_cells), tagged.entities)
    check_each(fits, labelled("tag", source), "give the rest a tag of its own", "cell {}".format)
    return {
        int(tag): {arrays.cell_type: np.sort(tagged.entities[tagged.values == tag])}
        for tag in np.unique(tagged.values)
    }
