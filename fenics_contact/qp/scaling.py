"""A dual problem in multipliers of even stiffness: what stiff and soft neighbours need of the projector.

With λ = s μ the projector becomes P_Q = I − Q Gᵀ(G Q Gᵀ)⁻¹G, Q = diag(s²). Where the coefficients jump,
preconditioned projected conjugate gradients need such a Q to converge independently of the jumps.

References:
    A. Klawonn, O. B. Widlund, FETI and Neumann-Neumann iterative substructuring methods: connections and new
    results, Comm. Pure Appl. Math. 54 (2001) 57-90.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.iterate import answer_at
from fenics_contact.qp.problem import DualProblem, FacePreconditioner, Operator
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import DualSolution

#: Factors that differ by less than this, relatively, are not worth scaling with.
EVEN = 1e-6


def _scaled(precondition: Operator, s: Vector) -> Operator:
    """Return x -> M(x / s) / s."""
    if isinstance(precondition, FacePreconditioner):
        return _ScaledPreconditioner(precondition, s)
    return lambda x: precondition(x / s) / s


@dataclass(frozen=True, eq=False)
class _ScaledPreconditioner:
    """x -> M(x / s) / s, on faces as well: s is even within a contact, so that Z is that of λ."""

    inner: FacePreconditioner
    factor: Vector

    def __call__(self, residual: Vector) -> Vector:
        return self.inner(residual / self.factor) / self.factor

    def on_face(self, restriction: sp.csr_matrix) -> Operator:
        precondition, s = self.inner.on_face(restriction), self.factor
        return lambda x: precondition(x / s) / s


@dataclass(frozen=True, eq=False)
class Scaling:
    """Factors s of the multipliers, λ = s μ, and the coarse space of the scaled problem.

    Attributes:
        factor: s > 0, the same for all multipliers of one contact, owned, shape (size,).
        coarse: G diag(s) with the right side e.
    """

    factor: Vector
    coarse: CoarseSpace

    @classmethod
    def build(cls, factor: Vector, coarse: CoarseSpace) -> Scaling:
        """Scale a coarse space; its matrix is factored when it is first needed."""
        return cls(factor, CoarseSpace(coarse.comm, coarse.matrix @ sp.diags(factor), coarse.load))

    def with_load(self, load: Vector) -> Scaling:
        """Return the scaling of a problem with another right side e; what is factored is shared."""
        return replace(self, coarse=self.coarse.with_load(load))

    def applied_to(self, problem: DualProblem) -> DualProblem:
        """Return the problem for μ, see `DualProblem.evened`."""
        s, precondition, reach = self.factor, problem.preconditioner, problem.reach
        return replace(
            problem,
            operator=lambda x: s * problem.operator(s * x),
            rhs=s * problem.rhs,
            coarse=self.coarse,
            diagonal=s**2 * problem.diagonal,
            preconditioner=None if precondition is None else _scaled(precondition, s),
            scaling=None,
            reach=None if reach is None else lambda x, alpha: s * reach(s * x, alpha),
        )

    def bound(self, problem: DualProblem, slip_bound: Vector | None) -> Vector | None:
        """Return given slip bounds as bounds for μ, owned, shape (n_friction,)."""
        if slip_bound is None:
            return None
        return np.asarray(slip_bound, dtype=np.float64) / self.factor[problem.layout.tangential[:, 0]]

    def start(
        self, problem: DualProblem, start: DualSolution | Vector | None
    ) -> DualSolution | Vector | None:
        """Return where to start for μ."""
        s = self.factor
        if not isinstance(start, DualSolution):
            return None if start is None else np.asarray(start / s, dtype=np.float64)
        multiplier, product, residual = start.multiplier / s, start.product * s, start.residual * s
        same = problem.evened if start.problem is problem else start.problem
        return replace(start, problem=same, multiplier=multiplier, product=product, residual=residual)

    def solution(self, problem: DualProblem, law: SlipLaw, found: DualSolution) -> DualSolution:
        """Return the solution for λ, with its residuals. Collective."""
        s = self.factor
        multiplier, product = s * found.multiplier, found.product / s
        judged = answer_at(problem, law, multiplier, product, found.alpha)
        return replace(
            found,
            problem=problem,
            multiplier=multiplier,
            product=product,
            residual=judged.residual,
            slip_bound=law.bound(multiplier),
            residuals=judged.residuals,
        )
