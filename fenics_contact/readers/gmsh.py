"""Bodies from gmsh: files and the model in memory; new tetrahedra behind a surface.

Physical groups define bodies and surfaces. By default every physical volume (in two dimensions: physical
surface) is a body of that name, and every physical surface (curve) a surface of each body on whose boundary
it lies. A group without a name is named by its number, as text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.checks import naming_arguments, require_file
from fenics_contact._base.progress import Task
from fenics_contact.errors import FenicsContactError, InvalidInputError
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.readers.bodies import TaggedMesh, bodies_of
from fenics_contact.readers.cad_shapes import cad_shapes
from fenics_contact.readers.gmsh_session import (
    gmsh_model,
    initialised_gmsh,
    lasting_session,
    reading_process,
    tagged_mesh_of,
)

if TYPE_CHECKING:
    from mpi4py import MPI


Bodies = Sequence[str] | Mapping[str, str | Sequence[str] | Mapping[str, str]]
"""Names of groups; or body to group, to groups that become regions, or to region to group."""

Surfaces = Sequence[str] | Mapping[str, str | Sequence[str]]
"""Names of groups; or surface to group or groups."""


@naming_arguments
def read_msh(
    path: str | Path,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
    *,
    comm: MPI.Comm | None = None,
) -> dict[str, BodyMesh]:
    """Read bodies from a .msh file of any version.

    Every body has its own nodes; those that bodies share in the file are duplicated. The constant z
    coordinate of plane meshes is dropped. Quadratic cells stay quadratic.

    Example:
        ``read_msh("press.msh")`` makes a body of every physical volume. ``read_msh("press.msh",
        bodies={"tool": "punch", "sheet": ["steel", "copper"]})`` makes one of the group "punch" and one with
        the regions "steel" and "copper", and leaves out all other groups.

    Args:
        path: The file.
        bodies: The physical volumes of each body: names of groups that are bodies; or name of the body to a
            group, to several groups, which become its regions, or to name of the region to a group. Every
            group is a body unless given.
        surfaces: The requested physical surfaces: their names, or name of the surface to a group or to
            several. All unless given.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: If the file is missing or cannot be read, a group does not exist, a volume has no
            group, cells are of order three, of both orders in one body, flipped, or disconnected, a cell is
            in two bodies, or a surface lies inside a body.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Note:
        Collective on ``comm`` if given.
    """
    return bodies_of(on_root_then_bcast(comm, lambda: _read(Path(path))), bodies, surfaces)


def from_gmsh_model(
    bodies: Bodies | None = None, surfaces: Surfaces | None = None, *, shapes: bool = True
) -> dict[str, BodyMesh]:
    """Build bodies from gmsh's current model, which must be meshed and is not changed.

    Args:
        bodies: As in `read_msh`.
        surfaces: As in `read_msh`.
        shapes: Whether surfaces keep their true shapes from the model's geometry, if it has one, see
            `cad_shapes`; else they are their facets.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: As `read_msh`, or if gmsh is not initialised.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.
    """
    gmsh = initialised_gmsh("from_gmsh_model", "read_msh")
    made = bodies_of(tagged_mesh_of(gmsh, f"model '{gmsh.model.getCurrent()}'"), bodies, surfaces)
    if not shapes:
        return made
    groups = surfaces if isinstance(surfaces, Mapping) else {}
    return {name: _with_shapes(mesh, groups) for name, mesh in made.items()}


def _with_shapes(mesh: BodyMesh, groups: Mapping[str, str | Sequence[str]]) -> BodyMesh:
    """Add the shapes of a body's surfaces, which consist of these groups or those of their names."""
    return mesh.with_shapes(cad_shapes(mesh, {name: groups.get(name, name) for name in mesh.surfaces}))


def _read(path: Path) -> TaggedMesh:
    require_file(path)
    with path.open("rb") as file:
        start = file.read(11)
    # gmsh would run any other file as a script.
    if start != b"$MeshFormat":
        raise InvalidInputError(
            f"file '{path}' must be a .msh file, which starts with $MeshFormat, it starts with {start!r}: "
            "let gmsh write it (gmsh.write, or `gmsh -3 part.geo -o part.msh`)"
        )
    with Task("mesh"), reading_process(path) as process:
        return process.call(_merged, path)


def _merged(path: Path) -> TaggedMesh:
    gmsh = lasting_session(path.name, {})
    try:
        gmsh.merge(str(path))
    except Exception as reason:  # gmsh raises no other class
        raise InvalidInputError(
            f"file '{path}' must be a .msh file that gmsh can read, it says: {reason}: write it again"
        ) from reason
    return tagged_mesh_of(gmsh, f"file '{path}'")


@naming_arguments
def refilled(mesh: BodyMesh) -> BodyMesh:
    """Return new tetrahedra behind the boundary of a body, which keeps its nodes, facets and named surfaces.

    For a body that was deformed so far that its cells have become thin, see `design.Remeshed`. Cells
    grow from the size of the facets around them. Nodes have other numbers afterwards.

    `mesh`: linear tetrahedra without regions and without true shapes of surfaces, in one piece.

    Example:
        >>> from fenics_contact.gallery import block
        >>> cube = block((0, 0, 0), (1, 1, 1), (3, 3, 3), "tetrahedron")
        >>> new = refilled(cube)
        >>> new.cell_type, round(new.volume, 12), len(new.surfaces["z1"])
        ('tetrahedron', 1.0, 18)
    """
    if mesh.cell_type != "tetrahedron" or mesh.regions or mesh.shapes:
        raise InvalidInputError(
            "a body is refilled with linear tetrahedra and has neither regions nor true shapes, got "
            f"{mesh.cells_in_words}, regions {sorted(mesh.regions)}, shapes of {sorted(mesh.shapes)}: keep it"
        )
    facets, _ = boundary_faces(mesh.cells)
    try:
        points, cells = _filled(mesh.points, facets)
    except Exception as error:
        raise FenicsContactError(
            f"gmsh must fill the boundary of {mesh.cells_in_words}, but failed ({error}): is it sound?"
        ) from error
    rounding = 1e-9 * float(np.ptp(mesh.points, axis=0).max())
    distance, number = cKDTree(points).query(mesh.points[facets])
    if distance.max() > rounding:
        raise FenicsContactError(
            f"gmsh must keep the nodes of the boundary, one is off by {distance.max():.1e}: please report it"
        )
    row = np.full(mesh.n_nodes, -1, dtype=np.int64)
    row[facets] = number
    points[number] = mesh.points[facets]
    inside = [name for name, nodes in mesh.node_sets.items() if (row[nodes] < 0).any()]
    if inside:
        raise InvalidInputError(
            f"a refilled body has nodes on its boundary alone, node set {inside[0]!r} has others: omit it"
        )
    surfaces, sets = (
        {name: row[nodes] for name, nodes in named.items()} for named in (mesh.surfaces, mesh.node_sets)
    )
    return BodyMesh(points, cells, surfaces, node_sets=sets)


def _filled(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates, (n_nodes, 3), and tetrahedra, (n_cells, 4), behind closed facets."""
    nodes, triangles = np.unique(facets, return_inverse=True)
    with gmsh_model("fenics_contact refilled") as gmsh:
        surface = gmsh.model.addDiscreteEntity(2)
        gmsh.model.mesh.addNodes(2, surface, np.arange(1, len(nodes) + 1), points[nodes].ravel())
        gmsh.model.mesh.addElementsByType(
            surface, gmsh.model.mesh.getElementType("Triangle", 1), [], triangles.ravel() + 1
        )
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop([surface])])
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
        row[tags.astype(np.int64)] = np.arange(tags.size)
        found = gmsh.model.mesh.getElementsByType(gmsh.model.mesh.getElementType("Tetrahedron", 1))[1]
        cells = row[found.astype(np.int64)].reshape(-1, 4)
    used, number = np.unique(cells, return_inverse=True)
    return coordinates.reshape(-1, 3)[used], number.reshape(-1, 4)
