"""A separate gmsh model that leaves the caller's gmsh, terminal and signal handlers unchanged."""

from __future__ import annotations

import ctypes
import importlib
import inspect
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from fenics_contact._base.apart import OwnProcess
from fenics_contact._base.progress import Task
from fenics_contact._base.requirements import check_gmsh
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import OF_THE_FILE
from fenics_contact.mesh.collapsed import SHAPES
from fenics_contact.mesh.plane import flattened, turned_counter_clockwise
from fenics_contact.mesh.quadratic_nodes import ordered
from fenics_contact.readers.bodies import Label, TaggedMesh, other_cells

_TYPES = {
    2: "triangle", 3: "quadrilateral", 4: "tetrahedron", 5: "hexahedron", 6: "prism", 7: "pyramid",
    9: "triangle6", 10: "quadrilateral9", 11: "tetrahedron10", 12: "hexahedron27", 13: "prism18",
    14: "pyramid14", 16: "quadrilateral8", 17: "hexahedron20", 18: "prism15", 19: "pyramid13",
}  # fmt: skip
"""gmsh's numbers of the supported cell types."""


def tagged_mesh_of(gmsh: ModuleType, source: str) -> TaggedMesh:
    """Return the cells of the highest dimension and the physical groups of gmsh's current model.

    Nodes are in the order of their tags, cells in that of entities.
    """
    elements = {dim: _elements(gmsh, dim, source) for dim in (3, 2)}
    dim = 3 if elements[3] else 2
    if not elements[dim]:
        raise InvalidInputError(
            f"{source} must hold cells, it has none: mesh it, and put all bodies into physical groups"
        )
    groups = _groups(gmsh, dim, set(elements[dim]), source)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    row = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    order = np.argsort(tags)  # versions of the format differ in the order of nodes, not in their tags
    row[tags[order].astype(np.int64)] = np.arange(tags.size)
    points = coordinates.reshape(-1, 3)[order]
    by_entity = {
        tag: {kind: _in_vtk_order(points, kind, row[nodes]) for kind, nodes in blocks.items()}
        for tag, blocks in elements[dim].items()
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
    elements: dict[int, dict[str, np.ndarray]] = {}
    for _, entity in gmsh.model.getEntities(dim):
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for number, tags in zip(types, nodes, strict=True):
            name, _, order, nodes_each, *_ = gmsh.model.mesh.getElementProperties(number)
            if order > 1 and number not in _TYPES:
                raise InvalidInputError(f"{source} has cells of type '{name}': {OF_THE_FILE}")
            if number not in _TYPES:
                raise other_cells(source, name)
            blocks = elements.setdefault(int(entity), {})
            blocks[_TYPES[number]] = tags.astype(np.int64).reshape(-1, nodes_each)
    return elements


def _in_vtk_order(points: np.ndarray, kind: str, cells: np.ndarray) -> np.ndarray:
    return ordered(points, cells, SHAPES[kind.rstrip("0123456789")])


def _groups(gmsh: ModuleType, dim: int, meshed: set[int], source: str) -> dict[Label, list[int]]:
    """Name to meshed entities of every physical group; every meshed entity must be in one."""
    groups = physical_groups(gmsh, dim)
    left = sorted(meshed - {tag for tags in groups.values() for tag in tags})
    if left:
        word = "volume" if dim == 3 else "surface"
        raise InvalidInputError(
            f"every {word} with cells must be in a physical {word}, which says what body it is, {word}s "
            f"{left} of {source} are in none: use gmsh.model.addPhysicalGroup({dim}, tags, name=...)"
        )
    return {label: tags for label, tags in groups.items() if meshed.intersection(tags)}


def physical_groups(gmsh: ModuleType, dim: int) -> dict[Label, list[int]]:
    """Return the entities of every physical group of a dimension, by its name, else by its number."""
    groups: dict[Label, list[int]] = {}
    for _, tag in gmsh.model.getPhysicalGroups(dim):
        name = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        groups.setdefault(name, []).extend(map(int, gmsh.model.getEntitiesForPhysicalGroup(dim, tag)))
    return groups


def _numbered(
    by_entity: Mapping[int, Mapping[str, np.ndarray]],
) -> tuple[dict[str, np.ndarray], dict[int, dict[str, np.ndarray]]]:
    """Concatenate the cells of all entities by type, and return the numbers of those of every entity."""
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
    """Corner nodes of the facets of every physical group, as row numbers."""
    facets: dict[Label, list[np.ndarray]] = {}
    for label, entities in physical_groups(gmsh, dim).items():
        blocks: list[Any] = []
        for entity in entities:
            if dim == 2:
                there = elements[2].get(entity, {}).items()
                blocks += [nodes[:, : SHAPES[kind.rstrip("0123456789")].corners] for kind, nodes in there]
            else:
                types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
                each = [gmsh.model.mesh.getElementProperties(number)[3] for number in types]
                blocks += [
                    tags.astype(np.int64).reshape(-1, columns)[:, :2]
                    for tags, columns in zip(nodes, each, strict=True)
                ]
        facets[label] = [row[block] for block in blocks]
    return facets


_OPTIONS = {
    "General.Terminal": 0.0,
    "Geometry.AutoCoherence": 1.0,
    "Geometry.Tolerance": 1e-8,
    "Mesh.ElementOrder": 1.0,
    "Mesh.MeshOnlyVisible": 0.0,
    "Mesh.SubdivisionAlgorithm": 0.0,
}
"""Options on which the meshes of this package rely: gmsh's defaults, without output."""


def reading_process(path: Path) -> OwnProcess:
    """Return a process in which gmsh reads a file: it and OpenCASCADE crash at files that mislead them.

    It knows nothing of the caller's gmsh, whose models and options count for no file.
    """
    return OwnProcess(
        f"gmsh's reading of file '{path}'",
        "the file is damaged or holds what gmsh cannot handle: write it again, look at it with gmsh, or, if "
        "it is sound, take a machine with more memory",
    )


def lasting_session(name: str, options: Mapping[str, float]) -> ModuleType:
    """Start gmsh with an empty model until the process ends, which is a `reading_process`."""
    gmsh = import_gmsh()
    _initialise(gmsh)
    for option, value in {**_OPTIONS, **options}.items():
        gmsh.option.setNumber(option, value)
    gmsh.model.add(name)
    return gmsh


@contextmanager
def gmsh_model(name: str, **more: float) -> Iterator[ModuleType]:
    """Open an empty gmsh model and remove it afterwards.

    If gmsh is already initialised the caller's models, current model and options are restored; if not, it is
    initialised without configuration files and finalised.

    Args:
        name: Name of the model.
        **more: Further options of gmsh by their names, such as ``{"Mesh.MeshSizeMax": 2.0}``.

    Yields:
        The module ``gmsh`` with the new model current.

    Raises:
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.
    """
    with Task("mesh"), interrupt_handler_kept():
        gmsh = import_gmsh()
        foreign = _is_initialised(gmsh)
        if not foreign:
            _initialise(gmsh)
        wanted = {**_OPTIONS, **more}
        options = {option: gmsh.option.getNumber(option) for option in wanted}
        current = gmsh.model.getCurrent()
        while name in gmsh.model.list():
            name += "'"
        try:
            for option, value in wanted.items():
                gmsh.option.setNumber(option, value)
            gmsh.model.add(name)
            yield gmsh
        finally:
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            for option, value in options.items():
                gmsh.option.setNumber(option, value)
            if not foreign:
                gmsh.finalize()


def initialised_gmsh(user: str, reader: str) -> ModuleType:
    """Return the module ``gmsh``, which must have a model in memory."""
    with interrupt_handler_kept():
        gmsh = import_gmsh()
        if not _is_initialised(gmsh):
            remedy = f"call gmsh.initialize(), build and mesh a model first, or read it with `{reader}`"
            raise InvalidInputError(f"{user} needs a model in memory, gmsh is not initialised: {remedy}")
        return gmsh


def _initialise(gmsh: ModuleType) -> None:
    known = inspect.signature(gmsh.initialize).parameters
    gmsh.initialize(readConfigFiles=False, **({"interruptible": False} if "interruptible" in known else {}))


def import_gmsh() -> ModuleType:
    """Return the module ``gmsh``, checked."""
    check_gmsh()
    return importlib.import_module("gmsh")


@contextmanager
def interrupt_handler_kept() -> Iterator[None]:
    """Restore the handler of SIGINT.

    gmsh replaces it at import, at initialisation or at finalisation, depending on the version.
    """
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        main = threading.current_thread() is threading.main_thread()
        if main and handler is not None and signal.getsignal(signal.SIGINT) is not handler:
            signal.signal(signal.SIGINT, handler)


def _is_initialised(gmsh: ModuleType) -> bool:
    if hasattr(gmsh, "isInitialized"):
        return bool(gmsh.isInitialized())
    # Older versions have no query: a call fails once gmsh is finalised, with a message on the terminal.
    with silenced(2):
        try:
            return len(gmsh.model.list()) > 0
        except Exception:
            return False


@contextmanager
def silenced(descriptor: int) -> Iterator[None]:
    """Discard what libraries write to standard output, 1, or to standard error, 2.

    OpenCASCADE prints a page of statistics for every STEP file.
    """
    (sys.stdout if descriptor == 1 else sys.stderr).flush()
    duplicate = os.dup(descriptor)
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, descriptor)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C still keeps would be written later
        os.dup2(duplicate, descriptor)
        os.close(sink)
        os.close(duplicate)
