"""What Newton's methods on faces share, and the steps of that on a dual problem.

Named steps on frozen states, forcing terms and damping are those of two methods: `FaceNewton` on a dual
problem, whose operator is constant, and `TangentNewton` of large deformations, whose tangents change. Only
operators and rules for a failed step differ. A step on a face classifies, solves its linear system,
equilibrates floating bodies and damps; one of rows that contradict each other gives way.

References:
    S. C. Eisenstat, H. F. Walker, Choosing the forcing terms in an inexact Newton method, SIAM J. Sci.
    Comput. 17 (1996). Z. Dostál, Optimal Quadratic Programming Algorithms, Springer (2009).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import ROUNDING
from fenics_contact.qp.face import Face, classify
from fenics_contact.qp.face_system import CoupledFace, FaceSystem, FaceSystems, couple
from fenics_contact.qp.krylov import FaceStep, Stop, never, projected_cg, projected_gmres
from fenics_contact.qp.problem import CountedOperator, DualProblem, RowsOfFace, ShiftedOperator
from fenics_contact.qp.reductions import Vector, global_least, global_sum
from fenics_contact.qp.rigid_motions import RigidMotionCorrection, keep_free_motions
from fenics_contact.qp.solution import (
    Iterate,
    Residuals,
    SolverStep,
    apply_unless_zero,
    contact_step,
    iterate_at,
    iterate_between,
)

State = TypeVar("State")
Answer = TypeVar("Answer", covariant=True)
Point = TypeVar("Point")


class NewtonMethod(Protocol[State, Answer]):
    """An inexact semismooth Newton method whose data pass from step to step in a frozen state.

    1. `terminate`: the answer where all residuals are small; an error where steps are used up.
    2. `step`: (a) the forcing term η, from how residuals fell, (b) the face that the natural map selects,
       (c) the linear system of the face, solved to η, (d) the step, damped where its end is worse,
       (e) progress, and what to do without.
    """

    def terminate(self, state: State) -> Answer | None:
        """Return the answer, None if a further step is needed. Collective."""

    def step(self, state: State) -> State:
        """Take one step. Collective."""


def run_newton(method: NewtonMethod[State, Answer], state: State) -> Answer:
    """Take steps until the method terminates. Collective."""
    while (answer := method.terminate(state)) is None:
        state = method.step(state)
    return answer


@dataclass(frozen=True)
class Forcing:
    """Forcing terms η, by choice 1 or 2 of Eisenstat and Walker.

    `largest`: largest tolerance relative to the residual; `loosest`: largest absolute tolerance; `tolerance`:
    that of the whole solve: no face is solved much more accurately.
    """

    largest: float
    loosest: float
    tolerance: float

    def at_most(self, largest: float, loosest: float) -> Forcing:
        """Return forcing terms that are no larger than these."""
        return replace(self, largest=min(self.largest, largest), loosest=min(self.loosest, loosest))

    def by_prediction(self, residuals: Residuals, mismatch: float, care: float) -> float:
        """Return the weighted residual at which a face is solved, by choice 1.

        `mismatch`: difference of the last residual from the one that its face predicted, relative to the
        residual before; infinite if the face has changed.
        """
        wanted = min(self.loosest, care * min(self.largest, mismatch) * residuals.worst)
        return max(wanted, 0.3 * self.tolerance)

    def by_reduction(self, worst: float, before: float | None, last: float, care: float) -> float:
        """Return the residual of a linear system relative to its start, by choice 2 with γ = 0.9."""
        term = self.largest
        if before and before < 1.0:
            safeguard = 0.9 * last**2
            term = min(term, max(0.9 * (worst / before) ** 2, safeguard if safeguard > 0.1 else 0.0))
        return care * max(term, 0.3 * self.tolerance / max(worst, self.tolerance))


@dataclass(frozen=True, eq=False)
class Damped(Generic[Point]):
    """The point that is taken and the fraction of the step that led to it."""

    point: Point
    fraction: float


def damp(
    full: Point,
    at: Callable[[float], Point],
    measured: Callable[[Point], Residuals],
    earlier: Iterable[Residuals],
    *,
    fractions: tuple[float, ...] = (0.5, 0.25, 0.1),
    shortest: tuple[float, ...] = (),
) -> Damped[Point]:
    """Return the end of a step, or the best of a few points on it if that is worse. Collective.

    Where the active set alternates between two faces the solution lies between them. The way to the right
    face may lead over a worse one: a full step is taken if it improves on either of the last two points.
    `earlier`: those of the last two points; `fractions`: parts of the step that are tried where its end is
    worse; `shortest`: more of them.
    """
    end = measured(full)
    if any(not end.is_worse_than(old) for old in earlier):
        return Damped(full, 1.0)
    tried = [Damped(full, 1.0), *(Damped(at(part), part) for part in (*fractions, *shortest))]
    return min(tried, key=lambda each: measured(each.point).worst_in_scales_with(end))


def residual_weights(face: Face, residuals: Residuals, step: Vector) -> Vector:
    """Return the weights that turn a residual on a face into the natural and the gluing residual."""
    gluing = residuals.gluing_scale or 1.0
    weights = np.sqrt(face.restriction.power(2).T @ step**2) * face.damping**2
    weights /= residuals.force_scale or np.inf
    return np.where(weights > 0.0, weights, 1.0 / gluing)


@dataclass(frozen=True, eq=False)
class Contradiction:
    """What rows demand of each other where B_Fᵀ N = 0: a node that sticks to a floor and touches a wall.

    There Nᵀr is the same for all multipliers of the face, and zero only where the rows agree. The dual
    objective falls without end along −N Nᵀr: forces grow until a disc slips or a contact opens. `excess`: the
    part of the residual on the face that no multiplier changes, owned; `direction`: change of the multiplier
    that lowers the objective and deforms nothing, owned; `group`: rows with the same number ≥ 0 are coupled,
    others are not.
    """

    excess: Vector
    direction: Vector
    group: npt.NDArray[np.int64]
    n_groups: int

    def relieved(self, problem: DualProblem, face: Face, multiplier: Vector, trial: Vector) -> Vector:
        """Return the multiplier with each group moved until the first of its contacts changes. Collective."""
        layout, moved, law = problem.layout, self.direction, problem.law
        longest: Vector = np.full(self.n_groups, np.inf)
        closed, discs = layout.normal[face.closed], layout.tangential[face.stick]
        pressing = law.growth(multiplier)[face.stick] * moved[layout.tangential_frictional[face.stick]]
        slipping = _until_slip(trial[discs], moved[discs], law.bound(multiplier)[face.stick], pressing)
        opening = _until_open(trial[closed], moved[closed])
        for rows, length in ((closed, opening), *((component, slipping) for component in discs.T)):
            coupled = self.group[rows] >= 0
            np.minimum.at(longest, self.group[rows[coupled]], length[coupled])
        longest = global_least(problem.comm, longest)
        part = np.append(np.where(np.isfinite(longest), longest * (1.0 + ROUNDING), 0.0), 0.0)
        return np.asarray(multiplier + part[self.group] * moved)


def contradiction(
    problem: DualProblem, system: FaceSystem, gradient: Vector, rigid: float = 1e-6
) -> Contradiction | None:
    """Return what no multiplier of a face changes in a residual; None where that is nothing. Collective.

    Forces that deform nothing may still push rigid surfaces that move freely, by more than ``rigid`` of them.
    """
    face, rows = system.face, system.preconditioner
    if not isinstance(rows, RowsOfFace):
        return None
    found = rows.contradiction(face.prolong(gradient))
    if found is None:
        return None
    excess, direction, group, count = found
    if problem.coarse.norm(problem.coarse.apply(direction)) > rigid * problem.norm(direction):
        return None
    return Contradiction(face.restrict(excess), direction, group, count)


def _until_open(trial: Vector, moved: Vector) -> Vector:
    """Return t ≥ 0 with w + t v = 0 for normal forces, infinite where they grow."""
    falls = moved < 0.0
    return np.where(falls, np.maximum(trial, 0.0) / np.where(falls, -moved, 1.0), np.inf)


def _until_slip(trial: Vector, moved: Vector, bound: Vector, pressing: Vector) -> Vector:
    """Return the least t ≥ 0 with ‖w + t v‖ = Ψ + t ψ for discs, infinite where there is none."""
    a = np.einsum("ia,ia->i", moved, moved) - pressing**2
    b = np.einsum("ia,ia->i", trial, moved) - bound * pressing
    c = np.minimum(np.einsum("ia,ia->i", trial, trial) - bound**2, 0.0)
    root = b * b - a * c
    divisor = b + np.sqrt(np.maximum(root, 0.0))
    reached = (root >= 0.0) & (divisor > 0.0)
    return np.where(reached, -c / np.where(reached, divisor, 1.0), np.inf)


def shorten(
    problem: DualProblem,
    before: Iterate,
    after: Iterate,
    earlier: Sequence[Residuals] = (),
    *,
    shortest: float = 0.01,
    near: float = 0.5,
) -> Damped[Iterate]:
    """Return the end of a step from one iterate to another, or the best of a few between. Collective.

    F λ and r are linear in λ and α, so no product is needed; the natural residual is not, and often has its
    minimum inside. Where the residual is below ``near``, the fraction ``shortest`` is tried, too: far from a
    solution, a step as short makes no progress.
    """
    return damp(
        after,
        lambda part: iterate_between(problem, before, after, part),
        lambda iterate: iterate.residuals,
        (before.residuals, *earlier),
        shortest=(shortest,) if before.residuals.worst < near else (),
    )


@dataclass(frozen=True)
class Safeguards:
    """Safeguards that keep Newton's method from cycling.

    `adapts_step`: whether the ρ of a disc whose friction force would turn by more than a right angle is
    reduced: it was too large, unless springs prescribe it; `reduction`: factor on that ρ; `moves_held`:
    whether floating bodies are equilibrated also where the face holds them all; `balanced`: imbalance up to
    which an iterate counts as in equilibrium; steps from others are not cut; `stuck`: part of a step after
    which the next one is not cut on the same face; `rounded`: where products are in single precision, least
    tolerance of a face relative to the residual; `flickering`: share of the contacts that open or close which
    go back, from which, without progress, a face is solved more accurately, by the factor `doubt`.
    """

    shorten: Callable[[DualProblem, Iterate, Iterate, Sequence[Residuals]], Damped[Iterate]] = shorten
    adapts_step: bool = True
    moves_held: bool = True
    reduction: float = 0.3
    longest_cycle: int = 6
    balanced: float = 1e-6
    stuck: float = 0.01
    rounded: float = 1e-5
    flickering: float = 0.4
    doubt: float = 0.003


@dataclass(frozen=True, eq=False)
class FaceState:
    """The data passed from one Newton step to the next.

    `step`: ρ of the natural map, 0 on equality rows, owned; `mismatch`: difference of the last residual from
    the one that its face predicted, relative to the residual before it; `fraction`: part of the last step
    that was taken.
    """

    iterate: Iterate
    step: Vector
    faces: tuple[Face, ...] = ()
    mismatch: float = 1.0
    earlier: tuple[Residuals, ...] = ()
    fraction: float = 1.0

    def pressing(self, problem: DualProblem) -> Vector:
        """Return the multiplier whose normal forces slip bounds follow, that of the iterate."""
        return self.iterate.multiplier

    def residual(self, problem: DualProblem) -> Vector:
        """Return the residual that selects the next face, that of the iterate."""
        return self.iterate.residual

    def stall(self, comm: MPI.Comm) -> str:
        """Describe why the last steps made no progress: a cycling or a stationary active set. Collective."""
        if len(self.faces) < 2:
            return "the residual stagnates"
        last, *earlier = self.faces
        changed = global_sum(comm, *[last.changes(face) for face in earlier])
        flickering = f"{round(float(changed[0]))} statuses changed in the last step"
        if changed[0] == 0.0:
            return "the residual stagnates on one face"
        if not np.all(changed):
            return f"the active set cycles with period {int(np.argmin(changed)) + 1}, {flickering}"
        return f"the active set does not settle, {flickering}"


@dataclass(frozen=True, eq=False)
class RestedState(FaceState):
    """The state before the first step from nothing: the multiplier does not depend on what touches."""

    def pressing(self, problem: DualProblem) -> Vector:
        """Return the trial multiplier, by which floating bodies came to rest, w = λ − ρ r."""
        trial = self.iterate.multiplier - self.step * self.iterate.residual
        return problem.compliance.pressed(trial, self.step)


@dataclass(frozen=True, eq=False)
class OpenState(FaceState):
    """The state before the first step from nothing where no body floats.

    Torn pieces have no place before their jumps are closed: which contacts their gaps select is arbitrary
    then, and those of a plate on a ball are opened a few at a time, 292 in 20 steps down to one. Only the
    closest ones may be among them.
    """

    def pressing(self, problem: DualProblem) -> Vector:
        """Return the multiplier without forces on contacts that are farther apart."""
        found = self.iterate.multiplier.copy()
        found[problem.layout.normal[problem.apart]] = 0.0
        return found

    def residual(self, problem: DualProblem) -> Vector:
        """Return one by which they do not close, w = λ − 2 |λ|."""
        found, apart = self.iterate.residual.copy(), problem.layout.normal[problem.apart]
        found[apart] = 2.0 * np.abs(self.iterate.multiplier[apart]) / self.step[apart]
        return found


@dataclass(frozen=True, eq=False)
class _SolvedFace:
    """The multiplier of a face with its product F λ, and how the Krylov method ended."""

    system: FaceSystem  # the symmetric system of the face
    # The system that was solved: the symmetric one, or that with growing friction.
    linear: FaceSystem | CoupledFace
    multiplier: Vector  # λ, owned
    product: Vector  # F λ, owned
    inner: FaceStep  # the step of the Krylov method
    # What rows of the face demand of each other beyond its tolerance; None where they agree.
    contradiction: Contradiction | None


@dataclass(frozen=True, eq=False)
class FaceSteps:
    """Newton's method on the faces of one problem: `init` makes the first state, `step` the following ones.

    `natural_step`: ρ = 1/diag F, 0 on equality rows, owned; `correction`: moves floating bodies into
    equilibrium.
    """

    problem: DualProblem
    operator: CountedOperator | ShiftedOperator
    forcing: Forcing
    max_products: int
    safeguards: Safeguards
    natural_step: Vector
    systems: FaceSystems
    correction: RigidMotionCorrection

    @classmethod
    def build(
        cls,
        problem: DualProblem,
        operator: CountedOperator | ShiftedOperator,
        forcing: Forcing,
        max_products: int,
        safeguards: Safeguards | None = None,
    ) -> FaceSteps:
        """Prepare the coarse spaces of all faces. Collective."""
        return cls(
            problem,
            operator,
            forcing,
            max_products,
            safeguards or Safeguards(),
            contact_step(problem.layout, problem.diagonal),
            FaceSystems(problem, operator),
            RigidMotionCorrection.build(problem),
        )

    def moved(self, problem: DualProblem) -> FaceSteps:
        """Return the method for a problem that differs only in its right side or law."""
        return replace(self, problem=problem, correction=replace(self.correction, problem=problem))

    def init(self, iterate: Iterate) -> FaceState:
        """Return the state before the first step."""
        return FaceState(iterate, self.natural_step)

    def from_rest(self, iterate: Iterate) -> FaceState:
        """Return the state before the first step from nothing, in which floating bodies came to rest."""
        kind = RestedState if self.correction.motions.size else OpenState
        return kind(iterate, self.natural_step)

    def at_rest(self, iterate: Iterate) -> Iterate:
        """Return an iterate of another load or position with floating bodies in equilibrium. Collective."""
        problem = self.problem
        alpha = iterate.motions(problem)
        alpha = alpha + self.correction(iterate.multiplier, iterate.residual, self.natural_step)
        return iterate_at(problem, iterate.multiplier, iterate.product, alpha)

    def step(self, state: FaceState, number: int, care: float = 1.0) -> tuple[FaceState, SolverStep]:
        """Take one step and return the state after it with its line of history. Collective."""
        before = state.iterate
        # (b) The face that the natural map selects, and the number of status changes since the last one.
        pressing = state.pressing(self.problem)
        step, face = self._next_face(state, pressing)
        count = face.changes(state.faces[0]) if state.faces else 0
        changed = round(float(global_sum(self.problem.comm, count)[0]))
        flickers = self._flickers((face, *state.faces))
        stalls = any(before.residuals.worst > 0.5 * each.worst for each in state.earlier)
        care *= self.safeguards.doubt if flickers and stalls else 1.0
        # (a), (c) Its solution, as accurate as the last face's prediction warrants.
        mismatch = np.inf if changed else state.mismatch
        tolerance = self.forcing.by_prediction(before.residuals, mismatch, care)
        if self.problem.exact is not None:
            tolerance = max(tolerance, self.safeguards.rounded * before.residuals.worst)
        solved = self._solve(face, before, pressing, tolerance, predicted=not changed)
        # (d) Rigid motions, then the damped step.
        alpha = self._motions(solved, state, step)
        after = iterate_at(self.problem, self._relieved(solved, alpha, step), solved.product, alpha)
        mismatch = abs(after.residuals.size - solved.inner.measure) / (before.residuals.size or 1.0)
        # Loads may not balance a start, whose residuals are then no measure: no part leads into equilibrium.
        # Nor does a second short step on the same face: where two faces meet, each step aims beyond it.
        stuck = state.fraction <= self.safeguards.stuck and changed == 0
        whole = stuck or before.residuals.coarse > self.safeguards.balanced
        taken = Damped(after, 1.0)
        if not whole:
            taken = self.safeguards.shorten(self.problem, before, after, state.earlier)
        # A copy without Z and what else was computed on the face: of earlier ones only the marks are of use.
        faces = (replace(face), *state.faces[: self.safeguards.longest_cycle])
        following = FaceState(taken.point, step, faces, mismatch, (before.residuals,), taken.fraction)
        return following, self._record(number, taken, solved, changed)

    def _flickers(self, faces: Sequence[Face]) -> bool:
        """Return whether many of the contacts that open or close go back, twice in turn. Collective.

        Then a face is solved less accurately than what touches there is small, as at the edges of thin
        plates that press each other, or even without any force, and statuses are those of rounding.
        """
        if len(faces) < 4:
            return False
        now, last, before, first = (each.closed for each in faces[:4])
        changes = now != last, last != before
        counts = [changes[0], changes[0] & (now == before), changes[1], changes[1] & (last == first)]
        found = global_sum(self.problem.comm, *map(np.count_nonzero, counts))
        return bool((found[1::2] > self.safeguards.flickering * found[::2]).all())

    def _next_face(self, state: FaceState, pressing: Vector) -> tuple[Vector, Face]:
        """Classify, with a smaller ρ for discs whose force would otherwise reverse."""
        layout, iterate = self.problem.layout, state.iterate
        bound, residual = self.problem.law.bound(pressing), state.residual(self.problem)
        soft = self.problem.compliance
        face = classify(layout, bound, iterate.multiplier, residual, state.step, soft)
        if not state.faces or not self.safeguards.adapts_step:
            return state.step, face
        turned = np.einsum("ia,ia->i", face.direction, state.faces[0].direction) < 0.0
        step = state.step.copy()
        step[layout.tangential[turned]] *= self.safeguards.reduction
        return step, classify(layout, bound, iterate.multiplier, iterate.residual, step, soft)

    def _solve(
        self, face: Face, before: Iterate, pressing: Vector, tolerance: float, *, predicted: bool
    ) -> _SolvedFace:
        """Solve the linear system of a face, in which slipping forces grow with normal forces. Collective.

        `pressing`: multiplier of the slip bounds; `predicted`: whether the tolerance is by a prediction of
        the face, which may turn out wrong: it is solved no further than other residuals allow.
        """
        problem = self.problem
        system = self.systems.build(face)
        linear = couple(system, problem.coarse, problem.law.growth(pressing), pressing) or system
        # Onto the face and into equilibrium; the Krylov method preserves both.
        entered = linear.enter(before.multiplier)
        product = before.product + apply_unless_zero(problem, self.operator, entered - before.multiplier)
        gradient = system.gradient(entered, product - problem.rhs)
        weights = residual_weights(face, before.residuals, self.natural_step)
        contrary = self._contradiction(system, gradient)
        if contrary is not None:
            gradient = gradient - contrary.excess
            if system.weighted_norm(contrary.excess, weights) <= tolerance:
                contrary = None
        limit = max(self.max_products - self.operator.products, 1)

        seen: list[float] = []

        def enough(found: Callable[[], tuple[Vector, Vector]], size: float) -> bool:
            step, image = found()
            moved, whole = entered + linear.advance(step), product + image
            alpha = self._fitted(system, linear, moved, whole, before)
            residuals = iterate_at(problem, moved, whole, alpha).residuals
            seen.append(residuals.size_in_scales_of(before.residuals))
            # What falls with the linear residual is due to that.
            left = len(seen) > 1 and seen[-1] > 0.5 * seen[-2]
            return left and size <= self.forcing.largest * seen[-1]

        # Rows that contradict each other have a residual that no step changes; where nothing presses there is
        # no force to measure others by.
        asked = predicted and contrary is None and before.residuals.natural > 0.0
        ends = enough if asked else never
        if isinstance(linear, CoupledFace):
            inner = projected_gmres(linear.coupled, gradient, weights, tolerance, limit, ends)
        else:
            inner = projected_cg(linear, gradient, weights, tolerance, limit, ends)
        multiplier, product = entered + linear.advance(inner.step), product + inner.product
        return _SolvedFace(system, linear, multiplier, product, inner, contrary)

    def _contradiction(self, system: FaceSystem, gradient: Vector) -> Contradiction | None:
        """Return what rows demand of each other; none does that gives way. Collective."""
        if self.operator.gives_way or self.problem.compliance.gives_way:
            return None
        return contradiction(self.problem, system, gradient)

    def _relieved(self, solved: _SolvedFace, alpha: Vector, step: Vector) -> Vector:
        """Return the multiplier of a face, at which one of contradicting rows gives way. Collective."""
        if solved.contradiction is None:
            return solved.multiplier
        residual = solved.product - self.problem.rhs - self.problem.coarse.transpose(alpha)
        trial, face = solved.multiplier - step * residual, solved.system.face
        return solved.contradiction.relieved(self.problem, face, solved.multiplier, trial)

    def _motions(self, solved: _SolvedFace, state: FaceState, step: Vector) -> Vector:
        """Return α after a step: from the rows of the face, then in equilibrium. Collective.

        A motion that lets go of what presses leaves those to the face that contacts hold.
        """
        problem, system = self.problem, solved.system
        alpha = self._fitted(system, solved.linear, solved.multiplier, solved.product, state.iterate)
        held = system.coarse.gram.rank == problem.coarse.m
        if held and not self.safeguards.moves_held:
            return alpha
        residual = solved.product - problem.rhs - problem.coarse.transpose(alpha)
        moved = self.correction(solved.multiplier, residual, step)
        if held and self._lets_go(solved, state, residual - problem.coarse.transpose(moved), step):
            closed = problem.layout.normal[system.face.closed]
            moved = self.correction(solved.multiplier, residual, step, closed)
        return np.asarray(alpha + moved, dtype=np.float64)

    def _lets_go(self, solved: _SolvedFace, state: FaceState, residual: Vector, step: Vector) -> bool:
        """Return whether a residual leaves less than half of the contacts that press on a face. Collective.

        In the first step, whose face is a guess, others may close in their place.
        """
        rows, force = self.problem.layout.normal, solved.multiplier
        presses = solved.system.face.closed & (force[rows] > 0.0)
        closes = force[rows] > step[rows] * residual[rows]
        left = closes & presses if state.faces else closes
        after, pressing = global_sum(self.problem.comm, *map(np.count_nonzero, (left, presses)))
        return bool(after < 0.5 * pressing)

    def _fitted(
        self,
        system: FaceSystem,
        linear: FaceSystem | CoupledFace,
        multiplier: Vector,
        product: Vector,
        before: Iterate,
    ) -> Vector:
        """Return α of a multiplier of a face, from the rows of the face. Collective."""
        alpha = linear.motions(system.gradient(multiplier, product - self.problem.rhs))
        if system.coarse.gram.null_space.shape[1] == 0:
            return alpha
        return keep_free_motions(system.coarse, before.motions(self.problem), alpha)

    def _record(self, number: int, taken: Damped[Iterate], solved: _SolvedFace, changed: int) -> SolverStep:
        inner, face, coarse = solved.inner, solved.system.face, solved.system.coarse
        closed, stick, slip = face.counts(self.problem.comm)
        note = f"{inner.iterations} CG steps, {changed} status changes"
        if solved.contradiction is not None:
            note += ", rows that contradict each other"
        if taken.fraction < 1.0:
            note += f", cut to {taken.fraction:g} of the step"
        if inner.stop is not Stop.CONVERGED:
            note += f", {inner.stop.value}"
        if coarse.gram.rank < coarse.m:
            note += f", {coarse.m - coarse.gram.rank} rigid motions not held by the face"
        residuals, products = taken.point.residuals, self.operator.products
        return SolverStep("face Newton", number, products, residuals, closed, stick, slip, note)
