"""The adjoint of the linearised contact problem: one linear solve with the operators of the state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.contact import LinearState
from fenics_contact.display import displayed
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti import DualSystem
from fenics_contact.linalg import ROUNDING
from fenics_contact.progress import Task
from fenics_contact.qp import (
    CountedOperator,
    CoupledSystem,
    DualProblem,
    Face,
    FaceSystems,
    Stop,
    apply_unless_zero,
    projected_gmres,
)
from fenics_contact.shape.linearised_face import LinearisedFace
from fenics_contact.shape.objective import Partials

#: Said where a face does not hold every body.
NOT_HELD = (
    "the adjoint needs a contact face that holds every body, but from this state some body can slide without "
    "resistance: refine the contact until more points hold it, add a support, choose WeakChoice.HELD where "
    "points are weakly active, or take a design away from this one"
)
#: Derivatives along a rigid motion below this fraction of their summands are rounding.
UNFELT = 1e-9


@displayed
@dataclass(frozen=True, eq=False)
class Adjoint:
    """Solution of the adjoint system.

    Attributes:
        displacement: w on this rank's torn dofs.
        multiplier: ζ = Z_s z, owned.
        motions: β, coefficients of the rigid motions in w, shape (m,), replicated.
        iterations: Krylov iterations, each one F-product.
    """

    displacement: np.ndarray
    multiplier: np.ndarray
    motions: np.ndarray
    iterations: int


def solve_adjoint(
    state: LinearState,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float = 1e-9,
    max_iterations: int = 500,
    start: np.ndarray | None = None,
) -> Adjoint:
    """Solve the transpose of the linearised state equations. Collective.

    With the bases Z_s (test) and Z_u (trial) of the state's face and the curvature κ of slipping discs,

        K w + Bᵀ Z_s z = ∂J/∂u,      Z_uᵀ B w − κ z = Z_uᵀ ∂J/∂λ.

    Eliminating w leaves (Z_uᵀ F Z_s + κ) z − (G Z_u)ᵀ β = Z_uᵀ (B K⁺ ∂J/∂u − ∂J/∂λ) under G Z_s z = Rᵀ ∂J/∂u,
    the system of a Newton step with its two bases swapped.

    Everything is linear in the objective, also the start and the scale of the residual: rescaling the
    objective rescales the adjoint, to rounding.

    Args:
        partials: Partial derivatives of the objective.
        linearised: Branch of the contact law.
        tolerance: Residual relative to that of the objective alone; what rounding leaves of the sums that it
            is projected from is small enough, as where the objective is stationary in the state.
        max_iterations: Largest number of F-products.
        start: Multiplier of an adjoint to start from, owned, in any scaling; that of the same objective at a
            less accurate state saves most products. By default the multiplier of the state.

    Raises:
        ConvergenceError: If the face does not hold every body, the objective changes along a rigid motion
            that nothing resists, or the tolerance was not reached.
    """
    system = state.dual
    _require_held(system, partials.by_displacement)
    problem, face, factor = _scaled(system.problem, linearised.face)
    task = Task("adjoint", unit="products")
    operator = CountedOperator(problem.operator, lambda products, _: task.step(products))
    face_system = FaceSystems(problem, operator).build(face)
    transposed = CoupledSystem.build(
        face_system, problem.coarse, linearised.moving, linearised.tested, damped=True
    )
    if transposed is None:
        raise ConvergenceError(NOT_HELD)
    flexed = system.inverse(partials.by_displacement)
    right = linearised.moving.T @ (factor * (system.jump(flexed) - partials.by_multiplier))
    load = np.asarray(problem.comm.allreduce(system.kernel.T @ partials.by_displacement))
    if partials.by_motion is not None:
        load += system.points.T @ partials.by_motion
    # At a minimum of the energy without slip the adjoint multiplier is minus the multiplier itself.
    guess = state.solution.multiplier if start is None else start
    begin = _begin(problem, transposed, right, load, linearised.tested.T @ (guess / factor))
    weights = np.ones(len(right))
    small = max(tolerance * begin.size, begin.rounding)
    with task:
        solved = projected_gmres(transposed, begin.gradient, weights, small, max_iterations)
    if solved.stop is not Stop.CONVERGED:
        raise ConvergenceError(
            f"the adjoint needs a relative residual below {small / (begin.size or 1.0):.1e}, reached "
            f"{solved.measure / (begin.size or 1.0):.1e} after {solved.iterations} iterations "
            f"({solved.stop.value}): raise max_iterations or loosen the tolerance"
        )
    multiplier = factor * (linearised.tested @ (begin.point + solved.step))
    final = begin.gradient + transposed.operate(solved.step, solved.product)
    beta = transposed.oblique.coefficients(final)
    displacement = system.inverse(partials.by_displacement - system.force(multiplier)) + system.kernel @ beta
    return Adjoint(displacement, multiplier, beta, solved.iterations)


@dataclass(frozen=True, eq=False)
class _Begin:
    """The start of the iteration.

    Attributes:
        point: z, shape (n_face,).
        gradient: Residual of the equations there, shape (n_face,).
        size: Norm of the projected residual due to the objective alone, independent of the guess.
        rounding: Norm of what rounding leaves of a residual that the projection removes.
    """

    point: np.ndarray
    gradient: np.ndarray
    size: float
    rounding: float


def _begin(
    problem: DualProblem, transposed: CoupledSystem, right: np.ndarray, load: np.ndarray, guess: np.ndarray
) -> _Begin:
    """Return the shortest z that balances the load plus that multiple of the guess that fits best.

    The guess has its own units (forces, or those of another objective), so its factor is computed.
    Collective; one product each for load and guess.
    """

    def image(z: np.ndarray) -> np.ndarray:
        return transposed.operate(z, apply_unless_zero(problem, problem.operator, transposed.moving @ z))

    bearing = transposed.balanced(np.zeros_like(right), load)
    direction = transposed.balanced(guess, np.zeros_like(load))
    borne, turned = image(bearing), image(direction)
    gradient = borne - right
    rest, along = transposed.oblique(gradient), transposed.oblique(turned)
    slope, square = problem.dot(along, rest), problem.dot(along, along)
    share = -slope / square if square > 0.0 else 0.0
    size = max(problem.norm(transposed.oblique(right)), problem.norm(rest))
    rounding = ROUNDING * max(problem.norm(part) for part in (right, borne, share * turned))
    return _Begin(bearing + share * direction, gradient + share * turned, size, rounding)


def _require_held(system: DualSystem, by_displacement: np.ndarray) -> None:
    """Reject objectives that change along motions that nothing resists. Collective.

    Such motions are fixed by convention, not by the state, and how the convention changes with the shape is
    not part of the adjoint.
    """
    work = system.unheld.T @ by_displacement
    size = abs(system.unheld).T @ np.abs(by_displacement)
    work, size = system.problem.comm.allreduce(np.stack([work, size]))
    if np.any(np.abs(work) > UNFELT * size):
        raise ConvergenceError(
            "the adjoint needs an objective that is the same wherever nothing holds a body, but this one "
            "changes along a rigid motion that meets no resistance (`State.unheld`): add a support, or use "
            "stresses, energies or contact forces"
        )


def _scaled(problem: DualProblem, face: Face) -> tuple[DualProblem, Face, np.ndarray | float]:
    """Return problem and face in multipliers scaled by stiffness, and the factors, see `Scaling`.

    The factors are uniform within a contact point, so that both bases of a face are unchanged.
    """
    if problem.scaling is None:
        return problem, face, 1.0
    factor = problem.scaling.factor
    flexibility = face.flexibility * factor[problem.layout.tangential[:, 0]] ** 2
    return problem.scaled_problem, replace(face, flexibility=flexibility), factor
