"""SMALSE-M: equilibrium by an augmented Lagrangian, bounds and discs by MPGP inside. Robust but slow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import ROUNDING
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.cones import FeasibleSet, TrescaLaw
from fenics_contact.qp.problem import DualProblem, Operator
from fenics_contact.qp.reductions import Vector, global_min, global_sum
from fenics_contact.qp.solution import (
    DualSolution,
    Residuals,
    SmalseMemory,
    SolverStep,
    Start,
    StoppedError,
    certify,
    count_status,
    measure,
)


@dataclass(frozen=True)
class Mpgp:
    """Modified proportioning with gradient projections: the inner iteration of `Smalse`.

    It minimises ½ xᵀA x − bᵀx over bounds and discs: conjugate gradients on the free variables, gradient
    projections of fixed length ᾱ where the set of active constraints changes. The defaults suit all problems,
    as `Smalse` scales A to ‖A‖ = 1.

    Attributes:
        expansion: ᾱ‖A‖, the length of gradient projections, in (0, 2): any of them decreases the quadratic.
        proportioning: Γ > 0. A gradient projection releases active constraints once their chopped gradient
            is more than Γ times the free one, in reduced norms. A larger Γ stays on a face for longer.

    Raises:
        InvalidInputError: A parameter is out of its range.

    Example:
        >>> careful = Smalse(tolerance=1e-8, mpgp=Mpgp(expansion=1.0))
        >>> careful.mpgp.proportioning
        1.0

    References:
        Z. Dostál, T. Kozubek, An optimal algorithm and superrelaxation for minimization of a quadratic
        function subject to separable convex constraints with applications, Math. Program. 135 (2012).
    """

    expansion: float = 1.9
    proportioning: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges for which convergence is proven."""
        _require_between("expansion of Mpgp, ᾱ‖A‖,", self.expansion, 2.0)
        _require_between("proportioning of Mpgp, Γ,", self.proportioning, np.inf)


def _require_between(name: str, value: float, upper: float) -> None:
    """Raise unless 0 < value < upper."""
    if not 0.0 < value < upper:
        limit = str(upper).replace("inf", "∞")
        raise InvalidInputError(f"{name} must be in (0, {limit}), got {value}: leave it out for the default")


@dataclass(frozen=True, eq=False)
class BoundedQuadratic:
    """½ xᵀA x − bᵀx over a feasible set."""

    comm: MPI.Comm
    operator: Operator
    rhs: Vector
    feasible: FeasibleSet
    norm: float

    def gradient(self, x: Vector) -> Vector:
        """Return A x − b. Collective; one product."""
        return self.operator(x) - self.rhs

    def projected_step(self, x: Vector, gradient: Vector, step: float) -> Vector:
        """Return the projection of x − step·g on the set."""
        return self.feasible.project(x - step * gradient)


@dataclass(frozen=True, eq=False)
class BoundedMinimum:
    """The result of MPGP.

    `gradient`: A x − b there, owned, updated by recursion within a sequence of CG steps; `reached`: whether
    the projected gradient met the target.
    """

    x: Vector
    gradient: Vector
    projected: float
    iterations: int
    reached: bool


@dataclass(frozen=True, eq=False)
class _Split:
    """Free gradient and the three numbers that choose the next step."""

    free: Vector
    projected: float
    proportional: bool


def minimise(
    quadratic: BoundedQuadratic,
    start: Vector,
    target: Callable[[Vector], float],
    *,
    parameters: Mpgp,
    max_products: int,
) -> BoundedMinimum:
    """Minimise a quadratic over bounds and discs by MPGP, with one product more at most. Collective.

    While the chopped gradient β is dominated by the free gradient φ, the iteration moves by conjugate
    gradients on the free variables; a CG step that would leave the set is cut at the boundary and followed by
    a gradient projection (expansion). Otherwise one gradient projection releases constraints (proportioning).
    The reduced gradients of the test are those of a step of length ᾱ.

    References:
        Z. Dostál, T. Kozubek, Math. Program. 135 (2012), algorithm MPGP.
    """
    step = parameters.expansion / quadratic.norm
    x = quadratic.feasible.project(start)
    gradient = quadratic.gradient(x)
    split = _split(quadratic, x, gradient, step, parameters)
    direction = split.free
    iterations, products = 0, 1
    while not (reached := split.projected <= target(x)) and products < max_products:
        iterations += 1
        products += 1
        if split.proportional:  # 1. x is proportional: a trial step of conjugate gradients
            image = quadratic.operator(direction)
            slope, curvature = global_sum(quadratic.comm, gradient @ direction, direction @ image)
            limit = global_min(quadratic.comm, quadratic.feasible.step_to_boundary(x, direction))
            length = slope / curvature if curvature > 0.0 else np.inf
            if length <= limit and np.isfinite(length):  # 2. feasible: take it
                x, gradient = x - length * direction, gradient - length * image
                split = _split(quadratic, x, gradient, step, parameters)
                overlap = global_sum(quadratic.comm, split.free @ image)[0]
                direction = split.free - (overlap / curvature) * direction
                continue
            # 3. Not feasible: as far as the boundary, then expansion by the projection below.
            limit = limit if np.isfinite(limit) else 0.0
            x, gradient = x - limit * direction, gradient - limit * image
            products += 1
        # 4. Expansion, or proportioning where x is not proportional.
        x = quadratic.projected_step(x, gradient, step)
        gradient = quadratic.gradient(x)
        split = _split(quadratic, x, gradient, step, parameters)
        direction = split.free
    return BoundedMinimum(x, gradient, split.projected, iterations, reached)


def _split(quadratic: BoundedQuadratic, x: Vector, gradient: Vector, step: float, parameters: Mpgp) -> _Split:
    """Split the gradient at x into free and chopped parts and compare their reduced forms."""
    feasible = quadratic.feasible
    active = feasible.active(x)
    projected = feasible.projected_gradient(x, gradient)
    free, chopped = np.where(active, 0.0, gradient), np.where(active, projected, 0.0)
    reduced = (x - quadratic.projected_step(x, gradient, step)) / step
    free_part, chopped_part, square = global_sum(
        quadratic.comm, reduced @ free, reduced @ chopped, projected @ projected
    )
    proportional = chopped_part <= parameters.proportioning**2 * free_part
    return _Split(free, float(np.sqrt(square)), bool(proportional))


def largest_eigenvalue(
    comm: MPI.Comm, operator: Operator, size: int, *, accuracy: float = 0.05, max_products: int = 40
) -> float:
    """Return an upper estimate of ‖A‖ by Lanczos with full reorthogonalisation. Collective.

    The largest Ritz value θ is a lower bound; θ plus the residual norm of its Ritz vector bounds from above
    the eigenvalue it belongs to. Iterated until the two agree to ``accuracy``; the upper one is returned,
    because a fixed step length 1.9/‖A‖ must not be too long.
    """
    start = np.random.default_rng(comm.rank).standard_normal(size)
    basis: list[Vector] = [np.asarray(start / (_norm(comm, start) or 1.0), dtype=np.float64)]
    diagonal: list[float] = []
    off_diagonal: list[float] = []
    for _ in range(max_products):
        image = operator(basis[-1])
        block = np.array(basis)
        weights = global_sum(comm, block @ image)
        image = image - weights @ block
        image -= global_sum(comm, block @ image) @ block
        diagonal.append(float(weights[-1]))
        length = _norm(comm, image)
        values, vectors = scipy.linalg.eigh_tridiagonal(diagonal, off_diagonal)
        bound = float(values[-1] + length * abs(vectors[-1, -1]))
        if bound - values[-1] <= accuracy * values[-1] or length <= 1e-14 * abs(bound):
            break
        off_diagonal.append(length)
        basis.append(np.asarray(image / length, dtype=np.float64))
    return bound


def _norm(comm: MPI.Comm, x: Vector) -> float:
    return float(np.sqrt(global_sum(comm, x @ x)[0]))


class AugmentedLagrangian:
    """L(λ, v) = ½ λᵀ(P F P/‖PFP‖ + Q) λ − (P(d − F λ₀)/‖PFP‖ + λ₀ − v)ᵀλ + const.

    λ₀ = Gᵀ(G Gᵀ)⁻¹e, Q = I − P, and v in range(Gᵀ) is the multiplier of Q λ = λ₀, which is equivalent to G λ
    = e. Where that holds, L and ½ λᵀF λ − dᵀλ differ by a factor and a constant.
    """

    def __init__(self, problem: DualProblem, start: Start) -> None:
        """Estimate ‖PFP‖ unless the start knows it, and build the right side. Collective."""
        self._problem, self._operator, self._coarse = problem, start.operator, problem.coarse
        self._particular = self._coarse.particular()
        if start.memory is None:
            self.norm = largest_eigenvalue(problem.comm, self._projected, problem.layout.size) or 1.0
        else:
            self.norm = start.memory.norm
        if start.cold:
            flexed = problem.rhs - start.iterate.product
        elif problem.norm(self._particular) > 0.0:
            flexed = problem.rhs - start.operator(self._particular)
        else:
            flexed = problem.rhs
        self._base = self._coarse.project(flexed) / self.norm + self._particular
        self._size = problem.norm(self._base)
        softest = problem.diagonal[problem.layout.contact].min(initial=np.inf)
        softest = global_min(problem.comm, float(softest))
        self._softest = softest if np.isfinite(softest) else 0.0

    def quadratic(self, feasible: FeasibleSet, v: Vector) -> BoundedQuadratic:
        """Return L(·, v) on a feasible set."""
        return BoundedQuadratic(self._problem.comm, self._penalised, self._base - v, feasible, 1.0)

    def first_multiplier(self, residual: Vector) -> Vector:
        """Return v for which the gradient of L, times ‖PFP‖, is a given residual r. Collective."""
        return np.asarray((residual - self._coarse.project(residual)) / self.norm, dtype=np.float64)

    def drift(self, x: Vector) -> Vector:
        """Return Q x − λ₀, owned. Collective."""
        return x - self._coarse.project(x) - self._particular

    def imbalance(self, x: Vector) -> float:
        """Return ‖Q x − λ₀‖. Collective."""
        return self._coarse.norm(self._coarse.residual(x)) if self._coarse.m else 0.0

    def value(self, minimum: BoundedMinimum, v: Vector) -> float:
        """Return L at a minimum of L(·, v), up to a constant that no iteration changes. Collective."""
        x, rhs = minimum.x, self._base - v
        half, shift = global_sum(
            self._problem.comm, 0.5 * (x @ (minimum.gradient - rhs)), v @ self._particular
        )
        return float(half - shift)

    def floor(self, residuals: Residuals, tolerance: float) -> float:
        """Return a projected gradient small enough for the natural and the gluing residual."""
        scales = (residuals.gluing_scale, residuals.force_scale * self._softest)
        scale = min((scale for scale in scales if scale > 0.0), default=0.0)
        return 0.3 * tolerance * scale / self.norm

    def stopping_rule(self, balance: float, loosest: float, floor: float) -> Callable[[Vector], float]:
        """Return the target of the inner iteration, max(floor, min(M‖Q x − λ₀‖, η‖b‖))."""

        def target(x: Vector) -> float:
            return max(min(balance * self.imbalance(x), loosest * self._size), floor)

        return target

    def _projected(self, x: Vector) -> Vector:
        return self._coarse.project(self._operator(self._coarse.project(x)))

    def _penalised(self, x: Vector) -> Vector:
        inside = self._coarse.project(x)
        return self._coarse.project(self._operator(inside)) / self.norm + (x - inside)


@dataclass(frozen=True)
class Smalse:
    """Semimonotonic augmented Lagrangians for bound and equality constraints, with MPGP inside.

    The operator is scaled so that ‖PFP‖ = 1 and G is used as if orthonormalised, so that the penalty is 1
    and no parameter depends on units. Only for slip bounds that are given (Tresca, frictionless).

    Attributes:
        tolerance: Every residual of `Residuals` ends below it.
        max_products: Give up after that many F-products.
        balance: First M > 0: the inner iteration stops at ‖projected gradient‖ ≤ M·(equilibrium error).
        loosest: η > 0: but not before ‖projected gradient‖ ≤ η‖b‖.
        balance_reduction: 1/β in (0, 1), the factor on M when the Lagrangian increases too little.
        mpgp: Parameters of the inner iteration.
        rounded: Least tolerance where products are in single precision.

    Raises:
        InvalidInputError: M or η is not positive, or the factor on M not in (0, 1).

    Example:
        >>> FixedPoint(Smalse(tolerance=1e-8, balance=0.5)).tolerance  # for Coulomb's law
        1e-08

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
    rounded: float = 1e-5

    def __post_init__(self) -> None:
        """Check the ranges for which convergence is proven."""
        _require_between("balance of Smalse, M,", self.balance, np.inf)
        _require_between("loosest of Smalse, η,", self.loosest, np.inf)
        _require_between("balance_reduction of Smalse, 1/β,", self.balance_reduction, 1.0)

    def with_tolerance(self, tolerance: float) -> Smalse:
        """Return the solver with another tolerance."""
        return replace(self, tolerance=tolerance)

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InvalidInputError: The slip bound follows the multiplier.
            ConvergenceError: The product budget was used up; carries the history.
        """
        if problem.compliance.gives_way:
            raise InvalidInputError("SMALSE needs no closure laws or stick stiffness: use FaceNewton")
        if problem.exact is not None and self.tolerance < self.rounded:
            raise InvalidInputError(
                f"SMALSE needs subdomains in double precision below a tolerance of {self.rounded:g}, got "
                f"{self.tolerance:g} with compact ones: use FaceNewton, allow more memory, or loosen it"
            )
        if not isinstance(problem.law, TrescaLaw):
            raise InvalidInputError(
                f"SMALSE needs a given slip bound, got {type(problem.law).__name__}: use FaceNewton"
            )
        operator, history = start.operator, list[SolverStep]()
        for state in outer_iterations(problem, start, self):
            history.append(state.record(len(history), problem, operator.products))
            start.reached(history[-1])
            if state.residuals.within(0.5 * self.tolerance):
                product = operator.exactly(state.multiplier)
                answer = certify(problem, state.multiplier, product, state.residual)
                if answer.iterate.residuals.within(self.tolerance):
                    return answer.solution(history, operator.products, state.memory)
            if operator.products >= self.max_products:
                break
        answer = certify(problem, state.multiplier, operator.exactly(state.multiplier), state.residual)
        raise StoppedError(
            f"SMALSE needs residuals below {self.tolerance:.1e}, got {history[-1]}: raise max_products",
            history,
            answer.iterate,
        )


@dataclass(frozen=True, eq=False)
class SmalseState:
    """The multiplier after an outer iteration, with residuals that cost no further product.

    `residual`: ‖PFP‖ times the gradient of the Lagrangian: F λ − d − Gᵀα up to F times the equilibrium error,
    owned.
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
        # 1. The Lagrangian is minimised until its projected gradient is below M times the equilibrium error.
        minimum = minimise(
            lagrangian.quadratic(feasible, v),
            x,
            lagrangian.stopping_rule(balance, parameters.loosest, caution * floor),
            parameters=parameters.mpgp,
            max_products=max(parameters.max_products - start.operator.products, 1),
        )
        x, residual = minimum.x, lagrangian.norm * minimum.gradient
        # 2. M falls where the Lagrangian has not risen enough. 3. The multiplier of equilibrium.
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
