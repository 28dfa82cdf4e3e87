"""Rigid tools as counterparts of nodes that move far."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.masters import ToolMaster, carried
from fenics_contact._pairing.sliding.meeting import Found, Moved
from fenics_contact._pairing.sliding.obstacles import OnObstacle
from fenics_contact._pairing.sliding.stiffness import Differential
from fenics_contact._scene.pairs import ContactPair


@dataclass(frozen=True)
class OnTool(OnObstacle):
    """Nodes that meet a tool, whose motion nodes of a body carry."""

    master: ToolMaster

    @classmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Tools."""
        return bool(pair.tool)

    def _found(self, moved: Moved) -> Found:
        """Return points; those of a free tool are like those on a body, of the nodes that carry it.

        At the foot Y of a point on the tool these have affine weights w(Y), so that its surface S = Σ w_j x_j
        is one of patches: with orthonormal tangents t_a, S,_a = t_a, W,_a = t_a·∂w/∂Y, and n·S,_ab = −D₀ with
        the curvature D₀ = D (I − r D)⁻¹ of the surface at Y, D being that of the distance r.
        """
        found = super()._found(moved)
        if self.master.pair.master.name not in moved.free_tools:
            return found
        points, differential, coordinates = found.points, found.differential, moved.coordinates
        body, nodes = self.master.body, self.master.nodes
        turn, shift = moved.placements[self.number]
        foot = points.own @ coordinates - points.distance[:, None] * points.normal
        slopes = points.tangents @ turn @ body.cell_slopes.T
        second = np.einsum("nad,nde,nbe->nab", points.tangents, differential.curvature, points.tangents)
        # At edges and corners, where a foot stays, r D has an eigenvalue of one.
        stays = (1.0 + ROUNDING) * np.eye(second.shape[1]) - points.distance[:, None, None] * second
        bend, none = -second @ np.linalg.inv(stays), np.zeros_like(differential.curvature)
        master = carried(body.weights((foot - shift) @ turn), nodes, len(coordinates))
        of_slopes = (carried(slopes[:, a], nodes, len(coordinates)) for a in range(slopes.shape[1]))
        points = replace(points, master=master, facet=np.zeros(points.count, dtype=np.int64))
        return Found(points, Differential(points.tangents, bend, tuple(of_slopes), none))
