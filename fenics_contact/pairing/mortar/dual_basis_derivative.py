"""Reverse mode through the dual functions of partly covered facets and the integrals with them."""

from __future__ import annotations

import numpy as np

from fenics_contact.pairing.mortar.cells import CellDerivatives
from fenics_contact.pairing.mortar.dual_basis import DualBasis, inverted_pulled_back
from fenics_contact.pairing.mortar.sums import SumsBy


def integrals_pulled_back(
    basis: DualBasis, field: np.ndarray, by_coverage: np.ndarray, by_integrals: np.ndarray
) -> tuple[CellDerivatives, np.ndarray]:
    """Vector-Jacobian product of `dual_integrals` with respect to the cells and the field.

    Args:
        basis: The dual functions.
        field: Values at the quadrature points, shape (n, q).
        by_coverage: Derivative by D_e, shape (n_facets, corners).
        by_integrals: By the integrals with the master's shape functions and, last, with the field, shape
            (n_pairs, corners, master corners + 1).

    Returns:
        By the cells, and by the field, shape (n, q).
    """
    cells, facet = basis.cells, basis.facet
    functions = np.concatenate([cells.master, field[:, :, None]], axis=2)
    moments = basis.moments(functions)
    over_facet, area = SumsBy(facet, len(basis.area)), basis.area
    by_coverage = by_coverage + over_facet((by_integrals * basis.values(moments)).sum(axis=2))
    by_values = basis.coverage[facet][:, :, None] * by_integrals
    by_mean, means = by_values.sum(axis=1), moments[:, 0] / area[facet][:, None]
    by_area = -over_facet((by_mean * means).sum(axis=1)) / area
    projector = basis.at_corners @ basis.inverse
    by_projector = over_facet(by_values @ moments[:, 1:].transpose(0, 2, 1))
    by_moments = np.concatenate(
        [(by_mean / area[facet][:, None])[:, None], projector[facet].transpose(0, 2, 1) @ by_values], axis=1
    )
    by_corners = by_projector @ basis.inverse
    by_second, more = _by_second_moments(basis, basis.at_corners.transpose(0, 2, 1) @ by_projector)
    # Each quadrature point is in the moments of its pair and in the second moments and areas of its facet.
    at_points = by_moments[cells.pair]
    pulled = functions @ at_points.transpose(0, 2, 1)
    twice = basis.modes @ (by_second + by_second.transpose(0, 2, 1))[cells.facet]
    by_modes = cells.weight[:, :, None] * (pulled[:, :, 1:] + twice)
    by_weight = pulled[:, :, 0] + np.einsum("nqa,nqa->nq", pulled[:, :, 1:] + twice / 2, basis.modes)
    by_weight += np.einsum("nqk,nk->nq", cells.slave, by_coverage[cells.facet])
    by_weight += (by_area + more)[cells.facet][:, None]
    by_local, by_centring = _modes_pulled_back(basis, by_modes, by_corners)
    weighted = (
        np.concatenate([np.ones_like(field)[:, :, None], basis.modes], axis=2) * cells.weight[:, :, None]
    )
    by_functions = weighted @ at_points
    by = CellDerivatives(
        by_weight + by_centring, by_local, np.zeros_like(cells.opposite),
        cells.weight[:, :, None] * by_coverage[cells.facet][:, None], by_functions[:, :, :-1],
    )  # fmt: skip
    return by, by_functions[:, :, -1]


def _by_second_moments(basis: DualBasis, by_inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives by the second moments, shape (n_facets, m, m), and by the areas, (n_facets,)."""
    area = basis.area[:, None, None]
    by_covariance = inverted_pulled_back(basis.covariance, by_inverse / area)
    by_area = -(by_inverse * basis.inverse + by_covariance * basis.covariance).sum(axis=(1, 2)) / basis.area
    return by_covariance / area, by_area


def _modes_pulled_back(
    basis: DualBasis, by_modes: np.ndarray, by_corners: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives by local coordinates, shape (n, q, dim − 1), and by weights, shape (n, q)."""
    cells, plain = basis.cells, basis.cells.local.shape[2]

    def centring(which: slice, by: np.ndarray, at_corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # The mean is zero, its derivative is not.
        by_mean = -(basis.over_facet(by.sum(axis=1)) + at_corners.sum(axis=1)) / basis.area[:, None]
        by_mean = by_mean[cells.facet]
        by_weight = np.einsum("nqa,na->nq", basis.modes[:, :, which], by_mean)
        return by + cells.weight[:, :, None] * by_mean[:, None], by_weight

    by_local, corners = by_modes[:, :, :plain], by_corners[:, :, :plain]
    by_weight = np.zeros(cells.weight.shape)
    if basis.modes.shape[2] > plain:
        mixed = slice(plain, None)
        by_product, by_weight = centring(mixed, by_modes[:, :, mixed], by_corners[:, :, mixed])
        # The product of both coordinates is derived by one of them to the other.
        by_local = by_local + by_product * basis.modes[:, :, 1::-1]
        corners = corners + by_corners[:, :, mixed] * basis.at_corners[:, :, 1::-1]
    by_local, more = centring(slice(plain), by_local, corners)
    return by_local, by_weight + more
