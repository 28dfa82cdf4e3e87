"""The fallbacks of the face Newton method: proximal points or SMALSE steps until the residual falls again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.qp.iterate import Iterate, Start, certify, iterate_at
from fenics_contact.qp.newton_steps import NewtonSteps
from fenics_contact.qp.problem import CountedOperator, DualProblem, ShiftedOperator
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.slip_law import SlipLaw, Tresca
from fenics_contact.qp.smalse import outer_iterations
from fenics_contact.qp.solution import Residuals, SmalseMemory, SolverStep, contact_step

if TYPE_CHECKING:
    from fenics_contact.qp.face_newton import FaceNewton


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


#: A rescue aims at a residual smaller by this factor.
REDUCTION = 0.1
#: Stiffness of the springs of a proximal point in units of 1/diag F: soft for Newton, stiff for the centre.
SPRINGS = 10.0
#: Where a centre takes no more steps than this, the springs of the next are stiffer by that factor: springs
#: that stay the same move the centre by ever the same small part of its way to the solution.
FEW, STIFFER = 2, 4.0
#: Newton steps of a rescue by proximal points.
PROXIMAL_STEPS = 60
#: The centre moves once the residual with springs is this small, or so much smaller than that without.
CENTRED, AHEAD = 0.03, 0.3
#: A residual from which nothing comes back.
DIVERGED = 1e12
#: Largest inner tolerances, relative to the residual and of all.
FORCING, LOOSEST = 0.25, 0.1


def rescue(
    problem: DualProblem,
    law: SlipLaw,
    start: Start,
    parameters: FaceNewton,
    *,
    budget: int,
    further: bool = False,
    reason: str,
    history: list[SolverStep],
) -> tuple[Iterate, SmalseMemory | None]:
    """Improve an iterate that Newton's method cannot, with its slip bound held for a while. Collective.

    By proximal points where a preconditioner makes faces cheap; by SMALSE, which solves no face, elsewhere.

    Args:
        problem: The dual problem.
        law: Where the slip bound comes from.
        start: The iterate that Newton could not improve.
        parameters: Those of Newton's method.
        budget: Largest number of products to spend.
        further: Whether an earlier rescue from the same iterate was of no use.
        reason: Why Newton's method needs it, in words.
        history: Gets one record.

    Returns:
        The improved iterate with its residuals for ``law``, and what SMALSE learned.
    """
    limit = start.operator.products + budget
    memory: SmalseMemory | None = start.memory
    if problem.preconditioner is None:
        found, line, memory = _by_smalse(problem, law, start, parameters, limit)
    else:
        found, line = _by_proximal_points(problem, law, start, parameters, limit, further)
    before = start.iterate.residuals
    reached = "met its target" if _improved(found.residuals, before, further) else "used its budget"
    note = f"rescue from {before.worst:.1e} because {reason}: {reached}"
    products = start.operator.products
    history.append(
        replace(line, iteration=len(history), products=products, residuals=found.residuals, note=note)
    )
    return found, memory


def _improved(after: Residuals, before: Residuals, further: bool) -> bool:
    better = after.worst_beside(before) <= REDUCTION * before.worst_beside(after)
    # From a very bad iterate any other is better by far, but not always one from which Newton gets anywhere.
    return better and (not further or after.worst <= REDUCTION)


def _by_proximal_points(
    problem: DualProblem, law: SlipLaw, start: Start, parameters: FaceNewton, limit: int, further: bool
) -> tuple[Iterate, SolverStep]:
    """Take Newton steps with springs, and move their centre whenever they come to rest. Collective."""
    stiffness, since = SPRINGS, 0
    point = ProximalPoint.build(problem, law, start.operator, stiffness).centred(start.iterate.multiplier)
    careful = replace(
        parameters, forcing=min(parameters.forcing, FORCING), loosest=min(parameters.loosest, LOOSEST)
    )
    steps = NewtonSteps(point.problem, point.frozen, point.operator, careful, springs=True)
    current = steps.settled(point.enter(start.iterate))
    for number in range(PROXIMAL_STEPS):
        current, line = steps.step(current, number)
        found = point.leave(current)
        if not found.residuals.worst < DIVERGED:
            found = start.iterate
            break
        if _improved(found.residuals, start.iterate.residuals, further) or start.operator.products >= limit:
            break
        if found.residuals.within(parameters.tolerance):
            break
        since += 1
        if current.residuals.worst < max(CENTRED, AHEAD * found.residuals.worst):
            force = point.force(current)
            if since <= FEW:
                stiffness, since = STIFFER * stiffness, 0
                point = ProximalPoint.build(problem, law, start.operator, stiffness).centred(force)
                steps = NewtonSteps(point.problem, point.frozen, point.operator, careful, springs=True)
            else:
                since = 0
                point = point.centred(force)
                steps.move(point.problem, point.frozen)
            current = point.enter(found)
    return found, replace(line, method="proximal rescue")


def _by_smalse(
    problem: DualProblem, law: SlipLaw, start: Start, parameters: FaceNewton, limit: int
) -> tuple[Iterate, SolverStep, SmalseMemory]:
    """Take SMALSE steps. Collective."""
    frozen = Tresca(problem.layout, law.bound(start.iterate.multiplier))
    feasible = frozen.feasible(start.iterate.multiplier)
    target = REDUCTION * start.iterate.residuals.worst
    settings = replace(parameters.rescue, tolerance=target, max_products=limit)
    for state in outer_iterations(problem, feasible, start, settings):
        if state.residuals.within(target) or start.operator.products >= limit:
            break
    improved = certify(problem, start.operator, law, state.multiplier, state.residual).iterate
    line = state.record(0, problem, start.operator.products)
    return improved, replace(line, method="SMALSE rescue"), state.memory
