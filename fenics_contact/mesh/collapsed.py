"""Prisms, pyramids and mixed cells: hexahedra, in the plane quadrilaterals, some of whose vertices coincide.

A body of several shapes of cells has one array of cells, each a hexahedron of 8 or 27 nodes. A prism lists
two nodes twice, [0, 1, 2, 2, 3, 4, 5, 5], a pyramid its apex four times, a tetrahedron is
[0, 1, 2, 2, 3, 3, 3, 3]; in the plane a triangle is [0, 1, 2, 2]. The functions of a prism, a pyramid or a
simplex are among those of the hexahedron in its collapsed coordinates: from values u at its k nodes follow
those at the nodes of the hexahedron, T u with T of shape (8 | 27, k). With this T the collapsed hexahedron is
the cell itself, integrated by the Gauss rule of the hexahedron, whose points are off the collapsed edges.

References:
    M. Bergot, G. Cohen, M. Duruflé: Higher-order finite elements for hybrid meshes using new nodal pyramidal
    elements, J. Sci. Comput. 42 (2010); G. Bedrosian: Shape functions and integration formulas for
    three-dimensional finite element analysis, Int. J. Numer. Meth. Engng 35 (1992).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import check_each
from fenics_contact._base.display import counted
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import (
    HEXAHEDRON,
    HEXAHEDRON27,
    QUADRILATERAL,
    QUADRILATERAL9,
    TETRAHEDRON10,
    cell_type_of,
    shape_values,
)


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape of cells.

    `onto`: own vertex of each vertex of the hexahedron (quadrilateral); `edges`: vertices of the edges, in
    VTK's order of their midpoints; `squares`: vertices of the faces with four, in VTK's order of their
    centres; `mirrored`: the vertices of the cell with the opposite sign of its Jacobian.
    """

    name: str
    plural: str
    dim: int
    onto: tuple[int, ...]
    edges: tuple[tuple[int, int], ...]
    squares: tuple[tuple[int, ...], ...]
    centre: bool
    mirrored: tuple[int, ...]

    @property
    def corners(self) -> int:
        """Number of vertices."""
        return max(self.onto) + 1

    def sets(self, count: int) -> list[frozenset[int]]:
        """Return the vertices in whose middle each of a cell's `count` nodes lies, in VTK's order."""
        every: list[tuple[int, ...]] = [(v,) for v in range(self.corners)]
        every += [*self.edges, *self.squares, *([tuple(range(self.corners))] if self.centre else [])]
        return [frozenset(each) for each in every[:count]]

    @property
    def counts(self) -> tuple[int, ...]:
        """Possible numbers of nodes: linear, serendipity, complete; the last two may be equal."""
        linear, edges = self.corners, len(self.edges)
        return linear, linear + edges, linear + edges + len(self.squares) + self.centre

    @property
    def square_columns(self) -> np.ndarray:
        """Nodes of quadratic cells on each face with four corners: these, midpoints and centre, (n, 9).

        In the plane that of a quadrilateral is the cell itself.
        """
        sets = self.sets(self.counts[2])
        squares = self.squares or ((tuple(range(4)),) if self.dim == 2 and self.centre else ())
        rows = []
        for square in squares:
            around = [frozenset(pair) for pair in zip(square, (*square[1:], square[0]), strict=True)]
            rows.append([*square, *map(sets.index, around), sets.index(frozenset(square))])
        return np.array(rows, dtype=np.int64).reshape(-1, 9)

    def mirror(self, count: int) -> np.ndarray:
        """Return the order of `count` nodes that changes the sign of the Jacobian."""
        sets = self.sets(count)
        turned = [frozenset(self.mirrored[v] for v in each) for each in sets]
        return np.array([sets.index(each) for each in turned])

    @property
    def corner_edges(self) -> np.ndarray:
        """Vertices with one edge in each direction, and the far ends of these, right-handed, (n, 1 + dim)."""
        rows = []
        for vertex in range(self.corners):
            ends = [a + b - vertex for a, b in self.edges if vertex in (a, b)]
            if len(ends) == self.dim:
                rows.append([vertex, *ends])
        at = np.array(self.vertex_places)
        for row in rows:
            if np.linalg.det(at[row[1:]] - at[row[0]]) < 0:
                row[1], row[2] = row[2], row[1]
        return np.array(rows)

    @property
    def vertex_places(self) -> list[list[float]]:
        """Positions of the vertices of a straight cell in the cube."""
        places = _WHOLE[self.dim][0].nodes
        return [list(places[self.onto.index(v)]) for v in range(self.corners)]

    def shrinkage(self, at: np.ndarray) -> np.ndarray:
        """Return the Jacobian of the collapsed map of a straight cell at positions in the cube, (m,)."""
        towards_edge, towards_apex = 1.0 - at[:, 1], 1.0 - at[:, -1]
        return {
            "triangle": towards_edge, "prism": towards_edge, "pyramid": towards_apex**2,
            "tetrahedron": towards_edge * towards_apex**2,
        }.get(self.name, np.ones(len(at)))  # fmt: skip

    @property
    def is_simplex(self) -> bool:
        """Whether it is a triangle or a tetrahedron."""
        return self.corners == self.dim + 1

    @property
    def is_whole(self) -> bool:
        """Whether it is the hexahedron (quadrilateral)."""
        return len(set(self.onto)) == len(self.onto)


_ROUND = ((0, 1), (1, 2), (2, 3), (3, 0))
TRIANGLE_SHAPE = Shape(
    "triangle", "triangles", 2, (0, 1, 2, 2), ((0, 1), (1, 2), (2, 0)), (), False, (0, 2, 1)
)
SQUARE_SHAPE = Shape("quadrilateral", "quadrilaterals", 2, (0, 1, 2, 3), _ROUND, (), True, (0, 3, 2, 1))
TETRAHEDRON_SHAPE = Shape(
    "tetrahedron", "tetrahedra", 3, (0, 1, 2, 2, 3, 3, 3, 3),
    ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)), (), False, (0, 2, 1, 3),
)  # fmt: skip
PYRAMID_SHAPE = Shape(
    "pyramid", "pyramids", 3, (0, 1, 2, 3, 4, 4, 4, 4), (*_ROUND, (0, 4), (1, 4), (2, 4), (3, 4)),
    ((0, 1, 2, 3),), False, (0, 3, 2, 1, 4),
)  # fmt: skip
PRISM_SHAPE = Shape(
    "prism", "prisms", 3, (0, 1, 2, 2, 3, 4, 5, 5),
    ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)), False, (3, 4, 5, 0, 1, 2),
)  # fmt: skip
CUBE_SHAPE = Shape(
    "hexahedron", "hexahedra", 3, tuple(range(8)),
    (*_ROUND, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 1, 2, 3), (4, 5, 6, 7)),
    True, (4, 5, 6, 7, 0, 1, 2, 3),
)  # fmt: skip
SHAPES = {
    shape.name: shape
    for shape in (
        *(TRIANGLE_SHAPE, SQUARE_SHAPE),
        *(TETRAHEDRON_SHAPE, PYRAMID_SHAPE, PRISM_SHAPE, CUBE_SHAPE),
    )
}
"""Name to shape."""
_WHOLE = {2: (QUADRILATERAL, QUADRILATERAL9), 3: (HEXAHEDRON, HEXAHEDRON27)}


def shape_of(count: int, dim: int) -> Shape:
    """Return the shape of cells with a number of nodes."""
    for shape in SHAPES.values():
        if shape.dim == dim and count in shape.counts:
            return shape
    known = ", ".join(
        f"{'/'.join(map(str, dict.fromkeys(s.counts)))} for {s.plural}"
        for s in SHAPES.values()
        if s.dim == dim
    )
    raise InvalidInputError(
        f"cells in {dim} dimensions must have {known} nodes, got {count}: list them in VTK order"
    )


@dataclass(frozen=True, eq=False)
class Collapse:
    """How cells of a shape are those of the hexahedron.

    `columns`: own node in each place of the hexahedron; a vertex where it has none; `places`: a place of each
    own node; `values`: T.
    """

    shape: Shape
    columns: np.ndarray
    places: np.ndarray
    values: np.ndarray

    @property
    def is_selection(self) -> bool:
        """Whether T only repeats nodes."""
        return len(self.columns) == 2**self.shape.dim


@cache
def collapse(name: str, order: int) -> Collapse:
    """Return how cells of a shape of order 1 or 2 are those of the hexahedron (quadrilateral)."""
    shape = SHAPES[name]
    linear, whole = _WHOLE[shape.dim][0], _WHOLE[shape.dim][order - 1]
    own = shape.sets(shape.counts[0 if order == 1 else 2])
    weights = shape_values(linear, whole.nodes) > 0.1
    images = [frozenset(shape.onto[v] for v in np.flatnonzero(row)) for row in weights]
    columns = np.array([own.index(image) if image in own else min(image) for image in images])
    exact = np.array([image in own for image in images])
    places = np.array([np.flatnonzero(exact & (columns == node))[0] for node in range(len(own))])
    basis = _basis(shape, order)
    values = np.linalg.solve(basis(whole.nodes[places]).T, basis(whole.nodes).T).T
    values[np.abs(values) < 1e-12] = 0.0
    return Collapse(shape, columns, places, values)


def _basis(shape: Shape, order: int) -> Callable[[np.ndarray], np.ndarray]:
    """Return functions in collapsed coordinates that span those of a shape."""
    powers = range(order + 1)
    every: Iterable[tuple[int, ...]] = product(powers, repeat=shape.dim)
    # Factors x, y, z and, after these, what vanishes at a collapsed edge or apex.
    terms: list[tuple[int, ...]]
    if shape.name == "triangle":
        terms = [(i, j, i) for i, j in every if i + j <= order]
    elif shape.name == "prism":
        terms = [(i, j, k, i, 0) for i, j, k in every if i + j <= order]
    elif shape.name == "tetrahedron":
        terms = [(i, j, k, i, i + j) for i, j, k in every if i + j + k <= order]
    elif shape.name == "pyramid":
        terms = [(i, j, 0, 0, max(i, j) + k) for i, j, k in every if max(i, j) + k <= order]
    else:
        terms = [(*each, *(shape.dim - 1) * (0,)) for each in every]

    def evaluated(at: np.ndarray) -> np.ndarray:
        factors = np.column_stack([at, 1.0 - at[:, 1:]])
        return np.stack([np.prod(factors ** np.array(term), axis=1) for term in terms], axis=1)

    return evaluated


def has_collapsed(cells: np.ndarray, dim: int) -> bool:
    """Return whether some hexahedra (quadrilaterals) list nodes twice: they are other shapes."""
    return bool(_marks(cells, dim).any())


def _marks(cells: np.ndarray, dim: int) -> np.ndarray:
    kind = cell_type_of(cells, dim)
    if kind not in _WHOLE[dim]:
        return np.zeros(1, dtype=bool)
    return np.asarray(cells[:, -2 + len(kind.edges)] == cells[:, -1 + len(kind.edges)])


def shapes_in(cells: np.ndarray, dim: int) -> dict[str, np.ndarray]:
    """Return the cells of each shape, name to ascending numbers; empty where all are of the cells' type."""
    marks = _marks(cells, dim)
    if not marks.any():
        return {}
    groups = {"triangle" if dim == 2 else "": marks}
    if dim == 3:
        apex = cells[:, 4] == cells[:, 6]
        edge = cells[:, 2] == cells[:, 3]
        groups = {
            "tetrahedron": marks & apex & edge, "pyramid": marks & apex & ~edge, "prism": marks & ~apex,
        }  # fmt: skip
    groups[_WHOLE[dim][0].name] = ~marks
    return {name: np.flatnonzero(mine) for name, mine in groups.items() if mine.any()}


def check_collapsed(cells: np.ndarray, dim: int) -> None:
    """Reject cells that list nodes twice otherwise than prisms, pyramids and simplices do."""
    order = cell_type_of(cells, dim).order
    for name, mine in shapes_in(cells, dim).items():
        _check_repeated(cells, mine, collapse(name, order))


def _check_repeated(cells: np.ndarray, mine: np.ndarray, how: Collapse) -> None:
    own = cells[mine][:, how.places]
    check_each(
        (own[:, how.columns] == cells[mine]).all(axis=1) & np.diff(np.sort(own, axis=1), axis=1).all(axis=1),
        "cells that list a node twice must be prisms, pyramids or simplices as joined_cells makes them",
        "use joined_cells({'prism': ...})",
        lambda k: f"cell {mine[k]} with nodes {cells[mine[k]].tolist()}",
    )


def joined_cells(cells: Mapping[str, np.ndarray], dim: int = 3) -> np.ndarray:
    """Return cells of several shapes as one array for `BodyMesh`, hexahedra some of whose nodes coincide.

    Args:
        cells: Shape (``"prism"``, ``"pyramid"``, ``"tetrahedron"``, ``"hexahedron"``; in the plane
            ``"triangle"``, ``"quadrilateral"``) to node numbers in VTK order, (n_cells, nodes of a cell): all
            linear with 6, 5, 4, 8 (3, 4) nodes, or all quadratic with 18, 14, 10, 27 (6, 9).
        dim: Dimension.

    Returns:
        Node numbers, (n_cells, 8 | 27), in the plane (n_cells, 4 | 9), in the order of the mapping.

    Raises:
        InvalidInputError: If a shape is unknown, or numbers of nodes do not belong together.

    Example:
        >>> from fenics_contact.mesh import joined_cells
        >>> joined_cells({"prism": [[0, 1, 2, 3, 4, 5]]}).tolist()
        [[0, 1, 2, 2, 3, 4, 5, 5]]
    """
    parts, orders = [], set()
    for name, rows in cells.items():
        array = np.asarray(rows, dtype=np.int64)
        shape = SHAPES.get(name)
        if shape is None or shape.dim != dim:
            known = [each for each, its in SHAPES.items() if its.dim == dim]
            raise InvalidInputError(
                f"shapes of cells in {dim} dimensions must be among {known}, got {name!r}"
            )
        whole = dict(zip((shape.counts[0], shape.counts[2]), (1, 2), strict=True))
        if array.ndim != 2 or array.shape[1] not in whole:
            raise InvalidInputError(
                f"{shape.plural} have {' or '.join(map(str, whole))} nodes, got {array.shape}: see "
                "in_vtk_order"
            )
        orders.add(whole[array.shape[1]])
        parts.append(array[:, collapse(name, whole[array.shape[1]]).columns])
    if len(orders) != 1:
        raise InvalidInputError(
            f"joined_cells needs cells all linear or all quadratic, got {'both' if orders else 'none'}"
        )
    return np.concatenate(parts)


def by_shape(cells: np.ndarray, dim: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the shapes in an array of cells: name to cell numbers and node numbers in VTK order."""
    kind = cell_type_of(cells, dim)
    groups = shapes_in(cells, dim)
    if not groups:
        return {kind.shape_name: (np.arange(len(cells)), cells)}
    return {name: (mine, cells[mine][:, collapse(name, kind.order).places]) for name, mine in groups.items()}


def places_of(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the positions of the nodes of every cell as a hexahedron, (n_cells, nodes of a cell, dim)."""
    return as_hexahedra(points[cells], cells, points.shape[1])


def as_hexahedra(values: np.ndarray, cells: np.ndarray, dim: int) -> np.ndarray:
    """Return values at the nodes of cells, (n_cells, k, ...), as those at the nodes of hexahedra."""
    result = values
    kind = cell_type_of(cells, dim)
    if kind.order == 1:
        return result
    for name, mine in shapes_in(cells, dim).items():
        if not SHAPES[name].is_whole:
            how = collapse(name, kind.order)
            result = result.copy() if result is values else result
            result[mine] = np.einsum("pk,ck...->cp...", how.values, values[mine][:, how.places])
    return result


def expanded(cells: np.ndarray, n_nodes: int, dim: int) -> tuple[np.ndarray, sp.csr_matrix] | None:
    """Return hexahedra all of whose nodes differ in place of several shapes; None where all are whole.

    Whole cells keep sharing nodes, which come first in their order; others have nodes of their own. The
    matrix maps values at the given nodes to these.
    """
    groups = shapes_in(cells, dim)
    if not groups:
        return None
    order, width = cell_type_of(cells, dim).order, cells.shape[1]
    whole = groups.get(_WHOLE[dim][0].name, np.zeros(0, dtype=np.int64))
    kept, numbers = np.unique(cells[whole], return_inverse=True)
    result = np.empty_like(cells)
    result[whole] = numbers.reshape(-1, width)
    count = len(kept)
    rows, columns, entries = [np.arange(count)], [kept], [np.ones(count)]
    for name, mine in groups.items():
        if SHAPES[name].is_whole:
            continue
        how = collapse(name, order)
        result[mine] = count + np.arange(len(mine) * width).reshape(-1, width)
        place, node = np.nonzero(how.values)
        rows.append(result[mine][:, place].ravel())
        columns.append(cells[mine][:, how.places][:, node].ravel())
        entries.append(np.tile(how.values[place, node], len(mine)))
        count += len(mine) * width
    found = np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))
    return result, sp.csr_matrix(found, shape=(count, n_nodes))


def in_words(cells: np.ndarray, dim: int, lacking: bool = False) -> str:
    """Return numbers of cells by shape: "8 hexahedra, 4 pyramids and 12 prisms".

    `lacking`: whether centres follow, as in serendipity cells.
    """
    order, parts = cell_type_of(cells, dim).order, []
    for name, mine in shapes_in(cells, dim).items():
        kind = "serendipity " if lacking and len(SHAPES[name].square_columns) else "quadratic "
        words = (kind * (order - 1) + word for word in (name, SHAPES[name].plural))
        parts.append(counted(len(mine), *words))
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


_TRIANGLES = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
_LEVELS = ((0, 1, 2, 6, 7, 8), (12, 13, 14, 15, 16, 17), (3, 4, 5, 9, 10, 11))
#: The linear cells through the nodes of quadratic ones: shape and nodes of each.
_PIECES: dict[str, list[tuple[str, tuple[int, ...]]]] = {
    "triangle": [("triangle", piece) for piece in _TRIANGLES],
    "prism": [
        ("prism", tuple(level[v] for level in both for v in piece))
        for both in (_LEVELS[:2], _LEVELS[1:])
        for piece in _TRIANGLES
    ],
    "pyramid": [
        *(("pyramid", piece) for piece in ((0, 5, 13, 8, 9), (5, 1, 6, 13, 10), (13, 6, 2, 7, 11))),
        *(("pyramid", piece) for piece in ((8, 13, 7, 3, 12), (9, 10, 11, 12, 4), (9, 12, 11, 10, 13))),
        *(("tetrahedron", p) for p in ((5, 13, 9, 10), (6, 13, 10, 11), (7, 13, 11, 12), (8, 13, 12, 9))),
    ],
    "tetrahedron": [("tetrahedron", tuple(row)) for row in TETRAHEDRON10.pieces.tolist()],
    "quadrilateral": [("quadrilateral", tuple(row)) for row in QUADRILATERAL9.pieces.tolist()],
    "hexahedron": [("hexahedron", tuple(row)) for row in HEXAHEDRON27.pieces.tolist()],
}


def cut_into_linear(cells: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut quadratic cells of several shapes into linear ones: nodes, (n, 8 | 4), and cells, ascending."""
    rows, parents = [], []
    for name, (mine, own) in by_shape(cells, dim).items():
        for shape, piece in _PIECES[name]:
            rows.append(own[:, piece][:, collapse(shape, 1).columns])
            parents.append(mine)
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    return np.concatenate(rows)[order], parent[order]


def simplices_in(cells: np.ndarray, dim: int) -> np.ndarray:
    """Return the simplices that make up linear cells, (n, dim + 1)."""
    every = cells[:, cell_type_of(cells, dim).simplices].reshape(-1, dim + 1)
    if not shapes_in(cells, dim):
        return every
    return every[(np.diff(np.sort(every, axis=1), axis=1) > 0).all(axis=1)]
