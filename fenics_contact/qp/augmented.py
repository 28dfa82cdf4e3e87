"""The augmented Lagrangian of the dual problem, scaled so that its Hessian has norm 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from fenics_contact._libraries import MPI
from fenics_contact.qp.feasible import FeasibleSet
from fenics_contact.qp.iterate import Start
from fenics_contact.qp.mpgp import BoundedMinimum, BoundedQuadratic
from fenics_contact.qp.problem import DualProblem, Operator
from fenics_contact.qp.reductions import Vector, global_min, global_sum
from fenics_contact.qp.solution import Residuals


def largest_eigenvalue(
    comm: MPI.Comm, operator: Operator, size: int, *, accuracy: float = 0.05, max_products: int = 40
) -> float:
    """Return an upper estimate of ‖A‖ by Lanczos with full reorthogonalisation. Collective.

    The largest Ritz value θ is a lower bound; θ plus the residual norm of its Ritz vector bounds from
    above the eigenvalue it belongs to. Iterated until the two agree to ``accuracy``; the upper one is
    returned, because a fixed step length 1.9/‖A‖ must not be too long.

    Args:
        comm: Communicator over which the vectors are distributed.
        operator: Symmetric positive semidefinite A, owned to owned, collective.
        size: Length of this rank's owned vector.
        accuracy: Relative distance of the bounds at which to stop.
        max_products: Largest number of operator applications.

    Returns:
        The estimate, the same on every rank; 0 for an operator that maps the start to zero.
    """
    start = np.random.default_rng(comm.rank).standard_normal(size)
    basis: list[Vector] = [np.asarray(start / (_norm(comm, start) or 1.0), dtype=np.float64)]
    diagonal: list[float] = []
    beside: list[float] = []
    for _ in range(max_products):
        image = operator(basis[-1])
        block = np.array(basis)
        weights = global_sum(comm, block @ image)
        image = image - weights @ block
        image -= global_sum(comm, block @ image) @ block
        diagonal.append(float(weights[-1]))
        length = _norm(comm, image)
        values, vectors = scipy.linalg.eigh_tridiagonal(diagonal, beside)
        bound = float(values[-1] + length * abs(vectors[-1, -1]))
        if bound - values[-1] <= accuracy * values[-1] or length <= 1e-14 * abs(bound):
            break
        beside.append(length)
        basis.append(np.asarray(image / length, dtype=np.float64))
    return bound


def _norm(comm: MPI.Comm, x: Vector) -> float:
    return float(np.sqrt(global_sum(comm, x @ x)[0]))


class AugmentedLagrangian:
    """L(λ, v) = ½ λᵀ(P F P/‖PFP‖ + Q) λ − (P(d − F λ₀)/‖PFP‖ + λ₀ − v)ᵀλ + const.

    λ₀ = Gᵀ(G Gᵀ)⁻¹e, Q = I − P, and v in range(Gᵀ) is the multiplier of Q λ = λ₀, which is equivalent to G λ
    = e. Where that holds, L and ½ λᵀF λ − dᵀλ differ by a factor and a constant.

    Attributes:
        norm: Upper estimate of ‖PFP‖.
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
