"""Check that all ranks have the same input, instead of solving a mixture or waiting forever."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

from fenics_contact.errors import InvalidInputError, agree
from fenics_contact.fingerprint.description import differences

if TYPE_CHECKING:  # the optimiser does without mpi4py
    from mpi4py import MPI


def require_alike(comm: MPI.Comm, descriptions: Mapping[str, str]) -> None:
    """Reject input that differs from rank to rank. Collective on ``comm``.

    Args:
        comm: Communicator of the ranks that must have the same input.
        descriptions: This rank's input, from `described`.

    Raises:
        InvalidInputError: On all ranks; names the differences between two of them.
    """
    if comm.size == 1:
        return
    digest = hashlib.sha256(repr(list(descriptions.items())).encode()).digest()
    digests = comm.allgather(digest)
    other = next((rank for rank, each in enumerate(digests) if each != digests[0]), 0)
    if other == 0:
        return
    first = comm.bcast(dict(descriptions))
    named = comm.bcast(differences(first, descriptions) or [_order(first, descriptions)], root=other)
    error = InvalidInputError(
        f"all ranks must be given the same, but on rank 0 and rank {other} differ {'; '.join(named)}: build "
        "it from the same numbers on every rank, or on rank 0 alone and send it with comm.bcast"
    )
    agree(comm, error)


def _order(there: Mapping[str, str], here: Mapping[str, str]) -> str:
    """Describe where two descriptions differ in order."""
    pairs = zip(there, here, strict=True)
    one, other = next(((one, other) for one, other in pairs if one != other), ("", ""))
    return f"the order of entries ({one}, {other})"
