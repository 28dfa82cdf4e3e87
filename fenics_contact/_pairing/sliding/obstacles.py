"""Rigid obstacles as counterparts of nodes that move far: at rest, or driven along a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._pairing.masters import ObstacleMaster
from fenics_contact._pairing.points import with_symmetry
from fenics_contact._pairing.sliding.meeting import Found, Moved, SlidingPair
from fenics_contact._pairing.sliding.stiffness import without_patches
from fenics_contact._scene.pairs import ContactPair
from fenics_contact.errors import together
from fenics_contact.shapes.simple import evaluate_shape


@dataclass(frozen=True)
class OnObstacle(SlidingPair):
    """Nodes that meet a rigid obstacle."""

    master: ObstacleMaster

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Obstacles of any class."""
        return True

    def at(self, moved: Moved) -> Found:
        """Return the points on the obstacle. Collective."""
        with together(moved.comm):
            found = self._found(moved)
        points, name = found.points, type(self.master.pair.master).__name__
        name = f"what ContactPair {self.number} asks its obstacle, {name}"
        require_alike(moved.comm, described((points.slave, points.normal, points.gap), name))
        return found

    def _found(self, moved: Moved) -> Found:
        coordinates = moved.coordinates
        shape = self.master.moved(self.number, coordinates, moved.placements).shape
        place = self.own @ coordinates[self.slave_nodes]
        gap, normal = evaluate_shape(shape, "distance", place), evaluate_shape(shape, "normals", place)
        facing = np.einsum("nd,nd->n", self.normals(coordinates), normal) < 0
        chosen = np.flatnonzero(facing & (gap <= moved.reach))
        curvature = evaluate_shape(shape, "curvatures", place[chosen])
        none = sp.csr_matrix((len(chosen), len(coordinates)))
        points = self.points(chosen, normal[chosen], gap[chosen], none)
        points = with_symmetry(points, self.cut[chosen], self.slave.planes)
        return Found(points, without_patches(curvature, len(coordinates)))
