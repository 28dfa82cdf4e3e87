"""From a mesh file's labels to bodies: the cells of each body, and the facets on its boundary."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.collapsed import has_collapsed, joined_cells, shape_of
from fenics_contact.mesh.faces import (
    boundary_faces,
    cell_faces,
    coincident_pairs,
    corners_of,
    match_faces,
    widened,
)
from fenics_contact.mesh.quadratic_nodes import with_centres
from fenics_contact.mesh.serendipity_cells import serendipity

Label = str | int
"""A physical name of gmsh, or a numeric tag."""


@dataclass(frozen=True, eq=False)
class TaggedMesh:
    """Points, cells and their labels.

    `source`: where it comes from, for messages: ``"file 'beam.msh'"``; `cells`: cell type, by any name, to
    node numbers in VTK order, also of prisms, pyramids and serendipity cells; `groups`: label to cell type to
    the numbers of its cells; `facets`: label to the corners of facets, in any order; `words`: names of its
    labels, for messages: ``"physical volume"``; `node_sets`: label to nodes, of which the facets on a body's
    boundary with all corners among them are meant; `point_sets`: label to single nodes; `coincident_nodes`:
    whether nodes of one body may coincide.
    """

    source: str
    points: np.ndarray
    cells: Mapping[str, np.ndarray]
    groups: Mapping[Label, Mapping[str, np.ndarray]]
    facets: Mapping[Label, Sequence[np.ndarray]]
    words: tuple[str, str]
    node_sets: Mapping[Label, np.ndarray] = field(default_factory=dict)
    point_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    coincident_nodes: bool = False

    @property
    def dim(self) -> int:
        """Dimension of the space, 2 or 3."""
        return int(self.points.shape[1])


@dataclass(frozen=True)
class BodyParts:
    """The groups of a body, and the regions that they are, if any."""

    labels: tuple[Label, ...]
    regions: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SurfaceParts:
    """The parts of a surface.

    `facets`: corners of facets, arrays of (n, 4 | 3 | 2) node numbers.
    """

    facets: Sequence[np.ndarray]
    nodes: Sequence[np.ndarray]


def chosen_bodies(mesh: TaggedMesh, bodies: Any) -> dict[str, BodyParts]:
    """Resolve the caller's choice of bodies.

    It is None for every group; a list of labels; or name of the body to a label, to a list of labels, or to a
    mapping from the name of a region to a label.
    """
    chosen = {}
    for name, wanted in by_name(list(mesh.groups) if bodies is None else bodies).items():
        parts = _parts(wanted)
        labels = _known(parts.labels, mesh.groups, f"body '{name}'", mesh.words[0], mesh.source)
        chosen[name] = BodyParts(labels, parts.regions)
    if not chosen:
        raise InvalidInputError(f"{mesh.source} has no {mesh.words[0]} for a body: name what the bodies are")
    return chosen


def chosen_surfaces(mesh: TaggedMesh, surfaces: Any) -> dict[str, SurfaceParts]:
    """Resolve the caller's choice of surfaces, in the same forms but without regions."""
    known = {**mesh.node_sets, **mesh.facets}
    chosen = {}
    for name, wanted in by_name(list(known) if surfaces is None else surfaces).items():
        labels = _known(_parts(wanted).labels, known, f"surface '{name}'", mesh.words[1], mesh.source)
        chosen[name] = SurfaceParts(
            [block for label in labels for block in mesh.facets.get(label, ())],
            [mesh.node_sets[label] for label in labels if label not in mesh.facets],
        )
    return chosen


def listed(labels: Any) -> list[Any]:
    """Return labels, of which one alone need not be in a list."""
    return [labels] if isinstance(labels, (str, int, np.integer)) else list(labels)


def by_name(wanted: Any) -> Mapping[str, Any]:
    """Return what is wanted by its name, which for labels alone is their text."""
    return wanted if isinstance(wanted, Mapping) else {str(label): label for label in listed(wanted)}


def _parts(wanted: Any) -> BodyParts:
    names = by_name(wanted)
    alone = listed(wanted) == [wanted]  # one label, whose group is not a region
    return BodyParts(tuple(names.values()), () if alone else tuple(map(str, names)))


def _known(
    labels: Iterable[Label], known: Mapping[Label, object], what: str, word: str, source: str
) -> tuple[Label, ...]:
    """Return the labels as in the mesh; a number may also be given as text."""
    by_text = {str(label): label for label in known}
    for label in labels:
        if not isinstance(label, Hashable) or str(label) not in by_text:
            there = ", ".join(map(repr, known)) or "none at all"
            raise InvalidInputError(f"{what} needs the {word} {label!r}, {source} has {there}")
    return tuple(by_text[str(label)] for label in labels)


Facets = Mapping[str, SurfaceParts]
"""Name of a surface to its parts."""


def bodies_of(mesh: TaggedMesh, bodies: Any = None, surfaces: Any = None) -> dict[str, BodyMesh]:
    """Build bodies from a mesh with labels.

    Every body has its own nodes: those on a boundary that two bodies share are duplicated. A surface belongs
    to every body on whose boundary some of its facets lie.
    """
    points, cells = with_centres(mesh.points, mesh.cells, mesh.dim)
    follow = {kind for kind, rows in cells.items() if rows.shape != mesh.cells[kind].shape}
    mesh = replace(mesh, points=points, cells=cells)
    chosen, facets = chosen_bodies(mesh, bodies), chosen_surfaces(mesh, surfaces)
    _check_facets_belong(mesh, facets)
    owner = {kind: np.full(len(cells), -1) for kind, cells in mesh.cells.items()}
    result = {}
    for number, (name, parts) in enumerate(chosen.items()):
        found = _cells_of(mesh, name, parts)
        for kind, numbers, _ in found:
            taken = owner[kind][numbers]
            if np.any(taken >= 0):
                other = list(chosen)[int(taken.max())]
                raise InvalidInputError(
                    f"a cell must belong to one body, {np.count_nonzero(taken >= 0)} of {mesh.source} are of "
                    f"'{other}' and '{name}': say which {mesh.words[0]}s are bodies by bodies={{name: label}}"
                )
            owner[kind][numbers] = number
        cells = {kind: mesh.cells[kind][numbers] for kind, numbers, _ in found}
        _checked_order(mesh, name, cells)
        rows = one_array(cells, mesh.dim)
        region = np.concatenate([region for _, _, region in found])
        body = _body(mesh, name, rows, parts.regions, region, facets)
        lacking = {kind in follow for kind, _, _ in found if len(square_columns(mesh, kind))}
        result[name] = serendipity(body) if lacking == {True} else body
    if surfaces is not None:
        _check_nodes_make_facets(mesh, facets, result)
    return result


def cells_of_bodies(mesh: TaggedMesh, bodies: Any = None) -> dict[str, np.ndarray]:
    """Return the ascending numbers of each body's cells; arguments as in `bodies_of`."""
    return {name: _cells_of(mesh, name, parts)[0][1] for name, parts in chosen_bodies(mesh, bodies).items()}


def square_columns(mesh: TaggedMesh, kind: str) -> np.ndarray:
    """Return the nodes of cells of a type on faces that have centres where they are quadratic, (n, 9)."""
    shape = shape_of(mesh.cells[kind].shape[1], mesh.dim)
    return shape.square_columns if mesh.cells[kind].shape[1] > shape.corners else np.zeros((0, 9), dtype=int)


def _checked_order(mesh: TaggedMesh, name: str, cells: Mapping[str, np.ndarray]) -> None:
    """Reject cells of both orders in one body."""
    orders = {rows.shape[1] > shape_of(rows.shape[1], mesh.dim).corners for rows in cells.values()}
    if len(orders) > 1:
        raise InvalidInputError(
            f"body '{name}' of {mesh.source} has both linear and quadratic cells: mesh it with one"
        )


def one_array(cells: Mapping[str, np.ndarray], dim: int) -> np.ndarray:
    """Return the nodes of complete cells, those of one shape as they are, of several as hexahedra."""
    shapes = {kind: shape_of(rows.shape[1], dim) for kind, rows in cells.items()}
    first = next(iter(shapes.values()))
    if len(cells) == 1 and (first.is_whole or first.is_simplex):
        return next(iter(cells.values()))
    return np.concatenate([joined_cells({shapes[kind].name: rows}, dim) for kind, rows in cells.items()])


def _cells_of(mesh: TaggedMesh, name: str, parts: BodyParts) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return the cell types of a body, of each its ascending cells, and the group of each."""
    chosen = [
        (kind, cells, n) for n, label in enumerate(parts.labels) for kind, cells in mesh.groups[label].items()
    ]
    chosen = [(kind, cells, n) for kind, cells, n in chosen if cells.size]
    if not chosen:
        raise InvalidInputError(f"body '{name}' of {mesh.source} has no cells: mesh it, or leave it out")
    kinds = sorted({kind for kind, _, _ in chosen})
    return [_cells_of_kind(mesh, name, parts, kind, chosen) for kind in kinds]


def _cells_of_kind(
    mesh: TaggedMesh, name: str, parts: BodyParts, kind: str, chosen: list[tuple[str, np.ndarray, int]]
) -> tuple[str, np.ndarray, np.ndarray]:
    mine = [(cells, n) for each, cells, n in chosen if each == kind]
    cells = np.concatenate([cells for cells, _ in mine])
    region = np.concatenate([np.full(cells.size, n) for cells, n in mine])
    order = np.argsort(cells, kind="stable")
    cells, region = cells[order], region[order]
    double = np.flatnonzero(np.diff(cells) == 0)
    if double.size:
        pair = [parts.labels[region[double[0] + i]] for i in (0, 1)]
        raise InvalidInputError(
            f"{double.size} cells of body '{name}' of {mesh.source} belong to {pair[0]!r} and {pair[1]!r}"
        )
    return kind, cells, region


def _body(
    mesh: TaggedMesh,
    name: str,
    cells: np.ndarray,
    regions: Sequence[str],
    region: np.ndarray,
    facets: Facets,
) -> BodyMesh:
    """Number the nodes of a body from zero and find the surfaces on its boundary."""
    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    number = np.full(mesh.points.shape[0], -1, dtype=np.int64)
    number[nodes] = np.arange(nodes.size)
    boundary, _ = boundary_faces(local, mesh.dim)
    corners = corners_of(boundary, mesh.dim)
    surfaces = {}
    for surface, parts in facets.items():
        members: list[np.ndarray] = [np.zeros(0, dtype=np.int64)]
        widths = {corners.shape[1], 3} if has_collapsed(local, mesh.dim) else {corners.shape[1]}
        mine = [number[block] for block in parts.facets if block.shape[1] in widths]
        mine = [widened(block, corners.shape[1]) for block in mine]
        mine = [block[(block >= 0).all(axis=1)] for block in mine]
        if mine and (candidates := np.concatenate(mine)).size:
            matches = match_faces(candidates, corners)
            _check_none_inside(mesh, name, surface, candidates[matches < 0], local)
            members.append(matches[matches >= 0])
        for inside in parts.nodes:
            members.append(np.flatnonzero(np.isin(nodes[corners], inside).all(axis=1)))
        if (there := np.unique(np.concatenate(members))).size:
            surfaces[surface] = boundary[there]
    named = {label: np.flatnonzero(region == n) for n, label in enumerate(regions)}
    held = {label: number[inside][number[inside] >= 0] for label, inside in mesh.point_sets.items()}
    held = {label: inside for label, inside in held.items() if len(inside) and label not in surfaces}
    try:
        points = mesh.points[nodes]
        cracked = mesh.coincident_nodes and len(coincident_pairs(points)) > 0
        return BodyMesh(
            points, local, surfaces, regions=named, node_sets=held, coincident_nodes=cracked
        )  # fmt: skip
    except InvalidInputError as error:
        raise InvalidInputError(f"body '{name}' of {mesh.source} is no sound mesh: {error}") from error


def _check_none_inside(
    mesh: TaggedMesh, name: str, surface: str, facets: np.ndarray, cells: np.ndarray
) -> None:
    """Reject facets between two cells of one body; facets that are not faces of it belong to other bodies."""
    faces = cell_faces(cells, mesh.dim)
    inside = (
        np.count_nonzero(match_faces(facets, corners_of(faces.reshape(-1, faces.shape[2]), mesh.dim)) >= 0)
        if facets.size
        else 0
    )
    if inside:
        raise InvalidInputError(
            f"{inside} facets of '{surface}' of {mesh.source} lie inside body '{name}': make bodies of both "
            "sides, or leave the surface out with surfaces=[...]"
        )


def _check_nodes_make_facets(mesh: TaggedMesh, facets: Facets, bodies: Mapping[str, BodyMesh]) -> None:
    """Reject a requested surface that is a set of nodes without all nodes of any facet."""
    for name, parts in facets.items():
        if parts.nodes and not any(name in body.surfaces for body in bodies.values()):
            count = sum(len(nodes) for nodes in parts.nodes)
            raise InvalidInputError(
                f"{count} nodes of '{name}' of {mesh.source} hold no whole facet: save facets, or all nodes"
            )


def _check_facets_belong(mesh: TaggedMesh, surfaces: Facets) -> None:
    """Reject facets that are not faces of cells."""
    known = []
    for kind, rows in mesh.cells.items():
        faces = cell_faces(one_array({kind: rows}, mesh.dim), mesh.dim)
        known.append(widened(corners_of(faces.reshape(-1, faces.shape[2]), mesh.dim), 2 * (mesh.dim - 1)))
    faces = np.concatenate(known)
    blocks = [(name, block) for name, parts in surfaces.items() for block in parts.facets]
    for width in {block.shape[1] for _, block in blocks}:
        some = [(name, block) for name, block in blocks if block.shape[1] == width]
        lost = match_faces(np.concatenate([block for _, block in some]), faces) < 0
        ends = np.cumsum([len(block) for _, block in some])[:-1]
        for (name, block), off in zip(some, np.split(lost, ends), strict=True):
            if off.any():
                place = ", ".join(f"{x:.6g}" for x in mesh.points[block[np.argmax(off)]].mean(axis=0))
                raise InvalidInputError(
                    f"a surface must consist of faces of cells, {np.count_nonzero(off)} of {len(block)} "
                    f"facets of '{name}' of {mesh.source} are none, first at ({place}): mesh both together"
                )


def other_cells(
    source: str, kind: str, known: str = "tetrahedra, pyramids, prisms or hexahedra"
) -> InvalidInputError:
    """Return an error about cells of a type that cannot be read."""
    plane = "(in the plane triangles or quadrilaterals)"
    return InvalidInputError(f"cells must be {known} {plane}, {source} has {kind!r}: mesh it without these")


def labelled(word: str, source: str) -> str:
    """Say what cells need to be read."""
    return f"every cell of {source} must have a {word}, which says what body it is"
