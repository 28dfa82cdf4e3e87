"""The linear system of one face: operator, coarse space, preconditioner, and the growth of friction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.costs import count_flops
from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact.qp.coarse import (
    CoarseSpace,
    Composed,
    FaceGrams,
    SquareInverse,
    gram_matrix,
    invert_square,
    plus,
)
from fenics_contact.qp.face import Face
from fenics_contact.qp.problem import (
    NO_SECOND_LEVEL,
    DualProblem,
    FacePreconditioner,
    Operator,
    SecondLevelOfFace,
    ShiftedOperator,
)
from fenics_contact.qp.reductions import Vector, global_max, global_sum


@dataclass(frozen=True, eq=False)
class FaceSystem:
    """A = Zᵀ F Z + κ on {G Z y = e − G fixed}, with a preconditioner.

    `operator`: F, owned to owned, collective; `preconditioner`: approximation of F⁻¹, owned to owned, or
    None; `patience`: iterations without progress after which an inner solver gives up; `spring`: 1/ρ of the
    discs is the diagonal of F divided by this, as for springs of proximal points; `single`: whether Krylov
    methods store directions in single precision, as F is no more accurate; `second_level`: corrects the
    preconditioner where bodies are held softly.
    """

    comm: MPI.Comm
    face: Face
    operator: Operator
    coarse: CoarseSpace
    preconditioner: Operator | None = None
    patience: int = 60
    spring: float = 1.0
    single: bool = False
    second_level: SecondLevelOfFace = NO_SECOND_LEVEL

    def image(self, y: Vector, full: Vector) -> Vector:
        """Return A y, shape (n_face,), for y on the face and full = F Z y, owned."""
        return self.face.restrict(full) + self.face.curvature * y

    def precondition(self, residual: Vector) -> Vector:
        """Approximate A⁻¹ r, shape (n_face,). Collective."""
        return self.second_level(self._by_rows, residual)

    def _by_rows(self, residual: Vector) -> Vector:
        """Apply D Zᵀ M Z D, where D = (1 + ρκ)^-½ accounts for the curvature of the discs. Collective.

        Compliances κ far beyond F, and those of rows that supports alone determine, add their own inverses.
        Offsets of slipping discs add ρ D²: where rows depend on each other or supports hold a tangent, no
        force on the rows deforms anything, M is zero, and κ alone is left.
        """
        damping, soft = self.face.damping, self.face.softness * residual
        if self.preconditioner is None:
            return damping**2 * residual + soft
        solved = self.face.restrict(self.preconditioner(self.face.prolong(damping * residual)))
        return damping * solved + soft + self.face.offset_stiffness / self.spring * residual

    def gradient(self, multiplier: Vector, flexed: Vector) -> Vector:
        """Return Zᵀ(F λ − d) + κ y, shape (n_face,), for λ on the face and flexed = F λ − d."""
        return self.face.restrict(flexed) + self.face.bent(self.face.restrict(multiplier))

    def enter(self, multiplier: Vector) -> Vector:
        """Return the owned vector on the face and in equilibrium that is closest to λ. Collective."""
        on_face = self.face.nearest(multiplier)
        y = self.face.restrict(on_face)
        given = self.second_level.balancing(self.coarse, self.coarse.residual(y), on_face - multiplier)
        return on_face - self.face.prolong(given)

    def advance(self, step: Vector) -> Vector:
        """Return the change of the multiplier, Z δ, owned, for a step δ in face coordinates."""
        return self.face.prolong(step)

    def motions(self, gradient: Vector) -> Vector:
        """Return α, the least-squares fit of rigid motions to a gradient on the face. Collective."""
        return self.coarse.fitted(gradient)

    def weighted_norm(self, y: Vector, weights: Vector) -> float:
        """Return the global norm of weights · y. Collective."""
        scaled = weights * y
        return float(np.sqrt(global_sum(self.comm, scaled @ scaled)[0]))


class FaceSystems:
    """Builds face systems of one problem; the gluing part of G Z Zᵀ Gᵀ is computed once."""

    def __init__(self, problem: DualProblem, operator: Operator) -> None:
        """Prepare for ``problem`` with its (counted) operator F. Collective."""
        self._problem = problem
        self._operator = operator
        self._equality_gram: sp.csr_matrix | None = None
        if problem.coarse.faces is None:
            # Kept without its zeros: dense, it would be one matrix more beside those of each face.
            gluing = gram_matrix(problem.comm, problem.coarse.matrix[:, problem.layout.equality])
            self._equality_gram = Csr(gluing)

    def build(self, face: Face) -> FaceSystem:
        """Return the system of a face. Collective."""
        problem, coarse = self._problem, self._problem.coarse
        n_equality = len(problem.layout.equality)
        gram = None
        if self._equality_gram is not None:
            columns = coarse.matrix @ face.restriction[:, n_equality:]
            gram = plus(gram_matrix(problem.comm, columns), self._equality_gram)
        load = coarse.load - coarse.apply(face.fixed)
        restricted = coarse.restricted(face.restriction, load, gram=gram, whole=True)
        preconditioner = problem.preconditioner
        if isinstance(preconditioner, FacePreconditioner):
            preconditioner = preconditioner.on_face(face.restriction)
        spring = self._operator.stiffness if isinstance(self._operator, ShiftedOperator) else 1.0
        return FaceSystem(
            problem.comm, face, self._operator, restricted, preconditioner,
            spring=spring, single=problem.exact is not None, second_level=problem.second_level.on_face(face),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ObliqueProjector:
    """v ↦ v − G_sᵀ (G_u G_sᵀ)⁻¹ G_u v: removes rigid motions, with range in the kernel of G_u.

    `tested`: G_s, this rank's columns on the test basis; `moving`: coarse space of G_u on the moving basis.
    """

    tested: sp.csr_matrix | Composed
    moving: CoarseSpace
    inverse: SquareInverse

    @classmethod
    def build(
        cls,
        tested: sp.csr_matrix | Composed,
        moving: CoarseSpace,
        faces: FaceGrams | None = None,
        shared: int = 0,
    ) -> ObliqueProjector | None:
        """Factor G_u G_sᵀ; None if it is singular, when the face does not hold every body. Collective.

        `faces`: reduced matrices of faces, whose first ``shared`` columns are equality rows.
        """
        if faces is not None:
            assert isinstance(tested, Composed)
            reduced = faces.square(moving.matrix.from_column(shared), tested.from_column(shared))
            return None if reduced is None else cls(tested, moving, reduced)
        diagonal = global_sum(moving.comm, moving.matrix.power(2).sum(axis=1))
        scale = 1.0 / np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
        inverse = invert_square(moving.comm, (moving.matrix @ tested.T).tocsr(), scale)
        return None if inverse is None else cls(tested, moving, inverse)

    def solve(self, resultant: Vector) -> Vector:
        """Return (G_u G_sᵀ)⁻¹ times a replicated array of shape (m,). Collective."""
        count_flops(self.moving.comm, self.inverse.flops)
        return self.inverse.solve(resultant)

    def coefficients(self, v: Vector) -> Vector:
        """Return (G_u G_sᵀ)⁻¹ G_u v, replicated. Collective."""
        return self.solve(self.moving.apply(v))

    def preserve(self, v: Vector) -> Vector:
        """Return the nearest y with G_u y = 0. Collective."""
        return self.moving.project(v)

    def balancing(self, resultant: Vector) -> Vector:
        """Return y in the range of G_sᵀ with G_u y = resultant. Collective."""
        return self.transposed @ self.solve(resultant)

    @cached_property
    def transposed(self) -> sp.csc_matrix | Composed:
        """G_sᵀ, which shares the memory of G_s, shape (n_face, m)."""
        return self.tested.T

    def __call__(self, v: Vector) -> Vector:
        """Project. Collective."""
        return v - self.transposed @ self.coefficients(v)


@dataclass(frozen=True, eq=False)
class DampedEquilibrium:
    """Preserves G Z y with little motion of the offsets of slipping discs that κ holds in place.

    Near zero normal force, κ exceeds the flexibility of other rows by a factor of a million and more. If such
    offsets moved as far as all others to preserve equilibrium, they would swamp the rest of a residual by κ
    times as much. `damping`: D, that of the face down to a least one, owned.
    """

    damping: Vector
    coarse: CoarseSpace

    def preserve(self, v: Vector) -> Vector:
        """Return v − D² ZᵀGᵀ (G Z D² ZᵀGᵀ)⁻¹ G Z v. Collective."""
        return self.damping * self.coarse.project(v / self.damping)

    def balancing(self, resultant: Vector) -> Vector:
        """Return the shortest y in the norm of D⁻¹ with G Z y = resultant. Collective."""
        return self.damping * self.coarse.transpose(self.coarse.solve(resultant))


@dataclass(frozen=True, eq=False)
class CoupledSystem:
    """(Wᵀ F Z + κ) y = Wᵀ d + (G W)ᵀ α on {G Z y = load}, unsymmetric where discs slip.

    Newton's step tests with the face's own basis W = Z_s and moves the multiplier along Z = Z_u = Z_s +
    growth: the column of a normal multiplier includes the slipping friction μ ŵ. The adjoint swaps the two.
    `tested`: W; `moving`: Z; `curvature`: κ; `equilibrium`: preserves equilibrium, where offsets are held in
    place with little motion of these.
    """

    system: FaceSystem
    tested: sp.csr_matrix
    moving: sp.csr_matrix
    curvature: Vector
    oblique: ObliqueProjector
    equilibrium: DampedEquilibrium | ObliqueProjector

    @classmethod
    def build(
        cls,
        system: FaceSystem,
        coarse: CoarseSpace,
        tested: sp.csr_matrix,
        moving: sp.csr_matrix,
        *,
        curvature: Vector,
        damped: bool = False,
        whole: bool = True,
        least_damping: float = 1e-4,
    ) -> CoupledSystem | None:
        """Join both bases; None where the face does not hold every body. Collective.

        `tested`: W; `moving`: Z; `curvature`: κ; `whole`: whether both begin
        with all equality rows, see `CoarseSpace.restricted`; `least_damping`: lower bound on D, so that
        motions that only offsets resist stay distinct from unresisted ones.
        """
        system = replace(system, second_level=system.second_level.along(tested, moving))
        known = whole and tested is system.face.restriction
        columns = system.coarse.matrix if known else coarse.columns(tested, whole=whole)
        faces, shared = coarse.faces if whole else None, len(system.face.layout.equality)
        own = coarse.restricted(moving, whole=whole)
        oblique = ObliqueProjector.build(columns, own, faces, shared)
        if oblique is None:
            return None
        if not damped:
            return cls(system, tested, moving, curvature, oblique, oblique)
        damping = np.maximum(system.face.damping, least_damping)
        spared = coarse.restricted(Csr(moving @ sp.diags(damping)), whole=whole)
        return cls(system, tested, moving, curvature, oblique, DampedEquilibrium(damping, spared))

    def transposed(self, coarse: CoarseSpace) -> CoupledSystem | None:
        """Return the system with its bases swapped; None where that does not hold every body. Collective."""
        return CoupledSystem.build(self.system, coarse, self.moving, self.tested, curvature=self.curvature)

    @cached_property
    def _testing(self) -> sp.csc_matrix:
        """Wᵀ, which shares the memory of W."""
        return self.tested.T

    def operate(self, z: Vector, full: Vector) -> Vector:
        """Return (Wᵀ F Z + κ) z, shape (n_face,), where full = F Z z."""
        return self._testing @ full + self.curvature * z

    def image(self, z: Vector, full: Vector) -> Vector:
        """Return the projected image of z, shape (n_face,), where full = F Z z. Collective."""
        return self.oblique(self.operate(z, full))

    def precondition(self, residual: Vector) -> Vector:
        """Apply the symmetric preconditioner and restore equilibrium, G Z z = 0. Collective."""
        return self.equilibrium.preserve(self.system.precondition(residual))

    def balanced(self, y: Vector, load: Vector) -> Vector:
        """Return y moved so that G Z y = load, shape (n_face,). Collective."""
        return y - self.equilibrium.balancing(self.oblique.moving.apply(y) - load)


@dataclass(frozen=True, eq=False)
class CoupledFace:
    """A Newton step with growing friction: λ = fixed + Z_u y."""

    coupled: CoupledSystem
    coarse: CoarseSpace
    fixed: Vector

    def enter(self, multiplier: Vector) -> Vector:
        """Return the multiplier on the face and in equilibrium that shares λ's coordinates. Collective."""
        load = self.coarse.load - self.coarse.apply(self.fixed)
        y = self.coupled.balanced(self.coupled.system.face.restrict(multiplier), load)
        return self.fixed + self.coupled.moving @ y

    def advance(self, step: Vector) -> Vector:
        """Return the change of the multiplier, Z_u δ, owned, for a step δ in face coordinates."""
        return self.coupled.moving @ step

    def motions(self, gradient: Vector) -> Vector:
        """Return α, the rigid motions of a gradient on the face, replicated. Collective."""
        return self.coupled.oblique.coefficients(gradient)


def growing_basis(
    comm: MPI.Comm, face: Face, growth: Vector, multiplier: Vector
) -> tuple[sp.csr_matrix, Vector]:
    """Return Z of a face, with growing friction if any, and the part of λ that is fixed. Collective.

    Friction grows by dΨ/dλ_N, owned by disc, from the multiplier at which the face was determined.
    """
    if global_max(comm, float(np.any(growth[face.slip] > 0.0))) == 0.0:
        return face.restriction, face.fixed
    coupling = face.growth(growth)
    fixed = face.fixed - coupling @ np.maximum(face.restrict(multiplier), 0.0)
    return (face.restriction + coupling).tocsr(), fixed


def couple(system: FaceSystem, coarse: CoarseSpace, growth: Vector, multiplier: Vector) -> CoupledFace | None:
    """Add the growth of friction to a face system. Collective.

    Returns the coupled face; None where no disc grows, or where the face does not hold every body.
    """
    moving, fixed = growing_basis(system.comm, system.face, growth, multiplier)
    face = system.face
    if moving is face.restriction:
        return None
    coupled = CoupledSystem.build(system, coarse, face.restriction, moving, curvature=face.curvature)
    return None if coupled is None else CoupledFace(coupled, coarse, fixed)
