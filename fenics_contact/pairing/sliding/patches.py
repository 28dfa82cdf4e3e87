"""A smooth surface through the nodes of a mesh, linear in their coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.mesh import FACET_TYPES, shape_values
from fenics_contact.pairing.sliding.edge_turns import edge_turns
from fenics_contact.pairing.sliding.patch_functions import (
    PatchValues,
    edge_derivatives,
    n_functions,
    n_values,
    patch_functions,
)
from fenics_contact.surfaces import FacetedSurface, SurfaceTangents, shape_weights, surface_tangents


@dataclass(frozen=True)
class SmoothPatches:
    """S(ξ) = Σ_j W_j(ξ) x_j on every facet, with weights that the reference configuration fixes.

    Edges are cubic; their tangents at the corners are linear combinations of the nodes around them, common to
    all facets that meet there without a crease. So are tangent planes along edges, see `edge_turns`: the
    normal is continuous whatever becomes of the nodes. As S is linear in the nodes and follows every affine
    motion, the closest point's gap has the derivative n·(x_s − Σ W_j x_j)' exactly, and is frame indifferent.

    Attributes:
        facets: Facets as rows of node positions on the surface, shape (n_facets, corners).
        control: Weights of the surface's nodes in the coefficients of each facet's functions, shape (n_facets
            · n_functions, n_nodes).
        dim: Dimension of space.
        order: 1, or 2 where facets are pieces of quadratic ones: patches then are these, but for what smooths
            the edges between them.
    """

    facets: np.ndarray
    control: sp.csr_matrix
    dim: int
    order: int

    @classmethod
    def of(cls, surface: FacetedSurface, *, smooth: bool = True) -> SmoothPatches:
        """Return the patches of a surface in its reference configuration; its facets if not smooth."""
        corners, order = surface.corners, 1 if surface.whole is None else 2
        first, functions = n_values(corners, order), n_functions(corners, order)
        positions, size = _positions(surface, first), first + 2 * corners
        if not smooth:
            return cls(surface.facets, _spaced(positions, first, 0, functions), surface.dim, order)
        tangents = surface_tangents(surface)
        control = _spaced(positions, first, 0, size)
        bends = tangents.bends if order == 1 else tangents.bends - _bent(surface, tangents, control)
        control = control + _spaced(bends, 2 * corners, first, size)
        if corners == 2:
            return cls(surface.facets, control, surface.dim, order)
        turns = _spaced(edge_turns(tangents, control, order), functions - size, size, functions)
        return cls(surface.facets, _spaced(control, size, 0, functions) + turns, surface.dim, order)

    @property
    def corners(self) -> int:
        """Corners of a facet."""
        return int(self.facets.shape[1])

    def coefficients(self, points: np.ndarray) -> np.ndarray:
        """Return the coefficients of all patches, shape (n_facets, n_functions, dim).

        Args:
            points: Present coordinates of the surface's nodes, shape (n_nodes, dim), [length].
        """
        return np.asarray(self.control @ points).reshape(len(self.facets), -1, self.dim)

    def functions(self, local: np.ndarray) -> PatchValues:
        """Return the functions at local coordinates, see `patch_functions`."""
        return patch_functions(local, self.corners, self.order)

    def weights(self, facet: np.ndarray, values: np.ndarray) -> sp.csr_matrix:
        """Return the weights of the surface's nodes at points, shape (n, n_nodes).

        Args:
            facet: Facets, shape (n,).
            values: Functions there, or one of their derivatives, shape (n, n_functions).
        """
        count, size = values.shape
        column = size * facet[:, None] + np.arange(size)
        row = np.repeat(np.arange(count), size)
        spread = sp.csr_matrix((values.ravel(), (row, column.ravel())), shape=(count, self.control.shape[0]))
        return (spread @ self.control).tocsr()


def _positions(surface: FacetedSurface, count: int) -> sp.csr_matrix:
    """Return the weights of nodes in so many positions on each facet, shape (n_facets · count, n_nodes)."""
    nodes, values = surface.facets.reshape(-1, 1), np.ones((surface.facets.size, 1))
    if surface.whole is not None:
        kinds = (FACET_TYPES[each, surface.dim] for each in (surface.corners, count))
        linear, quadratic = kinds
        shares = np.tile(shape_values(linear, quadratic.nodes), (len(surface.facets), 1))
        nodes, values = shape_weights(surface.whole, np.repeat(np.arange(len(surface.facets)), count), shares)
    row = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    shape = len(nodes), len(surface.nodes)
    return sp.csr_matrix((values.ravel(), (row, nodes.ravel())), shape=shape)


def _bent(surface: FacetedSurface, tangents: SurfaceTangents, control: sp.csr_matrix) -> sp.csr_matrix:
    """Return by which weights the tangents of quadratic edges differ from straight ones, as their ``bends``.

    Args:
        surface: The surface, with quadratic facets.
        tangents: Its tangents; those that are not smooth do not differ.
        control: Weights of the nodes in the patches' functions without tangents.
    """
    corner, parts = surface.facets.ravel(), []
    for way in (1, -1):
        other = np.roll(surface.facets, -way, axis=1).ravel()
        row, one = np.tile(np.arange(len(corner)), 2), np.ones(len(corner))
        chords = (np.concatenate([one, -one]), (row, np.concatenate([other, corner])))
        straight = sp.csr_matrix(chords, shape=(len(corner), control.shape[1]))
        parts.append(edge_derivatives(control, surface.corners, 2, 0.0, way) - straight)
    order = np.arange(2 * len(corner)).reshape(2, -1).T.ravel()
    return sp.diags(tangents.smooth.ravel().astype(np.float64)) @ sp.vstack(parts, format="csr")[order]


def _spaced(rows: sp.csr_matrix, size: int, start: int, total: int) -> sp.csr_matrix:
    """Return ``size`` rows of every facet at ``start`` among ``total`` ones of each."""
    entries = rows.tocoo()
    facet, place = np.divmod(entries.row, size)
    shape = (rows.shape[0] // size * total, rows.shape[1])
    return sp.csr_matrix((entries.data, (facet * total + start + place, entries.col)), shape=shape)
