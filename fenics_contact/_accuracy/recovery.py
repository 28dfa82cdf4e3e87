"""Recovered displacement gradients at the nodes: polynomial-preserving recovery.

Around each site the differences of the displacement to the neighbouring nodes are fitted by a polynomial one
degree higher than the displacement; the recovered gradient is the polynomial's at the site, exact for
displacements of that degree on any mesh. A patch at the boundary usually leaves some of the highest
derivatives undetermined (with linear cells, two layers of nodes do not determine the curvature normal to
them): these are taken from the neighbours inside the body, all others from the patch's own nodes. Where none
is inside, as in a plate one cell thick, derivatives that even the best patches leave undetermined are zero.

A patch contains one material: strains may jump where materials meet.

References:
    Z. Zhang and A. Naga, A new finite element gradient recovery method: superconvergence property, SIAM J.
    Sci. Comput. 26 (2005); O. C. Zienkiewicz and J. Z. Zhu, The superconvergent patch recovery and a
    posteriori error estimates, Int. J. Numer. Meth. Engng 33 (1992).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from math import factorial, prod

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact.feti.averages import Sharing
from fenics_contact.feti.torn import TornSystem


@dataclass(frozen=True)
class Polynomials:
    """All polynomials up to a degree that vanish at a point.

    The coefficient of a mixed derivative is √(number of its permutations) times it: the sum of squares is
    that of the full tensor of derivatives. Derivatives of the highest degree come last.
    """

    dim: int
    degree: int

    @property
    def count(self) -> int:
        """Number m of polynomials."""
        return sum(len(self._indices(degree)) for degree in range(1, self.degree + 1))

    @property
    def highest(self) -> slice:
        """The polynomials of the highest degree."""
        return slice(self.count - len(self._indices(self.degree)), self.count)

    def values(self, away: np.ndarray) -> np.ndarray:
        """Evaluate them: d_i, then ½ d_i², d_i d_j / √2, and so on."""
        columns = []
        for degree in range(1, self.degree + 1):
            for index in self._indices(degree):
                scale = np.sqrt(_orders(index)) / factorial(degree)
                columns.append(scale * prod((away[..., i] for i in index[1:]), start=away[..., index[0]]))
        return np.stack(columns, axis=-1)

    def tensors(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the tensors of highest derivatives, (n, m', k) -> (n, dim, ..., dim, k)."""
        place, scale = self._places
        return np.asarray((coefficients / scale[:, None])[:, place])

    def coefficients_of(self, tensors: np.ndarray) -> np.ndarray:
        """Return the coefficients of the given tensors, the inverse of `tensors`."""
        index = tuple(np.array(self._indices(self.degree)).T)
        return np.asarray(tensors[(slice(None), *index)] * self._places[1][:, None])

    def turned(self, tensors: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Return Σ t_i..j T_ia ... T_jb: highest derivatives by coordinates x of those by T x."""
        for axis in range(1, self.degree + 1):
            front = np.moveaxis(tensors, axis, 1)
            flat = front.reshape(len(front), self.dim, front[0, 0].size if len(front) else 0)
            done = np.matmul(turn.transpose(0, 2, 1), flat).reshape(front.shape)
            tensors = np.moveaxis(done, 1, axis)
        return tensors

    def _indices(self, degree: int) -> list[tuple[int, ...]]:
        return list(combinations_with_replacement(range(self.dim), degree))

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficient of each entry of the tensor of highest derivatives, and their scales."""
        indices = self._indices(self.degree)
        entries = np.moveaxis(np.indices((self.dim,) * self.degree), 0, -1)
        number = {index: position for position, index in enumerate(indices)}
        ordered = np.sort(entries, axis=-1).reshape(-1, self.degree)
        place = np.array([number[tuple(map(int, index))] for index in ordered])
        return place.reshape(entries.shape[:-1]), np.sqrt([_orders(index) for index in indices])


def _orders(index: tuple[int, ...]) -> int:
    """Return the number of permutations of the factors of a product."""
    return factorial(len(index)) // prod(factorial(index.count(i)) for i in set(index))


@displayed
@dataclass(frozen=True)
class Sites:
    """The nodes of this rank's cells of one order, one site for every material that meets there.

    `sharing`: sites that other ranks hold as well; `neighbours`: number of this rank's cells of their
    material that two sites share, without diagonal; `of_cells`: number of a subdomain -> site of each node of
    its cells, as dolfinx orders the cells of its mesh, nodes in the order of the body's mesh.
    """

    order: int
    node: np.ndarray
    points: np.ndarray
    sharing: Sharing
    neighbours: sp.csr_matrix
    of_cells: dict[int, np.ndarray]
    cells: np.ndarray

    @property
    def count(self) -> int:
        """Number of sites."""
        return len(self.node)


def find_sites(torn: TornSystem, order: int = 1) -> Sites:
    """Number the sites of this rank's subdomains whose cells have a given order. Collective."""
    scene, tearing = torn.scene, torn.decomposition.tearing
    kinds = max(len(body.materials) for body in scene.bodies.values())
    keys: dict[int, np.ndarray] = {}
    for mesh in torn.decomposition.meshes:
        body = scene.bodies[mesh.body]
        if body.mesh.order == order:
            nodes = tearing.global_nodes(mesh.body, body.mesh.cells[mesh.cells])
            keys[mesh.number] = nodes * kinds + body.material_of_cells[mesh.cells][:, None]
    nothing = np.zeros(0, dtype=np.int64)
    every = np.concatenate([nothing, *(part.ravel() for part in keys.values())])
    key, place = np.unique(every, return_inverse=True)
    parts = np.split(place.ravel(), np.cumsum([part.size for part in keys.values()])[:-1])
    of_cells = {
        number: part.reshape(known.shape) for (number, known), part in zip(keys.items(), parts, strict=False)
    }
    node = key // kinds
    points = scene.points[node]
    several = np.flatnonzero(tearing.on_several_ranks[node])
    sharing = Sharing(torn.decomposition.comm, key, several)
    neighbours, cells = _neighbours(list(of_cells.values()), len(key))
    return Sites(order, node, points, sharing, neighbours, of_cells, cells)


def _neighbours(of_cells: list[np.ndarray], count: int) -> tuple[sp.csr_matrix, np.ndarray]:
    nothing = np.zeros(0, dtype=np.int64)
    widths = np.concatenate([nothing, *(np.full(len(cells), cells.shape[1]) for cells in of_cells)])
    start = np.concatenate([[0], np.cumsum(widths)])
    sites = np.concatenate([nothing, *(cells.ravel() for cells in of_cells)])
    incidence = sp.csr_matrix((np.ones(len(sites)), sites, start), shape=(len(widths), count))
    common = sp.csr_matrix(incidence.T @ incidence)
    cells = common.diagonal()
    common.setdiag(0)
    common.eliminate_zeros()
    return common, cells


#: Largest number of entries in a chunk of patches.
CHUNK = 2_000_000


@dataclass(frozen=True)
class Moments:
    """Normal equations of the fits of some sites, in the coordinates of their patches."""

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
    number of cells that it shares with the site. `turn`: T of each site: a difference d of positions is T d
    in its own coordinates, [1 / length]; `weight`: sum of the weights of each patch.
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
        """Yield the normal equations of all sites in chunks. Collective."""
        shared = self.sites.sharing.shared
        alone = np.ones(self.sites.count, dtype=bool)
        alone[shared] = False
        yield self._of_all_ranks(shared, displacement)
        for rows in self._chunks(np.flatnonzero(alone)):
            yield self._of_this_rank(rows, displacement)

    def _of_all_ranks(self, rows: np.ndarray, displacement: np.ndarray) -> Moments:
        size, width = self.polynomials.count, displacement.shape[1]
        packed = np.zeros((self.sites.count if len(rows) else 0, size * (size + width)))
        for part in self._chunks(rows):
            moments = self._of_this_rank(part, displacement)
            packed[part] = np.concatenate([moments.matrix, moments.right], axis=2).reshape(len(part), -1)
        summed = self.sites.sharing.add_up(packed)[rows].reshape(-1, size, size + width)
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
    """Return neighbours and their weights as tables, padded with neighbours of weight zero."""
    table = sites.neighbours
    start, end = table.indptr[rows], table.indptr[rows + 1]
    place = start[:, None] + np.arange(int((end - start).max(initial=0)))
    real = place < end[:, None]
    place = np.where(real, place, start[:, None])
    return table.indices[place], np.where(real, table.data[place], 0.0)


#: A patch does not determine the highest derivatives if the trace of the inverse of its moments on them
#: exceeds this, by degree and dimension. It is 5.5 and 13.1 inside regular meshes of linear cells, 144 and
#: 273 of quadratic ones; on curved boundaries it may be finite only because layers of nodes are slightly
#: curved, which yields noise.
OPEN = {(2, 2): 8.0, (2, 3): 18.0, (3, 2): 210.0, (3, 3): 400.0}
#: Their weight, by degree, where neighbours prescribe them.
FIRM = {2: 0.2, 3: 0.02}


def recovered_gradients(sites: Sites, displacement: np.ndarray, slight: float = 1e-5) -> np.ndarray:
    """Return the recovered displacement gradient at every site. Collective.

    `slight`: weight of the highest derivatives relative to the moments of a patch, which are of order one: it
    affects only what the patch leaves undetermined, which rounding would decide otherwise.
    """
    patches = find_patches(sites)
    dim, penalty, highest = patches.dim, _penalty(patches), patches.polynomials.highest
    coefficients = np.zeros((sites.count, patches.polynomials.count, displacement.shape[1]))
    waiting, doubts = [], []
    for moments in patches.moments(displacement):
        inverse = np.linalg.inv(moments.matrix + slight * penalty)
        first = inverse @ moments.right
        # Once more with the remainder, which removes the effect of the weight.
        coefficients[moments.rows] = first + inverse @ (moments.right - moments.matrix @ first)
        spread = np.einsum("nii->n", inverse[:, highest, highest])
        open_ = spread > OPEN[patches.polynomials.degree, dim]
        waiting.append(moments.part(open_))
        doubts.append(spread[open_])
    _ask_neighbours(patches, _joined(waiting), np.concatenate(doubts), coefficients)
    return np.asarray(np.einsum("njk,nji->nki", coefficients[:, :dim], patches.turn))


def _ask_neighbours(
    patches: Patches, open_: Moments, doubt: np.ndarray, coefficients: np.ndarray, alike: float = 1.5
) -> None:
    """Refit undetermined sites with the highest derivatives of neighbours, layer by layer. Collective.

    `doubt`: measure of how poorly each is determined; `alike`: where no patch suffices, those within this
    factor of the best are used.
    """
    comm = patches.sites.sharing.comm
    known = np.ones(patches.sites.count, dtype=bool)
    known[open_.rows] = False
    while comm.allreduce(len(open_.rows)):
        heard, derivatives = _mean_of_neighbours(patches, open_.rows, known, coefficients)
        if comm.allreduce(np.count_nonzero(heard)):
            ready = open_.part(heard)
            coefficients[ready.rows] = _fitted(patches, ready, derivatives[heard])
        else:
            heard = doubt <= alike * comm.allreduce(float(doubt.min(initial=np.inf)), op=MPI.MIN)
        known[open_.rows[heard]] = True
        open_, doubt = open_.part(~heard), doubt[~heard]


def _fitted(patches: Patches, moments: Moments, derivatives: np.ndarray) -> np.ndarray:
    """Refit with given highest derivatives where a patch leaves them undetermined."""
    polynomials, back = patches.polynomials, np.linalg.inv(patches.turn[moments.rows])
    firm, right = FIRM[polynomials.degree], moments.right.copy()
    right[:, polynomials.highest] += firm * polynomials.coefficients_of(polynomials.turned(derivatives, back))
    return np.asarray(np.linalg.solve(moments.matrix + firm * _penalty(patches), right))


def _mean_of_neighbours(
    patches: Patches, rows: np.ndarray, known: np.ndarray, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return whether sites have known neighbours, and the mean of these neighbours' highest derivatives.

    Collective.
    """
    sites, dim = patches.sites, patches.dim
    links = sites.neighbours[rows]
    needed = np.unique(links.indices)
    needed = needed[known[needed]]
    polynomials = patches.polynomials
    of_sites = polynomials.tensors(coefficients[needed][:, polynomials.highest])
    turned = polynomials.turned(of_sites, patches.turn[needed])
    width = coefficients.shape[2]
    size = dim**polynomials.degree * width
    values = np.column_stack([np.ones(len(needed)), turned.reshape(len(needed), size)])
    total = np.zeros((sites.count, values.shape[1]))
    total[rows] = links[:, needed] @ values
    total = sites.sharing.add_up(total)[rows]
    heard = total[:, 0] > 0
    mean = total[:, 1:] / np.where(heard, total[:, 0], 1.0)[:, None]
    return heard, mean.reshape(len(mean), *(dim,) * polynomials.degree, width)


def _penalty(patches: Patches) -> np.ndarray:
    weight = np.zeros(patches.polynomials.count)
    weight[patches.polynomials.highest] = 1.0
    return np.diag(weight)


def _joined(parts: list[Moments]) -> Moments:
    columns = zip(*((part.rows, part.matrix, part.right) for part in parts), strict=True)
    return Moments(*(np.concatenate(column) for column in columns))
