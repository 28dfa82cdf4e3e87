"""Semismooth Newton on faces: its state, steps and stopping rules, and the test whether friction suffices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NoReturn

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError
from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.newton_steps import FaceState, FaceSteps, Forcing, run_newton
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import Vector, global_max, global_sum
from fenics_contact.qp.rescue import Rescue, Rescued
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import (
    Certificate,
    DualSolution,
    Iterate,
    SmalseMemory,
    SolverStep,
    Start,
    StoppedError,
    apply_unless_zero,
    certify,
    iterate_fitted,
)
from fenics_contact.qp.solve import Equilibrium, find_equilibrium


def without_contact(history: Sequence[SolverStep], count: int, plain: float = 1e-2) -> bool:
    """Return whether contacts that alone balance the load stayed open in the last ``count`` steps.

    Gaps are reliable if jumps are smaller than ``plain``, and bodies are unheld if that much of the load is
    unbalanced.
    """
    late = history[-count:]
    return len(late) == count and all(_open(step, plain) for step in late)


def _open(step: SolverStep, plain: float) -> bool:
    residuals = step.residuals
    lost = step.closed == 0 and residuals.natural == 0.0 and residuals.gluing < plain < residuals.coarse
    return lost and "rescue" not in step.method


def error_without_contact(step: SolverStep) -> InfeasibleError:
    """Return the error of a problem whose contacts stay open, given the last step."""
    return InfeasibleError(
        "every loaded body must be held, but all contacts stay open, and "
        f"{100 * step.residuals.coarse:.2g} % of the load drive motions that only contact or "
        "friction could hold: close the gaps, support the bodies or press them together"
    )


class SlidingError(InfeasibleError):
    """The load is more than friction carries while bodies slide.

    Attributes:
        share: Part of the load's work that friction takes up.
        motion: Coefficients of the rigid motion, shape (m,).
    """

    def __init__(self, share: float, motion: Vector, words: str = "bodies slide") -> None:
        """Store the motion; ``words`` say which bodies move."""
        super().__init__(
            f"every body must be held by supports, contact or friction, but {words}, and friction carries "
            f"only {100 * round(share, 9):.3g} % of the load against it: support what slides, press it, "
            "lower the load or raise the friction coefficient"
        )
        self.share, self.motion = share, motion

    def named(self, words: str) -> SlidingError:
        """Return the error in other words for what moves."""
        return SlidingError(self.share, self.motion, words)


@dataclass(frozen=True, eq=False)
class FrictionAlone:
    """Test whether friction can hold what nothing else holds; used where a solver makes no progress.

    `wedged`: wedging friction may itself press surfaces together: at most by this factor on the other normal
    forces.
    """

    problem: DualProblem
    solve: Callable[[DualProblem, Start], DualSolution]
    wedged: float = 100.0

    def require_enough(self) -> None:
        """Reject a problem whose friction is far from sufficient. Collective.

        If even `wedged` times the slip bounds of the forces without friction cannot balance the load,
        friction is taken to hold nothing, as where supports keep the surfaces apart. That is not a proof.
        """
        if self._forces is None:
            return
        equilibrium = self._under(self.wedged * self.problem.law.bound(self._forces))
        if not equilibrium.may_exist:
            raise InfeasibleError(
                "friction needs surfaces that are pressed together, without friction even "
                f"{self.wedged:g} times the forces leave {100 * equilibrium.error:.2g} % of it: press them"
            )

    def require_enough_sliding(self, start: Vector | None, settled: float = 1e-2, times: int = 20) -> None:
        """Reject a problem in which what only friction holds goes on sliding. Collective.

        With friction along the motion that it resists least, bodies are pressed otherwise than without; with
        the slip bounds of these forces that motion is another one, and so on. If friction then bears less
        than the load, bodies accelerate. Forces of the last load may hold bodies where they were driven in.
        They are computed ``times`` times at most, until friction carries the same to ``settled``.
        """
        layout, before = self.problem.layout, np.inf
        forces = self._forces if start is None or self._forces is None else start
        for _ in range(times):
            if forces is None or (equilibrium := self._under(self.problem.law.bound(forces))).motion is None:
                return
            share, motion = self._borne(equilibrium.motion, forces)
            if not share < 1.0:
                return
            if abs(share - before) <= settled * share:
                raise SlidingError(share, motion)
            friction, before = np.zeros(layout.size), share
            friction[layout.tangential] = equilibrium.multiplier[layout.tangential]
            forces = self._pressed(friction)

    def _under(self, bound: Vector) -> Equilibrium:
        """Look for admissible forces in equilibrium under slip bounds. Collective."""
        return find_equilibrium(self.problem.with_law(TrescaLaw(self.problem.layout, bound)))

    def _borne(self, motion: Vector, forces: Vector) -> tuple[float, Vector]:
        """Return the part of the load's work on a motion that friction takes up, and the motion. Collective.

        The motion without what other contacts resist; the part is infinite where little is left of it.
        """
        problem, coarse, unheld = self.problem, self.problem.coarse, self._unheld
        free = unheld @ (unheld.T @ motion)
        free *= np.sign(coarse.load @ free)
        slip = np.linalg.norm(coarse.transpose(free)[problem.layout.tangential], axis=1)
        friction = float(global_sum(problem.comm, problem.law.bound(forces) @ slip)[0])
        work = float(coarse.load @ free)
        return (friction / work if work > 0.5 * abs(coarse.load @ motion) else np.inf), free

    @cached_property
    def _unheld(self) -> Vector:
        """Rigid motions that only friction resists, orthonormal, shape (m, n). Collective on first use."""
        layout, coarse = self.problem.layout, self.problem.coarse
        rows = np.concatenate([layout.equality, layout.normal])
        entries = (np.ones(len(rows)), (rows, np.arange(len(rows))))
        pressing = coarse.restricted(sp.csr_matrix(entries, shape=(layout.size, len(rows))))
        return np.asarray(np.linalg.qr(pressing.gram.null_space)[0])

    @cached_property
    def _forces(self) -> Vector | None:
        """The multiplier without friction; None where no friction grows with it or the solve fails.

        Collective on first use.
        """
        problem = self.problem
        if global_max(problem.comm, float(problem.law.grows)) == 0.0:
            return None
        return self._pressed(np.zeros(problem.layout.size))

    def _pressed(self, friction: Vector) -> Vector | None:
        """Return the multiplier with friction forces, owned; None where the solve fails. Collective.

        The bodies are held in all motions that only friction resists, and nothing rubs otherwise, where no
        friction is given but the part that does not grow with the normal force.
        """
        problem, layout, coarse = self.problem, self.problem.layout, self.problem.coarse
        operator = CountedOperator(problem.operator)
        product = apply_unless_zero(problem, operator, friction)
        rubs = problem.norm(friction) > 0.0
        bound = problem.law.bound(np.zeros(layout.size)) * (not rubs)
        load = coarse.load - coarse.apply(friction)
        loaded = coarse.with_load(load - self._unheld @ (self._unheld.T @ load))
        law = TrescaLaw(layout, bound)
        held = replace(problem, coarse=loaded, rhs=problem.rhs - product, friction=law)
        multiplier = held.coarse.particular()
        product = apply_unless_zero(held, operator, multiplier)
        start = Start(iterate_fitted(held, multiplier, product), operator)
        try:
            return self.solve(held, start).multiplier + friction
        except (ConvergenceError, InfeasibleError):
            return None


@dataclass(frozen=True)
class FaceNewton:
    """Faces by the natural map w = λ − ρ r, each solved by projected preconditioned CG.

    On a face G λ = e holds exactly, so there is no loop for equilibrium. The inner tolerance follows the
    outer residual and, once no contact changes, tightens with the quality of the last face's prediction. With
    Coulomb's law the slip bound is updated in every step, and the friction of slipping discs grows with the
    normal force within the step: a single loop.

    Floating bodies come to rest before the first step and after every one (`RigidMotionCorrection`): their
    motions balance the load with the forces of the next guess. A cold start knows nothing of contact: its
    first slip bounds follow these forces, and where no body floats only the closest contacts may be closed.
    Three further safeguards keep the active set from cycling. A disc whose friction force would turn by more
    than a right angle has too large a ρ, which is reduced until the force keeps its direction or the disc
    sticks. A step that is worse than the last two iterates is shortened, at no cost in products. Steps
    without progress are followed by a rescue from the best iterate so far, by proximal points, whose convex
    potential a line search descends (`qp.rescue`), or without a preconditioner by SMALSE where bodies float;
    the history reports whether the active set cycled or the residual stagnated. No result is accepted before
    its residuals are recomputed.

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_steps: Largest number of Newton steps and rescues.
        max_products: Largest number of F-products.
        forcing: Largest inner tolerance relative to the outer residual.
        loosest: Largest absolute inner tolerance.
        patience: Steps in which the residual must halve before a rescue is called.
        care: Factor on the inner tolerance after each step without progress beyond ``careful_after``: where
            forces vanish in the limit, residuals relative to them do not measure the accuracy of the gaps.
        careful_after: Steps without progress that do not tighten the inner tolerance yet.
        rescue: Parameters of SMALSE in rescues.
        rescue_products: Products that a rescue may use; doubled each time Newton fails again.
        repairable: Relative imbalance up to which a rescue starts from the best iterate: proximal points
            preserve equilibrium and do not restore it. From more the first iterate is the start.
        max_vain: Consecutive rescues to the same iterate after which to stop.
        max_rescues: Rescues after which to stop where one more is needed.
        doubts: Whether to ask, without progress, if friction can suffice at all: more solves, of no use
            where another load is tried after any failure.
        doubted_rescue: Number of the rescue before which that is asked: the first ones mostly help.
        doubt_tolerance: Tolerance of the solves without friction of that test.
        drift: Where products are in single precision, F λ is computed in double anew whenever the residual
            has fallen by this factor: its rounding would else be found at the end, for another step.

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
    care: float = 0.25
    rescue: Smalse = field(default_factory=Smalse)
    rescue_products: int = 300
    doubts: bool = True
    careful_after: int = 2
    repairable: float = 1e-6
    max_vain: int = 7
    max_rescues: int = 200
    doubted_rescue: int = 4
    doubt_tolerance: float = 1e-3
    drift: float = 1e-3

    def with_tolerance(self, tolerance: float) -> FaceNewton:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    @property
    def without_rescue(self) -> FaceNewton:
        """The method that stops where it would need a rescue."""
        return replace(self, max_rescues=0)

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InfeasibleError: Some body is held only by contacts that stay open, or by too little friction; if
                that is detected after all else failed, its cause carries the history.
            ConvergenceError: Steps or products were used up; carries the history.
        """
        run = _Run.build(self, problem, start)
        return run_newton(run, run.init())


class _NoRescue:
    """There was no rescue yet."""

    vain: int = -1

    def repeats(self, origin: Iterate) -> bool:
        """Return whether one from an iterate begins where the last one did."""
        return False

    def budget_after(self, usual: int, origin: Iterate, best: Iterate) -> int:
        """Return the products of one from an iterate."""
        return usual

    def vain_after(self, origin: Iterate, result: Iterate) -> int:
        """Return how many, including one with a result, led to the same iterate."""
        return 0


NO_RESCUE = _NoRescue()


@dataclass(frozen=True, eq=False)
class _LastRescue(_NoRescue):
    """The data of the last rescue that the next one needs."""

    origin: Iterate  # its initial iterate
    result: Iterate  # its final iterate
    budget: int  # products that it was allowed
    vain: int  # consecutive rescues, including this one, that led to the same iterate

    def repeats(self, origin: Iterate) -> bool:
        return origin is self.origin

    def budget_after(self, usual: int, origin: Iterate, best: Iterate) -> int:
        return 2 * self.budget if self.repeats(origin) or best is self.result else usual

    def vain_after(self, origin: Iterate, result: Iterate) -> int:
        return self.vain + 1 if self.repeats(origin) and _same(self.result, result) else 0


@dataclass(frozen=True, eq=False)
class _State:
    """State of a solve by face Newton."""

    newton: FaceState  # the present iterate, with faces and ρ
    best: Iterate  # the last iterate that halved the residual, or the outcome of a later rescue
    memory: SmalseMemory | None  # estimates from SMALSE
    history: tuple[SolverStep, ...] = ()  # one line per step or rescue
    since_best: int = 0  # Newton steps since the best iterate
    care: float = 1.0  # factor on the tolerance of the next face
    rescues: int = 0
    last_rescue: _NoRescue = NO_RESCUE
    exact_at: float = 1.0  # residual where the product was last computed in double precision
    answer: Certificate | None = None  # the certified solution, once there is one
    least: Iterate | None = None  # the iterate with the least residual of all, None before the first step

    def seen(self, iterate: Iterate) -> Iterate:
        """Return the least of an iterate and all before it."""
        least = self.least or self.best
        now = iterate.residuals.worst_in_scales_with(least.residuals)
        return iterate if now < least.residuals.worst_in_scales_with(iterate.residuals) else least


@dataclass(frozen=True, eq=False)
class _Run:
    """One solve by face Newton: the data that all its steps share."""

    parameters: FaceNewton
    problem: DualProblem
    start: Start
    steps: FaceSteps  # Newton's method
    rescue: Rescue  # the fallback when that stagnates
    friction_alone: FrictionAlone  # the test whether friction can suffice

    @classmethod
    def build(cls, parameters: FaceNewton, problem: DualProblem, start: Start) -> _Run:
        """Prepare a solve. Collective."""
        most = parameters.max_products
        forcing = Forcing(parameters.forcing, parameters.loosest, parameters.tolerance)
        steps = FaceSteps.build(problem, start.operator, forcing, most)
        products = 10 * parameters.rescue_products
        rough = replace(parameters, tolerance=parameters.doubt_tolerance, max_products=products)
        rescue = Rescue(problem, forcing, most, parameters.rescue)
        start = replace(start, iterate=steps.at_rest(start.iterate))
        return cls(parameters, problem, start, steps, rescue, FrictionAlone(problem, rough.run))

    def init(self) -> _State:
        """Return the state before the first step."""
        first = self.start.iterate
        begin = self.steps.from_rest if self.start.cold else self.steps.init
        return _State(begin(first), first, self.start.memory)

    def terminate(self, state: _State) -> DualSolution | None:
        """Return the certified solution, None if a further step is needed. Collective."""
        parameters, products = self.parameters, self.start.operator.products
        if state.answer is not None:
            return state.answer.solution(state.history, products, state.memory)
        in_vain = state.last_rescue.vain >= parameters.max_vain
        if in_vain or len(state.history) >= parameters.max_steps or products >= parameters.max_products:
            self._fail(state)
        return None

    def step(self, state: _State) -> _State:
        """Take a Newton step; without progress a rescue follows. Collective."""
        # (a)-(d) Forcing term, face, linear system, damped step: see `FaceSteps.step`.
        newton, line = self.steps.step(state.newton, len(state.history), state.care)
        history = (*state.history, line)
        self.start.reached(line)
        iterate, answer = self._checked(newton.iterate, state.exact_at)
        exact_at = state.exact_at if iterate is newton.iterate else iterate.residuals.worst
        newton = replace(newton, iterate=iterate)
        least = state.seen(iterate)
        state = replace(state, newton=newton, history=history, answer=answer, exact_at=exact_at, least=least)
        if answer is not None:
            return state
        lost = without_contact(history, self.parameters.patience)
        if lost and state.rescues:  # an active set may also lose bodies that contact can hold
            raise error_without_contact(line)
        # (e) Progress: without any, faces are solved more accurately, and at last a rescue is called.
        best, now = state.best.residuals, iterate.residuals
        if now.worst_in_scales_with(best) < 0.5 * best.worst_in_scales_with(now):
            state = replace(state, best=iterate, since_best=0, care=1.0)
        else:
            careful = state.since_best >= self.parameters.careful_after
            factor = self.parameters.care if careful else 1.0
            state = replace(state, since_best=state.since_best + 1, care=factor * state.care)
        stuck = (
            lost
            or state.since_best >= self.parameters.patience
            or not np.isfinite(now.worst_in_scales_with(best))
        )
        return self._rescued(state) if stuck else state

    def _rescued(self, state: _State) -> _State:
        """Continue from the best iterate improved by a rescue. Collective."""
        if state.rescues >= self.parameters.max_rescues:
            self._fail(state)
        if self.parameters.doubts and state.rescues + 1 == self.parameters.doubted_rescue:
            self.friction_alone.require_enough()
        if self.parameters.doubts and state.rescues == 1 and slides(state.history):
            self._require_enough_sliding()
        operator, last = self.start.operator, state.last_rescue
        origin = self._rescue_start(state.best)
        # If Newton made no progress from the last rescue, the next one must go further.
        budget = last.budget_after(self.parameters.rescue_products, origin, state.best)
        left = max(self.parameters.max_products - operator.products, 1)
        begin = Start(origin, operator, state.memory, cold=False)
        enough = self.rescue.reduction if last.repeats(origin) else np.inf
        outcome = self.rescue(begin, min(budget, left), enough=enough, number=state.rescues)
        line = self._line(state, origin, outcome)
        self.start.reached(line)
        iterate, answer = self._checked(outcome.iterate, state.exact_at)
        return replace(
            state,
            newton=replace(state.newton, iterate=iterate),
            best=iterate,
            least=state.seen(iterate),
            memory=outcome.memory,
            history=(*state.history, line),
            since_best=0,
            rescues=state.rescues + 1,
            last_rescue=_LastRescue(origin, iterate, budget, last.vain_after(origin, iterate)),
            answer=answer,
        )

    def _fail(self, state: _State) -> NoReturn:
        """Raise the error of a solve that is exhausted. Collective."""
        failure = StoppedError(self._failed(state), state.history, state.least or state.best)
        if self.parameters.doubts and state.rescues >= self.parameters.doubted_rescue:
            try:
                self._require_enough_sliding()
            except InfeasibleError as reason:
                raise reason from failure
        raise failure

    def _require_enough_sliding(self) -> None:
        """Reject a problem whose friction does not stop what slides. Collective."""
        start = None if self.start.cold else self.start.iterate.multiplier
        self.friction_alone.require_enough_sliding(start)

    def _rescue_start(self, best: Iterate) -> Iterate:
        """Return the start of a rescue: the first iterate if the best one is far from equilibrium.

        SMALSE restores equilibrium, proximal points only preserve it.
        """
        lost = best.residuals.coarse > self.parameters.repairable
        return self.start.iterate if lost and self.problem.preconditioner is not None else best

    def _line(self, state: _State, origin: Iterate, outcome: Rescued) -> SolverStep:
        """Return the line of history of a rescue, with its reason. Collective."""
        reached = "met its target" if outcome.reached else "used its budget"
        reason = state.newton.stall(self.problem.comm)
        note = f"rescue from {origin.residuals.worst:.1e} because {reason}: {reached}"
        return replace(outcome.line, iteration=len(state.history), note=note)

    def _checked(self, iterate: Iterate, exact_at: float) -> tuple[Iterate, Certificate | None]:
        """Recompute the residuals of an apparent solution; certify it if they confirm it. Collective.

        `exact_at`: the residual where the product was last computed in double precision.
        """
        tolerance, worst = self.parameters.tolerance, iterate.residuals.worst
        drifted = self.problem.exact is not None and worst < self.parameters.drift * exact_at
        if not (drifted or iterate.residuals.within(tolerance)):
            return iterate, None
        product = self.start.operator.exactly(iterate.multiplier)
        answer = certify(self.problem, iterate.multiplier, product, iterate.residual)
        return answer.iterate, answer if answer.iterate.residuals.within(tolerance) else None

    def _failed(self, state: _State) -> str:
        """Describe what was reached, why it went no further and what to try. Collective."""
        parameters, products, history = self.parameters, self.start.operator.products, state.history
        up = [products >= parameters.max_products, len(history) >= parameters.max_steps]
        more = [f"raise {name}" for name, used in zip(("max_products", "max_steps"), up, strict=True) if used]
        best = (state.least or state.best).residuals.worst
        last = history[-1] if history else "none of them was left for a step"
        reached = (
            f"face Newton needs residuals below {parameters.tolerance:.1e}, got after {products} products "
            f"and {len(history)} steps: {last}; the best was {best:.1e}, "
            f"{state.newton.stall(self.problem.comm)}, and {state.rescues} rescues did not help"
        )
        if slides(history) and best > 1e-2:  # no approximate solution at all
            ways = ["raise the friction", "lower the load", "add a support", *more]
            why = f"all {history[-1].slip} discs slip, and friction may not suffice for any equilibrium; "
        else:
            ways = [*more, "start from the solution of a neighbouring load"]
            ways += ["loosen the tolerance if the best residual is near it", "use InTurn"]
            why = ""
        return f"{reached}: {why}{', '.join(ways[:-1])}, or {ways[-1]}"


def _same(before: Iterate, after: Iterate, difference: float = 1e-6) -> bool:
    """Return whether two rescues led to the same iterate, by its residual."""
    worst = after.residuals.worst
    return abs(worst - before.residuals.worst) <= difference * worst


def slides(history: Sequence[SolverStep], count: int = 5) -> bool:
    """Return whether all discs slip, and have done so for ``count`` steps and a quarter of all.

    A single such step occurs on the way to states that stick.
    """
    late = history[-max(count, len(history) // 4) :]
    return bool(late) and all(step.slip > 0 and step.stick == 0 for step in late)


@dataclass(frozen=True)
class ProjectedCG:
    """Projected preconditioned conjugate gradients for gluing and Dirichlet multipliers alone.

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_products: Largest number of F-products.
        max_restarts: Largest number of runs; more than one is needed only where rounding makes the recursive
            residual differ from the recomputed one.
    """

    tolerance: float = 1e-9
    max_products: int = 5000
    max_restarts: int = 10

    def with_tolerance(self, tolerance: float) -> ProjectedCG:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InvalidInputError: There are contacts.
            ConvergenceError: Restarts or products were used up; carries the history.
        """
        contacts = round(float(global_sum(problem.comm, problem.layout.n_contact)[0]))
        if contacts:
            raise InvalidInputError(f"projected CG needs no contact, got {contacts}: use FaceNewton")
        newton = FaceNewton(
            tolerance=self.tolerance,
            max_products=self.max_products,
            max_steps=self.max_restarts,
            forcing=0.0,
            patience=self.max_restarts,
        )
        return newton.run(problem, start)
