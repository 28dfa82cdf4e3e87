"""Friction problems published by others as W, q and μ, and the residual by which solvers are compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from scipy.sparse.linalg import LinearOperator, eigsh

from fenics_contact.qp import DualProblem
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.layout import ContactLayout

#: All eleven by their names.
CASES = {path.stem: path for path in sorted((Path(__file__).parents[1] / "data/siconos").glob("*.npz"))}
#: One on which the plain fixed point runs in circles.
CYCLING = CASES["OneObject-i100000-499__sym"]


def published(path: Path) -> tuple[DualProblem, np.ndarray]:
    """Return the dual problem F = W, d = −q without any body that floats, and μ."""
    with np.load(path) as case:
        W = sp.csr_matrix((case["W_data"], case["W_indices"], case["W_indptr"]), shape=tuple(case["W_shape"]))
        q, mu_f = case["q"].astype(float), case["mu"].astype(float)
    n = len(q)
    rows = np.arange(n).reshape(-1, 3)
    layout = ContactLayout.build(n, normal=rows[:, 0], tangential=rows[:, 1:])
    free = CoarseSpace(MPI.COMM_SELF, sp.csr_matrix((0, n)), np.zeros(0))
    return DualProblem(MPI.COMM_SELF, lambda x: W @ x, -q, free, layout, W.diagonal()), mu_f


def cone_residual(problem: DualProblem, mu_f: np.ndarray, multiplier: np.ndarray) -> float:
    """Return ‖R − P_K(R − ρ V̂)‖ / max(‖R‖, ρ‖q‖) with V̂ = V + μ‖V_T‖ e_N and ρ = 1/‖W‖.

    The natural map of De Saxcé's form of the law, with one ρ for all contacts: the `rels` of Siconos's
    judges, not the residual by which the solvers of this project stop.
    """
    n = problem.layout.size
    W = LinearOperator((n, n), matvec=problem.operator, dtype=np.float64)
    rho = 1.0 / float(eigsh(W, k=1, v0=np.ones(n), return_eigenvectors=False)[0])
    velocity = (problem.operator(multiplier) - problem.rhs).reshape(-1, 3)
    velocity[:, 0] += mu_f * np.linalg.norm(velocity[:, 1:], axis=1)
    reaction = multiplier.reshape(-1, 3)
    distance = reaction - _nearest_in_cone(reaction - rho * velocity, mu_f)
    scale = max(np.linalg.norm(reaction), rho * np.linalg.norm(problem.rhs))
    return float(np.linalg.norm(distance) / scale)


def _nearest_in_cone(x: np.ndarray, mu_f: np.ndarray) -> np.ndarray:
    normal, length = x[:, 0], np.linalg.norm(x[:, 1:], axis=1)
    peak = np.maximum((mu_f * length + normal) / (1 + mu_f**2), 0.0)
    direction = x[:, 1:] / np.maximum(length, np.finfo(float).tiny)[:, None]
    mantle = np.column_stack([peak, (mu_f * peak)[:, None] * direction])
    return np.where((length <= mu_f * normal)[:, None], x, mantle)
