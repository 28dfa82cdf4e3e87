"""MPGP: conjugate gradients and gradient projections for a quadratic on half lines and discs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.qp.feasible import FeasibleSet
from fenics_contact.qp.problem import Operator
from fenics_contact.qp.reductions import Vector, global_min, global_sum


@dataclass(frozen=True)
class Mpgp:
    """Parameters of the method.

    Attributes:
        expansion: Fixed step ᾱ of the gradient projection times ‖A‖, below 2.
        proportioning: Γ; active constraints are released once the chopped gradient exceeds Γ times the free
            one.
    """

    expansion: float = 1.9
    proportioning: float = 1.0


@dataclass(frozen=True, eq=False)
class BoundedQuadratic:
    """½ xᵀA x − bᵀx over a feasible set.

    Attributes:
        comm: Communicator of the ranks.
        operator: A, symmetric positive semidefinite, owned to owned, collective.
        rhs: b, owned.
        feasible: Half lines and discs.
        norm: Upper estimate of ‖A‖.
    """

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

    Attributes:
        x: The iterate, in the set, owned.
        gradient: A x − b there, owned, updated by recursion within a sequence of CG steps.
        projected: Norm of the projected gradient.
        iterations: Steps of all kinds.
        reached: Whether the projected gradient met the target.
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
    max_iterations: int,
) -> BoundedMinimum:
    """Minimise a quadratic over bounds and discs by MPGP. Collective.

    While the chopped gradient β is dominated by the free gradient φ, the iteration moves by conjugate
    gradients on the free variables; a CG step that would leave the set is cut at the boundary and
    followed by a gradient projection (expansion). Otherwise one gradient projection releases constraints
    (proportioning). The reduced gradients of the test are those of a step of length ᾱ.

    Args:
        quadratic: Objective and set.
        start: Any owned vector; it is projected on the set.
        target: Norm of the projected gradient to be reached, as a function of x; collective.
        parameters: Step length and proportioning.
        max_iterations: Largest number of steps.

    References:
        Z. Dostál, T. Kozubek, Math. Program. 135 (2012), algorithm MPGP.
    """
    step = parameters.expansion / quadratic.norm
    x = quadratic.feasible.project(start)
    gradient = quadratic.gradient(x)
    split = _split(quadratic, x, gradient, step, parameters)
    direction = split.free
    for iteration in range(max_iterations):
        if split.projected <= target(x):
            return BoundedMinimum(x, gradient, split.projected, iteration, True)
        if split.proportional:
            image = quadratic.operator(direction)
            slope, curvature = global_sum(quadratic.comm, gradient @ direction, direction @ image)
            limit = global_min(quadratic.comm, quadratic.feasible.step_to_boundary(x, direction))
            length = slope / curvature if curvature > 0.0 else np.inf
            if length <= limit and np.isfinite(length):
                x, gradient = x - length * direction, gradient - length * image
                split = _split(quadratic, x, gradient, step, parameters)
                overlap = global_sum(quadratic.comm, split.free @ image)[0]
                direction = split.free - (overlap / curvature) * direction
                continue
            limit = limit if np.isfinite(limit) else 0.0
            x, gradient = x - limit * direction, gradient - limit * image
        x = quadratic.projected_step(x, gradient, step)
        gradient = quadratic.gradient(x)
        split = _split(quadratic, x, gradient, step, parameters)
        direction = split.free
    reached = split.projected <= target(x)
    return BoundedMinimum(x, gradient, split.projected, max_iterations, reached)


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
