"""A subdomain under stress: its tangent may be indefinite, and rigid motions have a stiffness."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fenics_contact.feti import (
    FIXING_NODES,
    FactoredOperator,
    Subdomain,
    dofs_inside,
    fixing_dofs,
    held_by,
    motions_at,
)
from fenics_contact.nonlinear.indefinite_factor import (
    IndefiniteFactor,
    RefillableFactor,
    mostly_positive,
    with_inertia,
)

#: Fixing nodes relative to the cube root of the number of nodes: held at its corners alone, a body under
#: stress buckles around them.
SPREAD = 4.0
#: Motions softer than this fraction of the softest one without stress are held by columns of their own: these
#: by a multiple of their negative stiffness, and by a fraction of a typical entry of the stiffness at least.
SOFT, GRIP, LEAST_GRIP = 0.5, 3.0, 0.1
#: New vectors in the search for soft motions, and iterations of the first search and of later ones.
PROBES, FIRST_SWEEPS, SWEEPS = 4, 6, 2
#: Accuracy of eigenvectors, and restarts of the search for them: any columns will do.
ROUGH, RESTARTS = 1e-2, 20


class TangentOperator(FactoredOperator):
    """K_ρ⁻¹ with K_ρ = K + C Cᵀ, and a Schur complement on the interface, for a symmetric tangent K.

    C holds the rigid motions at some nodes and, where these leave motions that stress has made soft or
    unstable, approximate eigenvectors for them. The modes Φ = K_ρ⁻¹C, with factors that make them
    displacements, and their stiffness S keep the dual problem exact for any C.

    The Schur complement is that of K_ρ − C (CᵀK_ρ⁻¹C)⁻¹Cᵀ, which is K without stress: positive, and without
    forces where the modes move. Multipliers bear their stiffness, which preconditioners must leave out.

    Attributes:
        modes: Φ, shape (n, m).
        stiffness: S with K Φ = Ĉ S, Ĉ the orthonormal columns of C, shape (m, m), symmetric.
        softened: Number of columns for motions that stress has softened.
    """

    _fixing: np.ndarray
    _searched: np.ndarray
    _softest: float
    _spent: tuple[RefillableFactor | None, RefillableFactor | None] = (None, None)

    def __init__(self, subdomain: Subdomain, interface: np.ndarray, earlier: TangentOperator | None) -> None:
        """Factor a subdomain.

        Args:
            subdomain: Its tangent and the rigid motions of its present shape, as kernel.
            interface: Interface dofs b, shape (n_b,).
            earlier: That of an earlier shape, whose soft motions are a start; None for the first.
        """
        K, size = subdomain.stiffness, subdomain.mesh.size
        typical = float(np.abs(K.diagonal()).max())
        self._fixing = _well_spread(subdomain.points) if earlier is None else earlier._fixing
        spent, inner = (None, None) if earlier is None else earlier._spent
        dofs, basis = self._fixing, motions_at(self._fixing, subdomain.kernel)
        held = held_by(K, dofs, basis, typical)
        factor = with_inertia(held, spent)
        columns = np.zeros((size, basis.shape[1]))
        columns[dofs] = basis
        weights = np.full(basis.shape[1], typical)
        soft, grip = self._soft_motions(held, factor, earlier, typical)
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
        inside = None if inner is None else _Updated(inner, self._at_rest, self._relief)
        self._factors = factor, inner
        super().__init__(K, interface, whole, inside)

    def release_factors(self) -> None:
        """Hand the factorisation to the operator of the next shape; do not use this one afterwards."""
        self._spent = self._factors

    def _soft_motions(
        self, held: sp.csr_matrix, factor: IndefiniteFactor, earlier: TangentOperator | None, typical: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return motions that need columns of their own, shape (n, k), and the stiffness of each."""
        probes = np.random.default_rng(0).standard_normal((factor.size, PROBES))
        sweeps = SWEEPS
        if earlier is not None:
            probes, self._softest = np.hstack([earlier._searched, probes]), earlier._softest
        else:
            sweeps = FIRST_SWEEPS
        values, vectors = _softest(held, factor, probes, sweeps)
        if earlier is None:
            self._softest = float(np.abs(values).min())
        soft = values < SOFT * self._softest
        self._searched = vectors[:, soft]
        return self._searched, GRIP * np.maximum(-values[soft], 0.0) + LEAST_GRIP * typical

    def _forces(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        here, inside = super()._forces(displacement)
        moved = self._relief @ (self._at_interface.T @ displacement)
        return here + self._at_interface @ moved, inside + self._at_rest @ moved

    def _forces_from_inside(self, displacement: np.ndarray) -> np.ndarray:
        moved = self._relief @ (self._at_rest.T @ displacement)
        return super()._forces_from_inside(displacement) + self._at_interface @ moved


def _well_spread(points: np.ndarray) -> np.ndarray:
    """Return the dofs of nodes by which a subdomain is held, ascending, shape (n_dofs,)."""
    return fixing_dofs(points, max(FIXING_NODES, round(SPREAD * len(points) ** (1.0 / 3.0))))


class _Updated:
    """The inverse of A + V D Vᵀ with factors of A, by Woodbury's formula."""

    def __init__(self, factor: RefillableFactor, columns: np.ndarray, added: np.ndarray) -> None:
        """Prepare for V, shape (n, k), and D, symmetric and maybe singular, shape (k, k)."""
        self._factor, self._columns = factor, columns
        self._moved = factor.solve_many(columns)
        self._small = np.linalg.solve(np.eye(len(added)) + added @ (columns.T @ self._moved), added)

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
    """Return approximate eigenvalues next to zero, ascending, and their vectors, by inverse iteration.

    Args:
        held: The matrix, shape (n, n).
        factor: Its factors.
        start: Vectors to start from, shape (n, k).
        sweeps: Number of iterations.
    """
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
    """Return those approximate eigenvectors of the lowest eigenvalues that are found soon, shape (n, k)."""
    try:
        return np.asarray(eigsh(operator, count, which="SA", v0=start, tol=ROUGH, maxiter=RESTARTS)[1])
    except ArpackNoConvergence as found:
        return np.asarray(found.eigenvectors)


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * (matrix + matrix.T))
