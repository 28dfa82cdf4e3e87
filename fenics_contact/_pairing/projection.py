"""Projection of some nodes of a surface onto another one, shared by the ranks.

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

import logging
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import cg

from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.points import HELD
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._surfaces.facets import FacetedSurface, bearing_areas, nodal_areas, shape_functions
from fenics_contact._surfaces.projection import Projection, join, node_weights, project
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.errors import together
from fenics_contact.errors.kinds import safe_log


def shared_projection(
    slave: FacetedSurface, chosen: np.ndarray, master: FacetedSurface, comm: MPI.Comm
) -> Projection:
    """Project nodes of the slave, distributed round-robin over the ranks. Collective.

    `chosen`: positions in its nodes; the projection numbers these, shape (n,); `comm`: communicator of the
    ranks; all receive all projections.
    """
    mine = np.arange(comm.rank, len(chosen), comm.size)
    projection: Projection | None = None
    with together(comm):
        part = chosen[mine]
        hit = project(slave.points[part], slave.normals[part], master)
        projection = replace(hit, point=mine[hit.point], lost=mine[hit.lost])
    return join([part for part in comm.allgather(projection) if part is not None])


_LOG = logging.getLogger(__name__)


def warn_of_surface(
    scene: Scene,
    surface: Surface,
    geometry: Geometry,
    faceted: FacetedSurface,
    comm: MPI.Comm,
    on_shape: float = 1e-6,
) -> None:
    """Warn of nodes off their shape, and of reconstructed facets that stay flat.

    `on_shape`: nodes count as on their shape if their distance is no more than this fraction of an edge.
    """
    mesh = scene.bodies[surface.body].mesh.origin
    away = mesh.off_shapes.get(surface.name) if geometry == "best" else None
    name = f"surface {surface.name!r} of {surface.body!r}"
    if comm.rank > 0:
        return
    if away is not None and (off := np.count_nonzero(away > on_shape)):
        safe_log(
            _LOG.warning,
            "%d of %d nodes of %s lie off its shape, %s, by up to %.3g of an edge: gaps are measured "
            "from the nodes where they are; move them onto the shape, or correct it",
            off, len(away), name, type(mesh.shapes[surface.name]).__name__, away.max(),
        )  # fmt: skip
    flattened = 0 if faceted.relief is None else faceted.relief.flattened
    if flattened:
        safe_log(
            _LOG.warning,
            "%d of %d facets of %s stay flat, as the surface that their nodes suggest has cusps there or "
            "folds: refine the mesh there, give the surface its shape, or take geometry='faceted'",
            flattened, len(faceted.facets), name,
        )  # fmt: skip


def warn_of_edge(
    tie: AnyTie,
    slave: FacetedSurface,
    held: np.ndarray,
    master: FacetedSurface,
    comm: MPI.Comm,
) -> None:
    """Warn where nodes beyond the master's edge leave a part of the master to the others. Collective.

    Slave facets that the edge crosses are tied at some of their nodes alone; what the master transmits to
    them between these nodes and its edge is missing.

    `held`: which nodes of the slave are tied or held by supports, shape (n_nodes,); `comm`: communicator of
    the ranks that share the work; rank 0 logs.
    """
    whole, some = (each(held[slave.facets], axis=1) for each in (np.all, np.any))
    if not np.any(some & ~whole):
        return
    hit = shared_projection(master, np.arange(len(master.nodes)), slave, comm)
    weights, _ = shape_functions(hit.local, slave.corners)
    nodes = slave.facets[hit.facet]
    off = (np.abs(weights) * ~held[nodes]).sum(axis=1) > HELD
    crossed = off & some[hit.facet]
    share = master.areas[hit.point[crossed]].sum() / max(master.areas[hit.point].sum(), np.finfo(float).tiny)
    if share > 0.0 and comm.rank == 0:
        safe_log(
            _LOG.warning,
            "the tie of %s is by nodes, and the master ends within %d of %d facets of the slave that meet "
            "it: only some of their nodes are tied, %.2g %% of the master's surface lies under them, and "
            "about as much of the force may be lost; take discretisation='mortar', or let the smaller "
            "surface be the slave",
            tie.place, np.count_nonzero(some & ~whole), np.count_nonzero(some), 100.0 * share,
        )  # fmt: skip


def warn_of_free_master(
    tie: AnyTie,
    slave: tuple[FacetedSurface, np.ndarray],
    master: tuple[FacetedSurface, np.ndarray],
    comm: MPI.Comm,
) -> None:
    """Warn where supports hold what a tie would hold, and nothing holds the master there. Collective.

    The support keeps such a component of the slave, see `feti.ties.bonded_rows`.

    `slave`, `master`: surfaces, and which components of their nodes supports prescribe, (n_nodes, dim).
    """
    (surface, fixed), (other, held) = slave, master
    chosen = np.flatnonzero(fixed.any(axis=1))
    hit = shared_projection(surface, chosen, other, comm)
    open_ = abs(node_weights(other, hit)) @ (~held).astype(float) > HELD
    lost = (open_ & fixed[chosen[hit.point]]).any(axis=1)
    if lost.any() and comm.rank == 0:
        safe_log(
            _LOG.warning,
            "the tie of %s holds nothing at %d of %d nodes of the slave in directions in which supports hold "
            "these, although the master is free there: let the other surface be the slave, or hold the "
            "master by a support",
            tie.place, np.count_nonzero(lost), len(surface.nodes),
        )  # fmt: skip


def warn_of_uneven_pressure(
    scene: Scene,
    pair: ContactPair | AnyTie,
    slave: FacetedSurface,
    master: FacetedSurface,
    comm: MPI.Comm,
    even: float = 0.1,
) -> None:
    """Say by how much a uniform pressure will be missed, and whether less with slave and master swapped.

    Only of quadratic cells, where that of single nodes is several times larger. Collective.

    `comm`: communicator of the ranks that share the work; rank 0 logs; `even`: errors of a uniform pressure
    up to this are not reported.
    """
    if slave.order == master.order == 1:
        return
    there = shared_projection(slave, np.arange(len(slave.nodes)), master, comm)
    back = shared_projection(master, np.arange(len(master.nodes)), slave, comm)
    with together(comm):
        share = master_share(scene, pair)
        error = unevenness(slave, there, master, back, share) if comm.rank == 0 else 0.0
        if error <= even:
            return
        swapped = unevenness(master, back, slave, there, 1.0 - share)
    better = "swap them" if swapped < error else "it would not help to swap them"
    safe_log(
        _LOG.warning,
        "%s are by nodes, of quadratic cells, and their meshes do not match: where a pressure is uniform, "
        "that of single nodes is off by up to about %.0f %%, and by %.0f %% with slave and master swapped: "
        "%s; discretisation='mortar' has no such error",
        f"surfaces of {pair.place}", 100.0 * error, 100.0 * swapped, better,
    )  # fmt: skip


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
    bearing = bearing_areas(places, facets[full], surface.axisymmetric)
    areas = np.bincount(facets[full].ravel(), bearing.ravel(), minlength=len(met))
    return ~np.isin(np.arange(len(met)), facets[~full]), areas


def _compliance(surface: FacetedSurface) -> np.ndarray:
    """Return size over area of the linear pieces around each node, up to a constant, shape (n,)."""
    facets, corners = surface.facets, surface.corners
    around = np.bincount(facets.ravel(), np.repeat(nodal_areas(surface.points, facets).sum(axis=1), corners))
    square = around / np.bincount(facets.ravel()) * (2.0 if corners == 3 else 1.0)  # of two triangles
    return square ** (1.0 / (surface.dim - 1)) * corners / around
