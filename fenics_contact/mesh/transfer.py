"""From one mesh to another that was refined from the same one: places, and values at Gauss points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, CellType, quadrature
from fenics_contact.mesh.quality import jacobians
from fenics_contact.mesh.refinement import Refinement, one_by_one


@displayed
@dataclass(frozen=True, eq=False)
class MeshTransfer:
    """From an old mesh to a new one, both refined from the same mesh, each where it was needed.

    A point of the new mesh is followed up to its cell of the common mesh and from there down to the cell of
    the old one in which it lies, in reference coordinates: exact also along curved surfaces, to which
    refined nodes move, and without a search.

    Attributes:
        old: Refinements from the common mesh to the old one, in their order; empty if that is the common one.
        new: Those to the new mesh.

    Example:
        >>> from fenics_contact.gallery import rectangle
        >>> from fenics_contact.mesh import refined
        >>> plate = rectangle((0.0, 0.0), (2.0, 1.0), (4, 2))
        >>> left, right = refined(plate, [0]), refined(plate, [7])
        >>> cells, positions = MeshTransfer((left,), (right,)).located(np.array([0]), np.array([[0.2, 0.7]]))
        >>> cells, positions.round(9)  # a child of the first cell, where that was halved
        (array([3]), array([[0.4, 0.4]]))
    """

    old: Sequence[Refinement] = ()
    new: Sequence[Refinement] = ()

    def located(
        self, cells: np.ndarray, positions: np.ndarray, inward: float = 1e-5
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return in which cells of the old mesh points of the new one lie, (n,), and where, (n, dim).

        Of cells that meet in a point it is the one on the side of the point's own: sections may part them.

        Args:
            cells: Cells of the new mesh, shape (n,).
            positions: Reference coordinates in them, shape (n, dim).
            inward: Part of the way to the centre of its cell that a point is moved before cells are chosen.
        """
        old, new = (list(one_by_one(chain)) for chain in (self.old, self.new))
        while old and new and old[0] is new[0]:  # both meshes have gone through it
            del old[0], new[0]
        if not old and not new:
            return cells, positions
        kind = CELL_TYPES[(new or old)[-1].mesh.cell_type]
        probes = positions + inward * (kind.vertices.mean(axis=0) - positions)
        for refinement in reversed(new):
            _, probes = refinement.located(cells, probes)
            cells, positions = refinement.located(cells, positions)
        for refinement in old:
            cells, positions, probes = _among_children(refinement, cells, positions, probes)
        return cells, positions

    def fits(self, old: BodyMesh, new: BodyMesh) -> bool:
        """Return whether it may lead from one mesh to the other: their numbers of cells agree."""
        first = {_count_before(chain[0]) for chain in (self.old, self.new) if chain}
        ends = [(self.old, old), (self.new, new)]
        common = first or {old.n_cells}
        return len(common) == 1 and all(
            (chain[-1].mesh.n_cells if chain else next(iter(common))) == mesh.n_cells for chain, mesh in ends
        )

    def at_gauss_points(self, old: BodyMesh, new: BodyMesh, degree: int, values: np.ndarray) -> np.ndarray:
        """Return values at the Gauss points of the new mesh for those at the points of the old one.

        A point is given the mean, by volume, of the old points to which it is the nearest one in its cell.
        Where there are none, as the old cells are larger, it is given the value of the nearest point of the
        old cell in which it lies. So every value is a mean of old ones of its neighbourhood: constants stay
        what they are, signs and bounds too, and stresses within a convex yield surface remain in it. Where
        cells become larger, volume integrals are kept; nothing is smoothed where they stay or become smaller.

        Args:
            old: The old mesh.
            new: The new mesh.
            degree: Degree of the quadrature of both.
            values: Of the points of the old mesh, shape (n_cells, n_gauss, k).

        Returns:
            Shape (n_cells of the new mesh, n_gauss, k).

        References:
            M. Ortiz, J. J. Quigley IV, Adaptive mesh refinement in strain localization problems, Comput.
            Methods Appl. Mech. Engrg. 90 (1991) 781-804 (internal variables of the nearest point, without the
            diffusion of nodal fields). D. Peric, Ch. Hochard, M. Dutko, D. R. J. Owen, Transfer operators for
            evolving meshes in small strain elasto-plasticity, Comput. Methods Appl. Mech. Engrg. 137 (1996)
            331-344 (what a transfer must keep).
        """
        kind = CELL_TYPES[old.cell_type]
        positions, weights = quadrature(kind, degree)
        size = (weights * jacobians(old.points, old.cells, positions)).ravel()
        flat = values.reshape(len(size), -1)
        nearest = self._nearest(kind, new.n_cells, positions)
        receiver = MeshTransfer(self.new, self.old)._nearest(kind, old.n_cells, positions)
        gathered = sp.csr_matrix((size, (receiver, np.arange(len(size)))), shape=(len(nearest), len(size)))
        total = np.asarray(gathered.sum(axis=1))
        found = np.where(total > 0.0, (gathered @ flat) / np.where(total > 0.0, total, 1.0), flat[nearest])
        return np.asarray(found.reshape(new.n_cells, *values.shape[1:]))

    def _nearest(self, kind: CellType, count: int, points: np.ndarray, decimals: int = 9) -> np.ndarray:
        """Return for the points of all cells the nearest one of the old cell in which each lies, numbered.

        `points`: reference coordinates, the same in all cells; `decimals`: those of distances that count, so
        that rounding decides between no two points.
        """
        every = np.repeat(np.arange(count), len(points))
        cells, positions = self.located(every, np.tile(points, (count, 1)))
        distance = np.linalg.norm(positions[:, None] - points, axis=2).round(decimals)
        return cells * len(points) + distance.argmin(axis=1)


def _count_before(refinement: Refinement) -> int:
    return int(refinement.parents.max(initial=-1)) + 1


def _among_children(
    refinement: Refinement,
    cells: np.ndarray,
    positions: np.ndarray,
    probes: np.ndarray,
    decimals: int = 9,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return in which children of their cells points lie, and where they and their probes lie in these.

    It is the first that contains the probe; `decimals`: of depths that count, see `MeshTransfer._nearest`.
    """
    kind = CELL_TYPES[refinement.mesh.cell_type]
    first = np.searchsorted(refinement.parents, np.arange(_count_before(refinement) + 1))
    count = np.diff(first)
    best, child = np.full(len(cells), -np.inf), first[cells]
    for number in range(int(count.max(initial=0))):
        tried = np.flatnonzero(number < count[cells])
        candidates = first[cells[tried]] + number
        inside = _depth(kind, _local(kind, refinement.positions[candidates], probes[tried])).round(decimals)
        better = inside > best[tried]
        chosen = tried[better]
        best[chosen], child[chosen] = inside[better], candidates[better]
    nodes = refinement.positions[child]
    return child, _local(kind, nodes, positions), _local(kind, nodes, probes)


def _local(kind: CellType, nodes: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return reference coordinates in cells with nodes at given places, to which their maps are affine."""
    ends = kind.edges[0]
    axes = np.linalg.solve(kind.nodes[ends] - kind.nodes[0], nodes[:, ends] - nodes[:, :1])
    ways = (positions - nodes[:, 0])[..., None]
    return np.asarray(kind.nodes[0] + np.linalg.solve(axes.swapaxes(1, 2), ways)[..., 0])


def _depth(kind: CellType, positions: np.ndarray) -> np.ndarray:
    """Return how far points lie inside the reference cell, negative outside, (n,)."""
    other = 1.0 - (positions.sum(axis=1, keepdims=True) if kind.is_simplex else positions)
    return np.asarray(np.hstack([positions, other]).min(axis=1))
