"""How uneven a uniform pressure comes out at the nodes of a slave.

Slave nodes exert a uniform pressure p by forces p a, with the areas a that belong to them. These reach the
master as p Wᵀ a, with the weights W of its nodes in their counterparts, but the same pressure on the master
makes p b. So its nodes move by what r = Wᵀ a − b does to them, and forces of the slave change by p λ until
surfaces fit again. With the compliance of each node alone, C = h / (E g) for a size h and an area g, as
that of a flat punch, and with a constant c, by which the bodies come closer:

    (C_s + W C_m Wᵀ) λ = c − W C_m r,    Σ λ = 0.

λ / a is the relative error of the pressures. That of the whole bodies is about the same, as it changes its
sign from node to node and so does not reach into them.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import cg

from fenics_contact._surfaces.facets import FacetedSurface, bearing_areas, nodal_areas
from fenics_contact._surfaces.projection import Projection, node_weights


def unevenness(
    slave: FacetedSurface, there: Projection, master: FacetedSurface, back: Projection, share: float
) -> float:
    """Return the estimate of the largest relative error of a uniform pressure at nodes of a slave.

    Facets near the end of the other surface are left out. Pressures do not fall below zero.
    """
    met, reached = (np.isin(np.arange(len(s.nodes)), h.point) for s, h in ((slave, there), (master, back)))
    spread = sp.eye(len(met), format="csc")[:, there.point]
    weights = (spread @ node_weights(master, there)).tocsr()
    inside, areas = _areas(slave, weights @ master.points, met)
    covered, wanted = _areas(master, master.points, reached)
    sure = covered & (abs(weights[met & ~inside]).sum(axis=0).A1 == 0.0)
    excess = np.where(sure, weights.T @ areas - wanted, 0.0)
    bears = met & (areas > 0.0)
    if not bears.any():
        return 0.0
    weights, areas = weights[bears], areas[bears]
    own, other = (1.0 - share) * _compliance(slave)[bears], share * _compliance(master)
    matrix = sp.diags(own) + weights @ sp.diags(other) @ weights.T
    forced, _ = cg(matrix, -(weights @ (other * excess)), atol=0.0)
    closed, _ = cg(matrix, np.ones(len(areas)), atol=0.0)
    force = forced - closed * (forced.sum() / closed.sum())
    error = np.maximum(force / areas, -1.0)
    return float(np.abs(error).max(initial=0.0))


def _areas(surface: FacetedSurface, places: np.ndarray, met: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which nodes have facets alone that meet the other surface, and the areas that these bear on.

    `places`: places of its nodes on that surface between which areas are measured, shape (n, dim); `met`:
    which of its nodes meet the other surface, shape (n,).
    """
    facets = surface.bearing
    full = met[facets].all(axis=1)
    bearing = bearing_areas(places, facets[full], surface.measure)
    areas = np.bincount(facets[full].ravel(), bearing.ravel(), minlength=len(met))
    return ~np.isin(np.arange(len(met)), facets[~full]), areas


def _compliance(surface: FacetedSurface) -> np.ndarray:
    """Return size over area of the linear pieces around each node, up to a constant, shape (n,)."""
    facets, corners = surface.facets, surface.corners
    around = np.bincount(facets.ravel(), np.repeat(nodal_areas(surface.points, facets).sum(axis=1), corners))
    square = around / np.bincount(facets.ravel()) * (2.0 if corners == 3 else 1.0)  # of two triangles
    return square ** (1.0 / (surface.dim - 1)) * corners / around
