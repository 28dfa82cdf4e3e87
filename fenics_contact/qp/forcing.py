"""How accurately faces are solved: the forcing terms of an inexact Newton method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.qp.face import Face
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.solution import Residuals


@dataclass(frozen=True)
class Forcing:
    """Tolerances of faces that follow the residual of the iterate, choice 1 of Eisenstat and Walker.

    Attributes:
        largest: Largest tolerance relative to the residual.
        loosest: Largest absolute tolerance.
        tolerance: That of the whole solve: no face is solved much more accurately.

    References:
        S. C. Eisenstat, H. F. Walker, Choosing the forcing terms in an inexact Newton method, SIAM J. Sci.
        Comput. 17 (1996).
    """

    largest: float
    loosest: float
    tolerance: float

    def at_most(self, largest: float, loosest: float) -> Forcing:
        """Return forcing terms that are no larger than these."""
        return replace(self, largest=min(self.largest, largest), loosest=min(self.loosest, loosest))

    def tolerance_of_face(self, residuals: Residuals, mismatch: float | None, care: float) -> float:
        """Return the weighted residual at which a face is solved.

        Args:
            residuals: Those of the iterate.
            mismatch: Difference of the last residual from the one that its face predicted, relative to the
                residual before; None if the face has changed.
            care: Factor on the relative tolerance, at most one.
        """
        term = self.largest if mismatch is None else min(self.largest, mismatch)
        wanted = min(self.loosest, care * term * residuals.worst)
        return max(wanted, 0.3 * self.tolerance)


def residual_weights(face: Face, residuals: Residuals, step: Vector) -> Vector:
    """Return the weights that turn a residual on a face into the natural and the gluing residual.

    Args:
        face: The face.
        residuals: The last residuals, for their scales.
        step: ρ of the natural map, 0 on equality rows, owned.
    """
    gluing = residuals.gluing_scale or 1.0
    weights = np.sqrt(face.restriction.power(2).T @ step**2) * face.damping**2
    weights /= residuals.force_scale or np.inf
    return np.where(weights > 0.0, weights, 1.0 / gluing)
