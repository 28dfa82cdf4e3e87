"""Content of a mesh file of any format: points, cells, and labels on cells and facets."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError

Label = str | int
"""A physical name of gmsh, or a numeric tag."""


@dataclass(frozen=True, eq=False)
class TaggedMesh:
    """Points, cells and their labels.

    Attributes:
        source: Where it comes from, for messages: ``"file 'beam.msh'"``.
        points: Coordinates, (n_nodes, 3 | 2).
        cells: Cell type to node numbers in VTK order, (n_cells, nodes of a cell).
        groups: Label to cell type to the numbers of its cells.
        facets: Label to the corners of facets, arrays of (n, 4 | 3 | 2) node numbers; in any order.
        words: Names of its labels, for messages: ``"physical volume"``, ``"physical surface"``.
        node_sets: Label to node numbers, in any order: the facets on the boundary of a body all of whose
            corners are among them.
    """

    source: str
    points: np.ndarray
    cells: Mapping[str, np.ndarray]
    groups: Mapping[Label, Mapping[str, np.ndarray]]
    facets: Mapping[Label, Sequence[np.ndarray]]
    words: tuple[str, str]
    node_sets: Mapping[Label, np.ndarray] = field(default_factory=dict)

    @property
    def dim(self) -> int:
        """Dimension of the space, 2 or 3."""
        return int(self.points.shape[1])


@dataclass(frozen=True)
class BodyParts:
    """The groups of a body.

    Attributes:
        labels: The groups.
        regions: Their names as regions, or None for a body without regions.
    """

    labels: tuple[Label, ...]
    regions: tuple[str, ...] | None


@dataclass(frozen=True, eq=False)
class SurfaceParts:
    """The parts of a surface.

    Attributes:
        facets: Corners of facets, arrays of (n, 4 | 3 | 2) node numbers.
        nodes: Sets of node numbers.
    """

    facets: Sequence[np.ndarray]
    nodes: Sequence[np.ndarray]


def chosen_bodies(mesh: TaggedMesh, bodies: Any) -> dict[str, BodyParts]:
    """Resolve the caller's choice of bodies.

    Args:
        mesh: The mesh with its groups.
        bodies: None for every group; a list of labels; or name of the body to a label, to a list of labels,
            or to a mapping from the name of a region to a label.

    Returns:
        Name of the body to its groups.

    Raises:
        InvalidInputError: If a label is not there.
    """
    if bodies is None:
        bodies = list(mesh.groups)
    if isinstance(bodies, (str, int)):
        bodies = [bodies]
    if not isinstance(bodies, Mapping):
        bodies = {str(label): label for label in bodies}
    chosen = {}
    for name, wanted in bodies.items():
        parts = _parts(wanted)
        labels = _known(parts.labels, mesh.groups, f"body '{name}'", mesh.words[0], mesh.source)
        chosen[name] = BodyParts(labels, parts.regions)
    if not chosen:
        raise InvalidInputError(
            f"{mesh.source} must have a {mesh.words[0]} for a body, there is none: name what the bodies are"
        )
    return chosen


def chosen_surfaces(mesh: TaggedMesh, surfaces: Any) -> dict[str, SurfaceParts]:
    """Resolve the caller's choice of surfaces, in the same forms but without regions.

    Returns:
        Name of the surface to its facets and sets of nodes.

    Raises:
        InvalidInputError: If a label is not there.
    """
    known = {**mesh.node_sets, **mesh.facets}
    if surfaces is None:
        surfaces = list(known)
    if isinstance(surfaces, (str, int)):
        surfaces = [surfaces]
    if not isinstance(surfaces, Mapping):
        surfaces = {str(label): label for label in surfaces}
    chosen = {}
    for name, wanted in surfaces.items():
        labels = _known(_parts(wanted).labels, known, f"surface '{name}'", mesh.words[1], mesh.source)
        chosen[name] = SurfaceParts(
            [block for label in labels for block in mesh.facets.get(label, ())],
            [mesh.node_sets[label] for label in labels if label not in mesh.facets],
        )
    return chosen


def _parts(wanted: Any) -> BodyParts:
    if isinstance(wanted, Mapping):
        return BodyParts(tuple(wanted.values()), tuple(map(str, wanted)))
    if isinstance(wanted, (str, int, np.integer)):
        return BodyParts((wanted,), None)  # type: ignore[arg-type]
    return BodyParts(tuple(wanted), tuple(map(str, wanted)))


def _known(
    labels: Iterable[Label], known: Mapping[Label, object], what: str, word: str, source: str
) -> tuple[Label, ...]:
    """Return the labels as in the mesh; a number may also be given as text."""
    by_text = {str(label): label for label in known}
    for label in labels:
        if not isinstance(label, Hashable) or str(label) not in by_text:
            there = ", ".join(map(repr, known)) or "none at all"
            raise InvalidInputError(
                f"{what} needs the {word} {label!r}, which {source} does not have: it has {there}"
            )
    return tuple(by_text[str(label)] for label in labels)
