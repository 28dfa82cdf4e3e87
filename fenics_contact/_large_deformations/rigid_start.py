"""Bodies whose supports move them as a whole: Newton's method starts where these take them."""

from __future__ import annotations

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.mesh.quality import similarity
from fenics_contact.qp.reductions import Vector


@displayed
class RigidStart:
    """The bodies of a scene with large deformations, moved by their supports like rigid ones."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Keep where the nodes are."""
        self._points, self._decomposition = scene.points, decomposition
        offset = decomposition.tearing.node_offset
        bodies = (scene.bodies[name] for name in decomposition.tearing.body_names)
        self._bodies = [
            slice(int(offset[number]), int(offset[number + 1]))
            for number, body in enumerate(bodies)
            if body.deforms_much
        ]

    def moved(self, before: np.ndarray, load: Loading, displacement: Vector) -> Vector | None:
        """Return the displacement after rigid motions of bodies whose supports all move as one.

        Supports hold whole nodes of such a body, and these move from one load to the other like those of a
        rigid body, whose motion they determine.

        Returns:
            That of this rank, torn; None if no body moves like that.
        """
        copy, block = self._decomposition.held
        node, result = self._decomposition.tearing.copy_node[copy], None
        for nodes in self._bodies:
            motion = _rigid(self._points[nodes], before[nodes], load.prescribed[nodes])
            if motion is None:
                continue
            rotation, shift = motion
            result = displacement.copy() if result is None else result
            own = (node >= nodes.start) & (node < nodes.stop)
            moved, rest = result.reshape(-1, len(shift)), self._points[node[own]]
            moved[block[own]] = (rest + moved[block[own]]) @ rotation.T + shift - rest
        return result

    def _facts(self) -> dict[str, object]:
        return {"bodies": len(self._bodies)}


def _rigid(points: np.ndarray, old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return rotation and shift of a body by prescribed displacements, NaN where free; None if not rigid."""
    held = ~np.isnan(new).all(axis=1)
    if not np.isfinite(new[held]).all() or np.array_equal(old[held], new[held]):
        return None
    start, end, dim = points[held] + old[held], points[held] + new[held], points.shape[1]
    if np.linalg.matrix_rank(start - start.mean(axis=0), tol=1e-6 * np.ptp(points, axis=0).max()) < dim - 1:
        return None
    motion = similarity(start, end)
    if motion is None or abs(motion[2] - 1.0) > 1e-9:
        return None
    return motion[0], motion[1]
