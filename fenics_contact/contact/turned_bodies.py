"""Bodies of small strain that turn so far that they are strained by it."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import tell

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
    arms, moved = (each - each.mean(axis=0) for each in (points, displacement))
    spins = arms.T @ moved - moved.T @ arms  # twice the antisymmetric part of the moments
    moments = arms.T @ arms
    total = np.trace(moments)
    if points.shape[1] == 2:
        return float(abs(spins[0, 1]) / total)
    axial = np.array([spins[1, 2], spins[2, 0], spins[0, 1]])
    return float(np.linalg.norm(np.linalg.lstsq(total * np.eye(3) - moments, axial, rcond=None)[0]))
