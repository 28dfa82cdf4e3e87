"""Global sums and extrema of small arrays: the only way in which ranks take decisions together."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_contact._base.libraries import MPI

#: One number for each row, (n,).
Vector = npt.NDArray[np.float64]


def global_sum(comm: MPI.Comm, *parts: npt.ArrayLike) -> Vector:
    """Sum arrays over all ranks, joined in one message. Collective on ``comm``."""
    local = np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in parts])
    if comm.size == 1:
        return local
    total = np.empty_like(local)
    comm.Allreduce(local, total, op=MPI.SUM)
    return total


def global_max(comm: MPI.Comm, value: float) -> float:
    """Return the largest of the ranks' values. Collective on ``comm``."""
    return float(comm.allreduce(value, op=MPI.MAX))


def global_min(comm: MPI.Comm, value: float) -> float:
    """Return the smallest of the ranks' values. Collective on ``comm``."""
    return float(comm.allreduce(value, op=MPI.MIN))


def global_least(comm: MPI.Comm, values: Vector) -> Vector:
    """Return the smallest of the ranks' values in each entry, shape (n,). Collective."""
    least = np.empty_like(values)
    comm.Allreduce(values, least, op=MPI.MIN)
    return least
