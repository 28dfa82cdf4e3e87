"""The adjoint of the linearised contact problem: one linear solve with the operators of the state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
from petsc4py import PETSc

from fenics_contact.contact import State
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import CoarseSpace
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
    state: State, partials: Partials, linearised: LinearisedFace, *, tolerance: float = 1e-9, max_iterations: int = 500
) -> Adjoint:
    """Solve the transpose of the linearised state equations. Collective.

    With the bases Z_s (tested) and Z_u (moving) of the face and the curvature κ of slipping discs,

        K w + Bᵀ Z_s z = ∂J/∂u,      Z_uᵀ B w − κ z = Z_uᵀ ∂J/∂λ.

    Eliminating w leaves (Z_uᵀ F Z_s + κ) z − (G Z_u)ᵀ β = Z_uᵀ (B K⁺ ∂J/∂u − ∂J/∂λ) under G Z_s z = Rᵀ ∂J/∂u,
    unsymmetric where discs slip. It is solved by GMRES in the space G Z_s z = 0 with the oblique projector
    I − G_uᵀ (G_s G_uᵀ)⁻¹ G_s, preconditioned by the symmetric part's preconditioner.

    Args:
        state: A converged state.
        partials: Partial derivatives of the objective.
        linearised: Branch of the contact law.
        tolerance: Relative residual.
        max_iterations: Largest number of F-products.

    Raises:
        ConvergenceError: If the tolerance was not reached.
    """
    system = state.system
    problem = system.problem
    Zs, Zu = linearised.tested, linearised.moving
    curvature = linearised.face.curvature
    balance = system.kernel.T @ partials.by_displacement
    load = np.asarray(problem.comm.allreduce(balance))
    oblique = _ObliqueProjector(problem.coarse.restricted(Zs, load), problem.coarse.matrix @ Zu)
    rhs = Zu.T @ (system.jump(system.inverse(partials.by_displacement)) - partials.by_multiplier)

    def operate(z: np.ndarray) -> np.ndarray:
        return Zu.T @ system.apply(Zs @ z) + curvature * z

    def precondition(r: np.ndarray) -> np.ndarray:
        damping = linearised.face.damping
        z = r if problem.preconditioner is None else Zs.T @ problem.preconditioner(Zs @ (damping * r))
        return oblique.tested.project(damping * z)

    # At an energy minimum without slip the adjoint multiplier of the energy is minus the multiplier itself.
    guess = oblique.tested.project(-(Zs.T @ state.solution.multiplier)) + oblique.tested.particular()
    start = min((oblique.tested.particular(), guess), key=lambda z: problem.norm(oblique(rhs - operate(z))))
    residual = oblique(rhs - operate(start))
    scale = max(problem.norm(oblique(rhs)), problem.norm(residual), np.finfo(float).tiny)
    correction, iterations = _gmres(
        problem.comm, lambda v: oblique(operate(precondition(v))), residual, tolerance * scale, max_iterations
    )
    z = start + precondition(correction)
    multiplier = Zs @ z
    particular = system.inverse(partials.by_displacement - system.force(multiplier))
    beta = oblique.coefficients(operate(z) - rhs)
    return Adjoint(particular + system.kernel @ beta, multiplier, iterations)


class _ObliqueProjector:
    """v ↦ v − G_uᵀ (G_s G_uᵀ)⁻¹ G_s v: removes what rigid motions absorb, lands in the kernel of G_s."""

    def __init__(self, tested: CoarseSpace, moving_columns: object) -> None:
        self.tested = tested
        self._moving = moving_columns
        mixed = tested.comm.allreduce((tested.matrix @ self._moving.T).toarray())  # type: ignore[attr-defined]
        self._factor = sl.lu_factor(mixed) if len(mixed) else None

    def coefficients(self, v: np.ndarray) -> np.ndarray:
        """Return (G_s G_uᵀ)⁻¹ G_s v, replicated. Collective."""
        resultant = self.tested.apply(v)
        return resultant if self._factor is None else sl.lu_solve(self._factor, resultant)

    def __call__(self, v: np.ndarray) -> np.ndarray:
        return v - self._moving.T @ self.coefficients(v)  # type: ignore[attr-defined]


def _gmres(comm: object, operator: object, right: np.ndarray, absolute: float, limit: int) -> tuple[np.ndarray, int]:
    """Solve operator(x) = right by PETSc's GMRES without restart. Collective."""
    size = (len(right), PETSc.DETERMINE)
    matrix = PETSc.Mat().createPython((size, size), context=_Shell(operator), comm=comm)
    matrix.setUp()
    b, x = matrix.createVecs()
    b.array_w[:] = right
    if b.norm() <= absolute:
        return np.zeros_like(right), 0
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.GMRES)
    ksp.setGMRESRestart(limit)
    ksp.getPC().setType(PETSc.PC.Type.NONE)
    ksp.setTolerances(rtol=0.0, atol=absolute, max_it=limit)
    ksp.setConvergenceHistory()
    ksp.solve(b, x)
    if ksp.getConvergedReason() <= 0:
        raise ConvergenceError(
            f"the adjoint needs a residual below {absolute:.1e}, reached {ksp.getResidualNorm():.1e} after "
            f"{ksp.getIterationNumber()} iterations: raise max_iterations or loosen the tolerance",
            tuple(ksp.getConvergenceHistory()),
        )
    return np.array(x.array_r), int(ksp.getIterationNumber())


class _Shell:
    """A Python function as a PETSc matrix."""

    def __init__(self, operator: object) -> None:
        self._operator = operator

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.array_w[:] = self._operator(np.array(x.array_r))  # type: ignore[operator]
