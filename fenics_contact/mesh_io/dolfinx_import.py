"""Bodies from XDMF files and from dolfinx meshes in memory, by numeric tags.

By default every cell tag is a body and every facet tag a surface, called by its number, as text. Without cell
tags the whole mesh is one body called "mesh".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._libraries import start
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh import CELL_TYPES, OF_THE_FILE, BodyMesh, flattened, turned_right_handed
from fenics_contact.mesh_io.bodies import bodies_of, cells_of_bodies
from fenics_contact.mesh_io.dolfinx_bodies import DolfinxBodies
from fenics_contact.mesh_io.tagged_mesh import Label, TaggedMesh
from fenics_contact.mesh_io.xdmf_grids import Grid, chosen_grid, grids_of

if TYPE_CHECKING:
    import dolfinx
    from mpi4py import MPI

    from fenics_contact._dolfinx import MeshArrays, TagArrays

Bodies = Sequence[Label] | Mapping[str, Label | Sequence[Label] | Mapping[str, Label]]
"""Tags; or body to tag, to tags that become regions, or to region to tag."""

Surfaces = Sequence[Label] | Mapping[str, Label | Sequence[Label]]
"""Tags; or surface to tag or tags."""


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
    if comm is None:
        return bodies_of(_read(Path(path), facets, names), bodies, surfaces)
    read = None
    start(comm)  # dolfinx starts PETSc, on one rank it would wait for the others
    with together(comm):
        read = _read(Path(path), facets, names) if comm.rank == 0 else None
    return bodies_of(comm.bcast(read, root=0), bodies, surfaces)


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
    tagged = _tagged_mesh(mesh, arrays, cell_tags, facet_tags, "mesh of dolfinx")
    made, cells = bodies_of(tagged, bodies, surfaces), cells_of_bodies(tagged, bodies)
    return DolfinxBodies(
        made, cells, {name: np.unique(arrays.cells[rows]) for name, rows in cells.items()}, arrays
    )


def _read(path: Path, facet_path: Path, names: tuple[str | None, str | None, str | None]) -> TaggedMesh:
    from fenics_contact import _dolfinx

    grids = grids_of(path)
    others = grids if facet_path == path else grids_of(facet_path)
    place = chosen_grid(grids, names[0], "mesh", lambda grid: grid.is_mesh, path)
    assert place is not None
    cells = chosen_grid(grids, names[1], "cell_tags", lambda grid: grid.tags_cells(place), path, True)
    facets = chosen_grid(
        others, names[2], "facet_tags", lambda grid: grid.tags_facets(place), facet_path, True
    )

    def tags(file: Path, grid: Grid | None) -> dolfinx.mesh.MeshTags | None:
        return (
            None if grid is None else _dolfinx.read_tags(file, mesh, grid.name, grid.inline, grid.has_points)
        )

    try:
        mesh = _dolfinx.read_mesh(path, place.name, place.inline)
        arrays, source = _dolfinx.mesh_arrays(mesh), f"file '{path}'"
        return _tagged_mesh(mesh, arrays, tags(path, cells), tags(facet_path, facets), source)
    except RuntimeError as reason:  # dolfinx raises no other class
        raise InvalidInputError(
            f"file '{path}' must be an XDMF file that dolfinx can read, with its HDF5 file beside it, "
            f"dolfinx says: "
            f"{reason}: write it again"
        ) from reason


def _tagged_mesh(
    mesh: dolfinx.mesh.Mesh,
    arrays: MeshArrays,
    cell_tags: dolfinx.mesh.MeshTags | None,
    facet_tags: dolfinx.mesh.MeshTags | None,
    source: str,
) -> TaggedMesh:
    from fenics_contact import _dolfinx

    if arrays.order > 2:
        raise InvalidInputError(
            f"{source} has cells of type '{arrays.cell_type}' of order {arrays.order}: {OF_THE_FILE}"
        )
    if arrays.cell_type not in CELL_TYPES:
        raise InvalidInputError(
            f"cells must be tetrahedra or hexahedra (in two dimensions triangles or quadrilaterals), "
            f"{source} has "
            f"cells of type '{arrays.cell_type}': mesh it with others"
        )
    points = arrays.points
    if arrays.dim == 2:
        points = flattened(points, np.unique(arrays.cells), source)
    cells = {arrays.cell_type: turned_right_handed(points, arrays.cells, source)}
    groups = _groups(
        arrays, None if cell_tags is None else _dolfinx.tag_arrays(mesh, arrays, cell_tags), source
    )
    facets: dict[Label, list[np.ndarray]] = {}
    if facet_tags is not None:
        tagged = _dolfinx.tag_arrays(mesh, arrays, facet_tags)
        facets = {int(tag): [tagged.entities[tagged.values == tag]] for tag in np.unique(tagged.values)}
    return TaggedMesh(source, points, cells, groups, facets, ("cell tag", "facet tag"))


def _groups(arrays: MeshArrays, tagged: TagArrays | None, source: str) -> dict[Label, dict[str, np.ndarray]]:
    """Cells by tag; every cell has one, or all are "mesh"."""
    n_cells = arrays.cells.shape[0]
    if tagged is None:
        return {"mesh": {arrays.cell_type: np.arange(n_cells)}}
    left = np.setdiff1d(np.arange(n_cells), tagged.entities)
    if left.size:
        raise InvalidInputError(
            f"every cell must have a tag, which says what body it is, {left.size} of {n_cells} cells "
            f"of {source} "
            f"have none, first cell {left[0]}: give the rest a tag of its own"
        )
    return {
        int(tag): {arrays.cell_type: np.sort(tagged.entities[tagged.values == tag])}
        for tag in np.unique(tagged.values)
    }
