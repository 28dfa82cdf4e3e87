"""Newton steps of problems whose tangent changes: one face of a dual problem with stiff rigid motions.

Under stress, rigid motions of a subdomain have a stiffness. With C the columns that hold them, K_ρ = K + C Cᵀ
and the modes Φ = K_ρ⁻¹C, the tangent problem in increments of multipliers and amplitudes β of the modes is

    F δλ − Gᵀβ = d,   G δλ + S β = e,   F = B K_ρ⁻¹Bᵀ,   G = ΦᵀBᵀ,   S = I − CᵀΦ,

exact for any columns. Without stress S = 0, and it is the usual problem with its equilibrium G δλ = e.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import displayed
from fenics_contact._base.sparse import ROUNDING, scaled_columns
from fenics_contact._large_deformations.moving_contact import AuxiliaryRows
from fenics_contact._large_deformations.tangent import TangentSystem
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.face import Face, classify
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.face_system import CoupledSystem, FaceSystem, growing_basis
from fenics_contact.qp.krylov import Kept, Stop, gmres
from fenics_contact.qp.problem import CountedOperator, DualProblem, FacePreconditioner, unknown_reach
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.solution import apply_unless_zero
from fenics_contact.qp.solve import solve


class Resisted(Protocol):
    """How the motions of all subdomains follow from those that the rows of a face resist."""

    def motions(self, change: Vector, resisted: Vector) -> Vector:
        """Return β by δλ, owned, and the motions that rows resist, replicated. Collective."""


@dataclass(frozen=True)
class _EveryMotion:
    """Rows resist every motion."""

    def motions(self, change: Vector, resisted: Vector) -> Vector:
        return resisted


EVERY_MOTION: Resisted = _EveryMotion()


@displayed
@dataclass(frozen=True, eq=False)
class TangentProblem:
    """The linearisation of a nonlinear problem at a multiplier λ and a displacement u.

    `problem`: F, d and e of increments, G, the law of friction of λ itself; d = B K_ρ⁻¹ r + (B u − c) and e =
    Φᵀ r with the forces r = f − f_int(u) − Bᵀλ out of balance; `further`: the last rows, for the stiffness of
    forces that turn; `flexibility`: A typical entry of F; `resisted`: how all motions follow from those of
    this problem.
    """

    problem: DualProblem
    stiffness: sp.csr_matrix
    multiplier: Vector
    residual: Vector
    further: AuxiliaryRows
    flexibility: float
    resisted: Resisted = EVERY_MOTION

    @property
    def compliance(self) -> Vector:
        """Compliances of rows of equality, owned, of either sign: B u = c + compliance · λ."""
        usual = np.zeros(len(self.multiplier) - self.further.count)
        return np.concatenate([usual, self.further.compliance])

    def corrected(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return columns of weights of rows, shape (n_owned, n), with those of the rows that correct them."""
        further = self.further
        entries = further.correction, (further.correction_rows, further.corrected_rows)
        return (rows + Csr(entries, shape=(rows.shape[0],) * 2) @ rows).tocsr()

    def scaled(self) -> TangentProblem:
        """Return the problem in the multipliers of `DualProblem.scaling`, itself where there is none."""
        if not self.problem.scaling:
            return self
        s = self.problem.scaling.factor * np.ones_like(self.multiplier)
        return replace(
            self,
            problem=self.problem.scaled_problem,
            multiplier=np.asarray(self.multiplier / s, dtype=np.float64),
            residual=np.asarray(self.residual * s, dtype=np.float64),
            further=self.further.scaled(s),
        )


@dataclass(frozen=True, eq=False)
class _StiffAlone:
    """The motions N that no row of a face resists, (G Z)ᵀN = 0, follow the others, Q b, by their stiffness.

    By NᵀSβ = Nᵀ(e − G δλ) with β = Q b + N γ. So b are the motions of a problem with Eᵀ G, Eᵀ S Q and Eᵀ e,
    Eᵀ = Qᵀ(I − S N (NᵀSN)⁻¹Nᵀ). The columns of motions that stress has softened may be more than the rows.
    `kept`: Q, orthonormal; `alone`: N; `flexibility`: (NᵀSN)⁻¹.
    """

    whole: TangentProblem
    kept: Vector
    alone: Vector
    flexibility: Vector

    @classmethod
    def of(cls, at: TangentProblem, columns: sp.csr_matrix, soft: float = 1e-8) -> _StiffAlone | None:
        """Return those of a face; None where some have no stiffness either, or there are none. Collective.

        `soft`: stiffness that is none, relative to the typical one.
        """
        coarse = at.problem.coarse
        null = coarse.comm.bcast(coarse.restricted(columns).gram.null_space)
        basis, _ = np.linalg.qr(null, mode="complete")
        alone, kept = basis[:, : null.shape[1]], basis[:, null.shape[1] :]
        stiffness = alone.T @ (at.stiffness @ alone)
        sizes = np.linalg.svd(stiffness, compute_uv=False)
        if not alone.size or not sizes.min() * at.flexibility > soft:
            return None
        return cls(at, kept, alone, np.linalg.inv(stiffness))

    @property
    def problem(self) -> TangentProblem:
        """The problem of the motions that rows resist."""
        at, coarse = self.whole, self.whole.problem.coarse
        passed = (at.stiffness @ self.alone) @ self.flexibility @ self.alone.T
        onto = self.kept.T - self.kept.T @ passed
        fewer = CoarseSpace(coarse.comm, Csr(onto) @ coarse.matrix, onto @ coarse.load)
        stiffness = Csr(onto @ (at.stiffness @ self.kept))
        return replace(at, problem=replace(at.problem, coarse=fewer), stiffness=stiffness, resisted=self)

    def motions(self, change: Vector, resisted: Vector) -> Vector:
        at, given = self.whole, self.kept @ resisted
        missing = at.problem.coarse.load - at.problem.coarse.apply(change) - at.stiffness @ given
        return np.asarray(given + self.alone @ (self.flexibility @ (self.alone.T @ missing)))


@displayed
@dataclass(frozen=True, eq=False)
class TangentStep:
    """One Newton step."""

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
    """Solve the face that the natural map selects; None where it does not hold every body. Collective."""
    factor = tangent.problem.scaling.factor
    at = tangent.scaled()
    problem = at.problem
    bound = (1.0 - margin) * problem.law.bound(at.multiplier)
    ratio = np.asarray(step / factor**2, dtype=np.float64)
    face = classify(problem.layout, bound, at.multiplier, at.residual, ratio, problem.compliance)
    operator = CountedOperator(problem.operator)
    moving, fixed = growing_basis(problem.comm, face, problem.law.growth(at.multiplier), at.multiplier)
    solved = _StiffFace.held(at, face, moving, operator)
    if solved is None:
        return None
    change, motions, stop = solved.solve(fixed, forcing, floor, max_products)
    motions = solved.at.resisted.motions(change, motions)
    multiplier = (at.multiplier + change) * factor
    return TangentStep(multiplier, motions, face, operator.products, stop)


def whole_step(system: TangentSystem, multiplier: Vector, step: Vector, solver: FaceNewton) -> TangentStep:
    """Solve the linearised contact problem as a whole, its rigid motions without stiffness. Collective.

    At the start of a history nothing is known of the active set, and without stress they have none.
    """
    torn, before, problem = system.torn, system.products, system.problem
    multiplier = np.concatenate([multiplier, np.zeros(len(step) - len(multiplier))])
    load = problem.coarse.load + problem.coarse.apply(multiplier)
    flexed = apply_unless_zero(problem, system.apply, multiplier)
    problem = replace(problem.with_load(problem.rhs + flexed, load), reach=unknown_reach)
    solution = solve(problem, None, solver, multiplier, law=torn.law)
    bound = torn.law.bound(solution.multiplier)
    face = classify(problem.layout, bound, solution.multiplier, solution.residual, step, problem.compliance)
    products = system.products - before
    return TangentStep(solution.multiplier, solution.alpha, face, products, Stop.CONVERGED)


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
    `coupling`: growth of slipping forces with their normal forces; `load`: e, replicated.
    """
    problem = tangent.problem
    factor = problem.scaling.factor
    problem = problem.with_load(right, load)
    nothing = np.zeros_like(tangent.multiplier)
    at = replace(tangent, problem=problem, multiplier=nothing, residual=nothing).scaled()
    operator = CountedOperator(at.problem.operator)
    face, moving = face.scaled(factor * np.ones_like(nothing)), (face.restriction + coupling).tocsr()
    solved = _StiffFace.held(at, face.homogeneous, moving, operator)
    if solved is None:
        return None
    transposed = solved.coupled.transposed(solved.at.problem.coarse)
    if transposed is None:
        return None
    swapped = replace(solved, coupled=transposed)
    change, motions, stop = swapped.solve(nothing, tolerance, 0.0, max_products)
    motions = solved.at.resisted.motions(change, motions)
    return TangentStep(change * factor, motions, face, operator.products, stop)


@dataclass(frozen=True, eq=False)
class _StiffFace:
    """A face with stiff rigid motions: (Wᵀ F Z + κ) y − (G W)ᵀβ = g with G Z y + S β = b.

    W and Z have the columns of the face in common but for growing friction; then W has the rows that measure
    without multipliers, and Z those whose multipliers act without being measured.
    """

    at: TangentProblem  # the linearised problem
    # The face without S; κ is that of slipping discs, of rows with a compliance, and one of rows that act.
    coupled: CoupledSystem
    shared: np.ndarray  # columns of the face that W and Z have in common, as numbers, shape (n_shared,)
    soft: np.ndarray  # marks of the columns with a compliance of their own, shape (n,)

    @classmethod
    def held(
        cls, at: TangentProblem, face: Face, moving: sp.csr_matrix, operator: CountedOperator
    ) -> _StiffFace | None:
        """Prepare the face; None where neither it nor their stiffness holds every motion. Collective."""
        found = cls.build(at, face, moving, operator)
        if found is not None:
            return found
        columns = sp.hstack([at.corrected(face.restriction), moving], format="csr")
        alone = _StiffAlone.of(at, columns)
        return None if alone is None else cls.build(alone.problem, face, moving, operator)

    @classmethod
    def build(
        cls, at: TangentProblem, face: Face, moving: sp.csr_matrix, operator: CountedOperator
    ) -> _StiffFace | None:
        """Prepare the face; None where its rows do not resist every motion. Collective."""
        problem, further, equality = at.problem, at.further, at.problem.layout.equality
        basis = face.restriction
        measuring, acting, correcting = (
            np.searchsorted(equality, rows)
            for rows in (further.displacement_rows, further.force_rows, further.correction_rows)
        )
        shared = np.setdiff1d(np.arange(basis.shape[1]), np.concatenate([measuring, acting, correcting]))
        tested = at.corrected(basis[:, np.concatenate([shared, measuring])])
        moving = moving[:, np.concatenate([shared, acting])]
        own, share = face.restrict(at.compliance), further.share
        compliance = np.concatenate([(face.curvature + own)[shared], share])
        soft = np.concatenate([own[shared] != 0.0, np.ones(len(share), dtype=bool)])
        scale = _scale(at, compliance, soft)
        preconditioner = problem.preconditioner
        if isinstance(preconditioner, FacePreconditioner):
            # The other rows are nearly combinations of contact rows: the preconditioner is that of these.
            preconditioner = preconditioner.on_face(basis[:, shared[own[shared] == 0.0]])
        system = FaceSystem(problem.comm, face, operator, problem.coarse.restricted(basis), preconditioner)
        coupled = CoupledSystem.build(
            system,
            problem.coarse,
            scaled_columns(tested, scale),
            scaled_columns(moving, scale),
            curvature=compliance * scale**2,
            whole=False,
        )
        return None if coupled is None else cls(at, coupled, shared, soft)

    def solve(
        self, fixed: Vector, forcing: float, floor: float, max_products: int
    ) -> tuple[Vector, Vector, Stop]:
        """Return δλ, owned, β, replicated, and why the iteration ended. Collective.

        GMRES on the whole residual v of the first equation: its part across the rigid motions is cancelled by
        multipliers in equilibrium, the rest by the motions, with multipliers that balance their stiffness.
        """
        problem, comm, coupled = self.at.problem, self.at.problem.comm, self.coupled
        oblique, moving, operator = coupled.oblique, coupled.moving, coupled.system.operator
        # From λ onto the face, into the equilibrium of β = 0.
        load = problem.coarse.load + problem.coarse.apply(self.at.multiplier - fixed)
        on_face = coupled.system.face.restrict(self.at.multiplier)[self.shared]
        y = coupled.balanced(self._filled(on_face), load)
        change = fixed + moving @ y - self.at.multiplier
        gradient = coupled.operate(y, apply_unless_zero(problem, operator, change) - problem.rhs)
        gradient += self._filled(coupled.system.face.offset[self.shared])

        def expand(vector: Vector) -> tuple[Vector, Kept]:
            step, motions = self._direction(vector)
            image = coupled.operate(step, operator(moving @ step))
            return image - oblique.transposed @ motions, (step, motions)

        across = oblique(gradient)
        # Rigid motions that close the jumps of the last step must not make the tolerance larger, nor may an
        # oblique projection; what rounding leaves of them is small enough.
        size, seen = np.sqrt(global_sum(comm, gradient @ gradient, across @ across))
        tolerance = max(forcing * float(min(size, seen)), floor, ROUNDING * float(size))
        found = gmres(comm, -gradient, expand, tolerance, max_products, coupled.system.patience)
        change = change + moving @ found.combined(0, len(gradient))
        return np.asarray(change, dtype=np.float64), found.combined(1, problem.coarse.m), found.stop

    def _filled(self, on_shared: Vector) -> Vector:
        """Return multipliers of the shared columns with none of the others, shape (n,)."""
        return np.concatenate([on_shared, np.zeros(len(self.soft) - len(self.shared))])

    def _direction(self, vector: Vector) -> tuple[Vector, Vector]:
        """Return a step y and motions β with G Z y + S β = 0 for a residual. Collective."""
        coupled, oblique, soft = self.coupled, self.coupled.oblique, self.soft
        motions = -oblique.coefficients(vector)
        across = vector + oblique.transposed @ motions
        residual = np.zeros(coupled.system.face.n_face)
        residual[self.shared] = across[: len(self.shared)]
        step = self._filled(coupled.system.precondition(residual)[self.shared])
        step[soft] = across[soft] / coupled.curvature[soft]
        balancing = oblique.transposed @ oblique.solve(self.at.stiffness @ motions)
        return np.asarray(oblique.moving.project(step) - balancing, dtype=np.float64), motions


def _scale(at: TangentProblem, compliance: Vector, soft: np.ndarray) -> Vector:
    """Return factors of columns that give soft rows the usual flexibility, shape (n,). Collective.

    An error in a soft row causes little force: unscaled, its residual would swamp all others, first where
    rigid motions take their part of it.
    """
    problem, contact = at.problem, at.problem.layout.contact
    total, count = global_sum(problem.comm, problem.diagonal[contact].sum(), len(contact))
    usual = total / count if count > 0.0 else at.flexibility
    scale = np.ones(len(compliance))
    scale[soft] = np.sqrt(np.minimum(usual / np.abs(compliance[soft]), 1.0))
    return scale
