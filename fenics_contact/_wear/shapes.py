"""The mesh follows what contact has worn off: as much volume is taken from it as surfaces have lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.discretisation import keeping_discretisation
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.parts import mirrored, planes_of, surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.thickness import thickness_on
from fenics_contact._surfaces.facets import filled_at_corners, gauss_points, within_planes
from fenics_contact._surfaces.projection import node_weights, project
from fenics_contact.design.motion import (
    MeshMotion,
    held_by_scene,
    moving_with,
    require_movable,
    require_no_sectors,
)
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.results.deformed_state import AnyState


@dataclass(frozen=True, eq=False)
class Moved:
    """A scene whose meshes have lost what was worn off.

    Attributes:
        scene: In its new shape.
        before: The state from which its next load step goes on: what its contact has lost is what stays a
            gap.
        volumes: Name of a body -> the volume that its mesh has lost, of a plane body the area.
        depth: Depth of the contact points that the meshes have lost, of both sides, shape (n_contact,).
    """

    scene: Scene
    before: AnyState
    volumes: Mapping[str, float]
    depth: np.ndarray


@dataclass(frozen=True, eq=False)
class _Side:
    """A worn surface of a pair. `share`: part of the depth that it loses."""

    pair: int
    body: str
    surface: str
    share: float
    is_slave: bool

    @classmethod
    def of(cls, number: int, pair: ContactPair) -> list[_Side]:
        """Return the sides of a pair whose shape may follow: none where gaps are given."""
        shares = [(share, 1.0 - share) for share in (wear.share for wear in pair.wears if not pair.given_gap)]
        return [
            cls(number, side.body, side.name, share, side is pair.slave)
            for both in shares
            for side, share in zip(pair.surfaces, both, strict=False)
            if share > 0.0
        ]

    def weights(self, points: ContactPoints, nodes: slice) -> tuple[np.ndarray, sp.csr_matrix]:
        """Return its points, and their weights on the nodes of its body."""
        mine = np.flatnonzero(points.pair == self.pair)
        return mine, (points.own if self.is_slave else points.master)[mine][:, nodes]


class WornShape:
    """The meshes of a scene follow the depth that its pairs have lost, as far as gaps are measured.

    Surface nodes move against their normals, by the depth at the contact points that belong to them; a factor
    close to one then makes the mesh lose just the volume Σ A w. The mesh behind follows as that of a design.
    Flat sides parallel to the axes stay what they are, and so do all other surfaces; a worn surface keeps no
    true shape. Depth stays a gap on obstacles, where pairs give their gaps, and at nodes that supports hold.

    Example:
        >>> equilibria = ContactProblem(scene, comm)  # doctest: +SKIP
        >>> moved = WornShape(scene, equilibria.decomposition).moved(scene, state)  # doctest: +SKIP
        >>> after = equilibria.solve(moved.scene, before=moved.before)  # doctest: +SKIP
    """

    #: Depth, relative to the size of facets, that may stay a gap at nodes that supports hold.
    small = 0.2

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Prepare the motion of the meshes. Collective on the decomposition's communicator.

        Raises:
            InvalidInputError: If the scene is nonlinear, or has meshes that cannot be moved.
        """
        self._decomposition = decomposition
        with together(decomposition.comm):
            if scene.is_nonlinear:
                raise InvalidInputError(
                    "shapes that follow wear need linear materials, got nonlinear ones: leave the worn depth "
                    "a gap by follow=np.inf"
                )
            require_movable(scene, "a shape that follows wear")
            require_no_sectors(scene, "a shape that follows wear")
        self._sides = [side for number, pair in enumerate(scene.contacts) for side in _Side.of(number, pair)]
        self._cut = {side.body: mirrored(scene, side.body) for side in self._sides}
        self._held = {name: held_by_scene(scene, name, cut) for name, cut in self._cut.items()}
        self._still = {name: held.all(axis=1) for name, held in self._held.items()}
        self._motions = {name: self._motion(scene, name) for name in self._cut}

    def _motion(self, scene: Scene, name: str) -> MeshMotion:
        """Return how the mesh behind the worn surfaces of a body follows them. Collective."""
        mesh, dim = scene.bodies[name].mesh, scene.dim
        worn = [mesh.surfaces[side.surface] for side in self._sides if side.body == name]
        moving = np.setdiff1d(
            np.concatenate([np.unique(facets) for facets in worn]), self._still[name].nonzero()
        )
        others = [
            mesh.nodes_of(side.name)
            for pair in (*scene.contacts, *scene.ties)
            for side in pair.surfaces
            if side.body == name
        ]
        held = self._held[name] | _held_by_sides(mesh, self._cut[name], dim)
        held[np.concatenate(others)] = True
        held[moving] = False
        return moving_with(self._decomposition, scene, name, moving, held)

    def moved(self, scene: Scene, state: AnyState, kept: np.ndarray | float = 0.0) -> Moved:
        """Return a scene in its worn shape, and what its next load step goes on from. Collective.

        Args:
            scene: With the meshes of the state.
            state: At the end of a load step.
            kept: Depth of its contact points that stays a gap since the shape followed before, (n_contact,).

        Raises:
            InvalidInputError: If depth that is not small is at nodes that supports hold, or cells would turn
                inside out.
        """
        contact, tearing = state.contact, self._decomposition.tearing
        depth, rest, earlier = contact.worn_depth - kept, contact.worn_depth, contact.worn_depth * 0.0 + kept
        vectors = {name: np.zeros_like(scene.bodies[name].mesh.points) for name in self._cut}
        volumes = dict.fromkeys(self._cut, 0.0)
        with together(self._decomposition.comm):
            for side in self._sides:
                first = tearing.first_of(side.body)
                nodes = slice(first, first + scene.bodies[side.body].mesh.n_nodes)
                mine, weights = side.weights(contact.points, nodes)
                lost = side.share * depth[mine]
                held = weights @ self._still[side.body].astype(float)
                stays, before = lost * held, held * earlier[mine] * scene.contacts[side.pair].between_bodies
                self._require_small(scene, side, (stays + before) / contact.points.sizes[mine])
                rest[mine] -= lost - stays
                vector, volume = self._lost(scene, side, contact.points, lost, weights)
                vectors[side.body] += vector
                volumes[side.body] += volume
        points = {name: self._points(scene, name, vectors[name], volumes[name]) for name in self._cut}
        with together(self._decomposition.comm):
            after = self._reshaped(scene, points)
        going_on = replace(state, contact=replace(contact, worn=np.zeros_like(rest), worn_before=rest))
        removed = {name: scene.bodies[name].volume - after.bodies[name].volume for name in self._cut}
        return Moved(after, going_on, removed, contact.worn_depth - rest)

    def _require_small(self, scene: Scene, side: _Side, stays: np.ndarray) -> None:
        """Reject depth at nodes that supports hold, relative to the size of facets."""
        if stays.max(initial=0.0) <= self.small:
            return
        holding = [part.in_words for part in scene.supports if part.body == side.body]
        raise InvalidInputError(
            f"nodes that wear must be free to move, but {', '.join(holding)} of body {side.body!r} hold "
            f"some of surface {side.surface!r}, which lost {stays.max():.2g} of a facet's size: hold others"
        )

    def _lost(
        self, scene: Scene, side: _Side, points: ContactPoints, lost: np.ndarray, weights: sp.csr_matrix
    ) -> tuple[np.ndarray, float]:
        """Return how the nodes of a body move by what a side has lost, (n_nodes, dim), and the volume."""
        body = scene.bodies[side.body]
        mesh, measure = body.mesh, body.kinematics.measure
        thickness = (
            thickness_on(body, side.surface, f"surface {side.surface!r}") if scene.has_thickness else 1.0
        )
        mine = points.pair == side.pair
        area, slaves = points.area[mine] / thickness, points.slave[mine]
        volume, covered = weights.T @ (area * lost), weights.T @ area
        facets = mesh.linear.surfaces[side.surface]
        normal, whole = np.zeros_like(mesh.points), np.zeros(mesh.n_nodes)
        for at in gauss_points(mesh.points, facets, measure):
            np.add.at(normal, facets, at.values[:, None] * at.normals[:, None])
            np.add.at(whole, facets, at.areas[:, None] * at.values)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
        found = covered > 1e-9 * whole.max()
        if side.is_slave:
            depth = np.divide(volume, covered, out=np.zeros(mesh.n_nodes), where=found)
            filled = filled_at_corners(mesh.surfaces[side.surface], depth)
            depth = np.where(found, depth, np.maximum(filled, 0.0))
        else:
            # Where the slave ends, a node of the master loses what belongs to it, and less depth.
            depth = np.divide(volume, np.maximum(covered, whole), out=np.zeros(mesh.n_nodes), where=found)
            surface, facing = np.unique(facets), np.zeros(mesh.n_nodes, dtype=bool)
            opposite, hit = _opposite(scene, side, mesh.points[surface], normal[surface], lost, slaves)
            facing[surface[hit]] = True
            inside = np.setdiff1d(surface[hit], facets[~facing[facets].all(axis=1)])
            depth[inside] = opposite[np.searchsorted(surface, inside)]
        depth[self._still[side.body]] = 0.0
        along = within_planes(normal, self._cut[side.body], planes_of(scene))
        size = np.linalg.norm(along, axis=1)[:, None]
        along = np.divide(along, size, out=np.zeros_like(along), where=size > 1e-6)
        return -depth[:, None] * along, float(volume[~self._still[side.body]].sum())

    def _points(self, scene: Scene, name: str, vectors: np.ndarray, volume: float) -> np.ndarray:
        """Return the points of a body, moved as vectors on its surfaces say and by its volume. Collective."""
        body, motion = scene.bodies[name], self._motions[name]
        mesh, way = body.mesh, motion.extend(vectors[motion.moving])
        if volume == 0.0:
            return mesh.points

        def missing(size: float) -> float:
            moved = replace(body, mesh=mesh.reshaped(mesh.points + size * way))
            return (body.volume - moved.volume) / volume - 1.0

        with together(self._decomposition.comm):
            try:
                last, size, error = 0.0, 1.0, -1.0
                for _ in range(8):
                    now = missing(size)
                    if abs(now) < 1e-12 or now == error:
                        break
                    last, size, error = size, size - now * (size - last) / (now - error), now
            except InvalidInputError as failure:
                raise InvalidInputError(
                    f"the worn shape of body {name!r} cannot be meshed, {failure}; or follow wear more "
                    "often, or leave it a gap by follow=np.inf"
                ) from failure
        return mesh.points + size * way

    def _reshaped(self, scene: Scene, points: Mapping[str, np.ndarray]) -> Scene:
        """Return a scene at other coordinates, whose worn surfaces have no true shapes any more."""
        after = scene.reshaped(points)
        for name in points:
            worn = {side.surface for side in self._sides if side.body == name}
            body = after.bodies[name]
            kept = {key: shape for key, shape in body.mesh.shapes.items() if key not in worn}
            if len(kept) < len(body.mesh.shapes):
                there = body.mesh.points.copy()
                for key in kept:
                    there[body.mesh.nodes_of(key)] = body.mesh.origin.points[body.mesh.nodes_of(key)]
                mesh = body.mesh.with_shapes({}).reshaped_from(there, kept)
                after = keeping_discretisation(after)
                after = replace(after, bodies={**after.bodies, name: replace(body, mesh=mesh)})
        return after


class ShapeLost(InvalidInputError):
    """The shape of a scene cannot follow its wear."""


class Follower:
    """Moves meshes where depth that is a gap exceeds a part of the size of facets.

    `part`: the part, infinite for meshes that never move. Those of bodies that deform much do not.
    """

    def __init__(self, part: float) -> None:
        self._part = part
        self._shapes: list[WornShape] = []

    def moved(
        self, scene: Scene, decomposition: Decomposition, state: AnyState, kept: np.ndarray
    ) -> tuple[Moved, ...]:
        """Return the scene in its worn shape, none if it need not move. Collective; `kept`: as `WornShape`.

        Raises:
            ShapeLost: If the shape cannot follow.
        """
        share = np.zeros(len(scene.contacts))
        for number, pair in enumerate(scene.contacts):
            share[number] = sum(side.share for side in _Side.of(number, pair))
        points = state.contact.points
        depth = share[points.pair] * (state.contact.worn_depth - kept)
        if scene.is_nonlinear or not (depth > self._part * points.sizes).any():
            return ()
        try:
            if not self._shapes:
                self._shapes.append(WornShape(scene, decomposition))
            return (self._shapes[0].moved(scene, state, kept),)
        except InvalidInputError as failure:
            raise ShapeLost(f"the shape cannot follow: {failure}") from failure


def _opposite(
    scene: Scene, side: _Side, places: np.ndarray, normals: np.ndarray, lost: np.ndarray, slaves: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the depth opposite places of a master, (n,), and the numbers of those that face the slave.

    `lost`: depth at the points of the slave, `slaves`: their nodes among those of all bodies.
    """
    pair, result = scene.contacts[side.pair], np.zeros(len(places))
    slave = surface_of(scene, pair.slave, "faceted")
    at_nodes = np.zeros(scene.bodies[pair.slave.body].mesh.n_nodes)
    at_nodes[slaves - NodeNumbers.of(scene).first_of(pair.slave.body)] = lost
    facets = scene.bodies[pair.slave.body].mesh.surfaces[pair.slave.name]
    at_nodes = np.where(at_nodes > 0.0, at_nodes, filled_at_corners(facets, at_nodes))[slave.nodes]
    hit = project(places, normals, slave)
    result[hit.point] = node_weights(slave, hit) @ at_nodes
    return result, hit.point


def _held_by_sides(mesh: BodyMesh, cut: np.ndarray, dim: int) -> np.ndarray:
    """Return which components of nodes the shape of the boundary holds, shape (n_nodes, dim).

    Nodes of flat sides across an axis may slide along them, those of other sides stay where they are.
    """
    facets, _ = mesh.boundary
    facets = facets[~cut[facets].all(axis=1).any(axis=1)]
    normal = vector_areas(mesh.points, facets)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    places = mesh.points[facets]
    size = np.ptp(places, axis=1).max(axis=1)[:, None]
    flat = (np.abs(normal) > 1.0 - 1e-9) & (np.ptp(places, axis=1) < 1e-9 * size)
    held = np.zeros((mesh.n_nodes, dim), dtype=bool)
    held[facets[~flat.any(axis=1)]] = True
    for axis in range(dim):
        held[facets[flat[:, axis]], axis] = True
    return held
