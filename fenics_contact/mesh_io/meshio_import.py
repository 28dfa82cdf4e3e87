"""Bodies from every mesh file that meshio reads: Abaqus, Nastran, VTK, Exodus, MED, Medit and others.

Labels of cells become bodies, labels of facets and nodes become surfaces: cell sets by name, tags (numbers,
by their names in the file if any), node sets. `read_msh` reads gmsh's files and `read_xdmf` those of dolfinx;
`read_mesh` delegates to them.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fenics_contact.checks import require_file
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh import BodyMesh
from fenics_contact.mesh_io.abaqus_sets import with_element_sets
from fenics_contact.mesh_io.bodies import bodies_of
from fenics_contact.mesh_io.dolfinx_import import Bodies, Surfaces, read_xdmf
from fenics_contact.mesh_io.gmsh_import import read_msh
from fenics_contact.mesh_io.meshio_cells import cells_of
from fenics_contact.mesh_io.meshio_labels import labels_of
from fenics_contact.mesh_io.tagged_mesh import TaggedMesh

if TYPE_CHECKING:
    import meshio
    from mpi4py import MPI


def read_mesh(
    path: str | Path,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
    *,
    labels: str | None = None,
    corners_only: bool = False,
    file_format: str | None = None,
    comm: MPI.Comm | None = None,
) -> dict[str, BodyMesh]:
    """Read bodies from a mesh file of any format that meshio supports.

    By default every cell set (or tag) of the file is a body of that name, and every set (or tag) of facets
    and every set of nodes a surface of each body on whose boundary it lies. Each body has its own nodes.
    Nodes without a cell are dropped, cells with negative volume reversed. Coordinates stay in the file's unit
    of length; ``mesh.moved(1e3 * mesh.points)`` converts metres to millimetres.

    Quadratic cells stay quadratic: tetrahedra of 10 nodes, hexahedra of 20 or 27, in the plane
    quadrilaterals of 8 or 9 and triangles of 6; whatever order a format lists midpoints in. Missing nodes of
    27 or 9 are added without changing the geometry.

    Example:
        ``read_mesh("press.inp")`` makes a body of every element set. ``read_mesh("press.vtu",
        bodies={"tool": 1, "sheet": {"steel": 2, "copper": 3}}, labels="material")`` takes the bodies from the
        cell data "material"; ``labels="pieces"`` makes a body of every connected piece, "piece 1" and so on.

    Args:
        path: The file. Files of gmsh go to `read_msh`, XDMF files to `read_xdmf`.
        bodies: The labels of each body: labels that are bodies; or name of the body to a label, to several,
            which become its regions, or to name of the region to a label. Every label is a body unless given.
        surfaces: Which labels are surfaces: labels, or name of the surface to a label or several. All unless
            given.
        labels: What groups the cells: ``"sets"``, ``"blocks"``, ``"pieces"``, or the name of cell data with
            integers. Unless given: cell sets where there are any, else the only integer cell data, else the
            whole mesh is one body "mesh".
        corners_only: Drop all nodes but the corners of quadratic cells.
        file_format: Name of meshio's format, if the file's suffix does not determine it.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: If the file is missing or cannot be read, a label does not exist, a cell has none
            or several, cells are prisms, pyramids, or of several types in one body, are
            degenerate or disconnected, or a surface lies inside a body.

    Note:
        Collective on ``comm`` if given.
    """
    path = Path(path)
    other = None if file_format or corners_only else _other_reader(path, labels)
    if other is not None:
        return other(path, bodies, surfaces, comm=comm)
    how = partial(_tagged, labels=labels, corners_only=corners_only, everything=bodies is None)
    if comm is None:
        return bodies_of(_read(path, how, file_format), bodies, surfaces)
    read = None
    with together(comm):
        read = _read(path, how, file_format) if comm.rank == 0 else None
    return bodies_of(comm.bcast(read, root=0), bodies, surfaces)


def from_meshio(
    mesh: meshio.Mesh,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
    *,
    labels: str | None = None,
    corners_only: bool = False,
) -> dict[str, BodyMesh]:
    """Build bodies from a meshio mesh, on every rank from its own.

    Example:
        ``from_meshio(meshio.read("press.vtu"), {"tool": 1, "table": 2})``

    Args:
        mesh: The mesh; not changed.
        bodies: As in `read_mesh`.
        surfaces: As in `read_mesh`.
        labels: As in `read_mesh`.
        corners_only: As in `read_mesh`.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: As `read_mesh`.
    """
    tagged = _tagged(mesh, "the mesh of meshio", labels, corners_only, everything=bodies is None)
    return bodies_of(tagged, bodies, surfaces)


def _other_reader(path: Path, labels: str | None) -> Callable[..., dict[str, BodyMesh]] | None:
    """Return the reader of gmsh's or dolfinx's own files, by the suffix only."""
    ending = path.suffix.lower()
    if ending == ".msh" and labels is None:
        return read_msh
    if ending in (".xdmf", ".xmf") and labels not in ("sets", "blocks", "pieces"):
        return partial(read_xdmf, cell_tags=labels)
    return None


def _read(path: Path, tagged: Callable[..., TaggedMesh], file_format: str | None) -> TaggedMesh:
    return tagged(with_element_sets(read_with_meshio(path, file_format), path), f"file '{path}'")


def read_with_meshio(path: Path, file_format: str | None = None) -> meshio.Mesh:
    """Read a file as meshio does, by its format or its ending.

    Raises:
        InvalidInputError: If it is missing, of unknown format, or cannot be read.
    """
    require_file(path)
    import meshio

    known = meshio.extension_to_filetypes
    endings = ["".join(path.suffixes[-2:]).lower(), path.suffix.lower()]
    if file_format is None and not any(ending in known for ending in endings):
        raise InvalidInputError(
            f"file '{path}' must end in one of {' '.join(sorted(known))}, which say what is in it: rename "
            "it, or give file_format"
        )
    return _read_by_meshio(path, file_format)


def _read_by_meshio(path: Path, file_format: str | None) -> meshio.Mesh:
    """Read a file; meshio reports errors by various exceptions, by text, or by exiting Python."""
    import meshio

    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            return meshio.read(path, file_format)
    except ImportError as reason:
        raise InvalidInputError(
            f"meshio needs the library {reason.name!r} to read file '{path}', it is not installed: install "
            f"it (pip install {reason.name}), or save the mesh in another format, .vtu for instance"
        ) from reason
    except (Exception, SystemExit) as reason:
        words = " ".join(f"{said.getvalue()} {'' if isinstance(reason, SystemExit) else reason}".split())
        raise InvalidInputError(
            f"file '{path}' must be a mesh that meshio can read, it says: {words or type(reason).__name__}: "
            "check its format, or save the mesh in another one, .vtu for instance"
        ) from reason


def _tagged(
    mesh: meshio.Mesh, source: str, labels: str | None, corners_only: bool, *, everything: bool
) -> TaggedMesh:
    points, blocks, cells = cells_of(mesh, source, corners_only)
    groups, facets, node_sets = labels_of(mesh, blocks, cells, labels, source, everything)
    return TaggedMesh(source, points, cells, groups, facets, ("cell label", "facet label"), node_sets)
