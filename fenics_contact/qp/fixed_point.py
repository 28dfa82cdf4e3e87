"""The next slip bounds of the Coulomb fixed point: undamped as long as that converges, else damped.

Coulomb friction as a fixed point of Tresca problems: the slip bound follows the normal force.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp.cones import TrescaLaw
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.solution import (
    DualSolution,
    Iterate,
    SolverStep,
    Start,
    StoppedError,
    continued,
    measure,
)
from fenics_contact.qp.solve import DualSolver, find_equilibrium, solve


@dataclass(frozen=True)
class Damping:
    """Ψ ← (1 − θ) Ψ + θ μ λ_N with θ = 1 until the iteration cycles or stagnates.

    Near the solution the undamped iteration multiplies an error by an eigenvalue that friction makes
    negative: below −1 it alternates without converging, and damping by θ moves the eigenvalue ω to 1 − θ
    (1 − ω).

    Attributes:
        fractions: The values of θ, each used when the one before it failed.
        patience: Steps (1/θ times as many when damped) in which the residual must fall before θ fails.
        progress: Factor on the best residual below which it has fallen.
        returns: A cycle is a return to earlier slip bounds in this many consecutive steps.
        return_ratio: Slip bounds have returned if they are this much nearer to earlier ones than to the last.
        memory: Number of earlier slip bounds that are compared: the longest period that is recognised, plus
            one.
    """

    fractions: tuple[float, ...] = (1.0, 0.6, 0.3, 0.15)
    patience: int = 10
    progress: float = 0.9
    returns: int = 3
    return_ratio: float = 0.3
    memory: int = 6


class SlipBoundSequence:
    """Chooses slip bounds from the record of earlier ones."""

    def __init__(self, comm: MPI.Comm, damping: Damping) -> None:
        """Begin with the first θ and an empty record."""
        self._comm, self._damping = comm, damping
        self._stage = 0
        self._bounds: list[Vector] = []
        self._best, self._since_best, self._returns = np.inf, 0, 0

    @property
    def fraction(self) -> float:
        """θ of the next step."""
        return self._damping.fractions[min(self._stage, len(self._damping.fractions) - 1)]

    @property
    def exhausted(self) -> bool:
        """Whether the smallest θ failed too."""
        return self._stage >= len(self._damping.fractions)

    def advance(self, bound: Vector, image: Vector, residual: float) -> tuple[Vector, str]:
        """Return the next slip bound and a note on the decision. Collective."""
        self._bounds = [*self._bounds[1 - self._damping.memory :], bound]
        period, change = self._returned(image)
        self._returns = self._returns + 1 if period else 0
        if residual < self._damping.progress * self._best:
            self._best, self._since_best = residual, 0
        else:
            self._since_best += 1
        note = f"slip bounds changed by {change:.1e}"
        reason = self._failure(period)
        if reason:
            self._stage += 1
            self._bounds, self._best, self._since_best, self._returns = [], np.inf, 0, 0
            remedy = "no θ is left" if self.exhausted else f"damping with θ = {self.fraction:g}"
            note += f", {reason}: {remedy}"
        return (1.0 - self.fraction) * bound + self.fraction * image, note

    def _failure(self, period: int) -> str:
        """Return why the present θ fails, empty if it does not."""
        if min(self._returns, self._since_best) >= self._damping.returns:
            return f"they cycle with period {period}"
        if self._since_best * self.fraction >= self._damping.patience:
            return f"the residual has not fallen in {self._since_best} steps"
        return ""

    def _returned(self, image: Vector) -> tuple[int, float]:
        """Return the period with which the bounds repeat, 0 for none, and their last relative change."""
        squares = [(image - earlier) @ (image - earlier) for earlier in reversed(self._bounds)]
        *distances, size = np.sqrt(global_sum(self._comm, *squares, image @ image))
        change = float(distances[0] / size) if size > 0.0 else 0.0
        older = distances[1:]
        if not older or distances[0] == 0.0 or min(older) > self._damping.return_ratio * distances[0]:
            return 0, change
        return int(np.argmin(older)) + 2, change


@dataclass(frozen=True)
class FixedPoint:
    """Two loops: Ψ ← given bound + μ λ_N around a solver for given slip bounds.

    A Tresca problem is solved no more accurately than the slip bound deserves: its tolerance follows the
    natural residual that its solution will have with its own slip bound. The bound is updated undamped;
    only where the bounds cycle or the residual stops falling are they damped, as the history reports.

    Attributes:
        solver: Solver of the Tresca problems.
        max_steps: Largest number of Tresca problems.
        max_products: Give up after the Tresca problem with which that many F-products are reached.
        forcing: Tolerance of a Tresca problem relative to the last natural residual.
        loosest: Largest tolerance, that of the first Tresca problem.
        damping: What to do where the plain iteration cycles.

    References:
        J. Haslinger, Z. Dostál, R. Kučera, On a splitting type algorithm for the numerical realization of
        contact problems with Coulomb friction, CMAME 191 (2002).

    Example:
        >>> state = solve_scene(scene, comm, solver=FixedPoint(Smalse()))  # doctest: +SKIP
    """

    solver: DualSolver
    max_steps: int = 200
    max_products: int = 1_000_000
    forcing: float = 0.1
    loosest: float = 1e-2
    damping: Damping = field(default_factory=Damping)

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution with the slip bound that belongs to its own normal force."""
        return self.solver.tolerance

    def with_tolerance(self, tolerance: float) -> FixedPoint:
        """Return the fixed point around its solver with another tolerance."""
        return replace(self, solver=self.solver.with_tolerance(tolerance))

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `fenics_contact.qp.solve`. Collective.

        Raises:
            InfeasibleError: If a Tresca problem on the way has no equilibrium.
            ConvergenceError: If the fixed point was not reached; carries the history of all steps.
        """
        slip_bound = _first_slip_bound(problem, start)
        sequence = SlipBoundSequence(problem.comm, self.damping)
        earlier: DualSolution | np.ndarray | None = None if start.cold else start.iterate.multiplier
        history: list[SolverStep] = []
        products, reached = start.operator.products, np.inf
        best: Iterate | None = None
        for number in range(self.max_steps):
            try:
                solution = solve(problem, slip_bound, self._inner(sequence.fraction * reached), earlier)
            except ConvergenceError as failure:
                steps = continued(history, failure.history, products)
                raise StoppedError(
                    f"a fixed point needs residuals below {self.tolerance:.1e}, problem {number}: {failure}",
                    steps,
                    best or start.iterate,
                ) from failure
            history = continued(history, solution.history, products)
            products += solution.products
            solution = _under_own_bound(problem, solution)
            reached = solution.natural_residual
            if best is None or solution.residuals.worst < best.residuals.worst:
                best = _iterate_of(solution)
            slip_bound, note = sequence.advance(slip_bound, solution.slip_bound, reached)
            history[-1] = replace(history[-1], note=f"{history[-1].note}; {note}")
            start.reached(replace(history[-1], residuals=solution.residuals))
            if solution.residuals.within(self.tolerance):
                return replace(solution, iterations=len(history), products=products, history=tuple(history))
            if sequence.exhausted or products >= self.max_products:
                break
            earlier = solution
        reason = self._failure(sequence, reached, products, number + 1)
        raise StoppedError(reason, history, best or start.iterate)

    def _inner(self, residual: float) -> DualSolver:
        """Return the solver of the next Tresca problem, given the error that its slip bound has already."""
        # Inner solutions may be as inaccurate as their tolerance allows; half of it is left to the fixed
        # point.
        tolerance = max(0.5 * self.tolerance, min(self.loosest, self.forcing * residual))
        return self.solver.with_tolerance(tolerance)

    def _failure(self, sequence: SlipBoundSequence, reached: float, products: int, steps: int) -> str:
        needed = (
            f"the Coulomb fixed point needs a natural residual below {self.tolerance:.1e}, reached "
            f"{reached:.1e}"
        )
        if sequence.exhausted:
            fractions = ", ".join(f"{fraction:g}" for fraction in self.damping.fractions)
            return (
                f"{needed}: it cycles or stagnates with every θ of {fractions}; use FaceNewton, which "
                "updates the slip bound in every step, or give Damping smaller fractions"
            )
        used = "max_products" if products >= self.max_products else "max_steps"
        return (
            f"{needed} after {steps} Tresca problems and {products} products: raise {used}, or use "
            "FaceNewton, which updates the slip bound in every step"
        )


def _first_slip_bound(problem: DualProblem, start: Start, margin: float = 1.1) -> np.ndarray:
    """Return slip bounds for which the first Tresca problem has an equilibrium. Collective.

    Zero, the obvious choice, might leave a body unheld, and so might the bounds of another load. Those of
    forces in equilibrium are taken with a margin for the error of these forces.
    """
    if not start.cold:
        bound = problem.law.bound(start.iterate.multiplier)
        if find_equilibrium(problem.with_law(TrescaLaw(problem.layout, bound))).may_exist:
            return bound
    return margin * problem.law.bound(find_equilibrium(problem).multiplier)


def _iterate_of(solution: DualSolution) -> Iterate:
    return Iterate(solution.multiplier, solution.product, solution.residual, solution.residuals)


def _under_own_bound(problem: DualProblem, solution: DualSolution) -> DualSolution:
    """Return a Tresca solution with slip bound and residuals of its own normal forces. Collective."""
    residuals = measure(problem, solution.multiplier, solution.product, solution.residual)
    return replace(solution, slip_bound=problem.law.bound(solution.multiplier), residuals=residuals)
