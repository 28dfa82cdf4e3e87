"""Bodies that pass through each other unseen are told of."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from fenics_contact.contact.state import State
from fenics_contact.errors import safe_log, together
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene import Outline, Scene, bodies_near, outline_of, unpaired

_LOG = logging.getLogger(__name__)


class PassingBodies:
    """Bodies that touch, overlap or pass through each other unseen; each two are warned of once."""

    def __init__(self) -> None:
        """Start without any."""
        self._outlines: dict[str, tuple[BodyMesh, Outline]] = {}
        self._told: set[tuple[str, str]] = set()

    def warn(self, state: State) -> None:
        """Warn of bodies with facets in one another, or that touch without a pair or tie. Collective.

        Only bodies whose bounding boxes come near each other are gathered; ranks share their facets.

        Args:
            state: The state; places before and after its loads are compared.
        """
        scene, comm = state.scene, state.torn.decomposition.comm
        moved = state.torn_displacement.reshape(-1, scene.dim)
        reach = max(comm.allgather(float(np.linalg.norm(moved, axis=1).max(initial=0.0))))
        near = [both for both in bodies_near(scene, reach) if both not in self._told]
        names = sorted({name for both in near for name in both})
        displacement = {name: state.gather_displacement(name) for name in names}
        share = slice(comm.rank, None, comm.size)
        with together(comm):
            outlines = {name: self._outline(scene, name) for name in names}
            parts = [unpaired(scene, both, outlines, displacement, reach, share) for both in near]
        counts = comm.allreduce(np.array([part.counts for part in parts], dtype=int)).tolist()
        for part, whole in zip(parts, counts, strict=True):
            if words := replace(part, counts=tuple(whole)).in_words():
                self._told.add(part.bodies)
                if comm.rank == 0:
                    safe_log(_LOG.warning, "%s", words)

    def _outline(self, scene: Scene, name: str) -> Outline:
        """Return the boundary of a body, which meshes of the same cells share."""
        mesh = scene.bodies[name].mesh
        known = self._outlines.get(name)
        if known is None or known[0].cells is not mesh.cells:
            known = self._outlines[name] = (mesh, outline_of(mesh))
        return known[1]
