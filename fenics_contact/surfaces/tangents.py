"""Tangents of a smooth surface at the nodes of a mesh, as fixed combinations of the nodes around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.surface_shapes import tangent_bases
from fenics_contact.surfaces.facets import FacetedSurface, corner_products
from fenics_contact.surfaces.fitting import PolynomialFit
from fenics_contact.surfaces.reconstruction import Wedges, wedges_of
from fenics_contact.surfaces.relief import edges_at_corners


@dataclass(frozen=True)
class SurfaceTangents:
    """Tangents along the edges at every corner, to the next corner and to the one before.

    All tangents at a node are combinations of the same dim − 1 derivatives, so that they stay in one plane
    whatever becomes of the nodes.

    Attributes:
        bends: By which weights of the nodes they differ from the facets' edges, shape (n_facets · corners ·
            2, n_nodes); rows sum to zero.
        derivatives: Weights of the nodes in the derivatives along the axes of each wedge, shape (n_wedges ·
            (dim − 1), n_nodes).
        of_corner: Wedge of each corner, shape (n_facets, corners).
        shares: Shares of the derivatives in the tangents, shape (n_facets, corners, 2, dim − 1).
        smooth: Whether they are such combinations; the others are straight, shape (n_facets, corners, 2).
    """

    bends: sp.csr_matrix
    derivatives: sp.csr_matrix
    of_corner: np.ndarray
    shares: np.ndarray
    smooth: np.ndarray


def surface_tangents(surface: FacetedSurface, order: int = 2, steepest: float = 0.5) -> SurfaceTangents:
    """Return the tangents of a smooth surface.

    Positions themselves are fitted by polynomials over the tangent planes, as heights are in `reconstructed`:
    the derivative along an edge is then a fixed linear combination of nodes, whatever becomes of them. It
    gets the length with which Hermite's cubic follows an arc of a circle.

    Args:
        surface: The surface in its reference configuration.
        order: Degree of the polynomials.
        steepest: Cosine of the angle between edge and tangent plane below which the edge stays straight.
    """
    wedges = wedges_of(surface)
    axes, derivatives = _tangent_operators(surface, wedges, order)
    of_corner, width = wedges.of_corner[:, :, None], surface.dim - 1
    edges = edges_at_corners(surface.points[surface.facets])
    along = np.einsum("nkad,nked->nkea", axes[wedges.of_corner], edges)
    tangents = (derivatives @ surface.points).reshape(len(wedges.node), width, surface.dim)
    tangent = np.einsum("nkea,nkad->nked", along, tangents[wedges.of_corner])
    length, chord = np.linalg.norm(tangent, axis=3), np.linalg.norm(edges, axis=3)
    cosine = np.einsum("nked,nked->nke", tangent, edges) / np.maximum(length * chord, np.finfo(float).tiny)
    smooth = cosine > steepest
    shares = (
        np.where(smooth, chord / np.where(smooth, length * (1 + cosine) / 2, 1.0), 0.0)[..., None] * along
    )
    column = width * np.broadcast_to(of_corner[..., None], along.shape) + np.arange(width)
    row = np.broadcast_to(np.arange(chord.size).reshape(chord.shape)[..., None], along.shape)
    shape = (chord.size, width * len(wedges.node))
    spread = sp.csr_matrix((shares.ravel(), (row.ravel(), column.ravel())), shape=shape)
    ends = np.stack([np.roll(surface.facets, -1, axis=1), np.roll(surface.facets, 1, axis=1)], axis=2)
    starts = np.broadcast_to(surface.facets[:, :, None], ends.shape)
    at, value = np.arange(chord.size), smooth.ravel().astype(np.float64)
    entries = (np.concatenate([value, -value]), (np.tile(at, 2), np.concatenate([ends, starts]).ravel()))
    straight = sp.csr_matrix(entries, shape=(chord.size, len(surface.points)))
    bends = (spread @ derivatives - straight).tocsr()
    return SurfaceTangents(bends, derivatives, wedges.of_corner, shares, smooth)


def _tangent_operators(
    surface: FacetedSurface, wedges: Wedges, order: int
) -> tuple[np.ndarray, sp.csr_matrix]:
    """Return axes of the tangent plane of each wedge and the derivatives of positions along them.

    Args:
        surface: The surface.
        wedges: Its wedges.
        order: Degree of the polynomials.

    Returns:
        Axes, shape (n_wedges, dim − 1, dim), and weights of the nodes, shape (n_wedges · (dim − 1), n_nodes).
    """
    node, count, dim = wedges.node, len(wedges.node), surface.dim
    summed = np.zeros((count, dim))
    np.add.at(summed, wedges.of_corner, corner_products(surface.points, surface.facets))
    mean = summed / np.linalg.norm(summed, axis=1)[:, None]
    axes = tangent_bases(mean)
    centre, around, narrow = wedges.patches(order)
    away = surface.points[node[around]] - surface.points[node[centre]]
    size = np.zeros(count)
    np.maximum.at(size, centre, np.linalg.norm(away, axis=1))
    away /= size[centre][:, None]
    place, height = np.einsum("nad,nd->na", axes[centre], away), np.einsum("nd,nd->n", mean[centre], away)
    fit = PolynomialFit.of(place, height, centre, narrow, order)
    value = fit.slope_weights(dim - 1) / size[centre][:, None]
    row = ((dim - 1) * centre[:, None] + np.arange(dim - 1)).ravel()
    ends = (np.repeat(node[around], dim - 1), np.repeat(node[centre], dim - 1))
    entries = (np.concatenate([value.ravel(), -value.ravel()]), (np.tile(row, 2), np.concatenate(ends)))
    return axes, sp.csr_matrix(entries, shape=((dim - 1) * count, len(surface.points)))
