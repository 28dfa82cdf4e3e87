"""Displacements of quadratic facets at points of the linear pieces that stand for them."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import FACET_TYPES, CellType, shape_gradients, shape_values


def shape_weights(
    facets: np.ndarray, facet: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of quadratic facets and their weights at points of their linear pieces.

    Args:
        facets: Node numbers of the quadratic facets, (n, nodes of a facet).
        facet: Numbers of linear pieces, consecutive ones of a facet, (m,).
        weights: Linear shape functions of the pieces at the points, (m, corners).

    Returns:
        Node numbers and quadratic shape functions, (m, nodes of a facet) each.
    """
    kind, corners = _pieces(facets, facet)
    places = np.einsum("mk,mkd->md", weights, corners)
    return facets[facet // len(kind.pieces)], shape_values(kind, places)


def shape_weight_gradients(
    facets: np.ndarray, facet: np.ndarray, weights: np.ndarray, gradients: np.ndarray
) -> np.ndarray:
    """Return the derivatives of the weights that `shape_weights` returns by the pieces' local coordinates.

    Args:
        facets: Node numbers of the quadratic facets, (n, nodes of a facet).
        facet: Numbers of linear pieces, (m,).
        weights: Linear shape functions of the pieces at the points, (m, corners).
        gradients: Their derivatives, (m, corners, dim − 1).

    Returns:
        Shape (m, nodes of a facet, dim − 1).
    """
    kind, corners = _pieces(facets, facet)
    by_place = shape_gradients(kind, np.einsum("mk,mkd->md", weights, corners))
    return np.asarray(by_place @ np.einsum("mka,mkd->mda", gradients, corners))


def _pieces(facets: np.ndarray, facet: np.ndarray) -> tuple[CellType, np.ndarray]:
    """Return the type of quadratic facets and the reference corners of pieces, (m, corners, dim − 1)."""
    kind = FACET_TYPES[facets.shape[1], 2 if facets.shape[1] == 3 else 3]
    return kind, kind.nodes[kind.pieces[facet % len(kind.pieces)]]
