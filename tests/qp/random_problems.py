"""Small dense dual problems of several bodies, and an independent conic solver for them."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.qp import DualProblem
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.layout import ContactLayout


@dataclass(frozen=True, eq=False)
class DenseProblem:
    """Matrices of a dual problem that live on one rank, and a slip bound."""

    F: np.ndarray
    d: np.ndarray
    G: np.ndarray
    e: np.ndarray
    layout: ContactLayout
    slip_bound: np.ndarray

    @property
    def dual(self) -> DualProblem:
        coarse = CoarseSpace(MPI.COMM_SELF, sp.csr_matrix(self.G), self.e)
        return DualProblem(
            MPI.COMM_SELF, lambda x: self.F @ x, self.d, coarse, self.layout, np.diagonal(self.F).copy()
        )

    def energy(self, multiplier: np.ndarray) -> float:
        return float(0.5 * multiplier @ self.F @ multiplier - self.d @ multiplier)


def random_problem(
    seed: int,
    *,
    n_equality: int = 20,
    n_contact: int = 12,
    n_friction: int | None = None,
    tangents: int = 2,
    m: int = 6,
    rank: int | None = None,
) -> DenseProblem:
    """A random F = A Aᵀ of the given rank, d in its range, e balanced by an admissible multiplier."""
    rng = np.random.default_rng(seed)
    n_friction = n_contact if n_friction is None else n_friction
    n = n_equality + n_contact + tangents * n_friction
    order = rng.permutation(n)
    normal = order[n_equality : n_equality + n_contact]
    tangential = order[n_equality + n_contact :].reshape(n_friction, tangents)
    friction_of = rng.permutation(n_contact)[:n_friction]
    layout = ContactLayout(n, normal, tangential, friction_of)
    rank = n + 5 if rank is None else rank
    A = rng.standard_normal((n, rank)) / np.sqrt(rank) + 0.3 * np.eye(n, rank)
    balanced = rng.standard_normal(n)
    balanced[normal] = rng.uniform(0.5, 1.5, n_contact)
    balanced[tangential] = 0.0
    G = rng.standard_normal((m, n))
    slip_bound = 10.0 ** rng.uniform(-1.0, 0.8, n_friction)
    d = A @ rng.standard_normal(rank)
    return DenseProblem(A @ A.T, d, G, G @ balanced, layout, slip_bound)


def dense_operator(problem: DualProblem) -> np.ndarray:
    """Assemble F of a problem on one rank, column by column."""
    return np.column_stack([problem.operator(column) for column in np.eye(problem.layout.size)])


def conic_solution(
    F: np.ndarray, d: np.ndarray, G: np.ndarray, e: np.ndarray, layout: ContactLayout, slip_bound: np.ndarray
) -> np.ndarray:
    """Solve the Tresca problem with Clarabel's interior point method."""
    n = len(d)
    identity = sp.identity(n, format="csr")
    blocks, rhs = [sp.csr_matrix(G), -identity[layout.normal]], [e, np.zeros(layout.n_contact)]
    cones = [clarabel.ZeroConeT(len(e)), clarabel.NonnegativeConeT(layout.n_contact)]
    for rows, bound in zip(layout.tangential, slip_bound, strict=True):
        blocks += [sp.csr_matrix((1, n)), -identity[rows]]
        rhs += [np.array([bound]), np.zeros(len(rows))]
        cones.append(clarabel.SecondOrderConeT(1 + len(rows)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-13
    upper = sp.triu(sp.csc_matrix(F), format="csc")
    solver = clarabel.DefaultSolver(
        upper, -d, sp.vstack(blocks, format="csc"), np.concatenate(rhs), cones, settings
    )
    solution = solver.solve()
    assert "Solved" in str(solution.status), solution.status
    return np.array(solution.x)


def count_statuses(
    layout: ContactLayout, multiplier: np.ndarray, slip_bound: np.ndarray
) -> tuple[int, int, int]:
    """Count open contacts, sticking and slipping discs of a solution."""
    length = np.linalg.norm(multiplier[layout.tangential], axis=1)
    scale = np.abs(multiplier).max()
    slip = length > slip_bound * (1 - 1e-5)
    return (
        int(np.count_nonzero(multiplier[layout.normal] < 1e-6 * scale)),
        int(np.count_nonzero(~slip)),
        int(np.count_nonzero(slip & (slip_bound > 0))),
    )
