"""A smooth surface through the nodes of a mesh, linear in their coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.pairing.sliding.patch_functions import PatchValues, n_functions, patch_functions
from fenics_contact.surfaces import FacetedSurface, tangent_weights


@dataclass(frozen=True)
class SmoothPatches:
    """S(ξ) = Σ_j W_j(ξ) x_j on every facet, with weights that the reference configuration fixes.

    On a facet the surface is cubic; its tangents at the corners are linear combinations of the nodes around
    them, common to all facets that meet there without a crease. So the normal is continuous at the nodes, and
    across edges up to the third order of their length. As S is linear in the nodes and follows every affine
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
        size, total = n_functions(corners), len(surface.nodes)
        here = size * np.arange(count)[:, None]
        at_corners = (here + np.arange(corners)).ravel()
        shape = (count * size, total)
        control = sp.csr_matrix((np.ones(surface.facets.size), (at_corners, surface.facets.ravel())), shape)
        if smooth:
            bends = tangent_weights(surface).tocoo()
            row = (here + np.arange(corners, size)).ravel()[bends.row]
            control = control + sp.csr_matrix((bends.data, (row, bends.col)), shape)
        return cls(surface.facets, control.tocsr(), surface.dim)

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
