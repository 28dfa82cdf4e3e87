"""Equations without the free components of nodes that belong to no element: these follow from the others.

Of equations A f + C u = 0 with the free components f some are solved for f, independent ones P, so that the
others are (C_Q − M C_P) u = 0 with M A_P = A_Q; forces on f are those −C_Pᵀ A_P⁻ᵀ F on u.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact.decks.local_axes import LocalAxes
from fenics_contact.decks.multi_point import Equation
from fenics_contact.readers.deck_cards import DeckError
from fenics_contact.readers.deck_mesh import DeckMesh


@dataclass(frozen=True, eq=False)
class Reduced:
    """Equations without free components of nodes outside of elements, and where forces on these go.

    `shares`: forces on a unit of force on each component, (6 n_nodes, 6 n_nodes), of components that are
    left out; `undetermined`: what of such forces no equation takes, same shape; `left_out`: numbers of these.
    """

    equations: Sequence[Equation]
    shares: sp.csr_matrix
    undetermined: sp.csr_matrix
    left_out: np.ndarray

    def forces(self, given: np.ndarray, values: np.ndarray, axes: LocalAxes, mesh: DeckMesh) -> np.ndarray:
        """Return forces along x, y and z, (n_nodes, 6), with those on left out components on the others.

        Args:
            given: Forces along the local axes of nodes.
            values: The same along x, y and z.
            axes: Local axes of nodes.
            mesh: The mesh, for errors.
        """
        own = given.ravel()
        lost = np.flatnonzero(np.abs(self.undetermined @ own) > 1e-9 * np.abs(own).max(initial=0.0))
        if len(lost):
            number, component = mesh.numbers[lost[0] // 6], lost[0] % 6 + 1
            raise DeckError(
                f"component {component} of node {number} has a *CLOAD, but no element or equation holds it: "
                "leave the load out"
            )
        moved = (self.shares @ own).reshape(values.shape)
        result = values + moved
        result.ravel()[self.left_out] -= own[self.left_out]
        for node in np.flatnonzero(axes.turned(np.arange(len(values))) & moved.any(axis=1)).tolist():
            result[node, :3] += axes.of(node).T @ moved[node, :3] - moved[node, :3]
        return result


def reduced(
    equations: Sequence[Equation], loose: np.ndarray, moving: np.ndarray, most: int = 30_000_000
) -> Reduced:
    """Return equations without components that nothing but equations holds.

    Args:
        equations: Equations between components of nodes.
        loose: Which components are of no element and never held, (n_nodes, 6).
        moving: Which components are displacements of elements, (n_nodes, 6).
        most: Entries up to which the free components that are joined by equations are solved for.
    """
    size = loose.size
    nothing = sp.csr_matrix((size, size))
    number = np.repeat(np.arange(len(equations)), [len(each.nodes) for each in equations])
    node, part, factor = (
        np.array([entry for each in equations for entry in getattr(each, name)], dtype=kind)
        for name, kind in (("nodes", np.int64), ("components", np.int64), ("factors", np.float64))
    )
    matrix = sp.csr_matrix((factor, (number, 6 * node + part)), shape=(len(equations), size))
    free = np.flatnonzero(loose.ravel() & (np.diff(matrix.tocsc().indptr) > 0))
    if not len(free):
        return Reduced(equations, nothing, nothing, free)
    touched = np.flatnonzero(np.diff(matrix[:, free].tocsr().indptr))
    apart = np.setdiff1d(np.arange(len(equations)), touched)
    kept = [equations[k] for k in apart.tolist()]
    shares, lost = [], []
    for rows, columns in _joined(matrix[touched][:, free]):
        mine, out = touched[rows], free[columns]
        if len(rows) * len(columns) > most:
            raise equations[mine[0]].error(
                f"{len(rows)} equations share {len(columns)} components without elements: hold some of these"
            )
        found = _Group.of(matrix[mine], out)
        kept += [_equation(equations[mine[k]], *row) for k, *row in found.rest()]
        shares.append(found.shares(out, size))
        lost.append(found.lost(out, size))
    onto = sp.diags(moving.ravel().astype(float))  # what is held takes its share by itself
    return Reduced(kept, (onto @ sum(shares, nothing)).tocsr(), sum(lost, nothing).tocsr(), free)


def _joined(matrix: sp.csr_matrix) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield rows and columns that belong together."""
    entries, (rows, columns) = matrix.tocoo(), matrix.shape
    graph = sp.coo_matrix(
        (np.ones(entries.nnz), (entries.row, rows + entries.col)), shape=(rows + columns, rows + columns)
    )
    count, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    ends = np.cumsum(np.bincount(label, minlength=count))[:-1]
    for group in np.split(order, ends):
        yield group[group < rows], group[group >= rows] - rows


@dataclass(frozen=True, eq=False)
class _Group:
    """Equations that are solved for free components: A, (n, m), and the others without these columns, C."""

    own: np.ndarray
    others: sp.csr_matrix
    solved: np.ndarray
    left: np.ndarray

    @classmethod
    def of(cls, matrix: sp.csr_matrix, out: np.ndarray, least: float = 1e-10) -> _Group:
        """Choose the equations to solve; `least`: smallest pivot that counts, over the largest."""
        own = matrix[:, out].toarray()
        kept = np.ones(matrix.shape[1])
        kept[out] = 0.0
        rest = (matrix @ sp.diags(kept)).tocsr()
        rest.eliminate_zeros()
        scaled = own / np.linalg.norm(own, axis=0)
        pivots, order = scipy.linalg.qr(scaled.T, mode="r", pivoting=True)
        size = np.abs(np.diag(pivots))
        rank = int(np.count_nonzero(size > least * size[0]))
        return cls(own, rest, order[:rank], order[rank:])

    def rest(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Yield the numbers of equations that remain, and their components and factors."""
        if not len(self.left):
            return
        weights = np.linalg.lstsq(self.own[self.solved].T, self.own[self.left].T, rcond=None)[0].T
        whole = (self.others[self.left] - sp.csr_matrix(weights) @ self.others[self.solved]).tocsr()
        # Coordinates have few digits.
        whole.data[np.abs(whole.data) <= 1e-9 * abs(self.others).max()] = 0.0
        whole.eliminate_zeros()
        for k, number in enumerate(self.left.tolist()):
            mine = slice(whole.indptr[k], whole.indptr[k + 1])
            if mine.stop > mine.start:
                yield number, whole.indices[mine], whole.data[mine]

    def shares(self, out: np.ndarray, size: int) -> sp.csr_matrix:
        """Return forces on others on a unit of force on each left out component."""
        moved = -(self.others[self.solved].T @ np.linalg.pinv(self.own[self.solved].T))
        picked = sp.csr_matrix((np.ones(len(out)), (np.arange(len(out)), out)), shape=(len(out), size))
        return (sp.csr_matrix(moved) @ picked).tocsr()

    def lost(self, out: np.ndarray, size: int) -> sp.csr_matrix:
        """Return what of forces on left out components no equation takes."""
        span = self.own[self.solved].T
        left = np.eye(len(out)) - span @ np.linalg.pinv(span)
        left[np.abs(left) < 1e-9] = 0.0
        picked = sp.csr_matrix((np.ones(len(out)), (np.arange(len(out)), out)), shape=(len(out), size))
        return (picked.T @ sp.csr_matrix(left) @ picked).tocsr()


def _equation(of: Equation, place: np.ndarray, factors: np.ndarray) -> Equation:
    """Return an equation with other entries; `place`: 6 times their nodes, plus their components."""
    node, component = np.divmod(place, 6)
    return replace(
        of, nodes=tuple(node.tolist()), components=tuple(component.tolist()), factors=tuple(factors.tolist())
    )
