"""Destroy PETSc objects together with the Python object that uses them.

petsc4py frees nothing by itself when a Python reference goes away: PETSc has to be told, and for objects
shared by several ranks by all of them in the same order.
"""

from __future__ import annotations

import weakref
from typing import Any

from mpi4py import MPI

#: Objects of several ranks whose owner is gone on this rank, by the order in which they were registered.
_waiting: dict[int, tuple[Any, ...]] = {}
_registered = 0


def dispose_with(owner: Any, *objects: Any, comm: MPI.Comm = MPI.COMM_SELF) -> None:
    """Destroy PETSc objects when their owner is no longer used.

    Args:
        owner: The Python object that holds them.
        *objects: PETSc objects. They must not refer to the owner.
        comm: Communicator they live on. Objects of one rank are destroyed at once, others by `sweep`; they
            must be registered by all ranks in the same order.
    """
    global _registered
    finalizer: Any
    if comm.size == 1:
        finalizer = weakref.finalize(owner, _destroy, objects)
    else:
        _registered += 1
        finalizer = weakref.finalize(owner, _retire, _registered, objects)
    finalizer.atexit = False


def sweep(comm: MPI.Comm) -> None:
    """Destroy the shared objects that no rank uses any more. Collective on ``comm``."""
    if comm.size == 1:
        return
    everywhere = set.intersection(*map(set, comm.allgather(sorted(_waiting))))
    for number in sorted(everywhere):
        _destroy(_waiting.pop(number))


def _retire(number: int, objects: tuple[Any, ...]) -> None:
    _waiting[number] = objects


def _destroy(objects: tuple[Any, ...]) -> None:
    for part in objects:
        part.destroy()
