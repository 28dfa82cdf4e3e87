"""A smooth surface through the nodes of a mesh, linear in their coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.pairing.sliding.edge_turns import edge_turns
from fenics_contact.pairing.sliding.patch_functions import PatchValues, n_functions, patch_functions
from fenics_contact.surfaces import FacetedSurface, surface_tangents


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
    """

    facets: np.ndarray
    control: sp.csr_matrix
    dim: int

    @classmethod
    def of(cls, surface: FacetedSurface, *, smooth: bool = True) -> SmoothPatches:
        """Return the patches of a surface in its reference configuration; its facets if not smooth."""
        count, corners = surface.facets.shape
        size, total, functions = 3 * corners, len(surface.nodes), n_functions(corners)
        here = size * np.arange(count)[:, None]
        at_corners = (here + np.arange(corners)).ravel()
        shape = (count * size, total)
        control = sp.csr_matrix((np.ones(surface.facets.size), (at_corners, surface.facets.ravel())), shape)
        if not smooth:
            return cls(surface.facets, _spaced(control, size, 0, functions), surface.dim)
        tangents = surface_tangents(surface)
        bends = tangents.bends.tocoo()
        row = (here + np.arange(corners, size)).ravel()[bends.row]
        control = (control + sp.csr_matrix((bends.data, (row, bends.col)), shape)).tocsr()
        if corners == 2:
            return cls(surface.facets, control, surface.dim)
        turns = _spaced(edge_turns(tangents, control), functions - size, size, functions)
        return cls(surface.facets, _spaced(control, size, 0, functions) + turns, surface.dim)

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
        return patch_functions(local, self.corners)

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


def _spaced(rows: sp.csr_matrix, size: int, start: int, total: int) -> sp.csr_matrix:
    """Return ``size`` rows of every facet at ``start`` among ``total`` ones of each."""
    entries = rows.tocoo()
    facet, place = np.divmod(entries.row, size)
    shape = (rows.shape[0] // size * total, rows.shape[1])
    return sp.csr_matrix((entries.data, (facet * total + start + place, entries.col)), shape=shape)
