"""Rigid obstacles as counterparts of nodes that move far: at rest, or driven along a path."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import floats
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._pairing.points import ContactPoints, with_symmetry
from fenics_contact._pairing.sliding.meeting import Candidates, Found, Moved, Placement, SlidingPair
from fenics_contact._pairing.sliding.stiffness import without_patches
from fenics_contact._scene.obstacles import MovingObstacle, RigidObstacle
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import together
from fenics_contact.shapes.combined import placed
from fenics_contact.shapes.simple import SurfaceShape, evaluate_shape


@dataclass(frozen=True)
class OnObstacle(SlidingPair):
    """Nodes that meet a rigid obstacle at rest."""

    obstacle: Any

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Obstacles of any class."""
        return True

    @classmethod
    def master_of(cls, scene: Scene, pair: ContactPair) -> RigidObstacle:
        """Return the obstacle."""
        assert not isinstance(pair.master, Surface)
        return pair.master

    @classmethod
    def of(cls, scene: Scene, pair: ContactPair, side: Candidates, master: Any) -> SlidingPair:
        """Return the slave with the obstacle."""
        return cls(**vars(side), obstacle=master)

    def shape(self, scene: Scene, coordinates: np.ndarray, time: float) -> SurfaceShape:
        """Return the obstacle where it is."""
        return self.obstacle

    def at(self, moved: Moved) -> Found:
        """Return the points on the obstacle. Collective."""
        with together(moved.comm):
            found = self._found(moved)
        points, name = found.points, type(self.obstacle).__name__
        name = f"what ContactPair {self.number} asks its obstacle, {name}"
        require_alike(moved.comm, described((points.slave, points.normal, points.gap), name))
        return found

    def _found(self, moved: Moved) -> Found:
        coordinates = moved.coordinates
        shape, place = (
            self.shape(moved.scene, coordinates, moved.time),
            self.own @ coordinates[self.slave_nodes],
        )
        gap, normal = evaluate_shape(shape, "distance", place), evaluate_shape(shape, "normals", place)
        facing = np.einsum("nd,nd->n", self.normals(coordinates), normal) < 0
        chosen = np.flatnonzero(facing & (gap <= moved.reach))
        curvature = evaluate_shape(shape, "curvatures", place[chosen])
        none = sp.csr_matrix((len(chosen), len(coordinates)))
        points = self._where_they_lie(self.points(chosen, normal[chosen], gap[chosen], none), chosen)
        points = with_symmetry(points, self.cut[chosen], self.slave.planes)
        return Found(points, without_patches(curvature, len(coordinates)))

    def _where_they_lie(self, points: ContactPoints, chosen: np.ndarray) -> ContactPoints:
        """Return points of candidates that may lie inside facets of the slave."""
        if (self.on_facet < 0).all():
            return points
        own = self.own[chosen].tocoo()
        entries = own.data, (own.row, self.slave_nodes[own.col])
        inside = sp.csr_matrix(entries, shape=points.master.shape)
        facet, local = self.on_facet[chosen], self.on_local[chosen]
        return replace(points, inside=inside, slave_facet=facet, slave_local=local)


@dataclass(frozen=True)
class OnMovingObstacle(OnObstacle):
    """Nodes that meet an obstacle which moves as prescribed."""

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Obstacles with a path."""
        return isinstance(pair.master, MovingObstacle)

    def placement(self, scene: Scene, coordinates: np.ndarray, time: float) -> Placement:
        """Return where its path has it at a time."""
        placement: Placement = self.obstacle.frame(time)
        return placement

    @property
    def at_rest(self) -> SurfaceShape:
        """The obstacle in its own coordinates."""
        resting: SurfaceShape = self.obstacle.obstacle
        return resting

    def shape(self, scene: Scene, coordinates: np.ndarray, time: float) -> SurfaceShape:
        """Return the obstacle where it is now."""
        turn, shift = self.placement(scene, coordinates, time)
        return placed(self.at_rest, turn, floats(shift))
