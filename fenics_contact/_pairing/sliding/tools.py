"""Rigid tools as counterparts of nodes that move far."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._pairing.sliding.meeting import Found, Moved, Placement
from fenics_contact._pairing.sliding.obstacles import OnMovingObstacle
from fenics_contact._pairing.sliding.stiffness import Differential
from fenics_contact._scene.obstacles import RigidTool
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.tools import ToolBody
from fenics_contact.shapes.simple import SurfaceShape


@dataclass(frozen=True)
class OnTool(OnMovingObstacle):
    """Nodes that meet a tool, whose motion nodes of a body carry."""

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Tools."""
        return isinstance(pair.master, RigidTool)

    def placement(self, scene: Scene, coordinates: np.ndarray, time: float) -> Placement:
        """Return where the nodes that carry it have it."""
        body, nodes = self._carriers(scene)
        return body.frame(coordinates[nodes])

    @property
    def at_rest(self) -> SurfaceShape:
        """The tool in its own coordinates."""
        tool: SurfaceShape = self.obstacle
        return tool

    def _carriers(self, scene: Scene) -> tuple[ToolBody, np.ndarray]:
        """Return the body that carries the tool, and the numbers of its nodes."""
        body = scene.bodies[self.obstacle.name]
        assert isinstance(body, ToolBody)
        nodes = np.arange(body.mesh.n_nodes)
        return body, NodeNumbers.of(scene).global_nodes(self.obstacle.name, nodes)

    def _found(self, moved: Moved) -> Found:
        """Return points; those of a loose tool are like those on a body, of the nodes that carry it.

        At the foot Y of a point on the tool these have affine weights w(Y), so that its surface S = Σ w_j x_j
        is one of patches: with orthonormal tangents t_a, S,_a = t_a, W,_a = t_a·∂w/∂Y, and n·S,_ab = −D₀ with
        the curvature D₀ = D (I − r D)⁻¹ of the surface at Y, D being that of the distance r.
        """
        found = super()._found(moved)
        if self.obstacle.name not in moved.loose:
            return found
        points, differential, coordinates = found.points, found.differential, moved.coordinates
        body, nodes = self._carriers(moved.scene)
        turn, shift = body.frame(coordinates[nodes])
        foot = points.own @ coordinates - points.distance[:, None] * points.normal
        slopes = points.tangents @ turn @ body.cell_slopes.T
        second = np.einsum("nad,nde,nbe->nab", points.tangents, differential.curvature, points.tangents)
        # At edges and corners, where a foot stays, r D has an eigenvalue of one.
        stays = (1.0 + ROUNDING) * np.eye(second.shape[1]) - points.distance[:, None, None] * second
        bend, none = -second @ np.linalg.inv(stays), np.zeros_like(differential.curvature)
        master = _carried(body.weights((foot - shift) @ turn), nodes, len(coordinates))
        of_slopes = (_carried(slopes[:, a], nodes, len(coordinates)) for a in range(slopes.shape[1]))
        points = replace(points, master=master, facet=np.zeros(points.count, dtype=np.int64))
        return Found(points, Differential(points.tangents, bend, tuple(of_slopes), none))


def _carried(weights: np.ndarray, nodes: np.ndarray, count: int) -> sp.csr_matrix:
    """Return weights of a few nodes, shape (n, k), as those of all of them, (n, count)."""
    rows = weights.shape[1] * np.arange(len(weights) + 1)
    return sp.csr_matrix((weights.ravel(), np.tile(nodes, len(weights)), rows), shape=(len(weights), count))
