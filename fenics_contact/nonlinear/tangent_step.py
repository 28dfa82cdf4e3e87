"""Newton steps of problems whose tangent changes: one face of a dual problem with stiff rigid motions.

Under stress, rigid motions of a subdomain have a stiffness. With C the columns that hold them, K_ρ = K + C Cᵀ
and the modes Φ = K_ρ⁻¹C, the tangent problem in increments of multipliers and amplitudes β of the modes is

    F δλ − Gᵀβ = d,   G δλ + S β = e,   F = B K_ρ⁻¹Bᵀ,   G = ΦᵀBᵀ,   S = I − CᵀΦ,

exact for any columns. Without stress S = 0, and it is the usual problem with its equilibrium G δλ = e.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.linalg import ROUNDING, scaled_columns
from fenics_contact.qp import (
    CountedOperator,
    DualProblem,
    Face,
    FacePreconditioner,
    FaceSystem,
    Kept,
    ObliqueProjector,
    Stop,
    Vector,
    apply_unless_zero,
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
        acting: Positions of rows whose multipliers act without being felt: each is what the row of `felt` of
            the same number measures, an unsymmetric stiffness; shape (k,).
        felt: Positions of these rows, which have no multipliers, shape (k,).
        share: What each of them measures for a multiplier of one, shape (k,).
        lacking: Positions of rows without multipliers that others lack where displacements are measured: the
            derivative of a gap need not be the row of its force; shape (m,).
        completed: Positions of these others, shape (m,).
        completing: How much of the former the latter lack, shape (m,).
        flexibility: A typical entry of F, [length / force].
    """

    problem: DualProblem
    stiffness: sp.csr_matrix
    multiplier: Vector
    residual: Vector
    compliance: Vector
    acting: np.ndarray
    felt: np.ndarray
    share: Vector
    lacking: np.ndarray
    completed: np.ndarray
    completing: Vector
    flexibility: float

    def complete(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return columns of weights of rows, shape (n_owned, n), with those of the rows that they lack."""
        entries = self.completing, (self.lacking, self.completed)
        return (rows + sp.csr_matrix(entries, shape=(rows.shape[0],) * 2) @ rows).tocsr()

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
            share=np.asarray(self.share * s[self.felt] * s[self.acting], dtype=np.float64),
            completing=np.asarray(self.completing * s[self.completed] / s[self.lacking], dtype=np.float64),
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
    tangent: TangentProblem,
    step: Vector,
    forcing: float,
    floor: float,
    max_products: int,
    *,
    margin: float = 0.0,
) -> TangentStep | None:
    """Solve the face that the natural map selects; None where it does not hold every body. Collective.

    Args:
        tangent: The linearised problem.
        step: ρ of the natural map, owned; zero on equality rows.
        forcing: Residual of the linear system relative to that of its start.
        floor: A residual that is small enough, [length].
        max_products: Largest number of products.
        margin: Discs inside their slip bound by less than this part of it count as slipping.
    """
    factor = None if tangent.problem.scaling is None else tangent.problem.scaling.factor
    at = tangent.scaled()
    problem = at.problem
    bound = (1.0 - margin) * problem.law.bound(at.multiplier)
    ratio = step if factor is None else np.asarray(step / factor**2, dtype=np.float64)
    face = classify(problem.layout, bound, at.multiplier, at.residual, ratio)
    operator = CountedOperator(problem.operator)
    growth, coupling, fixed = problem.law.growth, None, face.fixed
    if global_max(problem.comm, float(np.any(growth[face.slip] > 0.0))) > 0.0:
        coupling = face.growth(growth)
        fixed = fixed - coupling @ np.maximum(face.restrict(at.multiplier), 0.0)
    solved = _StiffFace.build(at, face, coupling, operator)
    if solved is None:
        return None
    change, motions, stop = solved.solve(fixed, forcing, floor, max_products)
    multiplier = at.multiplier + change
    if factor is not None:
        multiplier = multiplier * factor
    return TangentStep(multiplier, motions, face, operator.products, stop)


def tangent_adjoint(
    tangent: TangentProblem,
    face: Face,
    coupling: sp.csr_matrix,
    right: Vector,
    load: Vector,
    tolerance: float,
    max_products: int,
) -> TangentStep | None:
    """Solve the transpose of a linearised problem; None where its face does not hold every body. Collective.

    It is (Zᵀ F W + κ) z − (G Z)ᵀβ = Zᵀ d under G W z + S β = e, with the bases of `tangent_step` swapped.

    Args:
        tangent: The linearised problem.
        face: Its face.
        coupling: Growth of slipping forces with their normal forces, shape (n_owned, n_face).
        right: d, owned.
        load: e, shape (m,), replicated.
        tolerance: Residual of the linear system relative to that of its start.
        max_products: Largest number of products.

    Returns:
        W z as multiplier, β as motions.
    """
    problem = tangent.problem
    factor = 1.0 if problem.scaling is None else problem.scaling.factor
    scaling = None if problem.scaling is None else problem.scaling.with_load(load)
    problem = replace(problem, rhs=right, coarse=problem.coarse.with_load(load), scaling=scaling)
    nothing = np.zeros_like(tangent.multiplier)
    at = replace(tangent, problem=problem, multiplier=nothing, residual=nothing).scaled()
    flexibility = face.flexibility * (factor * np.ones_like(nothing))[problem.layout.tangential[:, 0]] ** 2
    operator = CountedOperator(at.problem.operator)
    solved = _StiffFace.build(at, replace(face, flexibility=flexibility), coupling, operator)
    if solved is None:
        return None
    transposed = solved.transposed()
    if transposed is None:
        return None
    change, motions, stop = transposed.solve(nothing, tolerance, 0.0, max_products)
    return TangentStep(change * factor, motions, face, operator.products, stop)


@dataclass(frozen=True, eq=False)
class _StiffFace:
    """(Wᵀ F Z + κ) y − (G W)ᵀβ = g with G Z y + S β = b: a face with stiff rigid motions.

    Attributes:
        at: The linearised problem.
        system: The face without stiffness, whose preconditioner is used.
        shared: Columns of the face that W and Z have in common, as numbers, shape (n_shared,).
        tested: W: those, and the rows that are felt, shape (n_owned, n).
        moving: Z: those with growing friction, and the rows that act, shape (n_owned, n).
        compliance: κ, of slipping discs, of rows with a compliance, and one of acting rows, shape (n,).
        further: Marks of the columns with a compliance of their own, shape (n,).
        oblique: Projector to equilibrium.
        operator: F, counted.
    """

    at: TangentProblem
    system: FaceSystem
    shared: np.ndarray
    tested: sp.csr_matrix
    moving: sp.csr_matrix
    compliance: Vector
    further: np.ndarray
    oblique: ObliqueProjector
    operator: CountedOperator

    @classmethod
    def build(
        cls, at: TangentProblem, face: Face, coupling: sp.csr_matrix | None, operator: CountedOperator
    ) -> _StiffFace | None:
        """Prepare the face; None where it does not hold every body. Collective."""
        problem, coarse, equality = at.problem, at.problem.coarse, at.problem.layout.equality
        basis = face.restriction
        felt, acting, lacking = (np.searchsorted(equality, x) for x in (at.felt, at.acting, at.lacking))
        shared = np.setdiff1d(np.arange(basis.shape[1]), np.concatenate([felt, acting, lacking]))
        moving = basis if coupling is None else (basis + coupling).tocsr()
        tested = at.complete(basis[:, np.concatenate([shared, felt])])
        moving = moving[:, np.concatenate([shared, acting])]
        own = face.restrict(at.compliance)
        compliance = np.concatenate([(face.curvature + own)[shared], at.share])
        further = np.concatenate([own[shared] != 0.0, np.ones(len(at.share), dtype=bool)])
        scale = _scale(at, compliance, further)
        tested, moving = scaled_columns(tested, scale), scaled_columns(moving, scale)
        oblique = ObliqueProjector.build(sp.csr_matrix(coarse.matrix @ tested), coarse.restricted(moving))
        if oblique is None:
            return None
        preconditioner = problem.preconditioner
        if isinstance(preconditioner, FacePreconditioner):
            # The other rows are nearly combinations of contact rows: the preconditioner is that of these.
            preconditioner = preconditioner.on_face(basis[:, shared[own[shared] == 0.0]])
        system = FaceSystem(problem.comm, face, operator, coarse.restricted(basis), preconditioner)
        return cls(at, system, shared, tested, moving, compliance * scale**2, further, oblique, operator)

    def transposed(self) -> _StiffFace | None:
        """Return the face with its bases swapped; None where that does not hold every body. Collective."""
        coarse = self.at.problem.coarse
        matrix, moving = sp.csr_matrix(coarse.matrix @ self.moving), coarse.restricted(self.tested)
        oblique = ObliqueProjector.build(matrix, moving)
        if oblique is None:
            return None
        return replace(self, tested=self.moving, moving=self.tested, oblique=oblique)

    def solve(
        self, fixed: Vector, forcing: float, floor: float, max_products: int
    ) -> tuple[Vector, Vector, Stop]:
        """Return δλ, owned, β, replicated, and why the iteration ended. Collective.

        GMRES on the whole residual v of the first equation: its part across the rigid motions is met by
        multipliers in equilibrium, the rest by the motions, with the multipliers that bear their stiffness.

        Args:
            fixed: The part of λ that is given on the face, owned.
            forcing: As for `tangent_step`.
            floor: As there.
            max_products: As there.
        """
        problem, comm, oblique = self.at.problem, self.at.problem.comm, self.oblique
        # From λ onto the face, into the equilibrium of β = 0.
        load = problem.coarse.load + problem.coarse.apply(self.at.multiplier - fixed)
        y = np.concatenate([self.system.face.restrict(self.at.multiplier)[self.shared], self._nothing])
        y = y - oblique.transposed @ oblique.solve(oblique.moving.apply(y) - load)
        change = fixed + self.moving @ y - self.at.multiplier
        product = apply_unless_zero(problem, self.operator, change)
        gradient = self._testing @ (product - problem.rhs) + self.compliance * y

        def expand(vector: Vector) -> tuple[Vector, Kept]:
            step, motions = self._direction(vector)
            image = self._testing @ self.operator(self.moving @ step) + self.compliance * step
            return image - oblique.transposed @ motions, (step, motions)

        across = oblique(gradient)
        # Rigid motions that close the jumps of the last step must not make the tolerance larger, nor may an
        # oblique projection; what rounding leaves of them is small enough.
        size, seen = np.sqrt(global_sum(comm, gradient @ gradient, across @ across))
        tolerance = max(forcing * float(min(size, seen)), floor, ROUNDING * float(size))
        found = gmres(comm, -gradient, expand, tolerance, max_products, self.system.patience)
        change = change + self.moving @ found.combined(0, len(gradient))
        return np.asarray(change, dtype=np.float64), found.combined(1, problem.coarse.m), found.stop

    @cached_property
    def _testing(self) -> sp.csr_matrix:
        """Wᵀ."""
        return self.tested.T.tocsr()

    @property
    def _nothing(self) -> Vector:
        """No multipliers of acting rows."""
        return np.zeros(self.tested.shape[1] - len(self.shared))

    def _direction(self, vector: Vector) -> tuple[Vector, Vector]:
        """Return a step y and motions β with G Z y + S β = 0 for a residual. Collective."""
        oblique, motions = self.oblique, -self.oblique.coefficients(vector)
        across = vector + oblique.transposed @ motions
        residual = np.zeros(self.system.face.n_face)
        residual[self.shared] = across[: len(self.shared)]
        step = np.concatenate([self.system.precondition(residual)[self.shared], self._nothing])
        step[self.further] = across[self.further] / self.compliance[self.further]
        borne = oblique.transposed @ oblique.solve(self.at.stiffness @ motions)
        return np.asarray(oblique.moving.project(step) - borne, dtype=np.float64), motions


def _scale(at: TangentProblem, compliance: Vector, further: np.ndarray) -> Vector:
    """Return factors of columns that give soft rows the usual flexibility, shape (n,). Collective.

    An error in a soft row causes little force: unscaled, its residual would swamp all others, first where
    rigid motions take their part of it.

    Args:
        at: The linearised problem.
        compliance: Of each column, shape (n,).
        further: Marks of the columns with a compliance of their own, shape (n,).
    """
    problem, contact = at.problem, at.problem.layout.contact
    total, count = global_sum(problem.comm, problem.diagonal[contact].sum(), len(contact))
    usual = total / count if count > 0.0 else at.flexibility
    scale = np.ones(len(compliance))
    scale[further] = np.sqrt(np.minimum(usual / np.abs(compliance[further]), 1.0))
    return scale
