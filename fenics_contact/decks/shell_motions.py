"""How nodes of shells move with the nodes across their thickness, and what joins shells at knots.

A node of a shell moves as the mean of the bottom and the top, and turns as these move apart: δ = t θ × n. A
turn about the normal is no motion of a shell. Where shells meet that do not share the nodes across their
thickness, these move as one rigid piece with a uniform stretch, as CalculiX's knots do: u = u₀ + θ × r + α r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.readers.deck_shell_nodes import ShellNodes


@dataclass(frozen=True, eq=False)
class ShellMotions:
    """How some nodes of shells move.

    `nodes`: their positions, ascending; `sources`: as in `ShellNodes`; `ends`: nodes across the thickness of
    the first shell of each, (n, 3); `normal`: the normals there; `is_knot`: whether shells meet there that do
    not share nodes; `motion`: displacement and rotation from the displacements of all nodes, (6 n, 3
    n_nodes); `joints`: equations of knots, and the number among the nodes of each.
    """

    nodes: np.ndarray
    sources: np.ndarray
    ends: np.ndarray
    normal: np.ndarray
    is_knot: np.ndarray
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
        for count in np.unique(several).tolist():
            mine = np.flatnonzero(several == count)
            ends = shells.ends[known[first[mine, None] + np.arange(count)]]
            rows, null, of = _of_pieces(ends, points)
            motion = motion + _chosen(6 * mine[:, None] + np.arange(6), 6 * len(nodes)) @ rows
            if count > 1:
                joints += [null, _middles(ends, points.size)]
                of_joint += [mine[of], np.repeat(mine, 3 * count)[(ends[:, :, 1] >= 0).ravel().repeat(3)]]
        ends = shells.ends[known[first]]
        normal = points[ends[:, 2]] - points[ends[:, 0]]
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        whole = sp.vstack(joints).tocsr(), np.concatenate(of_joint)
        return cls(nodes, shells.sources[known[first]], ends, normal, several > 1, motion.tocsr(), *whole)


def _chosen(rows: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the matrix that puts rows, in their order, where they belong."""
    flat = rows.ravel()
    return sp.csr_matrix((np.ones(len(flat)), (flat, np.arange(len(flat)))), shape=(count, len(flat)))


def _of_pieces(
    ends: np.ndarray, points: np.ndarray, flat: float = 1e-6
) -> tuple[sp.csr_matrix, sp.csr_matrix, np.ndarray]:
    """Return motions of pieces, six rows for each, and the equations that make them rigid but for a stretch.

    With the equations comes the number of the piece of each. `ends`: nodes across the shells of a piece, (n,
    k, 3); `flat`: singular values that are none, relative to the size of a piece.
    """
    nodes = ends[:, :, [0, 2]].reshape(len(ends), -1)
    arms = points[nodes] - points[nodes].mean(axis=1, keepdims=True)
    size = np.linalg.norm(arms, axis=2).max(axis=1)
    arms = arms / size[:, None, None]
    ways = np.zeros((*arms.shape, 7))
    ways[..., :3] = np.eye(3)
    for axis in range(3):
        ways[..., 3 + axis] = np.cross(np.eye(3)[axis], arms)
    ways[..., 6] = arms
    matrix = ways.reshape(len(ends), -1, 7)
    left, values, right = np.linalg.svd(matrix)
    there = values > flat * values[:, :1]
    inverse = np.where(there, 1.0 / np.where(there, values, 1.0), 0.0)
    width = values.shape[1]
    motion = np.einsum("nki,nk,njk->nij", right[:, :width], inverse, left[:, :, :width])[:, :6]
    motion[:, 3:] /= size[:, None, None]
    columns = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(ends), -1)
    spare = np.ones(left.shape[::2], dtype=bool)
    spare[:, :width] = ~there
    piece, which = np.nonzero(spare)
    shape = 6 * len(ends), points.size
    rows = _rows(np.repeat(columns, 6, axis=0), motion.reshape(shape[0], -1), shape[1])
    return rows, _rows(columns[piece], left[piece, :, which], shape[1]), piece


def _rows(columns: np.ndarray, values: np.ndarray, width: int) -> sp.csr_matrix:
    """Return the matrix with some entries in each row."""
    row = np.repeat(np.arange(len(columns)), columns.shape[1])
    return sp.csr_matrix((values.ravel(), (row, columns.ravel())), shape=(len(columns), width))


def _middles(ends: np.ndarray, width: int) -> sp.csr_matrix:
    """Return the equations by which nodes in the middle move as the mean of bottom and top."""
    mine = ends.reshape(-1, 3)
    mine = mine[mine[:, 1] >= 0][:, [1, 0, 2]]
    columns = (3 * mine[:, None, :] + np.arange(3)[:, None]).reshape(-1, 3)
    return _rows(columns, np.tile([1.0, -0.5, -0.5], (len(columns), 1)), width)
