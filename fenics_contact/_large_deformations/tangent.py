"""The dual of a linearised torn system: tangents may be indefinite, and rigid motions have a stiffness."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI, PETSc
from fenics_contact._base.progress import PhaseTimer
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.by_shape import BY_MATRIX
from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.dual import DirichletPreconditioner, DualSystem
from fenics_contact.feti.factor import (
    Factor,
    NoFactor,
    fixing_dofs,
    held_by,
    motions_at,
    petsc_call,
    require_factored,
    symmetric_matrix,
)
from fenics_contact.feti.inverse import FactoredOperator, LocalKind, TornInverse, dofs_inside
from fenics_contact.feti.kernel_basis import TornModes
from fenics_contact.feti.sewing import NOT_SEWN, NotSewn
from fenics_contact.feti.subdomain import CachedMatrix, LocalOperator, Subdomain
from fenics_contact.feti.torn import FluidLoad, TornSystem
from fenics_contact.qp.coarse import CoarseSpace


class RefillableFactor(Factor):
    """Cholesky factors that may take other matrices with the same pattern."""

    positive = True
    #: Largest residual of a solution with factors that are used, relative to its right side.
    accuracy = 1e-8

    def __init__(self, matrix: sp.csr_matrix) -> None:
        """Factor ``matrix``, shape (n, n)."""
        self._pattern = matrix.indptr, matrix.indices
        super().__init__(matrix)

    def refill(self, matrix: sp.csr_matrix) -> bool:
        """Factor another matrix instead, without a new analysis; False where that cannot be done.

        For small matrices the analysis takes most of the time.
        """
        pattern = matrix.indptr, matrix.indices
        if not all(np.array_equal(mine, other) for mine, other in zip(self._pattern, pattern, strict=True)):
            return False
        given = symmetric_matrix(matrix, shared=True)
        given.setOption(PETSc.Mat.Option.SPD, self.positive)
        petsc_call("MatCholeskyFactorNumeric", self._factor.handle, given.handle, None)
        given.destroy()
        return self._complete()

    def _complete(self) -> bool:
        return True

    def fits(self, matrix: sp.csr_matrix) -> bool:
        """Return whether a solution satisfies its equations: without pivoting it may not."""
        right = np.random.default_rng(0).standard_normal(self.size)
        self.solve(right, solution := np.empty_like(right))
        return bool(np.linalg.norm(matrix @ solution - right) <= self.accuracy * np.linalg.norm(right))


class IndefiniteFactor(RefillableFactor):
    """LDLᵀ factors of a sparse symmetric matrix on one rank, by MUMPS, with the number of negative pivots."""

    positive = False
    #: Further memory of each analysis, in percent; MUMPS's own first, more where that was too small.
    _memory: tuple[int | None, ...] = (None, 100, 400)

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int(self._factor.getInertia()[0])

    def _set_up(self, pc: PETSc.PC, given: PETSc.Mat) -> None:
        given.setOption(PETSc.Mat.Option.SPD, False)
        for percent in self._memory:
            pc.setFactorSolverType("mumps")
            pc.setFactorSetUpSolverType()
            factor = pc.getFactorMatrix()
            # Without these MUMPS does not count the pivots of its last front, or PETSc does not ask for them.
            factor.setMumpsIcntl(13, 1)
            factor.setMumpsIcntl(24, 1)
            if percent is not None:
                factor.setMumpsIcntl(14, percent)
            pc.setUp()
            if factor.getMumpsInfog(1) not in (-8, -9):  # its words for too little memory
                break
            # PETSc takes no further matrix into factors that failed: they are analysed anew.
            pc.reset()
            pc.setOperators(given)
        require_factored(factor)

    def _complete(self) -> bool:
        return bool(self._factor.getMumpsInfog(1) >= 0)


def with_inertia(matrix: sp.csr_matrix, unused: RefillableFactor | None) -> IndefiniteFactor:
    """Return factors that know the negative eigenvalues of a matrix, refilled unused ones where they fit."""
    if isinstance(unused, IndefiniteFactor) and unused.refill(matrix):
        return unused
    return IndefiniteFactor(matrix)


def mostly_positive(matrix: sp.csr_matrix, unused: RefillableFactor | None) -> RefillableFactor:
    """Return factors of a matrix that is positive definite but for few exceptions; see `with_inertia`.

    Cholesky factors, which are much faster in small problems, unless their solutions are wrong.
    """
    try:
        if unused is None or isinstance(unused, IndefiniteFactor) or not unused.refill(matrix):
            unused = RefillableFactor(matrix)
    except (PETSc.Error, ConvergenceError):  # as later versions say that it is not positive definite
        return with_inertia(matrix, None)
    return unused if unused.fits(matrix) else with_inertia(matrix, None)


#: Assembles the part of a tangent that is due to stresses as they turn with the cells.
StressStiffness = Callable[[], sp.csr_matrix]


#: Factors that may be refilled: of the held tangent, and of its inner dofs.
Released: TypeAlias = "tuple[RefillableFactor | None, RefillableFactor | None]"


class TangentOperator(FactoredOperator):
    """K_ρ⁻¹ with K_ρ = K + C Cᵀ, and a Schur complement on the interface, for a symmetric tangent K.

    C holds the rigid motions at some nodes and, where these leave motions that stress has made soft or
    unstable, approximate eigenvectors for them. The modes Φ = K_ρ⁻¹C, with factors that make them
    displacements, and their stiffness S keep the dual problem exact for any C.

    The Schur complement is that of K_ρ − C (CᵀK_ρ⁻¹C)⁻¹Cᵀ, which is K without stress: positive, and without
    forces where the modes move. Their stiffness is left to multipliers, preconditioners must leave it out.
    `modes`: Φ; `stiffness`: S with K Φ = Ĉ S, Ĉ the orthonormal columns of C, symmetric; `softened`: number
    of columns for motions that stress has softened.
    """

    _fixing: np.ndarray
    _searched: np.ndarray
    _softest: float
    #: Motions softer than this fraction of the softest one without stress are held by columns of their own,
    soft = 0.5
    #: by this multiple of their negative stiffness,
    grip = 3.0
    #: and by this fraction of a typical entry of the stiffness at least.
    least_grip = 0.1
    #: New vectors in the search for soft motions,
    probes = 4
    #: and iterations of later searches, which start from what was found before.
    later_sweeps = 2

    def __init__(
        self,
        subdomain: Subdomain,
        interface: np.ndarray,
        earlier: TangentOperator | NoTangent,
        by_stress: StressStiffness | None = None,
    ) -> None:
        """Factor a subdomain; ``by_stress`` assembles the part of its tangent that is due to stress."""
        K, size = subdomain.stiffness, subdomain.mesh.size
        typical = float(np.abs(K.diagonal()).max())
        self._fixing = earlier.fixing_dofs(subdomain.points)
        unused, inner = earlier.released
        dofs, basis = self._fixing, motions_at(self._fixing, subdomain.kernel)
        held = held_by(K, dofs, basis, typical)
        factor = with_inertia(held, unused)
        columns = np.zeros((size, basis.shape[1]))
        columns[dofs] = basis
        weights = np.full(basis.shape[1], typical)
        soft, grip = self._soft_motions(held, factor, earlier, typical, by_stress)
        self.softened = soft.shape[1]
        whole = _Updated(factor, soft, np.diag(grip))
        columns, weights = np.hstack([columns, soft]), np.concatenate([weights, grip])
        self.modes = whole.solve_many(columns * weights)
        self.stiffness = _symmetric(np.linalg.lstsq(columns, K @ self.modes, rcond=None)[0])
        # In terms of the orthonormal columns, by K Φ = Ĉ S: accurate where S is small.
        self._relief = -_symmetric(self.stiffness @ np.linalg.inv(columns.T @ self.modes))
        rest = dofs_inside(K, interface)
        self._at_interface, self._at_rest = columns[interface], columns[rest]
        inner = mostly_positive(K[rest][:, rest].tocsr(), inner) if len(rest) else None
        inside = NoFactor() if inner is None else _Updated(inner, self._at_rest, self._relief)
        self._factors = factor, inner
        self.released: Released = (None, None)
        super().__init__(K, interface, whole, inside)

    def release_factors(self) -> None:
        """Hand the factorisation to the operator of the next shape; do not use this one afterwards."""
        self.released = self._factors

    def fixing_dofs(self, points: np.ndarray) -> np.ndarray:
        """Return the dofs by which a subdomain is held."""
        return self._fixing

    def softest(
        self, held: sp.csr_matrix, factor: IndefiniteFactor, probes: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return eigenvalues next to zero and their vectors, and the softest one without stress."""
        probes = np.hstack([self._searched, probes])
        return *_softest(held, factor, probes, self.later_sweeps), self._softest

    def _soft_motions(
        self,
        held: sp.csr_matrix,
        factor: IndefiniteFactor,
        earlier: TangentOperator | NoTangent,
        typical: float,
        by_stress: StressStiffness | None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return motions that need columns of their own, shape (n, k), and the stiffness of each."""
        probes = np.random.default_rng(0).standard_normal((factor.size, self.probes))
        values, vectors, self._softest = earlier.softest(held, factor, probes)
        soft = values < self.soft * self._softest
        if by_stress is not None and soft.any():
            # What materials themselves resist less, as beyond yield, stress has not softened.
            turning = np.einsum("ik,ik->k", vectors, by_stress() @ vectors)
            soft &= values < np.maximum(self.soft * (values - turning), 0.0)
        self._searched = vectors[:, soft]
        return self._searched, self.grip * np.maximum(-values[soft], 0.0) + self.least_grip * typical

    def _forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        here, inside = super()._forces(displacement)
        moved = self._relief @ (self._at_interface.T @ displacement)
        return here + self._at_interface @ moved, inside + self._at_rest @ moved

    def _forces_from_inside(self, displacement: np.ndarray) -> np.ndarray:
        moved = self._relief @ (self._at_rest.T @ displacement)
        return super()._forces_from_inside(displacement) + self._at_interface @ moved


class NoTangent:
    """What is known of a subdomain before its first tangent."""

    released: Released = (None, None)
    #: Iterations of the first search for soft motions.
    sweeps = 6

    def fixing_dofs(self, points: np.ndarray) -> np.ndarray:
        """Return the dofs by which a subdomain is held."""
        return _well_spread(points)

    def softest(
        self, held: sp.csr_matrix, factor: IndefiniteFactor, probes: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return eigenvalues next to zero and their vectors, and the softest one without stress."""
        values, vectors = _softest(held, factor, probes, self.sweeps)
        return values, vectors, float(np.abs(values).min())


def _well_spread(points: np.ndarray, spread: float = 4.0) -> np.ndarray:
    """Return the dofs of nodes by which a subdomain is held, ascending, shape (n_dofs,).

    Their number is ``spread`` times the cube root of that of all nodes: held at its corners alone, a body
    under stress buckles around them.
    """
    return fixing_dofs(points, round(spread * len(points) ** (1.0 / 3.0)))


class _Updated:
    """The inverse of A + V D Vᵀ with factors of A, by Woodbury's formula."""

    def __init__(self, factor: RefillableFactor, columns: np.ndarray, added: np.ndarray) -> None:
        """Prepare for V, shape (n, k), and D, symmetric and maybe singular, shape (k, k)."""
        self._factor, self._columns = factor, columns
        self._moved = factor.solve_many(columns)
        self._small = np.linalg.solve(np.eye(len(added)) + added @ (columns.T @ self._moved), added)

    @property
    def entries(self) -> int:
        """Number of entries of the factor and of the columns."""
        return self._factor.entries + self._moved.size

    def solve(self, right: np.ndarray, out: np.ndarray) -> None:
        """Write the solution for one right side, shape (n,), into ``out``."""
        self._factor.solve(right, out)
        if len(self._small):
            out -= self._moved @ (self._small @ (self._columns.T @ out))

    def solve_many(self, right: np.ndarray) -> np.ndarray:
        """Return the solutions for the columns of ``right``, shape (n, k)."""
        solution = self._factor.solve_many(right)
        if len(self._small):
            solution = solution - self._moved @ (self._small @ (self._columns.T @ solution))
        return solution


def _softest(
    held: sp.csr_matrix, factor: IndefiniteFactor, start: np.ndarray, sweeps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return approximate eigenvalues next to zero, ascending, and their vectors, by inverse iteration."""
    basis = start
    for _ in range(sweeps):
        basis, _ = np.linalg.qr(factor.solve_many(basis))
    values, factors = np.linalg.eigh(_symmetric(basis.T @ (held @ basis)))
    if np.count_nonzero(values < 0.0) < factor.negative:
        basis, _ = np.linalg.qr(np.hstack([basis, _negative(held, factor, start.sum(axis=1))]))
        values, factors = np.linalg.eigh(_symmetric(basis.T @ (held @ basis)))
    return values, basis @ factors


def _negative(held: sp.csr_matrix, factor: IndefiniteFactor, start: np.ndarray) -> np.ndarray:
    """Return approximate eigenvectors of the negative eigenvalues, shape (n, k).

    The inverse separates those next to zero, and has large ones amid a cluster: these the matrix separates.
    There are both where few cells have lost their strength, as beyond a limit of stretch.
    """

    def invert(right: np.ndarray) -> np.ndarray:
        factor.solve(np.ascontiguousarray(right, dtype=np.float64).ravel(), out := np.empty(factor.size))
        return out

    inverse = LinearOperator((factor.size, factor.size), matvec=invert, dtype=np.float64)
    count = min(factor.negative, factor.size - 1)
    near = _lowest(inverse, count, start)
    missing = count - near.shape[1]
    return np.hstack([near, _lowest(held, missing, start)]) if missing else near


def _lowest(operator: sp.csr_matrix | LinearOperator, count: int, start: np.ndarray) -> np.ndarray:
    """Return those approximate eigenvectors of the lowest eigenvalues that are found soon, shape (n, k).

    Any columns will do, so that two digits and few restarts suffice.
    """
    try:
        return np.asarray(eigsh(operator, count, which="SA", v0=start, tol=1e-2, maxiter=20)[1])
    except ArpackNoConvergence as found:
        return np.asarray(found.eigenvectors)


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * (matrix + matrix.T))


class TangentInverse(TornInverse):
    """K_ρ⁻¹ of this rank's subdomains, with the modes and their stiffness."""

    def __init__(
        self,
        torn: TornSystem,
        condensations: Condensations,
        earlier: Mapping[int, TangentOperator],
        by_stress: Mapping[int, StressStiffness],
    ) -> None:
        """Factor the tangents; ``earlier`` has operators of an earlier shape by number of subdomain."""
        self._earlier, self._by_stress = earlier, by_stress
        super().__init__(torn.subdomains, torn.B, condensations, kind=LocalKind.IMPLICIT, shared=False)

    def _factor(
        self, subdomain: Subdomain, interface: np.ndarray, condensations: Condensations
    ) -> LocalOperator:
        number = subdomain.mesh.number
        return TangentOperator(
            subdomain, interface, self._earlier.get(number, NoTangent()), self._by_stress.get(number)
        )

    @property
    def tangents(self) -> Sequence[TangentOperator]:
        """The factored subdomains."""
        return [operator for operator in self.operators if isinstance(operator, TangentOperator)]


class TangentSystem(DualSystem):
    """The dual of a torn system linearised at a displacement and multipliers.

    Its torn system has the tangents of the subdomains as stiffness, the forces out of balance as load, the
    rigid motions of the present shape as kernel, and c − B u as right side; displacements and multipliers are
    increments. `softened`: number of motions of all subdomains that stress has softened or made unstable,
    which have columns of their own.
    """

    whole_faces = False

    inverse: TangentInverse
    stiffness: sp.csr_matrix
    softened: int

    def __init__(
        self,
        torn: TornSystem,
        timer: PhaseTimer | None = None,
        *,
        diagonal: np.ndarray | None = None,
        earlier: Mapping[int, TangentOperator] | None = None,
        by_stress: Mapping[int, StressStiffness] | None = None,
    ) -> None:
        """Factor the tangents and assemble d, G, S, e. Collective."""
        self._known_diagonal, self._earlier, self._by_stress = diagonal, earlier or {}, by_stress or {}
        super().__init__(torn, timer, kind=LocalKind.IMPLICIT)

    def _inverse(
        self, torn: TornSystem, condensations: Condensations, kind: LocalKind, known: TornInverse | None
    ) -> TornInverse:
        inverse = TangentInverse(torn, condensations, self._earlier, self._by_stress)
        self._earlier, self._by_stress = {}, {}  # a history must not keep all its linearisations
        parts = zip(torn.subdomains, inverse.tangents, strict=True)
        subdomains = tuple(replace(subdomain, kernel=operator.modes) for subdomain, operator in parts)
        self.torn = replace(torn, subdomains=subdomains)
        return inverse

    @property
    def operators(self) -> dict[int, TangentOperator]:
        """This rank's factored subdomains by number."""
        each = zip(self.torn.subdomains, self.inverse.tangents, strict=True)
        return {subdomain.mesh.number: operator for subdomain, operator in each}

    def _kernel(self, comm: MPI.Comm) -> TornModes:
        shared = comm.allgather({n: (each.stiffness, each.softened) for n, each in self.operators.items()})
        blocks = {number: block for part in shared for number, block in part.items()}
        stiffnesses = [blocks[number][0] for number in sorted(blocks)]
        self.stiffness = Csr(sp.block_diag(stiffnesses))
        self.softened = sum(count for _, count in blocks.values())
        offset = np.concatenate([[0], np.cumsum([len(block) for block in stiffnesses])])
        mine = offset[[part.mesh.number for part in self.torn.subdomains]]
        total, count = int(offset[-1]), self.torn.free.count
        motions = TornModes.of(self.torn.subdomains, mine, total)
        self.points = Csr((count, total))
        if count:  # free motions move nothing but the right sides of rows
            known = self.torn.free.stiffness
            own = Csr((count, count)) if known is None else Csr(known)
            self.points = sp.hstack([self.points, sp.identity(count)], format="csr")
            self.stiffness = Csr(sp.block_diag([self.stiffness, own]))
            motions = motions.combined(sp.eye(total, total + count, format="csr"))
        return motions

    def _sewing(self) -> NotSewn:
        """Return none: tangents change with every step, and may be indefinite."""
        return NOT_SEWN

    def _without_unheld(self, coarse: CoarseSpace) -> CoarseSpace:
        """Leave the motions as they are: under stress they may have a stiffness."""
        self.unheld = Csr((self.kernel.shape[0], 0))
        self._unheld_points = self.points[:, :0]
        return coarse

    def conforming_on(self, torn: TornSystem, displacement: np.ndarray) -> np.ndarray:
        """Return a displacement on the rows of a neighbouring configuration made continuous. Collective."""
        rows, numbering = torn.B[:, self.inverse.interface].tocsr(), torn.numbering
        sewing = DirichletPreconditioner(self.inverse, rows, self._compliance(), numbering, torn.n_gluing)
        nothing = Csr((len(torn.right), 0))
        sewn = sewing.lifting(nothing).jump(torn.right - torn.jump(displacement))
        return displacement + self.inverse.extend(sewn)

    def _diagonal(self) -> tuple[np.ndarray, np.ndarray]:
        if self._known_diagonal is not None:
            return self._known_diagonal, np.zeros(len(self._known_diagonal), dtype=bool)
        return super()._diagonal()


def linearised(
    torn: TornSystem,
    displacement: np.ndarray,
    tangents: Sequence[sp.csr_matrix],
    unbalanced: np.ndarray,
    constraint_residual: np.ndarray,
) -> TornSystem:
    """Return the torn system of increments at a displacement; forces out of balance are all its load."""
    subdomains, start = [], 0
    for subdomain, tangent in zip(torn.subdomains, tangents, strict=True):
        part = slice(start, start + subdomain.mesh.size)
        points = subdomain.points + displacement[part].reshape(subdomain.points.shape)
        body = torn.scene.bodies[subdomain.mesh.body]
        kernel = body.kinematics.rigid_modes(points).reshape(subdomain.mesh.size, -1)
        matrix = CachedMatrix(partial(_itself, tangent))
        # All motions are in the kernel, whatever resists them.
        subdomains.append(
            replace(
                subdomain, points=points, kernel=kernel, resisted=kernel[:, :0], resistance=np.zeros(0),
                load=unbalanced[part], matrix=matrix, shape=BY_MATRIX,
            )
        )  # fmt: skip
        start = part.stop
    return replace(torn, subdomains=tuple(subdomains), right=constraint_residual, fluid=FluidLoad())


def _itself(matrix: sp.csr_matrix) -> sp.csr_matrix:
    return matrix
