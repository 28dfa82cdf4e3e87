"""Dual shape functions of partly covered slave facets, and the mortar integrals with them.

On the covered part of a slave facet the dual functions are ψ = D M⁻¹ N with M = ∫ N Nᵀ and D = diag ∫ N,
so that ∫ ψ_i N_j = δ_ij ∫ N_j and Σ ψ_i = 1. Integrals of ψ_i with master functions are then D_ii times the
value at corner i of the master function's L² projection onto the slave functions. That projection is computed
in the basis {1, u, v, u v} of the same space, centred on the covered part and scaled to its extent, which
stays well conditioned where the part is small.

Directions in which the part is a sliver (see `SLIVER`) are omitted: the projection is constant along them
instead of extrapolated. Biorthogonality is lost there, but not Σ ψ_i = 1 and ∫ ψ_i = ∫ N_i, hence the
transfer of forces.

References:
    Wohlmuth, B.: A mortar finite element method using dual spaces for the Lagrange multiplier. SIAM Journal
    on Numerical Analysis 38 (2000).
    Popp, A., Gitterle, M., Gee, M. W., Wall, W. A.: A dual mortar approach for 3D finite deformation contact
    with consistent linearization. International Journal for Numerical Methods in Engineering 83 (2010).
    Cichosz, T., Bischoff, M.: Consistent treatment of boundaries with mortar contact formulations using dual
    Lagrange multipliers. Computer Methods in Applied Mechanics and Engineering 200 (2011).
"""

from __future__ import annotations

import math

import numpy as np
from scipy import sparse

from fenics_contact.pairing.mortar.cells import Cells

#: Extent of a covered part, as root mean square in local coordinates, below which it is a sliver.
SLIVER = 1e-4
#: Extents below this are not scaled up, so that those of slivers fall below `SLIVER` relative to it.
FLOOR = 1e-2

#: Local coordinates of the corners, by their number.
CORNERS = {
    2: np.array([[-1.0], [1.0]]),
    3: np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    4: np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
}


def dual_integrals(cells: Cells, field: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrate the dual functions with the slave's and the master's shape functions and with a field.

    Args:
        cells: The integration cells.
        field: Values v at the quadrature points, shape (n, q).

    Returns:
        D_e = ∫ N_i over the covered part of each facet, shape (n_facets, corners), ∫ ψ_i N_j of each pair,
        shape (n_pairs, corners, master corners), both [length²] or [length], and ∫ ψ_i v of each pair, shape
        (n_pairs, corners).
    """
    over_facet, over_pair = _SumsBy(cells.facet), _SumsBy(cells.pair)
    area = over_facet(cells.weight.sum(axis=1))
    coverage = over_facet(np.einsum("nq,nqk->nk", cells.weight, cells.slave))
    modes, at_corners = _modes(cells, area)
    second = over_facet(np.einsum("nqa,nqb->nab", modes * cells.weight[:, :, None], modes))
    inverse = _pseudo_inverse(second / area[:, None, None]) / area[:, None, None]
    weighted = np.concatenate([cells.weight[:, :, None], cells.weight[:, :, None] * modes], axis=2)
    functions = np.concatenate([cells.master, field[:, :, None]], axis=2)
    moments = over_pair(weighted.transpose(0, 2, 1) @ functions)
    facet = np.zeros(len(moments), dtype=np.int64)
    facet[cells.pair] = cells.facet
    values = moments[:, :1] / area[facet][:, None, None] + (at_corners @ inverse)[facet] @ moments[:, 1:]
    integrals = coverage[facet][:, :, None] * values
    return coverage, integrals[:, :, :-1], integrals[:, :, -1]


class _SumsBy:
    """Sums of arrays over the entries with the same number."""

    def __init__(self, number: np.ndarray) -> None:
        rows, count = int(number.max(initial=-1)) + 1, len(number)
        self.matrix = sparse.csr_matrix((np.ones(count), (number, np.arange(count))), shape=(rows, count))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        shape = values.shape[1:]
        summed = self.matrix @ values.reshape(len(values), math.prod(shape))
        return np.asarray(summed.reshape(len(summed), *shape), dtype=np.float64)


def _modes(cells: Cells, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the non-constant functions, of mean zero, that span the shape functions together with 1.

    Returns:
        At the quadrature points, shape (n, q, m), and at the corners of each facet, (n_facets, corners, m).
    """
    over_facet, corners = _SumsBy(cells.facet), cells.slave.shape[2]

    def centred(modes: np.ndarray, at_corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Twice: if the covered part is small, the first subtraction leaves a mean of its rounding errors.
        for _ in range(2):
            mean = over_facet(np.einsum("nq,nqa->na", cells.weight, modes)) / area[:, None]
            modes, at_corners = modes - mean[cells.facet][:, None], at_corners - mean[:, None]
        return modes, at_corners

    modes, at_corners = centred(cells.local, CORNERS[corners][None])
    if corners == 4:
        mixed = centred(modes.prod(axis=2, keepdims=True), at_corners.prod(axis=2, keepdims=True))
        modes, at_corners = (np.concatenate(p, axis=2) for p in zip((modes, at_corners), mixed, strict=True))
    return modes, at_corners


def _pseudo_inverse(covariance: np.ndarray) -> np.ndarray:
    """Invert symmetric matrices (n, m, m) except in directions of slivers, where the inverse is zero."""
    floor = np.array([FLOOR, FLOOR, FLOOR**2])[: covariance.shape[1]]
    scale = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), floor**2))
    scaled = covariance / (scale[:, :, None] * scale[:, None])
    values, vectors = np.linalg.eigh(scaled)
    large = values > (SLIVER / FLOOR) ** 2
    inverted = np.where(large, 1 / np.where(large, values, 1.0), 0.0)
    inverse = (vectors * inverted[:, None]) @ vectors.transpose(0, 2, 1)
    return np.asarray(inverse / (scale[:, :, None] * scale[:, None]), dtype=np.float64)
