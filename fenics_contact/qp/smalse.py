"""SMALSE-M: equilibrium by an augmented Lagrangian, bounds and discs by MPGP inside. Robust but slow."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.linalg import ROUNDING
from fenics_contact.qp.augmented import AugmentedLagrangian
from fenics_contact.qp.iterate import Start, certify, count_status
from fenics_contact.qp.mpgp import Mpgp, minimise
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.slip_law import TrescaLaw
from fenics_contact.qp.solution import DualSolution, Residuals, SmalseMemory, SolverStep, measure


@dataclass(frozen=True)
class Smalse:
    """Semimonotonic augmented Lagrangians for bound and equality constraints, with MPGP inside.

    The operator is scaled so that ‖PFP‖ = 1 and G is used as if orthonormalised, so that the penalty is 1
    and no parameter depends on units. Only for slip bounds that are given (Tresca, frictionless).

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_products: Give up after that many F-products.
        balance: First M: the inner iteration stops at ‖projected gradient‖ ≤ M·(equilibrium error).
        loosest: η: but not before ‖projected gradient‖ ≤ η‖b‖.
        balance_reduction: Factor on M when the Lagrangian increases too little.
        mpgp: Parameters of the inner iteration.

    References:
        Z. Dostál, T. Kozubek, M. Sadowská, V. Vondrák, Scalable Algorithms for Contact Problems,
        Springer (2016), algorithm SMALSE-M.
    """

    tolerance: float = 1e-6
    max_products: int = 20_000
    balance: float = 1.0
    loosest: float = 0.1
    balance_reduction: float = 0.1
    mpgp: Mpgp = field(default_factory=Mpgp)

    def with_tolerance(self, tolerance: float) -> Smalse:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InvalidInputError: The slip bound follows the multiplier.
            ConvergenceError: The product budget was used up; carries the history.
        """
        if not isinstance(problem.law, TrescaLaw):
            raise InvalidInputError(
                f"SMALSE needs a given slip bound, got {type(problem.law).__name__}: iterate on the "
                "bound around it, or use FaceNewton"
            )
        operator, history = start.operator, list[SolverStep]()
        for state in outer_iterations(problem, start, self):
            history.append(state.record(len(history), problem, operator.products))
            start.reached(history[-1])
            if state.residuals.within(0.5 * self.tolerance):
                product = operator(state.multiplier)
                answer = certify(problem, state.multiplier, product, state.residual)
                if answer.iterate.residuals.within(self.tolerance):
                    return answer.solution(history, operator.products, state.memory)
            if operator.products >= self.max_products:
                break
        raise ConvergenceError(
            f"SMALSE needs residuals below {self.tolerance:.1e}, got after {operator.products} products: "
            f"{history[-1]}; raise max_products, or loosen the tolerance",
            history,
        )


@dataclass(frozen=True, eq=False)
class SmalseState:
    """The multiplier after an outer iteration, with residuals that cost no further product.

    Attributes:
        multiplier: λ in Λ(Ψ), in equilibrium up to the penalty, owned.
        residual: ‖PFP‖ times the gradient of the Lagrangian: F λ − d − Gᵀα up to F times the equilibrium
            error, owned.
        residuals: Measured with `residual`.
        memory: Norm estimate and current M.
        iterations: MPGP steps of this outer iteration.
    """

    multiplier: Vector
    residual: Vector
    residuals: Residuals
    memory: SmalseMemory
    iterations: int

    def record(self, iteration: int, problem: DualProblem, products: int) -> SolverStep:
        """Return the line for the history. Collective."""
        closed, stick, slip = count_status(problem, self.multiplier)
        note = f"{self.iterations} MPGP steps, M = {self.memory.balance:.0e}"
        return SolverStep("SMALSE", iteration, products, self.residuals, closed, stick, slip, note)


def outer_iterations(problem: DualProblem, start: Start, parameters: Smalse) -> Iterator[SmalseState]:
    """Yield the state after every outer iteration, without end, for given slip bounds. Collective.

    The multiplier of G λ = e is stored as the vector v = G̃ᵀμ in range(Gᵀ) and updated by v ← v + Q λ − λ₀.
    """
    lagrangian = AugmentedLagrangian(problem, start)
    feasible = problem.law.feasible(start.iterate.multiplier)
    x, v = feasible.project(start.iterate.multiplier), lagrangian.first_multiplier(start.iterate.residual)
    balance = parameters.balance if start.memory is None else start.memory.balance
    rigid = start.iterate.product - start.iterate.residual  # d + Gᵀα at the start: sets a scale only
    floor = lagrangian.floor(start.iterate.residuals, parameters.tolerance)
    previous, caution = -np.inf, 1.0
    while True:
        minimum = minimise(
            lagrangian.quadratic(feasible, v),
            x,
            lagrangian.stopping_rule(balance, parameters.loosest, caution * floor),
            parameters=parameters.mpgp,
            max_iterations=max(parameters.max_products - start.operator.products, 1),
        )
        x, residual = minimum.x, lagrangian.norm * minimum.gradient
        value = lagrangian.value(minimum, v)
        rise = 0.5 * lagrangian.imbalance(x) ** 2
        if value < previous + rise - ROUNDING * abs(value):
            balance *= parameters.balance_reduction
        previous = value
        v = v + lagrangian.drift(x)
        residuals = measure(problem, x, residual + rigid, residual)
        memory = SmalseMemory(lagrangian.norm, balance)
        yield SmalseState(x, residual, residuals, memory, minimum.iterations)
        caution *= 0.3 if minimum.iterations == 0 else 1.0
        floor = lagrangian.floor(residuals, parameters.tolerance)
