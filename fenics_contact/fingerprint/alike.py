"""Ranks that are given different things are told so, instead of solving a mixture or waiting for ever."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

from fenics_contact.errors import InvalidInputError, agree
from fenics_contact.fingerprint.description import differences

if TYPE_CHECKING:  # the optimiser does without mpi4py
    from mpi4py import MPI


def require_alike(comm: MPI.Comm, told: Mapping[str, str]) -> None:
    """Refuse input that differs from rank to rank. Collective on ``comm``.

    Args:
        comm: Communicator of the ranks that must have been given the same.
        told: What this rank was given, as `described` tells it.

    Raises:
        InvalidInputError: On all ranks; names what differs between two of them.
    """
    if comm.size == 1:
        return
    digest = hashlib.sha256(repr(list(told.items())).encode()).digest()
    digests = comm.allgather(digest)
    other = next((rank for rank, found in enumerate(digests) if found != digests[0]), 0)
    if other == 0:
        return
    first = comm.bcast(dict(told))
    named = comm.bcast(differences(first, told) or [_order(first, told)], root=other)
    error = InvalidInputError(
        f"all ranks must be given the same, but on rank 0 and rank {other} differ {'; '.join(named)}: build "
        "it from the same numbers on every rank, or on rank 0 alone and send it with comm.bcast"
    )
    agree(comm, error)


def _order(there: Mapping[str, str], here: Mapping[str, str]) -> str:
    """Name where two descriptions stand in different orders."""
    pairs = zip(there, here, strict=True)
    one, other = next(((one, other) for one, other in pairs if one != other), ("", ""))
    return f"the order of entries ({one}, {other})"
