"""Bodies from CAD files, meshed by gmsh; their surfaces keep their true shapes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from fenics_contact.checks import check_numbers, require_file
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh import BodyMesh
from fenics_contact.mesh_io.gmsh_import import Bodies, Surfaces, from_gmsh_model
from fenics_contact.mesh_io.gmsh_session import gmsh_model

if TYPE_CHECKING:
    from mpi4py import MPI

#: Formats that gmsh reads as geometry.
SUFFIXES = (".step", ".stp", ".iges", ".igs", ".brep", ".geo", ".geo_unrolled")
#: Default name of the library that writes STEP files.
NO_NAME = "Open CASCADE"
_SIZE = "Mesh.MeshSizeMax"


def read_cad(
    path: str | Path,
    size: float | None = None,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
    *,
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
        surfaces: As in `read_msh`.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body, with `BodyMesh.shapes`. gmsh reads STEP and IGES files in millimetres.

    Raises:
        InvalidInputError: As `read_msh`, or if gmsh cannot read or mesh the file.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Note:
        Collective on ``comm`` if given.

    Example:
        ``read_cad("bracket.step", 2.0, surfaces={"hole": ["4", "7"]})`` makes bodies of tetrahedra of at most
        2 mm; faces 4 and 7, two halves of a hole, become the surface "hole", whose shape is a `Cylinder`.
    """
    if comm is None:
        return _read(Path(path), size, bodies, surfaces)
    made = None
    with together(comm):
        made = _read(Path(path), size, bodies, surfaces) if comm.rank == 0 else None
    return comm.bcast(made, root=0)


def _read(
    path: Path, size: float | None, bodies: Bodies | None, surfaces: Surfaces | None
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
    with gmsh_model("fenics_contact CAD") as gmsh:
        previous = gmsh.option.getNumber(_SIZE)
        try:
            gmsh.merge(str(path))
            dim = max((dim for dim, _ in gmsh.model.getEntities()), default=0)
            if size is not None:
                gmsh.option.setNumber(_SIZE, size)
            for each in (dim, dim - 1):
                _name(gmsh, each, unique=each == dim)
            gmsh.model.mesh.generate(dim)
        except Exception as reason:  # gmsh raises no other class
            raise InvalidInputError(
                f"file '{path}' must be one that gmsh can read and mesh, it says: {reason}: look at it with "
                "gmsh, or give another size"
            ) from reason
        finally:
            gmsh.option.setNumber(_SIZE, previous)
        return from_gmsh_model(bodies, surfaces)


def _name(gmsh: ModuleType, dim: int, *, unique: bool) -> None:
    """Add physical groups of entities if there are none of their dimension."""
    if dim < 1 or gmsh.model.getPhysicalGroups(dim):
        return
    names = {}
    for _, tag in gmsh.model.getEntities(dim):
        name = gmsh.model.getEntityName(dim, tag).rpartition("/")[2]
        names[tag] = str(tag) if not name or name.startswith(NO_NAME) else name
    times = Counter(names.values())
    groups: dict[str, list[int]] = {}
    for tag, name in names.items():
        groups.setdefault(f"{name} {tag}" if unique and times[name] > 1 else name, []).append(tag)
    for name, tags in groups.items():
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)
