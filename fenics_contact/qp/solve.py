"""The common entry point for all dual problems and solvers, and whether any force balances the load."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.progress import Task
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError, together
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.cones import CoulombLaw, Proportional, SlipLaw, TrescaLaw
from fenics_contact.qp.problem import CountedOperator, DualProblem, LeastSizes, unknown_reach
from fenics_contact.qp.reductions import Vector, global_max, global_sum
from fenics_contact.qp.resting import LooseMotions
from fenics_contact.qp.solution import (
    DualSolution,
    Iterate,
    Residuals,
    SmalseMemory,
    SolverStep,
    Start,
    answer_at,
    apply_unless_zero,
    certify,
    count_status,
    iterate_at,
    iterate_fitted,
)


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An admissible multiplier in equilibrium, or the rigid motion that proves there is none.

    Attributes:
        multiplier: An admissible multiplier, owned; in equilibrium up to `error`.
        error: ‖Gᵀ(G Gᵀ)⁻¹(G λ − e)‖ relative to that of e.
        motion: Coefficients of a rigid motion on which the load does work and which no admissible
            multiplier resists, shape (m,); None unless that is proven.
    """

    multiplier: Vector
    error: float
    motion: Vector | None

    @property
    def may_exist(self) -> bool:
        """Whether it is not proven that there is none."""
        return self.motion is None


def find_equilibrium(
    problem: DualProblem,
    *,
    tolerance: float = 1e-4,
    max_iterations: int = 2000,
    largest_force: float = 1e7,
) -> Equilibrium:
    """Compute an admissible multiplier that balances the load, without any F-product. Collective.

    Minimises ½‖Q z − λ₀‖² over the admissible set by accelerated projected gradients, Q = I − P. At distance
    g = Q z − λ₀ with optimality error s = z − P_Λ(z − g), any equilibrium y satisfies ‖g‖² ≤ ‖s‖(‖y − z‖ +
    ‖g‖). Once that would need a force ``largest_force`` times the load's, none exists: a thin plate clamped
    at one edge needs forces as many times the load as its length is times its thickness.
    """
    coarse, law = problem.coarse, problem.law
    target = coarse.particular()
    size = coarse.norm(coarse.load)
    z = law.admit(target)
    momentum, weight = z, 1.0
    for _ in range(max_iterations):
        resultant = coarse.solve(coarse.residual(momentum))
        gradient = coarse.transpose(resultant)
        following = law.admit(momentum - gradient)
        step = momentum - following
        distance, error, turn = np.array(
            global_sum(problem.comm, gradient @ gradient, step @ step, step @ (following - z))
        )
        if distance <= (tolerance * size) ** 2:
            return Equilibrium(momentum, float(np.sqrt(distance)) / (size or 1.0), None)
        if distance > np.sqrt(error) * (largest_force * size + np.sqrt(distance)):
            return Equilibrium(following, float(np.sqrt(distance)) / size, resultant)
        weight, previous = (1.0, 1.0) if turn > 0.0 else (0.5 + np.sqrt(0.25 + weight**2), weight)
        momentum = following + (previous - 1.0) / weight * (following - z) * (turn <= 0.0)
        z = following
    return Equilibrium(z, float(np.sqrt(distance)) / size, None)


def require_equilibrium(problem: DualProblem) -> Equilibrium:
    """Return an admissible multiplier near equilibrium, or reject the problem. Collective."""
    equilibrium = find_equilibrium(problem)
    if equilibrium.motion is not None:
        size = np.abs(equilibrium.motion)
        rows = np.flatnonzero(size > 0.1 * size.max())
        raise InfeasibleError(
            f"contact and friction must balance the load, but leave {100 * equilibrium.error:.3g} % of it: "
            f"motions in rows {rows.tolist()} of e are not held; add a support, or raise the friction"
        )
    return equilibrium


def may_grip(problem: DualProblem, multiplier: Vector) -> bool:
    """Return whether friction may press bodies together that no load acts on; no product. Collective.

    Without friction that grows with the normal force, forces without a load are unique. With it they may
    remain, as in a wedge or a taper, unless it is proven that no admissible ones balance each other, those of
    a block on its floor for one.
    """
    coarse, layout, comm = problem.coarse, problem.layout, problem.comm
    if global_max(comm, float(problem.law.grows)) == 0.0:
        return False
    rows, normal = layout.normal, multiplier[layout.normal]
    squares, count, pressed = global_sum(
        comm, coarse.matrix.power(2).sum(), len(rows), np.maximum(normal, 0.0).sum()
    )
    if pressed == 0.0:
        return False
    # One more equation, of the size of the others: the sum of the normal forces is what it was.
    weight = float(np.sqrt(squares / count)) or 1.0
    entries = (np.full(len(rows), weight), (np.zeros(len(rows), dtype=np.int64), rows))
    total = sp.csr_matrix(entries, shape=(1, layout.size))
    load = np.append(np.zeros(coarse.m), weight * pressed)
    gripping = CoarseSpace(comm, sp.vstack([coarse.matrix, total]), load)
    # Where the sum is the resultant on one body, the equations contradict each other.
    if np.abs(gripping.unresisted()).max() > 1e-8 * load[-1]:
        return False
    return find_equilibrium(replace(problem, coarse=gripping)).may_exist


class DualSolver(Protocol):
    """Parameters of a method together with the method itself."""

    @property
    def tolerance(self) -> float:
        """Largest relative residual of a solution."""

    def with_tolerance(self, tolerance: float) -> DualSolver:
        """Return the solver with another tolerance."""

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start`` under the law of the problem. Collective.

        Raises:
            InfeasibleError: If the problem has no equilibrium.
            ConvergenceError: If the tolerance was not met; carries the history.
        """


def solve(
    problem: DualProblem,
    slip_bound: Vector | None,
    solver: DualSolver,
    start: DualSolution | Vector | None = None,
    *,
    friction_coefficient: Vector | None = None,
    law: SlipLaw | None = None,
) -> DualSolution:
    """Solve min ½ λᵀF λ − dᵀλ subject to G λ = e, λ_N ≥ 0 and ‖τ_i‖ ≤ Ψ_i. Collective.

    Args:
        problem: Operators and layout.
        slip_bound: Ψ, or with a friction coefficient its given part Ψ₀, shape (n_friction,), owned; None
            where there is no friction or the whole bound follows the normal force.
        solver: `FaceNewton`, `Smalse` or `ProjectedCG`, which hold only their parameters.
        start: An earlier solution (of this problem or of one with the same rows) or a multiplier, owned.
        friction_coefficient: μ, shape (n_friction,), owned: Coulomb's law, Ψ = Ψ₀ + μ λ_N; then λ is a
            fixed point and not a minimiser.
        law: Another law of the slip bounds, in place of both.

    Returns:
        The solution; its residuals were recomputed and are all below ``solver.tolerance``.

    Raises:
        InvalidInputError: Shapes disagree, values are not finite, or the solver does not fit the problem.
        InfeasibleError: The load drives a rigid motion that no admissible multiplier resists; tested only in
            a cold start.
        ConvergenceError: The tolerance was not met; carries the history.
    """
    problem.check()
    with together(problem.comm):
        under_law = problem.with_law(law or _slip_law(problem, slip_bound, friction_coefficient))
    find = _solve_scaled if problem.scaling else _solve_as_given
    found = _settled(under_law, find(under_law, solver, _from(start, problem)), solver.tolerance)
    return replace(found, problem=problem)


class _Cold:
    """A start from the shortest multiplier in equilibrium."""

    cold = True

    @property
    def memory(self) -> SmalseMemory | None:
        return None

    def scaled(self, factor: Vector | float) -> _Cold:
        return self

    def multiplier(self, problem: DualProblem) -> Vector:
        return problem.coarse.particular()

    def product(self, problem: DualProblem, operator: CountedOperator, multiplier: Vector) -> Vector:
        # A cold start is never the answer, and rounding of its product is that of the first step's.
        return apply_unless_zero(problem, operator, multiplier)

    def iterate(self, problem: DualProblem, multiplier: Vector, product: Vector) -> Iterate:
        return iterate_fitted(problem, multiplier, product)


@dataclass(frozen=True, eq=False)
class _Warm(_Cold):
    """A start from a multiplier of another problem, owned."""

    given: Vector

    cold = False

    def scaled(self, factor: Vector | float) -> _Warm:
        return _Warm(np.asarray(self.given / factor, dtype=np.float64))

    def multiplier(self, problem: DualProblem) -> Vector:
        return np.array(self.given, dtype=np.float64)

    def product(self, problem: DualProblem, operator: CountedOperator, multiplier: Vector) -> Vector:
        return apply_unless_zero(problem, operator.exactly, multiplier)


@dataclass(frozen=True, eq=False)
class _Solved(_Warm):
    """A start from a solution."""

    solution: DualSolution

    @property
    def memory(self) -> SmalseMemory | None:
        return self.solution.memory

    @classmethod
    def at(cls, solution: DualSolution) -> _Solved:
        return cls(solution.multiplier, solution)

    def scaled(self, factor: Vector | float) -> _Solved:
        old, s = self.solution, factor
        scaled = old.multiplier / s, old.product * s, old.residual * s
        return self.at(replace(old, multiplier=scaled[0], product=scaled[1], residual=scaled[2]))

    def iterate(self, problem: DualProblem, multiplier: Vector, product: Vector) -> Iterate:
        if self.solution.alpha.shape == (problem.coarse.m,):
            return iterate_at(problem, multiplier, product, self.solution.alpha)
        return super().iterate(problem, multiplier, product)


class _SolvedBefore(_Solved):
    """A start from a solution of the same problem, whose product is known."""

    def product(self, problem: DualProblem, operator: CountedOperator, multiplier: Vector) -> Vector:
        return self.solution.product


def _from(start: DualSolution | Vector | None, problem: DualProblem) -> _Cold:
    """Return a start of a problem."""
    if isinstance(start, DualSolution):
        return (_SolvedBefore if start.problem is problem else _Solved).at(start)
    return _Cold() if start is None else _Warm(start)


def _settled(problem: DualProblem, found: DualSolution, tolerance: float) -> DualSolution:
    """Return a solution with bodies on which nothing acts where they were, as far as they do not overlap."""
    motion = LooseMotions.of(problem, found.multiplier, found.residual).settled()
    if motion is None:
        return found
    moved = answer_at(problem, found.multiplier, found.product, found.alpha + motion)
    if not moved.residuals.within(tolerance):
        return found
    return replace(found, residual=moved.residual, residuals=moved.residuals, alpha=found.alpha + motion)


def _solve_as_given(problem: DualProblem, solver: DualSolver, start: _Cold) -> DualSolution:
    """Solve a problem with its law. Collective."""
    with Task("solve", unit="products", target=solver.tolerance) as task:
        if start.cold:
            require_equilibrium(problem)
        operator = CountedOperator(
            problem.operator,
            lambda products, residual: task.step(products, measure=residual),
            problem.exact,
        )
        begin = _begin(problem, operator, start)
        answer = _as_it_is(problem, begin, solver.tolerance)
        if answer is not None:
            return replace(answer, released=begin.released)
        solution = _run(problem, solver, begin)
    if not solution.residuals.within(solver.tolerance):
        raise ConvergenceError(
            f"the solver's answer must have residuals below {solver.tolerance:.1e}, got {solution.residuals}",
            solution.history,
        )
    return solution


def _run(problem: DualProblem, solver: DualSolver, begin: Start) -> DualSolution:
    """Solve from a start; where nothing is loaded and friction lets go, forces are exactly zero. Collective.

    Residuals are relative to the forces at the start first: those of bodies that are let go vanish.
    """
    released = None if begin.cold else _released(problem, begin, solver.tolerance)
    if released is None:
        return solver.run(problem, begin)
    residuals, size = begin.iterate.residuals, problem.norm(begin.iterate.multiplier)
    least = LeastSizes(residuals.force_scale, residuals.gluing_scale, size)
    found = solver.run(replace(problem, least=least, reach=unknown_reach), begin)
    # Zero is one of the answers: forces this small relative to those of the last load are none.
    if problem.norm(found.multiplier) <= max(solver.tolerance, min(100.0 * solver.tolerance, 1e-3)) * size:
        return replace(released, products=found.products)
    answer = certify(problem, found.multiplier, found.product, found.residual)
    if answer.iterate.residuals.within(solver.tolerance):
        return answer.solution(list(found.history), found.products, found.memory)
    return solver.run(problem, replace(begin, iterate=answer.iterate))


def _released(problem: DualProblem, begin: Start, tolerance: float) -> DualSolution | None:
    """Return the solution without any force, None if there is none. Collective."""
    return None if problem.is_loaded else _as_it_is(problem, _at_rest(problem, begin), tolerance)


def _solve_scaled(problem: DualProblem, solver: DualSolver, start: _Cold, attempts: int = 4) -> DualSolution:
    """Solve in scaled multipliers until the residuals of the unscaled ones are small, too. Collective."""
    scaled = problem.scaled_problem
    scaled.check()
    start = start.scaled(problem.scaling.factor)
    tolerance, products = solver.tolerance, 0
    history: tuple[SolverStep, ...] = ()
    for _ in range(attempts):
        found = _solve_as_given(scaled, solver.with_tolerance(tolerance), start)
        products, history = products + found.products, (*history, *found.history)
        solution = _unscaled(problem, found)
        if solution.residuals.within(solver.tolerance):
            return replace(solution, products=products, iterations=len(history), history=history)
        tolerance, least = _sharper(tolerance, solver.tolerance, found.residuals, solution.residuals)
        scaled = replace(scaled, least=least)
        start = _SolvedBefore.at(replace(found, problem=scaled))
    raise ConvergenceError(
        f"residuals must be below {solver.tolerance:.1e}, got {solution.residuals} in {attempts} attempts",
        history,
    )


def _sharper(
    tolerance: float, aim: float, scaled: Residuals, unscaled: Residuals
) -> tuple[float, LeastSizes]:
    """Return the tolerance of the next attempt, and sizes by which it asks no more of what is met already.

    Contact forces cannot be had as sharply as jumps of soft parts beside stiff ones may need.
    """

    def needed(got: float, of: float) -> float:
        return tolerance if of <= aim else min(0.3 * tolerance * aim / of, 0.3 * got or tolerance)

    natural = needed(scaled.natural, unscaled.natural)
    gluing = needed(scaled.gluing, unscaled.gluing)
    sharpest = min(natural, gluing, needed(scaled.coarse, unscaled.coarse))
    force, jumps = scaled.force_scale * natural, scaled.gluing_scale * gluing
    return sharpest, LeastSizes(force / sharpest, jumps / sharpest)


def _unscaled(problem: DualProblem, solution: DualSolution) -> DualSolution:
    """Return the solution for λ of one for μ, with its residuals. Collective.

    Jumps and errors of forces that are last digits for μ, whose rows are equally stiff, are so for λ: where
    soft and stiff parts are held side by side, jumps of the soft ones would be compared with motions of the
    stiff ones.
    """
    s = problem.scaling.factor
    multiplier, product = s * solution.multiplier, solution.product / s
    answer = answer_at(problem, multiplier, product, solution.alpha)
    residuals = answer.residuals
    if solution.residuals.gluing == 0.0:
        residuals = replace(residuals, gluing=0.0)
    if solution.residuals.natural == 0.0:
        residuals = replace(residuals, natural=0.0, violation=0.0)
    return replace(
        solution,
        multiplier=multiplier,
        product=product,
        residual=answer.residual,
        slip_bound=problem.law.bound(multiplier),
        residuals=residuals,
    )


def _slip_law(
    problem: DualProblem, slip_bound: Vector | None, friction_coefficient: Vector | None
) -> SlipLaw:
    layout = problem.layout
    if friction_coefficient is not None:
        given = 0.0 if slip_bound is None else np.asarray(slip_bound, dtype=np.float64)
        return CoulombLaw(layout, Proportional(np.asarray(friction_coefficient, dtype=np.float64)), given)
    if slip_bound is None:
        if layout.n_friction:
            raise InvalidInputError("friction discs need a slip_bound or friction_coefficient, got neither")
        slip_bound = np.zeros(0)
    law = TrescaLaw(layout, np.asarray(slip_bound, dtype=np.float64))
    law.feasible(np.zeros(layout.size))
    return law


def _begin(problem: DualProblem, operator: CountedOperator, start: _Cold) -> Start:
    """Compute product and residual of the starting multiplier. Collective; at most one product."""
    multiplier = start.multiplier(problem)
    with together(problem.comm):
        _require_size(multiplier, problem.layout.size)
    iterate = start.iterate(problem, multiplier, start.product(problem, operator, multiplier))
    begin = Start(iterate, operator, start.memory, cold=start.cold)
    if begin.cold or problem.is_loaded or may_grip(problem, multiplier):
        return begin
    # No body is loaded: zero forces, free of cost, may be closer than those of another load.
    rest = _at_rest(problem, begin)
    return replace(rest, released=True) if rest.iterate.residuals.worst <= iterate.residuals.worst else begin


def _at_rest(problem: DualProblem, begin: Start) -> Start:
    """Return the start without any force, where bodies do not overlap if that is possible. Collective."""
    nothing = np.zeros_like(begin.iterate.multiplier)
    iterate = iterate_fitted(problem, nothing, nothing)
    motion = LooseMotions.of(problem, nothing, iterate.residual).settled()
    if motion is not None:
        iterate = iterate_at(problem, nothing, nothing, iterate.motions(problem) + motion)
    return replace(begin, iterate=iterate, cold=True)


def _as_it_is(problem: DualProblem, start: Start, tolerance: float) -> DualSolution | None:
    """Return a start that is the solution already: nothing is loaded, or nothing has changed. Collective."""
    iterate = start.iterate
    if not iterate.residuals.within(tolerance):
        return None
    answer = certify(problem, iterate.multiplier, iterate.product, iterate.residual)
    residuals = answer.iterate.residuals
    if not residuals.within(tolerance):
        return None
    closed, stick, slip = count_status(problem, iterate.multiplier)
    products = start.operator.products
    note = "released: no load, and no friction that grips" if start.released else "the answer already"
    line = SolverStep("start", 0, products, residuals, closed, stick, slip, note)
    return answer.solution([line], products, start.memory)


def _require_size(multiplier: Vector, size: int) -> None:
    if multiplier.shape != (size,):
        raise InvalidInputError(f"start must have shape ({size},), got {multiplier.shape}: start cold")
