"""The fallbacks of the face Newton method: proximal points or SMALSE steps until the residual falls again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.newton_steps import Damped, FaceState, FaceSteps, Forcing, Safeguards
from fenics_contact.qp.problem import CountedOperator, DualProblem, ShiftedOperator
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.smalse import Smalse, outer_iterations
from fenics_contact.qp.solution import (
    Iterate,
    Residuals,
    SmalseMemory,
    SolverStep,
    Start,
    certify,
    contact_step,
    iterate_at,
    iterate_between,
)


@dataclass(frozen=True, eq=False)
class ProximalPoint:
    """min ½ λᵀF λ − dᵀλ + ½ ‖λ − λ̄‖²_D over G λ = e and Λ(Ψ): contacts and friction on springs 1/D.

    In displacements this minimises a convex, continuously differentiable function, the potential energy with
    augmented Lagrangians of contact and friction, so that Newton's method with a line search converges
    globally and without cycles. Its face is Newton's of the problem with F + D, d + D λ̄ and ρ = 1/D; the
    centre λ̄ then moves to the spring forces. `stiffness`: 1/D in units of 1/diag F: the larger, the nearer
    to the problem without springs; `shift`: D, 0 on equality rows, owned.

    References:
        R. T. Rockafellar, Augmented Lagrangians and applications of the proximal point algorithm in convex
        programming, Math. Oper. Res. 1 (1976).
    """

    original: DualProblem
    problem: DualProblem
    operator: ShiftedOperator
    stiffness: float
    shift: Vector

    @classmethod
    def build(cls, problem: DualProblem, operator: CountedOperator, stiffness: float) -> ProximalPoint:
        """Add springs of stiffness ``stiffness`` / diag F to all contacts and discs, without a centre yet."""
        layout = problem.layout
        shift = np.zeros(layout.size)
        shift[layout.contact] = 1.0 / (stiffness * contact_step(layout, problem.diagonal)[layout.contact])
        diagonal = np.where(shift > 0.0, shift, problem.diagonal)
        springs = ShiftedOperator(operator, shift, stiffness)
        shifted = replace(problem, operator=springs, diagonal=diagonal, friction=None)
        return cls(problem, shifted, springs, stiffness, shift)

    def centred(self, force: Vector) -> ProximalPoint:
        """Return the point with the centre and the slip bound of a force, owned."""
        original = self.original
        frozen = TrescaLaw(original.layout, original.law.bound(force))
        rhs = original.rhs + self.shift * frozen.admit(force)
        return replace(self, problem=replace(self.problem, rhs=rhs, friction=frozen))

    def enter(self, iterate: Iterate) -> Iterate:
        """Return an iterate of the original problem as one of that with springs. Collective."""
        alpha = iterate.motions(self.original)
        product = iterate.product + self.shift * iterate.multiplier
        return iterate_at(self.problem, iterate.multiplier, product, alpha)

    def leave(self, iterate: Iterate) -> Iterate:
        """Return an iterate of the problem with springs as one of the original one. Collective."""
        alpha = iterate.motions(self.problem)
        product = iterate.product - self.shift * iterate.multiplier
        return iterate_at(self.original, iterate.multiplier, product, alpha)

    def force(self, iterate: Iterate) -> Vector:
        """Return the force of the springs at an iterate, P_Λ(λ̄ − D⁻¹ r), owned."""
        step = contact_step(self.original.layout, self.problem.diagonal)
        trial = iterate.multiplier - step * iterate.residual
        return self.problem.compliance.resolve(self.problem.law.feasible(trial), trial, step)


def descend(
    problem: DualProblem,
    before: Iterate,
    after: Iterate,
    earlier: Sequence[Residuals] = (),
    *,
    steep: float = 0.3,
    level: float = 0.1,
    torn: float = 0.1,
) -> Damped[Iterate]:
    """Return the minimum between two iterates of the potential that a proximal point minimises. Collective.

    The potential energy of displacements u(λ, α) together with that of springs ρ in all contacts and discs is
    convex; its derivative along a step is the product of that of r with the force λ that deforms the bodies
    less the force P_Λ(λ − ρ r) of the springs. Torn bodies are joined first, whatever the potential. `steep`:
    the full step is taken if the slope at its end is below this fraction of the initial descent; `level`:
    slope at which a minimum is accepted, relative to the initial one; `torn`: gluing residual above which
    bodies are torn apart, and their potential is meaningless.
    """
    slope = _slope(problem, before, after)
    first, last = slope(0.0), slope(1.0)
    if first >= 0.0 or last <= -steep * first or before.residuals.gluing > torn:
        return Damped(after, 1.0)
    left, right, low, high = 0.0, 1.0, first, last
    for _ in range(30):
        part = left + (right - left) * min(max(-low / (high - low), 0.1), 0.9)
        value = slope(part)
        if abs(value) <= -level * first:
            break
        if value < 0.0:
            left, low = part, value
        else:
            right, high = part, value
    return Damped(iterate_between(problem, before, after, part), part)


def _slope(problem: DualProblem, before: Iterate, after: Iterate) -> Callable[[float], float]:
    """Return the derivative of the potential as a function of the fraction of a step. Collective to call."""
    layout, step = problem.layout, contact_step(problem.layout, problem.diagonal)
    moved, turned = after.multiplier - before.multiplier, after.residual - before.residual
    opened = turned.copy()
    opened[layout.contact] -= moved[layout.contact] / step[layout.contact]

    def slope(part: float) -> float:
        multiplier = before.multiplier + part * moved
        trial = multiplier - step * (before.residual + part * turned)
        missing = multiplier - problem.compliance.resolve(problem.law.feasible(multiplier), trial, step)
        missing[layout.equality] = (part - 1.0) * moved[layout.equality]
        return float(global_sum(problem.comm, opened @ missing)[0])

    return slope


#: Springs prescribe ρ, a potential determines the step length, and a face that holds all bodies moves them
#: already: moving them alternately with the rest would converge slowly.
WITH_SPRINGS = Safeguards(shorten=descend, adapts_step=False, moves_held=False)


@dataclass(frozen=True, eq=False)
class Rescued:
    """The result of a rescue.

    `line`: its line of history, without number and reason.
    """

    iterate: Iterate
    line: SolverStep
    memory: SmalseMemory | None
    reached: bool


@dataclass(frozen=True, eq=False)
class Rescue:
    """Improves iterates that Newton's method cannot, with their slip bound temporarily fixed.

    By proximal points; by SMALSE, which solves no face, where bodies float and no preconditioner makes faces
    cheap. `reduction`: A rescue aims at a residual smaller by this factor; `springs`: first stiffness of the
    springs in units of 1/diag F: soft for Newton, stiff for the centre; `variety`: factors on that stiffness
    from the fifth rescue on, in turn: where F is singular, Newton's method may lose the same way again what
    springs of one stiffness have gained; `few`: if a centre takes no more steps than this, the springs of the
    next are stiffer: constant springs move the centre by the same small fraction of its way to the solution
    each time; `stiffer`: factor on the springs then; `max_steps`: Newton steps of a rescue by proximal
    points; `centred`: the centre moves once the residual with springs is this small; `ahead`: or this much
    smaller than that without; `face_forcing`: largest inner tolerance relative to the residual with springs;
    `face_loosest`: and the largest absolute one.
    """

    problem: DualProblem
    forcing: Forcing
    max_products: int
    smalse: Smalse
    reduction: float = 0.1
    springs: float = 10.0
    variety: tuple[float, ...] = (10.0, 0.3, 30.0, 1.0)
    few: int = 2
    stiffer: float = 4.0
    max_steps: int = 60
    centred: float = 0.03
    ahead: float = 0.3
    face_forcing: float = 0.25
    face_loosest: float = 0.1

    def __call__(self, start: Start, budget: int, *, enough: float = np.inf, number: int = 0) -> Rescued:
        """Improve an iterate, to ``enough``; ``number``: of the rescue in the solve, from 0. Collective."""
        problem, limit, memory = self.problem, start.operator.products + budget, start.memory
        if problem.preconditioner is None and not problem.compliance.gives_way and problem.coarse.m:
            iterate, line, memory = self._by_smalse(start, limit)
        else:
            factor = 1.0 if number < 4 else self.variety[(number - 4) % len(self.variety)]
            iterate, line = self._by_proximal_points(start, factor * self.springs, limit, enough)
        reached = self._improved(iterate.residuals, start.iterate.residuals, enough)
        line = replace(line, products=start.operator.products, residuals=iterate.residuals)
        return Rescued(iterate, line, memory, reached)

    def _by_proximal_points(
        self, start: Start, springs: float, limit: int, enough: float
    ) -> tuple[Iterate, SolverStep]:
        """Take Newton steps with springs, and move their centre whenever they converge. Collective."""
        path = self._first_centre(start, springs)
        for number in range(self.max_steps):
            newton, line = path.steps.step(path.newton, number)
            iterate = path.point.leave(newton.iterate)
            if not np.isfinite(iterate.residuals.worst):
                iterate = start.iterate
                break
            improved = self._improved(iterate.residuals, start.iterate.residuals, enough)
            solved = iterate.residuals.within(self.forcing.tolerance)
            if improved or solved or start.operator.products >= limit:
                break
            path = replace(path, newton=newton, since=path.since + 1)
            if newton.iterate.residuals.worst < max(self.centred, self.ahead * iterate.residuals.worst):
                path = self._next_centre(path, start.operator, iterate)
        return iterate, replace(line, method="proximal rescue")

    def _first_centre(self, start: Start, springs: float) -> _ProximalPath:
        """Add springs centred at the initial forces. Collective."""
        point = ProximalPoint.build(self.problem, start.operator, springs)
        point = point.centred(start.iterate.multiplier)
        steps = self._steps(point)
        return _ProximalPath(point, steps, steps.init(steps.at_rest(point.enter(start.iterate))))

    def _next_centre(self, path: _ProximalPath, operator: CountedOperator, iterate: Iterate) -> _ProximalPath:
        """Move the centre to the spring forces; stiffen springs that converged quickly. Collective."""
        force = path.point.force(path.newton.iterate)
        if path.since <= self.few:
            stiffness = self.stiffer * path.point.stiffness
            point = ProximalPoint.build(self.problem, operator, stiffness).centred(force)
            steps = self._steps(point)
            return _ProximalPath(point, steps, steps.init(point.enter(iterate)))
        point = path.point.centred(force)
        newton = replace(path.newton, iterate=point.enter(iterate))
        return _ProximalPath(point, path.steps.moved(point.problem), newton)

    def _steps(self, point: ProximalPoint) -> FaceSteps:
        """Prepare Newton's method for a proximal point. Collective."""
        forcing = self.forcing.at_most(self.face_forcing, self.face_loosest)
        return FaceSteps.build(point.problem, point.operator, forcing, self.max_products, WITH_SPRINGS)

    def _by_smalse(self, start: Start, limit: int) -> tuple[Iterate, SolverStep, SmalseMemory]:
        """Take SMALSE steps. Collective."""
        problem = self.problem
        frozen = problem.with_law(TrescaLaw(problem.layout, problem.law.bound(start.iterate.multiplier)))
        target = self.reduction * start.iterate.residuals.worst
        settings = replace(self.smalse, tolerance=target, max_products=limit)
        for state in outer_iterations(frozen, start, settings):
            if state.residuals.within(target) or start.operator.products >= limit:
                break
        improved = certify(
            problem, state.multiplier, start.operator.exactly(state.multiplier), state.residual
        )
        line = state.record(0, frozen, start.operator.products)
        return improved.iterate, replace(line, method="SMALSE rescue"), state.memory

    def _improved(self, after: Residuals, before: Residuals, enough: float) -> bool:
        better = after.worst_in_scales_with(before) <= self.reduction * before.worst_in_scales_with(after)
        # Almost any iterate is far better than a very bad one, but not always good enough for Newton to
        # progress.
        return better and after.worst <= enough


@dataclass(frozen=True, eq=False)
class _ProximalPath:
    """State of a rescue by proximal points."""

    point: ProximalPoint  # springs and their centre
    steps: FaceSteps  # Newton's method with these springs
    newton: FaceState  # its state
    since: int = 0  # steps since the centre moved
