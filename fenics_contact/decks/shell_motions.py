"""How nodes of shells and beams move with the nodes across their thickness, and what joins them at knots.

A node of a shell moves as the mean of the bottom and the top, and turns as these move apart: δ = t θ × n. A
turn about the normal is no motion of a shell. A node of a beam moves and turns as the corners of its section.
Where shells or beams meet that do not share the nodes across their thickness, these move as one rigid piece
with a uniform stretch, as CalculiX's knots do: u = u₀ + θ × r + α r, where r starts at the node. In a plane
those of beams have two stretches, along its principal axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.readers.deck_shell_nodes import ShellNodes


@dataclass(frozen=True, eq=False)
class ShellMotions:
    """How some nodes of shells move.

    `nodes`: their positions, ascending; `sources`: as in `ShellNodes`; `ends`: nodes across the thickness of
    the first shell or beam of each, as there; `normal`: the normals there, zero of beams; `is_knot`: whether
    shells meet there that do not share nodes; `of_beam`: whether it is no knot, and of beams; `motion`:
    displacement and rotation from the displacements of all nodes, (6 n, 3 n_nodes); `joints`: equations of
    knots, and the number among the nodes of each.
    """

    nodes: np.ndarray
    sources: np.ndarray
    ends: np.ndarray
    normal: np.ndarray
    is_knot: np.ndarray
    of_beam: np.ndarray
    motion: sp.csr_matrix
    joints: sp.csr_matrix
    of_joint: np.ndarray

    @classmethod
    def of(cls, shells: ShellNodes, points: np.ndarray) -> ShellMotions:
        """Return those of all nodes of shells."""
        known = np.argsort(shells.node, kind="stable")
        nodes, first, several = np.unique(shells.node[known], return_index=True, return_counts=True)
        motion = sp.csr_matrix((6 * len(nodes), points.size))
        joints, of_joint = [sp.csr_matrix((0, points.size))], [np.zeros(0, dtype=np.int64)]
        of_beams = shells.of_beams[known]
        for mine, piece in _pieces(shells.ends[known], first, several):
            is_knot, beams = several[mine[0]] > 1, np.logical_or.reduceat(of_beams, first)[mine]
            origin = points[nodes[mine]] if is_knot else points[piece].mean(axis=1)
            rows, null, of = _of_pieces(piece, points, origin, beams & is_knot)
            motion = motion + _chosen(6 * mine[:, None] + np.arange(6), 6 * len(nodes)) @ rows
            if is_knot:
                joints.append(null)
                of_joint.append(mine[of])
        ends = shells.ends[known[first]]
        normal = points[ends[:, 2]] - points[ends[:, 0]]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        normal[of_beams[first]] = 0.0
        knots = several > 1, of_beams[first] & (several == 1)
        whole = motion.tocsr(), sp.vstack(joints).tocsr(), np.concatenate(of_joint)
        return cls(nodes, shells.sources[known[first]], ends, normal, *knots, *whole)

    def inner(self, number: np.ndarray, width: int) -> sp.csr_matrix:
        """Return the equations by which nodes between corners of some beams move as their means."""
        ends = self.ends[number]
        inner = ends[:, 1::2].ravel()
        columns = np.stack([inner, ends[:, ::2].ravel(), np.roll(ends[:, ::2], -1, axis=1).ravel()], axis=1)
        columns = (3 * columns[inner >= 0][:, None] + np.arange(3)[:, None]).reshape(-1, 3)
        return _rows(columns, np.tile([1.0, -0.5, -0.5], (len(columns), 1)), width)


def _pieces(
    ends: np.ndarray, first: np.ndarray, several: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield numbers of nodes and those that move with each, as many in one go: (n,) and (n, k).

    At a knot these are all across, else bottom and top, or corners. `ends`: in the order of the nodes, whose
    first ones and numbers are given.
    """
    for count in np.unique(several).tolist():
        mine = np.flatnonzero(several == count)
        every = ends[first[mine, None] + np.arange(count)]
        every = (every if count > 1 else every[..., ::2]).reshape(len(mine), -1)
        size = (every >= 0).sum(axis=1)
        for width in np.unique(size):
            own = every[size == width]
            yield mine[size == width], own[own >= 0].reshape(-1, width)


def _chosen(rows: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the matrix that puts rows, in their order, where they belong."""
    flat = rows.ravel()
    return sp.csr_matrix((np.ones(len(flat)), (flat, np.arange(len(flat)))), shape=(count, len(flat)))


def _of_pieces(
    nodes: np.ndarray, points: np.ndarray, origin: np.ndarray, of_beams: np.ndarray, flat: float = 1e-6
) -> tuple[sp.csr_matrix, sp.csr_matrix, np.ndarray]:
    """Return motions of pieces, six rows for each, and the equations that make them rigid but for a stretch.

    With the equations comes the number of the piece of each. `nodes`: of each piece, (n, k); `origin`: where
    it has the displacement, (n, 3); `of_beams`: whether it has two stretches where it is in a plane, (n,);
    `flat`: singular values that are none, relative to the size of a piece.
    """
    arms = points[nodes] - origin[:, None]
    size = np.linalg.norm(arms, axis=2).max(axis=1)
    arms = arms / size[:, None, None]
    ways = np.zeros((*arms.shape, 8))
    ways[..., :3] = np.eye(3)
    for axis in range(3):
        ways[..., 3 + axis] = np.cross(np.eye(3)[axis], arms)
    _, extent, axes = np.linalg.svd(arms - arms.mean(axis=1, keepdims=True), full_matrices=False)
    along = np.einsum("nkd,nd,ne->nke", arms, axes[:, 0], axes[:, 0])
    ways[..., 7] = along * (of_beams & (extent[:, -1] < flat))[:, None, None]
    ways[..., 6] = arms - ways[..., 7]
    matrix = ways.reshape(len(nodes), -1, 8)
    left, values, right = np.linalg.svd(matrix)
    there = values > flat * values[:, :1]
    inverse = np.where(there, 1.0 / np.where(there, values, 1.0), 0.0)
    width = values.shape[1]
    motion = np.einsum("nki,nk,njk->nij", right[:, :width], inverse, left[:, :, :width])[:, :6]
    motion[:, 3:] /= size[:, None, None]
    columns = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)
    spare = np.ones(left.shape[::2], dtype=bool)
    spare[:, :width] = ~there
    piece, which = np.nonzero(spare)
    shape = 6 * len(nodes), points.size
    rows = _rows(np.repeat(columns, 6, axis=0), motion.reshape(shape[0], -1), shape[1])
    return rows, _rows(columns[piece], left[piece, :, which], shape[1]), piece


def _rows(columns: np.ndarray, values: np.ndarray, width: int) -> sp.csr_matrix:
    """Return the matrix with some entries in each row."""
    row = np.repeat(np.arange(len(columns)), columns.shape[1])
    return sp.csr_matrix((values.ravel(), (row, columns.ravel())), shape=(len(columns), width))
