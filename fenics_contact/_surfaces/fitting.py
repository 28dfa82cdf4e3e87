"""Polynomials fitted to the nodes around others, as far as these nodes determine them."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from fenics_contact._base.csr import Csr


@dataclass(frozen=True)
class PolynomialFit:
    """Polynomials without constant around centres, by least squares with the weights 1 / distance².

    Nodes on two lines, as those of a surface one layer of facets wide, do not tell how it bends across: there
    y² is nearly a linear function of y, and what is not is the nodes' unevenness. So of polynomials that
    those of lower degree explain none is fitted. The surface is then straight in one direction: across the
    lines, but along the rulings where a developable surface, which bends hardly more, goes through the nodes:
    all of a cylinder or cone is found, however its strip lies. Only angles and curvatures decide, in any
    axes. `terms`: powers of the node's coordinates times its weight; `inverse`: from their sums times values
    to coefficients; `scale`: factors of the coefficients. In terms of Bombieri's norm, in which powers of a
    degree count by one over their binomial coefficient, the sum of squares is the same in all axes.
    """

    centre: np.ndarray
    terms: np.ndarray
    inverse: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(
        cls, place: np.ndarray, height: np.ndarray, centre: np.ndarray, narrow: np.ndarray, order: int
    ) -> PolynomialFit:
        """Prepare the fit.

        `narrow`: whether a centre and the nodes around it are all at the rim.
        """
        powers = powers_of(place.shape[1], order)
        scale = np.sqrt([comb(sum(power), power[-1]) for power in powers])
        plain = scale * np.column_stack([np.prod(place**power, axis=1) for power in powers])
        terms = plain / np.maximum((place**2).sum(axis=1), 1e-12)[:, None]
        columns = np.column_stack([plain, height])
        # Power by power: all products of pairs at once would be the largest array of a whole solve.
        sums = np.stack([_summed(centre, len(narrow), term[:, None] * columns) for term in terms.T], axis=1)
        degree = np.array([sum(power) for power in powers])
        kept = _determined(sums, degree, narrow)
        return cls(centre, terms, _inverse_on(sums[:, :, :-1], kept), scale)

    def coefficients(self, values: np.ndarray) -> np.ndarray:
        """Return the coefficients for values at the nodes less those at centres, (n_centres, n_powers)."""
        right = _summed(self.centre, len(self.inverse), self.terms * values[:, None])
        return np.asarray(self.scale * np.einsum("npq,nq->np", self.inverse, right))

    def slope_weights(self, width: int) -> np.ndarray:
        """Return the weights of the nodes' values in the slopes at the centres, shape (n_pairs, width)."""
        return np.asarray(np.einsum("naq,nq->na", self.inverse[self.centre, :width], self.terms))


def powers_of(dim: int, order: int) -> list[tuple[int, ...]]:
    """List the powers of the coordinates in a polynomial without constant, those of degree one first."""
    if dim == 1:
        return [(k,) for k in range(1, order + 1)]
    return [(k - second, second) for k in range(1, order + 1) for second in range(k + 1)]


def _summed(centre: np.ndarray, count: int, values: np.ndarray) -> np.ndarray:
    over = Csr((np.ones(len(centre)), (centre, np.arange(len(centre)))), shape=(count, len(centre)))
    return np.asarray(over @ values.reshape(len(centre), -1)).reshape(count, *values.shape[1:])


def _inverse_on(matrix: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Return the inverses of matrices on the ranges of projectors, both shape (n, size, size)."""
    unit = np.eye(matrix.shape[1]) * np.trace(matrix, axis1=1, axis2=2)[:, None, None]
    return np.asarray(kept @ np.linalg.inv(kept @ matrix @ kept + unit - unit @ kept) @ kept)


def _determined(sums: np.ndarray, degree: np.ndarray, narrow: np.ndarray) -> np.ndarray:
    """Return projectors on the coefficients that are fitted, shape (n, n_powers, n_powers)."""
    matrix, kept = sums[:, :, :-1], np.zeros_like(sums[:, :, :-1])
    width = int(np.count_nonzero(degree == 1))
    kept[:, :width, :width] = np.eye(width)
    for order in range(2, int(degree.max()) + 1):
        low, high = int(np.count_nonzero(degree < order)), int(np.count_nonzero(degree <= order))
        own = slice(low, high)
        lost = _explained(matrix[:, :high, :high], kept[:, :low, :low], narrow & (order == 2))
        kept[:, own, own] = np.eye(high - low) - lost @ np.swapaxes(lost, 1, 2)
        one = np.flatnonzero((lost**2).sum(axis=(1, 2)).round() == 1.0)
        if width == 2 and order == 2 and len(one):
            inverse = _inverse_on(matrix[one, :high, :high], kept[one, :high, :high])
            found = np.einsum("npq,nq->np", inverse, sums[one, :high, -1])[:, own]
            straight = _straight(found, lost[one].sum(axis=2))
            kept[one, own, own] = np.eye(3) - straight[:, :, None] * straight[:, None]
    return kept


def _explained(
    matrix: np.ndarray, kept: np.ndarray, narrow: np.ndarray, fraction: float = 3e-3
) -> np.ndarray:
    """Return the polynomials of the highest degree that lower ones explain at the nodes.

    `kept`: projectors on the lower ones that are fitted; `narrow`: where one counts as explained in any case.
    """
    low = kept.shape[1]
    across, own = matrix[:, :low, low:], matrix[:, low:, low:]
    left = own - np.swapaxes(across, 1, 2) @ _inverse_on(matrix[:, :low, :low], kept) @ across
    values, vectors = np.linalg.eigh(own)
    scaled = vectors / np.sqrt(np.maximum(values, 1e-14 * values[:, -1:]))[:, None]
    unexplained, mixed = np.linalg.eigh(np.swapaxes(scaled, 1, 2) @ left @ scaled)
    explained = unexplained < fraction
    explained[:, 0] |= narrow
    found = scaled @ mixed
    found *= (explained / np.linalg.norm(found, axis=1))[:, None]
    basis, size, _ = np.linalg.svd(found)
    return np.asarray(basis * (size > 1e-9)[:, None])


def _straight(found: np.ndarray, lost: np.ndarray, most: float = 1 / 3) -> np.ndarray:
    """Return the square of the coordinate along which each surface is straight, shape (n, 3).

    `found`: quadratic parts of the surfaces without what is lost; `lost`: what the nodes leave open, nearly
    the square of a coordinate.
    """
    bend, free = _matrices(found), _matrices(lost)
    # The smallest s for which det(bend + s free) = 0.
    turned = np.trace(bend, axis1=1, axis2=2)[:, None, None] * np.eye(2) - bend
    half = 0.5 * (turned * free).sum(axis=(1, 2))
    flat, square = np.linalg.det(bend), half**2 - np.linalg.det(bend) * np.linalg.det(free)
    divisor = half + np.copysign(np.sqrt(np.maximum(square, 0.0)), half)
    known = (square >= 0.0) & (divisor != 0.0)
    added = -flat / np.where(known, divisor, 1.0)
    known &= added**2 <= most * (bend**2).sum(axis=(1, 2))
    ruling = _principal(bend + added[:, None, None] * free, 0)
    x, y = np.where(known[:, None], ruling, _principal(free, -1)).T
    return np.stack([x * x, np.sqrt(2.0) * x * y, y * y], axis=1)


def _matrices(quadratic: np.ndarray) -> np.ndarray:
    """Return the symmetric matrices of quadratic parts, in terms of Bombieri's norm, shape (n, 2, 2)."""
    a, b, c = quadratic[:, 0], quadratic[:, 1] / np.sqrt(2.0), quadratic[:, 2]
    return np.stack([np.stack([a, b], axis=1), np.stack([b, c], axis=1)], axis=1)


def _principal(matrices: np.ndarray, which: int) -> np.ndarray:
    """Return unit eigenvectors of the smallest (0) or largest (−1) magnitude, shape (n, 2)."""
    values, vectors = np.linalg.eigh(matrices)
    chosen = np.argsort(np.abs(values), axis=1)[:, which]
    return np.asarray(vectors[np.arange(len(values)), :, chosen])
