"""Newton steps of problems whose tangent changes: one face of a dual problem with stiff rigid motions.

Under stress, rigid motions of a subdomain have a stiffness. With C the columns that hold them, K_ρ = K + C Cᵀ
and the modes Φ = K_ρ⁻¹C, the tangent problem in increments of multipliers and amplitudes β of the modes is

    F δλ − Gᵀβ = d,   G δλ + S β = e,   F = B K_ρ⁻¹Bᵀ,   G = ΦᵀBᵀ,   S = I − CᵀΦ,

exact for any columns. Without stress S = 0, and it is the usual problem with its equilibrium G δλ = e.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.qp import (
    CountedOperator,
    CoupledSystem,
    DualProblem,
    Face,
    FacePreconditioner,
    FaceSystems,
    Kept,
    Stop,
    Vector,
    classify,
    global_max,
    global_sum,
    gmres,
)


@displayed
@dataclass(frozen=True, eq=False)
class TangentProblem:
    """The linearisation of a nonlinear problem at a multiplier λ and a displacement u.

    Attributes:
        problem: F, d and e of increments, G, the law of friction of λ itself; d = B K_ρ⁻¹ r + (B u − c) and
            e = Φᵀ r with the forces r = f − f_int(u) − Bᵀλ out of balance.
        stiffness: S of the rigid motions, shape (m, m), replicated.
        multiplier: λ, owned.
        residual: c − B u, owned: the residual r of the natural map, gaps and minus the slip.
        compliance: Compliances of rows of equality, owned, shape (size,): B u = c + compliance · λ; of either
            sign, zero on most rows.
    """

    problem: DualProblem
    stiffness: sp.csr_matrix
    multiplier: Vector
    residual: Vector
    compliance: Vector

    def scaled(self) -> TangentProblem:
        """Return the problem in the multipliers of `DualProblem.scaling`, itself where there is none."""
        if self.problem.scaling is None:
            return self
        s = self.problem.scaling.factor
        return replace(
            self,
            problem=self.problem.scaled_problem,
            multiplier=np.asarray(self.multiplier / s, dtype=np.float64),
            residual=np.asarray(self.residual * s, dtype=np.float64),
            compliance=np.asarray(self.compliance * s**2, dtype=np.float64),
        )


@displayed
@dataclass(frozen=True, eq=False)
class TangentStep:
    """One Newton step.

    Attributes:
        multiplier: λ + δλ, owned.
        motions: β, shape (m,), replicated.
        face: The face on which it was taken.
        products: Applications of F.
        stop: Why the Krylov method ended.
    """

    multiplier: Vector
    motions: Vector
    face: Face
    products: int
    stop: Stop


def tangent_step(
    tangent: TangentProblem, step: Vector, forcing: float, floor: float, max_products: int
) -> TangentStep | None:
    """Solve the face that the natural map selects; None where it does not hold every body. Collective.

    Args:
        tangent: The linearised problem.
        step: ρ of the natural map, owned; zero on equality rows.
        forcing: Residual of the linear system relative to that of its start.
        floor: A residual that is small enough, [length].
        max_products: Largest number of products.
    """
    factor = None if tangent.problem.scaling is None else tangent.problem.scaling.factor
    at = tangent.scaled()
    problem = at.problem
    bound = problem.law.bound(at.multiplier)
    ratio = step if factor is None else np.asarray(step / factor**2, dtype=np.float64)
    face = classify(problem.layout, bound, at.multiplier, at.residual, ratio)
    operator = CountedOperator(problem.operator)
    solved = _StiffFace.build(at, face, operator)
    if solved is None:
        return None
    change, motions, stop = solved.solve(forcing, floor, max_products)
    multiplier = at.multiplier + change
    if factor is not None:
        multiplier = multiplier * factor
    return TangentStep(multiplier, motions, face, operator.products, stop)


@dataclass(frozen=True, eq=False)
class _StiffFace:
    """(Wᵀ F Z + κ) y − (G W)ᵀβ = g with G Z y + S β = b: a face with stiff rigid motions.

    Attributes:
        at: The linearised problem.
        coupled: The face with growing friction, as it is without stiffness.
        compliance: That of rows of equality in coordinates of the face, shape (n_face,), zero on most.
        fixed: The part of λ that is given on the face, owned.
        operator: F, counted.
    """

    at: TangentProblem
    coupled: CoupledSystem
    compliance: Vector
    fixed: Vector
    operator: CountedOperator

    @classmethod
    def build(cls, at: TangentProblem, face: Face, operator: CountedOperator) -> _StiffFace | None:
        """Prepare the face; None where it does not hold every body. Collective."""
        problem, coarse = at.problem, at.problem.coarse
        system = FaceSystems(problem, operator).build(face)
        compliance = face.restrict(at.compliance)
        if isinstance(problem.preconditioner, FacePreconditioner):
            # Rows with a compliance are nearly those of other contacts: the preconditioner is that of these.
            others = face.restriction @ sp.diags((compliance == 0.0).astype(float))
            system = replace(system, preconditioner=problem.preconditioner.on_face(_nonzero(others)))
        growth, fixed, moving = problem.law.growth, face.fixed, face.restriction
        if global_max(problem.comm, float(np.any(growth[face.slip] > 0.0))) > 0.0:
            coupling = face.growth(growth)
            moving = (moving + coupling).tocsr()
            fixed = fixed - coupling @ np.maximum(face.restrict(at.multiplier), 0.0)
        coupled = CoupledSystem.build(system, coarse, face.restriction, moving)
        return None if coupled is None else cls(at, coupled, compliance, fixed, operator)

    def solve(self, forcing: float, floor: float, max_products: int) -> tuple[Vector, Vector, Stop]:
        """Return δλ, owned, β, replicated, and why the iteration ended. Collective.

        GMRES on the whole residual v of the first equation: its part across the rigid motions is met by
        multipliers in equilibrium, the rest by the motions, with the multipliers that bear their stiffness.
        """
        problem, coupled, comm = self.at.problem, self.coupled, self.at.problem.comm
        face, m = coupled.system.face, problem.coarse.m
        # From λ onto the face, into the equilibrium of β = 0.
        load = problem.coarse.load + problem.coarse.apply(self.at.multiplier - self.fixed)
        y = coupled.balanced(face.restrict(self.at.multiplier), load)
        change = self.fixed + coupled.moving @ y - self.at.multiplier
        product = np.zeros_like(change)
        if problem.norm(change) > 0.0:
            product = self.operator(change)
        gradient = coupled.tested.T @ (product - problem.rhs) + (face.curvature + self.compliance) * y

        def expand(vector: Vector) -> tuple[Vector, Kept]:
            step, motions = self._direction(vector)
            full = self.operator(coupled.moving @ step)
            image = coupled.operate(step, full) + self.compliance * step
            return image - coupled.oblique.tested.T @ motions, (step, motions)

        size = float(np.sqrt(global_sum(comm, gradient @ gradient)[0]))
        across = coupled.oblique(gradient)
        seen = float(np.sqrt(global_sum(comm, across @ across)[0]))
        tolerance = max(forcing * seen, floor, float(np.finfo(float).eps) * size)
        found = gmres(comm, -gradient, expand, tolerance, max_products, coupled.system.patience)
        change = change + coupled.moving @ found.combined(0, len(gradient))
        return np.asarray(change, dtype=np.float64), found.combined(1, m), found.stop

    def _direction(self, vector: Vector) -> tuple[Vector, Vector]:
        """Return a step y and motions β with G Z y + S β = 0 for a residual. Collective."""
        coupled = self.coupled
        motions = -coupled.oblique.coefficients(vector)
        across = coupled.oblique(vector)
        step = coupled.system.precondition(across)
        stiff = self.compliance != 0.0
        step[stiff] = across[stiff] / self.compliance[stiff]
        step = coupled.oblique.moving.project(step)
        borne = coupled.oblique.tested.T @ coupled.oblique.solve(self.at.stiffness @ motions)
        return np.asarray(step - borne, dtype=np.float64), motions


def _nonzero(basis: sp.spmatrix) -> sp.csr_matrix:
    """Return the columns of a basis that are not zero."""
    kept = sp.csc_matrix(basis)
    kept.eliminate_zeros()
    return kept[:, np.diff(kept.indptr) > 0].tocsr()
