"""Proximal points of a dual problem: Newton's method with a potential to descend, which cannot cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.qp.iterate import Iterate, iterate_at
from fenics_contact.qp.problem import CountedOperator, DualProblem, ShiftedOperator
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.residual import contact_step
from fenics_contact.qp.slip_law import SlipLaw, Tresca


@dataclass(frozen=True, eq=False)
class ProximalPoint:
    """min ½ λᵀF λ − dᵀλ + ½ ‖λ − λ̄‖²_D over G λ = e and Λ(Ψ): contacts and friction on springs 1/D.

    In displacements that is to minimise a convex function with a continuous derivative, the potential energy
    with augmented Lagrangians of contact and friction, so that Newton's method with a line search gets there
    from anywhere, and without cycles. Its face is Newton's of the problem with F + D, d + D λ̄ and ρ = 1/D;
    the centre λ̄ then moves to the force of the springs.

    Attributes:
        original: The problem without springs.
        law: Its law.
        problem: The problem with springs: F + D, d + D λ̄, and D in place of the diagonal of F.
        operator: F + D, counted.
        frozen: Tresca's law with the slip bound of the centre.
        shift: D, 0 on equality rows, owned.

    References:
        R. T. Rockafellar, Augmented Lagrangians and applications of the proximal point algorithm in convex
        programming, Math. Oper. Res. 1 (1976).
    """

    original: DualProblem
    law: SlipLaw
    problem: DualProblem
    operator: ShiftedOperator
    frozen: Tresca
    shift: Vector

    @classmethod
    def build(
        cls, problem: DualProblem, law: SlipLaw, operator: CountedOperator, stiffness: float
    ) -> ProximalPoint:
        """Put springs of stiffness ``stiffness`` / diag F in all contacts and discs, without a centre yet.

        Args:
            problem: The dual problem.
            law: Where the slip bound comes from.
            operator: F, counted.
            stiffness: 1/D in units of 1/diag F: the larger, the nearer to the problem without springs.
        """
        layout = problem.layout
        shift = np.zeros(layout.size)
        shift[layout.contact] = 1.0 / (stiffness * contact_step(layout, problem.diagonal)[layout.contact])
        diagonal = np.where(shift > 0.0, shift, problem.diagonal)
        springs = ShiftedOperator(operator, shift)
        shifted = replace(problem, operator=springs, diagonal=diagonal)
        return cls(problem, law, shifted, springs, Tresca(layout, np.zeros(layout.n_friction)), shift)

    def centred(self, force: Vector) -> ProximalPoint:
        """Return the point with the centre and the slip bound of a force, owned."""
        bound = self.law.bound(force)
        frozen = Tresca(self.original.layout, bound)
        centre = self.shift * frozen.feasible(force).project(force)
        return replace(self, problem=replace(self.problem, rhs=self.original.rhs + centre), frozen=frozen)

    def enter(self, iterate: Iterate) -> Iterate:
        """Return an iterate of the original problem as one of that with springs. Collective."""
        original = self.original
        alpha = original.coarse.coefficients(iterate.product - original.rhs - iterate.residual)
        product = iterate.product + self.shift * iterate.multiplier
        return iterate_at(self.problem, self.frozen, iterate.multiplier, product, alpha)

    def leave(self, iterate: Iterate) -> Iterate:
        """Return an iterate of the problem with springs as one of the original one. Collective."""
        problem = self.problem
        alpha = problem.coarse.coefficients(iterate.product - problem.rhs - iterate.residual)
        product = iterate.product - self.shift * iterate.multiplier
        return iterate_at(self.original, self.law, iterate.multiplier, product, alpha)

    def force(self, iterate: Iterate) -> Vector:
        """Return the force of the springs at an iterate, P_Λ(λ̄ − D⁻¹ r), owned."""
        step = contact_step(self.original.layout, self.problem.diagonal)
        trial = iterate.multiplier - step * iterate.residual
        return self.frozen.feasible(trial).project(trial)
