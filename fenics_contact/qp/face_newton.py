"""Semismooth Newton on faces: guess which constraints hold, solve the linear face, correct the guess."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp.certify import Certificate, certify
from fenics_contact.qp.coupled import CoupledFace, couple
from fenics_contact.qp.face import Face, classify
from fenics_contact.qp.face_system import FaceSystem, FaceSystems
from fenics_contact.qp.gmres import projected_gmres
from fenics_contact.qp.iterate import Iterate, Start, apply_unless_zero, iterate_at
from fenics_contact.qp.line_search import Damped, damp
from fenics_contact.qp.pcg import FaceStep, Stop, projected_cg
from fenics_contact.qp.problem import DualProblem, Operator
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.rescue import rescue
from fenics_contact.qp.residual import Residuals, contact_step
from fenics_contact.qp.settling import Settling, keep_unheld
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import DualSolution, SolverStep

#: The longest cycle of active sets that is recognised.
LONGEST_CYCLE = 6


@dataclass(frozen=True)
class FaceNewton:
    """Faces by the natural map w = λ − ρ r, each solved by projected preconditioned CG.

    On a face G λ = e holds exactly, so there is no loop for equilibrium. The inner tolerance follows the
    outer residual, and once no contact changes, the better the last face predicted it, the closer. With
    Coulomb's law the slip bound is refreshed in every step, and the friction of slipping discs grows with
    the normal force already within the step: one loop for all.

    Floating bodies are settled after every step (`Settling`): their motions balance the load with the forces
    of the next guess. Three more things keep the active set from cycling. A disc whose friction force would
    turn by more than a right angle has a ρ too large for it; its ρ is reduced until the force stays or the
    disc sticks. A step that makes the residual worse is cut short, at no cost in products. Steps without
    progress are followed by SMALSE steps from the best iterate so far; the history says whether the active
    set cycled or the residual stood still. And nothing is accepted before its residuals were recomputed.

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
    forcing: float = 0.25
    loosest: float = 0.1
    patience: int = 6
    rescue: Smalse = field(default_factory=Smalse)
    rescue_products: int = 300

    def with_tolerance(self, tolerance: float) -> FaceNewton:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            ConvergenceError: Steps or products were used up; carries the history.
        """
        operator, memory = start.operator, start.memory
        newton = NewtonSteps(problem, law, start, self)
        history: list[SolverStep] = []
        iterate = start.iterate if start.cold else newton.settled(start.iterate)
        best, since_best = iterate, 0
        rescued, budget = None, self.rescue_products
        while len(history) < self.max_steps and operator.products < self.max_products:
            iterate, line = newton.step(iterate, len(history))
            history.append(line)
            answer = self._accepted(problem, law, operator, iterate)
            if answer is not None and answer.iterate.residuals.within(self.tolerance):
                return answer.solution(problem, history, operator.products, memory)
            iterate = iterate if answer is None else answer.iterate
            if iterate.residuals.worst < 0.5 * best.residuals.worst:
                best, since_best = iterate, 0
            else:
                since_best += 1
            if since_best >= self.patience or not np.isfinite(iterate.residuals.worst):
                # Where Newton could do nothing with the last rescue, the next one must go further.
                budget = 2 * budget if best is rescued else self.rescue_products
                left = max(self.max_products - operator.products, 1)
                iterate, memory = rescue(
                    problem,
                    law,
                    Start(best, operator, memory, cold=False),
                    self.rescue,
                    reduction=0.1,
                    budget=min(budget, left),
                    reason=newton.stall(),
                    history=history,
                )
                answer = self._accepted(problem, law, operator, iterate)
                if answer is not None:
                    return answer.solution(problem, history, operator.products, memory)
                rescued, best, since_best = iterate, iterate, 0
        raise ConvergenceError(
            f"face Newton needs residuals below {self.tolerance:.1e}, got after {operator.products} "
            f"products and {len(history)} steps: {history[-1]}; raise max_products, start from a "
            "neighbouring solution, or use SMALSE",
            history,
        )

    def _accepted(
        self, problem: DualProblem, law: SlipLaw, operator: Operator, iterate: Iterate
    ) -> Certificate | None:
        """Return an iterate that claims to be the solution, recomputed, else None. Collective."""
        if not iterate.residuals.within(self.tolerance):
            return None
        return certify(problem, operator, law, iterate.multiplier, iterate.residual)


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
        self._earlier: list[Face] = []
        self._mismatch = 1.0
        self._settling = Settling(problem, law)

    def settled(self, iterate: Iterate) -> Iterate:
        """Return an iterate of another load or position with its floating bodies at rest. Collective."""
        problem = self._problem
        alpha = problem.coarse.coefficients(iterate.product - problem.rhs - iterate.residual)
        alpha = alpha + self._settling(iterate.multiplier, iterate.residual, self._rho)
        return iterate_at(problem, self._law, iterate.multiplier, iterate.product, alpha)

    def step(self, iterate: Iterate, number: int) -> tuple[Iterate, SolverStep]:
        """Classify, solve the face, and return the new iterate with its line of history. Collective."""
        face = self._next_face(iterate)
        self._earlier = [self._face, *self._earlier[: LONGEST_CYCLE - 1]] if self._face else []
        changes = 0 if self._face is None else face.changes(self._face)
        self._face = face
        system = self._systems.build(face)
        coupled = couple(system, self._problem.coarse, self._law.growth, iterate.multiplier)
        linear = coupled or system
        entered = linear.enter(iterate.multiplier)
        moved = apply_unless_zero(self._problem, self._operator, entered - iterate.multiplier)
        product = iterate.product + moved
        solved = self._solve(system, coupled, entered, product, iterate.residuals, changes)
        multiplier, product = entered + linear.advance(solved.step), product + solved.product
        alpha = self._motions(system, linear, iterate, multiplier, product)
        after = iterate_at(self._problem, self._law, multiplier, product, alpha)
        self._mismatch = abs(after.residuals.size - solved.measure) / (iterate.residuals.size or 1.0)
        damped = damp(self._problem, self._law, iterate, after)
        return damped.iterate, self._record(number, damped, system, solved, changes)

    def stall(self) -> str:
        """Say why the last steps led nowhere: whether the active set cycles or stands still. Collective."""
        if self._face is None or not self._earlier:
            return "the residual stands still"
        changes = [self._face.changes(face) for face in self._earlier]
        changed = global_sum(self._problem.comm, *changes)
        if changed[0] == 0.0:
            return "the residual stands still on one face"
        if not np.all(changed):
            return f"the active set cycles with period {int(np.argmin(changed)) + 1}"
        return "the active set does not settle"

    def _next_face(self, iterate: Iterate) -> Face:
        """Classify, with a smaller ρ for discs whose force would otherwise turn back."""
        layout, slip_bound = self._problem.layout, self._law.bound(iterate.multiplier)
        face = classify(layout, slip_bound, iterate.multiplier, iterate.residual, self._rho)
        if self._face is None:
            return face
        turned = np.einsum("ia,ia->i", face.direction, self._face.direction) < 0.0
        self._rho[layout.tangential[turned]] *= 0.3
        return classify(layout, slip_bound, iterate.multiplier, iterate.residual, self._rho)

    def _motions(
        self,
        system: FaceSystem,
        linear: FaceSystem | CoupledFace,
        before: Iterate,
        multiplier: Vector,
        product: Vector,
    ) -> Vector:
        """Return α after a step: from the rows of the face, then settled. Collective."""
        problem, coarse = self._problem, self._problem.coarse
        earlier = coarse.coefficients(before.product - problem.rhs - before.residual)
        alpha = linear.motions(system.gradient(multiplier, product - problem.rhs))
        alpha = keep_unheld(system.coarse, earlier, alpha)
        residual = product - problem.rhs - coarse.transpose(alpha)
        return np.asarray(alpha + self._settling(multiplier, residual, self._rho), dtype=np.float64)

    def _solve(
        self,
        system: FaceSystem,
        coupled: CoupledFace | None,
        multiplier: Vector,
        product: Vector,
        residuals: Residuals,
        changes: int,
    ) -> FaceStep:
        changed = global_sum(self._problem.comm, changes)[0] > 0.0
        forcing = self._parameters.forcing if changed else min(self._parameters.forcing, self._mismatch)
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
