"""Bodies from every mesh file that meshio reads.

Labels of cells become bodies, labels of facets and nodes become surfaces: cell sets by name, tags (numbers,
by their names in the file if any), node sets. `read_msh` reads gmsh's files and `read_xdmf` those of dolfinx;
`read_mesh` delegates to them.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from copy import copy
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.checks import check_each, naming_arguments, require_file
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import shape_of
from fenics_contact.mesh.plane import flattened, turned_right_handed
from fenics_contact.mesh.quadratic_nodes import ordered
from fenics_contact.readers.bodies import Label, TaggedMesh, bodies_of, labelled, other_cells
from fenics_contact.readers.dolfinx import Bodies, Surfaces, read_xdmf
from fenics_contact.readers.gmsh import read_msh

if TYPE_CHECKING:
    import meshio
    from mpi4py import MPI


_ELEMENT = re.compile(r"^\*element\s*,", re.IGNORECASE)
_NODE = re.compile(r"^\*node\s*(,|$)", re.IGNORECASE)
_ELSET = re.compile(r",\s*elset\s*=\s*([^,\n]+)", re.IGNORECASE)


def with_element_sets(mesh: meshio.Mesh, path: Path) -> meshio.Mesh:
    """Return the mesh with the sets of ``*ELEMENT, ELSET=name`` as in the file.

    meshio 5.3 assigns the n-th of these names to the n-th block, even if a block has none or two blocks have
    the same.
    """
    if path.suffix.lower() != ".inp":
        return mesh
    with path.open(errors="replace") as file:
        lines = [line for line in file if line.startswith("*")]
    _check_nodes(lines, path)
    heads = [line for line in lines if _ELEMENT.match(line)]
    if len(heads) != len(mesh.cells):
        return mesh
    names = [match.group(1).strip() if (match := _ELSET.search(head)) else None for head in heads]
    for name in filter(None, dict.fromkeys(names)):
        mesh.cell_sets[name] = [
            np.arange(len(block)) if name == mine else np.zeros(0, dtype=np.int64)
            for mine, block in zip(names, mesh.cells, strict=True)
        ]
    return mesh


def _check_nodes(lines: Sequence[str], path: Path) -> None:
    count = sum(bool(_NODE.match(line)) for line in lines)
    if count > 1:
        raise InvalidInputError(
            f"file '{path}' must list nodes under one *NODE, it has {count}, of which meshio keeps the last"
        )


_CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
"""Number of corners by meshio's name of a linear cell."""
_SERENDIPITY_OR_LAGRANGE = {
    "triangle6": "triangle", "quad8": "quad", "quad9": "quad",
    "hexahedron20": "hexahedron", "hexahedron27": "hexahedron", "tetra10": "tetra",
    "pyramid13": "pyramid", "pyramid14": "pyramid", "wedge15": "wedge", "wedge18": "wedge",
}  # fmt: skip
"""meshio's name of a quadratic cell to that of the linear cell."""


@dataclass(frozen=True)
class Block:
    """The role of a block of a meshio mesh; its cells of bodies have a kind, and numbers from `start`.

    A block has a kind, or facets, or neither.
    """

    kind: str
    start: int
    facets: np.ndarray
    size: int


_NO_FACETS = np.zeros((0, 0), dtype=np.int64)


def corners_of(mesh: meshio.Mesh) -> meshio.Mesh:
    """Return a mesh without the nodes of quadratic cells that are no corners."""
    import meshio

    linear = copy(mesh)
    linear.cells = []
    for block in mesh.cells:
        kind = _SERENDIPITY_OR_LAGRANGE.get(block.type, block.type)
        corners = _CORNERS.get(kind)
        linear.cells.append(meshio.CellBlock(kind, block.data[:, :corners]) if corners else block)
    return linear


def cells_of(mesh: meshio.Mesh, source: str) -> tuple[np.ndarray, list[Block], dict[str, np.ndarray]]:
    """Sort the blocks of a mesh into cells and facets, and return the role of each block."""
    dim = max((block.dim for block in mesh.cells if len(block)), default=0)
    if dim < 2:
        raise InvalidInputError(f"{source} must hold cells, it has {_counted(mesh)}: save those of bodies")
    used = [_nodes(block, source) for block in mesh.cells if block.dim == dim]
    points = np.array(mesh.points, dtype=np.float64)
    blocks_of: dict[int, list[np.ndarray]] = {}
    for nodes in used:
        blocks_of.setdefault(nodes.shape[1], []).append(nodes)
    joined = {columns: np.concatenate(parts) for columns, parts in blocks_of.items()}
    if dim == 2:
        points = flattened(points, np.concatenate([nodes.ravel() for nodes in joined.values()]), source)
    cells: dict[str, np.ndarray] = {}
    kinds: dict[int, str] = {}
    for columns, nodes in joined.items():
        shape = shape_of(columns, dim)
        kinds[columns] = f"{shape.name}{columns if columns > shape.corners else ''}"
        nodes = ordered(points, nodes, shape)
        if any(shape is shape_of(other, dim) and other > shape.corners for other in set(joined) - {columns}):
            if columns > shape.corners:
                raise InvalidInputError(
                    f"quadratic cells must have one number of nodes, {source} has {_counted(mesh)}: save it "
                    "with one of them, or read it with corners_only=True"
                )
        cells[kinds[columns]] = turned_right_handed(points, nodes, source)
    return points, _blocks(mesh, dim, kinds), cells


def _nodes(block: meshio.CellBlock, source: str) -> np.ndarray:
    name = block.type
    linear = _SERENDIPITY_OR_LAGRANGE.get(name, name)
    if linear not in _CORNERS:
        raise other_cells(source, name)
    return np.array(block.data, dtype=np.int64)


def _blocks(mesh: meshio.Mesh, dim: int, kinds: Mapping[int, str]) -> list[Block]:
    blocks, count = [], dict.fromkeys(kinds.values(), 0)
    for block in mesh.cells:
        size = len(block)
        if block.dim == dim:
            kind = kinds[block.data.shape[1]]
            blocks.append(Block(kind, count[kind], _NO_FACETS, size))
            count[kind] += size
            continue
        corners = 2 if dim == 2 else _CORNERS.get(_SERENDIPITY_OR_LAGRANGE.get(block.type, block.type), 0)
        usable = block.dim == dim - 1 and corners
        blocks.append(Block("", 0, np.array(block.data)[:, :corners] if usable else _NO_FACETS, size))
    return blocks


def _counted(mesh: meshio.Mesh) -> str:
    counts: dict[str, int] = {}
    for block in mesh.cells:
        counts[block.type] = counts.get(block.type, 0) + len(block)
    return ", ".join(f"{count} of type '{name}'" for name, count in counts.items()) or "none at all"


Members = list[np.ndarray]
"""The members of a set in each block, numbers within the block."""
Groups = dict[Label, dict[str, np.ndarray]]
Facets = dict[Label, list[np.ndarray]]

_USUAL = ("gmsh:physical", "medit:ref", "nastran:ref", "cell_tags", "avsucd:material", "MaterialIDs")
"""Cell data of labels, by their names in various formats."""
_NO_LABELS = ("gmsh:geometrical", "gmsh:bounding_entities")


def labels_of(
    mesh: meshio.Mesh,
    blocks: Sequence[Block],
    cells: Mapping[str, np.ndarray],
    labels: str | None,
    source: str,
    everything: bool,
) -> tuple[Groups, Facets, dict[Label, np.ndarray]]:
    """Return by label cells (by type), corners of facets, and nodes."""
    sets = _sets(mesh, blocks, source)
    node_sets = {name: np.asarray(nodes, dtype=np.int64) for name, nodes in _node_sets(mesh).items()}
    of_sets = {name: members for name, members in sets.items() if _cells_among(members, blocks)}
    tags = _tag_array(mesh, blocks, labels, of_sets, source)
    members = sets if tags is None else _by_tag(mesh, tags)
    facets = _facets({**({} if tags is None else members), **sets}, blocks)
    if labels == "pieces":
        return _pieces(cells), facets, node_sets
    if labels == "blocks":
        return _by_block(blocks), facets, node_sets
    groups = _groups(members, blocks)
    if not groups and labels is None:
        return {"mesh": {kind: np.arange(len(nodes)) for kind, nodes in cells.items()}}, facets, node_sets
    if everything:
        _check_all_labelled(groups, cells, "cell set" if tags is None else f"label in {tags!r}", source)
    return groups, facets, node_sets


def _sets(mesh: meshio.Mesh, blocks: Sequence[Block], source: str) -> dict[Label, Members]:
    """Cell sets, one array per block."""
    sets: dict[Label, Members] = {}
    for name, given in mesh.cell_sets.items():
        if name in _NO_LABELS:
            continue
        members = [np.zeros(0, int) if part is None else np.asarray(part, dtype=np.int64) for part in given]
        fits = len(members) == len(blocks) and all(
            part.ndim == 1 and (not part.size or (part.min() >= 0 and part.max() < block.size))
            for part, block in zip(members, blocks, strict=True)
        )
        if not fits:
            raise InvalidInputError(
                f"cell set {name!r} of {source} must list cells of each of the {len(blocks)} blocks, it may "
                "be a set of sets: list the cells, or choose other labels, such as 'pieces' or cell data"
            )
        sets[name] = members
    return sets


def _node_sets(mesh: meshio.Mesh) -> dict[Label, Iterable[int]]:
    """Node sets, and the families of nodes of MED files, which may have several names."""
    sets: dict[Label, Iterable[int]] = dict(mesh.point_sets)
    families = np.asarray(mesh.point_data.get("point_tags", ()))
    for name, tags in _families(getattr(mesh, "point_tags", {})).items():
        sets[name] = np.flatnonzero(np.isin(families, tags))
    return sets


def _families(names: Mapping[int, Sequence[str]]) -> dict[str, list[int]]:
    """Name to the families of a MED file with that name."""
    families: dict[str, list[int]] = {}
    for tag, several in names.items():
        for name in several:
            families.setdefault(name, []).append(tag)
    return families


def _tag_array(
    mesh: meshio.Mesh, blocks: Sequence[Block], labels: str | None, sets: Collection[Label], source: str
) -> str | None:
    """Return the name of the cell data used as labels; None if sets are used, or nothing."""
    whole = [name for name, data in mesh.cell_data.items() if _holds_integers(data, blocks)]
    if labels in ("sets", "blocks", "pieces"):
        if labels == "sets" and not sets:
            raise InvalidInputError(f'labels="sets" needs cell sets, {source} has none: it has {whole}')
        return None
    if labels is not None:
        if labels not in whole:
            raise InvalidInputError(
                f"labels must be 'sets', 'blocks', 'pieces' or cell data of integers {whole}, got {labels!r}"
            )
        return labels
    if sets:
        return None
    candidates = [name for name in _USUAL if name in whole] or [n for n in whole if n not in _NO_LABELS]
    if len(candidates) > 1:
        raise InvalidInputError(
            f"one kind of cell data must say what bodies are, {source} has {candidates}: give labels="
        )
    return candidates[0] if candidates else None


def _holds_integers(data: Sequence[np.ndarray], blocks: Sequence[Block]) -> bool:
    """Whether there is one integer for every cell; some formats write it as a floating-point number."""
    parts = [np.asarray(part) for part, block in zip(data, blocks, strict=True) if block.size]
    return all(
        part.dtype.kind in "iuf" and part.size == len(part) and bool(np.all(np.mod(part, 1) == 0))
        for part in parts
    )


def _by_tag(mesh: meshio.Mesh, name: str) -> dict[Label, Members]:
    """Convert cell data to sets; numbers are replaced by their names in gmsh and MED files."""
    data = [np.asarray(part).ravel().astype(np.int64) for part in mesh.cell_data[name]]
    members: dict[Label, Members] = {}
    if name == "cell_tags" and (families := _families(getattr(mesh, "cell_tags", {}))):
        return {label: [np.flatnonzero(np.isin(p, tags)) for p in data] for label, tags in families.items()}
    named: dict[tuple[int, int], str] = {}
    if name == "gmsh:physical":
        named = {(int(pair[0]), int(pair[1])): text for text, pair in mesh.field_data.items()}
    for tag in np.unique(np.concatenate(data)):
        for dim in sorted({block.dim for block in mesh.cells}):
            label: Label = named.get((int(tag), dim), int(tag))
            there = [
                np.flatnonzero(part == tag) if block.dim == dim else np.zeros(0, int)
                for part, block in zip(data, mesh.cells, strict=True)
            ]
            before = members.get(label, there)
            members[label] = [np.union1d(a, b) for a, b in zip(before, there, strict=True)]
    return members


def _cells_among(members: Members, blocks: Sequence[Block]) -> bool:
    return any(part.size and block.kind for part, block in zip(members, blocks, strict=True))


def _groups(members: Mapping[Label, Members], blocks: Sequence[Block]) -> Groups:
    """Label to cells, labels without cells left out."""
    groups: Groups = {}
    for label, parts in members.items():
        kinds: dict[str, list[np.ndarray]] = {}
        for part, block in zip(parts, blocks, strict=True):
            if part.size and block.kind:
                kinds.setdefault(block.kind, []).append(block.start + part)
        if kinds:
            groups[label] = {kind: np.unique(np.concatenate(parts)) for kind, parts in kinds.items()}
    return groups


def _facets(members: Mapping[Label, Members], blocks: Sequence[Block]) -> Facets:
    """Label to facets; those with the number 0 are unmarked."""
    facets: Facets = {}
    for label, parts in members.items():
        corners = [
            block.facets[part]
            for part, block in zip(parts, blocks, strict=True)
            if part.size and block.facets.size
        ]
        if corners and label != 0:
            facets[label] = corners
    return facets


def _by_block(blocks: Sequence[Block]) -> Groups:
    chosen = [block for block in blocks if block.kind and block.size]
    return {
        f"block {number}": {block.kind: block.start + np.arange(block.size)}
        for number, block in enumerate(chosen, 1)
    }


def _pieces(cells: Mapping[str, np.ndarray]) -> Groups:
    """Cells that are connected by nodes, in the order of their first cells."""
    kinds = list(cells)
    count = 1 + max(int(nodes.max()) for nodes in cells.values())
    first = np.concatenate([np.repeat(nodes[:, 0], nodes.shape[1]) for nodes in cells.values()])
    second = np.concatenate([nodes.ravel() for nodes in cells.values()])
    graph = coo_matrix((np.ones(first.size, dtype=bool), (first, second)), shape=(count, count))
    _, of_node = connected_components(graph, directed=False)
    of_cell = np.concatenate([of_node[nodes[:, 0]] for nodes in cells.values()])
    names, start = np.unique(of_cell, return_index=True)
    ends = np.cumsum([0, *(len(nodes) for nodes in cells.values())])
    groups: Groups = {}
    for number, name in enumerate(names[np.argsort(start)], 1):
        groups[f"piece {number}"] = {
            kind: there
            for kind, (low, high) in zip(kinds, pairwise(ends), strict=True)
            if (there := np.flatnonzero(of_cell[low:high] == name)).size
        }
    return groups


def _check_all_labelled(groups: Groups, cells: Mapping[str, np.ndarray], word: str, source: str) -> None:
    """Reject a mesh with cells in no group: they would be lost silently."""
    for kind, nodes in cells.items():
        there = [group[kind] for group in groups.values() if kind in group]
        fits = np.isin(np.arange(len(nodes)), np.concatenate(there) if there else [])
        remedy = "give the rest one of its own, or say with bodies= which are wanted"
        check_each(fits, labelled(word, source), remedy, f"of type {kind} cell {{}}".format)


@naming_arguments
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
    quadrilaterals of 8 or 9 and triangles of 6; whatever order a format lists midpoints in. A body may have
    prisms, pyramids and several shapes of cells. Cells of 20, 15, 13 and 8 nodes stay as they are, see
    `mesh.serendipity`; `mesh.completed` makes them cells of 27, 18, 14 and 9.

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
            or several, cells of one body are of different orders, are degenerate or disconnected, or a
            surface lies inside a body.

    Note:
        Collective on ``comm`` if given.
    """
    path = Path(path)
    other = None if file_format or corners_only else _other_reader(path, labels)
    if other is not None:
        return other(path, bodies, surfaces, comm=comm)
    how = partial(
        _tagged, labels=labels, kept=corners_of if corners_only else _whole, everything=bodies is None
    )
    return bodies_of(on_root_then_bcast(comm, lambda: _read(path, how, file_format)), bodies, surfaces)


@naming_arguments
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
    kept = corners_of if corners_only else _whole
    tagged = _tagged(mesh, "the mesh of meshio", labels, kept, everything=bodies is None)
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
    """Read a file as meshio does, by its format or its ending."""
    require_file(path)
    import meshio

    known = meshio.extension_to_filetypes
    endings = ["".join(path.suffixes[-2:]).lower(), path.suffix.lower()]
    if file_format is None and not any(ending in known for ending in endings):
        raise InvalidInputError(
            f"file '{path}' must end in one of {' '.join(sorted(known))}: rename it, or give file_format"
        )
    return _read_by_meshio(path, file_format)


def _read_by_meshio(path: Path, file_format: str | None) -> meshio.Mesh:
    """Read a file; meshio reports errors by various exceptions, by text, or by exiting Python."""
    import meshio

    said = io.StringIO()
    try:
        # Whether an STL file is binary it asks by a product of letters, which overflows in NumPy 2.
        with redirect_stdout(said), redirect_stderr(said), np.errstate(over="ignore"):
            return meshio.read(path, file_format)
    except ImportError as reason:
        raise InvalidInputError(
            f"meshio needs the library {reason.name!r} to read '{path}': pip install {reason.name}"
        ) from reason
    except (Exception, SystemExit) as reason:
        words = " ".join(f"{said.getvalue()} {'' if isinstance(reason, SystemExit) else reason}".split())
        raise InvalidInputError(
            f"file '{path}' must be a mesh that meshio can read, it says: {words or type(reason).__name__}"
        ) from reason


def _whole(mesh: meshio.Mesh) -> meshio.Mesh:
    return mesh


def _tagged(
    given: meshio.Mesh,
    source: str,
    labels: str | None,
    kept: Callable[[meshio.Mesh], meshio.Mesh],
    *,
    everything: bool,
) -> TaggedMesh:
    mesh = kept(given)
    points, blocks, cells = cells_of(mesh, source)
    groups, facets, node_sets = labels_of(mesh, blocks, cells, labels, source, everything)
    return TaggedMesh(source, points, cells, groups, facets, ("cell label", "facet label"), node_sets)
