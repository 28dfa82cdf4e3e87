"""A multiplier with its product and residuals: start, iterates, certified solution, history of a solve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp.face import classify
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.problem import CountedOperator, DualProblem, Operator
from fenics_contact.qp.reductions import Vector, global_max, global_sum

#: Forces below this fraction of those in all rows are rounding: residuals are not relative to them.
FORCE_FLOOR = 1e-10


@dataclass(frozen=True)
class Residuals:
    """Relative residuals of a multiplier λ with r = F λ − d − Gᵀα; all are zero at the solution.

    Attributes:
        natural: ‖λ − P_Λ(λ − ρ r)‖ over the contact rows, relative to ‖λ_N‖.
        gluing: ‖r‖ over the equality rows, relative to the displacements that cancel there,
            max(‖(F λ − d)_E‖, ‖d_E‖), or, for a final solution, to the displacements themselves if they are
            smaller.
        coarse: Distance of λ from equilibrium, ‖Gᵀ(G Gᵀ)⁻¹(G λ − e)‖, relative to ‖λ‖.
        violation: Largest violation of a bound or disc, relative to ‖λ_N‖.
        force_scale: The force by which `natural` and `violation` were divided.
        gluing_scale: The displacement by which `gluing` was divided.
    """

    natural: float
    gluing: float
    coarse: float
    violation: float
    force_scale: float
    gluing_scale: float

    @property
    def worst(self) -> float:
        """The largest residual, which controls the iteration: the natural one is at least the violation.

        NaN if one of them is.
        """
        return float(np.max((self.natural, self.gluing, self.coarse)))

    @property
    def size(self) -> float:
        """√(natural² + gluing²), which the solution of a face predicts."""
        return float(np.hypot(self.natural, self.gluing))

    def size_in_scales_of(self, other: Residuals) -> float:
        """The size in the scales of other residuals, of the face that they select: see `residual_weights`."""
        natural = self.natural * (self.force_scale or 1.0) / (other.force_scale or np.inf)
        return float(
            np.hypot(natural, self.gluing * (self.gluing_scale or 1.0) / (other.gluing_scale or 1.0))
        )

    def worst_in_scales_with(self, other: Residuals) -> float:
        """The worst residual in the smaller scales of two, so that two iterates can be compared.

        A huge wrong force divided by itself is 1, no worse than the missing part of a nearly correct one.
        """
        force = min(self.force_scale, other.force_scale) or max(self.force_scale, other.force_scale)
        gluing = min(self.gluing_scale, other.gluing_scale) or max(self.gluing_scale, other.gluing_scale)
        # Infinite where it was divided by zero, in any scale: nothing was displaced yet.
        natural = _ratio(self.natural * (self.force_scale or 1.0), force)
        return max(natural, _ratio(self.gluing * (self.gluing_scale or 1.0), gluing), self.coarse)

    def is_worse_than(self, other: Residuals) -> bool:
        """Return whether these are worse, in their own scales and in the smaller ones of both."""
        return self.worst > other.worst and self.worst_in_scales_with(other) > other.worst_in_scales_with(
            self
        )

    @property
    def at_rows(self) -> Residuals:
        """These without the forces out of balance."""
        return replace(self, coarse=0.0)

    def beside(self, reach: float, nothing: float = 1e-10, rounding: float = 1e-11) -> Residuals:
        """Return the residuals with the gluing residual relative to smaller displacements.

        Where displacements are at most ``nothing`` of those that cancel, jumps of ``rounding`` of these are
        none: supports take up all load, and both are the last digits of K⁺.
        """
        if not 0.0 < reach < self.gluing_scale:
            return self
        if reach <= nothing * self.gluing_scale and self.gluing <= rounding:
            return replace(self, gluing=0.0)
        return replace(self, gluing=self.gluing * self.gluing_scale / reach, gluing_scale=reach)

    def within(self, tolerance: float) -> bool:
        """Return whether every residual is at most ``tolerance``; False for NaN."""
        return all(value <= tolerance for value in (self.natural, self.gluing, self.coarse, self.violation))


def contact_step(layout: ContactLayout, diagonal: Vector) -> Vector:
    """Return ρ = 1/diag F on the contact rows, one value per disc, and 0 on equality rows, owned."""
    step = np.zeros(layout.size)
    step[layout.normal] = 1.0 / diagonal[layout.normal]
    step[layout.tangential] = 1.0 / diagonal[layout.tangential].mean(axis=1, keepdims=True)
    return step


def measure(problem: DualProblem, multiplier: Vector, product: Vector, residual: Vector) -> Residuals:
    """Compute all residuals with the slip bound that belongs to the multiplier. Collective.

    Contact forces below 1e-10 of ‖λ‖ count as zero, so that a body that merely touches does not prolong the
    iteration, and so do forces below 1e-10 of those that would close the gaps, ρ‖d‖, as rounding of r causes
    them. No force closes gaps between supports: rows that these alone determine have a ρ that is not a
    stiffness, and excuse only their own error. Where no normal force acts at all, ‖λ‖ over all contact rows
    replaces ‖λ_N‖.
    """
    layout, equality, contact = problem.layout, problem.layout.equality, problem.layout.contact
    step = contact_step(layout, problem.diagonal)
    feasible = problem.law.feasible(multiplier)
    mapped = problem.compliance.resolve(feasible, multiplier - step * residual, step)
    free, error, needed = ~problem.between_supports, multiplier - mapped, step * problem.rhs
    idle = free & (multiplier == 0.0) & (mapped != 0.0)
    sums = global_sum(
        problem.comm,
        *(_square(x[layout.normal]) for x in (multiplier, mapped)),
        *(_square(x[contact]) for x in (multiplier, mapped)),
        *(_square(x[equality]) for x in (residual, product - problem.rhs, problem.rhs)),
        _square(multiplier),
        _square(problem.rhs),
        _square(product[layout.normal]),
        *(_square(error[rows]) for rows in (free & ~idle, ~free, idle)),
        *(_square(needed[rows]) for rows in (free, ~free)),
        _square(step[idle]),
        problem.coarse.local(multiplier),
    )
    normal, normal_mapped, force, force_mapped = np.sqrt(sums[:4])
    jump, cancelled, load, everything, rhs, pressed = np.sqrt(sums[4:10])
    distance, distance_held, distance_idle, closing, closing_held, stiff = np.sqrt(sums[10:16])
    unbalanced = problem.coarse.norm(sums[16:] - problem.coarse.load)
    loads = problem.coarse.norm(problem.coarse.load)
    force_scale = max(normal, normal_mapped)
    if force_scale <= FORCE_FLOOR * max(force, force_mapped):
        force_scale = max(force, force_mapped)
    force_scale = max(force_scale, FORCE_FLOOR * max(everything, closing))
    force_scale = max(force_scale, problem.least.force)
    gluing_scale = max(cancelled, load, problem.least.gluing) or rhs
    # Errors below the last places of all forces, and jumps of what the loads alone would open, or of what
    # contact forces displace, are none: an interference alone may displace nothing at supports. Neither are
    # jumps where nothing presses that are rounding of how far supports move bodies.
    rounding = LAST_PLACES * max(everything, closing)
    distance = hypot(
        distance if distance > rounding else 0.0,
        distance_held if distance_held > max(rounding, LAST_PLACES * closing_held) else 0.0,
        distance_idle if distance_idle > max(rounding, LAST_PLACES * stiff * load) else 0.0,
    )
    violation = global_max(problem.comm, feasible.violation(multiplier))
    return Residuals(
        natural=_ratio(distance, force_scale),
        gluing=_ratio(jump if jump > LAST_PLACES * max(load, pressed) else 0.0, gluing_scale),
        coarse=_ratio(unbalanced, max(everything, loads, problem.least.everything)),
        violation=_ratio(violation if violation > rounding else 0.0, force_scale),
        force_scale=force_scale,
        gluing_scale=gluing_scale,
    )


def _square(x: Vector) -> float:
    return float(x @ x)


def _ratio(value: float, scale: float) -> float:
    if value == 0.0:
        return 0.0
    return float(value / scale) if scale > 0.0 else float(np.inf)


@dataclass(frozen=True)
class SolverStep:
    """One line of a solver's history; counts and residuals are global.

    `products`: F-products up to and including this step; `note`: the solver's decision in words; empty for an
    ordinary step; `outer`: number of the solve that it belongs to, from 0: a Tresca problem of the Coulomb
    fixed point, or a round with a smaller tolerance.
    """

    method: str
    iteration: int
    products: int
    residuals: Residuals
    closed: int
    stick: int
    slip: int
    note: str = ""
    outer: int = 0

    def __str__(self) -> str:
        """Return one readable line."""
        r = self.residuals
        return (
            f"{self.method} {self.iteration}: natural {r.natural:.1e}, gluing {r.gluing:.1e}, coarse "
            f"{r.coarse:.1e}, {self.closed} closed, {self.stick} stick, {self.slip} slip, "
            f"{self.products} products{': ' if self.note else ''}{self.note}"
        )


def continued(history: Sequence[SolverStep], steps: Sequence[SolverStep], products: int) -> list[SolverStep]:
    """Append the steps of a further solve, continuing the counts of steps, of products and of solves."""
    outer = history[-1].outer + 1 if history else 0
    counted = (
        replace(step, iteration=number, products=products + step.products, outer=outer + step.outer)
        for number, step in enumerate(steps, len(history))
    )
    return [*history, *counted]


@dataclass(frozen=True)
class SmalseMemory:
    """Estimates of SMALSE that it can reuse for a neighbouring problem.

    `norm`: upper estimate of ‖PFP‖; `balance`: M, the ratio of projected gradient to equilibrium error at
    which inner iterations stop.
    """

    norm: float
    balance: float


@displayed
@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """A multiplier that satisfies every residual to the tolerance, and how it was found."""

    multiplier: Vector
    residuals: Residuals
    iterations: int
    products: int
    history: tuple[SolverStep, ...]
    reason: str

    @property
    def natural_residual(self) -> float:
        """‖λ − P_Λ(λ − ρ r)‖ over the contact rows, relative to ‖λ_N‖."""
        return self.residuals.natural

    @property
    def gluing_residual(self) -> float:
        """‖r‖ over the equality rows, relative to the displacements that cancel there."""
        return self.residuals.gluing

    @property
    def coarse_residual(self) -> float:
        """Distance of λ from equilibrium relative to ‖λ‖."""
        return self.residuals.coarse


@displayed
@dataclass(frozen=True, eq=False, kw_only=True)
class DualSolution(Solution):
    """The solution of a dual problem; its residuals are recomputed from `product`.

    Attributes:
        problem: The solved problem.
        residual: r = F λ − d − Gᵀα, owned: minus the violation B u − c of every row.
        product: F λ, owned.
        alpha: Coefficients α of the rigid motions, shape (m,), replicated.
        slip_bound: Ψ at the solution, shape (n_friction,), owned.
        memory: Estimates of SMALSE, None if it did not run.
        released: Whether all forces are zero because no load acts and friction cannot grip without one.
    """

    problem: DualProblem
    residual: Vector
    product: Vector
    alpha: Vector
    slip_bound: Vector
    memory: SmalseMemory | None = None
    released: bool = False


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate of the multiplier.

    `product`: F λ, owned, recomputed or updated by recursion; `residual`: r = F λ − d − Gᵀα, owned, with the
    α of the solver.
    """

    multiplier: Vector
    product: Vector
    residual: Vector
    residuals: Residuals

    def motions(self, problem: DualProblem) -> Vector:
        """Return the α of r = F λ − d − Gᵀα, shape (m,), replicated. Collective."""
        return problem.coarse.coefficients(self.product - problem.rhs - self.residual)


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a solve.

    Attributes:
        iterate: The first multiplier.
        operator: F with its counter, to be used for the whole solve.
        memory: Estimates from an earlier SMALSE, or None.
        cold: Whether λ is the shortest multiplier in equilibrium, Gᵀ(G Gᵀ)⁻¹e.
        released: Whether λ is zero because no load acts and friction cannot grip, see `may_grip`.
    """

    iterate: Iterate
    operator: CountedOperator
    memory: SmalseMemory | None = None
    cold: bool = True
    released: bool = False

    def reached(self, step: SolverStep) -> None:
        """Report what a step of the solver has reached."""
        self.operator.report(step.products, step.residuals.worst)


class StoppedError(ConvergenceError):
    """A dual solver stopped before its tolerance was met.

    `best`: the iterate with the least residual, from which another solver may go on.
    """

    def __init__(self, message: str, history: Sequence[SolverStep], best: Iterate) -> None:
        """Store the iterate with message and history."""
        super().__init__(message, history)
        self.best = best


def iterate_at(problem: DualProblem, multiplier: Vector, product: Vector, alpha: Vector) -> Iterate:
    """Return the iterate of a multiplier with known product F λ and rigid motions α. Collective."""
    residual = product - problem.rhs - problem.coarse.transpose(alpha)
    residuals = measure(problem, multiplier, product, residual)
    return Iterate(multiplier, product, residual, residuals)


def iterate_fitted(
    problem: DualProblem, multiplier: Vector, product: Vector, margin: float = 1e-4
) -> Iterate:
    """Return the iterate with α = (G_F G_Fᵀ)⁻¹ G_F (F λ − d)_F of the rows that are free by λ. Collective.

    Free are the gluing rows, contacts with λ_N > 0, discs inside their bound by the relative ``margin``, and
    the tangents of the others. There r should vanish; open rows have gaps and slipping ones slip, which must
    not enter the fit.
    """
    bound = (1.0 - margin) * problem.law.bound(multiplier)
    step = contact_step(problem.layout, problem.diagonal)
    face = classify(problem.layout, bound, multiplier, np.zeros_like(multiplier), step, problem.compliance)
    free = problem.coarse.restricted(face.restriction, whole=True)
    alpha = free.coefficients(face.restrict(product - problem.rhs + problem.compliance.given_way(multiplier)))
    return iterate_at(problem, multiplier, product, alpha)


def iterate_between(problem: DualProblem, before: Iterate, after: Iterate, part: float) -> Iterate:
    """Return the iterate at a fraction of the way from one to another, without a product. Collective."""
    multiplier, product, residual = (
        np.asarray((1.0 - part) * old + part * new, dtype=np.float64)
        for old, new in (
            (before.multiplier, after.multiplier),
            (before.product, after.product),
            (before.residual, after.residual),
        )
    )
    return Iterate(multiplier, product, residual, measure(problem, multiplier, product, residual))


def answer_at(problem: DualProblem, multiplier: Vector, product: Vector, alpha: Vector) -> Iterate:
    """Return the iterate with its jumps relative to the displacements where these are known. Collective.

    During the iteration jumps are compared with B K⁺(Bᵀλ − f), which costs nothing extra. That is a poor
    scale where loads go straight into supports or act on thin parts that are held, which alone would move
    far.
    """
    iterate = iterate_at(problem, multiplier, product, alpha)
    reach = problem.reach(multiplier, alpha)
    # Jumps in the last digits of displacements are none.
    jumps = np.where(np.abs(iterate.residual) > LAST_PLACES * reach, iterate.residual, 0.0)
    residuals = measure(problem, multiplier, product, jumps)
    # Over all rows: those of supports may not move at all.
    return replace(iterate, residuals=residuals.beside(problem.norm(reach)))


def apply_unless_zero(problem: DualProblem, operator: Operator, x: Vector) -> Vector:
    """Return F x, without a product where x is zero on all ranks. Collective."""
    return operator(x) if problem.norm(x) > 0.0 else np.zeros_like(x)


@dataclass(frozen=True, eq=False)
class Certificate:
    """A multiplier whose α and residuals were recomputed from its exact product."""

    problem: DualProblem
    iterate: Iterate
    alpha: Vector

    def solution(
        self, history: Sequence[SolverStep], products: int, memory: SmalseMemory | None = None
    ) -> DualSolution:
        """Return the solution of a solve that took ``products`` products."""
        return DualSolution(
            problem=self.problem,
            multiplier=self.iterate.multiplier,
            residual=self.iterate.residual,
            product=self.iterate.product,
            alpha=self.alpha,
            slip_bound=self.problem.law.bound(self.iterate.multiplier),
            residuals=self.iterate.residuals,
            iterations=len(history),
            products=products,
            history=tuple(history),
            reason="every residual is below the tolerance",
            memory=memory,
        )


def certify(problem: DualProblem, multiplier: Vector, product: Vector, residual: Vector) -> Certificate:
    """Recompute α and residuals of λ with its exact product F λ, from the α of a solver's r. Collective."""
    alpha = problem.coarse.fitted(product - problem.rhs - residual)
    return Certificate(problem, answer_at(problem, multiplier, product, alpha), alpha)


def count_status(problem: DualProblem, multiplier: Vector) -> tuple[int, int, int]:
    """Count closed contacts, sticking and slipping discs by the multiplier alone. Collective."""
    layout, slip_bound = problem.layout, problem.law.bound(multiplier)
    length = np.linalg.norm(multiplier[layout.tangential], axis=1)
    slip = length >= slip_bound * (1.0 - 1e-9)
    counts = global_sum(
        problem.comm,
        np.count_nonzero(multiplier[layout.normal] > 0.0),
        np.count_nonzero(~slip),
        np.count_nonzero(slip & (slip_bound > 0.0)),
    )
    closed, stick, slipping = (round(float(count)) for count in counts)
    return closed, stick, slipping
