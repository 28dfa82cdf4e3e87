"""Reverse mode through mortar contact points: from gaps, normals, weights and areas back to coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.feti import TornSystem
from fenics_contact.pairing import CouplingDerivatives, MortarPoints
from fenics_contact.scene import ContactPair, Surface, Tie, master_share, surface_of
from fenics_contact.shape.point_motions import PointMotions
from fenics_contact.shape.projection_derivative import PointDerivatives, projection_pulled_back
from fenics_contact.shape.surface_derivative import normals_pulled_back, slopes_pulled_back
from fenics_contact.surfaces import FacetedSurface, Projection


@dataclass(frozen=True)
class MortarDerivatives:
    """Derivatives of a scalar by mortar points.

    Attributes:
        pulled: Forces p on the master, in the equations of adjoint and state: that by the weight of node j is
            the sum over both of p · v_j, shape (2, n, dim).
        normal: By the normals, shape (n, dim).
        gap: By the gaps, shape (n,).
        area: By the areas, shape (n,).
    """

    pulled: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    area: np.ndarray


def mortar_by_shape(
    torn: TornSystem,
    pair: ContactPair | Tie,
    points: np.ndarray,
    motions: PointMotions,
    by: MortarDerivatives,
) -> np.ndarray:
    """Return the derivative by the nodes of all bodies, replicated, shape (n_nodes, dim). Collective.

    Args:
        points: Slave nodes among those of all bodies, ascending, shape (n,).
        motions: Displacements of state and adjoint at the nodes of the master.
    """
    tearing, scene = torn.decomposition.tearing, torn.scene
    assert isinstance(pair.master, Surface)
    slave, master = (surface_of(scene, side, pair.geometry) for side in (pair.slave, pair.master))
    nodes, opposite = (
        tearing.global_nodes(side.body, surface.nodes)
        for side, surface in ((pair.slave, slave), (pair.master, master))
    )
    bearing, comm = np.isin(nodes, points), torn.decomposition.comm
    met = MortarPoints.of(slave, master, bearing, master_share(scene, pair), comm)
    left, right = (np.hstack(list(each)) for each in (by.pulled, motions.at(opposite)))
    own, known = np.zeros((len(nodes), left.shape[1])), np.isin(nodes, motions.nodes)
    own[known] = np.hstack(list(motions.at(nodes[known])))
    coupled = CouplingDerivatives(by.area, left, right, by.normal, by.gap, own)
    by_slave, by_master = mortar_points_pulled_back(met, coupled, comm)
    result = np.zeros((tearing.n_nodes, torn.dim))
    result[nodes] += by_slave
    result[opposite] += by_master
    return result


def mortar_points_pulled_back(
    points: MortarPoints, by: CouplingDerivatives, comm: MPI.Comm
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives by the nodes of slave and master, shape (n_nodes, dim) each. Collective.

    Gaps between true surfaces are those that linear displacements can close: combinations of gaps at the
    nodes of both, each of which is a projection.

    Args:
        comm: Communicator of the ranks that share the work, all with the same arguments.
    """
    slave, master, coupling, gaps = points.slave, points.master, points.coupling, points.closable
    by_slave, by_master = np.zeros_like(slave.points), np.zeros_like(master.points)
    if gaps is not None:
        across = gaps.share * by.gap
        by_own = np.where(gaps.kept, 0.0, by.gap) - across
        here, there = gaps.here, gaps.there
        at_slave, at_master = _gaps_pulled_back(master, here, by_own[here.point])
        by_slave[coupling.node[here.point]] += at_slave
        by_master += at_master
        at_master, at_slave = _gaps_pulled_back(slave, there, (coupling.weight.T @ across)[there.point])
        by_master[there.point] += at_master
        by_slave += at_slave
        own = None if by.own is None else np.pad(by.own, ((0, 0), (0, 1)))
        by = replace(
            by,
            own=own,
            gap=np.where(gaps.kept, by.gap, 0.0),
            left=np.column_stack([by.left, across]),
            right=np.column_stack([by.right, gaps.opposite]),
        )
    parts = points.pulled_back(by, comm)
    for surface, part, result in zip((slave, master), parts, (by_slave, by_master), strict=True):
        every = np.arange(len(surface.facets))
        by_points, by_normals, by_averaged = slopes_pulled_back(surface, every, part.slopes)
        result += part.points + by_points
        result += normals_pulled_back(surface, part.normals + by_normals, by_averaged)
    return by_slave, by_master


def _gaps_pulled_back(
    surface: FacetedSurface, hit: Projection, by_gap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of the gaps with respect to projected points and the surface's nodes."""
    count, dim, corners = len(hit.point), surface.dim, surface.corners
    by = PointDerivatives(
        by_gap, np.zeros((count, dim)), np.zeros((count, dim - 1, dim)), np.zeros((count, corners))
    )
    return projection_pulled_back(surface, hit.facet, hit.local, hit.gap, by)
