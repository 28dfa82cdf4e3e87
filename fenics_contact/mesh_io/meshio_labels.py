"""Labels of a meshio mesh on cells, facets and nodes: named sets, and numbers that may have names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh_io.meshio_cells import Block
from fenics_contact.mesh_io.tagged_mesh import Label

if TYPE_CHECKING:
    import meshio

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
    """Return the labels of cells, facets and nodes.

    Args:
        mesh: The mesh.
        blocks: The roles of its blocks.
        cells: Cell type to nodes.
        labels: What groups the cells, see `read_mesh`.
        source: Where the mesh comes from, for messages.
        everything: Whether every cell must have a label.

    Returns:
        Label to cell type to cells, label to corners of facets, label to nodes.

    Raises:
        InvalidInputError: If ``labels`` does not exist or is needed and not given, a set does not fit the
            mesh, or a cell has no label.
    """
    sets = _sets(mesh, blocks, source)
    node_sets = {name: np.asarray(nodes, dtype=np.int64) for name, nodes in _node_sets(mesh).items()}
    of_sets = {name: members for name, members in sets.items() if _cells_among(members, blocks)}
    tags = _tag_array(mesh, blocks, labels, bool(of_sets), source)
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
                f"cell set {name!r} of {source} must list cells of each of the {len(blocks)} blocks of "
                "cells, it does not: meshio misunderstands a set of sets; list the cells themselves, or name "
                'the bodies otherwise (labels="pieces", or the name of cell data)'
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
    mesh: meshio.Mesh, blocks: Sequence[Block], labels: str | None, have_sets: bool, source: str
) -> str | None:
    """Return the name of the cell data used as labels; None if sets are used, or nothing."""
    whole = [name for name, data in mesh.cell_data.items() if _holds_integers(data, blocks)]
    if labels in ("sets", "blocks", "pieces"):
        if labels == "sets" and not have_sets:
            raise InvalidInputError(
                f'labels="sets" needs cell sets, {source} has none: it has the cell data with integers '
                f"{whole}"
            )
        return None
    if labels is not None:
        if labels not in whole:
            raise InvalidInputError(
                f"labels must name cell data with integers, or be 'sets', 'blocks' or 'pieces', {source} has "
                f"no such data {labels!r}: it has {whole or 'none at all'}"
            )
        return labels
    if have_sets:
        return None
    candidates = [name for name in _USUAL if name in whole] or [n for n in whole if n not in _NO_LABELS]
    if len(candidates) > 1:
        raise InvalidInputError(
            f"one kind of cell data must say what body a cell is part of, {source} has {candidates}: give "
            "labels=, the name of one of them"
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
            if part.size and block.facets is not None
        ]
        if corners and label != 0:
            facets[label] = corners
    return facets


def _by_block(blocks: Sequence[Block]) -> Groups:
    chosen = [block for block in blocks if block.kind and block.size]
    return {
        f"block {number}": {str(block.kind): block.start + np.arange(block.size)}
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
        left = np.setdiff1d(np.arange(len(nodes)), np.concatenate(there) if there else [])
        if left.size:
            raise InvalidInputError(
                f"every cell must have a {word}, which says what body it is, {left.size} of {len(nodes)} "
                f"cells of type {kind} of {source} have none: give the rest one of its own, or say with "
                "bodies= which are wanted"
            )
