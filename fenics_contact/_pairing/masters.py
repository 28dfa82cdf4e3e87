"""What slaves face in undeformed bodies: rigid obstacles, tools, surfaces of bodies, other sides of sectors.

Each kind finds the points of a slave, and what places on it meet. It registers in `MASTERS`.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import floats
from fenics_contact._base.csr import Csr
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.advice import Advice
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    with_symmetry,
)
from fenics_contact._pairing.projection import shared_projection
from fenics_contact._scene.local_axes import LocalAxes
from fenics_contact._scene.obstacles import MovingObstacle
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact._scene.pairs import ContactPair, Surface, Tie
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._scene.tools import ToolBody
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import node_weights, project
from fenics_contact.errors import together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.mesh.faces import coordinate_rounding
from fenics_contact.shapes.combined import placed
from fenics_contact.shapes.simple import SurfaceShape, evaluate_shape

_LOG = logging.getLogger(__name__)

#: Rotation, shape (dim, dim), and translation, shape (dim,), [length], of moving obstacles, by their pairs.
Placements: TypeAlias = Mapping[int, tuple[np.ndarray, np.ndarray]]

#: Returns a named surface of a body, of its facets or of what is known of its shape.
SurfaceOf: TypeAlias = Callable[[Surface], FacetedSurface]


@dataclass(frozen=True)
class Search:
    """Where points are looked for, by whom, and who is told what is noticed.

    Attributes:
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
        comm: Communicator of the ranks that share the work.
        finer: Whether surfaces are those known best.
    """

    scene: Scene
    fixed: np.ndarray
    axes: LocalAxes
    comm: MPI.Comm
    finer: bool
    advice: Advice


@dataclass(frozen=True)
class Slave:
    """The slave of a pair.

    Attributes:
        number: Which of the pairs of the scene.
        n_pairs: Number of contact pairs of the scene.
        nodes: Its nodes among those of all bodies, shape (n,).
        movable: Which of them supports leave free in a direction, shape (n,).
        bearing: Which may have a point, shape (n,).
    """

    number: int
    n_pairs: int
    surface: FacetedSurface
    nodes: np.ndarray
    movable: np.ndarray
    bearing: np.ndarray

    def points(
        self, chosen: np.ndarray, normal: np.ndarray, gap: np.ndarray, weight: sp.csr_matrix
    ) -> ContactPoints:
        """Return points on chosen nodes, without facets."""
        surface, pair = self.surface, np.full(len(chosen), self.number)
        return ContactPoints.at_nodes(
            pair, self.nodes[chosen], weight, normal, gap, surface.point_areas[chosen],
            length=surface.sizes[chosen] if surface.measure.varies else None,
            merged_nodes=Csr((len(chosen), self.n_pairs), dtype=np.int64),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Met:
    """What places meet on a master.

    Attributes:
        distance: From the master, infinite where places do not face it, shape (n,), [length].
        normal: From master to slave, shape (n, dim).
        weights: Weights of the nodes of all bodies in what is met, shape (n, n_nodes).
    """

    distance: np.ndarray
    normal: np.ndarray
    weights: sp.csr_matrix


@dataclass(frozen=True)
class Master(ABC):
    """What the slave of a pair faces.

    Attributes:
        n_nodes: Number of nodes of all bodies.
    """

    pair: Any
    n_nodes: int

    @classmethod
    @abstractmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Return whether the master of a pair is of this kind, if it is of none before."""

    @classmethod
    @abstractmethod
    def of(cls, scene: Scene, pair: Any, surface: SurfaceOf) -> Master:
        """Return the master of a pair."""

    @abstractmethod
    def normals_at(self, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return its normals where places with normals meet it, zero where they do not, shape (n, dim)."""

    @abstractmethod
    def met(self, places: np.ndarray, normals: np.ndarray) -> Met:
        """Return what places with outward normals meet, shape (n, dim) each."""

    @abstractmethod
    def turning(self, slave: FacetedSurface, place: np.ndarray, weights: sp.csr_matrix) -> np.ndarray:
        """Return by how much both surfaces may turn against each other over each facet, shape (n_facets,).

        `place`: positions of the slave's nodes that meet it, shape (n,); `weights`: of what they meet.
        """

    def moved(self, number: int, coordinates: np.ndarray, placements: Placements) -> Self:
        """Return it where it is when bodies have moved far; `number`: of the pair."""
        return self

    def placements(self, number: int, coordinates: np.ndarray, time: float) -> Placements:
        """Return where an obstacle is that moves; `number`: of the pair."""
        return {}

    @property
    def bodies(self) -> set[str]:
        """Names of the bodies that move it."""
        return set()

    def movable(self, scene: Scene, nodes: np.ndarray) -> np.ndarray:
        """Return which nodes of the slave may have points as far as the pair goes, shape (n,)."""
        return np.ones(len(nodes), dtype=bool)

    @abstractmethod
    def points(self, slave: Slave, search: Search) -> ContactPoints:
        """Return the points of the slave. Collective."""

    def cure_of_no_points(self, scene: Scene) -> str:
        """Return what to do where no slave node faces it."""
        return "check the surfaces' names and where the bodies lie"


@dataclass(frozen=True)
class ObstacleMaster(Master):
    """A rigid obstacle.

    Attributes:
        shape: Where it is.
    """

    shape: SurfaceShape

    @classmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Obstacles of any class."""
        return True

    @classmethod
    def of(cls, scene: Scene, pair: Any, surface: SurfaceOf) -> ObstacleMaster:
        """Return the obstacle of a pair."""
        return cls(pair, NodeNumbers.of(scene).n_nodes, pair.master)

    @property
    def at_rest(self) -> SurfaceShape:
        """The obstacle in its own coordinates."""
        shape: SurfaceShape = self.pair.master
        return shape

    def normals_at(self, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return its normals at places."""
        return evaluate_shape(self.at_rest, "normals", places)

    def met(self, places: np.ndarray, normals: np.ndarray) -> Met:
        """Return what places meet that face it."""
        outward = evaluate_shape(self.shape, "normals", places)
        facing = np.einsum("nd,nd->n", normals, outward) < 0
        distance = np.where(facing, evaluate_shape(self.shape, "distance", places), np.inf)
        return Met(distance, outward, self._weights(places))

    def turning(self, slave: FacetedSurface, place: np.ndarray, weights: sp.csr_matrix) -> np.ndarray:
        """Return two: its features may be finer than facets."""
        return np.full(len(slave.facets), 2.0)

    def points(self, slave: Slave, search: Search) -> ContactPoints:
        """Return the slave nodes that face it. Collective."""
        with together(search.comm):
            candidates, surface = np.flatnonzero(slave.bearing), slave.surface
            normals = evaluate_shape(self.shape, "normals", surface.points[candidates])
            facing = np.einsum("nd,nd->n", surface.normals[candidates], normals) < 0
            chosen = candidates[facing]
            gap = evaluate_shape(self.shape, "distance", surface.points[chosen])
            points = slave.points(chosen, normals[facing], gap, self._weights(surface.points[chosen]))
            points = with_symmetry(points, surface.mirrored[chosen], surface.planes)
        name = f"what ContactPair {slave.number} asks its obstacle, {type(self.shape).__name__}"
        require_alike(search.comm, described((points.slave, points.normal, points.gap), name))
        return points

    def _weights(self, places: np.ndarray) -> sp.csr_matrix:
        """Return the weights of the nodes of all bodies at places of the obstacle, (n, n_nodes)."""
        return Csr((len(places), self.n_nodes))

    def cure_of_no_points(self, scene: Scene) -> str:
        """Return what to do where no slave node faces it."""
        body = self.pair.slave.body
        if evaluate_shape(self.shape, "distance", scene.bodies[body].mesh.points).mean() >= 0.0:
            return super().cure_of_no_points(scene)
        return (
            f"body {body!r} lies inside the {type(self.shape).__name__}, whose normal points "
            "out of it and towards the body: reverse it (a plane's normal), or take its other side"
        )


@dataclass(frozen=True)
class MovingMaster(ObstacleMaster):
    """An obstacle that moves as prescribed."""

    @classmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Obstacles with a path."""
        return isinstance(pair.master, MovingObstacle)

    @property
    def at_rest(self) -> SurfaceShape:
        """The obstacle in its own coordinates."""
        shape: SurfaceShape = self.pair.master.obstacle
        return shape

    def placements(self, number: int, coordinates: np.ndarray, time: float) -> Placements:
        """Return where its path has it at a time."""
        return {number: self.pair.master.frame(time)}

    def moved(self, number: int, coordinates: np.ndarray, placements: Placements) -> Self:
        """Return it where it is."""
        turn, shift = placements[number]
        return replace(self, shape=placed(self.at_rest, turn, floats(shift)))


@dataclass(frozen=True)
class ToolMaster(MovingMaster):
    """A rigid tool, whose motion nodes of a body carry.

    Attributes:
        body: That body.
        nodes: Its nodes among those of all bodies.
    """

    body: ToolBody
    nodes: np.ndarray

    @classmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Tools."""
        return bool(pair.tool)

    @classmethod
    def of(cls, scene: Scene, pair: Any, surface: SurfaceOf) -> ToolMaster:
        """Return the tool of a pair."""
        tool, numbers = pair.master, NodeNumbers.of(scene)
        body = scene.tools[tool.name]
        nodes = numbers.global_nodes(tool.name, np.arange(body.mesh.n_nodes))
        return cls(pair, numbers.n_nodes, tool, body, nodes)

    @property
    def at_rest(self) -> SurfaceShape:
        """The tool in its own coordinates."""
        shape: SurfaceShape = self.pair.master
        return shape

    def placements(self, number: int, coordinates: np.ndarray, time: float) -> Placements:
        """Return where the nodes that carry it have it."""
        return {number: self.body.frame(coordinates[self.nodes])}

    @property
    def bodies(self) -> set[str]:
        """The body that carries it."""
        return {self.pair.master.name}

    def _weights(self, places: np.ndarray) -> sp.csr_matrix:
        return carried(self.body.weights(places), self.nodes, self.n_nodes)


def carried(weights: np.ndarray, nodes: np.ndarray, count: int) -> sp.csr_matrix:
    """Return weights of a few nodes, shape (n, k), as those of all of them, (n, count)."""
    rows = weights.shape[1] * np.arange(len(weights) + 1)
    return Csr((weights.ravel(), np.tile(nodes, len(weights)), rows), shape=(len(weights), count))


@dataclass(frozen=True)
class BodyMaster(Master):
    """A surface of a body.

    Attributes:
        nodes: Its nodes among those of all bodies, shape (n,).
    """

    surface: FacetedSurface
    nodes: np.ndarray

    @classmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Surfaces of bodies."""
        return pair.between_bodies

    @classmethod
    def of(cls, scene: Scene, pair: Any, surface: SurfaceOf) -> Self:
        """Return the master of a pair."""
        side: Surface = pair.master
        own, numbers = surface(side), NodeNumbers.of(scene)
        return cls(pair, numbers.n_nodes, own, numbers.global_nodes(side.body, own.nodes))

    def normals_at(self, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return its normals where places project on it."""
        hit, result = project(places, normals, self.surface), np.zeros_like(places)
        result[hit.point] = hit.normal
        return result

    def met(self, places: np.ndarray, normals: np.ndarray) -> Met:
        """Return what places meet that project on it."""
        hit = project(places, normals, self.surface)
        distance, outward = np.full(len(places), np.inf), -normals
        distance[hit.point], outward[hit.point] = hit.gap, hit.normal
        own = node_weights(self.surface, hit).tocoo()
        entries = own.data, (hit.point[own.row], self.nodes[own.col])
        return Met(distance, outward, Csr(entries, shape=(len(places), self.n_nodes)))

    def turning(self, slave: FacetedSurface, place: np.ndarray, weights: sp.csr_matrix) -> np.ndarray:
        """Return what normals at nodes say."""
        every, normals = np.zeros((self.n_nodes, slave.dim)), np.full(slave.points.shape, np.nan)
        every[self.nodes] = self.surface.normals
        normals[place] = weights @ every
        return turning(slave, normals)

    @property
    def bodies(self) -> set[str]:
        """The body."""
        return {self.pair.master.body}

    def moved(self, number: int, coordinates: np.ndarray, placements: Placements) -> Self:
        """Return its facets where they are."""
        from fenics_contact._pairing.sliding.closest import moved_surface

        return replace(self, surface=moved_surface(self.surface, coordinates[self.nodes]))

    def points(self, slave: Slave, search: Search) -> ContactPoints:
        """Return the slave nodes that face it, or the means around them. Collective."""
        pair = self.pair
        search.advice.surface(search.scene, pair.master, pair.geometry, self.surface, search.comm)
        find = _by_mortar if pair.discretisation == "mortar" else _by_projection
        points = find(slave, self, search)
        return with_symmetry(points, self._symmetric(points, slave), slave.surface.planes)

    def _symmetric(self, points: ContactPoints, slave: Slave) -> np.ndarray:
        """Return the symmetry planes that cut both surfaces at a point, (n_points, n_planes)."""
        place = np.zeros((self.n_nodes, points.normal.shape[1]))
        cut = np.zeros((2, self.n_nodes, slave.surface.mirrored.shape[1]), dtype=bool)
        sides = (slave.nodes, slave.surface), (self.nodes, self.surface)
        for here, (nodes, surface) in zip(cut, sides, strict=True):
            place[nodes], here[nodes] = surface.points, surface.mirrored
        met = points.master.tocoo()
        node, other = points.slave[met.row], met.col
        same = np.abs(slave.surface.across(place[node] - place[other])) <= coordinate_rounding(place)
        symmetric = np.zeros((points.count, cut.shape[2]), dtype=bool)
        np.logical_or.at(symmetric, met.row, cut[0][node] & cut[1][other] & same)
        return symmetric


def turning(slave: FacetedSurface, normals: np.ndarray) -> np.ndarray:
    """Return by how much surfaces turn against each other over each facet of the slave, shape (n_facets,).

    `normals`: of the master at the slave's nodes, NaN where these do not meet it, shape (n_slave, dim).
    """
    tilt = (slave.normals + normals)[slave.facets]
    apart = np.linalg.norm(tilt[:, :, None] - tilt[:, None], axis=3)
    return np.asarray(np.nan_to_num(apart).max(axis=(1, 2)))


def _by_projection(slave: Slave, master: BodyMaster, search: Search) -> ContactPoints:
    """Pair each slave node with the master facet on which it projects. Collective."""
    candidates, surface, comm = np.flatnonzero(slave.bearing), master.surface, search.comm
    hit = shared_projection(slave.surface, candidates, surface, comm)
    if len(hit.lost) and comm.rank == 0:
        _tell_of_lost(slave.surface.points[candidates[hit.lost]], len(candidates))
    own = node_weights(surface, hit)
    entries = own.data, master.nodes[own.indices], own.indptr
    weights = Csr(entries, shape=(own.shape[0], master.n_nodes))
    points = slave.points(candidates[hit.point], hit.normal, hit.gap, weights)
    search.advice.uneven_pressure(search.scene, master.pair, slave.surface, surface, comm)
    return replace(points, facet=hit.facet, local=hit.local)


def _tell_of_lost(places: np.ndarray, count: int) -> None:
    where = ", ".join(f"{x:.6g}" for x in places[0])
    safe_log(
        _LOG.warning,
        "%d of %d slave nodes face their master, but no point of it was found for them, the first at (%s): "
        "nothing keeps them out of it; refine the master there, or let the other surface be the slave",
        len(places), count, where,
    )  # fmt: skip


def _by_mortar(slave: Slave, master: BodyMaster, search: Search) -> ContactPoints:
    """Pair each slave node with the mean of the master weighted by its dual basis function. Collective."""
    from fenics_contact._pairing.mortar.points import MortarPoints

    # Of linear facets only what supports hold: a hanging node, say, moves and keeps its function.
    free = slave.bearing if slave.surface.cut.is_cut else ~search.fixed[slave.nodes].all(axis=1)
    share = master_share(search.scene, master.pair)
    met = MortarPoints.of(slave.surface, master.surface, slave.bearing, share, search.comm, free)
    coupling, nodes = met.coupling, np.concatenate([slave.nodes, master.nodes])
    count = len(nodes)
    spread = Csr((np.ones(count), (np.arange(count), nodes)), shape=(count, master.n_nodes))
    points = slave.points(coupling.node, coupling.normal, met.gap, (met.weight @ spread).tocsr())
    return replace(points, area=coupling.area)


@dataclass(frozen=True)
class TiedMaster(BodyMaster):
    """A surface to which another one is tied."""

    @classmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Ties of surfaces."""
        return isinstance(pair, Tie)

    def points(self, slave: Slave, search: Search) -> ContactPoints:
        """Return the tied points. Collective."""
        self._check(slave, search)
        points = super().points(slave, search)
        if self.pair.discretisation != "mortar":
            held = ~slave.movable | np.isin(slave.nodes, points.slave)
            search.advice.edge_of_tie(self.pair, slave.surface, held, self.surface, search.comm)
        return points

    def _check(self, slave: Slave, search: Search) -> None:
        """Warn where supports hold the slave alone. Collective."""
        if not self.pair.sliding and not search.axes:
            own, other = search.fixed[slave.nodes], search.fixed[self.nodes]
            sides = (slave.surface, own), (self.surface, other)
            search.advice.free_master(self.pair, *sides, search.comm)

    def movable(self, scene: Scene, nodes: np.ndarray) -> np.ndarray:
        """Return all nodes but those of the master itself, of the same body."""
        return ~np.isin(nodes, self.nodes)


@dataclass(frozen=True)
class SectorMaster(TiedMaster):
    """The other side of a sector, turned onto the slave.

    Attributes:
        angle: By which it is turned.
    """

    angle: float

    @classmethod
    def serves(cls, pair: ContactPair | AnyTie) -> bool:
        """Sides of sectors."""
        return bool(pair.sectors)

    @classmethod
    def of(cls, scene: Scene, pair: Any, surface: SurfaceOf) -> SectorMaster:
        """Return the turned side."""
        side, angle = TiedMaster.of(scene, pair, surface), pair.angle_in(scene)
        points, turn = pair.turned(side.surface.points, angle), pair.matrix(angle)
        turned = replace(side.surface, points=points, averaged=side.surface.averaged @ turn.T)
        return cls(pair, side.n_nodes, turned, side.nodes, angle)

    def movable(self, scene: Scene, nodes: np.ndarray) -> np.ndarray:
        """Return all nodes but those on the axis."""
        side = self.pair.slave
        axial = self.pair.axial_nodes(scene.bodies[side.body].mesh, side.name)
        return ~np.isin(nodes, NodeNumbers.of(scene).global_nodes(side.body, axial))

    def points(self, slave: Slave, search: Search) -> ContactPoints:
        """Return points with the rotation of the master's displacement. Collective."""
        points = super().points(slave, search)
        rotations = np.tile(self.pair.matrix(self.angle), (points.count, 1, 1))
        return replace(points.as_rotated(), rotations=rotations)

    def _check(self, slave: Slave, search: Search) -> None:
        """Reject sides that are not one surface."""
        from fenics_contact._pairing.sectors import check_sides

        with together(search.comm):
            check_sides(self.pair, self.angle, slave.surface, self.surface)

    def _symmetric(self, points: ContactPoints, slave: Slave) -> np.ndarray:
        """Return none: a plane that cuts both sides is held by its support."""
        return np.zeros((points.count, slave.surface.mirrored.shape[1]), dtype=bool)


#: Kinds of masters, the first that serves a pair has it.
MASTERS: tuple[type[Master], ...] = (
    SectorMaster, TiedMaster, BodyMaster, ToolMaster, MovingMaster, ObstacleMaster,
)  # fmt: skip


def master_of(scene: Scene, pair: ContactPair | AnyTie, surface: SurfaceOf) -> Master:
    """Return what the slave of a pair faces."""
    return next(kind for kind in MASTERS if kind.serves(pair)).of(scene, pair, surface)
