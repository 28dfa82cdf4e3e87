"""The patch of nodes around every site, with the normal equations of polynomial fits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fenics_contact.accuracy.polynomials import Polynomials
from fenics_contact.accuracy.sites import Sites

#: Largest number of entries in a chunk of patches.
CHUNK = 2_000_000


@dataclass(frozen=True)
class Moments:
    """Normal equations of the fits of some sites, in the coordinates of their patches.

    Attributes:
        rows: The sites, shape (n,).
        matrix: Shape (n, m, m), its trace of order one, with m polynomials.
        right: Shape (n, m, dim), [length].
    """

    rows: np.ndarray
    matrix: np.ndarray
    right: np.ndarray

    def part(self, chosen: np.ndarray) -> Moments:
        """Return those of some sites, given by indices or a mask."""
        return Moments(self.rows[chosen], self.matrix[chosen], self.right[chosen])


@dataclass(frozen=True)
class Patches:
    """The patches of all sites, each with coordinates in which it is isotropic.

    The nodes of a patch are those of the cells around the site that are of its material, each weighted by the
    number of cells that it shares with the site.

    Attributes:
        sites: The sites.
        turn: T of each site: a difference d of positions is T d in its own coordinates, shape (n_sites, dim,
            dim), [1 / length].
        weight: Sum of the weights of each patch, shape (n_sites,).
        polynomials: The fitted polynomials, one degree higher than displacements.
    """

    sites: Sites
    turn: np.ndarray
    weight: np.ndarray
    polynomials: Polynomials

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return int(self.turn.shape[1])

    def moments(self, displacement: np.ndarray) -> Iterator[Moments]:
        """Yield the normal equations of all sites in chunks. Collective.

        Args:
            displacement: Displacement of each site, shape (n_sites, dim), [length].
        """
        shared = self.sites.sharing.shared
        alone = np.ones(self.sites.count, dtype=bool)
        alone[shared] = False
        yield self._of_all_ranks(shared, displacement)
        for rows in self._chunks(np.flatnonzero(alone)):
            yield self._of_this_rank(rows, displacement)

    def _of_all_ranks(self, rows: np.ndarray, displacement: np.ndarray) -> Moments:
        size, dim = self.polynomials.count, self.dim
        packed = np.zeros((self.sites.count if len(rows) else 0, size * (size + dim)))
        for part in self._chunks(rows):
            moments = self._of_this_rank(part, displacement)
            packed[part] = np.concatenate([moments.matrix, moments.right], axis=2).reshape(len(part), -1)
        summed = self.sites.sharing.add_up(packed)[rows].reshape(-1, size, size + dim)
        return Moments(rows, summed[:, :, :size], summed[:, :, size:])

    def _of_this_rank(self, rows: np.ndarray, displacement: np.ndarray) -> Moments:
        other, weight = padded(self.sites, rows)
        points = self.sites.points
        away = np.einsum("nij,npj->npi", self.turn[rows], points[other] - points[rows][:, None])
        basis = self.polynomials.values(away)
        weighted = (basis * (weight / self.weight[rows, None])[..., None]).transpose(0, 2, 1)
        jump = displacement[other] - displacement[rows][:, None]
        return Moments(rows, weighted @ basis, weighted @ jump)

    def _chunks(self, rows: np.ndarray) -> Iterator[np.ndarray]:
        """Yield sites in chunks with about equal numbers of neighbours."""
        if not len(rows):
            return
        count = np.diff(self.sites.neighbours.indptr)[rows]
        order = np.argsort(count, kind="stable")
        numbers = np.cumsum(count[order]) * 2 * self.polynomials.count
        yield from np.split(rows[order], np.flatnonzero(np.diff(numbers // CHUNK)) + 1)


def find_patches(sites: Sites) -> Patches:
    """Give every patch its coordinates. Collective."""
    dim, table, points = sites.points.shape[1], sites.neighbours, sites.points
    row = np.repeat(np.arange(sites.count), np.diff(table.indptr))
    away = (points[table.indices] - points[row]).T
    i, j = np.triu_indices(dim)
    products = [table.data * away[a] * away[b] for a, b in zip(i, j, strict=True)]
    columns = [table.data, *(table.data * away), *products]
    # Every site has neighbours: those of its own cells.
    sums = np.column_stack([np.add.reduceat(column, table.indptr[:-1]) for column in columns])
    sums = sites.sharing.add_up(np.column_stack([sums, sites.cells]))
    weight, own = sums[:, :1], sums[:, -1:]
    mean = sums[:, 1 : 1 + dim] / (weight + own)
    spread = np.empty((sites.count, dim, dim))
    spread[:, i, j] = spread[:, j, i] = sums[:, 1 + dim : -1] / (weight + own)
    spread -= mean[:, :, None] * mean[:, None, :]
    polynomials = Polynomials(dim, sites.order + 1)
    return Patches(sites, np.linalg.inv(np.linalg.cholesky(spread)), weight[:, 0], polynomials)


def padded(sites: Sites, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return neighbours and their weights as tables, padded with neighbours of weight zero.

    Args:
        sites: The sites.
        rows: Some of them.
    """
    table = sites.neighbours
    start, end = table.indptr[rows], table.indptr[rows + 1]
    place = start[:, None] + np.arange(int((end - start).max(initial=0)))
    real = place < end[:, None]
    place = np.where(real, place, start[:, None])
    return table.indices[place], np.where(real, table.data[place], 0.0)
