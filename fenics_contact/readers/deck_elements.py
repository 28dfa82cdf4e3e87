"""Types of elements of a deck, and elements that list nodes twice."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import permutations, product

import numpy as np

from fenics_contact.mesh.cell_types import HEXAHEDRON, QUADRILATERAL
from fenics_contact.mesh.collapsed import (
    PRISM_SHAPE,
    PYRAMID_SHAPE,
    TETRAHEDRON_SHAPE,
    TRIANGLE_SHAPE,
    Shape,
)
from fenics_contact.readers.deck_cards import Card


@dataclass(frozen=True, eq=False)
class Element:
    """One type of elements.

    `kind`: "solid", "plane stress", "plane strain" or "axisymmetric"; `cell`: name of the type of cells that
    has its nodes; `variant`: letters behind the number: "R" for reduced integration, "I" for incompatible
    modes.
    """

    name: str
    kind: str
    cell: str
    count: int
    variant: str

    @property
    def dim(self) -> int:
        """Dimension of its space."""
        return 3 if self.kind == "solid" else 2

    @property
    def shape(self) -> str:
        """Name of the linear cell of its shape."""
        return re.sub(r"\d+$", "", self.cell)

    @property
    def faces(self) -> Sequence[Sequence[int]]:
        """Positions of the corners of its faces S1, S2, ..., without regard to their sense."""
        return _FACES[self.shape]

    @property
    def written(self) -> Sequence[int]:
        """Positions of its nodes in the order in which the deck lists them."""
        return range(self.count)

    @property
    def is_reduced(self) -> bool:
        """Whether it is integrated by fewer points."""
        return self.variant == "R" and self.cell in ("hexahedron20", "quadrilateral8")

    @property
    def listed(self) -> int:
        """Number of nodes that the deck lists for it."""
        return len(self.written)

    @property
    def given(self) -> tuple[int, Sequence[int]]:
        """Dimension of the element that the deck has, and positions of nodes that belong to its own."""
        return self.dim, self.written

    @property
    def is_row(self) -> bool:
        """Whether it is one of a row of cells that a beam has become."""
        return False

    @property
    def outer(self) -> int:
        """Number of the faces that may be outside of what elements make up."""
        return len(self.faces)

    @property
    def instead(self) -> str:
        """Type as which it is solved, and why, where that is another one."""
        return ""

    def side(self, label: str) -> int:
        """Return the position of the face that a label names, "S3" or "P3", −1 where there is none."""
        place = int(label[1:]) - 1 if label[:1] in "SP" and label[1:].isdecimal() else -1
        return place if place < len(self.faces) else -1

    @cached_property
    def edges(self) -> Sequence[tuple[int, int, int]]:
        """Positions of the ends of its edges and of the nodes in their middles, without these nothing."""
        corners = 1 + max(max(face) for face in self.faces)
        inner = range(corners, self.count)
        return [(*edge, n) for n, edge in zip(inner, _EDGES[self.shape], strict=False)]

    @cached_property
    def face_nodes(self) -> Sequence[Sequence[int]]:
        """Positions of all nodes of its faces: corners, then those in the middle of edges."""
        corners = 1 + max(max(face) for face in self.faces)
        edges, inner = _EDGES[self.shape], range(corners, self.count)
        return [
            [*face, *(n for n, edge in zip(inner, edges, strict=False) if set(edge) <= set(face))]
            for face in self.faces
        ]

    @cached_property
    def rims(self) -> Sequence[Sequence[int]]:
        """Positions of the nodes of its faces in their order around the face, of plane elements along it."""
        corners = 1 + max(map(max, self.faces))
        between = {frozenset(edge): corners + k for k, edge in enumerate(_EDGES[self.shape])}
        found = []
        for face in self.faces:
            ends = list(zip(face, [*face[1:], face[0]], strict=True))[: len(face) - (self.dim == 2)]
            rim = [n for end in ends for n in (end[0], between[frozenset(end)]) if n < self.count]
            found.append(rim if self.dim == 3 else [*rim, face[-1]])
        return found


_KINDS = {"C3D": "solid", "CPS": "plane stress", "CPE": "plane strain", "CAX": "axisymmetric"}
_CELLS = {
    3: {
        4: "tetrahedron",
        10: "tetrahedron10",
        8: "hexahedron",
        20: "hexahedron20",
        6: "wedge",
        15: "wedge15",
    },
    2: {3: "triangle", 6: "triangle6", 4: "quadrilateral", 8: "quadrilateral8"},
}
#: Corners of the faces of elements as CalculiX and Abaqus number them, from zero.
_FACES: dict[str, Sequence[Sequence[int]]] = {
    "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0),
    ),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
}  # fmt: skip
#: Ends of the edges on which nodes beyond the corners lie, in their order.
_EDGES: dict[str, Sequence[tuple[int, int]]] = {
    "tetrahedron": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "hexahedron": (
        (0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7),
    ),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
}  # fmt: skip
_TYPE = re.compile(r"(C3D|CPS|CPE|CAX)(\d+)([RIHMT]*)")


@dataclass(frozen=True, eq=False)
class Thin(Element):
    """Elements of a surface or a line, which become solid cells."""

    @property
    def dim(self) -> int:
        """Dimension of its space."""
        return 3

    @property
    def outer(self) -> int:
        """None: which side is meant must be said."""
        return 0


@dataclass(frozen=True, eq=False)
class Shell(Thin):
    """Elements of a surface, whose sides and edges are faces of the solid cell that they become."""

    @property
    def faces(self) -> Sequence[Sequence[int]]:
        """Positions of the corners of both sides, and of its edges."""
        corners = tuple(range(3 if self.count in (3, 6) else 4))
        return (corners, corners, *zip(corners, (*corners[1:], 0), strict=True))

    def side(self, label: str) -> int:
        """Return the position of the face that a label names: of both sides "SNEG" and "SPOS"."""
        return _SIDES[label] if label in _SIDES else super().side(label)


@dataclass(frozen=True, eq=False)
class Beam(Thin):
    """Elements of a line; the faces of the solid cell that they become have its nodes."""

    @property
    def faces(self) -> Sequence[Sequence[int]]:
        """Its nodes for each face of the solid cell."""
        return (tuple(range(self.count)),) * 6

    @property
    def face_nodes(self) -> Sequence[Sequence[int]]:  # type: ignore[override]
        """Its nodes for each face of the solid cell."""
        return self.faces

    def side(self, label: str) -> int:
        """Return the position of the face of the solid cell that a label names."""
        return _ACROSS.get(label, -1)


@dataclass(frozen=True, eq=False)
class Layer(Element):
    """Solid cells that shells have become.

    `listed`: number of nodes of these; `instead`: type as which those without midpoints are solved, and why.
    """

    listed: int = 0  # type: ignore[misc]
    instead: str = ""  # type: ignore[misc]

    @classmethod
    def of(cls, shell: Element) -> Layer:
        """Return that of shells."""
        instead = _RAISED.get(shell.name.rstrip("R"), "")
        if shell.count in (3, 6):
            return cls("C3D15", "solid", "wedge15", 15, "", shell.count, instead)
        variant = "" if shell.name == "S8" else "R"
        return cls(f"C3D20{variant}", "solid", "hexahedron20", 20, variant, shell.count, instead)

    @property
    def given(self) -> tuple[int, Sequence[int]]:
        """That of shells, and the nodes at the bottom in their order."""
        width = 3 if self.listed in (3, 6) else 4
        return 2, [*range(width), *range(2 * width, 3 * width)][: self.listed]

    def side(self, label: str) -> int:
        """Return the position of the face that a label names: of both sides "SNEG" and "SPOS"."""
        return _SIDES[label] if label in _SIDES else super().side(label)


@dataclass(frozen=True, eq=False)
class Row(Layer):
    """Solid cells that beams have become, whose first direction is along these."""

    @property
    def given(self) -> tuple[int, Sequence[int]]:
        """That of beams, and a node at each end, then one in the middle."""
        return 1, (0, 1, 8)[: self.listed]

    @property
    def is_row(self) -> bool:
        """Whether it is one of a row of cells that a beam has become."""
        return True

    @classmethod
    def of(cls, beam: Element) -> Row:
        """Return that of beams."""
        instead = _RAISED.get(beam.name.rstrip("R"), "")
        variant = "" if beam.name == "B32" else "R"
        return cls(f"C3D20{variant}", "solid", "hexahedron20", 20, variant, beam.count, instead)

    def side(self, label: str) -> int:
        """Return the position of the face of the solid cell that a label of beams names."""
        return _ACROSS.get(label, -1)


#: Faces of shells that have names, of edges those of Abaqus; a pressure without a number acts on the first.
_SIDES = {"SNEG": 0, "SPOS": 1, "P": 0, "E1": 2, "E2": 3, "E3": 4, "E4": 5}
#: Types of shells with the number of their nodes.
_SHELLS = {"S3": 3, "S3R": 3, "S4": 4, "S4R": 4, "S6": 6, "S8": 8, "S8R": 8}
#: Types of beams with the number of their nodes.
_BEAMS = {"B31": 2, "B31R": 2, "B32": 3, "B32R": 3}
#: Faces of the cells of beams by their labels: pressures along directions 1 and 2, and sides of surfaces.
_ACROSS = {"P1": 0, "P2": 4, "S1": 0, "S2": 1, "S3": 2, "S5": 4}
#: As what elements without midpoints are solved, by their types without "R".
_RAISED = {
    "S3": "S6: CalculiX's own lock or hourglass", "S4": "S8R: CalculiX's own lock or hourglass",
    "B31": "B32R: CalculiX's own have incompatible modes, or hourglass",
}  # fmt: skip


#: What elements of other programs are, by how their types begin.
_OTHERS = {
    "STRI": ", shells,", "SC": ", shells,", "S": ", shells,", "B": ", beams,",
    "M3D": ", membranes,", "DASHPOT": ", dashpots,", "GAP": ", gaps,",
    "DC": ", which conduct heat,", "F3D": ", fluids,", "COH": ", cohesive ones,", "R3D": ", rigid ones,",
}  # fmt: skip


def element_of(card: Card) -> Element:
    """Return the type of the elements of a card."""
    name = card.required("TYPE")
    if name in _SHELLS:
        return Shell(name, "shell", "shell", _SHELLS[name], "")
    if name in _BEAMS:
        return Beam(name, "beam", "beam", _BEAMS[name], "")
    match = _TYPE.fullmatch(name)
    kind = _KINDS[match.group(1)] if match else ""
    count = int(match.group(2)) if match else 0
    cell = _CELLS[3 if kind == "solid" else 2].get(count)
    if match is None or cell is None:
        what = next((words for start, words in _OTHERS.items() if name.startswith(start)), "")
        raise card.error(
            f"elements of type {name}{what} are not supported: give solids (C3D4, 6, 8, 10, 15, 20), shells "
            "(S3, 4, 6, 8), beams (B31, B32), plane ones (CPS, CPE 3, 4, 6, 8) or axisymmetric ones (CAX)"
        )
    return Element(name, kind, cell, count, match.group(3))


@dataclass(frozen=True, eq=False)
class Collapsed(Element):
    """Hexahedra or quadrilaterals that list nodes twice, as the prisms, pyramids, ... that they are.

    `onto`: position of the node that stands in each place of the element as the deck lists it; the faces are
    those of the hexahedron or quadrilateral, empty where they are no more than an edge or a node.
    """

    onto: tuple[int, ...] = ()

    @property
    def written(self) -> Sequence[int]:
        """Positions of its nodes in the order in which the deck lists them."""
        return self.onto

    @property
    def faces(self) -> Sequence[Sequence[int]]:
        """Positions of the corners of its faces."""
        whole = _FACES["hexahedron" if self.dim == 3 else "quadrilateral"]
        kept = (tuple(dict.fromkeys(self.onto[place] for place in face)) for face in whole)
        return [face if len(face) >= self.dim else () for face in kept]

    @property
    def edges(self) -> Sequence[tuple[int, int, int]]:  # type: ignore[override]
        """No edges with nodes in their middles."""
        return []

    @property
    def face_nodes(self) -> Sequence[Sequence[int]]:  # type: ignore[override]
        """Positions of all nodes of its faces."""
        return self.faces

    @property
    def rims(self) -> Sequence[Sequence[int]]:  # type: ignore[override]
        """Positions of the nodes of its faces in their order around the face."""
        return self.faces


#: Cells of elements whose nodes may repeat.
_WHOLE = {"hexahedron": HEXAHEDRON, "quadrilateral": QUADRILATERAL}
_SHAPES = {3: (PRISM_SHAPE, PYRAMID_SHAPE, TETRAHEDRON_SHAPE), 2: (TRIANGLE_SHAPE,)}


def without_repeated(
    element: Element, nodes: np.ndarray, numbers: np.ndarray, card: Card
) -> Iterator[tuple[Element, np.ndarray, np.ndarray]]:
    """Yield elements of one shape: their type, which they are and their nodes, each once.

    Linear hexahedra and quadrilaterals that list nodes twice, as of meshes swept around an axis, are prisms,
    pyramids, tetrahedra and triangles: their functions and integrals are the same.
    """
    alike = nodes[:, :, None] == nodes[:, None, :]
    pattern, number = np.unique(alike.argmax(axis=2), axis=0, return_inverse=True)
    number = number.ravel()
    for k, row in enumerate(pattern):
        mine = np.flatnonzero(number == k)
        if len(set(row.tolist())) == element.count:
            yield element, mine, nodes[mine]
            continue
        found = _collapse(element.cell, tuple(row.tolist())) if element.cell in _WHOLE else None
        if found is None:
            remedy = (
                "take S3 or S6"
                if element.kind == "shell"
                else "give each its own"
                if element.kind == "beam"
                else "take CPS6, CPE6, CAX6, C3D15 or C3D10"
                if element.count > 8 or element.dim == 2
                else "they must be a prism, a pyramid or a tetrahedron"
            )
            raise card.error(
                f"{len(mine)} elements {element.name} list nodes twice, first "
                f"{card.label(numbers[mine[0]])}: {remedy}"
            )
        shape, places, onto = found
        cell = {"prism": "wedge"}.get(shape.name, shape.name)
        own = nodes[mine][:, places]
        yield Collapsed(element.name, element.kind, cell, len(places), element.variant, onto), mine, own


@cache
def _collapse(cell: str, pattern: tuple[int, ...]) -> tuple[Shape, list[int], tuple[int, ...]] | None:
    """Return the shape of cells with equal nodes, the place of each own node, and the node in each place."""
    for turn in _turns(cell):
        seen = [pattern[place] for place in turn]
        for shape in _SHAPES[_WHOLE[cell].dim]:
            firsts = [seen[shape.onto.index(vertex)] for vertex in range(shape.corners)]
            if [firsts[vertex] for vertex in shape.onto] == seen and len(set(firsts)) == shape.corners:
                places = [turn[shape.onto.index(vertex)] for vertex in range(shape.corners)]
                onto = dict(zip(turn, shape.onto, strict=True))
                return shape, places, tuple(onto[place] for place in range(len(pattern)))
    return None


def _turns(cell: str) -> list[list[int]]:
    """Return the orders of the vertices of a cell that rotations of it have."""
    vertices = 2.0 * _WHOLE[cell].nodes - 1.0
    dim, found = vertices.shape[1], []
    for axes, signs in product(permutations(range(dim)), product((1.0, -1.0), repeat=dim)):
        matrix = np.eye(dim)[list(axes)] * signs
        if np.linalg.det(matrix) > 0.0:
            away = np.abs((vertices @ matrix.T)[:, None] - vertices[None]).sum(axis=2)
            found.append(away.argmin(axis=1).tolist())
    return found
