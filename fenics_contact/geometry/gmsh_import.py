"""Bodies from gmsh: from a .msh file of any version, or from the model in memory.

Physical groups say what is what. By default every physical volume (in two dimensions: physical surface) is a
body of that name, and every physical surface (curve) a surface of each body on whose boundary it lies. A
group without a name goes by its number, as text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.geometry.bodies import bodies_of
from fenics_contact.geometry.gmsh_session import gmsh_model, running_gmsh
from fenics_contact.geometry.mesh import BodyMesh
from fenics_contact.geometry.plane import flattened, turned_counter_clockwise
from fenics_contact.geometry.tagged_mesh import QUADRATIC, Label, TaggedMesh

if TYPE_CHECKING:
    from mpi4py import MPI

Bodies = Sequence[str] | Mapping[str, str | Sequence[str] | Mapping[str, str]]
"""Names of groups; or body to group, to groups that become regions, or to region to group."""

Surfaces = Sequence[str] | Mapping[str, str | Sequence[str]]
"""Names of groups; or surface to group or groups."""

_TYPES = {2: "triangle", 3: "quadrilateral", 4: "tetrahedron", 5: "hexahedron"}
"""gmsh's numbers of the cells that a body may have."""


def read_msh(
    path: str | Path,
    bodies: Bodies | None = None,
    surfaces: Surfaces | None = None,
    *,
    comm: MPI.Comm | None = None,
) -> dict[str, BodyMesh]:
    """Read bodies from a .msh file of any version.

    Every body gets nodes of its own; those that bodies share in the file are there once for each of them.
    Plane meshes lose their constant z coordinate.

    Example:
        ``read_msh("press.msh")`` makes a body of every physical volume. ``read_msh("press.msh",
        bodies={"tool": "punch", "sheet": ["steel", "copper"]})`` makes one of the group "punch" and one with
        the regions "steel" and "copper", and leaves out all other groups.

    Args:
        path: The file.
        bodies: Which physical volumes make up which bodies: names of groups that are bodies; or name of the
            body to a group, to several groups, which become its regions, or to name of the region to a group.
            Every group is a body unless given.
        surfaces: Which physical surfaces are wanted: their names, or name of the surface to a group or to
            several. All unless given.
        comm: If given, rank 0 reads the file and all ranks receive the bodies.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: If the file is missing or cannot be read, a group is not in it, a volume has no
            group, cells are not linear, are prisms or pyramids, of several types in one body, flipped, or do
            not hang together, a cell is in two bodies, or a surface lies inside a body.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Note:
        Collective on ``comm`` if given.
    """
    if comm is None:
        return bodies_of(_read(Path(path)), bodies, surfaces)
    read = None
    with together(comm):
        read = _read(Path(path)) if comm.rank == 0 else None
    return bodies_of(comm.bcast(read, root=0), bodies, surfaces)


def from_gmsh_model(bodies: Bodies | None = None, surfaces: Surfaces | None = None) -> dict[str, BodyMesh]:
    """Take bodies from gmsh's current model, which has been meshed and stays as it is.

    Args:
        bodies: As in `read_msh`.
        surfaces: As in `read_msh`.

    Returns:
        Name to body.

    Raises:
        InvalidInputError: As `read_msh`, or if gmsh is not initialised.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.
    """
    gmsh = running_gmsh()
    if gmsh is None:
        raise InvalidInputError(
            "from_gmsh_model needs a model in memory, gmsh is not initialised: call gmsh.initialize(), build "
            "and mesh a model first, or read a file with `read_msh`"
        )
    return bodies_of(_tagged_mesh(gmsh, f"model '{gmsh.model.getCurrent()}'"), bodies, surfaces)


def _read(path: Path) -> TaggedMesh:
    if not path.is_file():
        raise InvalidInputError(f"there must be a file '{path}', there is none: check the name and folder")
    with path.open("rb") as file:
        start = file.read(11)
    # gmsh would run any other file as a script.
    if start != b"$MeshFormat":
        raise InvalidInputError(
            f"file '{path}' must be a .msh file, which starts with $MeshFormat, it starts with {start!r}: "
            "let gmsh write it (gmsh.write, or `gmsh -3 part.geo -o part.msh`)"
        )
    with gmsh_model("fenics_contact import") as gmsh:
        try:
            gmsh.merge(str(path))
        except Exception as reason:  # gmsh raises no other class
            raise InvalidInputError(
                f"file '{path}' must be a .msh file that gmsh can read, it says: {reason}: write it again"
            ) from reason
        return _tagged_mesh(gmsh, f"file '{path}'")


def _tagged_mesh(gmsh: ModuleType, source: str) -> TaggedMesh:
    elements = {dim: _elements(gmsh, dim, source) for dim in (3, 2)}
    dim = 3 if elements[3] else 2
    if not elements[dim]:
        raise InvalidInputError(
            f"{source} must hold cells, it has none: mesh it (gmsh.model.mesh.generate) and put its volumes, "
            "or the surfaces of a plane body, into physical groups"
        )
    groups = _groups(gmsh, dim, set(elements[dim]), source)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    order = np.argsort(tags)  # versions of the format differ in the order of nodes, not in their tags
    row[tags[order].astype(np.int64)] = np.arange(tags.size)
    points = coordinates.reshape(-1, 3)[order]
    by_entity = {
        tag: {kind: row[nodes] for kind, nodes in blocks.items()} for tag, blocks in elements[dim].items()
    }
    if dim == 2:
        used = np.concatenate([rows.ravel() for blocks in by_entity.values() for rows in blocks.values()])
        points = flattened(points, used, source)
        by_entity = {
            tag: {kind: turned_counter_clockwise(points, rows) for kind, rows in blocks.items()}
            for tag, blocks in by_entity.items()
        }
    cells, of_entity = _numbered(by_entity)
    words = ("physical volume", "physical surface") if dim == 3 else ("physical surface", "physical curve")
    return TaggedMesh(
        source,
        points,
        cells,
        {
            label: _joined([of_entity[tag] for tag in tags if tag in of_entity])
            for label, tags in groups.items()
        },
        _facets(gmsh, dim - 1, row, elements),
        words,
    )


def _elements(gmsh: ModuleType, dim: int, source: str) -> dict[int, dict[str, np.ndarray]]:
    """Node tags of all cells of a dimension by entity and cell type; entities without cells left out."""
    found: dict[int, dict[str, np.ndarray]] = {}
    for _, entity in gmsh.model.getEntities(dim):
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for number, tags in zip(types, nodes, strict=True):
            name, _, order, vertices, *_ = gmsh.model.mesh.getElementProperties(number)
            if order > 1:
                raise InvalidInputError(f"{source} has cells of type '{name}': {QUADRATIC}")
            if number not in _TYPES:
                raise InvalidInputError(
                    f"cells must be tetrahedra or hexahedra (in two dimensions triangles or quadrilaterals), "
                    f"{source} has cells of type '{name}': mesh it without prisms and pyramids"
                )
            blocks = found.setdefault(int(entity), {})
            blocks[_TYPES[number]] = tags.astype(np.int64).reshape(-1, vertices)
    return found


def _groups(gmsh: ModuleType, dim: int, meshed: set[int], source: str) -> dict[Label, list[int]]:
    """Name to meshed entities of every physical group; every meshed entity must be in one."""
    groups = _physical(gmsh, dim)
    left = sorted(meshed - {tag for tags in groups.values() for tag in tags})
    if left:
        word = "volume" if dim == 3 else "surface"
        raise InvalidInputError(
            f"every {word} with cells must be in a physical {word}, which says what body it is, {word}s "
            f"{left} of {source} are in none: name them with gmsh.model.addPhysicalGroup({dim}, tags, "
            f"name=...)"
        )
    return {label: tags for label, tags in groups.items() if meshed.intersection(tags)}


def _physical(gmsh: ModuleType, dim: int) -> dict[Label, list[int]]:
    groups: dict[Label, list[int]] = {}
    for _, tag in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        groups.setdefault(name, []).extend(map(int, gmsh.model.getEntitiesForPhysicalGroup(dim, tag)))
    return groups


def _numbered(
    by_entity: Mapping[int, Mapping[str, np.ndarray]],
) -> tuple[dict[str, np.ndarray], dict[int, dict[str, np.ndarray]]]:
    """Join the cells of all entities by type; say which numbers those of every entity got."""
    blocks: dict[str, list[np.ndarray]] = {}
    numbers: dict[int, dict[str, np.ndarray]] = {}
    for entity, kinds in by_entity.items():
        for kind, rows in kinds.items():
            start = sum(map(len, blocks.setdefault(kind, [])))
            blocks[kind].append(rows)
            numbers.setdefault(entity, {})[kind] = np.arange(start, start + len(rows))
    return {kind: np.concatenate(rows) for kind, rows in blocks.items()}, numbers


def _joined(parts: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    kinds = {kind for part in parts for kind in part}
    return {kind: np.concatenate([part[kind] for part in parts if kind in part]) for kind in sorted(kinds)}


def _facets(
    gmsh: ModuleType,
    dim: int,
    row: np.ndarray,
    elements: Mapping[int, Mapping[int, Mapping[str, np.ndarray]]],
) -> dict[Label, list[np.ndarray]]:
    """Node rows of the facets of every physical group."""
    facets: dict[Label, list[np.ndarray]] = {}
    for label, entities in _physical(gmsh, dim).items():
        blocks: list[Any] = []
        for entity in entities:
            if dim == 2:
                blocks += elements[2].get(entity, {}).values()
            else:
                _, _, nodes = gmsh.model.mesh.getElements(dim, entity)
                blocks += [tags.astype(np.int64).reshape(-1, 2) for tags in nodes]
        facets[label] = [row[block] for block in blocks]
    return facets
