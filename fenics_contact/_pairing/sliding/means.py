"""Mortar contact of bodies where they lie now: weighted means over the master, and how these move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import scaled_rows
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.coupling import MortarCoupling, mortar_coupling
from fenics_contact._pairing.mortar.derivatives import (
    WeightDerivatives,
    mortar_pulled_back,
    weight_derivatives,
)
from fenics_contact._pairing.mortar.normals import MasterNormals
from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._pairing.sliding.closest import moved_surface, summed_normals, summed_normals_by_points
from fenics_contact._pairing.sliding.stiffness import LowRank, frame_changes, spread
from fenics_contact._scene.parts import slave_of
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.mesh.faces import coordinate_rounding

#: A surface in the reference configuration, and its nodes among those of all bodies.
Side: TypeAlias = tuple[FacetedSurface, np.ndarray]


@dataclass(frozen=True)
class MeanMotion:
    """First derivatives of normals and weights by the coordinates of all nodes.

    Attributes:
        turn: t_a·δn, shape (n, n_dofs) each.
        point: Point of each weight, shape (m,).
        node: Its node of the master among those of all bodies, shape (m,).
        weights: Derivatives of the weights, shape (m, n_dofs), [1 / length].
    """

    turn: tuple[sp.csr_matrix, ...]
    point: np.ndarray
    node: np.ndarray
    weights: sp.csr_matrix

    def feet(self, points: ContactPoints, coordinates: np.ndarray, along: np.ndarray) -> sp.csr_matrix:
        """Return v·Σ δW_j x_j, how the mean of the master moves as its weights change, (n, n_dofs).

        `coordinates`: of all nodes, shape (n_nodes, dim), [length]; `along`: v, shape (n, dim).
        """
        away = coordinates[self.node] - coordinates[points.slave[self.point]]
        lever = np.einsum("md,md->m", away, along[self.point])
        entries = lever, (self.point, np.arange(len(lever)))
        return (Csr(entries, shape=(points.count, len(lever))) @ self.weights).tocsr()

    def gap_rows(self, points: ContactPoints, coordinates: np.ndarray) -> sp.csr_matrix:
        """Return the derivative of the gaps less the rows n·(δx_i − Σ W_ij δx_j) of the forces, (n, n_dofs).

        That is δn·(x_i − Σ W_ij x_j) − n·Σ δW_ij x_j.
        """
        jump = points.jump @ coordinates
        turned = sum(
            scaled_rows(turn, np.einsum("nd,nd->n", points.tangents[:, a], jump))
            for a, turn in enumerate(self.turn)
        )
        return (turned - self.feet(points, coordinates, points.normal)).tocsr()

    def slip_rows(
        self, points: ContactPoints, coordinates: np.ndarray, way: np.ndarray
    ) -> list[sp.csr_matrix]:
        """Return what the derivative of the slip has beside t_c·Σ (W_j − W_j,start) δx_j, (n, n_dofs) each.

        That is t_c·Σ δW_j x_j + δt_c·way.

        `coordinates`: of all nodes, shape (n_nodes, dim), [length]; `way`: the slip as vectors, shape (n,
        dim), [length].
        """
        turned = frame_changes(points.normal, points.axes, points.tangents)
        change = np.einsum("ncad,nd->nca", turned, way)
        rows = []
        for c in range(turned.shape[1]):
            frames = sum(scaled_rows(turn, change[:, c, a]) for a, turn in enumerate(self.turn))
            rows.append((self.feet(points, coordinates, points.tangents[:, c]) + frames).tocsr())
        return rows

    def stiffness(self, points: ContactPoints, normal: np.ndarray, friction: np.ndarray) -> LowRank:
        """Return the derivative of the forces Σ p_i·(δx_i − Σ W_ij δx_j) at fixed multipliers.

        With p = −λ_N n + Σ τ_a t_a these change by δp, and over the master by −δW_ij p_i: one column for each
        tangent of a point and each component of a node.

        `normal`: λ_N, shape (n,), [force]; `friction`: τ in the points' tangents, shape (n, dim − 1),
        [force].
        """
        turned = frame_changes(points.normal, points.axes, points.tangents)
        change = np.einsum("nc,ncad->nad", friction, turned) - normal[:, None, None] * points.tangents
        acting = np.flatnonzero(change.any(axis=(1, 2)))
        left = [spread(change[acting, a], points.jump[acting]) for a in range(change.shape[1])]
        right = [turn[acting] for turn in self.turn]
        force = np.einsum("nc,ncd->nd", friction, points.tangents) - normal[:, None] * points.normal
        node, first, place = np.unique(self.node, return_index=True, return_inverse=True)
        # One row for each component of each node, component by component.
        dim, every, component = force.shape[1], np.arange(len(self.node)), np.arange(force.shape[1])[:, None]
        entry = (len(node) * component + place.ravel()).ravel(), np.tile(every, dim)
        acted = Csr((force[self.point].T.ravel(), entry), shape=(dim * len(node), len(every)))
        right.append(acted @ self.weights)
        column, row = (dim * node + component).ravel(), np.arange(dim * len(node) + 1)
        shape = dim * len(node), self.weights.shape[1]
        left.append(Csr((-np.ones(len(column)), column, row), shape=shape))
        point = [np.tile(acting, change.shape[1]), np.tile(self.point[first], dim)]
        return LowRank(
            sp.vstack(left).T.tocsr(), sp.vstack(right).T.tocsr(), np.concatenate(point).astype(np.int64)
        )


@dataclass(frozen=True)
class MeanTangents:
    """What the linearisation of mortar contact has beside the rows of its forces.

    Attributes:
        stiffness: Derivative of the forces by the coordinates at fixed multipliers.
        gap: Where a point has a force, the derivative of its gap less the row n·(δx_i − Σ W_ij δx_j), shape
            (n, n_dofs).
        slip: The same of its slip less the rows t_a·(δx_i − Σ W_ij δx_j), shape (n · (dim − 1), n_dofs).
    """

    stiffness: LowRank
    gap: sp.csr_matrix
    slip: sp.csr_matrix

    @classmethod
    def none(cls, count: int, width: int, size: int) -> MeanTangents:
        """Return those of points without forces."""
        nothing = Csr((size, 0))
        stiffness = LowRank(nothing, nothing, np.zeros(0, dtype=np.int64))
        return cls(stiffness, Csr((count, size)), Csr((count * width, size)))

    def with_points(self, mine: np.ndarray, other: MeanTangents) -> MeanTangents:
        """Return these and those of some of the points, by their numbers among all."""
        count, own = self.gap.shape[0], other.stiffness
        width = self.slip.shape[0] // max(count, 1)
        rows = (width * mine[:, None] + np.arange(width)).ravel()
        left, right = (
            sp.hstack([getattr(part, side) for part in (self.stiffness, own)], "csr")
            for side in ("left", "right")
        )
        point = np.concatenate([self.stiffness.point, mine[own.point]])
        return MeanTangents(
            LowRank(left, right, point),
            (self.gap + placed(mine, count) @ other.gap).tocsr(),
            (self.slip + placed(rows, count * width) @ other.slip).tocsr(),
        )


def placed(chosen: np.ndarray, count: int) -> sp.csr_matrix:
    """Return the matrix that puts rows to chosen places among a number of rows."""
    entries = np.ones(len(chosen)), (chosen, np.arange(len(chosen)))
    return Csr(entries, shape=(count, len(chosen)))


def interleaved(parts: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
    """Return the first row of each part, the second one of each, and so on."""
    width, count = len(parts), parts[0].shape[0]
    if width == 1:
        return parts[0]
    order = np.arange(width * count).reshape(width, count).T.ravel()
    return sp.vstack(parts, format="csr")[order]


@dataclass(frozen=True)
class MovingMeans:
    """The mortar coupling of two surfaces as they lie now, with the gap n_i·(x_i − Σ W_ij x_j).

    Normals n of the slave and weights W depend on the coordinates, but not on how everything lies in space.

    Attributes:
        slave: The slave surface in its present place.
        master: The master surface in its present place.
        coupling: Their coupling, at nodes that may carry a multiplier.
        slave_nodes: Nodes of the slave among those of all bodies.
        master_nodes: Nodes of the master among those of all bodies.
        comm: Communicator of the ranks that share the work.
    """

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
    slave_nodes: np.ndarray
    master_nodes: np.ndarray
    comm: MPI.Comm

    @classmethod
    def of(
        cls, slave: Side, master: Side, candidates: np.ndarray, coordinates: np.ndarray, comm: MPI.Comm
    ) -> MovingMeans:
        """Couple surfaces where the nodes of all bodies are. Collective on ``comm``.

        `candidates`: positions of the slave's nodes that may carry a multiplier.
        """
        here, there = (moved_surface(surface, coordinates[nodes]) for surface, nodes in (slave, master))
        coupling = mortar_coupling(here, there, comm)
        coupling = coupling.part(np.isin(coupling.node, candidates))
        return cls(here, there, coupling, slave[1], master[1], comm)

    def weights(self, n_nodes: int) -> sp.csr_matrix:
        """Return the weights of the nodes of all bodies, shape (n, n_nodes)."""
        weight, own = self.coupling.weight, self.coupling.own
        entries = weight.data, self.master_nodes[weight.indices], weight.indptr
        shape = (weight.shape[0], n_nodes)
        weights = Csr(entries, shape=shape)
        if own is None:
            return weights
        node, number = self.slave_nodes[self.coupling.node], np.arange(len(self.coupling.node) + 1)
        alone = Csr((np.ones(len(node)), node, number), shape=shape)
        return weights + alone - Csr((own.data, self.slave_nodes[own.indices], own.indptr), shape)

    def symmetric(self) -> np.ndarray:
        """Return the planes of symmetry that cut both surfaces at points, shape (n, n_planes)."""
        slave, master, met = self.slave, self.master, self.coupling.weight.tocoo()
        node = self.coupling.node[met.row]
        result = np.zeros((len(self.coupling.node), slave.mirrored.shape[1]), dtype=bool)
        apart = np.abs(slave.across(slave.points[node] - master.points[met.col]))
        same = apart <= coordinate_rounding(np.concatenate([slave.points, master.points]))
        np.logical_or.at(result, met.row, slave.mirrored[node] & master.mirrored[met.col] & same)
        return result

    def areas_pulled_back(self, by_area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vector-Jacobian product of the coupling's areas with respect to the nodes of slave and master.

        Collective.

        `by_area`: shape (n,).
        """
        count, dim = self.coupling.normal.shape
        none = np.zeros((count, 0)), np.zeros((len(self.master.nodes), 0))
        by = CouplingDerivatives(by_area, *none, np.zeros((count, dim)), np.zeros(count))
        by_slave, by_master = mortar_pulled_back(self.slave, self.master, self.coupling, by, self.comm)
        return by_slave.points, by_master.points

    def tangents(
        self,
        points: ContactPoints,
        coordinates: np.ndarray,
        forces: tuple[np.ndarray, np.ndarray],
        slid: tuple[np.ndarray, sp.csr_matrix],
    ) -> MeanTangents:
        """Return what the linearisation has beside the rows of the forces. Collective.

        `coordinates`: of all nodes, shape (n_nodes, dim), [length]; `forces`: λ_N, shape (n,), and τ in the
        points' tangents, shape (n, dim − 1), [force]; `slid`: the slip as vectors, shape (n, dim), [length],
        and the weights of all nodes from which it counts, shape (n, n_nodes).
        """
        normal, friction = forces
        rubbed, (way, before) = (friction != 0.0).any(axis=1), slid
        motion = self.motion(points, rubbed | (normal != 0.0))
        standing = (points.master - before - points.jump).tocsr()
        slip = [
            scaled_rows((spread(points.tangents[:, c], standing) + rows).tocsr(), rubbed.astype(float))
            for c, rows in enumerate(motion.slip_rows(points, coordinates, way))
        ]
        gap = motion.gap_rows(points, coordinates)
        return MeanTangents(motion.stiffness(points, normal, friction), gap, interleaved(slip))

    def motion(self, points: ContactPoints, wanted: np.ndarray) -> MeanMotion:
        """Differentiate normals and weights of wanted points. Collective.

        `wanted`: points that need it, a mask, shape (n,).
        """
        nodes, dim = np.concatenate([self.slave_nodes, self.master_nodes]), self.slave.dim
        dof = (dim * nodes[:, None] + np.arange(dim)).ravel()
        size = dim * points.master.shape[1]

        def among_all(rows: sp.csr_matrix) -> sp.csr_matrix:
            """Return rows by the dofs of both surfaces as rows by those of all bodies."""
            whole = Csr((rows.data, dof[rows.indices], rows.indptr), shape=(rows.shape[0], size))
            whole.sum_duplicates()  # of nodes on both surfaces, and sorted
            return whole

        found = weight_derivatives(self.slave, self.master, self.coupling, wanted, self.comm)
        turn = tuple(
            among_all(scaled_rows(self._turned(points.tangents[:, a], found), wanted.astype(float)))
            for a in range(dim - 1)
        )
        # The slave's own mean takes the place of its node: its weights are on the other side.
        every = np.concatenate([self.master_nodes, self.slave_nodes])
        rows = scaled_rows(found.rows, np.where(found.node < len(self.master_nodes), 1.0, -1.0))
        return MeanMotion(turn, found.point, every[found.node], among_all(rows))

    def _turned(self, along: np.ndarray, weights: WeightDerivatives) -> sp.csr_matrix:
        """Return v·δn of the points by the nodes of both for vectors v across the normals, (n, n_dofs).

        `weights`: derivatives of the weights of all points where v counts.
        """
        slave, master, node = self.slave, self.master, self.coupling.node
        of_master = MasterNormals.of(slave, master, node, self.coupling.weight, self.coupling.area)
        chosen, size = of_master.point, np.linalg.norm(summed_normals(slave, slave.points)[node], axis=1)
        by_all = of_master.across(along[chosen])
        vectors, normal = -along, slave.normals[node[chosen]]
        level = by_all - np.einsum("nd,nd->n", by_all, normal)[:, None] * normal
        vectors[chosen] = (of_master.part - 1.0)[:, None] * level
        vectors = slave.within(vectors, slave.mirrored[node]) / size[:, None]
        everywhere = np.zeros_like(slave.points)
        everywhere[node] = vectors
        own = summed_normals_by_points(slave, everywhere)[node]
        rows = Csr((own.data, own.indices, own.indptr), shape=(len(node), weights.rows.shape[1]))
        if not len(of_master.point):
            return rows
        turned = self._turned_by_master(of_master, by_all, weights)
        return (rows + placed(of_master.point, len(node)) @ turned).tocsr()

    def _turned_by_master(
        self, chosen: MasterNormals, by_all: np.ndarray, weights: WeightDerivatives
    ) -> sp.csr_matrix:
        """Return v·δN at fixed normals of the slave, by the nodes of both, (m, n_dofs), for vectors v.

        That is v·(β Σ (δW_j m_j + W_j δm_j) + N' δD), and m_j = S_j / ‖S_j‖ of summed areas S_j.
        """
        master, (count, size) = self.master, (len(chosen.point), weights.rows.shape[1])
        mirrored = self.slave.mirrored[self.coupling.node[chosen.point]]
        along = self.slave.within(chosen.part[:, None] * by_all, mirrored)
        place = np.full(len(self.coupling.node), -1)
        place[chosen.point] = np.arange(count)
        mine = np.flatnonzero((place[weights.point] >= 0) & (weights.node < len(master.nodes)))
        row, node = place[weights.point[mine]], weights.node[mine]
        lever = np.einsum("md,md->m", along[row], master.normals[node])
        result = Csr((lever, (row, mine)), shape=(count, weights.rows.shape[0])) @ weights.rows
        by_area = np.einsum("nd,nd->n", by_all, chosen.by_area)
        result = result + scaled_rows(weights.area[chosen.point], by_area)
        weight = self.coupling.weight[chosen.point]
        used = np.zeros(len(master.nodes), dtype=bool)
        used[weight.indices] = True
        near = replace(master, facets=master.facets[used[master.facets].any(axis=1)], relief=None)
        length = np.linalg.norm(summed_normals(near, near.points), axis=1)[:, None]
        for component, direction in enumerate(np.eye(master.dim)):
            vectors = direction - master.normals[:, [component]] * master.normals
            vectors = near.within(vectors, near.mirrored) / np.where(length > 0.0, length, 1.0)
            vectors[~used] = 0.0
            own = weight @ summed_normals_by_points(near, vectors)
            own = scaled_rows(own.tocsr(), along[:, component])
            first = size - own.shape[1]  # the nodes of the slave come first
            result = result + Csr((own.data, own.indices + first, own.indptr), shape=(count, size))
        return result.tocsr()


@displayed
@dataclass(frozen=True)
class PointAreas:
    """Areas of the deformed and of the undeformed slave that belong to contact points.

    By nodes these are whole areas of the nodes. By mortar they are the parts that face the master, on which
    the pressure of a point acts, but no less than halves: what holds a node hardly over the rim of the
    master has no area there, and its force does not vanish with it.

    Attributes:
        now: a, area of the node on the slave as it lies now, shape (n,), [length²] or in the plane [length].
        before: A, area of the node on the undeformed slave, shape (n,).
        share: What of the node's area counts, shape (n,).
        facing: Whether it is the part that faces the master, shape (n,).
        much: Whether the slave's material is made for large deformations, shape (n,).
    """

    now: np.ndarray
    before: np.ndarray
    share: np.ndarray
    facing: np.ndarray
    much: np.ndarray

    @classmethod
    def of(
        cls,
        scene: Scene,
        points: ContactPoints,
        coordinates: np.ndarray,
        means: Mapping[int, MovingMeans],
    ) -> PointAreas:
        """Measure the areas of points.

        `coordinates`: of all nodes now, shape (n_nodes, dim), [length]; `means`: the couplings of mortar
        contact, by their pairs.
        """
        count, before = points.count, points.area
        areas = cls(np.zeros(count), before, np.ones(count), *np.zeros((2, count), dtype=bool))
        for index, pair in enumerate(scene.contacts):
            surface, body = slave_of(scene, pair, "faceted"), pair.slave.body
            nodes = NodeNumbers.of(scene).global_nodes(body, surface.nodes)
            slave, point = points.of_surface(index, np.arange(count))
            own = surface.point_areas_at(coordinates[nodes])[np.searchsorted(nodes, slave)]
            np.add.at(areas.now, point, own)  # a point may have the areas of several nodes
            areas.much[points.pair == index] = scene.bodies[body].deforms_much
        for index, met in means.items():
            mine = points.pair == index
            part = met.coupling.area / areas.now[mine]
            areas.share[mine], areas.facing[mine] = np.maximum(part, 0.5), part > 0.5
        return areas

    @property
    def true(self) -> np.ndarray:
        """Areas to which the stress of the slave's material refers, shape (n,), [length²] or [length].

        Those of the deformed slave; where its material knows small strains alone, of the undeformed one.
        """
        return self.pressed * self.share

    @property
    def pressed(self) -> np.ndarray:
        """Whole areas to which that stress refers, on which fluid between surfaces presses, shape (n,)."""
        return np.where(self.much, self.now, self.before)

    @property
    def nominal(self) -> np.ndarray:
        """Areas of the undeformed slave, shape (n,), [length²] or [length]."""
        return self.before * self.share

    def pulled_back(self, by_true: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the derivatives by a, A and the parts of a that face the master, shape (n,) each.

        The last is zero by nodes, and where another part counts.

        `by_true`: derivative by `true`, shape (n,).
        """
        ratio = np.where(self.facing, np.where(self.much, 1.0, self.before / self.now), 0.0)
        by_part = by_true * self.share
        return by_part * (self.much - ratio), by_part * ~self.much, by_true * ratio
