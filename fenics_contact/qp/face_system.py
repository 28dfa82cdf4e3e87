"""The linear system of one face: operator, coarse space and preconditioner restricted to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.qp.coarse import CoarseSpace, gram_matrix
from fenics_contact.qp.face import Face
from fenics_contact.qp.problem import DualProblem, FacePreconditioner, Operator
from fenics_contact.qp.reductions import Vector, global_sum


@dataclass(frozen=True, eq=False)
class FaceSystem:
    """A = Zᵀ F Z + κ on {G Z y = e − G fixed}, with a preconditioner.

    Attributes:
        comm: Communicator of the ranks.
        face: Which multipliers are free.
        operator: F, owned to owned, collective.
        coarse: G Z and its right side.
        preconditioner: Approximation of F⁻¹, owned to owned, or None.
        patience: Iterations without progress after which an inner solver gives up.
    """

    comm: MPI.Comm
    face: Face
    operator: Operator
    coarse: CoarseSpace
    preconditioner: Operator | None = None
    patience: int = 60

    def image(self, y: Vector, full: Vector) -> Vector:
        """Return A y, shape (n_face,), for y on the face and full = F Z y owned."""
        return self.face.restrict(full) + self.face.curvature * y

    def precondition(self, residual: Vector) -> Vector:
        """Apply D Zᵀ M Z D, where D = (1 + ρκ)^-½ accounts for the curvature of the discs. Collective."""
        damping = self.face.damping
        if self.preconditioner is None:
            return damping**2 * residual
        return damping * self.face.restrict(self.preconditioner(self.face.prolong(damping * residual)))

    def gradient(self, multiplier: Vector, flexed: Vector) -> Vector:
        """Return Zᵀ(F λ − d) + κ y, shape (n_face,), for λ on the face and flexed = F λ − d."""
        return self.face.restrict(flexed) + self.face.curvature * self.face.restrict(multiplier)

    def enter(self, multiplier: Vector) -> Vector:
        """Return the owned vector on the face and in equilibrium that is closest to λ. Collective."""
        on_face = self.face.nearest(multiplier)
        y = self.face.restrict(on_face)
        missing = self.coarse.residual(y)
        return on_face - self.face.prolong(self.coarse.transpose(self.coarse.solve(missing)))

    def advance(self, step: Vector) -> Vector:
        """Return how the multiplier moves, Z δ, owned, for a step δ in face coordinates."""
        return self.face.prolong(step)

    def motions(self, gradient: Vector) -> Vector:
        """Return α, the rigid motions that fit a gradient on the face best, replicated. Collective.

        Refined once: rounding of bodies that move far would else move others, which nothing loads.
        """
        alpha = self.coarse.coefficients(gradient)
        return alpha + self.coarse.coefficients(gradient - self.coarse.transpose(alpha))

    def weighted_norm(self, y: Vector, weights: Vector) -> float:
        """Return the global norm of weights · y. Collective."""
        scaled = weights * y
        return float(np.sqrt(global_sum(self.comm, scaled @ scaled)[0]))


class FaceSystems:
    """Builds face systems of one problem; the gluing part of G Z Zᵀ Gᵀ is computed once."""

    def __init__(self, problem: DualProblem, operator: Operator) -> None:
        """Prepare for ``problem`` with its (counted) operator F. Collective."""
        self._problem = problem
        self._operator = operator
        self._equality_gram = gram_matrix(problem.comm, problem.coarse.matrix[:, problem.layout.equality])

    def build(self, face: Face) -> FaceSystem:
        """Return the system of a face. Collective."""
        problem, coarse = self._problem, self._problem.coarse
        n_equality = len(problem.layout.equality)
        columns = coarse.matrix @ face.restriction[:, n_equality:]
        gram = self._equality_gram + gram_matrix(problem.comm, columns)
        load = coarse.load - coarse.apply(face.fixed)
        restricted = coarse.restricted(face.restriction, load, gram=gram)
        preconditioner = problem.preconditioner
        if isinstance(preconditioner, FacePreconditioner):
            preconditioner = preconditioner.on_face(face.restriction)
        return FaceSystem(problem.comm, face, self._operator, restricted, preconditioner)
