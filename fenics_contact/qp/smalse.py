"""SMALSE-M: equilibrium by an augmented Lagrangian, bounds and discs by MPGP inside. Safe and slow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp.certify import certify
from fenics_contact.qp.feasible import FeasibleSet
from fenics_contact.qp.mpgp import BoundedMinimum, BoundedQuadratic, Mpgp, minimise
from fenics_contact.qp.norm_estimate import largest_eigenvalue
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_min, global_sum
from fenics_contact.qp.residual import Residuals, measure
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import DualSolution, SmalseMemory, SolverStep
from fenics_contact.qp.start import Start, count_status


@dataclass(frozen=True)
class Smalse:
    """Semimonotonic augmented Lagrangians for bound and equality constraints, with MPGP inside.

    The operator is scaled so that ‖PFP‖ = 1 and G is used as if orthonormalised, so that the penalty is 1
    and neither parameter depends on units. Only for slip bounds that are given (Tresca, frictionless).

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_products: Give up after that many F-products.
        balance: First M: the inner iteration stops at ‖projected gradient‖ ≤ M·(equilibrium error).
        loosest: η: but never before ‖projected gradient‖ ≤ η‖b‖.
        balance_reduction: Factor on M when the Lagrangian rises too little.
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

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            ConvergenceError: The product budget was used up; carries the history.
        """
        operator = start.operator
        feasible = law.feasible(start.multiplier)
        history: list[SolverStep] = []
        for state in augmented_lagrangians(problem, feasible, start, self):
            history.append(state.record(len(history), problem, operator.products))
            if state.residuals.within(0.5 * self.tolerance):
                answer = certify(problem, operator, law, state.multiplier, state.residual)
                if answer.residuals.within(self.tolerance):
                    return answer.solution(problem, history, operator.products, state.memory)
            if operator.products >= self.max_products:
                break
        raise ConvergenceError(
            f"SMALSE needs residuals below {self.tolerance:.1e}, reached {history[-1]} and stopped at its "
            f"limit of {self.max_products} products: raise max_products, or check that the load can be "
            "balanced by contact and friction at all",
            history,
        )


@dataclass(frozen=True, eq=False)
class SmalseState:
    """The multiplier after an outer iteration, with residuals that cost no further product.

    Attributes:
        multiplier: λ in Λ(Ψ), equilibrium up to the penalty, owned.
        residual: nrm·(gradient of the Lagrangian): F λ − d − Gᵀα up to F times the equilibrium error.
        residuals: Measured with `residual`.
        memory: Norm estimate and current M.
        iterations: MPGP steps of this outer iteration.
        slip_bound: Ψ, owned.
    """

    multiplier: Vector
    residual: Vector
    residuals: Residuals
    memory: SmalseMemory
    iterations: int
    slip_bound: Vector

    def record(self, iteration: int, problem: DualProblem, products: int) -> SolverStep:
        """Return the line for the history. Collective."""
        closed, stick, slip = count_status(problem, self.multiplier, self.slip_bound)
        note = f"{self.iterations} MPGP steps, M = {self.memory.balance:.0e}"
        return SolverStep("SMALSE", iteration, products, self.residuals, closed, stick, slip, note)


def augmented_lagrangians(
    problem: DualProblem, feasible: FeasibleSet, start: Start, parameters: Smalse
) -> Iterator[SmalseState]:
    """Yield the state after every outer iteration, without end. Collective.

    With λ₀ = Gᵀ(G Gᵀ)⁻¹e and Q = I − P the augmented Lagrangian, divided by ‖PFP‖, is
    ½ λᵀ(P F P/‖PFP‖ + Q) λ − (P(d − F λ₀)/‖PFP‖ + λ₀ − v)ᵀλ, and v ← v + Q λ − λ₀ in range(Gᵀ).
    """
    lagrangian = _Lagrangian(problem, start)
    x, v = feasible.project(start.multiplier), lagrangian.first_multiplier(start)
    balance = parameters.balance if start.memory is None else start.memory.balance
    previous: float | None = None
    caution = 1.0
    floor = lagrangian.floor(start.residuals, parameters.tolerance)
    while True:
        quadratic = lagrangian.quadratic(feasible, v)
        target = _target(lagrangian, balance, parameters.loosest, caution * floor)
        budget = max(parameters.max_products - start.operator.products, 1)
        minimum = minimise(quadratic, x, target, parameters=parameters.mpgp, max_iterations=budget)
        x = minimum.x
        error, value = lagrangian.imbalance(x), lagrangian.value(minimum, quadratic, v)
        if previous is not None and value < previous + 0.5 * error**2:
            balance *= parameters.balance_reduction
        previous = value
        v = v + lagrangian.drift(x)
        residual = lagrangian.norm * minimum.gradient
        product = residual + (start.product - start.residual)  # α of the start: only a scale needs it
        residuals = measure(problem, feasible, x, product, residual)
        yield SmalseState(
            x,
            residual,
            residuals,
            SmalseMemory(lagrangian.norm, balance),
            minimum.iterations,
            feasible.slip_bound,
        )
        caution *= 0.3 if minimum.iterations == 0 else 1.0
        floor = lagrangian.floor(residuals, parameters.tolerance)


class _Lagrangian:
    """The quadratic of the inner problems: P F P/‖PFP‖ + Q and its right side."""

    def __init__(self, problem: DualProblem, start: Start) -> None:
        self._problem, self._operator, self._coarse = problem, start.operator, problem.coarse
        self._particular = self._coarse.particular()
        if start.memory is None:
            estimate = largest_eigenvalue(problem.comm, self._projected, problem.layout.size)
            self.norm = estimate or 1.0
        else:
            self.norm = start.memory.norm
        flexed = problem.rhs
        if self._coarse.norm(self._coarse.load) > 0.0:
            flexed = flexed - (start.operator(self._particular) if start.warm else start.product)
        self._base = self._coarse.project(flexed) / self.norm + self._particular
        self.size = problem.norm(self._base)
        softest = problem.diagonal[problem.layout.contact].min(initial=np.inf)
        self._softest = global_min(problem.comm, float(softest))

    def _projected(self, x: Vector) -> Vector:
        return self._coarse.project(self._operator(self._coarse.project(x)))

    def _penalised(self, x: Vector) -> Vector:
        inside = self._coarse.project(x)
        return self._coarse.project(self._operator(inside)) / self.norm + (x - inside)

    def quadratic(self, feasible: FeasibleSet, v: Vector) -> BoundedQuadratic:
        return BoundedQuadratic(self._problem.comm, self._penalised, self._base - v, feasible, 1.0)

    def first_multiplier(self, start: Start) -> Vector:
        """Return v for which the gradient at the start is its residual, up to scale."""
        return (start.residual - self._coarse.project(start.residual)) / self.norm

    def drift(self, x: Vector) -> Vector:
        """Return Q x − λ₀, owned."""
        return x - self._coarse.project(x) - self._particular

    def imbalance(self, x: Vector) -> float:
        """Return ‖Q x − λ₀‖."""
        return self._coarse.norm(self._coarse.residual(x)) if self._coarse.m else 0.0

    def value(self, minimum: BoundedMinimum, quadratic: BoundedQuadratic, v: Vector) -> float:
        """Return the augmented Lagrangian at a minimum, up to a constant that no iteration changes."""
        x = minimum.x
        half, shift = global_sum(
            self._problem.comm, 0.5 * (x @ (minimum.gradient - quadratic.rhs)), v @ self._particular
        )
        return float(half - shift)

    def floor(self, residuals: Residuals, tolerance: float) -> float:
        """Return the projected gradient that is surely small enough for the natural and gluing residual."""
        allowed = [s for s in (residuals.gluing_scale, residuals.force_scale * self._softest) if s > 0.0]
        scale = min(allowed, default=0.0)
        return 0.3 * tolerance * scale / self.norm if np.isfinite(scale) else 0.0


def _target(
    lagrangian: _Lagrangian, balance: float, loosest: float, floor: float
) -> Callable[[Vector], float]:
    """Return the inner stopping rule, max(floor, min(M‖Q x − λ₀‖, η‖b‖))."""

    def target(x: Vector) -> float:
        return max(min(balance * lagrangian.imbalance(x), loosest * lagrangian.size), floor)

    return target
