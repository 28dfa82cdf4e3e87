"""Surfaces of bodies as counterparts of nodes that move far: patches, those of the same body, and means."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fenics_contact._base.csr import Csr
from fenics_contact._pairing.masters import BodyMaster
from fenics_contact._pairing.points import ContactPoints, with_symmetry
from fenics_contact._pairing.sliding.closest import ClosestPoints, Roles, patch_points
from fenics_contact._pairing.sliding.means import MovingMeans
from fenics_contact._pairing.sliding.meeting import Candidates, Found, Moved, SlidingPair
from fenics_contact._pairing.sliding.patches import SmoothPatches
from fenics_contact._pairing.sliding.stiffness import Differential, without_patches
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import shape_functions
from fenics_contact._surfaces.projection import Projection, join
from fenics_contact.errors import together


@dataclass(frozen=True)
class OnSurface(SlidingPair):
    """A slave that meets a surface of a body."""

    master: BodyMaster

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Surfaces of bodies."""
        return pair.between_bodies


@dataclass(frozen=True)
class OnMeans(OnSurface):
    """A slave that meets weighted means of a master."""

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Mortar contact."""
        return pair.by_mortar

    def at(self, moved: Moved) -> Found:
        """Return the points by the coupling of both surfaces. Collective."""
        coordinates, dim = moved.coordinates, moved.coordinates.shape[1]
        surfaces = (self.slave, self.slave_nodes), (self.master.surface, self.master.nodes)
        means = MovingMeans.of(*surfaces, self.candidates, coordinates, moved.comm)
        met = means.coupling
        chosen, near = np.searchsorted(self.candidates, met.node), met.gap <= moved.reach
        means, chosen = replace(means, coupling=met.part(near)), chosen[near]
        met = means.coupling
        points = self.points(chosen, met.normal, met.gap, means.weights(len(coordinates)))
        points = with_symmetry(points, means.symmetric(), self.slave.planes)
        bent = np.zeros((points.count, dim, dim))
        return Found(points, without_patches(bent, len(coordinates)), means={self.number: means})


@dataclass(frozen=True)
class OnPatches(OnSurface):
    """Nodes that meet the smooth surface through the nodes of a master.

    Attributes:
        patches: That surface.
    """

    patches: SmoothPatches

    @classmethod
    def of(cls, scene: Scene, pair: ContactPair, side: Candidates, master: Any) -> OnPatches:
        """Return the slave with the patches of the master."""
        patches = SmoothPatches.of(master.surface, smooth=pair.geometry != "faceted")
        return OnPatches(**vars(side), master=master, patches=patches)

    def at(self, moved: Moved) -> Found:
        """Return the closest points. Collective."""
        coordinates, patches, start = moved.coordinates, self.patches, moved.start
        count, dim = coordinates.shape
        known = self._last_facets(moved)
        met, mine = known[0] >= 0, start.pair == self.number
        met[np.searchsorted(self.nodes, start.key[mine] - self.number * count)] = True
        hit = self.closest(moved, known, met)
        own, width = coordinates[self.master.nodes], len(self.master.nodes)
        at = patch_points(patches, patches.coefficients(own)[hit.facet], hit.local)
        spread = Csr((np.ones(width), (np.arange(width), self.master.nodes)), (width, count))
        weights, *slopes = (
            (patches.weights(hit.facet, values) @ spread).tocsr()
            for values in (at.functions.value, *np.moveaxis(at.functions.first, 2, 0))
        )
        points = self.points(hit.point, at.normal, hit.gap, weights)
        points = replace(points, facet=hit.facet, local=hit.local)
        points = with_symmetry(points, self._symmetric(points), self.slave.planes)
        bend = np.einsum("nabd,nd->nab", at.second, at.normal)
        curvature = np.zeros((points.count, dim, dim))
        differential = Differential(at.tangents, bend, tuple(slopes), curvature)
        return Found(points, differential, self.nodes[hit.lost])

    def _last_facets(self, moved: Moved) -> tuple[np.ndarray, np.ndarray]:
        """Return last facets of candidates, −1 where there is none, and local coordinates."""
        count, last = len(self.candidates), moved.last
        facet, local = np.full(count, -1), np.zeros((count, moved.coordinates.shape[1] - 1))
        mine = last.pair == self.number
        place = np.searchsorted(self.nodes, last.slave[mine])
        facet[place], local[place] = last.facet[mine], last.local[mine]
        return facet, local

    def closest(self, moved: Moved, last: tuple[np.ndarray, np.ndarray], met: np.ndarray) -> Projection:
        """Return the closest points of the candidates, of which each rank projects a share. Collective.

        `last`: as of `_last_facets`; `met`: whether candidates are known to be on the side of their points,
        shape (n_candidates,).
        """
        coordinates, comm = moved.coordinates, moved.comm
        mine = np.arange(comm.rank, len(self.candidates), comm.size)
        found: Projection | None = None
        with together(comm):
            search = self._search(coordinates[self.master.nodes], moved.reach, mine)
            normals, (facet, local) = self.normals(coordinates), last
            at = coordinates[self.nodes[mine]]
            hit = search.find(at, normals[mine], facet[mine], local[mine], met[mine])
            found = replace(hit, point=mine[hit.point], lost=mine[hit.lost])
        return join([part for part in comm.allgather(found) if part is not None])

    def _search(self, points: np.ndarray, reach: float, mine: np.ndarray) -> ClosestPoints:
        """Return the search of some candidates, given where the master's nodes are."""
        return ClosestPoints(self.patches, points, self.patches.coefficients(points), reach)

    def _symmetric(self, points: ContactPoints) -> np.ndarray:
        """Return the symmetry planes that cut both surfaces at a point, (n, n_planes)."""
        corners = self.patches.facets[points.facet]
        shares, _ = shape_functions(points.local, corners.shape[1])
        there = np.einsum("nk,nkd->nd", np.abs(shares), ~self.master.surface.mirrored[corners]) < 0.05
        own = np.zeros((int(self.slave_nodes.max(initial=-1)) + 1, there.shape[1]), dtype=bool)
        own[self.slave_nodes] = self.slave.mirrored
        return np.asarray(there & own[points.slave])


@dataclass(frozen=True)
class OnOwnBody(OnPatches):
    """Nodes that meet another surface of their body.

    Attributes:
        apart: Facets on which each candidate never has a point, shape (n_candidates, n_facets).
        reach: Distance beyond which no candidate needs a point, [length].
    """

    apart: sp.csr_matrix
    reach: float

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Bodies that meet themselves."""
        return pair.is_self_contact

    @classmethod
    def of(
        cls, scene: Scene, pair: ContactPair, side: Candidates, master: Any, facets: float = 3.0
    ) -> OnOwnBody:
        """Return the slave with the patches of the master.

        Candidates have no points on patches on which they lie, nor on facets behind them in the undeformed
        body: those on the other side of a thin wall.
        """
        whole, surface = super().of(scene, pair, side, master), master.surface
        corners = surface.points[surface.facets]
        centres = corners.mean(axis=1)
        size = float(np.linalg.norm(corners - centres[:, None], axis=2).mean())
        reach = 2.0 * facets * size
        place = side.slave.points[side.candidates]
        lists = cKDTree(centres).query_ball_point(place, 2.0 * reach)
        row = np.repeat(np.arange(len(place)), [len(each) for each in lists])
        column = np.concatenate([np.zeros(0, dtype=np.int64), *map(np.asarray, lists)]).astype(np.int64)
        normals = side.slave.normals[side.candidates[row]]
        behind = np.einsum("nd,nd->n", centres[column] - place[row], normals) < 0.0
        shape = len(place), len(centres)
        behind_it = Csr((np.ones(behind.sum()), (row[behind], column[behind])), shape=shape)
        carried = whole.patches.control.tocoo()
        facet = carried.row // (whole.patches.control.shape[0] // len(centres))
        own = Csr(
            (np.ones(len(facet)), (facet, master.nodes[carried.col])),
            shape=(len(centres), int(max(side.slave_nodes.max(), master.nodes.max())) + 1),
        )
        touched = own[:, side.nodes]
        apart = ((behind_it + touched.T) > 0).tocsr()
        if not np.array_equal(side.slave_nodes, master.nodes):
            return OnOwnBody(**vars(whole), apart=apart, reach=reach)
        roles = Roles(whole.patches, surface.points, side.candidates, touched)
        return OnItself(**vars(whole), apart=apart, reach=reach, roles=roles)

    def _search(self, points: np.ndarray, reach: float, mine: np.ndarray) -> ClosestPoints:
        coefficients, reach = self.patches.coefficients(points), min(reach, self.reach)
        return ClosestPoints(self.patches, points, coefficients, reach, self.apart[mine])


@dataclass(frozen=True)
class OnItself(OnOwnBody):
    """A surface that meets itself.

    Attributes:
        roles: Which candidates are slaves.
    """

    roles: Roles

    def closest(self, moved: Moved, last: tuple[np.ndarray, np.ndarray], met: np.ndarray) -> Projection:
        """Return the closest points of those that are slaves. Collective."""
        found = super().closest(moved, last, met)
        return found.part(self.roles.are_slaves(found, last[0]))
