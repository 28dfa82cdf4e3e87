"""Partition of any mesh by recursive bisection with plane cuts of small area.

References:
    H. D. Simon: Partitioning of unstructured problems for parallel processing. Computing Systems in
    Engineering 2 (1991) 135-148.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from fenics_contact._base.checks import check_count, naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cuts import closed, pieces
from fenics_contact.mesh.equal_boxes import equal_boxes
from fenics_contact.mesh.faces import coordinate_rounding
from fenics_contact.mesh.partition import (
    cell_weights,
    check_one_piece,
    check_parts,
    face_areas,
    kept_together,
    merge_pieces,
)

LAYER = 1e-12
"""Cells whose centres differ by less than this fraction of the body's extent lie in one layer."""

UNEVEN = 2.0
"""Subdomains e^s times too large or too small are accepted for a cut that is e^(2 s) times smaller."""

APART = 0.5
"""A cut at the end of the middle third is equivalent to a cut in the middle that is larger by a twelfth."""

ALIKE = 1e-6
"""Cuts that differ by less are equivalent: rounding does not choose between them."""


@naming_arguments
def bisection_partition(mesh: BodyMesh, parts: int) -> np.ndarray:
    """Cut any mesh in two, and the halves again, each time by the cut of least area.

    Cuts are normal to the directions of the grid if there is one, else to the coordinate axes and the
    principal axes of the piece; they do not split layers of cells. Cells are weighted by the root of their
    volume, so that subdomains stay compact where cells are graded. Pieces that a cut leaves connected only by
    an edge or a node are given to a neighbour, see `merge_pieces`.

    Args:
        mesh: Any mesh.
        parts: Number of subdomains. The more often it can be halved, the more similar they are.

    Returns:
        (n_cells,) subdomain numbers, every subdomain connected through faces; the same on every rank.

    Raises:
        InvalidInputError: If there are fewer cells than parts, or the mesh consists of separate parts.
    """
    return _bisected(mesh, parts, mesh.n_cells)


def _bisected(
    mesh: BodyMesh,
    parts: int,
    usual: int,
    faces: tuple[np.ndarray, np.ndarray] | None = None,
    heavy: float = 3.0,
    *,
    power: float = 1.0,
) -> np.ndarray:
    """Return a partition into ``parts`` subdomains, and more where one has too many cells.

    Where cells are refined near a point, subdomains of the same weight may have very different numbers of
    cells: what has more than ``heavy`` times ``usual`` of them is cut on. `power`: of areas and weights; zero
    counts faces and cells, whatever their size.
    """
    check_parts(mesh, parts)
    if mesh.cuts:
        return pieces(mesh, _bisected(closed(mesh), parts, usual, heavy=heavy, power=power))
    partition, count = np.zeros(mesh.n_cells, dtype=np.int64), 0
    faces = face_areas(mesh) if faces is None else faces
    pending = [_whole(mesh, parts, *faces, power)] if parts > 1 else []
    while pending:
        piece = pending.pop()
        if piece.parts > 1:
            pending += reversed(piece.halves())
        elif len(piece.cells) > heavy * usual:
            pending.append(piece.into(round(len(piece.cells) / usual)))
        else:
            partition[piece.cells] = count
            count += 1
    return kept_together(mesh, merge_pieces(mesh, partition, pairs=faces[0]))


@dataclass(frozen=True, eq=False)
class _Cut:
    """A cut of a piece normal to one direction; its cost is the area, more if the cut is uneven."""

    order: np.ndarray
    cells: int
    parts: int
    cost: float


#: Behind which cells cuts are allowed, by the places of the cells along a direction in their order.
_Allowed: TypeAlias = Callable[[np.ndarray], np.ndarray]


def _between_layers(places: np.ndarray) -> np.ndarray:
    return np.diff(places) > 0


def _anywhere(places: np.ndarray) -> np.ndarray:
    return np.ones(len(places) - 1, dtype=bool)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A piece of a mesh that is to become several subdomains.

    `turned`: whether it may be cut normal to its principal axes; `weights`: weight of each cell, with 1 for a
    subdomain.
    """

    cells: np.ndarray
    places: np.ndarray
    orders: tuple[np.ndarray, ...]
    turned: bool
    weights: np.ndarray
    pairs: np.ndarray
    areas: np.ndarray
    parts: int

    def into(self, parts: int) -> _Piece:
        """Return the piece that is to become another number of subdomains."""
        return replace(self, parts=parts, weights=parts / self.weights.sum() * self.weights)

    def halves(self) -> tuple[_Piece, _Piece]:
        """Cut it in two by the cheapest cut."""
        cuts = self._cuts(_between_layers) or self._cuts(_anywhere)  # a piece has as many cells as subdomains
        best = cuts[0]  # the first of equivalent ones
        for cut in cuts[1:]:
            if cut.cost < (1.0 - ALIKE) * best.cost:
                best = cut
        before = np.zeros(len(self.cells), dtype=bool)
        before[best.order[: best.cells]] = True
        return (
            self._part(before, best.parts),
            self._part(~before, self.parts - best.parts),
        )

    def _cuts(self, allowed: _Allowed) -> list[_Cut]:
        """Return the cheapest cut normal to each direction that has one."""
        ways = self._directions()
        return [cut for place, order in ways for cut in self._across(order, allowed(place[order]))]

    def _directions(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """List the positions of the cells along the directions, and their orders, each (n,)."""
        along = list(zip(self.places.T, self.orders, strict=True))
        if self.turned:
            arms = self.places - self.weights @ self.places / self.weights.sum()
            _, axes = np.linalg.eigh((arms * self.weights[:, None]).T @ arms)
            turned = np.round(arms @ axes).T
            along += [(place, np.argsort(place, kind="stable")) for place in turned]
        return along

    def _across(self, order: np.ndarray, allowed: np.ndarray) -> list[_Cut]:
        """Return the cheapest cut normal to a direction, if there is one where cuts are allowed."""
        n, total = len(order), self.weights.sum()
        cells, before = np.arange(1, n), np.cumsum(self.weights[order])[:-1]
        least = min(-(-self.parts // 3), self.parts // 2)
        parts = np.clip(np.round(self.parts * before / total), least, self.parts - least)
        possible = (cells >= parts) & (n - cells >= self.parts - parts) & allowed
        if not possible.any():
            return []
        sizes = np.array([before / parts, (total - before) / (self.parts - parts)])
        uneven = UNEVEN * np.abs(np.log(sizes)).max(axis=0) + APART * np.abs(cells / n - 0.5)
        cost = np.where(possible, self._cut_areas(order) * np.exp(uneven), np.inf)
        chosen = int(np.argmax(cost <= (1.0 + ALIKE) * cost.min()))
        return [_Cut(order, chosen + 1, int(parts[chosen]), float(cost[chosen]))]

    def _cut_areas(self, order: np.ndarray) -> np.ndarray:
        """Return the area of the faces between the first k cells and the others, k = 1 ... n - 1."""
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        first, other = rank[self.pairs[:, 0]], rank[self.pairs[:, 1]]
        ends = np.minimum(first, other), np.maximum(first, other)
        begins, stops = (np.bincount(end, self.areas, minlength=len(order)) for end in ends)
        return np.asarray(np.cumsum(begins - stops)[:-1])

    def _part(self, chosen: np.ndarray, parts: int) -> _Piece:
        """Return some of its cells as a piece, (n,) bool."""
        inside = chosen[self.pairs].all(axis=1)
        number = np.cumsum(chosen) - 1
        return _Piece(
            self.cells[chosen],
            self.places[chosen],
            tuple(number[order[chosen[order]]] for order in self.orders),
            self.turned,
            self.weights[chosen],
            number[self.pairs[inside]],
            self.areas[inside],
            parts,
        )


def _whole(mesh: BodyMesh, parts: int, pairs: np.ndarray, areas: np.ndarray, power: float) -> _Piece:
    """Return the whole mesh as a piece."""
    if mesh.grid is None:
        # In units above rounding, so that layers of cells are not split by the last bits.
        unit = LAYER * float(np.ptp(mesh.points, axis=0).max()) + coordinate_rounding(mesh.points)
        centres = mesh.points[mesh.cells].mean(axis=1)
        places = np.round((centres - mesh.points.min(axis=0)) / unit)
    else:
        places = mesh.grid
    cells, weights = np.arange(mesh.n_cells), parts * cell_weights(mesh, 0.5 * power)
    areas = areas if power == 1.0 else areas**power
    orders = tuple(np.argsort(place, kind="stable") for place in places.T)
    return _Piece(cells, places, orders, mesh.grid is None, weights, pairs, areas, parts)


TARGET_NODES = {3: 700, 2: 1000}
"""Nodes of a subdomain by dimension: about 2000 displacement unknowns in both.

In 3D these are 9 nodes along an edge, as in the published chain of links. In 2D they are 32 nodes
along an edge: the matrices are of the same size, their factors sparser and the interface smaller, and the
condition number grows only with the squared logarithm of the cells along an edge."""

NEAR = (0.8, 1.25)
"""Factors by which the number of subdomains may miss the target so that it can be halved more often."""

_NODES_PER_CELL = {
    "hexahedron": 1.0,
    "tetrahedron": 1.0 / 5.5,
    "quadrilateral": 1.0,
    "triangle": 0.5,
    "hexahedron27": 8.0,
    "quadrilateral9": 4.0,
    "triangle6": 2.0,
    "tetrahedron10": 8.0 / 5.5,
}
"""Nodes per cell in a large mesh; for tetrahedra those of mesh generators (6 in a split hexahedron)."""


def target_parts(mesh: BodyMesh, nodes: float | None = None) -> int:
    """Choose the number of subdomains so that each has about a given number of nodes.

    A subdomain that would have m nodes inside a large mesh has (m^(1/d) + 1)^d once it is torn out. `nodes`:
    nodes of one subdomain, at least 2^d; unless given 700 in 3D and 1000 in 2D, about 2000 displacements.
    """
    nodes = TARGET_NODES[mesh.dim] if nodes is None else nodes
    if not 2**mesh.dim <= nodes < np.inf:
        raise InvalidInputError(
            f"nodes must be at least {2**mesh.dim}, which one cell has, got {nodes}: try 500"
        )
    inside = (nodes ** (1.0 / mesh.dim) - 1.0) ** mesh.dim
    whole = mesh.n_nodes if mesh.has_several_shapes else mesh.n_cells * _NODES_PER_CELL[mesh.cell_type]
    parts = round(whole / inside)
    return int(np.clip(parts, 1, mesh.n_cells))


def default_partition(
    mesh: BodyMesh,
    ranks: int = 1,
    *,
    nodes: float | None = None,
    body: str = "",
    lean: bool = False,
    lean_nodes: float = 300.0,
) -> np.ndarray:
    """Cut a body into a number of subdomains suited to its size, and at least one for every rank.

    A structured body of equal cells is cut into boxes of which many are alike, see `equal_boxes`. Of others a
    number near the target that can be halved often is chosen: halves are similar, so that their matrices
    share a pattern. The cuts are those of `bisection_partition`; subdomains with three times the usual number
    of cells, as where a mesh is refined near a point, are cut again. Only a body with fewer cells than ranks
    has fewer subdomains than there are ranks. `lean`: whether memory matters more than products. Subdomains
    are then smaller, and cuts cross fewer faces rather than less area: in graded bodies they are less
    compact, but their dense matrices take half as much. `lean_nodes`: nodes of one in space then; with fewer,
    tables of interfaces take what matrices save.
    """
    check_count(ranks, "ranks")
    faces = None if mesh.cuts else face_areas(mesh)
    check_one_piece(mesh, body, None if faces is None else faces[0])
    nodes = lean_nodes if lean and mesh.dim == 3 and nodes is None else nodes
    target, least = target_parts(mesh, nodes), min(ranks, mesh.n_cells)
    boxes = None if lean else equal_boxes(mesh, target, least, faces)
    if boxes is not None:
        return boxes
    usual = -(-mesh.n_cells // target)
    parts, power = _often_halved(target, least, mesh.n_cells), 0.5 if lean else 1.0
    return _bisected(mesh, parts, usual, faces, power=power)


def _often_halved(target: int, least: int, most: int) -> int:
    """Return the number near the target that can be halved most often, the nearer one of two."""
    first, last = (min(max(least, round(factor * target)), most) for factor in NEAR)
    return min(range(first, last + 1), key=lambda number: (-(number & -number), abs(number - target)))
