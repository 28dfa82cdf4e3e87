"""Destroy PETSc objects together with the Python object that uses them.

petsc4py frees nothing when a Python reference goes away: PETSc objects must be destroyed explicitly, those
shared by several ranks on all of them in the same order.
"""

from __future__ import annotations

import weakref
from collections import Counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc

#: Size of the communicator and index in the order of registration there: the same on all its ranks.
Key = tuple[int, int]

#: Objects of several ranks whose owner is gone on this rank.
_waiting: dict[Key, tuple[tuple[PETSc.Object, ...], object]] = {}
_registered: Counter[int] = Counter()


def dispose_with(
    owner: object, *objects: PETSc.Object, comm: MPI.Comm | None = None, keep: object = None
) -> None:
    """Destroy PETSc objects when their owner is no longer used.

    Args:
        owner: The Python object that holds them.
        *objects: They must not refer to the owner.
        comm: Communicator they live on: that of the scene or of its first ranks, or None for this rank alone.
            Objects of one rank are destroyed at once, others by `sweep`; they must be registered by all ranks
            in the same order.
        keep: An object that must live as long as they do, such as the mesh whose communicator they use.
    """
    finalizer: Any
    if comm is None or comm.size == 1:
        finalizer = weakref.finalize(owner, _destroy, objects, keep)
    else:
        _registered[comm.size] += 1
        finalizer = weakref.finalize(owner, _retire, (comm.size, _registered[comm.size]), objects, keep)
    finalizer.atexit = False


def sweep(comm: MPI.Comm) -> None:
    """Destroy the shared objects that no rank uses any more. Collective on ``comm``."""
    if comm.size == 1:
        return
    waiting = [set(keys) for keys in comm.allgather(sorted(_waiting))]
    for key in sorted(waiting[0]):
        if all(key in keys for keys in waiting[: key[0]]) and key in _waiting:
            _destroy(*_waiting.pop(key))


def _retire(key: Key, objects: tuple[PETSc.Object, ...], keep: object) -> None:
    _waiting[key] = objects, keep


def _destroy(objects: tuple[PETSc.Object, ...], keep: object) -> None:
    for part in objects:
        part.destroy()
