"""Rigid motions that a face does not hold: the body moves on until contact or friction stops it."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from fenics_contact.qp.face_system import FaceSystem
from fenics_contact.qp.iterate import Iterate
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_sum


def move_unheld(
    problem: DualProblem,
    system: FaceSystem,
    before: Iterate,
    multiplier: Vector,
    alpha: Vector,
    step: Vector,
) -> Vector:
    """Return α with the motions that the face leaves open determined by the unbalanced load. Collective.

    On the motions N with (G Z)ᵀN = 0 equilibrium cannot be met within the face, and its rows say nothing
    about α. There α stays what it was and moves on by δα = N (Nᵀ G ρ Gᵀ N)⁻¹ Nᵀ(e − G λ): the trial
    multiplier λ − ρ r then gains ρ Gᵀδα, whose resultant is what is missing. A step of the method of
    multipliers, after which other contacts close or other discs stick.

    Args:
        problem: The dual problem.
        system: The face.
        before: The iterate before the step.
        multiplier: λ after it, owned.
        alpha: α from the rows of the face, shape (m,), replicated.
        step: ρ, 0 on equality rows, owned.
    """
    null, coarse = system.coarse.gram.null_space, problem.coarse
    count = null.shape[1]
    if count == 0:
        return alpha
    basis, _ = np.linalg.qr(null)
    earlier = coarse.coefficients(before.product - problem.rhs - before.residual)
    rows, m = coarse.matrix.T @ basis, coarse.m
    sums = global_sum(
        problem.comm,
        coarse.matrix.power(2) @ step,
        rows.T @ multiplier,
        rows.T @ (step[:, None] * rows),
    )
    largest, resultant, stiffness = np.split(sums, (m, m + count))
    # Motions that no contact row resists at all stay what they are.
    inverse = scipy.linalg.pinvh(stiffness.reshape(count, count), atol=1e-10 * float(largest.max()))
    return alpha + basis @ (basis.T @ (earlier - alpha) + inverse @ (basis.T @ coarse.load - resultant))
