"""The dual problem: min ½ λᵀF λ − dᵀλ subject to G λ = e and λ in a cone, by its operators and its law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact.errors import InfeasibleError, InvalidInputError, together
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.cones import SlipLaw, TrescaLaw
from fenics_contact.qp.face import EXACT, ContactLaw, Face, Marks
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.reductions import Vector, global_max, global_sum

Operator = Callable[[Vector], Vector]
#: Called with the number of F-products so far and, after a step of a solver, with its residual.
Report = Callable[[int, float | None], None]


@runtime_checkable
class FacePreconditioner(Protocol):
    """A preconditioner that is better when it knows which multipliers are free."""

    def __call__(self, residual: Vector) -> Vector:
        """Approximate F⁻¹ r, owned. Collective."""

    def on_face(self, restriction: sp.csr_matrix) -> Operator:
        """Return the preconditioner of the face with basis Z, shape (n_owned, n_face). Collective."""


#: What `RowsOfFace.contradiction` returns.
Dependence: TypeAlias = tuple[Vector, Vector, npt.NDArray[np.int64], int]


@runtime_checkable
class RowsOfFace(Protocol):
    """A preconditioner of a face that knows which of its rows depend on each other."""

    def __call__(self, residual: Vector) -> Vector:
        """Approximate F⁻¹ r on the face, owned. Collective."""

    def contradiction(self, residual: Vector) -> Dependence | None:
        """Return what no force on the face's rows changes in r; None where that is nothing. Collective.

        Returns:
            The part D N (Nᵀ D N)⁻¹ Nᵀ r, where B_Fᵀ N = 0 and D is a diagonal; −D⁻¹ times it, a force that
            deforms nothing; numbers of coupled rows, −1 elsewhere, all owned; and how many numbers there are.
        """


@dataclass(frozen=True)
class LeastSizes:
    """Sizes that residuals are relative to where those of the answer may vanish.

    `force`: of contact forces; `gluing`: of the jumps of gluing rows that cancel; `everything`: of all
    multipliers.
    """

    force: float = 0.0
    gluing: float = 0.0
    everything: float = 0.0


@dataclass(frozen=True)
class Unscaled:
    """Multipliers of uniform stiffness as they are, see `Scaling`.

    Attributes:
        factor: One.
    """

    factor: float = 1.0

    def __bool__(self) -> bool:
        """Tell that nothing is scaled."""
        return False

    def with_load(self, load: Vector) -> Unscaled:
        """Return itself: nothing depends on e."""
        return self

    def of_coarse(self, coarse: CoarseSpace) -> CoarseSpace:
        """Return a coarse space as it is."""
        return coarse

    def of_face(self, face: Face) -> Face:
        """Return a face as it is."""
        return face

    def applied_to(self, problem: DualProblem) -> DualProblem:
        """Return a problem as it is."""
        return problem


@dataclass(frozen=True, eq=False)
class CompliantRows:
    """Rows of equality that give way in proportion to their forces.

    `rows`: their positions, owned; `compliance`: C of each, which the operator has on its diagonal.
    """

    rows: npt.NDArray[np.int64]
    compliance: Vector

    def scaled(self, factor: Vector) -> CompliantRows:
        """Return those of multipliers λ / s, with the factors s of all rows, owned."""
        return replace(self, compliance=factor[self.rows] ** 2 * self.compliance)


NO_COMPLIANT_ROWS = CompliantRows(np.zeros(0, dtype=np.int64), np.zeros(0))


class SecondLevel(Protocol):
    """A coarse space beside that of equilibrium, for preconditioners of faces."""

    def on_face(self, face: Face) -> SecondLevelOfFace:
        """Return that of a face. Collective."""


class SecondLevelOfFace(Protocol):
    """What a second level adds to the preconditioner of a face."""

    def along(self, tested: sp.csr_matrix, moving: sp.csr_matrix) -> SecondLevelOfFace:
        """Return that of a step which moves along another basis than it is tested with. Collective."""

    def balancing(self, coarse: CoarseSpace, resultant: Vector, change: Vector) -> Vector:
        """Return y of the face with G Z y = resultant that costs little energy. Collective.

        It has the resultants of a change of λ, owned, on the motions of the second level.
        """

    def __call__(self, inner: Operator, residual: Vector) -> Vector:
        """Return the preconditioned residual of the face with an inner preconditioner of it. Collective."""


class NoSecondLevel:
    """Equilibrium alone is enough."""

    def on_face(self, face: Face) -> NoSecondLevel:
        """Return itself."""
        return self

    def along(self, tested: sp.csr_matrix, moving: sp.csr_matrix) -> NoSecondLevel:
        """Return itself."""
        return self

    def balancing(self, coarse: CoarseSpace, resultant: Vector, change: Vector) -> Vector:
        """Return the shortest one. Collective."""
        return coarse.transpose(coarse.solve(resultant))

    def __call__(self, inner: Operator, residual: Vector) -> Vector:
        """Apply the inner preconditioner. Collective."""
        return inner(residual)


NO_SECOND_LEVEL = NoSecondLevel()


def unknown_reach(multiplier: Vector, alpha: Vector) -> Vector:
    """Return zeros, owned: displacements are not known."""
    return np.zeros_like(multiplier)


@dataclass(frozen=True, eq=False)
class DualProblem:
    """The data of a dual solver: an operator, a coarse space and the layout of vectors.

    Vectors are distributed: each rank holds the entries it owns, and the inner product is the sum of
    the ranks' own. Residual convention: r = F λ − d − Gᵀα is minus the violation B u − c of the rows.

    Attributes:
        comm: Communicator of the ranks that share the vectors.
        operator: F = B K⁺ Bᵀ, symmetric positive semidefinite, owned to owned, collective.
        rhs: d = B K⁺ f − c, owned, shape (size,).
        coarse: Equilibrium G λ = e.
        layout: Positions of normal and tangential multipliers.
        diagonal: Approximate positive diagonal of F, owned, shape (size,); only contact rows are used.
        preconditioner: Approximation of F⁻¹, symmetric positive definite, owned to owned, collective.
        scaling: Factors of multipliers between parts of different stiffness.
        reach: (λ, α) ↦ abs(B) abs(u), the size of the displacements at each row, owned, collective, with
            which the jumps of a solution are compared. Zero where displacements are not known.
        supported: Marks of contact rows that supports alone determine, owned, shape (size,): no multiplier
            moves them, and their diagonal is not a flexibility. Or one mark for all.
        friction: The law of the slip bounds; None where no disc carries a force.
        compliance: By how much contact rows give way to their forces.
        compliant: Rows of equality that give way.
        least: Sizes below which those of forces and jumps do not fall in residuals.
        given: c of all rows, the gaps before anything moves, owned, shape (size,), [length]; None where it
            does not matter where bodies without forces are.
        exact: F in double precision, owned to owned, collective, where `operator` is in single precision and
            only directions and images of Krylov methods are computed by it; None where it is exact itself.
        second_level: A coarse space of motions that are resisted, but little, in scaled multipliers.
    """

    comm: MPI.Comm
    operator: Operator
    rhs: Vector
    coarse: CoarseSpace
    layout: ContactLayout
    diagonal: Vector
    preconditioner: Operator | None = None
    scaling: Scaling | Unscaled = Unscaled()
    reach: Callable[[Vector, Vector], Vector] = field(default_factory=lambda: unknown_reach)  # no method
    supported: Marks | bool = False
    friction: SlipLaw | None = None
    compliance: ContactLaw = EXACT
    compliant: CompliantRows = NO_COMPLIANT_ROWS
    least: LeastSizes = LeastSizes()
    exact: Operator | None = None
    given: Vector | None = None
    second_level: SecondLevel = NO_SECOND_LEVEL

    @cached_property
    def between_supports(self) -> Marks:
        """The marks of `supported`, shape (size,)."""
        return np.broadcast_to(self.supported, self.layout.size)

    @cached_property
    def apart(self) -> Marks:
        """Which contacts are farther apart before anything moves than the closest one, shape (n_contact,).

        None where it is not known. Collective on first use.
        """
        gap = np.zeros(self.layout.n_contact) if self.given is None else self.given[self.layout.normal]
        closest = -global_max(self.comm, float(np.max(-gap, initial=-np.inf)))
        return np.asarray(gap > closest + 1e-3 * abs(closest))

    @cached_property
    def law(self) -> SlipLaw:
        """The law of `friction`; without one all slip bounds are zero."""
        return self.friction or TrescaLaw(self.layout, np.zeros(self.layout.n_friction))

    @cached_property
    def is_loaded(self) -> bool:
        """Whether loads drive motions of bodies. Collective on first use."""
        return self.norm(self.coarse.particular()) > 0.0

    def with_law(self, law: SlipLaw) -> DualProblem:
        """Return the same problem under another law of friction."""
        return replace(self, friction=law)

    def with_load(self, rhs: Vector, load: Vector) -> DualProblem:
        """Return the same problem with other right sides d, owned, and e, shape (m,), replicated."""
        coarse, scaling = self.coarse.with_load(load), self.scaling.with_load(load)
        return replace(self, rhs=rhs, coarse=coarse, scaling=scaling)

    @cached_property
    def scaled_problem(self) -> DualProblem:
        """The problem in multipliers scaled by `scaling`, itself where there is none."""
        return self.scaling.applied_to(self)

    def dot(self, x: Vector, y: Vector) -> float:
        """Return the global inner product of two owned vectors. Collective."""
        return float(global_sum(self.comm, x @ y)[0])

    def norm(self, x: Vector) -> float:
        """Return the global Euclidean norm of an owned vector. Collective."""
        return float(np.sqrt(self.dot(x, x)))

    def check(self) -> None:
        """Reject data that no solver could use. Collective on ``comm``.

        Raises:
            InvalidInputError: A shape disagrees with the layout, or an entry is not finite.
            InfeasibleError: The load drives a rigid motion that no multiplier resists.
        """
        with together(self.comm):
            _require_shape("rhs", self.rhs, self.layout.size)
            _require_shape("diagonal", self.diagonal, self.layout.size)
            _require_shape("a column block of G", self.coarse.matrix.T, self.layout.size)
            _require_finite("rhs", self.rhs)
            _require_finite("e", self.coarse.load)
            if not np.all(self.diagonal[self.layout.contact] > 0):
                raise InvalidInputError(
                    f"diagonal must be positive on contact, got {self.diagonal[self.layout.contact].min()}"
                )
            self._require_resisted_load()

    def _require_resisted_load(self) -> None:
        work = self.coarse.unresisted()
        size = np.abs(self.coarse.load).max(initial=0.0)
        if np.abs(work).max(initial=0.0) > 1e-8 * size:
            worst = int(np.argmax(np.abs(work)))
            raise InfeasibleError(
                f"a rigid motion, row {worst} of e, has load {work[worst]:.3e} but no row of B: support it"
            )


@dataclass(frozen=True, eq=False)
class Scaling:
    """Factors s of the multipliers, λ = s μ, that equalise their stiffness, and the coarse space of μ.

    The projector of the problem for μ is that of λ with P_Q = I − Q Gᵀ(G Q Gᵀ)⁻¹G, Q = diag(s²). Where the
    coefficients jump, preconditioned projected conjugate gradients need such a Q to converge independently of
    the jumps. `factor`: s > 0, the same for all multipliers of one contact, owned.

    References:
        A. Klawonn, O. B. Widlund, FETI and Neumann-Neumann iterative substructuring methods: connections and
        new results, Comm. Pure Appl. Math. 54 (2001) 57-90.
    """

    factor: Vector
    coarse: CoarseSpace

    @classmethod
    def build(cls, factor: Vector, coarse: CoarseSpace) -> Scaling:
        """Scale a coarse space; its matrix is factored on first use."""
        scaled = coarse.matrix @ sp.diags(factor)
        return cls(factor, CoarseSpace(coarse.comm, scaled, coarse.load, eliminate=coarse.eliminate))

    def with_load(self, load: Vector) -> Scaling:
        """Return the scaling of a problem with another right side e; factors are shared."""
        return replace(self, coarse=self.coarse.with_load(load))

    def of_coarse(self, coarse: CoarseSpace) -> CoarseSpace:
        """Return the coarse space of μ for that of λ."""
        return self.coarse

    def of_face(self, face: Face) -> Face:
        """Return a face of λ as one of μ."""
        return face.scaled(self.factor)

    def applied_to(self, problem: DualProblem) -> DualProblem:
        """Return the problem for μ, see `DualProblem.scaled_problem`."""
        s, precondition, reach = self.factor, problem.preconditioner, problem.reach

        def scaled(F: Operator) -> Operator:
            return lambda x: s * F(s * x)

        return replace(
            problem,
            operator=scaled(problem.operator),
            exact=None if problem.exact is None else scaled(problem.exact),
            rhs=s * problem.rhs,
            given=None if problem.given is None else s * problem.given,
            coarse=self.coarse,
            diagonal=s**2 * problem.diagonal,
            preconditioner=None if precondition is None else _scaled(precondition, s),
            scaling=Unscaled(),
            reach=lambda x, alpha: s * reach(s * x, alpha),
            friction=problem.law.scaled(s[problem.layout.tangential[:, 0]]),
            compliance=problem.compliance.scaled(s),
            compliant=problem.compliant.scaled(s),
        )


def _scaled(precondition: Operator, s: Vector) -> Operator:
    """Return x -> M(x / s) / s."""
    if isinstance(precondition, FacePreconditioner):
        return _ScaledPreconditioner(precondition, s)
    if isinstance(precondition, RowsOfFace):
        return _ScaledRows(precondition, s)
    return lambda x: precondition(x / s) / s


@dataclass(frozen=True, eq=False)
class _ScaledPreconditioner:
    """x -> M(x / s) / s, on faces as well: s is uniform within a contact, so that Z is that of λ."""

    inner: FacePreconditioner
    factor: Vector

    def __call__(self, residual: Vector) -> Vector:
        return self.inner(residual / self.factor) / self.factor

    def on_face(self, restriction: sp.csr_matrix) -> Operator:
        return _scaled(self.inner.on_face(restriction), self.factor)


@dataclass(frozen=True, eq=False)
class _ScaledRows:
    """x -> M(x / s) / s on a face, with what its rows demand of each other, for scaled multipliers."""

    inner: RowsOfFace
    factor: Vector

    def __call__(self, residual: Vector) -> Vector:
        return self.inner(residual / self.factor) / self.factor

    def contradiction(self, residual: Vector) -> Dependence | None:
        found = self.inner.contradiction(residual / self.factor)
        return found and (self.factor * found[0], found[1] / self.factor, *found[2:])


def _unheard(products: int, residual: float | None) -> None:
    """Tell nobody."""


class CountedOperator:
    """The dual operator together with the number of times it was applied."""

    gives_way, stiffness = False, 1.0

    def __init__(self, operator: Operator, report: Report = _unheard, exact: Operator | None = None) -> None:
        """Wrap ``operator``; ``exact`` is F in double precision where it is in single precision."""
        self._operator, self.report, self._exact = operator, report, exact or operator
        self.products = 0

    def __call__(self, x: Vector) -> Vector:
        """Apply F to an owned vector and count. Collective."""
        return self._counted(self._operator(x))

    def exactly(self, x: Vector) -> Vector:
        """Apply F in double precision, however it is stored, to an owned vector and count. Collective."""
        return self._counted(self._exact(x))

    def _counted(self, product: Vector) -> Vector:
        self.products += 1
        self.report(self.products, None)
        return product

    def anew(self) -> CountedOperator:
        """Return the operator with its counter at zero, for another solver; reports go on from here."""
        before = self.products
        return CountedOperator(
            self._operator, lambda products, residual: self.report(before + products, residual), self._exact
        )


class ShiftedOperator:
    """x ↦ F x + D x with D diagonal, rows that give way; it counts the products of F."""

    gives_way = True

    def __init__(self, operator: CountedOperator, shift: Vector, stiffness: float = 1.0) -> None:
        """Add ``shift``, the diagonal of D, (n_owned,), to F; ``stiffness`` is diag F / D on contact rows."""
        self._operator, self._shift, self.stiffness = operator, shift, stiffness

    def __call__(self, x: Vector) -> Vector:
        """Apply F + D to an owned vector and count. Collective."""
        return self._operator(x) + self._shift * x

    @property
    def products(self) -> int:
        """Products of F so far."""
        return self._operator.products


def _require_shape(name: str, array: Vector, size: int) -> None:
    if array.shape[0] != size:
        raise InvalidInputError(f"{name} must have {size} entries as the layout owns, got {array.shape[0]}")


def _require_finite(name: str, array: Vector) -> None:
    if not np.all(np.isfinite(array)):
        count = int(np.count_nonzero(~np.isfinite(array)))
        raise InvalidInputError(f"{name} must be finite, got {count} entries that are not: check loads, gaps")
