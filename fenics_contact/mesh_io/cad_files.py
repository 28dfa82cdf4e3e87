"""Bodies from CAD files, meshed by gmsh; their surfaces keep their true shapes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from fenics_contact.checks import check_numbers, require_file
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh import BodyMesh
from fenics_contact.mesh_io.cad_choice import FaceChoice, chosen_faces
from fenics_contact.mesh_io.cad_faces import faces_of, name_of
from fenics_contact.mesh_io.gmsh_elements import physical_groups
from fenics_contact.mesh_io.gmsh_import import Bodies, from_gmsh_model
from fenics_contact.mesh_io.gmsh_session import gmsh_model

if TYPE_CHECKING:
    from mpi4py import MPI

#: Formats that gmsh reads as geometry.
SUFFIXES = (".step", ".stp", ".iges", ".igs", ".brep", ".geo", ".geo_unrolled")


def read_cad(
    path: str | Path,
    size: float | None = None,
    bodies: Bodies | None = None,
    surfaces: FaceChoice | None = None,
    *,
    order: int = 1,
    comm: MPI.Comm | None = None,
) -> dict[str, BodyMesh]:
    """Read a CAD file, mesh it with gmsh, and return its bodies with the true shapes of their surfaces.

    Physical groups of a .geo file define bodies and surfaces, as in `from_gmsh_model`. Without groups, every
    volume (of a plane part: every surface) is a body and every surface (curve) a surface of it, named as in a
    STEP file, else by their numbers in gmsh, as text.

    Args:
        path: A file .step, .stp, .iges, .igs, .brep, .geo or .geo_unrolled; .geo is a script: gmsh runs it.
        size: Largest edge of a cell, [length]; that of the file unless given.
        bodies: As in `read_msh`.
        surfaces: The wanted surfaces: names or numbers of faces, or name of the surface to what chooses its
            faces: a name, a number, `InBox`, `OnPlane`, `OnCylinder`, a function that says of a `CadFace`
            whether it is one, or several of these. Every face unless given.
        order: 1 for linear cells, 2 for quadratic ones, curved like the surfaces.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body, with `BodyMesh.shapes`. Whatever unit a STEP or IGES file names, its coordinates come in
        millimetres; `BodyMesh.placed` scales them to another unit. Other files name no unit.

    Raises:
        InvalidInputError: As `read_msh`, or if gmsh cannot read or mesh the file, nothing is chosen for a
            surface, or a face for two; these messages list all faces.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Note:
        Collective on ``comm`` if given.

    Example:
        ``read_cad("bracket.step", 2.0, surfaces={"foot": [4, 7], "hole": OnCylinder(5.0)})`` makes bodies of
        tetrahedra of at most 2 mm. Faces 4 and 7 are the surface "foot"; all on cylinders of radius 5 mm the
        surface "hole", whose shape is a `Cylinder`.
    """
    if comm is None:
        return _read(Path(path), size, order, bodies, surfaces)
    made = None
    with together(comm):
        made = _read(Path(path), size, order, bodies, surfaces) if comm.rank == 0 else None
    return comm.bcast(made, root=0)


def _read(
    path: Path,
    size: float | None,
    order: int,
    bodies: Bodies | None,
    surfaces: FaceChoice | None,
) -> dict[str, BodyMesh]:
    require_file(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidInputError(
            f"file '{path}' must be a CAD file, {', '.join(SUFFIXES)}: read a mesh with `read_msh` or "
            "`read_mesh`"
        )
    if size is not None:
        check_numbers(size=size)
        if size <= 0:
            raise InvalidInputError(f"size must be above zero, got {size}: give the largest edge of a cell")
    if order not in (1, 2):
        raise InvalidInputError(f"order must be 1 or 2, got {order}: linear or quadratic cells")
    options: dict[str, float] = {
        "Mesh.ElementOrder": order,
        "Mesh.SecondOrderIncomplete": 0,
        "Mesh.SecondOrderLinear": 0,
    }
    options["Mesh.HighOrderOptimize"] = 1  # only where curved cells would be inverted
    if size is not None:
        options["Mesh.MeshSizeMax"] = size
    with gmsh_model("fenics_contact CAD", **options) as gmsh:
        with _reasons(path):
            gmsh.merge(str(path))
        dim = max((dim for dim, _ in gmsh.model.getEntities()), default=0)
        for each in (dim, dim - 1):
            _name(gmsh, each, unique=each == dim)
        if surfaces is not None and dim > 1:
            _choose(gmsh, dim - 1, surfaces, f"file '{path}'")
        with _reasons(path):
            gmsh.model.mesh.generate(dim)
        return from_gmsh_model(bodies)


@contextmanager
def _reasons(path: Path) -> Iterator[None]:
    """Say what gmsh says."""
    try:
        yield
    except Exception as reason:  # gmsh raises no other class
        raise InvalidInputError(
            f"file '{path}' must be one that gmsh can read and mesh, it says: {reason}: look at it with "
            "gmsh, or give another size"
        ) from reason


def _name(gmsh: ModuleType, dim: int, *, unique: bool) -> None:
    """Add physical groups of entities if there are none of their dimension."""
    if dim < 1 or gmsh.model.getPhysicalGroups(dim):
        return
    names = {tag: name_of(gmsh, dim, tag) for _, tag in gmsh.model.getEntities(dim)}
    times = Counter(names.values())
    groups: dict[str, list[int]] = {}
    for tag, name in names.items():
        groups.setdefault(f"{name} {tag}" if unique and times[name] > 1 else name, []).append(tag)
    _add_groups(gmsh, dim, groups)


def _choose(gmsh: ModuleType, dim: int, surfaces: FaceChoice, source: str) -> None:
    """Replace the physical groups of faces by those that are chosen."""
    groups = physical_groups(gmsh, dim)
    chosen = chosen_faces(faces_of(gmsh, dim), groups, surfaces, source)
    gmsh.model.removePhysicalGroups([(dim, tag) for _, tag in gmsh.model.getPhysicalGroups(dim)])
    _add_groups(gmsh, dim, chosen)


def _add_groups(gmsh: ModuleType, dim: int, groups: Mapping[str, Sequence[int]]) -> None:
    for name, tags in groups.items():
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)
