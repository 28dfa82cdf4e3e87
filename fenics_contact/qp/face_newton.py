"""Semismooth Newton on faces: guess which constraints hold, solve the linear face, correct the guess."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp.certify import certify
from fenics_contact.qp.coupled import CoupledFace, couple
from fenics_contact.qp.face import Face, classify
from fenics_contact.qp.face_system import FaceSystem, FaceSystems
from fenics_contact.qp.gmres import projected_gmres
from fenics_contact.qp.iterate import Iterate, Start, apply_unless_zero, iterate_at
from fenics_contact.qp.line_search import Damped, damp
from fenics_contact.qp.pcg import FaceStep, Stop, projected_cg
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.rescue import rescue
from fenics_contact.qp.residual import Residuals, contact_step
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import DualSolution, SolverStep
from fenics_contact.qp.unheld import move_unheld


@dataclass(frozen=True)
class FaceNewton:
    """Faces by the natural map w = λ − ρ r, each solved by projected preconditioned CG.

    On a face G λ = e holds exactly, so there is no loop for equilibrium. The inner tolerance follows the
    outer residual, and the better the last face predicted it, the closer. With Coulomb's law the slip bound
    is refreshed in every step, and the friction of slipping discs grows with the normal force already
    within the step: one loop for all.

    Three things keep the active set from cycling. A disc whose friction force would turn by more than a
    right angle has a ρ too large for it; its ρ is reduced until the force stays or the disc sticks. A step
    that makes the residual worse is cut short, at no cost in products. Steps without progress are followed
    by SMALSE steps from the best iterate so far. And nothing is accepted before its residuals were
    recomputed.

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_steps: Give up after that many Newton steps and rescues.
        max_products: Give up after that many F-products.
        forcing: Largest inner tolerance relative to the outer residual.
        loosest: Largest inner tolerance of all.
        patience: Steps in which the residual must halve before a rescue is called.
        rescue: Parameters of the fallback.
        rescue_products: Products that a rescue may spend; twice as many each time Newton fails again.

    References:
        S. Hüeber, G. Stadler, B. Wohlmuth, A primal-dual active set algorithm for three-dimensional
        contact problems with Coulomb friction, SIAM J. Sci. Comput. 30 (2008). S. C. Eisenstat,
        H. F. Walker, Choosing the forcing terms in an inexact Newton method, ibid. 17 (1996), choice 1.
    """

    tolerance: float = 1e-6
    max_steps: int = 200
    max_products: int = 20_000
    forcing: float = 0.2
    loosest: float = 0.1
    patience: int = 6
    rescue: Smalse = field(default_factory=Smalse)
    rescue_products: int = 300

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            ConvergenceError: Steps or products were used up; carries the history.
        """
        operator, memory = start.operator, start.memory
        newton = NewtonSteps(problem, law, start, self)
        history: list[SolverStep] = []
        iterate, best, since_best = start.iterate, start.iterate, 0
        rescued, budget = None, self.rescue_products
        while len(history) < self.max_steps and operator.products < self.max_products:
            iterate, line = newton.step(iterate, len(history))
            history.append(line)
            if iterate.residuals.within(self.tolerance):
                answer = certify(problem, operator, law, iterate.multiplier, iterate.residual)
                iterate = answer.iterate
                if iterate.residuals.within(self.tolerance):
                    return answer.solution(problem, history, operator.products, memory)
            if iterate.residuals.worst < 0.5 * best.residuals.worst:
                best, since_best = iterate, 0
            else:
                since_best += 1
            if since_best >= self.patience or not np.isfinite(iterate.residuals.worst):
                # Where Newton could do nothing with the last rescue, the next one must go further.
                budget = 2 * budget if best is rescued else self.rescue_products
                iterate, memory = rescue(
                    problem,
                    law,
                    Start(best, operator, memory, cold=False),
                    self.rescue,
                    reduction=0.1,
                    budget=budget,
                    history=history,
                )
                rescued, best, since_best = iterate, iterate, 0
        raise ConvergenceError(
            f"face Newton needs residuals below {self.tolerance:.1e}, got after {operator.products} "
            f"products and {len(history)} steps: {history[-1]}; raise max_products, start from a "
            "neighbouring solution, or use SMALSE",
            history,
        )


class NewtonSteps:
    """Takes Newton steps of one solve and remembers the last face and each disc's ρ."""

    def __init__(self, problem: DualProblem, law: SlipLaw, start: Start, parameters: FaceNewton) -> None:
        """Prepare the coarse spaces of all faces. Collective."""
        self._problem, self._law, self._parameters = problem, law, parameters
        self._operator = start.operator
        self._systems = FaceSystems(problem, start.operator)
        self._natural_step = contact_step(problem.layout, problem.diagonal)
        self._rho = self._natural_step.copy()
        self._face: Face | None = None
        self._mismatch = 1.0

    def step(self, iterate: Iterate, number: int) -> tuple[Iterate, SolverStep]:
        """Classify, solve the face, and return the new iterate with its line of history. Collective."""
        face = self._next_face(iterate)
        changes = 0 if self._face is None else face.changes(self._face)
        self._face = face
        system = self._systems.build(face)
        coupled = couple(system, self._problem.coarse, self._law.growth, iterate.multiplier)
        linear = coupled or system
        entered = linear.enter(iterate.multiplier)
        moved = apply_unless_zero(self._problem, self._operator, entered - iterate.multiplier)
        product = iterate.product + moved
        solved = self._solve(system, coupled, entered, product, iterate.residuals)
        multiplier, product = entered + linear.advance(solved.step), product + solved.product
        alpha = linear.motions(system.gradient(multiplier, product - self._problem.rhs))
        alpha = move_unheld(self._problem, system, iterate, multiplier, alpha, self._rho)
        after = iterate_at(self._problem, self._law, multiplier, product, alpha)
        self._mismatch = abs(after.residuals.size - solved.measure) / (iterate.residuals.size or 1.0)
        damped = damp(self._problem, self._law, iterate, after)
        return damped.iterate, self._record(number, damped, system, solved, changes)

    def _next_face(self, iterate: Iterate) -> Face:
        """Classify, with a smaller ρ for discs whose force would otherwise turn back."""
        layout, slip_bound = self._problem.layout, self._law.bound(iterate.multiplier)
        face = classify(layout, slip_bound, iterate.multiplier, iterate.residual, self._rho)
        if self._face is None:
            return face
        turned = np.einsum("ia,ia->i", face.direction, self._face.direction) < 0.0
        self._rho[layout.tangential[turned]] *= 0.3
        return classify(layout, slip_bound, iterate.multiplier, iterate.residual, self._rho)

    def _solve(
        self,
        system: FaceSystem,
        coupled: CoupledFace | None,
        multiplier: Vector,
        product: Vector,
        residuals: Residuals,
    ) -> FaceStep:
        forcing = min(self._parameters.forcing, self._mismatch)
        wanted = min(self._parameters.loosest, forcing * residuals.worst)
        tolerance = max(wanted, 0.3 * self._parameters.tolerance)
        gradient = system.gradient(multiplier, product - self._problem.rhs)
        weights = residual_weights(system.face, residuals, self._natural_step)
        limit = max(self._parameters.max_products - self._operator.products, 1)
        if coupled is None:
            return projected_cg(system, gradient, weights, tolerance, limit)
        return projected_gmres(coupled.coupled, gradient, weights, tolerance, limit)

    def _record(
        self, number: int, damped: Damped, system: FaceSystem, solved: FaceStep, changes: int
    ) -> SolverStep:
        face, coarse = system.face, system.coarse
        counts = global_sum(
            self._problem.comm,
            np.count_nonzero(face.closed),
            np.count_nonzero(face.stick),
            np.count_nonzero(face.slip),
            changes,
        )
        closed, stick, slip, changed = (round(float(count)) for count in counts)
        note = f"{solved.iterations} CG steps, {changed} status changes"
        if damped.fraction < 1.0:
            note += f", cut to {damped.fraction:g} of the step"
        if solved.stop is not Stop.CONVERGED:
            note += f", {solved.stop.value}"
        if coarse.gram.rank < coarse.m:
            note += f", {coarse.m - coarse.gram.rank} rigid motions not held by the face"
        return SolverStep(
            "face Newton",
            number,
            self._operator.products,
            damped.iterate.residuals,
            closed,
            stick,
            slip,
            note,
        )


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
