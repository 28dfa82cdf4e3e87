"""The adjoint of the linearised contact problem: one linear solve with the operators of the state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.contact import State
from fenics_contact.errors import ConvergenceError
from fenics_contact.progress import Task
from fenics_contact.qp import (
    CountedOperator,
    CoupledSystem,
    DualProblem,
    Face,
    FaceSystems,
    Stop,
    projected_gmres,
)
from fenics_contact.shape.linearised_face import LinearisedFace
from fenics_contact.shape.objective import Partials


@dataclass(frozen=True, eq=False)
class Adjoint:
    """Solution of the adjoint system.

    Attributes:
        displacement: w on this rank's torn dofs.
        multiplier: ζ = Z_s z, owned.
        iterations: Krylov iterations, each one F-product.
    """

    displacement: np.ndarray
    multiplier: np.ndarray
    iterations: int


def solve_adjoint(
    state: State,
    partials: Partials,
    linearised: LinearisedFace,
    *,
    tolerance: float = 1e-9,
    max_iterations: int = 500,
    start: np.ndarray | None = None,
) -> Adjoint:
    """Solve the transpose of the linearised state equations. Collective.

    With the bases Z_s (tested) and Z_u (moving) of the state's face and the curvature κ of slipping discs,

        K w + Bᵀ Z_s z = ∂J/∂u,      Z_uᵀ B w − κ z = Z_uᵀ ∂J/∂λ.

    Eliminating w leaves (Z_uᵀ F Z_s + κ) z − (G Z_u)ᵀ β = Z_uᵀ (B K⁺ ∂J/∂u − ∂J/∂λ) under G Z_s z = Rᵀ ∂J/∂u,
    the system of a Newton step with its two bases swapped.

    Args:
        state: A converged state.
        partials: Partial derivatives of the objective.
        linearised: Branch of the contact law.
        tolerance: Relative residual.
        max_iterations: Largest number of F-products.
        start: Multiplier of an adjoint to start from, owned; that of the same objective at a less accurate
            state saves most products. By default minus the multiplier of the state.

    Raises:
        ConvergenceError: If the face does not hold every body, or the tolerance was not reached.
    """
    system = state.dual
    problem, face, factor = _evened_out(system.problem, linearised.face)
    task = Task("adjoint", unit="products")
    operator = CountedOperator(problem.operator, task)
    face_system = FaceSystems(problem, operator).build(face)
    transposed = CoupledSystem.build(face_system, problem.coarse, linearised.moving, linearised.tested)
    if transposed is None:
        raise ConvergenceError(
            "the adjoint needs a contact face that holds every body, but from this state some body can slide "
            "without resistance: choose WeakChoice.HELD, or a design away from this one"
        )
    flexed = system.inverse(partials.by_displacement)
    right = linearised.moving.T @ (factor * (system.jump(flexed) - partials.by_multiplier))
    load = np.asarray(problem.comm.allreduce(system.kernel.T @ partials.by_displacement))
    # At a minimum of the energy without slip the adjoint multiplier is minus the multiplier itself.
    guess = -state.solution.multiplier if start is None else start
    start = transposed.balanced(linearised.tested.T @ (guess / factor), load)
    gradient = transposed.operate(start, problem.operator(linearised.tested @ start)) - right
    scale = max(problem.norm(transposed.oblique(right)), problem.norm(transposed.oblique(gradient)))
    weights = np.ones(len(start))
    with task:
        solved = projected_gmres(transposed, gradient, weights, tolerance * scale, max_iterations)
    if solved.stop is not Stop.CONVERGED:
        raise ConvergenceError(
            f"the adjoint needs a relative residual below {tolerance:.1e}, reached "
            f"{solved.measure / scale:.1e} after {solved.iterations} iterations ({solved.stop.value}): "
            "raise max_iterations or loosen the tolerance"
        )
    multiplier = factor * (linearised.tested @ (start + solved.step))
    final = gradient + transposed.operate(solved.step, solved.product)
    beta = transposed.oblique.coefficients(final)
    displacement = system.inverse(partials.by_displacement - system.force(multiplier)) + system.kernel @ beta
    return Adjoint(displacement, multiplier, solved.iterations)


def _evened_out(problem: DualProblem, face: Face) -> tuple[DualProblem, Face, np.ndarray | float]:
    """Return problem and face in multipliers scaled by stiffness, and the factors, see `Scaling`.

    The factors are even within a contact, so that both bases of a face stay what they are.
    """
    if problem.scaling is None:
        return problem, face, 1.0
    factor = problem.scaling.factor
    flexibility = face.flexibility * factor[problem.layout.tangential[:, 0]] ** 2
    return problem.evened, replace(face, flexibility=flexibility), factor
