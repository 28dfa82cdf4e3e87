"""Tangents of a smooth surface at the nodes of a mesh, as fixed combinations of the nodes around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._surfaces.facets import (
    FacetedSurface,
    corner_places,
    corner_products,
    edges_at_corners,
    shape_functions,
)
from fenics_contact._surfaces.fitting import PolynomialFit
from fenics_contact._surfaces.pieces import shape_weights
from fenics_contact._surfaces.true_surface import Wedges, wedges_of
from fenics_contact.shapes.simple import tangent_bases


@dataclass(frozen=True)
class SurfaceTangents:
    """Tangents along the edges at every corner, to the next corner and to the one before.

    All tangents at a node are combinations of the same dim − 1 derivatives, so that they stay in one plane
    whatever becomes of the nodes. `bends`: by which weights of the nodes they differ from the facets' edges;
    rows sum to zero; `derivatives`: weights of the nodes in the derivatives along the axes of each wedge;
    `of_corner`: wedge of each corner; `shares`: shares of the derivatives in the tangents; `smooth`: whether
    they are such combinations; the others are straight.
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
    """
    wedges = wedges_of(surface)
    axes = _axes(surface, wedges)
    if surface.order == 1:
        derivatives = _fitted_derivatives(surface, wedges, axes, order)
    else:
        derivatives = _mean_derivatives(surface, wedges, axes)
    of_corner, width = wedges.of_corner[:, :, None], surface.dim - 1
    edges = edges_at_corners(surface.points[surface.facets])
    along = np.einsum("nkad,nked->nkea", axes[wedges.of_corner][:, :, :-1], edges)
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


def _axes(surface: FacetedSurface, wedges: Wedges) -> np.ndarray:
    """Return axes of the tangent plane of each wedge and its normal, shape (n_wedges, dim, dim)."""
    summed = np.zeros((len(wedges.node), surface.dim))
    np.add.at(summed, wedges.of_corner, corner_products(surface.points, surface.facets))
    normal = summed / np.linalg.norm(summed, axis=1)[:, None]
    return np.concatenate([tangent_bases(normal), normal[:, None]], axis=1)


def _fitted_derivatives(
    surface: FacetedSurface, wedges: Wedges, axes: np.ndarray, order: int
) -> sp.csr_matrix:
    """Return weights of the nodes in the derivatives of fitted positions along the axes of wedges."""
    node, count, dim = wedges.node, len(wedges.node), surface.dim
    centre, around, narrow = wedges.patches(order)
    away = surface.points[node[around]] - surface.points[node[centre]]
    size = np.zeros(count)
    np.maximum.at(size, centre, np.linalg.norm(away, axis=1))
    place = np.einsum("nad,nd->na", axes[centre], away) / size[centre][:, None]
    fit = PolynomialFit.of(place[:, :-1], place[:, -1], centre, narrow, order)
    value = fit.slope_weights(dim - 1) / size[centre][:, None]
    row = ((dim - 1) * centre[:, None] + np.arange(dim - 1)).ravel()
    ends = (np.repeat(node[around], dim - 1), np.repeat(node[centre], dim - 1))
    entries = (np.concatenate([value.ravel(), -value.ravel()]), (np.tile(row, 2), np.concatenate(ends)))
    return sp.csr_matrix(entries, shape=((dim - 1) * count, len(surface.points)))


def _mean_derivatives(surface: FacetedSurface, wedges: Wedges, axes: np.ndarray) -> sp.csr_matrix:
    """Return the same of quadratic facets: the mean of those around a node, at the rim that of its facet."""
    (count, corners), width = surface.facets.shape, surface.dim - 1
    _, slopes = shape_functions(corner_places(corners), corners)
    facet, at = np.repeat(np.arange(count), corners), wedges.of_corner.ravel()
    shares, slopes = np.tile(np.eye(corners), (count, 1)), np.tile(slopes, (count, 1, 1))
    nodes, _ = shape_weights(surface, facet, shares)
    slopes = surface.cut.gradients(facet, shares, slopes)
    by_local = np.einsum("mqa,mqd->mda", slopes, surface.points[nodes])
    by_axes = np.linalg.inv(axes[at, :width] @ by_local)
    values = np.swapaxes(slopes @ by_axes, 1, 2) / np.bincount(at)[at][:, None, None]
    row = np.broadcast_to((width * at[:, None] + np.arange(width))[:, :, None], values.shape)
    column = np.broadcast_to(nodes[:, None], values.shape)
    shape = width * len(wedges.node), len(surface.points)
    return sp.csr_matrix((values.ravel(), (row.ravel(), column.ravel())), shape=shape)
