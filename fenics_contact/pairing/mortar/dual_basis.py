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

from dataclasses import dataclass

import numpy as np

from fenics_contact.pairing.mortar.cells import Cells
from fenics_contact.pairing.mortar.sums import SumsBy

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
    basis = DualBasis.on(cells)
    integrals = basis.integrals(np.concatenate([cells.master, field[:, :, None]], axis=2))
    return basis.coverage, integrals[:, :, :-1], integrals[:, :, -1]


@dataclass(frozen=True)
class DualBasis:
    """The dual functions on the covered parts of slave facets.

    Attributes:
        cells: The integration cells.
        over_facet: Sums over the cells of each facet.
        over_pair: Sums over the cells of each pair.
        facet: Facet of each pair, shape (n_pairs,).
        area: Covered area of each facet, shape (n_facets,), [length²] or [length].
        coverage: D_e, shape (n_facets, corners), in the same unit.
        modes: The functions beside 1 at the quadrature points, see `_modes`, shape (n, q, m).
        at_corners: The same at the corners, shape (n_facets, corners, m).
        covariance: Means of the products of two of them over the covered part, shape (n_facets, m, m).
        inverse: Its pseudo-inverse over the area, shape (n_facets, m, m).
    """

    cells: Cells
    over_facet: SumsBy
    over_pair: SumsBy
    facet: np.ndarray
    area: np.ndarray
    coverage: np.ndarray
    modes: np.ndarray
    at_corners: np.ndarray
    covariance: np.ndarray
    inverse: np.ndarray

    @classmethod
    def on(cls, cells: Cells) -> DualBasis:
        """Build the basis of some cells."""
        over_facet, over_pair = SumsBy(cells.facet), SumsBy(cells.pair)
        facet = np.zeros(over_pair.groups, dtype=np.int64)
        facet[cells.pair] = cells.facet
        area = over_facet(cells.weight.sum(axis=1))
        coverage = over_facet(np.einsum("nq,nqk->nk", cells.weight, cells.slave))
        modes, at_corners = _modes(cells, over_facet, area)
        second = over_facet(np.einsum("nqa,nqb->nab", modes * cells.weight[:, :, None], modes))
        covariance = second / area[:, None, None]
        inverse = _pseudo_inverse(covariance) / area[:, None, None]
        return cls(
            cells, over_facet, over_pair, facet, area, coverage, modes, at_corners, covariance, inverse
        )

    def moments(self, functions: np.ndarray) -> np.ndarray:
        """Integrate functions, shape (n, q, f), times 1 and the modes over each pair, (n_pairs, 1 + m, f)."""
        weight = self.cells.weight[:, :, None]
        weighted = np.concatenate([weight, weight * self.modes], axis=2)
        return self.over_pair(weighted.transpose(0, 2, 1) @ functions)

    def values(self, moments: np.ndarray) -> np.ndarray:
        """Return the projections of functions at the corners, each pair's share, (n_pairs, corners, f)."""
        mean = moments[:, :1] / self.area[self.facet][:, None, None]
        return np.asarray(mean + (self.at_corners @ self.inverse)[self.facet] @ moments[:, 1:])

    def integrals(self, functions: np.ndarray) -> np.ndarray:
        """Integrate the dual functions times functions, shape (n, q, f), shape (n_pairs, corners, f)."""
        return np.asarray(self.coverage[self.facet][:, :, None] * self.values(self.moments(functions)))


def _modes(cells: Cells, over_facet: SumsBy, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the non-constant functions, of mean zero, that span the shape functions together with 1.

    Returns:
        At the quadrature points, shape (n, q, m), and at the corners of each facet, (n_facets, corners, m).
    """
    corners = cells.slave.shape[2]

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
    scale, _ = _scales(covariance)
    scaled = covariance / (scale[:, :, None] * scale[:, None])
    values, vectors = np.linalg.eigh(scaled)
    inverse = (vectors * _inverted(values)[:, None]) @ vectors.transpose(0, 2, 1)
    return np.asarray(inverse / (scale[:, :, None] * scale[:, None]), dtype=np.float64)


def _scales(covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the extents (n, m) by which covariances are scaled, and which of them are their own."""
    floor = np.array([FLOOR, FLOOR, FLOOR**2])[: covariance.shape[1]]
    squares = np.diagonal(covariance, axis1=1, axis2=2)
    return np.sqrt(np.maximum(squares, floor**2)), squares > floor**2


def _inverted(values: np.ndarray) -> np.ndarray:
    """Return the inverses of eigenvalues, zero for those of slivers."""
    large = values > (SLIVER / FLOOR) ** 2
    return np.where(large, 1 / np.where(large, values, 1.0), 0.0)


def inverted_pulled_back(covariance: np.ndarray, by_inverse: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the pseudo-inverses of covariances, shape (n, m, m).

    With the eigenvectors V of X and a function f of its eigenvalues λ, δf(X) = V (Γ ∘ Vᵀ δX V) Vᵀ with the
    quotients Γ_ij = (f(λ_i) − f(λ_j)) / (λ_i − λ_j) (Daleckii and Krein): of 1/λ they are −1/(λ_i λ_j), and
    between λ and a sliver's, where f is zero, f(λ) / (λ − λ').
    """
    scale, own = _scales(covariance)
    both = scale[:, :, None] * scale[:, None]
    scaled = covariance / both
    values, vectors = np.linalg.eigh(scaled)
    inverted = _inverted(values)
    one, other = inverted[:, :, None], inverted[:, None]
    apart = values[:, :, None] - values[:, None]
    alone = (one == 0.0) != (other == 0.0)
    quotients = np.where(alone, (one - other) / np.where(alone, apart, 1.0), -one * other)
    inverse = (vectors * inverted[:, None]) @ vectors.transpose(0, 2, 1)
    by_scaled_inverse = by_inverse / both
    turned = vectors.transpose(0, 2, 1) @ by_scaled_inverse @ vectors
    by_scaled = vectors @ (quotients * turned) @ vectors.transpose(0, 2, 1)
    # Each entry is divided by the scales of its row and of its column.
    products = by_scaled_inverse * inverse + by_scaled * scaled
    by_scale = -(products.sum(axis=1) + products.sum(axis=2)) / scale
    result = by_scaled / both
    diagonal = np.arange(scale.shape[1])
    result[:, diagonal, diagonal] += np.where(own, by_scale / (2 * scale), 0.0)
    return np.asarray(result)
