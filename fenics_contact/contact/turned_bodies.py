"""Bodies of small strain that turn so far that they are strained by it."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import tell
from fenics_contact.scene import rigid_body_modes

if TYPE_CHECKING:
    from fenics_contact.contact.deformed_state import DeformedState

_LOG = logging.getLogger(__name__)
#: Mean rotation, in radians, beyond which it is told: its square is twice the strain that it makes.
FAR = 0.05


def tell_of_turned_bodies(state: DeformedState) -> None:
    """Log a warning for each body of small strain, beside others, that has turned far. Collective."""
    for name, body in state.scene.bodies.items():
        if body.deforms_much:
            continue
        angle = mean_rotation(body.mesh.points, state.gather_displacement(name))
        if angle > FAR and state.dual.problem.comm.rank == 0:
            words = (
                "body %r has turned by %.2g rad; its material is for small rotations, %.1g of strain is due "
                "to this alone: give it a material for large deformations, such as StVenantKirchhoff"
            )
            tell(_LOG.warning, words, name, angle, angle**2 / 2)


def mean_rotation(points: np.ndarray, displacement: np.ndarray) -> float:
    """Return the angle of the rigid motion nearest to a displacement, in radians.

    Args:
        points: Shape (n, dim), [length].
        displacement: Shape (n, dim), [length].
    """
    dim, size = points.shape[1], np.abs(points - points.mean(axis=0)).max()
    modes = rigid_body_modes(points / size).reshape(displacement.size, -1)
    motion = np.linalg.lstsq(modes, (displacement / size).ravel(), rcond=None)[0]
    return float(np.linalg.norm(motion[dim:]))
