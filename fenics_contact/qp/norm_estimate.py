"""Largest eigenvalue of a symmetric operator, bounded from above in a few products."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from fenics_contact._libraries import MPI
from fenics_contact.qp.problem import Operator
from fenics_contact.qp.reductions import Vector, global_sum


def largest_eigenvalue(
    comm: MPI.Comm, operator: Operator, size: int, *, accuracy: float = 0.05, max_products: int = 40
) -> float:
    """Return an upper estimate of ‖A‖ by Lanczos with full reorthogonalisation. Collective.

    The largest Ritz value θ is a lower bound; θ plus the residual norm of its Ritz vector bounds from
    above the eigenvalue it belongs to. Iterated until the two agree to ``accuracy``; the upper one is
    returned, because a fixed step length 1.9/‖A‖ must not be too long.

    Args:
        comm: Communicator over which the vectors are distributed.
        operator: Symmetric positive semidefinite A, owned to owned, collective.
        size: Length of this rank's owned vector.
        accuracy: Relative distance of the bounds at which to stop.
        max_products: Largest number of operator applications.

    Returns:
        The estimate, the same on every rank; 0 for an operator that maps the start to zero.
    """
    start = np.random.default_rng(comm.rank).standard_normal(size)
    basis: list[Vector] = [np.asarray(start / (_norm(comm, start) or 1.0), dtype=np.float64)]
    diagonal: list[float] = []
    beside: list[float] = []
    for _ in range(max_products):
        image = operator(basis[-1])
        block = np.array(basis)
        weights = global_sum(comm, block @ image)
        image = image - weights @ block
        image -= global_sum(comm, block @ image) @ block
        diagonal.append(float(weights[-1]))
        length = _norm(comm, image)
        values, vectors = scipy.linalg.eigh_tridiagonal(diagonal, beside)
        bound = float(values[-1] + length * abs(vectors[-1, -1]))
        if bound - values[-1] <= accuracy * values[-1] or length <= 1e-14 * abs(bound):
            break
        beside.append(length)
        basis.append(np.asarray(image / length, dtype=np.float64))
    return bound


def _norm(comm: MPI.Comm, x: Vector) -> float:
    return float(np.sqrt(global_sum(comm, x @ x)[0]))
