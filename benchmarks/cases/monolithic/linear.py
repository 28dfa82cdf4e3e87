"""The block without contact, one symmetric linear system, by the solvers that PETSc's users take."""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

from benchmarks.cases.monolithic.elasticity import PressedBlock


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """The solved system.

    Attributes:
        displacement: u.
        iterations: Of conjugate gradients, 1 of a direct solver.
        residual: ‖f − K u‖ / ‖f‖, computed anew.
    """

    displacement: PETSc.Vec
    iterations: int
    residual: float


def solve_linear(block: PressedBlock, solver: str, tolerance: float = 1e-6) -> LinearSolution:
    """Solve K u = f. Collective.

    Args:
        block: The assembled block.
        solver: ``"gamg"``: conjugate gradients with smoothed aggregation, which is told the rigid motions;
            ``"cholesky"``: factors of MUMPS, ordered by METIS as those of `solve_newton`.
        tolerance: Of the residual.

    Raises:
        RuntimeError: If the residual stays above it.
    """
    K, f, u = block.stiffness, block.load, block.stiffness.createVecRight()
    K.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(K.comm)
    ksp.setOperators(K)
    if solver == "gamg":
        _take_gamg(ksp, block)
    else:
        _take_cholesky(ksp)
    ksp.setTolerances(rtol=tolerance, max_it=1000)
    ksp.solve(f, u)
    r = f.duplicate()
    K.mult(u, r)
    r.aypx(-1.0, f)
    residual = r.norm() / f.norm()
    if not residual <= 1.01 * tolerance:
        raise RuntimeError(f"{solver} needs a residual of {tolerance:.1e}, got {residual:.1e}")
    return LinearSolution(u, ksp.getIterationNumber(), residual)


def _take_gamg(ksp: PETSc.KSP, block: PressedBlock) -> None:
    points = ksp.getOperators()[0].createVecRight()
    owned = points.getLocalSize() // 3
    points.array_w[:] = block.space.tabulate_dof_coordinates()[:owned].ravel()
    ksp.getOperators()[0].setNearNullSpace(PETSc.NullSpace().createRigidBody(points))
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.getPC().setType(PETSc.PC.Type.GAMG)


def _take_cholesky(ksp: PETSc.KSP) -> None:
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    pc.getFactorMatrix().setMumpsIcntl(7, 5)  # METIS
