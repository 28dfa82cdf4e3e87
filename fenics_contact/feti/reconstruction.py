"""The true surface that facets stand for, reconstructed from its nodes where it is smooth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact.feti.surface import FacetedSurface, Relief, corner_products

#: Angle between the normals of neighbouring facets above which their common edge is a crease, in degrees.
CREASE = 40.0
#: Directions of the fit that the neighbours tell less about than this part of the best known one stay as the
#: facets have them.
UNKNOWN = 1e-6


def reconstructed(surface: FacetedSurface) -> FacetedSurface:
    """Return a surface with the relief that the positions of its nodes suggest.

    At every node a quadratic polynomial is fitted to the nodes around (two rings of facets), which gives its
    normal with an error of the second order, also at the rim; cubics with these normals miss the surface by
    an error of the third order. Creases, edges between facets whose normals differ by more than `CREASE`
    degrees, stay: on their two sides nodes have different normals.

    Args:
        surface: Facets without relief.

    References:
        Cazals, F., Pouget, M.: Estimating differential quantities using polynomial fitting of osculating
        jets. Computer Aided Geometric Design 22 (2005).
        Nagata, T.: Simple local interpolation of surfaces using normal vectors. Computer Aided Geometric
        Design 22 (2005).
    """
    wedge, node = _wedges(surface)
    normals = _fitted_normals(surface, wedge, node)
    corners = normals[wedge] - surface.averaged[surface.facets]
    rest = np.zeros((len(surface.facets), 1 if surface.corners == 2 else surface.corners + 1))
    return replace(surface, relief=Relief(np.zeros_like(surface.averaged), corners, rest))


def _wedges(surface: FacetedSurface) -> tuple[np.ndarray, np.ndarray]:
    """Group the corners of facets that meet at a node without a crease in between.

    Returns:
        Wedge of each corner, shape (n_facets, corners), and node of each wedge, shape (n_wedges,).
    """
    count, corners = surface.facets.shape
    unit = _facet_normals(surface)
    one, other = _smooth_neighbours(surface, unit)
    corner = np.arange(count * corners)
    graph = sp.coo_matrix((np.ones(len(one)), (one, other)), shape=(len(corner), len(corner)))
    number, wedge = connected_components(graph, directed=False)
    node = np.zeros(number, dtype=np.int64)
    node[wedge] = surface.facets.ravel()
    return wedge.reshape(count, corners), node


def _facet_normals(surface: FacetedSurface) -> np.ndarray:
    summed = corner_products(surface.points, surface.facets).sum(axis=1)
    return np.asarray(summed / np.linalg.norm(summed, axis=1)[:, None])


def _smooth_neighbours(surface: FacetedSurface, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of corners, numbered facet by facet, at both ends of the edges that are no creases."""
    count, corners = surface.facets.shape
    corner = np.arange(count * corners).reshape(count, corners)
    if corners == 2:  # neighbours share a node: the end of one edge is the start of the next
        end = np.argsort(surface.facets[:, 1])
        ends = surface.facets[end, 1]
        place = np.clip(np.searchsorted(ends, surface.facets[:, 0]), 0, count - 1)
        met = ends[place] == surface.facets[:, 0]
        before, after = end[place[met]], np.flatnonzero(met)
        one, other = corner[before, 1], corner[after, 0]
        flat = _alike(unit, before, after)
        return one[flat], other[flat]
    start, stop = surface.facets.ravel(), np.roll(surface.facets, -1, axis=1).ravel()
    key, turned = start * len(surface.nodes) + stop, stop * len(surface.nodes) + start
    order = np.argsort(key)
    place = np.clip(np.searchsorted(key[order], turned), 0, len(key) - 1)
    other = order[place]
    met = np.flatnonzero((key[other] == turned) & (start < stop))
    other = other[met]
    flat = _alike(unit, met // corners, other // corners)
    met, other = met[flat], other[flat]
    following = np.roll(corner, -1, axis=1).ravel()
    return np.concatenate([met, following[met]]), np.concatenate([following[other], other])


def _alike(unit: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("nd,nd->n", unit[one], unit[other]) > np.cos(np.radians(CREASE)))


def _fitted_normals(surface: FacetedSurface, wedge: np.ndarray, node: np.ndarray) -> np.ndarray:
    """Fit quadratic polynomials around all wedges and return their normals, shape (n_wedges, dim)."""
    count, dim = len(node), surface.dim
    summed = np.zeros((count, dim))
    np.add.at(summed, wedge, corner_products(surface.points, surface.facets))
    summed[surface.mirrored[node]] = 0.0
    mean = summed / np.linalg.norm(summed, axis=1)[:, None]
    centre, around = _two_rings(wedge, count)
    away = surface.points[node[around]] - surface.points[node[centre]]
    away, centre = _with_mirror_images(away, centre, surface.mirrored[node])
    size = np.zeros(count)
    np.maximum.at(size, centre, np.linalg.norm(away, axis=1))
    axes = _tangents(mean)
    place = np.einsum("nad,nd->na", axes[centre], away) / size[centre][:, None]
    height = np.einsum("nd,nd->n", mean[centre], away) / size[centre]
    slope = _fitted_slopes(place, height, centre, count)
    normal = mean - np.einsum("na,nad->nd", slope, axes)
    normal[surface.mirrored[node]] = 0.0
    return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, None])


def _two_rings(wedge: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return which wedges lie within two rings of facets around each, as pairs without the wedge itself."""
    facet = np.repeat(np.arange(len(wedge)), wedge.shape[1])
    of_facet = sp.csr_matrix((np.ones(wedge.size), (wedge.ravel(), facet)), shape=(count, len(wedge)))
    ring = of_facet @ of_facet.T
    pairs = (ring @ ring).tocoo()
    other = pairs.row != pairs.col
    return pairs.row[other], pairs.col[other]


def _with_mirror_images(
    away: np.ndarray, centre: np.ndarray, mirrored: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Add the mirror images of the neighbours of nodes on planes of symmetry."""
    for axis in range(away.shape[1]):
        across = mirrored[centre, axis]
        image = away[across] * np.where(np.arange(away.shape[1]) == axis, -1.0, 1.0)
        away, centre = np.concatenate([away, image]), np.concatenate([centre, centre[across]])
    return away, centre


def _tangents(normals: np.ndarray) -> np.ndarray:
    """Return tangents of unit normals, shape (n, dim − 1, dim)."""
    if normals.shape[1] == 2:
        return np.stack([normals[:, 1], -normals[:, 0]], axis=1)[:, None]
    axes = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, axes)
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)], axis=1)


def _fitted_slopes(place: np.ndarray, height: np.ndarray, centre: np.ndarray, count: int) -> np.ndarray:
    """Fit height = slope · place + quadratic terms by weighted least squares, shape (count, dim − 1)."""
    x = place[:, 0]
    if place.shape[1] == 1:
        terms = np.column_stack([x, x**2])
    else:
        y = place[:, 1]
        terms = np.column_stack([x, y, x**2, x * y, y**2])
    weight = 1.0 / np.maximum((place**2).sum(axis=1), 1e-12)
    size = terms.shape[1]
    products = np.concatenate(
        [terms[:, :, None] * terms[:, None], (height[:, None] * terms)[:, :, None]], axis=2
    )
    over_centres = sp.csr_matrix((weight, (centre, np.arange(len(centre)))), shape=(count, len(centre)))
    summed = (over_centres @ products.reshape(len(centre), -1)).reshape(count, size, size + 1)
    matrix, right = summed[:, :, :-1], summed[:, :, -1]
    values, vectors = np.linalg.eigh(matrix)
    known = values > UNKNOWN * values[:, -1:]
    inverse = np.where(known, 1.0 / np.where(known, values, 1.0), 0.0)
    solved = np.einsum("nij,nj,nkj,nk->ni", vectors, inverse, vectors, right)
    return np.asarray(solved[:, : place.shape[1]])
