"""Which rigid motions of a body its supports resist."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.mesh import BodyMesh
from fenics_contact.scene.kernels import rigid_body_modes
from fenics_contact.scene.rigid_surfaces import RigidSurface

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts

#: A motion counts as unresisted if it moves supported nodes by less than this fraction of the other motions.
RANK_TOLERANCE = 1e-9


def held_components(scene: SceneParts, body: str, modes: np.ndarray) -> np.ndarray:
    """Return what motions of a body move of the components that supports prescribe, shape (n, n_modes).

    Of a rigid surface with free components the others count, as displacement and rotation of its point.

    Args:
        scene: The scene.
        body: Name of the body.
        modes: Motions at its nodes, shape (n_nodes, dim, n_modes).
    """
    mesh = scene.bodies[body].mesh
    loose = [each for each in scene.supports if isinstance(each, RigidSurface) and each.free.any()]
    firm = [each for each in scene.supports if each not in loose]
    rows = [modes[scene.fixed(body, firm)]]
    for surface in loose:
        if surface.body == body:
            rows.append(_of_point(surface, mesh, modes)[~surface.free])
    return np.concatenate(rows)


def point_loads(scene: SceneParts, body: str, modes: np.ndarray) -> np.ndarray:
    """Return the work of the loads at points of rigid surfaces of a body on its rigid motions, (n_modes,)."""
    total = np.zeros(modes.shape[2])
    for surface in scene.supports:
        if isinstance(surface, RigidSurface) and surface.body == body and surface.load.any():
            total += surface.load @ _of_point(surface, scene.bodies[body].mesh, modes)
    return total


def _of_point(surface: RigidSurface, mesh: BodyMesh, modes: np.ndarray) -> np.ndarray:
    """Return displacement and rotation of the point for motions of its body, (n_components, n_modes)."""
    nodes = np.unique(mesh.surfaces[surface.surface])
    moved = surface.modes(mesh.points[nodes]).reshape(-1, len(surface.motion))
    size = np.linalg.norm(moved, axis=0)
    fitted = np.linalg.lstsq(moved / size, modes[nodes].reshape(len(moved), -1), rcond=None)[0]
    return np.asarray(fitted / size[:, None])


def resisted_motions(held: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the rigid motions that supports resist.

    Args:
        held: What the motions move of prescribed components, shape (n, n_modes), see `held_components`.

    Returns:
        Coefficients of the modes as columns, shape (n_modes, rank).
    """
    # The edge of a thin plate moves little when the plate turns about it: singular values resolve how much,
    # their squares would be lost in rounding.
    _, size, motions = np.linalg.svd(held, full_matrices=False)
    return np.asarray(motions[size > RANK_TOLERANCE * size.max(initial=0.0)].T)


def held_by_supports(scene: SceneParts, body: str) -> bool:
    """Return whether the supports of a body resist all its rigid motions."""
    modes = rigid_body_modes(scene.bodies[body].mesh.points)
    return resisted_motions(held_components(scene, body, modes)).shape[1] == modes.shape[2]
