"""What a search notices of surfaces and points, in words for the log; nothing where it is known already."""

from __future__ import annotations

import logging

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.points import HELD, SomePoints, by_pairs
from fenics_contact._pairing.projection import shared_projection
from fenics_contact._pairing.uneven_pressure import unevenness
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import may_touch
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._surfaces.facets import FacetedSurface, shape_functions
from fenics_contact._surfaces.projection import node_weights
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.errors import together
from fenics_contact.errors.kinds import safe_log

_LOG = logging.getLogger(__name__)


class Advice:
    """Logs what is noticed, on rank 0."""

    def surface(
        self,
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

    def edge_of_tie(
        self,
        tie: AnyTie,
        slave: FacetedSurface,
        held: np.ndarray,
        master: FacetedSurface,
        comm: MPI.Comm,
    ) -> None:
        """Warn where nodes beyond the master's edge leave a part of the master to the others. Collective.

        Slave facets that the edge crosses are tied at some of their nodes alone; what the master transmits to
        them between these nodes and its edge is missing.

        `held`: which nodes of the slave are tied or held by supports, shape (n_nodes,).
        """
        whole, some = (each(held[slave.facets], axis=1) for each in (np.all, np.any))
        if not np.any(some & ~whole):
            return
        hit = shared_projection(master, np.arange(len(master.nodes)), slave, comm)
        weights, _ = shape_functions(hit.local, slave.corners)
        nodes = slave.facets[hit.facet]
        off = (np.abs(weights) * ~held[nodes]).sum(axis=1) > HELD
        crossed = off & some[hit.facet]
        whole_area = max(master.areas[hit.point].sum(), np.finfo(float).tiny)
        share = master.areas[hit.point[crossed]].sum() / whole_area
        if share > 0.0 and comm.rank == 0:
            safe_log(
                _LOG.warning,
                "the tie of %s is by nodes, and the master ends within %d of %d facets of the slave that "
                "meet it: only some of their nodes are tied, %.2g %% of the master's surface lies under "
                "them, and about as much of the force may be lost; take discretisation='mortar', or let the "
                "smaller surface be the slave",
                tie.place, np.count_nonzero(some & ~whole), np.count_nonzero(some), 100.0 * share,
            )  # fmt: skip

    def free_master(
        self,
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
                "the tie of %s holds nothing at %d of %d nodes of the slave in directions in which supports "
                "hold these, although the master is free there: let the other surface be the slave, or hold "
                "the master by a support",
                tie.place, np.count_nonzero(lost), len(surface.nodes),
            )  # fmt: skip

    def uneven_pressure(
        self,
        scene: Scene,
        pair: ContactPair | AnyTie,
        slave: FacetedSurface,
        master: FacetedSurface,
        comm: MPI.Comm,
        even: float = 0.1,
    ) -> None:
        """Say by how much a uniform pressure will be missed, and whether less with slave and master swapped.

        Only of quadratic cells, where that of single nodes is several times larger. Collective.

        `even`: errors of a uniform pressure up to this are not reported.
        """
        alike = slave.order == master.order == 1
        if alike or not may_touch(scene.bodies, pair, slave).all():
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
            "%s are by nodes, of quadratic cells, and their meshes do not match: where a pressure is "
            "uniform, that of single nodes is off by up to about %.0f %%, and by %.0f %% with slave and "
            "master swapped: %s; discretisation='mortar' has no such error",
            f"surfaces of {pair.place}", 100.0 * error, 100.0 * swapped, better,
        )  # fmt: skip

    def left_out(self, words: str, lost: SomePoints, kept: SomePoints, comm: MPI.Comm) -> None:
        """Log how many points of which pair are left out for which other pair."""
        (pairs, points, one), (others, those, other) = lost, kept
        if comm.rank > 0:
            return
        for here, there, which in by_pairs(points.pair[one], those.pair[other]):
            count = counted(len(np.unique(one[which])), "node")
            safe_log(_LOG.info, words, pairs[here].place, count, others[there].place)


class _Silence(Advice):
    """Logs nothing, where a search has been done before."""

    def surface(self, *_: object, **__: object) -> None:
        """Log nothing."""

    def edge_of_tie(self, *_: object, **__: object) -> None:
        """Log nothing."""

    def free_master(self, *_: object, **__: object) -> None:
        """Log nothing."""

    def uneven_pressure(self, *_: object, **__: object) -> None:
        """Log nothing."""

    def left_out(self, *_: object, **__: object) -> None:
        """Log nothing."""


ADVICE, SILENCE = Advice(), _Silence()
