"""Newton steps on faces: classify, solve the linear face, settle floating bodies, go as far as it pays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.qp.face import Face, classify
from fenics_contact.qp.face_system import CoupledFace, FaceSystem, FaceSystems, couple
from fenics_contact.qp.iterate import Iterate, apply_unless_zero, iterate_at
from fenics_contact.qp.krylov import FaceStep, Stop, projected_cg, projected_gmres
from fenics_contact.qp.problem import CountedOperator, DualProblem, ShiftedOperator
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.settling import Settling, keep_unheld
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import Residuals, SolverStep, contact_step, measure

if TYPE_CHECKING:
    from fenics_contact.qp.face_newton import FaceNewton


FRACTIONS = (0.5, 0.25, 0.1)
#: Taken only near a solution: far from one, a step as short as this stays where nothing is known yet.
SHORTEST = 0.01
#: The largest relative residual that counts as near.
NEAR = 0.5
#: The whole step is taken where the potential rises at its end by less than this fraction of its first fall.
STEEP = 0.3
#: The slope at which a minimum of the potential counts as found, relative to the first one.
LEVEL = 0.1
#: Gluing residual from which on bodies are in pieces, and their potential says nothing.
TORN = 0.1


@dataclass(frozen=True, eq=False)
class Damped:
    """The iterate that was kept and the fraction of the step that led to it."""

    iterate: Iterate
    fraction: float


def damp(
    problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate, earlier: Residuals | None = None
) -> Damped:
    """Return the best of a few points between two iterates if the second is worse than the first. Collective.

    F λ and r are linear in λ and α, so no product is spent; the natural residual is not, and often has its
    minimum inside: where the active set alternates between two faces the solution lies between them. The
    way to the right face may lead over a worse one: a step is whole that improves on either of two.

    Args:
        problem: The dual problem.
        law: Where the slip bound comes from.
        before: Where the step began.
        after: Where it ended.
        earlier: Residuals of the iterate before that, if there was one.
    """
    for residuals in (before.residuals, earlier):
        if residuals is not None and not _worse(after.residuals, residuals):
            return Damped(after, 1.0)
    candidates = [Damped(after, 1.0)]
    fractions = (*FRACTIONS, SHORTEST) if before.residuals.worst < NEAR else FRACTIONS
    candidates += [Damped(_between(problem, law, before, after, part), part) for part in fractions]
    return min(candidates, key=lambda candidate: candidate.iterate.residuals.worst_beside(after.residuals))


def descend(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate) -> Damped:
    """Return the minimum between two iterates of the potential that a proximal point minimises. Collective.

    The potential energy of displacements u(λ, α) together with that of springs ρ in all contacts and discs is
    convex; its derivative along a step is that of r, against the force λ that deforms the bodies less the
    force P_Λ(λ − ρ r) of the springs. Bodies in pieces come together first, whatever the potential.

    Args:
        problem: Problem of a proximal point, F + D with ρ = 1/D.
        law: Tresca's law.
        before: Where the step began.
        after: Where it ended.
    """
    slope = _slope(problem, law, before, after)
    first, last = slope(0.0), slope(1.0)
    if first >= 0.0 or last <= -STEEP * first or before.residuals.gluing > TORN:
        return Damped(after, 1.0)
    left, right, low, high = 0.0, 1.0, first, last
    for _ in range(30):
        part = left + (right - left) * min(max(-low / (high - low), 0.1), 0.9)
        value = slope(part)
        if abs(value) <= -LEVEL * first:
            break
        if value < 0.0:
            left, low = part, value
        else:
            right, high = part, value
    return Damped(_between(problem, law, before, after, part), part)


def _worse(one: Residuals, other: Residuals) -> bool:
    return one.worst > other.worst and one.worst_beside(other) > other.worst_beside(one)


def _slope(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate) -> Callable[[float], float]:
    """Return the derivative of the potential as a function of the fraction of a step. Collective to call."""
    layout, step = problem.layout, contact_step(problem.layout, problem.diagonal)
    moved, turned = after.multiplier - before.multiplier, after.residual - before.residual
    opened = turned.copy()
    opened[layout.contact] -= moved[layout.contact] / step[layout.contact]

    def slope(part: float) -> float:
        multiplier = before.multiplier + part * moved
        trial = multiplier - step * (before.residual + part * turned)
        missing = multiplier - law.feasible(multiplier).project(trial)
        missing[layout.equality] = (part - 1.0) * moved[layout.equality]
        return float(global_sum(problem.comm, opened @ missing)[0])

    return slope


def _between(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate, fraction: float) -> Iterate:
    multiplier, product, residual = (
        np.asarray((1.0 - fraction) * old + fraction * new, dtype=np.float64)
        for old, new in (
            (before.multiplier, after.multiplier),
            (before.product, after.product),
            (before.residual, after.residual),
        )
    )
    residuals = measure(problem, law.feasible(multiplier), multiplier, product, residual)
    return Iterate(multiplier, product, residual, residuals)


#: The longest cycle of active sets that is recognised.
LONGEST_CYCLE = 6


class NewtonSteps:
    """Takes Newton steps of one solve and remembers the last faces, residuals and each disc's ρ."""

    def __init__(
        self,
        problem: DualProblem,
        law: SlipLaw,
        operator: CountedOperator | ShiftedOperator,
        parameters: FaceNewton,
        *,
        springs: bool = False,
    ) -> None:
        """Prepare the coarse spaces of all faces. Collective.

        Args:
            problem: The dual problem, or that of a proximal point.
            law: Where the slip bound comes from.
            operator: Its operator, counted.
            parameters: Forcing terms and limits.
            springs: The problem is that of a proximal point: ρ is given, a potential says how far to go.
        """
        self._problem, self._law, self._parameters = problem, law, parameters
        self._operator, self._springs = operator, springs
        self._systems = FaceSystems(problem, operator)
        self._natural_step = contact_step(problem.layout, problem.diagonal)
        self._rho = self._natural_step.copy()
        self._face: Face | None = None
        self._earlier: list[Face] = []
        self._mismatch = 1.0
        self._settling = Settling(problem, law)
        self._before: Residuals | None = None

    def move(self, problem: DualProblem, law: SlipLaw) -> None:
        """Go on with another right side and another law."""
        self._problem, self._law = problem, law
        self._settling = self._settling.with_law(law)

    def settled(self, iterate: Iterate) -> Iterate:
        """Return an iterate of another load or position with its floating bodies at rest. Collective."""
        problem = self._problem
        alpha = problem.coarse.coefficients(iterate.product - problem.rhs - iterate.residual)
        alpha = alpha + self._settling(iterate.multiplier, iterate.residual, self._rho)
        return iterate_at(problem, self._law, iterate.multiplier, iterate.product, alpha)

    def step(self, iterate: Iterate, number: int, care: float = 1.0) -> tuple[Iterate, SolverStep]:
        """Classify, solve the face, and return the new iterate with its line of history. Collective.

        Args:
            iterate: Where to start.
            number: Number of the step in the history.
            care: Factor on the inner tolerance, at most one.
        """
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
        forcing = care * self._forcing(changes)
        solved = self._solve(system, coupled, entered, product, iterate.residuals, forcing)
        multiplier, product = entered + linear.advance(solved.step), product + solved.product
        alpha = self._motions(system, linear, iterate, multiplier, product)
        after = iterate_at(self._problem, self._law, multiplier, product, alpha)
        self._mismatch = abs(after.residuals.size - solved.measure) / (iterate.residuals.size or 1.0)
        if self._springs:
            damped = descend(self._problem, self._law, iterate, after)
        else:
            damped = damp(self._problem, self._law, iterate, after, self._before)
        self._before = iterate.residuals
        return damped.iterate, self._record(number, damped, system, solved, changes)

    def stall(self) -> str:
        """Say why the last steps led nowhere: whether the active set cycles or stands still. Collective."""
        if self._face is None or not self._earlier:
            return "the residual stands still"
        changes = [self._face.changes(face) for face in self._earlier]
        changed = global_sum(self._problem.comm, *changes)
        flickering = f"{round(float(changed[0]))} statuses changed in the last step"
        if changed[0] == 0.0:
            return "the residual stands still on one face"
        if not np.all(changed):
            return f"the active set cycles with period {int(np.argmin(changed)) + 1}, {flickering}"
        return f"the active set does not settle, {flickering}"

    def _next_face(self, iterate: Iterate) -> Face:
        """Classify, with a smaller ρ for discs whose force would otherwise turn back."""
        layout, slip_bound = self._problem.layout, self._law.bound(iterate.multiplier)
        face = classify(layout, slip_bound, iterate.multiplier, iterate.residual, self._rho)
        if self._face is None or self._springs:
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
        if self._springs and system.coarse.gram.rank == coarse.m:
            # The face moves the bodies already; moving them in turns with the rest would creep.
            return alpha
        residual = product - problem.rhs - coarse.transpose(alpha)
        return np.asarray(alpha + self._settling(multiplier, residual, self._rho), dtype=np.float64)

    def _forcing(self, changes: int) -> float:
        """Return the inner tolerance relative to the residual. Collective."""
        changed = global_sum(self._problem.comm, changes)[0] > 0.0
        return self._parameters.forcing if changed else min(self._parameters.forcing, self._mismatch)

    def _solve(
        self,
        system: FaceSystem,
        coupled: CoupledFace | None,
        multiplier: Vector,
        product: Vector,
        residuals: Residuals,
        forcing: float,
    ) -> FaceStep:
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
