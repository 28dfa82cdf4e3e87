"""Reverse mode through the heights of true surfaces at the quadrature points of a mortar coupling."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.pairing.mortar.cells import CellDerivatives, Cells
from fenics_contact.surfaces import FacetedSurface, heights, interpolated_normal


@dataclass(frozen=True)
class SurfaceDerivatives:
    """Derivatives of a scalar by what a faceted surface is made of.

    Attributes:
        points: By its nodes, shape (n, dim).
        normals: By its true unit normals, shape (n, dim).
        slopes: By the slopes of the true surface at the corners of facets, see `surfaces.slopes`, shape
            (n_facets, corners, 2).
    """

    points: np.ndarray
    normals: np.ndarray
    slopes: np.ndarray

    @classmethod
    def zero(cls, surface: FacetedSurface) -> SurfaceDerivatives:
        """Return derivatives to be summed up."""
        shape = surface.points.shape
        return cls(np.zeros(shape), np.zeros(shape), np.zeros((*surface.facets.shape, 2)))

    def summed(self, comm: MPI.Comm) -> SurfaceDerivatives:
        """Return the sums over all ranks. Collective."""
        return SurfaceDerivatives(
            *(np.asarray(comm.allreduce(getattr(self, each.name))) for each in fields(self))
        )


def relief_pulled_back(
    cells: Cells,
    surfaces: tuple[FacetedSurface, FacetedSurface],
    pairs: tuple[np.ndarray, np.ndarray],
    along: np.ndarray,
    by_relief: np.ndarray,
    into: tuple[SurfaceDerivatives, SurfaceDerivatives],
) -> tuple[CellDerivatives, np.ndarray]:
    """Vector-Jacobian product of `relief_of_cells` with respect to cells and directions.

    Args:
        cells: Quadrature points.
        surfaces: Slave and master.
        pairs: Slave facet and master facet of each pair, shape (n_pairs,) each.
        along: Direction of the heights at each cell, shape (n, dim).
        by_relief: Derivative by the heights, shape (n, q).
        into: Derivatives by slave and master, which grow by those through normals and slopes.

    Returns:
        By the cells, and by the direction at each, shape (n, dim).
    """
    at_slave, at_master = (facet[cells.pair] for facet in pairs)
    by_local, by_slave, by_along = _heights_pulled_back(
        surfaces[0], at_slave, (cells.local, cells.slave), along, by_relief, into[0]
    )
    by_opposite, by_master, more = _heights_pulled_back(
        surfaces[1], at_master, (cells.opposite, cells.master), along, -by_relief, into[1]
    )
    by = CellDerivatives(np.zeros_like(cells.weight), by_local, by_opposite, by_slave, by_master)
    return by, by_along + more


def _heights_pulled_back(
    surface: FacetedSurface,
    facet: np.ndarray,
    places: tuple[np.ndarray, np.ndarray],
    direction: np.ndarray,
    by_height: np.ndarray,
    into: SurfaceDerivatives,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives by local coordinates, shape functions and direction of each cell."""
    local, values = places
    if surface.relief is None:
        return np.zeros_like(local), np.zeros_like(values), np.zeros_like(direction)
    cells, points = by_height.shape
    facet, by_height = np.repeat(facet, points), by_height.ravel()
    direction, weights = np.repeat(direction, points, axis=0), values.reshape(len(facet), -1)
    nodes = surface.facets[facet]
    normals = surface.normals[nodes]
    normal, length = interpolated_normal(weights, normals)
    height = heights(surface, facet, local.reshape(len(facet), -1))
    cosine = np.einsum("nd,nd->n", normal, direction)
    by_value = by_height / cosine
    by_cosine = (-by_value * height.value / cosine)[:, None]
    by_normal = by_cosine * direction
    by_mean = (by_normal - np.einsum("nd,nd->n", by_normal, normal)[:, None] * normal) / length[:, None]
    np.add.at(into.normals, nodes, weights[:, :, None] * by_mean[:, None])
    np.add.at(into.slopes, facet, by_value[:, None, None] * height.by_slopes)
    by_weights = np.einsum("nkd,nd->nk", normals, by_mean)
    by_local = by_value[:, None] * height.by_local
    by_direction = (by_cosine * normal).reshape(cells, points, -1).sum(axis=1)
    return by_local.reshape(local.shape), by_weights.reshape(values.shape), by_direction
