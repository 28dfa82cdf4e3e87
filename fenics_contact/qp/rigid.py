"""The rigid motions α that belong to a multiplier of which nothing else is known."""

from __future__ import annotations

import numpy as np

from fenics_contact.qp.face import classify
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.residual import contact_step
from fenics_contact.qp.slip_law import SlipLaw

SLIP_MARGIN = 1e-4


def fit_rigid_motions(problem: DualProblem, law: SlipLaw, multiplier: Vector, product: Vector) -> Vector:
    """Return α = (G_F G_Fᵀ)⁻¹ G_F (F λ − d)_F over the rows that λ says are free. Collective.

    Free are the gluing rows, contacts with λ_N > 0, discs well inside their bound, and the tangents of the
    others. There r should vanish; open rows have gaps and slipping ones slip, which must not be spread
    over the bodies.

    Args:
        problem: The dual problem.
        law: Where the slip bound comes from.
        multiplier: λ, owned.
        product: F λ, owned.
    """
    bound = (1.0 - SLIP_MARGIN) * law.bound(multiplier)
    step = contact_step(problem.layout, problem.diagonal)
    face = classify(problem.layout, bound, multiplier, np.zeros_like(multiplier), step)
    return problem.coarse.restricted(face.restriction).coefficients(face.restrict(product - problem.rhs))
