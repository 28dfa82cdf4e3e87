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

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.accuracy.patches import Moments, Patches, find_patches
from fenics_contact.accuracy.sites import Sites

#: Weight of the highest derivatives relative to the moments of a patch, which are of order one: it affects
#: only what the patch leaves undetermined, which rounding would decide otherwise.
SLIGHT = 1e-5
#: A patch does not determine the highest derivatives if the trace of the inverse of its moments on them
#: exceeds this, by degree and dimension. It is 5.5 and 13.1 inside regular meshes of linear cells, 144 and
#: 273 of quadratic ones; on curved boundaries it may be finite only because layers of nodes are slightly
#: curved, which yields noise.
OPEN = {(2, 2): 8.0, (2, 3): 18.0, (3, 2): 210.0, (3, 3): 400.0}
#: Their weight, by degree, where neighbours prescribe them.
FIRM = {2: 0.2, 3: 0.02}
#: Where no patch suffices, those within this factor of the best are used.
ALIKE = 1.5


def recovered_gradients(sites: Sites, displacement: np.ndarray) -> np.ndarray:
    """Return the recovered displacement gradient at every site. Collective.

    Args:
        sites: The sites.
        displacement: Displacement of each site, shape (n_sites, dim), [length].

    Returns:
        ∂u_k/∂x_j as entry (k, j), shape (n_sites, dim, dim), dimensionless.
    """
    patches = find_patches(sites)
    dim, penalty, highest = patches.dim, _penalty(patches), patches.polynomials.highest
    coefficients = np.zeros((sites.count, patches.polynomials.count, dim))
    waiting, doubts = [], []
    for moments in patches.moments(displacement):
        inverse = np.linalg.inv(moments.matrix + SLIGHT * penalty)
        first = inverse @ moments.right
        # Once more with the remainder, which removes the effect of the weight.
        coefficients[moments.rows] = first + inverse @ (moments.right - moments.matrix @ first)
        spread = np.einsum("nii->n", inverse[:, highest, highest])
        open_ = spread > OPEN[patches.polynomials.degree, dim]
        waiting.append(moments.part(open_))
        doubts.append(spread[open_])
    _ask_neighbours(patches, _joined(waiting), np.concatenate(doubts), coefficients)
    return np.asarray(np.einsum("njk,nji->nki", coefficients[:, :dim], patches.turn))


def _ask_neighbours(patches: Patches, open_: Moments, doubt: np.ndarray, coefficients: np.ndarray) -> None:
    """Refit undetermined sites with the highest derivatives of neighbours, layer by layer. Collective.

    Args:
        patches: The patches.
        open_: Normal equations of the n undetermined sites.
        doubt: Measure of how poorly each is determined, shape (n,).
        coefficients: Coefficients of all sites, which are overwritten, shape (n_sites, m, dim), [length].
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
            heard = doubt <= ALIKE * comm.allreduce(float(doubt.min(initial=np.inf)), op=MPI.MIN)
        known[open_.rows[heard]] = True
        open_, doubt = open_.part(~heard), doubt[~heard]


def _fitted(patches: Patches, moments: Moments, derivatives: np.ndarray) -> np.ndarray:
    """Refit with given highest derivatives where a patch leaves them undetermined.

    Args:
        patches: The patches.
        moments: Normal equations of the sites, n of them.
        derivatives: ∂u_k/∂x_i...∂x_j as entry (i, ..., j, k), shape (n, dim, ..., dim, dim).

    Returns:
        Coefficients, shape (n, m, dim), [length].
    """
    polynomials, back = patches.polynomials, np.linalg.inv(patches.turn[moments.rows])
    firm, right = FIRM[polynomials.degree], moments.right.copy()
    right[:, polynomials.highest] += firm * polynomials.coefficients_of(polynomials.turned(derivatives, back))
    return np.asarray(np.linalg.solve(moments.matrix + firm * _penalty(patches), right))


def _mean_of_neighbours(
    patches: Patches, rows: np.ndarray, known: np.ndarray, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return whether sites have known neighbours, and the mean of these neighbours' highest derivatives.

    Collective.

    Args:
        patches: The patches.
        rows: The sites, shape (n,).
        known: Which sites are known, shape (n_sites,).
        coefficients: Coefficients of all sites.

    Returns:
        Shapes (n,) and (n, dim, ..., dim, dim): ∂u_k/∂x_i...∂x_j as entry (i, ..., j, k).
    """
    sites, dim = patches.sites, patches.dim
    links = sites.neighbours[rows]
    needed = np.unique(links.indices)
    needed = needed[known[needed]]
    polynomials = patches.polynomials
    of_sites = polynomials.tensors(coefficients[needed][:, polynomials.highest])
    turned = polynomials.turned(of_sites, patches.turn[needed])
    size = dim ** (polynomials.degree + 1)
    values = np.column_stack([np.ones(len(needed)), turned.reshape(len(needed), size)])
    total = np.zeros((sites.count, values.shape[1]))
    total[rows] = links[:, needed] @ values
    total = sites.sharing.add_up(total)[rows]
    heard = total[:, 0] > 0
    mean = total[:, 1:] / np.where(heard, total[:, 0], 1.0)[:, None]
    return heard, mean.reshape(len(mean), *(dim,) * (polynomials.degree + 1))


def _penalty(patches: Patches) -> np.ndarray:
    weight = np.zeros(patches.polynomials.count)
    weight[patches.polynomials.highest] = 1.0
    return np.diag(weight)


def _joined(parts: list[Moments]) -> Moments:
    columns = zip(*((part.rows, part.matrix, part.right) for part in parts), strict=True)
    return Moments(*(np.concatenate(column) for column in columns))
