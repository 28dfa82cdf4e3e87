"""Sparse Cholesky factors through PETSc, and the generalised inverse of a floating subdomain."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property, lru_cache

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import PETSc, check_not_forked
from fenics_contact._base.sparse import dispose_with
from fenics_contact.errors import ConvergenceError, InvalidInputError

#: Enough nodes to fix all rigid motions of a body that is not a line, few enough to keep the factor sparse.
FIXING_NODES = 4
#: What leaves motions without energy, and what to do.
ONE_LAYER = (
    "rows of single cells by reduced integration (C3D20R in decks) may move without energy, as may one layer "
    "of them in contact or tied: give the body integration='stabilised', or take two layers"
)


class Factor:
    """Cholesky factor of a sparse symmetric positive definite matrix on one rank.

    CHOLMOD where PETSc has it, else MUMPS.
    """

    def __init__(self, matrix: sp.csr_matrix) -> None:
        """Factor ``matrix``, shape (n, n)."""
        self.size = matrix.shape[0]
        given = symmetric_matrix(matrix, shared=True)
        pc = PETSc.PC().create(PETSc.COMM_SELF)
        pc.setOperators(given)
        pc.setType(PETSc.PC.Type.CHOLESKY)
        with _silent_cholmod(), _named_failure():
            self._set_up(pc, given)
        self._factor = pc.getFactorMatrix()
        self._right, self._left = given.createVecs()
        # Only the factor is stored: the matrix would take another third of its memory.
        pc.destroy()
        given.destroy()
        dispose_with(self, self._factor, self._right, self._left)

    @classmethod
    def of_stiffness(cls, matrix: sp.csr_matrix, worst: float = 0.02) -> Factor | NoFactor:
        """Factor a stiffness that resists every motion, or one without rows.

        Pivots that are rounding may be positive: a solution shows them. `worst`: error of a solution, see
        `error_of_a_solution`, that is refused.
        """
        if matrix.shape[0] == 0:
            return NoFactor()
        factor = cls(matrix)
        if words := factor.doubt(matrix, worst):
            raise InvalidInputError(f"a factored stiffness must resist every motion, but {words}")
        return factor

    def doubt(self, matrix: sp.csr_matrix, worst: float = 0.02) -> str:
        """Return in words that a stiffness has motions without energy but rounding; empty if it has none."""
        error = self.error_of_a_solution(matrix)
        if error < worst:
            return ""
        return (
            f"of a solution that is known components are off by {error:.2g} of themselves, so that some "
            f"motion costs no energy but rounding: {ONE_LAYER}; or a body is too slender, its cells are too "
            "flat, or its materials too different for double precision"
        )

    def error_of_a_solution(self, matrix: sp.csr_matrix) -> float:
        """Return the largest relative error of components of a solution that is known, ±1 / √K_ii.

        It is about the rounding of the scaled matrix over its smallest eigenvalue.
        """
        weight = np.sqrt(np.abs(matrix.diagonal()))
        weight[weight == 0.0] = 1.0
        known = np.random.default_rng(0).choice((-1.0, 1.0), self.size) / weight
        self.solve(matrix @ known, found := np.empty(self.size))
        return float(np.abs(weight * (found - known)).max())

    def _set_up(self, pc: PETSc.PC, given: PETSc.Mat) -> None:
        """Choose a library and factor."""
        pc.setFactorSolverType(_solver())
        pc.setUp()
        if _solver() == "mumps":
            require_factored(pc.getFactorMatrix())

    @cached_property
    def entries(self) -> int:
        """Number of entries of the factor."""
        return int(self._factor.getInfo()["nz_used"])

    def solve(self, right: np.ndarray, out: np.ndarray) -> None:
        """Write the solution for one right side, shape (n,), into ``out``."""
        check_not_forked()
        self._right.array_w[:] = right
        self._factor.solve(self._right, self._left)
        out[:] = self._left.array_r

    def solve_many(self, right: np.ndarray) -> np.ndarray:
        """Return the solutions for the columns of ``right``, shape (n, k)."""
        columns = right.shape[1]
        if columns == 0:
            return np.zeros_like(right)
        given = PETSc.Mat().createDense(
            (self.size, columns), array=np.asfortranarray(right), comm=PETSc.COMM_SELF
        )
        solutions = PETSc.Mat().createDense((self.size, columns), comm=PETSc.COMM_SELF)
        solutions.setUp()
        self._factor.matSolve(given, solutions)
        solution = np.array(solutions.getDenseArray())
        given.destroy()
        solutions.destroy()
        return solution


class NoFactor:
    """The factor of a matrix without rows."""

    entries = 0

    def doubt(self, matrix: sp.csr_matrix) -> str:
        """Return nothing."""
        return ""

    def solve(self, right: np.ndarray, out: np.ndarray) -> None:
        """Write nothing."""

    def solve_many(self, right: np.ndarray) -> np.ndarray:
        """Return no rows."""
        return right


def require_factored(factor: PETSc.Mat) -> None:
    """Reject factors that MUMPS could not complete: PETSc passes over that until they are used."""
    code = factor.getMumpsInfog(1)
    if code < 0:
        raise _failure(f"MUMPS ends with INFOG(1) = {code}")


@contextmanager
def _silent_cholmod() -> Iterator[None]:
    """Have factors that begin inside print nothing: what is wrong with a matrix becomes an error."""
    options, name = PETSc.Options(), "mat_cholmod_print"
    if options.hasName(name):  # the user wants to see it
        yield
        return
    options.setValue(name, 0)
    try:
        yield
    finally:
        options.delValue(name)


@contextmanager
def _named_failure() -> Iterator[None]:
    try:
        yield
    except PETSc.Error as error:
        raise _failure(str(error).strip().splitlines()[-1]) from error


def _failure(reason: str) -> ConvergenceError:
    return ConvergenceError(
        f"matrices of subdomains must have factors, but {reason}: check the constants of materials, and that "
        "no cell is flat and there is memory for them"
    )


def symmetric_matrix(matrix: sp.csr_matrix, *, shared: bool = False) -> PETSc.Mat:
    """Return a symmetric positive definite matrix on one rank in PETSc's format."""
    if shared and not matrix.has_canonical_format:
        matrix = matrix.copy()
        matrix.sum_duplicates()
    indices = (part.astype(PETSc.IntType, copy=False) for part in (matrix.indptr, matrix.indices))
    csr = (*indices, matrix.data)
    make = PETSc.Mat().createAIJWithArrays if shared else PETSc.Mat().createAIJ
    given = make(matrix.shape, csr=csr, comm=PETSc.COMM_SELF)
    given.setOption(PETSc.Mat.Option.SPD, True)
    given.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return given


@lru_cache(maxsize=1)
def _solver() -> str:
    """Name the factorisation library that this PETSc was built with.

    PETSc reports CHOLMOD wrongly in some distributions, so a 1 x 1 matrix is factored.
    """
    one = PETSc.Mat().createAIJ((1, 1), csr=([0, 1], [0], [1.0]), comm=PETSc.COMM_SELF)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOperators(one)
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType("cholmod")
    try:
        pc.setUp()
    except PETSc.Error:
        return "mumps"
    return "cholmod"


def fixing_nodes(points: np.ndarray, count: int = FIXING_NODES) -> np.ndarray:
    """Select well-spread nodes: each one is the farthest from those already selected."""
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    chosen = [int(np.argmax(distance))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def regularised(stiffness: sp.csr_matrix, kernel: np.ndarray, points: np.ndarray) -> sp.csr_matrix:
    """Return K + ρ R̂ R̂ᵀ, sparse and positive definite, whose inverse is a generalised inverse of K.

    R̂ is the kernel restricted to a few fixing nodes and orthonormalised; ρ is the largest diagonal entry of
    K.

    References:
        Brzobohatý, Dostál, Kozubek, Kovář, Markopoulos: Cholesky decomposition with fixing nodes to
        stable computation of a generalized inverse of the stiffness matrix of a floating structure.
        Int. J. Numer. Meth. Engng 88 (2011) 493-509.
    """
    dofs = fixing_dofs(points, components=stiffness.shape[0] // len(points))
    return held_by(stiffness, dofs, motions_at(dofs, kernel), float(stiffness.diagonal().max()))


def fixing_dofs(points: np.ndarray, count: int = FIXING_NODES, components: int | None = None) -> np.ndarray:
    """Return the dofs of well-spread nodes, ascending, shape (n_dofs,); see `fixing_nodes`."""
    nodes, width = np.sort(fixing_nodes(points, count)), components or points.shape[1]
    return np.asarray((width * nodes[:, None] + np.arange(width)).ravel())


def motions_at(dofs: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Return orthonormal rigid motions on some dofs, (n_dofs, n_modes), from those of all, (n, n_modes)."""
    basis, _ = np.linalg.qr(kernel[dofs])
    return np.asarray(basis)


def held_by(stiffness: sp.csr_matrix, dofs: np.ndarray, motions: np.ndarray, weight: float) -> sp.csr_matrix:
    """Return K + ρ R̂ R̂ᵀ, with the motions R̂ on some dofs and a weight ρ."""
    block = weight * (motions @ motions.T)
    rows, columns = np.repeat(dofs, len(dofs)), np.tile(dofs, len(dofs))
    return (stiffness + sp.coo_matrix((block.ravel(), (rows, columns)), shape=stiffness.shape)).tocsr()


def petsc_call(name: str, *arguments: object) -> None:
    """Call a function by its name; integers are handles of objects."""
    wrapped = [ctypes.c_void_p(a) if isinstance(a, int) else a for a in arguments]
    code = getattr(_petsc(), name)(*wrapped)
    if code:
        raise PETSc.Error(code)


@lru_cache(maxsize=1)
def _petsc() -> ctypes.CDLL:
    # The symbols of libpetsc are resolved through the extension module that is linked with it.
    return ctypes.CDLL(PETSc.__file__)
