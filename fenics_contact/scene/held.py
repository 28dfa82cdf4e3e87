"""Which rigid motions of a body its supports resist."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.scene.kernels import rigid_body_modes

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts

#: A motion counts as unresisted if it moves supported nodes by less than this fraction of the other motions.
RANK_TOLERANCE = 1e-9


def resisted_motions(modes: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the rigid motions that supports resist.

    Args:
        modes: Rigid motions at the nodes, shape (n_nodes, dim, n_modes).
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).

    Returns:
        Coefficients of the modes as columns, shape (n_modes, rank).
    """
    # The edge of a thin plate moves little when the plate turns about it: singular values resolve how much,
    # their squares would be lost in rounding.
    _, size, motions = np.linalg.svd(modes[fixed], full_matrices=False)
    return np.asarray(motions[size > RANK_TOLERANCE * size.max(initial=0.0)].T)


def held_by_supports(scene: SceneParts, body: str) -> bool:
    """Return whether the supports of a body resist all its rigid motions."""
    modes = rigid_body_modes(scene.bodies[body].mesh.points)
    return resisted_motions(modes, scene.fixed(body)).shape[1] == modes.shape[2]
