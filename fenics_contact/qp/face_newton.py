"""Semismooth Newton on faces: guess which constraints hold, solve the linear face, correct the guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError
from fenics_contact.qp.iterate import Certificate, Iterate, Start, certify
from fenics_contact.qp.newton_steps import NewtonSteps
from fenics_contact.qp.not_held import HARDLY_WEDGED, FrictionAlone, require_contact
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import global_sum
from fenics_contact.qp.rescue import DIVERGED, rescue
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import DualSolution, SolverStep

#: Distance from equilibrium of an iterate that proximal points could not repair.
UNBALANCED = 1e-6
#: A residual above this after all steps is no answer by any measure.
HARDLY = 1e-2
#: Steps in which nothing sticks, one after the other: a single one happens on the way to states that stick.
SLIDING = 5
#: The rescue before which it is asked whether friction can suffice at all, and by forces of which tolerance.
DOUBT, ROUGH = 4, 1e-3
#: After so many steps without progress each further one solves its face better by that factor: where forces
#: vanish in the end, residuals relative to them say nothing of how far gaps can be trusted.
CARELESS, CARE = 2, 0.25
#: So many rescues in turn that lead to one and the same iterate are the last; residuals agree so far there.
VAIN, SAME = 7, 1e-6


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
    disc sticks. A step that is worse than the last two iterates is cut short, at no cost in products. Steps
    without progress are followed by a rescue from the best iterate so far, by proximal points, whose convex
    potential a line search descends (`qp.proximal`), or without a preconditioner by SMALSE; the history says
    whether the active set cycled or the residual stood still. And nothing is accepted before its residuals
    were recomputed.

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_steps: Give up after that many Newton steps and rescues.
        max_products: Give up after that many F-products.
        forcing: Largest inner tolerance relative to the outer residual.
        loosest: Largest inner tolerance of all.
        patience: Steps in which the residual must halve before a rescue is called.
        rescue: Parameters of the fallback of problems without a preconditioner.
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
            InfeasibleError: Some body is held by nothing but contacts that stay open, or too little friction;
                where all was tried before that was found, its cause carries the history.
            ConvergenceError: Steps or products were used up; carries the history.
        """
        operator, memory = start.operator, start.memory
        newton = NewtonSteps(problem, law, operator, self)
        rough = replace(self, tolerance=ROUGH, max_products=10 * self.rescue_products)
        alone = FrictionAlone(problem, law, rough)
        history: list[SolverStep] = []
        first = start.iterate if start.cold else newton.settled(start.iterate)
        iterate = best = first
        since_best, budget, care, rescues, vain = 0, self.rescue_products, 1.0, 0, 0
        rescued: Iterate | None = None
        origin: Iterate | None = None
        while len(history) < self.max_steps and operator.products < self.max_products and vain < VAIN:
            iterate, line = newton.step(iterate, len(history), care)
            history.append(line)
            start.reached(line)
            iterate, answer = self._checked(problem, law, operator, iterate)
            if answer is not None:
                return answer.solution(problem, history, operator.products, memory)
            require_contact(history, self.patience)
            before, after = best.residuals, iterate.residuals
            progress = after.worst_beside(before) < 0.5 * before.worst_beside(after)
            best, since_best = (iterate, 0) if progress else (best, since_best + 1)
            care = 1.0 if progress else care * CARE if since_best > CARELESS else care
            if since_best < self.patience and after.worst_beside(before) < DIVERGED:
                continue
            rescues += 1
            if rescues == DOUBT:
                alone.require_enough()
            # Where Newton could do nothing with the last rescue, the next one must go further.
            origin, last = _sound(problem, best, first), origin
            budget = 2 * budget if best is rescued or origin is last else self.rescue_products
            found, memory = rescue(
                problem,
                law,
                Start(origin, operator, memory, cold=False),
                self,
                budget=min(budget, max(self.max_products - operator.products, 1)),
                further=origin is last,
                reason=newton.stall(),
                history=history,
            )
            start.reached(history[-1])
            iterate, answer = self._checked(problem, law, operator, found)
            if answer is not None:
                return answer.solution(problem, history, operator.products, memory)
            vain = vain + 1 if origin is last and _same(rescued, iterate) else 0
            rescued, best, since_best = iterate, iterate, 0
        failure = ConvergenceError(self._failure(newton, operator, history, best), history)
        if rescues >= DOUBT:
            try:
                alone.require_enough(HARDLY_WEDGED)
            except InfeasibleError as reason:
                raise reason from failure
        raise failure

    def _checked(
        self, problem: DualProblem, law: SlipLaw, operator: CountedOperator, iterate: Iterate
    ) -> tuple[Iterate, Certificate | None]:
        """Recompute an iterate that claims to be the solution; certify it if it is. Collective."""
        if not iterate.residuals.within(self.tolerance):
            return iterate, None
        answer = certify(problem, operator, law, iterate.multiplier, iterate.residual)
        return answer.iterate, answer if answer.iterate.residuals.within(self.tolerance) else None

    def _failure(
        self, newton: NewtonSteps, operator: CountedOperator, history: list[SolverStep], best: Iterate
    ) -> str:
        """Say what was reached, why it went no further and what to try. Collective."""
        up = [operator.products >= self.max_products, len(history) >= self.max_steps]
        more = [f"raise {name}" for name, used in zip(("max_products", "max_steps"), up, strict=True) if used]
        last, rescues = history[-1], sum("rescue" in step.method for step in history)
        reached = (
            f"face Newton needs residuals below {self.tolerance:.1e}, got after {operator.products} products "
            f"and {len(history)} steps: {last}; the best was {best.residuals.worst:.1e}, {newton.stall()}, "
            f"and {rescues} rescues did not help"
        )
        if slides(history) and best.residuals.worst > HARDLY:
            ways = ["raise the friction", "lower the load", "add a support", *more]
            why = f"all {last.slip} discs slip, and friction may not suffice for any equilibrium; "
        else:
            ways = [*more, "start from the solution of a neighbouring load"]
            ways += ["loosen the tolerance if the best residual is near it", "use a FixedPoint of SMALSE"]
            why = ""
        return f"{reached}: {why}{', '.join(ways[:-1])}, or {ways[-1]}"


def _same(before: Iterate | None, after: Iterate) -> bool:
    """Tell whether two rescues led to one and the same iterate."""
    if before is None:
        return False
    worst = after.residuals.worst
    return abs(worst - before.residuals.worst) <= SAME * worst


def slides(history: Sequence[SolverStep]) -> bool:
    """Tell whether all discs slip, and have done so for a while."""
    late = history[-max(SLIDING, len(history) // 4) :]
    return bool(late) and all(step.slip > 0 and step.stick == 0 for step in late)


def _sound(problem: DualProblem, best: Iterate, first: Iterate) -> Iterate:
    """Return where a rescue starts: the first iterate where the best one is far from equilibrium.

    SMALSE finds back to equilibrium, proximal points keep what they are given.
    """
    lost = problem.preconditioner is not None and best.residuals.coarse > UNBALANCED
    return first if lost else best


@dataclass(frozen=True)
class ProjectedCG:
    """Projected preconditioned conjugate gradients for gluing and Dirichlet multipliers alone.

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_products: Give up after that many F-products.
        max_restarts: Runs after which to give up; more than one is needed only where rounding makes the
            carried residual differ from the recomputed one.
    """

    tolerance: float = 1e-9
    max_products: int = 5000
    max_restarts: int = 10

    def with_tolerance(self, tolerance: float) -> ProjectedCG:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InvalidInputError: There are contacts.
            ConvergenceError: Restarts or products were used up; carries the history.
        """
        contacts = round(float(global_sum(problem.comm, problem.layout.n_contact)[0]))
        if contacts:
            raise InvalidInputError(
                f"projected CG needs a problem without contact, got {contacts} contacts: use FaceNewton or "
                "Smalse"
            )
        newton = FaceNewton(
            tolerance=self.tolerance,
            max_products=self.max_products,
            max_steps=self.max_restarts,
            forcing=0.0,
            patience=self.max_restarts,
        )
        return newton.run(problem, law, start)
